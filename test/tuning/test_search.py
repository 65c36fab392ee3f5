"""A search in this process."""

import dataclasses

from slip_detector.tuning.objective import Objective
from slip_detector.tuning.problem import SEARCHED
from slip_detector.tuning.search import search
from support.tuning_cases import CHAIN, problem, track


def test_a_search_finds_what_costs_less_and_keeps_the_rest_of_the_chain():
    given_chain = dataclasses.replace(CHAIN, passband_hz=(60.0, 120.0), stopbands_hz=())
    asked = problem([track(1), track(2)], given_chain)
    study = asked.study(None, 'a', seed=1)
    counts = []
    search(asked, study, 25, lambda: False, counts.append)
    assert counts == list(range(1, 26))
    best = asked.best(study)
    free = Objective(asked.tracks, asked.evaluation, asked.config)
    assert best.cost_ms < free.as_it_is(given_chain).cost_ms - 20.0
    for field in dataclasses.fields(CHAIN):
        if field.name not in SEARCHED:
            assert getattr(best.chain, field.name) == getattr(given_chain, field.name)
    choice = asked.choice(study)
    assert choice.cost_ms <= best.cost_ms + best.error_ms
