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

"""Real recordings, each left out of its own search."""

import numpy as np
import pytest

from benchmarks.tune.real_recordings import measure_real_recordings
from support.tuning_cases import PARAMETERS, RATE_HZ, slips


@pytest.fixture
def recordings(tmp_path):
    """Write three recordings: noise, slips, and motion, which is a weaker tone."""
    folder = tmp_path / 'recordings'
    folder.mkdir()
    for seed in range(3):
        volts, label = slips(seed, duration_s=9.0)
        motion = np.roll(label, round(RATE_HZ))
        tone = np.sin(2 * np.pi * 18.0 * np.arange(len(volts)) / RATE_HZ)
        volts += 0.2 * (motion * tone)[:, None]
        np.savez(
            folder / f'{seed}.npz',
            volts=volts,
            label=label,
            motion=1.0 * motion,
            sample_rate_hz=RATE_HZ,
        )
    return folder


def test_each_recording_is_left_out_and_scored_against_motion(recordings, tmp_path):
    config = tmp_path / 'config.yaml'
    config.write_text(PARAMETERS.replace('tail_s: 0.15', 'tail_s: 0.15, motion_key: motion'))
    figures = measure_real_recordings(recordings, config, range(2), trials=2)
    assert figures['recordings'] == 3
    assert figures['trials'] == 2
    assert list(figures['seeds']) == ['0', '1']
    for areas in (figures['given'], *figures['seeds'].values()):
        assert 0.8 < areas['auc_moving'] <= 1.0
        assert 0.8 < areas['auc_moving_by_threshold'] <= 1.0
    assert figures['choice'] is None  # the given parameters decide by the mean of the envelope
    assert figures['least_auc_moving'] == min(
        areas['auc_moving'] for areas in figures['seeds'].values()
    )
