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

"""The filter network: its gain, its delay, and the designs that float64 cannot hold."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from slip_detector.chain import filters
from slip_detector.chain.filters import design, group_delay_s, largest_pole_radius, response
from slip_detector.parameters.chain_checks import LOWEST_EDGE
from slip_detector.parameters.detector import ChainConfig

RATE = 380.0
HALF_POWER_DB = 10 * np.log10(0.5)  # -3.01 dB


def decibels(sections, frequency_hz, rate=RATE):
    return 20 * np.log10(np.abs(response(sections, np.atleast_1d(frequency_hz), rate)))


def stopband_of(pair, rate=RATE, **values):
    """Return the sections of one stop-band: those after the pass-band's two."""
    return design(ChainConfig(sample_rate_hz=rate, stopbands_hz=(pair,), **values))[2:]


def test_the_papers_network_has_six_sections():
    sections = design(ChainConfig())
    assert sections.shape == (6, 6)
    assert sections.dtype == np.float64
    assert np.array_equal(sections[:, 3], np.ones(6))


def test_each_stopband_left_out_leaves_its_sections_out():
    whole = design(ChainConfig())
    low_only = design(ChainConfig(stopbands_hz=((0.5, 7.0),)))
    none = design(ChainConfig(stopbands_hz=()))
    assert np.array_equal(low_only, whole[:4])
    assert np.array_equal(none, whole[:2])


def test_degree_4_is_the_second_order_band_pass_of_scipy():
    passband = signal.butter(2, [7, 50], 'bandpass', output='sos', fs=RATE)
    assert np.array_equal(design(ChainConfig(stopbands_hz=(), gain=1.0)), passband)


@pytest.mark.parametrize('gain', [1.0, 100.0])
@pytest.mark.parametrize('degree', [2, 4, 6, 8])
@pytest.mark.parametrize('edges', [(7.0, 50.0), (10.0, 150.0), (20.0, 25.0), (0.1, 189.0)])
def test_the_band_pass_lets_half_the_power_through_at_its_edges(edges, degree, gain):
    sections = design(
        ChainConfig(passband_hz=edges, passband_degree=degree, gain=gain, stopbands_hz=())
    )
    assert decibels(sections, edges) - 20 * np.log10(gain) == pytest.approx(
        HALF_POWER_DB, abs=1e-6
    )


def test_the_band_pass_has_its_gain_inside_and_falls_outside():
    sections = design(ChainConfig(stopbands_hz=()))
    inside = decibels(sections, np.linspace(9, 40, 50))
    assert inside.max() <= 40 + 1e-9
    assert inside.min() > 40 - 1.6
    # Degree 4 is 12 dB per octave on either side.
    below = decibels(sections, [0.2, 0.1])
    assert below[0] - below[1] == pytest.approx(12.04, abs=0.02)


def test_the_gain_is_a_factor_on_the_whole_network():
    frequencies = np.linspace(0.1, 189, 200)
    one, many = (
        response(design(ChainConfig(gain=gain)), frequencies, RATE) for gain in (1.0, 250.0)
    )
    assert np.allclose(many, 250 * one, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize('degree', [2, 4, 8])
@pytest.mark.parametrize('attenuation', [20.0, 40.0, 60.0])
@pytest.mark.parametrize('ripple', [0.01, 0.5])
@pytest.mark.parametrize('pair', [(0.5, 7.0), (50.0, 180.0), (48.0, 52.0)])
def test_a_stopband_ripples_outside_its_edges_and_keeps_its_attenuation_inside(
    pair, ripple, attenuation, degree
):
    sections = stopband_of(
        pair,
        stopband_degree=degree,
        stopband_ripple_db=ripple,
        stopband_attenuation_db=attenuation,
    )
    assert len(sections) == degree // 2
    outside = np.concatenate([np.linspace(0, pair[0], 500), np.linspace(pair[1], 189.9, 500)])
    passed = decibels(sections, outside)
    assert passed.max() <= 1e-6
    assert passed.min() >= -ripple - 1e-6
    assert decibels(sections, pair) == pytest.approx(-ripple, abs=1e-6)
    # The edges are those of the ripple. Full attenuation begins further in and lasts from its
    # first frequency to its last, about the centre on the warped axis of the bilinear transform.
    warped = np.tan(np.pi * np.array(pair) / RATE)
    centre = np.arctan(np.sqrt(warped.prod())) * RATE / np.pi
    inside = np.sort(np.append(np.linspace(*pair, 20001), centre))
    stopped = np.flatnonzero(decibels(sections, inside) <= -attenuation + 1e-6)
    assert np.array_equal(stopped, np.arange(stopped[0], stopped[-1] + 1))
    assert inside[stopped[0]] <= centre <= inside[stopped[-1]]
    last = decibels(sections, inside)[[stopped[0] - 1, stopped[-1] + 1]]
    assert (last > -attenuation).all()


def test_the_papers_stopbands_take_40_db_off_about_their_centres():
    low, high = (stopband_of(pair) for pair in ((0.5, 7.0), (50.0, 180.0)))
    assert decibels(low, np.linspace(1.75, 2.0, 50)).max() < -40 + 1e-6
    assert decibels(high, np.linspace(136.0, 145.0, 50)).max() < -40 + 1e-6


def test_a_higher_degree_widens_what_a_stopband_takes_off():
    inside = np.linspace(0.5, 7.0, 5001)
    widths = [
        (decibels(stopband_of((0.5, 7.0), stopband_degree=degree), inside) < -39.9).sum()
        for degree in (4, 6, 8, 12)
    ]
    assert widths == sorted(set(widths))


@pytest.mark.parametrize(
    'values',
    [
        {},
        {'stopbands_hz': ()},
        {'passband_hz': (7.0, 0.0)},
        {'passband_hz': (20.0, 150.0), 'passband_degree': 8},
        {'sample_rate_hz': 2000.0, 'passband_hz': (0.5, 50.0)},
    ],
)
def test_a_constant_does_not_pass(values):
    config = ChainConfig(**values)
    sections = design(config)
    assert abs(response(sections, np.zeros(1), config.sample_rate_hz)[0]) <= 1e-9 * config.gain


def test_response_is_that_of_the_sections():
    frequencies = np.array([3.0, 20.0, 50.0, 120.0])
    sections = design(ChainConfig())
    z = np.exp(-2j * np.pi * frequencies / RATE)
    expected = np.ones(4, dtype=complex)
    for b0, b1, b2, a0, a1, a2 in sections:
        expected *= (b0 + b1 * z + b2 * z**2) / (a0 + a1 * z + a2 * z**2)
    assert np.allclose(response(sections, frequencies, RATE), expected, rtol=1e-9, atol=0.0)


# --- high-pass -----------------------------------------------------------------------------


@pytest.mark.parametrize('degree', [1, 2, 3, 4, 7])
@pytest.mark.parametrize('edge', [0.5, 7.0, 95.0])
def test_a_high_edge_of_zero_makes_a_high_pass(edge, degree):
    sections = design(
        ChainConfig(passband_hz=(edge, 0.0), passband_degree=degree, gain=10.0, stopbands_hz=())
    )
    assert len(sections) == (degree + 1) // 2
    assert decibels(sections, edge)[0] - 20 == pytest.approx(HALF_POWER_DB, abs=1e-6)
    frequencies = np.linspace(edge, RATE / 2, 300)
    passed = decibels(sections, frequencies)
    assert (np.diff(passed) > -1e-9).all()
    assert passed[-1] == pytest.approx(20, abs=1e-9)
    assert decibels(sections, edge / 10)[0] < 20 - 19 * degree


# --- delay ---------------------------------------------------------------------------------


def test_the_papers_network_delays_its_band_by_10_to_15_ms():
    frequencies = np.linspace(16, 25, 19)
    delay = group_delay_s(design(ChainConfig()), frequencies, RATE)
    # To the millisecond: 15.5 ms at 16 Hz, 10.5 ms at 25 Hz.
    assert delay.max() < 0.0156
    assert delay.min() > 0.010
    # The order-4 design of SciPy, which is of degree 8, delays clearly more.
    slower = group_delay_s(design(ChainConfig(passband_degree=8)), frequencies, RATE)
    assert (slower > 1.6 * delay).all()


@pytest.mark.parametrize(
    'values',
    [
        {'stopbands_hz': ()},
        {'stopbands_hz': ((60.0, 140.0),), 'passband_hz': (30.0, 120.0)},
        {'stopbands_hz': (), 'passband_hz': (40.0, 0.0), 'passband_degree': 3},
    ],
)
def test_group_delay_is_that_of_scipy(values):
    sections = design(ChainConfig(**values))
    frequencies = np.linspace(15.0, 180.0, 40)
    _, samples = signal.group_delay(signal.sos2tf(sections), frequencies, fs=RATE)
    assert np.allclose(group_delay_s(sections, frequencies, RATE), samples / RATE, rtol=1e-6)


@pytest.mark.parametrize('samples', [0, 1, 2])
def test_group_delay_of_a_pure_delay_is_that_delay(samples):
    section = np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0]])
    section[0, samples] = 3.0
    delay = group_delay_s(section, np.array([0.0, 5.0, 30.0, 50.0]), 100.0)
    assert delay == pytest.approx(np.full(4, samples / 100), abs=1e-15)


def test_group_delay_of_sections_adds_up():
    frequencies = np.linspace(10, 40, 7)
    sections = design(ChainConfig())
    parts = sum(group_delay_s(section[None], frequencies, RATE) for section in sections)
    assert np.allclose(group_delay_s(sections, frequencies, RATE), parts, rtol=1e-12)


def test_group_delay_is_how_late_a_slow_modulation_comes_out():
    rate, carrier, n = 1000.0, 20.0, 4000
    sections = design(ChainConfig(sample_rate_hz=rate, gain=1.0))
    t = np.arange(n) / rate
    bump = np.exp(-0.5 * ((t - 2.0) / 0.3) ** 2)
    out = np.abs(signal.hilbert(signal.sosfilt(sections, bump * np.sin(2 * np.pi * carrier * t))))
    measured = (out @ t) / out.sum() - (bump @ t) / bump.sum()
    expected = group_delay_s(sections, np.array([carrier]), rate)[0]
    assert measured == pytest.approx(expected, rel=0.05)


# --- stability and lost designs ------------------------------------------------------------


@st.composite
def filter_configs(draw):
    rate = draw(st.sampled_from([100.0, 380.0, 2000.0, 44100.0]))
    low = draw(st.floats(1e-3, 0.3)) * rate
    width = draw(st.floats(0.01, 0.19)) * rate
    high_pass = draw(st.booleans())
    stopbands = [
        (edge * rate, (edge + more) * rate)
        for edge, more in draw(
            st.lists(st.tuples(st.floats(1e-3, 0.3), st.floats(0.01, 0.19)), max_size=3)
        )
    ]
    return ChainConfig(
        sample_rate_hz=rate,
        passband_hz=(low, 0.0 if high_pass else low + width),
        passband_degree=draw(st.integers(1, 4)) * (1 if high_pass else 2),
        stopbands_hz=stopbands,
        stopband_degree=draw(st.sampled_from([2, 4, 6])),
        stopband_attenuation_db=draw(st.sampled_from([20.0, 40.0, 80.0])),
    )


@given(filter_configs())
def test_drawn_designs_are_stable_and_forget_a_pulse(config):
    sections = design(config)
    radius = largest_pole_radius(sections)
    assert 0 <= radius < 1
    # Of this many rows at the radius 1e-12 is left; the rest is for poles that lie together.
    rows = min(int(2 * np.log(1e-12) / np.log(max(radius, 0.1))) + 50, 300_000)
    pulse = np.zeros(rows)
    pulse[0] = 1.0
    out = np.abs(signal.sosfilt(sections, pulse))
    assert out[-10:].max() <= 1e-9 * out.max()


def test_the_largest_pole_radius_is_that_of_the_outermost_pole():
    def section(radius, angle):
        return [1.0, 0.0, 0.0, 1.0, -2 * radius * np.cos(angle), radius**2]

    sections = np.array([section(0.5, 0.3), section(0.97, 2.0), section(0.9, 1.0)])
    assert largest_pole_radius(sections) == pytest.approx(0.97, abs=1e-12)
    first_order = np.array([[1.0, -1.0, 0.0, 1.0, 0.75, 0.0]])
    assert largest_pole_radius(first_order) == pytest.approx(0.75, abs=1e-12)


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
def test_a_design_lost_to_round_off_is_an_error_that_names_the_edges(name, values):
    config = ChainConfig(**values)
    edges = config.passband_hz if name == 'passband_hz' else config.stopbands_hz[-1]
    with pytest.raises(ValueError, match=f'^parameter {name}: ') as caught:
        design(config)
    message = str(caught.value)
    assert f'edges at {edges[0]:g} and {edges[1]:g} Hz' in message
    assert 'lost to round-off' in message
    assert 'allowed: ' in message
    assert '\n' not in message


@pytest.mark.parametrize(
    ('function', 'name'), [('butter', 'passband_hz'), ('ellip', 'stopbands_hz')]
)
def test_an_unstable_design_is_an_error_that_names_the_edges(monkeypatch, function, name):
    right = getattr(signal, function)

    def wrong(*args, **values):
        sections = right(*args, **values)
        sections[0, 3:] = [1.0, -2.02, 1.0201]  # both poles at 1.01
        return sections

    monkeypatch.setattr(signal, function, wrong)
    filters._unit_gain_network.cache_clear()
    with pytest.raises(
        ValueError, match=rf'^parameter {name}: .* is unstable at 380 Hz'
    ) as caught:
        design(ChainConfig())
    assert re.search(r'edges at (7 and 50|0\.5 and 7) Hz', str(caught.value))


def test_what_the_error_recommends_does_work():
    with pytest.raises(ValueError, match='allowed: edges') as caught:
        design(ChainConfig(passband_hz=(7.0, 7.0000001)))
    low, high = map(float, re.findall(r'between ([\d.]+) and ([\d.]+) Hz', str(caught.value))[0])
    sections = design(ChainConfig(passband_hz=(low, high), stopbands_hz=((low, high),)))
    assert largest_pole_radius(sections) < 1


@pytest.mark.parametrize('rate', [100.0, 380.0, 2000.0])
def test_the_lowest_edges_allowed_still_filter_right(rate):
    low = 1.001 * LOWEST_EDGE * rate
    config = ChainConfig(sample_rate_hz=rate, passband_hz=(low, 0.1 * rate), stopbands_hz=())
    sections = design(config)
    assert decibels(sections, config.passband_hz, rate) - 40 == pytest.approx(
        HALF_POWER_DB, abs=1e-3
    )
    assert decibels(sections, 0.01 * rate, rate)[0] == pytest.approx(40, abs=0.1)
