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

"""Faults: channels that fail from their time on, and no others."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.detector import PAPER_CHANNELS
from slip_detector.scenes.electronics import Electronics, Frontend
from slip_detector.scenes.faults import Faults, FaultyChannels
from support.disturbance_cases import (
    CUTS,
    RATE_HZ,
    RefusingGenerator,
    check_refused,
    instants_s,
    trial,
)

ALL_FAULTS = {'dead_channels': [3], 'flat_channels': [1, 16], 'noisy_channels': [7, 5]}


def sampled(faults, t, cuts=(), lowest_v=0.0, bits=0):
    """Sample noisy volts with faults, in any cut, as a scene does."""
    clean_v = 4.0 + 0.1 * np.sin(t[:, np.newaxis] * np.arange(20.0, 20.0 + PAPER_CHANNELS))
    electronics = Electronics(adc_bits=bits)
    frontend, channels = Frontend(electronics, trial(1)), None
    if faults is not None:
        channels = FaultyChannels(faults, trial(2), lowest_v)
    pieces = []
    for piece_v, piece_s in zip(np.split(clean_v, cuts), np.split(t, cuts), strict=True):
        if channels is None:
            pieces.append(frontend.sample(piece_v, 1 / RATE_HZ))
        else:
            disturbed_v = channels.before_converter(piece_v, piece_s)
            volts = frontend.sample(disturbed_v, 1 / RATE_HZ)
            pieces.append(channels.after_converter(volts, piece_s))
    return np.concatenate(pieces)


@given(CUTS, st.floats(0, 0.7))
def test_any_cut_of_rows_with_faults_gives_the_same_bits(cuts, from_s):
    faults, t = Faults(from_s=from_s, **ALL_FAULTS), instants_s(0.6)
    assert sampled(faults, t, cuts).tobytes() == sampled(faults, t).tobytes()


@given(st.floats(0, 0.7))
def test_channels_fail_from_their_time_on_and_the_others_never(from_s):
    t = instants_s(0.6)
    sound, faulty = sampled(None, t), sampled(Faults(from_s=from_s, **ALL_FAULTS), t, lowest_v=0.5)
    failed = t >= from_s
    np.testing.assert_array_equal(faulty[~failed], sound[~failed])
    failing = np.isin(np.arange(1, 17), [1, 3, 5, 7, 16])
    np.testing.assert_array_equal(faulty[:, ~failing], sound[:, ~failing])
    if failed.any():
        first = np.argmax(failed)
        assert np.all(faulty[failed, 2] == 0.5)
        for flat in (0, 15):
            assert np.all(faulty[failed, flat] == sound[first, flat])
        assert np.all(faulty[failed][:, [4, 6]] != sound[failed][:, [4, 6]])


def test_noisy_channels_have_so_much_more_noise_independent_of_each_other():
    t = instants_s(20.0)
    faults = Faults(noisy_channels=[5, 7], noise_v=0.02)
    extra_v = (sampled(faults, t) - sampled(None, t))[:, [4, 6]]
    np.testing.assert_allclose(extra_v.std(0), 0.02, rtol=0.05)
    assert abs(np.corrcoef(extra_v.T)[0, 1]) < 0.06


def test_the_converter_quantises_the_noise_and_a_flat_channel_holds_a_code():
    volts = sampled(Faults(noise_v=0.5, **ALL_FAULTS), instants_s(2.0), bits=8)
    codes = volts / (5.0 / 255)
    np.testing.assert_allclose(codes, np.rint(codes), atol=1e-9)
    assert volts.max() == 5.0


def test_rows_are_never_changed_in_place_and_nothing_is_drawn_without_noise():
    t, clean_v = instants_s(0.1), np.full((38, PAPER_CHANNELS), 4.0)
    quiet = FaultyChannels(Faults(dead_channels=[1], flat_channels=[2]), RefusingGenerator(), 0.0)
    assert quiet.before_converter(clean_v, t) is clean_v
    quiet.after_converter(clean_v, t)
    noisy = FaultyChannels(Faults(noisy_channels=[1]), trial(), 0.0)
    noisy.before_converter(clean_v, t)
    assert noisy.after_converter(clean_v, t) is clean_v
    assert np.all(clean_v == 4.0)


@pytest.mark.parametrize(
    ('parameters', 'said'),
    [
        ({}, 'flat_channels and noisy_channels are all empty, allowed: at least one'),
        ({'dead_channels': [0]}, 'parameter dead_channels is 0, allowed: 1 to 16'),
        ({'flat_channels': [17]}, 'parameter flat_channels is 17, allowed: 1 to 16'),
        (
            {'noisy_channels': [2.5]},
            'parameter noisy_channels is 2.5, allowed: a whole number',
        ),
        (
            {'dead_channels': [2], 'flat_channels': [4, 2]},
            'parameter flat_channels has channel 2, which fails already, allowed: one fault for '
            'a channel',
        ),
    ],
)
def test_a_wrong_parameter_is_named_with_what_is_allowed(parameters, said):
    check_refused(Faults, parameters, said)


def test_parameters_survive_being_written_and_read():
    part = Faults(**ALL_FAULTS)
    assert type(part).from_parameters(part.to_parameters()) == part


def test_channel_numbers_are_whole():
    assert Faults(dead_channels=[3.0]).to_parameters()['dead_channels'] == [3]
    assert isinstance(Faults(dead_channels=[3.0]).dead_channels[0], int)
