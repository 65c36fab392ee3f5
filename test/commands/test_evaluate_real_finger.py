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

import pytest

from support.evaluation_cases import report_of

ROOT = Path(__file__).parents[2]
XELA_CONFIG = ROOT / 'config' / 'xela_uskin.yaml'
XELA = ROOT.parent / 'shared' / 'data' / 'xela_uskin_slip'

needs_xela = pytest.mark.skipif(not XELA.is_dir(), reason=f'no recordings at {XELA}')


@needs_xela
def test_the_real_finger_is_told_sliding_from_holding_and_from_moving(capsys):
    report = report_of(capsys, XELA, '--config', XELA_CONFIG)['xela_uskin_slip']
    assert len(report['recordings']) == 7
    assert (report['rows'], report['slip_rows'], report['moving_rows']) == (2195, 196, 1512)
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
