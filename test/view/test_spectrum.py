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

"""The spectrum against Parseval's theorem, and what it does with rows that are no numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.view.detectors import Finger
from slip_detector.view.track import FEWEST_ROWS, spectrum


def power_v2(found):
    return np.sum(10.0 ** (found.density_db / 10.0), axis=1) * found.step_hz


@given(
    rate_hz=st.floats(20.0, 20_000.0),
    rows=st.integers(1000, 5000),
    scale=st.floats(1e-6, 1e3),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_power_over_all_frequencies_is_the_variance(rate_hz, rows, scale, seed):
    volts = scale * np.random.default_rng(seed).normal(size=(rows, 2))
    found = spectrum(volts, rate_hz)
    used = volts[-6 * min(round(2 * rate_hz), 4096) // 2 :]
    assert power_v2(found) == pytest.approx(used.var(axis=0), rel=0.6)
    assert found.density_db.shape[1] * found.step_hz == pytest.approx(rate_hz / 2, rel=0.05)


@pytest.mark.parametrize('hz', [3.0, 17.5, 60.0, 150.0])
def test_a_line_stands_at_its_frequency(hz):
    seconds = np.arange(3000) / 380.0
    volts = 4.3 + 0.2 * np.sin(2 * np.pi * hz * seconds)
    found = spectrum(volts[:, np.newaxis], 380.0)
    peak = found.density_db[0].argmax()
    assert found.step_hz * (peak + 1) == pytest.approx(hz, abs=found.step_hz)
    assert power_v2(found)[0] == pytest.approx(0.02, rel=0.05)


def test_rows_that_are_no_numbers_hold_the_one_before():
    volts = np.random.default_rng(1).normal(size=(2000, 3))
    held = volts.copy()
    held[700:704, 1], held[0, 2] = held[699, 1], held[1, 2]
    volts[700:704, 1], volts[0, 2] = (np.nan, np.inf, np.nan, -np.inf), np.nan
    assert np.array_equal(spectrum(volts, 380.0).density_db, spectrum(held, 380.0).density_db)


def test_a_value_whose_square_is_infinite_spoils_its_own_channel_only():
    volts = np.random.default_rng(1).normal(size=(800, 2))
    alone = spectrum(volts[:, 1:], 380.0).density_db[0]
    volts[700, 0] = 1e300
    assert spectrum(volts, 380.0).density_db[1] == pytest.approx(alone, abs=1e-3)


def test_a_channel_without_a_number_has_nothing():
    found = spectrum(np.full((500, 1), np.nan), 380.0)
    assert found.density_db.max() == pytest.approx(-300.0)


def test_too_few_rows_are_none():
    assert spectrum(np.zeros((FEWEST_ROWS - 1, 4)), 380.0) is None
    assert spectrum(np.zeros((FEWEST_ROWS, 4)), 380.0) is not None


def test_rest_is_held_of_all_channels_or_refused():
    finger = Finger('/index/slip_detector', DetectorConfig())
    with pytest.raises(ValueError, match='index: too few samples'):
        finger.hold_rest()
    volts = np.random.default_rng(2).normal(size=(800, 16))
    finger.track.add_samples(1 + np.arange(800), volts, np.zeros(800))
    finger.hold_rest()
    assert finger.rest.density_db.shape == (16, 380)
    finger.update_config(DetectorConfig(threshold=0.25))
    assert finger.rest is not None
    # Other channels, of which nothing is known.
    finger.update_config(DetectorConfig(channels=8))
    assert finger.rest is None
