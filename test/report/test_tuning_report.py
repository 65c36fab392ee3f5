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

"""The report of a search."""

from types import SimpleNamespace

from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.report.tuning_report import replay_tracks, write_tuning_report
from support import tuning_cases

TRACKS = [tuning_cases.track(seed, duration_s=6.0) for seed in (0, 1)]


def test_a_chain_is_replayed_on_every_recording_and_seen_where_it_is_to_be_shown():
    config = EvaluationConfig()
    bare = replay_tracks(tuning_cases.CHAIN, TRACKS, config, shown=False)
    seen = replay_tracks(tuning_cases.CHAIN, TRACKS, config, shown=True)
    assert bare.overviews == []
    assert [overview.name for overview in seen.overviews] == ['seed 0', 'seed 1']
    for overview, outcome, alone in zip(seen.overviews, seen.outcomes, bare.outcomes, strict=True):
        assert figures_of_merit([outcome]) == figures_of_merit([alone])
        slips = [event for event in overview.events if event.kind != 'false alarm']
        assert len(slips) == len(outcome.slips) > 0


def test_held_out_recordings_are_told_from_those_tuned_on_and_each_trial_is_counted(tmp_path):
    given = replay_tracks(tuning_cases.CHAIN, TRACKS, EvaluationConfig(), shown=True)
    figures = {
        'held out': [figures_of_merit(given.outcomes[:1])] * 2,
        'tuned on': [figures_of_merit(given.outcomes[1:])] * 2,
    }
    figures_found = {
        'latency_median_ms': 40.0, 'false_alarms_per_minute': 1.0, 'false_time_percent': 0.5,
        'sooner_than_chance': 1.0,
    }  # fmt: skip
    found = {'parameters': {'threshold': 0.1}, 'figures': figures_found}
    study = SimpleNamespace(
        trials=[
            SimpleNamespace(number=0, user_attrs={'found': [found]}),
            SimpleNamespace(number=1, user_attrs={'found': []}),
        ]
    )
    page = tmp_path / 'page.html'
    notes = ['A note.', '  of the table']
    written = write_tuning_report(page, None, notes, given, given, TRACKS[:1], figures, study)
    assert written == [page]
    text = page.read_text(encoding='utf-8')
    for words in ('seed 0 (held out)', 'seed 1 (tuned on)', 'all held out', '1 trials', 'A note.'):
        assert words in text
    assert 'of the table' not in text
