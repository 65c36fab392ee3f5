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

"""Real fingers: joints that are no sign of sliding, parts, figures, and what is printed."""

import json

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.fingers import command
from benchmarks.fingers.joints import join, latency_s
from benchmarks.fingers.judging import figures, judge
from benchmarks.fingers.parts import divide
from slip_detector.chain.samples import Samples
from slip_detector.parameters import ChainConfig, EvaluationConfig, RecordingConfig
from slip_detector.recordings.labels import read_labels
from slip_detector.tuning.tracks import track_of

RATE_HZ = 200.0
CHAIN = ChainConfig(
    sample_rate_hz=RATE_HZ, channels=2, passband_hz=(20.0, 0.0), passband_degree=2,
    stopbands_hz=(), gain=1.0, exponent=1, vote='all',
)  # fmt: skip


def finger_at_rest(seconds, seed=0, phase=0.0):
    """Return hum and noise of a finger at rest."""
    rows = round(seconds * RATE_HZ)
    hum = np.sin(2 * np.pi * 50.0 * np.arange(rows) / RATE_HZ + phase)[:, np.newaxis]
    return hum + np.random.default_rng(seed).normal(0.0, 0.05, (rows, 2))


def recorded(seconds, slips_s=(), kind='', seed=0):
    """Return a recording in which noise is ten times as loud while the finger slides."""
    volts, slides = finger_at_rest(seconds, seed), np.zeros(round(seconds * RATE_HZ), bool)
    for start_s, end_s in slips_s:
        slides[round(start_s * RATE_HZ) : round(end_s * RATE_HZ)] = True
    volts[slides] += np.random.default_rng(seed).normal(0.0, 0.5, (slides.sum(), 2))
    rows = Samples.evenly(volts, RATE_HZ, slides, kind=kind)
    return track_of(f'{kind or "slips"}{seed}.npz', [rows], RATE_HZ)


@pytest.mark.parametrize('phase', [0.5, 2.0, 4.0])
def test_a_joint_of_two_rests_is_no_louder_than_they_are(phase):
    before, after = finger_at_rest(3.0), 7.0 + finger_at_rest(3.0, seed=1, phase=phase)
    joined, first = join(before, after, RATE_HZ, fade_rows=4)
    at_joint = np.diff(joined, axis=0)[first - 8 : first + 12]
    assert np.abs(at_joint).max() < 1.1 * np.abs(np.diff(before, axis=0)).max()


def test_latency_counts_from_the_middle_of_a_joint_and_only_where_slip_was_off_before():
    loud = np.where(np.arange(800) >= 500, 1.0, 0.0)[:, np.newaxis] * finger_at_rest(4.0)
    assert 0.0 <= latency_s(CHAIN, loud, first=498, fade_rows=4) < 0.1
    assert latency_s(CHAIN, loud, first=700, fade_rows=4) is None
    assert latency_s(CHAIN, 0.0 * loud, first=498, fade_rows=4) == np.inf


@pytest.mark.parametrize(('with_slips', 'many'), [(1, 2), (3, 3), (6, 2)])
def test_no_row_is_on_both_sides_and_none_is_lost(tmp_path, with_slips, many):
    slips_s = [(2.0, 3.0), (4.0, 5.0), (6.0, 7.0), (8.0, 9.0)]
    tracks = [recorded(10.0, slips_s, seed=k) for k in range(with_slips)]
    tracks += [recorded(9.0, kind='rest'), *(recorded(2.0, kind='press', seed=k) for k in (0, 1))]
    paths = {tmp_path / track.name: track for track in tracks}
    parts = divide(paths, RecordingConfig(), tmp_path)
    every = [path for part in parts for path in part]
    assert (len(parts), len(every)) == (many, len({*every}))
    assert sum(len(part) for part in parts) == len(tracks) - 1 + many + (with_slips == 1)
    first, *others = [path for path in every if path.parent.name == 'rest']
    whole = np.concatenate([np.load(path)['volts'] for path in (first, *others)])
    assert np.array_equal(whole, paths[tmp_path / 'rest0.npz'].volts)
    assert read_labels(first.with_suffix('.labels.yaml')).kind == 'rest'


def test_what_is_always_on_has_areas_of_a_half_and_covers_all_but_finds_nothing():
    tracks = [recorded(20.0, [(5.0, 7.0), (12.0, 14.0)]), recorded(20.0, kind='press')]
    always = ChainConfig(**{**vars(CHAIN), 'valid_range_v': (-1e9, 1e9), 'threshold': 1e-9})
    never = ChainConfig(**{**vars(CHAIN), 'threshold': 1e9})
    on, off = (
        figures([judge(chain, track, EvaluationConfig()) for track in tracks])
        for chain in (always, never)
    )
