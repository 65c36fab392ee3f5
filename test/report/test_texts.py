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

"""What is said of figures: sentences that are true of good and bad detectors, and tables."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.evaluation.evaluator import EvaluatedRecording, recording_figures
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.recordings import RecordingCounts
from slip_detector.report.texts import (
    COMPARABLE,
    LEGEND,
    TABLES,
    answer,
    bad_recordings,
    compare,
    evaluation_tables,
)
from support.replay_cases import CONFIG, RATE_HZ, ridges

GOOD = figures_of_merit([]) | {
    'slips': 6, 'matched': 6, 'missed': 0, 'recall': 1.0, 'sooner_than_chance': 1.0,
    'recall_by_chance': 0.0, 'coverage': 0.9, 'latency_median_ms': 71.4,
    'latency_median_all_ms': 71.4, 'rest_on_percent': 0.0, 'taps_on_percent': 0.0,
    'press_on_percent': 0.0, 'false_time_percent': 0.0, 'false_alarms_per_minute': 0.0,
}  # fmt: skip
ON_OFTEN = {'rest_on_percent': 18.9, 'taps_on_percent': 28.3, 'press_on_percent': 22.0}
SOME = GOOD | ON_OFTEN | {'matched': 4, 'missed': 2, 'recall': 4 / 6, 'false_time_percent': 21.0}
BY_HAND = {'latency_accuracy_ms': 350.0, 'latency_median_ms': 0.0}
GUESSES = GOOD | {'sooner_than_chance': -0.1, 'false_time_percent': 45.0}
QUIET = 'ON at rest 0 %, taps 0 %, presses 0 %.'

#: Figures, those before, and what is said of them.
SAID = [
    (GOOD, SOME, 'Finds 6 of 6 slips (before: 4), some 71 ms after they begin. '
     'ON at rest 19 % → 0, taps 28 % → 0, presses 22 % → 0.'),
    (GOOD, GUESSES | {'matched': 5},
     f'Finds 6 of 6 slips (before: 5 by guessing), some 71 ms after they begin. {QUIET}'),
    (GOOD | {'recall': 0.9, 'rest_on_percent': 0.9}, GOOD, 'Finds 6 of 6 slips, some 71 ms after '
     'they begin. ON at rest 0 % → 0.9 %, taps 0 %, presses 0 %. '
     'Worse: share found 1.000 → 0.900, ON at rest 0.00 → 0.90 %.'),
    (GOOD | {'matched': 1, 'missed': 1}, None, 'Finds 1 of 2 slips, some 71 ms after it begins. '
     f'{QUIET} False alarms: 0 a minute.'),
    (SOME | BY_HAND, None, 'Finds 4 of 6 slips, within 0.35 s, as far as the labels tell. '
     'ON at rest 19 %, taps 28 %, presses 22 %. False alarms: 0 a minute.'),
    (GUESSES | {'false_alarms_per_minute': 33.0}, None, 'Finds 6 of 6 slips, no better than '
     'guessing. ON without slip 45 %, at rest 0 %, taps 0 %, presses 0 %. '
     'False alarms: 33 a minute.'),
]  # fmt: skip


@pytest.mark.parametrize(('after', 'before', 'said'), SAID)
def test_it_says_what_holds_before_and_after_and_what_got_worse(after, before, said):
    assert ' '.join(answer(after, before)) == said


def figures_at(threshold, volts, truth):
    """Return the figures of a quick chain on some rows."""
    chain = dataclasses.replace(CONFIG, threshold=threshold)
    return figures_of_merit([Replay(chain).run([Samples.evenly(volts, RATE_HZ, truth)])])


def test_what_is_always_on_or_never_finds_nothing_and_without_slips_there_is_nothing_to_find():
    volts, truth = ridges((700, 900), (1500, 1700))
    (always,), (never,) = (answer(figures_at(at, volts, truth)) for at in (1e-30, 1e30))
    assert always.startswith('Finds none of 2 slips. It was ON already before 2 of them. ON wit')
    assert always.endswith(' 100 %.')
    assert never == 'Finds none of 2 slips. ON without slip 0 %. False alarms: 0 a minute.'
    (rest,) = answer(figures_at(1.0, *ridges()))
    assert rest == 'No slips to find. ON without slip 0 %. False alarms: 0 a minute.'


@given(st.floats(-12.0, 0.0), st.integers(0, 9))
def test_of_noise_nothing_reads_as_good(power, seed):
    volts = np.random.default_rng(seed).normal(size=(4000, 4))
    (said,) = answer(figures_at(10.0**power, volts, np.arange(4000) // 400 % 3 == 1))
    assert any(words in said for words in ('guessing', 'Finds none', 'Finds 1 of'))


def test_the_worst_recording_and_what_is_damaged_are_named():
    volts, truth = ridges((700, 900))
    outcome = Replay(CONFIG).run([Samples.evenly(volts, RATE_HZ, truth)])
    every = [EvaluatedRecording(outcome, RecordingCounts(damage=what)) for what in ('', 'cut off')]
    good, cut = (recording_figures([one]) | {'lost': one.counts.damage} for one in every)
    assert bad_recordings({'a': good, 'b': cut, 'c': cut}) == ['b, c: cut off']
    worst, fault = bad_recordings({'a': good, 'b': {**good, 'matched': 0, 'missed': 1}, 'c': cut})
    assert worst.startswith('Worst: b. Finds none of 1 slip')
    assert fault == 'c: cut off'
    unlabelled = recording_figures([every[0]._replace(labelled=False)])
    assert answer(unlabelled)[0].startswith('ON 10 % of the time: without labels nobody knows')


def evaluated(value, **figures):
    names = [name for figures in TABLES.values() for name in figures]
    return {**dict.fromkeys(names, value), 'labelled': True, **figures}


def test_only_what_says_something_is_in_the_tables():
    slips = evaluated(None, slips=2, missed=0, recall=1.0, rest_s=30.0, onsets=2)
    rest = evaluated(None, slips=0, missed=0, rest_s=60.0, false_time_percent=0.0)
    sets = {'a': {**slips, 'recordings': {'1.npz': slips}}, 'b': {'recordings': {'2.npz': rest}}}
    report = {'answer': ['Good.'], 'sets': sets, 'all': slips}
    sets['b'] |= rest
    assert [line.split() for line in evaluation_tables(report).splitlines() if line] == [
        ['Good.'],
        ['slips', 'slips', 'share', 'found'],
        *([*name.split(), '2', '1.000'] for name in ('a/1.npz', 'all of a', 'all recordings')),
        ['rest', '[s]', 'ON', 'without', 'slip', '[%]'],
        ['a/1.npz', '30.0', '-'],
        ['b/2.npz', '60.0', '0.00'],
        *(f'{of} {s}'.split() for of, s in (('all of a', '30.0 -'), ('all of b', '60.0 0.00'))),
        ['all', 'recordings', '30.0', '-'],
        LEGEND.split(),
    ]
    assert '\ndecisions ' in evaluation_tables(report, verbose=True)


def test_without_labels_it_says_when_it_is_on_and_how_to_label():
    one = evaluated(None, labelled=False, on_intervals_s=[[0.5, 1.25]])
    two = {**one, 'on_intervals_s': []}
    whole = {**one, 'recordings': {'a': one, 'b': two}}
    report = {'answer': [], 'sets': {'x': whole}, 'all': whole, 'note': 'how to label'}
    lines = ['a: ON from 0.500 to 1.250 s', 'b: never ON', 'how to label']
    assert evaluation_tables(report).splitlines() == lines


def test_two_sets_of_figures_are_beside_each_other_and_better_or_worse_as_a_search_decides():
    known = dict.fromkeys(COMPARABLE, 1.0) | {'latency_accuracy_ms': 0.0}
    before = {**known, 'recall': 0.5, 'press_on_percent': 30.0, 'coverage': 0.996}
    after = {**known, 'recall': 0.75, 'press_on_percent': None, 'latency_worst_ms': -120.0}
    assert compare(before, after) == [
        ('share found', '0.500', '0.750', 'better'),
        # A search takes these for equal.
        ('ON during slips', '0.996', '1.000', ''),
        ('latency worst [ms]', '1.0', 'ON 120.0 before', ''),
        ('ON in presses [%]', '30.00', '-', 'worse'),
    ]
