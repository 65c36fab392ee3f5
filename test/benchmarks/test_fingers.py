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
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.fingers import command
from benchmarks.fingers.joints import join, latency_s
from benchmarks.fingers.judging import figures, judge
from benchmarks.fingers.parts import divide
from slip_detector.chain.samples import Samples
from slip_detector.parameters import (
    ChainConfig,
    DetectorConfig,
    EvaluationConfig,
    RecordingConfig,
)
from slip_detector.parameters.files import write_yaml
from slip_detector.recordings import write_recording
from slip_detector.recordings.labels import read_labels
from slip_detector.tuning.tracks import track_of

RATE_HZ = 312.5
CHAIN = ChainConfig(
    sample_rate_hz=RATE_HZ, channels=2, passband_hz=(20.0, 0.0), passband_degree=2,
    stopbands_hz=(), gain=1.0, exponent=1, mains_hz=50.0,
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
    joined, first = join(before, after, RATE_HZ, CHAIN.mains_rows)
    at_joint = np.diff(joined, axis=0)[first - 25 : first + 50]
    assert np.abs(at_joint).max() < 1.1 * np.abs(np.diff(before, axis=0)).max()


def test_latency_counts_from_the_middle_of_a_joint_and_only_where_slip_was_off_before():
    loud = recorded(4.0, [(2.0, 4.0)]).volts
    first = round(2.0 * RATE_HZ) - 12
    assert 0.0 <= latency_s(CHAIN, loud, first, fade_rows=25) < 0.2
    assert latency_s(CHAIN, loud, first + 200, fade_rows=25) is None
    assert latency_s(CHAIN, 0.0 * loud, first, fade_rows=25) == np.inf


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


def test_what_is_always_on_finds_nothing_and_what_tells_slides_does_not_tell_recordings():
    tracks = [recorded(20.0, [(5.0, 7.0), (12.0, 14.0)]), recorded(20.0, kind='press', seed=1)]
    always, found = (
        figures(
            [judge(replace(CHAIN, threshold=v), one, EvaluationConfig(), 25) for one in tracks]
        )
        for v in (1e-9, 0.25)
    )
    assert set(always['on_percent'].values()) == {100.0}
    assert (always['recall'], always['coverage'], always['joints']['slide']) == (0.0, 1.0, 0)
    assert (found['recall'], found['joints_detected_percent']) == (1.0, {'slide': 100, 'rest': 0})
    assert found['auc']['press'] > 0.98
    assert found['auc_of_rest'] == pytest.approx({'between': 0.5, 'press': 0.5}, abs=0.1)


def test_a_run_prints_what_is_documented_of_fingers_that_are_taught_and_that_are_given(
    capsys, tmp_path
):
    slips_s = [(2.0, 3.0), (5.0, 6.0), (8.0, 9.0)]
    for k in range(6):
        track = recorded(11.0, slips_s, seed=k)
        write_recording(tmp_path / f'new/slips/{k}.npz', track.rows(), RATE_HZ, 'ab')
    write_recording(tmp_path / 'new/rest.npz', recorded(20.0).rows(), RATE_HZ, 'ab')
    write_recording(tmp_path / 'known/rest.npz', recorded(20.0).rows(), RATE_HZ, 'ab')
    write_yaml(tmp_path / 'known.yaml', DetectorConfig(**vars(CHAIN)).to_document())
    words = ['fingers', '--json', '--quick', '--data', str(tmp_path)]
    assert main(words) == 0
    result = json.loads(capsys.readouterr().out)
    chains, parts = result['new']['chains'], result['new']['parts']
    assert [len(part['judged_on']) for part in parts] == [4, 4]
    assert (chains['taught']['slips'], chains['beginning']['recall']) == (18, 1.0)
    documented = [*parts[0], *chains, *chains['taught'], *result['known']['chains']]
    assert all(f'``{key}``' in command.__doc__ for key in documented)
    assert 'on_percent, between' in command.as_table({'new': result['new']})
    assert main([*words, '--config', 'other=sure.yaml']) == 1
    assert 'has no recordings of other, allowed: known, new' in capsys.readouterr().err
