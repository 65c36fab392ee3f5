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

import re
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.__main__ import main
from benchmarks.fingers.joints import join
from benchmarks.fingers.judging import figures, judge
from benchmarks.fingers.parts import divide
from slip_detector.chain.samples import Samples
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters import ChainConfig, DetectorConfig, EvaluationConfig, RecordingConfig
from slip_detector.parameters.yaml_files import write_yaml
from slip_detector.recordings import write_recording
from slip_detector.tuning.tracks import load_tracks, track_of

RATE_HZ, SLIPS_S = 312.5, ((2.0, 3.0), (5.0, 6.0), (8.0, 9.0))
CHAIN = ChainConfig(
    sample_rate_hz=RATE_HZ, channels=2, passband_hz=(20.0, 0.0), passband_degree=2,
    stopbands_hz=(), gain=1.0, exponent=1, mains_hz=50.0, threshold=0.25,
)  # fmt: skip


def recorded(seconds, slips_s=(), kind='', seed=0, phase=0.0):
    """Return a recording of hum and noise, which is ten times as loud while the finger slides."""
    time_s = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    slides = sum((time_s >= start_s) & (time_s < end_s) for start_s, end_s in slips_s)
    loud = np.where(slides, 0.5, 0.05) * np.ones_like(time_s)
    noise = np.random.default_rng(seed).normal(0.0, loud, (2, time_s.size))
    volts = (np.sin(2 * np.pi * 50.0 * time_s + phase) + noise).T
    rows = Samples.evenly(volts, RATE_HZ, loud > 0.1, kind=kind)
    return track_of(f'{kind or "slips"}{seed}.npz', [rows], RATE_HZ)


@pytest.mark.parametrize('phase', [0.5, 2.0, 4.0])
def test_a_joint_of_two_rests_is_no_louder_than_they_are(phase):
    before, after = recorded(3.0).volts, 7.0 + recorded(3.0, seed=1, phase=phase).volts
    joined, first = join(before, after, RATE_HZ, CHAIN.mains_rows)
    at_joint = np.diff(joined, axis=0)[first - 25 : first + 50]
    assert np.abs(at_joint).max() < 1.1 * np.abs(np.diff(before, axis=0)).max()


@pytest.mark.parametrize(('with_slips', 'many'), [(1, 2), (3, 3), (6, 2)])
def test_no_recording_is_in_two_parts_and_what_is_cut_loses_nothing(tmp_path, with_slips, many):
    tracks = [recorded(11.0, SLIPS_S, seed=k) for k in range(with_slips)]
    tracks += [recorded(9.0, kind='rest'), *(recorded(2.0, kind='press', seed=k) for k in (0, 1))]
    whole = {tmp_path / track.name: track for track in tracks}
    parts = divide(whole, RecordingConfig(), tmp_path)
    every = [path for part in parts for path in part]
    assert (len(parts), len({*every})) == (many, len(every))
    new = load_tracks([str(path) for path in {*every} - {*whole}], RecordingLoader(CHAIN))
    was = [whole[path] for path in {*whole} - {*every}]
    assert {one.kind for one in new} == {one.kind for one in was}
    a, b = ([(len(one.volts), len(one.slips)) for one in each] for each in (new, was))
    assert np.array_equal(np.sum(a, axis=0), np.sum(b, axis=0))


def test_what_is_always_on_finds_nothing_and_what_tells_slides_does_not_tell_recordings():
    tracks, config = [recorded(11.0, SLIPS_S), recorded(20.0, kind='press')], EvaluationConfig()
    chains = replace(CHAIN, threshold=1e-9), CHAIN
    on, found = (figures([judge(one, track, config, 25) for track in tracks]) for one in chains)
    assert {v for name, v in on.items() if name.endswith('on_percent')} == {100.0}
    assert (on['recall'], on['coverage'], on['joints_of_slide']) == (0.0, 1.0, 0)
    assert (found['recall'], 0.0 < found['joints_of_slide_ms'] < 150.0) == (1.0, True)
    assert (found['joints_of_rest_detected_percent'], found['press_auc'] > 0.98) == (0.0, True)
    assert found['press_auc_of_rest'] == pytest.approx(0.5, abs=0.1)


def test_a_run_prints_a_table_of_a_finger_and_refuses_one_that_is_not_there(capsys, tmp_path):
    for name, slips_s in [('rest', ()), *((f'slips/{k}', SLIPS_S) for k in range(6))]:
        track = recorded(11.0, slips_s, seed=len(name))
        write_recording(tmp_path / f'new/{name}.npz', track.rows(), RATE_HZ, 'ab')
    words = ['fingers', '--quick', '--data', str(tmp_path)]
    assert main(words) == 0
    assert re.search(
        r'new\n +taught +paper +beginning .* part 2\n +slips +18 ', capsys.readouterr().out
    )
    write_yaml(tmp_path / 'new.yaml', DetectorConfig(**vars(CHAIN)).to_document())
    assert main([*words, '--judge']) == 0
    assert re.search(
        r'new\n +given\n +slips +18\n[^$]* slips/5.npz +[0-9.]+$', capsys.readouterr().out
    )
    assert main([*words, '--config', 'other=sure.yaml']) == 1
    assert 'has no folder other, allowed: new' in capsys.readouterr().err
