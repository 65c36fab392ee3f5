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

"""The recordings of a real finger, evaluated as its configuration says."""

from pathlib import Path

import numpy as np
import pytest
import yaml

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from support.evaluation_cases import report_of, roc_auc

ROOT = Path(__file__).parents[2]
XELA_CONFIG = ROOT / 'config' / 'xela_uskin.yaml'
XELA = ROOT.parent / 'shared' / 'data' / 'xela_uskin_slip'

needs_xela = pytest.mark.skipif(not XELA.is_dir(), reason=f'no recordings at {XELA}')


def test_the_configuration_of_the_real_finger_suits_every_node():
    detector = DetectorConfig.from_yaml(XELA_CONFIG)
    recording = RecordingConfig.from_yaml(XELA_CONFIG)
    evaluate = EvaluationConfig.from_yaml(XELA_CONFIG)
    assert (detector.channels, detector.sample_rate_hz) == (96, 60.0)
    assert detector.groups == {'y': tuple(range(2, 97, 3))}
    assert set(detector.disabled_channels) == set(range(1, 97)) - set(detector.groups['y'])
    assert recording.recording_volts_key == 'tactile'
    assert evaluate.motion_columns == ('v_x', 'v_y')
    sections = yaml.safe_load(XELA_CONFIG.read_text(encoding='utf-8'))
    assert list(sections) == ['/**/slip_detector', '/**/slip_driver', '/**/slip_evaluate']


@needs_xela
def test_the_real_finger_is_told_sliding_from_holding_and_from_moving(capsys):
    report = report_of(capsys, XELA, '--config', XELA_CONFIG)['xela_uskin_slip']
    assert len(report['recordings']) == 7
    assert (report['rows'], report['slip_rows'], report['moving_rows']) == (2195, 196, 1512)
    # What a detector that knows nothing else reaches (the README of the data).
    assert report['auc_all'] > 0.91
    assert report['auc_moving'] > 0.85
    # What the configuration says of itself.
    assert report['auc_all'] == pytest.approx(0.969, abs=1e-3)
    assert report['auc_moving'] == pytest.approx(0.953, abs=1e-3)
    within = [part['auc_moving'] for part in report['recordings'].values() if part['slip_rows']]
    assert within == pytest.approx([0.965, 0.783, 0.946], abs=2e-3)
    assert (report['slips'], report['settling_slips'], report['matched']) == (4, 0, 3)
    assert (report['false_alarms'], report['rest_s']) == (2, pytest.approx(28.2, abs=0.1))
    assert report['false_time_percent'] == pytest.approx(4.6, abs=0.1)
    found = [slip for part in report['recordings'].values() for slip in part['slip_events']]
    latencies_s = sorted(slip['latency_s'] for slip in found if slip['latency_s'] is not None)
    assert latencies_s == pytest.approx([0.033, 0.150, 0.318], abs=1e-3)


@needs_xela
def test_a_threshold_that_is_too_low_detects_nothing(capsys, tmp_path):
    low = tmp_path / 'low.yaml'
    given = XELA_CONFIG.read_text(encoding='utf-8')
    low.write_text(given.replace('threshold: 0.5', 'threshold: 0.1'), encoding='utf-8')
    report = report_of(capsys, XELA, '--config', low)['xela_uskin_slip']
    assert (report['matched'], report['false_alarms'], report['success_percent']) == (0, 13, 100.0)
    assert report['sooner_than_chance'] < 0.0
    assert report['false_time_percent'] == pytest.approx(12.0, abs=0.1)


@needs_xela
def test_what_the_configuration_says_of_the_data_is_so():
    config = ChainConfig.from_yaml(XELA_CONFIG)
    speeds, slips, decisions = [], [], []
    for path in sorted(XELA.glob('*.npz')):
        with np.load(path) as file:
            names = list(file['robot_state_names'])
            columns = file['robot_state'][:, [names.index('v_x'), names.index('v_y')]]
            speeds.append(np.hypot(*columns.T.astype(float)))
            slips.append(file['slip'] == 1)
            decisions.append(SlipChain(config).update(file['tactile']).slip)
            axes = [name[-1] for name in file['taxel_names']]
    assert {axes[channel - 1] for channel in config.groups['y']} == {'y'}
    speed, slip, on = (np.concatenate(parts) for parts in (speeds, slips, decisions))
    moving = speed > 0.01
    assert roc_auc(speed, slip) == pytest.approx(0.878, abs=1e-3)
    assert roc_auc(speed[slip | moving], slip[slip | moving]) == pytest.approx(0.814, abs=1e-3)
    assert on[slip].mean() == pytest.approx(0.76, abs=0.01)
    assert on[moving & ~slip].mean() == pytest.approx(0.075, abs=0.01)
