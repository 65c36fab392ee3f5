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

"""The decision by evidence beside the reference: gaps, bounds, and decibels."""

import numpy as np
import pytest
from chain.chain_cases import bits, noise, quick_evidence

from slip_detector.chain.layout import FLOOR
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.stages import LEAST_EXCESS_DB, root_decibels
from slip_detector.compiled import compiled
from slip_detector.vectors import load, store

SIGNALS = ('envelope', 'level', 'floor', 'excess')
KEPT = {'floor': True, 'excess': True}

# --- floors and evidence -------------------------------------------------------------------


def test_a_gap_that_restarts_the_chain_keeps_the_floor_alone():
    config = quick_evidence(noise_floor_rate_db_s=100.0)
    volts = 0.1 * noise(9, 600, 4)
    chain = SlipChain(config)
    floor = chain.update(volts[:300], **KEPT).floor[-1]
    chain.restart()
    after = chain.update(volts[300:], **KEPT)
    assert np.array_equal(after.floor[0], floor)
    assert np.abs(floor + 40).min() > 1
    new = SlipChain(config).update(volts[300:], **KEPT)
    assert after.envelope.tobytes() == new.envelope.tobytes()
    assert (after.level[:8] == 0).all()
    chain.reset()
    assert bits(chain.update(volts[300:], **KEPT)) == bits(new)


def test_after_a_gap_contact_goes_on_as_after_a_touch_as_a_still_grip_touches_nothing():
    config = quick_evidence(
        contact_level_v=1.0, contact_channels=3, contact_hold_s=0.2, noise_floor_learnt=True
    )
    chain, volts = SlipChain(config), 0.1 * noise(5, 400, 4)
    assert (chain.update(volts, **KEPT).excess == 0).all()
    floor = chain.state[:, FLOOR].copy()
    chain.restart()
    excess = chain.update(volts, **KEPT).excess
    assert (excess[8:80] > 0).any()
    assert (excess[80:] == 0).all()
    assert (chain.state[:, FLOOR] == floor).all()


# --- extremes ------------------------------------------------------------------------------


@pytest.mark.parametrize('size_v', [0.0, 5e-324, 1e-310, 1e-160, 1e6, 1e12])
@pytest.mark.parametrize(
    'stages', [{}, {'contact_level_v': 1e-200, 'activity_cap_db': 8.7, 'activity_range_db': -100}]
)
def test_any_size_of_signal_gives_finite_numbers_within_their_bounds(size_v, stages):
    values = {'gain': 1e6, 'exponent': 6} if size_v == 1e12 else {}
    config = quick_evidence(valid_range_v=(-1e12, 1e12), **values | stages)
    volts = np.concatenate([size_v * noise(10, 300, 4), np.zeros((300, 4))])
    volts = np.clip(volts, -1e12, 1e12)
    result = SlipChain(config).update(volts, **KEPT)
    for name in SIGNALS:
        assert np.isfinite(getattr(result, name)).all(), name
    assert (result.excess >= LEAST_EXCESS_DB).all()
    assert (result.excess <= config.evidence_cap_db).all()
    assert (result.level >= 0).all()
    assert (result.level <= config.evidence_limit_db_s).all()
    assert (result.floor >= -40 - 1e-9).all()
    assert (result.floor <= 20 + config.activity_cap_db + 1e-9).all()


@compiled
def find_decibels(squares, found):
    for k in range(len(squares)):
        store(root_decibels(load(squares, (k, 0))), found, (k, 0))


def test_decibels_are_those_of_the_logarithm_and_rise_from_zero_to_infinity():
    octaves = 2.0 ** np.arange(-1022.0, 1023.0)[:, None] * np.linspace(1.0, 2.0, 17)
    squares = np.concatenate([[0.0, 5e-324, 1e-310], octaves.ravel()[:-1], [np.inf]])
    squares = np.resize(squares, (len(squares) // 16 + 1, 16))
    found = np.empty_like(squares)
    find_decibels(squares, found)
    squares, found = squares.ravel(), found.ravel()
    normal = (squares >= 2.0**-1022) & np.isfinite(squares)
    assert np.abs(found[normal] - 10 * np.log10(squares[normal])).max() < 7e-6
    assert np.isfinite(found).all()
    order = np.argsort(squares, kind='stable')
    assert (np.diff(found[order]) >= 0).all()
