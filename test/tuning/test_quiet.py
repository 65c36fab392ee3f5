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

"""A threshold from a recording without slip."""

import dataclasses

import numpy as np
import pytest

from slip_detector.commands.tune import main
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.quiet import quiet_threshold
from support.tuning_cases import CHAIN, PARAMETERS, track, write


def alarms_at(chain, recording):
    replay = Replay(chain, scores=False, stages=False)
    return len(replay.run(recording.rows(), recording.sample_rate_hz).alarms)


@pytest.mark.parametrize('vote', ['all', 'mean', 1])
def test_the_rate_holds_in_the_recording_and_in_another(vote):
    chain = dataclasses.replace(CHAIN, vote=vote)
    recording = track(1, duration_s=600.0, slips=False)
    found = quiet_threshold(recording, chain, 60.0, np.random.default_rng(0))
    assert not found.extrapolated
    assert found.alarms == alarms_at(found.chain, recording)
    assert found.alarms / found.hours <= 60.0
    assert found.per_hour[0] <= found.alarms / found.hours <= found.per_hour[1] <= 60.0
    other = track(2, duration_s=600.0, slips=False)
    assert alarms_at(found.chain, other) <= 2 * 10
    lower = dataclasses.replace(found.chain, threshold=found.chain.threshold / 1.5)
    assert alarms_at(lower, recording) / found.hours > 60.0


def test_more_data_is_surer():
    spans = []
    for minutes in (5, 30):
        recording = track(3, duration_s=60.0 * minutes, slips=False)
        found = quiet_threshold(recording, CHAIN, 100.0, np.random.default_rng(0))
        spans.append(found.per_hour[1] - found.alarms / found.hours)
    assert spans[1] < spans[0]


def test_a_rate_beyond_the_data_is_extrapolated_and_said_to_be():
    recording = track(4, duration_s=1200.0, slips=False)
    found = quiet_threshold(recording, CHAIN, 2.0, np.random.default_rng(0))
    assert found.extrapolated
    low, high = found.per_hour
    assert low < 2.0 < high
    assert 'can only show fewer than 8.99 an hour' in str(found)
    counted = quiet_threshold(recording, CHAIN, 30.0, np.random.default_rng(0))
    assert found.chain.threshold > counted.chain.threshold


def test_what_cannot_be_known_is_refused():
    recording = track(5, duration_s=60.0, slips=False)
    with pytest.raises(ValueError, match=r'seed 5: lasts 0.0167 h, allowed: at least 0.05 h'):
        quiet_threshold(recording, CHAIN, 1.0, np.random.default_rng(0))
    with pytest.raises(ValueError, match='seed 5: has 60 blocks of 1 s with a peak, allowed: 300'):
        quiet_threshold(recording, CHAIN, 10.0, np.random.default_rng(0))
    with pytest.raises(ValueError, match=r'seed 6: has slip at 1\.503 s'):
        quiet_threshold(track(6), CHAIN, 1000.0, np.random.default_rng(0))


def test_the_command_writes_only_another_threshold(tmp_path, capsys):
    (tmp_path / 'given.yaml').write_text(PARAMETERS)
    quiet = write(tmp_path / 'quiet.npz', 1, label=False, duration_s=300.0, slips=False)
    out = tmp_path / 'out.yaml'
    words = ['--quiet', quiet, '--false-alarms-per-hour', '120', '--out', str(out)]
    assert main([*words, '--config', str(tmp_path / 'given.yaml')]) == 0
    tuned = ChainConfig.from_yaml(out)
    assert tuned.threshold != CHAIN.threshold
    assert dataclasses.replace(tuned, threshold=CHAIN.threshold) == CHAIN
    assert 'at 95% confidence' in capsys.readouterr().out
    assert 'at 95% confidence' in out.read_text()


EVIDENCE = dataclasses.replace(
    CHAIN,
    decision='evidence',
    passband_hz=(60.0, 0.0),
    passband_degree=2,
    stopbands_hz=(),
    exponent=1,
    noise_floor=(0.01,),
    evidence_offset_db=4.0,
    vote=1,
)


def test_a_threshold_of_evidence_is_found_in_decibel_seconds():
    recording = track(1, duration_s=600.0, slips=False)
    found = quiet_threshold(recording, EVIDENCE, 60.0, np.random.default_rng(0))
    assert 0.0 < found.chain.threshold < EVIDENCE.evidence_limit_db_s
    assert found.alarms == alarms_at(found.chain, recording)
    assert found.per_hour[1] <= 60.0
    lower = dataclasses.replace(found.chain, threshold=found.chain.threshold / 1.5)
    assert alarms_at(lower, recording) / found.hours > 60.0


def test_evidence_that_is_at_its_limit_at_rest_has_no_threshold():
    deaf = dataclasses.replace(EVIDENCE, noise_floor=(1e-6,), noise_floor_range_db=10.0)
    recording = track(5, duration_s=60.0, slips=False)
    with pytest.raises(ValueError, match=r'seed 5: the evidence reaches its limit of 1\.3 dB s'):
        quiet_threshold(recording, deaf, 100.0, np.random.default_rng(0))


def test_where_rest_makes_no_evidence_the_given_threshold_stays():
    surer = dataclasses.replace(EVIDENCE, noise_floor=(1.0,))
    recording = track(5, duration_s=60.0, slips=False)
    found = quiet_threshold(recording, surer, 200.0, np.random.default_rng(0))
    assert found.chain == surer
    assert found.alarms == 0
    assert found.per_hour == (0.0, pytest.approx(180.0, rel=0.01))
    with pytest.raises(ValueError, match=r'seed 5: has 0 blocks of 1\.825 s with a peak'):
        quiet_threshold(recording, surer, 100.0, np.random.default_rng(0))
