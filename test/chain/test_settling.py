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

"""How long a chain settles, against the step response of its filters by SciPy."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from slip_detector.chain.filters import design
from slip_detector.chain.settling import SETTLED, settling_rows
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig


@settings(max_examples=20)
@given(
    st.sampled_from([(7.0, 50.0), (0.5, 5.0), (40.0, 0.0), (20.0, 150.0)]),
    st.sampled_from([(), ((0.5, 7.0), (50.0, 180.0)), ((49.0, 51.0),)]),
    st.sampled_from([0.01, 0.04, 0.2]),
)
def test_after_so_many_rows_a_step_has_fallen_below_the_share_and_left_the_windows(
    passband, stopbands, window_s
):
    config = ChainConfig(passband_hz=passband, stopbands_hz=stopbands, envelope_window_s=window_s)
    windows = config.samples(window_s) + config.samples(config.decision_window_s)
    step = np.abs(signal.sosfilt(design(config), np.ones(20000)))
    loud = np.flatnonzero(step > SETTLED * step.max())
    assert settling_rows(config) == loud[-1] + 1 + windows


def test_two_chains_that_began_at_different_baselines_agree_once_they_have_settled():
    config = ChainConfig(exponent=1, gain=1.0)
    rng = np.random.default_rng(0)
    rows = settling_rows(config)
    volts = 1e-4 * rng.standard_normal((rows + 50, 16))
    other = volts.copy()
    other[0] += 1.0  # to this chain all that follows is a step down
    levels = [SlipChain(config).update(each).level for each in (volts, other)]
    difference = np.abs(levels[0] - levels[1])
    assert difference[rows:].max() < SETTLED * difference.max()


def test_a_filter_that_cannot_be_run_is_refused():
    with pytest.raises(ValueError, match='passband_hz'):
        settling_rows(ChainConfig(passband_hz=(1e-6, 1e-5), stopbands_hz=()))


EVIDENCE = ChainConfig(
    decision='evidence', noise_floor=1e-3, noise_floor_learnt=True, stopbands_hz=(), exponent=1,
    gain=1.0, mains_hz=50.0,
)  # fmt: skip


def test_two_chains_whose_combs_began_at_different_baselines_agree_once_they_have_settled():
    rng = np.random.default_rng(0)
    rows = settling_rows(EVIDENCE)
    volts = 1e-3 * rng.standard_normal((rows + 50, 16))
    other = volts.copy()
    other[0] += 1.0
    ours, its = (SlipChain(EVIDENCE).update(each).level for each in (volts, other))
    assert ours[rows // 2] != pytest.approx(its[rows // 2])
    np.testing.assert_allclose(ours[rows:], its[rows:], atol=0.05)


def test_each_thing_that_evidence_waits_for_makes_it_settle_for_longer():
    rows = settling_rows(EVIDENCE)
    assert settling_rows(dataclasses.replace(EVIDENCE, mains_hz=0.0)) == rows - EVIDENCE.mains_rows
    assert settling_rows(dataclasses.replace(EVIDENCE, evidence_offset_db=1.0)) > rows
    # 5 dB at nine times 0.43 dB/s are 491 rows, 141 of which the evidence takes to fall.
    followed = dataclasses.replace(EVIDENCE, noise_floor_learnt=False)
    assert settling_rows(followed) == rows + 491 - 141
    still = dataclasses.replace(followed, noise_floor_rate_db_s=0.0)
    assert settling_rows(still) == rows
