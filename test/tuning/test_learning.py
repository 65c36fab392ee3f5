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

"""What is learnt from a recording at rest or of knocks."""

import dataclasses

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import EvaluationConfig, RecordingConfig
from slip_detector.tuning.learning import learn_from_quiet, learn_from_taps, quiet_threshold
from slip_detector.tuning.sensor import impact_step, learnt_floors
from slip_detector.tuning.tracks import track_of
from support.tuning_cases import CHAIN, RATE_HZ, slips, track, write

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


def silent(name):
    return track_of(name, [Samples.evenly(np.zeros((4560, 4)), 380.0, np.zeros(4560))], 380.0)


def alarms_at(chain, recording):
    replay = Replay(chain, scores=False, stages=False)
    return len(replay.run(recording.rows(), recording.sample_rate_hz).alarms)


@pytest.mark.parametrize('chain', [CHAIN, EVIDENCE], ids=['mean', 'evidence'])
@pytest.mark.parametrize('vote', ['all', 'mean', 1])
def test_the_rate_holds_in_the_recording_and_in_another_but_not_below_the_threshold(chain, vote):
    chain = dataclasses.replace(chain, vote=vote)
    recording = track(1, duration_s=600.0, slips=False)
    found = quiet_threshold(recording, chain, 60.0)
    assert found.alarms == alarms_at(found.chain, recording)
    assert found.per_hour[0] <= found.alarms / found.hours <= found.per_hour[1] <= 60.0
    other = track(2, duration_s=600.0, slips=False)
    assert alarms_at(found.chain, other) <= 2 * 10
    lower = dataclasses.replace(found.chain, threshold=found.chain.threshold / 1.5)
    assert alarms_at(lower, recording) / found.hours > 60.0


def test_with_more_data_the_bound_is_nearer_to_the_count():
    spans = []
    for minutes in (5, 30):
        recording = track(3, duration_s=60.0 * minutes, slips=False)
        found = quiet_threshold(recording, CHAIN, 100.0)
        spans.append(found.per_hour[1] - found.alarms / found.hours)
    assert spans[1] < spans[0]


@pytest.mark.parametrize(
    ('recording', 'chain', 'per_hour', 'line'),
    [
        (
            track(5, duration_s=60.0, slips=False),
            CHAIN,
            100.0,
            'seed 5: lasts 0.0167 h, allowed: at least 0.03 h to show a rate of 100 an hour',
        ),
        (track(6), CHAIN, 1000.0, 'seed 6: has slip at 1.503 s'),
        (
            track(5, duration_s=60.0, slips=False),
            dataclasses.replace(EVIDENCE, noise_floor=(1e-6,), noise_floor_range_db=10.0),
            200.0,
            'seed 5: the evidence reaches its limit of 1.3 dB s',
        ),
        (
            track_of(
                'seed 5', [Samples.evenly(np.zeros((4560, 4)), 380.0, np.zeros(4560))], 380.0
            ),
            CHAIN,
            1000.0,
            'seed 5: the chain gives 0 throughout',
        ),
    ],
    ids=['too short', 'slip', 'too noisy', 'a dead sensor'],
)
def test_a_recording_that_cannot_show_the_rate_is_refused(recording, chain, per_hour, line):
    with pytest.raises(ValueError, match=r'^seed') as refused:
        quiet_threshold(recording, chain, per_hour)
    assert line in str(refused.value)


def test_where_rest_makes_no_evidence_the_given_threshold_stays():
    surer = dataclasses.replace(EVIDENCE, noise_floor=(1.0,))
    found = quiet_threshold(track(5, duration_s=60.0, slips=False), surer, 200.0)
    assert found.chain == surer
    assert found.alarms == 0
    assert found.per_hour == (0.0, pytest.approx(180.0, rel=0.01))


GIVEN = dataclasses.replace(CHAIN, exponent=1, decision='evidence', noise_floor=(0.001,))


def recording(path, seconds=60.0, hum=0.0, hum_hz=60.0, knock=0.0, rate_hz=RATE_HZ):
    """Write a recording at rest, with hum or knocks."""
    volts, _ = slips(1, duration_s=seconds, slips=False)
    row = np.arange(len(volts))[:, np.newaxis]
    volts += hum * np.sin(2 * np.pi * hum_hz * row / rate_hz) + knock * (row % 760 == 380)
    np.savez(path, volts=volts, sample_rate_hz=rate_hz)
    return str(path), volts


def learn(path, chain=GIVEN, per_hour=None, of_slips=None):
    loader = RecordingLoader(
        chain, RecordingConfig(recording_truth_key='label'), EvaluationConfig()
    )
    if of_slips is not None:
        learnt = learn_from_taps(path, of_slips, chain, loader)
    else:
        learnt = learn_from_quiet(path, chain, loader, per_hour)
    return learnt.parameters, '\n'.join(learnt.lines)


def test_quiet_learns_a_floor_for_each_channel_and_nothing_else(tmp_path):
    parameters, lines = learn(recording(tmp_path / 'rest.npz')[0])
    assert parameters == {
        'noise_floor': list(learnt_floors(GIVEN, [track(1, duration_s=60.0, slips=False)])),
        'noise_floor_learnt': True,
        'noise_floor_range_db': 15.0,
    }
    assert 'no line of the mains is 12 dB above the noise' in lines


def test_quiet_removes_the_hum_before_it_learns_the_floors(tmp_path):
    humming, lines = learn(recording(tmp_path / 'hum.npz', hum=0.5)[0])
    assert humming['mains_hz'] == 60.0
    assert 'mains of 60 Hz: lines of 60 Hz (' in lines
    quiet, _ = learn(recording(tmp_path / 'rest.npz')[0])
    # The comb makes noise louder by 3 dB; the hum was louder by 20.
    ratios = np.array(humming['noise_floor']) / quiet['noise_floor']
    np.testing.assert_allclose(20.0 * np.log10(ratios), 3.0, atol=0.7)


def test_quiet_sets_the_threshold_of_the_floors_that_it_learnt(tmp_path):
    given = dataclasses.replace(GIVEN, evidence_offset_db=0.5)
    parameters, lines = learn(recording(tmp_path / 'rest.npz')[0], given, per_hour=200.0)
    chain = dataclasses.replace(given, **parameters)
    found = quiet_threshold(track(1, duration_s=60.0, slips=False), chain, 200.0)
    assert parameters['threshold'] == found.chain.threshold != given.threshold
    assert 'at 95% confidence' in lines


def test_hum_without_whole_periods_is_reported_and_not_removed(tmp_path):
    other = dataclasses.replace(GIVEN, sample_rate_hz=377.7)
    path, _ = recording(tmp_path / 'hum.npz', hum=1.0, hum_hz=50.0, rate_hz=377.7)
    parameters, lines = learn(path, other)
    assert 'mains_hz cannot remove it' in lines
    assert 'mains_hz' not in parameters


def test_with_the_decision_of_the_paper_only_the_threshold_is_set(tmp_path):
    path, _ = recording(tmp_path / 'hum.npz', hum=0.5)
    parameters, lines = learn(path, CHAIN, per_hour=200.0)
    assert parameters.keys() == {'threshold'}
    assert 'mains_hz: 60 would remove it' in lines


def test_taps_set_a_step_between_knocks_and_slips(tmp_path):
    path, volts = recording(tmp_path / 'knocks.npz', knock=20.0)
    parameters, lines = learn(path, of_slips=[write(tmp_path / 'slips.npz', 2)])
    knocks = track_of('knocks', [Samples.evenly(volts, 380.0, np.zeros(len(volts)))], 380.0)
    assert parameters == {'impact_v': impact_step(GIVEN, knocks, [track(2)]).impact_v}
    assert '30 knocks' in lines


@pytest.mark.parametrize(
    ('what', 'line'),
    [
        ({'chain': CHAIN}, 'parameter decision is mean, allowed: evidence, whose noise floors'),
        ({'chain': CHAIN, 'of_slips': []}, 'parameter decision is mean, allowed: evidence, which'),
        ({}, 'short.npz: lasts 4 s, allowed: at least 5 s at rest'),
    ],
    ids=['floors for a mean', 'impacts for a mean', 'too short for floors'],
)
def test_what_cannot_be_learnt_is_refused(what, line, tmp_path):
    path, _ = recording(tmp_path / 'short.npz', seconds=4.0)
    with pytest.raises(ValueError, match=line):
        learn(path, **what)
