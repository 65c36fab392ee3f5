# Copyright 2026 The slip_detector maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""A search in this process."""

import dataclasses

from slip_detector.tuning.objective import Objective
from slip_detector.tuning.problem import searched
from slip_detector.tuning.search import search
from support.tuning_cases import CHAIN, problem, track


def test_a_search_finds_what_costs_less_and_keeps_the_rest_of_the_chain():
    given_chain = dataclasses.replace(CHAIN, passband_hz=(60.0, 120.0), stopbands_hz=())
    asked = problem([track(1), track(2)], given_chain)
    study = asked.study(None, 'a', seed=1)
    counts = []
    search(asked, study, 25, lambda: False, counts.append)
    assert counts == sorted(counts)
    assert set(counts) == set(range(1, 26))
    best = asked.best(study)
    free = Objective(asked.tracks, asked.evaluation, asked.config)
    assert best.cost_ms < free.as_it_is(given_chain).cost_ms - 20.0
    for field in dataclasses.fields(CHAIN):
        if field.name not in searched(best.chain):
            assert getattr(best.chain, field.name) == getattr(given_chain, field.name)
    choice = asked.choice(study)
    assert choice.cost_ms <= best.cost_ms + best.error_ms


def test_the_order_in_which_a_batch_is_done_changes_nothing():
    asked = problem([track(1)])
    objective = asked.objective()

    def in_order(points):
        return [
            (place, asked.candidates_at(objective, point)) for place, point in enumerate(points)
        ]

    found = []
    for results in (None, in_order, lambda points: in_order(points)[::-1]):
        study = asked.study(None, 'a', seed=1)
        search(asked, study, 24, lambda: False, lambda count: None, results)
        found.append(
            [(trial.params, trial.values, trial.user_attrs['found']) for trial in study.trials]
        )
    assert len(found[0]) > 15
    assert found[0] == found[1] == found[2]


def test_a_wish_to_stop_leaves_the_rest_of_a_batch_untold(tmp_path):
    asked = problem([track(1)])
    study = asked.study(str(tmp_path / 'a.journal'), 'a', seed=1)
    counts = []
    search(asked, study, 20, lambda: len(counts) >= 3, counts.append)
    assert study.follow() == 3
