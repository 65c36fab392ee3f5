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

"""The benchmark of the evaluation."""

import numpy as np
import pytest

from benchmarks.tune import evaluation_speed


def test_the_hour_is_labelled_trials_of_the_asked_length(tmp_path):
    evaluation_speed.write_trials(tmp_path / 'hour.npz', rows=30_000)
    with np.load(tmp_path / 'hour.npz') as file:
        assert file['volts'].shape == (30_000, 16)
        starts = np.flatnonzero(np.diff(file['slip'].astype(int)) == 1)
        assert (len(starts), file['sample_rate_hz']) == (8, 380.0)
        assert 0.2 < file['slip'].mean() < 0.3


def test_it_measures_both_sides_on_what_is_detected():
    result = evaluation_speed.measure_evaluation(rows=30_000, rounds=1)
    assert (result['rows'], result['channels'], result['rounds']) == (30_000, 16, 1)
    assert result['ratio'] == result['evaluation_s'] / result['plain_s']
    assert result['plain_without_reading_s'] > 0.0
    assert result['times_real_time'] == pytest.approx(30_000 / 380.0 / result['evaluation_s'])
    assert (result['figures']['slips'], result['figures']['recall']) == (8, 1.0)
    assert result['figures']['auc_all'] > 0.98
    wanted = result['wanted']['ratio']
    assert wanted == {
        'value': result['ratio'], 'bound': '<= 4', 'met': result['ratio'] <= 4.0
    }  # fmt: skip
