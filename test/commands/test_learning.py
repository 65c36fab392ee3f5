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

"""What ``slip_tune --quiet`` and ``--taps`` write."""

import dataclasses

import numpy as np
import pytest

from slip_detector.commands.tune import main
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.impacts import impact_step
from slip_detector.tuning.noise import learnt_floors
from support.tuning_cases import RATE_HZ, slips, track, write

EVIDENCE = """/**/slip_detector:
  ros__parameters:
    channels: 4
    gain: 1.0
    exponent: 1
    decision: evidence
    noise_floor: [0.001]
"""

LABELS = '/**/slip_driver: {ros__parameters: {recording_truth_key: label}}\n'

HUM = 0.5


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'given.yaml').write_text(EVIDENCE + LABELS)
    volts, _ = slips(1, duration_s=60.0, slips=False)
    np.savez('rest.npz', volts=volts, sample_rate_hz=RATE_HZ)
    knocks = (np.arange(len(volts)) % 760 == 380)[:, np.newaxis]
    hum = np.sin(2 * np.pi * 60.0 * np.arange(len(volts)) / RATE_HZ)
    np.savez('hum.npz', volts=volts + HUM * hum[:, np.newaxis], sample_rate_hz=RATE_HZ)
    np.savez('soft.npz', volts=volts + 0.7 * knocks, sample_rate_hz=RATE_HZ)
    volts += 20.0 * knocks
    np.savez('knocks.npz', volts=volts, sample_rate_hz=RATE_HZ)
    write('slips.npz', 2)
    return tmp_path


def run(*words, code=0):
    assert main([*words, '--config', 'given.yaml', '--out', 'out.yaml']) == code


def given_and_written():
    return ChainConfig.from_yaml('given.yaml'), ChainConfig.from_yaml('out.yaml')


def test_quiet_writes_a_floor_for_each_channel_and_nothing_else(folder, capsys):
    run('--quiet', 'rest.npz')
    given, written = given_and_written()
    floors = learnt_floors(given, [track(1, duration_s=60.0, slips=False)])
    assert written == dataclasses.replace(
        given, noise_floor=floors, noise_floor_learnt=True, noise_floor_range_db=15.0
    )
    assert 'no line of the mains is 12 dB above the noise' in capsys.readouterr().out


def test_quiet_takes_the_hum_off_before_it_learns_the_floors(folder, capsys):
    run('--quiet', 'hum.npz')
    written = ChainConfig.from_yaml('out.yaml')
    assert written.mains_hz == 60.0
    assert 'mains of 60 Hz: lines of 60 Hz (' in capsys.readouterr().out
    run('--quiet', 'rest.npz')
    quiet = ChainConfig.from_yaml('out.yaml')
    # The comb makes noise louder by 3 dB; the hum was louder by 20.
    ratios = np.array(written.noise_floor) / quiet.noise_floor
    np.testing.assert_allclose(20.0 * np.log10(ratios), 3.0, atol=0.7)


def test_quiet_sets_the_threshold_of_the_floors_that_it_learnt(folder, capsys):
    (folder / 'given.yaml').write_text(EVIDENCE + '    evidence_offset_db: 0.5\n' + LABELS)
    run('--quiet', 'rest.npz', '--false-alarms-per-hour', '200')
    given, written = given_and_written()
    assert written.threshold != given.threshold
    assert written.noise_floor_learnt
    assert 'at 95% confidence' in capsys.readouterr().out


def test_a_recording_that_is_too_short_for_floors_is_refused(folder, capsys):
    np.savez('short.npz', volts=slips(1, duration_s=4.0, slips=False)[0], sample_rate_hz=RATE_HZ)
    run('--quiet', 'short.npz', code=1)
    assert 'short.npz: lasts 4 s, allowed: at least 5 s at rest' in capsys.readouterr().err
    assert not (folder / 'out.yaml').exists()


def test_a_mains_without_whole_periods_is_told_and_not_written(folder, capsys):
    (folder / 'given.yaml').write_text(EVIDENCE + '    sample_rate_hz: 377.7\n' + LABELS)
    with np.load('hum.npz') as recording:
        time_s = np.arange(len(recording['volts'])) / 377.7
        volts = recording['volts'] + np.sin(2 * np.pi * 50.0 * time_s)[:, np.newaxis]
    np.savez('other.npz', volts=volts, sample_rate_hz=377.7)
    run('--quiet', 'other.npz')
    assert 'mains_hz cannot remove it' in capsys.readouterr().out
    assert ChainConfig.from_yaml('out.yaml').mains_hz == 0.0


def test_taps_write_a_step_between_knocks_and_slips(folder, capsys):
    run('slips.npz', '--taps', 'knocks.npz')
    given, written = given_and_written()
    with np.load('knocks.npz') as recording:
        volts = recording['volts']
    knocks = track(1, duration_s=60.0, slips=False)._replace(volts=volts)
    expected = impact_step(given, knocks, [track(2)]).impact_v
    assert written == dataclasses.replace(given, impact_v=expected)
    assert '30 knocks' in capsys.readouterr().out


def test_knocks_that_are_no_louder_than_slips_write_nothing(folder, capsys):
    run('slips.npz', '--taps', 'soft.npz', code=1)
    error = capsys.readouterr().err
    assert 'soft.npz: its knocks cannot be told from slips' in error
    assert error.count('\n') == 1
    assert not (folder / 'out.yaml').exists()


def test_with_the_paper_s_decision_the_mains_is_told_and_only_the_threshold_written(
    folder, capsys
):
    (folder / 'given.yaml').write_text(EVIDENCE.replace('evidence', 'mean') + LABELS)
    run('--quiet', 'hum.npz', '--false-alarms-per-hour', '200')
    given, written = given_and_written()
    assert written == dataclasses.replace(given, threshold=written.threshold)
    assert written.threshold != given.threshold
    assert 'mains_hz: 60 would remove it' in capsys.readouterr().out
