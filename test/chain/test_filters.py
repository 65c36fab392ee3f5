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

"""The filter network: its gain, its delay, designs that float64 cannot hold, and settling."""

import os
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from slip_detector.chain.filters import SETTLED, design, settling_rows
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig
from support.config_cases import message_of
from support.python_runs import run_python

RATE = 380.0


#: A user without a home and without an entry in the list of users, then one more module.
NOBODY = """
import pwd
def nobody(uid): raise KeyError(uid)
pwd.getpwuid = nobody
import slip_detector.chain.slip_chain, slip_detector.report.page
slip_detector.chain.slip_chain.SlipChain()
"""


@pytest.mark.parametrize('cache', [{}, {'XDG_CACHE_HOME': 'relative'}])
def test_a_user_without_a_home_needs_none_and_nothing_is_left_where_he_is(tmp_path, cache):
    environment = {name: value for name, value in os.environ.items() if name != 'HOME'}
    done = run_python('-B', '-c', NOBODY, cwd=tmp_path, env={**environment, **cache})
    assert done.returncode == 0, done.stderr
    assert list(tmp_path.iterdir()) == []


# --- stability and lost designs ------------------------------------------------------------


LOST = {
    'passband edges that all but meet': ('passband_hz', {'passband_hz': (7.0, 7.0000001)}),
    'passband edges at Nyquist': ('passband_hz', {'passband_hz': (189.9999, 189.99999)}),
    'stop-band edges that all but meet': ('stopbands_hz', {'stopbands_hz': ((60.0, 60.0000001),)}),
    'stop-band edges at Nyquist': (
        'stopbands_hz',
        {'stopbands_hz': ((0.5, 7.0), (189.9999, 189.99999)), 'stopband_degree': 20},
    ),
}


@pytest.mark.parametrize(('name', 'values'), LOST.values(), ids=LOST)
def test_a_design_lost_to_round_off_is_an_error_that_names_the_edges_and_what_works(name, values):
    config = ChainConfig(**values)
    edges = config.passband_hz if name == 'passband_hz' else config.stopbands_hz[-1]
    message = message_of(design, config)
    assert message.startswith(
        f'parameter {name}: the filter with edges at {edges[0]:g} and {edges[1]:g} Hz is lost to '
        'round-off at 380 Hz'
    )
    low, high = map(float, re.findall(r'between ([\d.]+) and ([\d.]+) Hz', message)[0])
    design(ChainConfig(passband_hz=(low, high), stopbands_hz=((low, high),)))


# --- settling ------------------------------------------------------------------------------


def rows_until_fallen(sections):
    """Return after how many rows the answer to a step stays below its share of the largest."""
    step = np.abs(signal.sosfilt(sections, np.ones(20000)))
    return np.flatnonzero(step > SETTLED * step.max())[-1] + 1


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
    assert settling_rows(config) == rows_until_fallen(design(config)) + windows


EVIDENCE = ChainConfig(
    decision='evidence', noise_floor=1e-3, noise_floor_learnt=True, stopbands_hz=(), exponent=1,
    gain=1.0, mains_hz=50.0,
)  # fmt: skip


def test_a_low_band_that_settles_later_is_waited_for_and_one_that_float64_cannot_hold_refused():
    values = EVIDENCE.__dict__ | {'passband_hz': (60.0, 0.0), 'activity_cap_db': 8.7}
    low = signal.butter(2, (2.0, 4.0), 'bandpass', output='sos', fs=RATE)
    falls = settling_rows(EVIDENCE) - settling_rows(ChainConfig(stopbands_hz=())) + 15 - 38
    config = ChainConfig(**values | {'activity_band_hz': (2.0, 4.0)})
    assert settling_rows(config) == rows_until_fallen(low) + 15 + falls
    config = ChainConfig(**values | {'activity_band_hz': (0.01, 0.0101)})
    assert message_of(SlipChain, config).startswith('parameter activity_band_hz: the filter with')


@pytest.mark.parametrize(
    ('config', 'tolerance'), [(ChainConfig(exponent=1, gain=1.0), 0.01), (EVIDENCE, 0.05)]
)
def test_two_chains_that_began_at_different_baselines_agree_once_they_have_settled(
    config, tolerance
):
    rows = settling_rows(config)
    volts = 1e-3 * np.random.default_rng(0).standard_normal((rows + 50, 16))
    other = volts.copy()
    other[0] += 1.0  # to this chain all that follows is a step down
    levels = [SlipChain(config).update(each).level for each in (volts, other)]
    difference = np.abs(levels[0] - levels[1])
    assert difference[rows:].max() < tolerance * max(difference.max(), 1.0)
    assert difference[:rows].max() > 0.05
