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

"""What is kept of a finger, in columns and spectra, and what a page asks to see of it."""

import copy

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import ChainConfig
from slip_detector.view.track import SET_BACK_NS, LiveTrack, Rows, spectrum
from slip_detector.view.view_request import MOST_JOINED, SLOW_S, Pace, ViewRequest
from support.live_client import unpacked
from support.simulated_detectors import SimulatedDetectors

VALUES = st.floats(-1e3, 1e3, width=32) | st.just(np.nan)


@given(
    cuts=st.lists(st.integers(0, 30), max_size=20),
    kept=st.integers(1, 40),
    since=st.integers(0, 400),
)
def test_the_last_rows_are_kept_in_order_however_they_come(cuts, kept, since):
    rows, begin = Rows(kept, level=(np.float32, 2)), 0
    for n in cuts:
        which = np.arange(begin, begin + n)
        rows.append(10 * which, level=np.column_stack([which, -which]))
        begin += n
    # Of a call with more rows than are kept only the last ones count.
    assert rows.appended == sum(min(n, kept) for n in cuts)
    assert min(kept, rows.appended) <= len(rows) <= 2 * kept
    stamps_ns, level = rows.stamps_ns(since), rows.field('level', since)
    n = min(len(rows), max(0, rows.appended - since))
    assert len(stamps_ns) == len(level) == n
    if max(cuts, default=0) <= kept:
        assert stamps_ns.tolist() == [10 * k for k in range(begin - n, begin)]
    assert (level[:, 0] * 10 == stamps_ns).all()
    assert (level[:, 1] == -level[:, 0]).all()


@given(
    steps=st.lists(st.integers(1, 40), min_size=1, max_size=60),
    values=st.data(),
    width_ns=st.integers(1, 100),
    cut=st.integers(0, 30),
)
def test_a_column_has_the_lowest_and_the_highest_of_its_rows(steps, values, width_ns, cut):
    stamps_ns = np.cumsum(steps)
    volts = values.draw(st.lists(VALUES, min_size=len(steps), max_size=len(steps)))
    rows = Rows(100, volts=(np.float64, 1))
    rows.append(stamps_ns, volts=np.reshape(volts, (-1, 1)))
    edges_ns = np.arange(cut, cut + 41) * width_ns
    low, high = rows.columns('volts', edges_ns, np.array([0]), 0)
    for k, begin_ns in enumerate(edges_ns[:-1]):
        inside = (stamps_ns >= begin_ns) & (stamps_ns < begin_ns + width_ns)
        there = [v for v in np.array(volts, np.float32)[inside] if not np.isnan(v)] or [np.nan]
        np.testing.assert_equal((low[0, k], high[0, k]), (min(there), max(there)))


def test_a_clock_that_is_set_back_begins_a_new_track_and_a_late_message_does_not():
    track = LiveTrack(ChainConfig(channels=2))
    volts, at_ns = np.zeros((2, 2)), 10**18
    track.add_samples(Samples(volts, np.array([at_ns, at_ns + 5])))
    track.add_levels(np.array([at_ns]), volts[:1], volts[:1], volts[:1, 0])
    track.add_samples(Samples(volts, np.array([at_ns - SET_BACK_NS + 5, at_ns + 9])))
    assert (track.beginnings, len(track.samples)) == (0, 3)
    back_ns = at_ns - 2 * SET_BACK_NS
    track.add_samples(Samples(volts, np.array([back_ns, back_ns + 1])))
    assert (track.beginnings, len(track.samples), len(track.levels)) == (1, 2, 0)


@pytest.mark.parametrize('rate_hz', [20.0, 380.0, 20_000.0])
def test_the_power_over_all_frequencies_is_the_variance(rate_hz):
    volts = 1e-6 * np.random.default_rng(1).normal(size=(5000, 2))
    found = spectrum(volts, rate_hz)
    power_v2 = np.sum(10.0 ** (found.density_db / 10.0), axis=1) * found.step_hz
    assert power_v2 == pytest.approx(np.full(2, 1e-12), rel=0.4)
    assert found.density_db.shape[1] * found.step_hz == pytest.approx(rate_hz / 2, rel=0.05)


def test_values_that_are_no_numbers_are_replaced_by_the_mean_of_their_channel():
    volts = np.random.default_rng(1).normal(size=(2000, 3))
    filled = volts.copy()
    filled[700:704, 1] = np.delete(volts[:, 1], range(700, 704)).mean()
    filled[0, 2] = volts[1:, 2].mean()
    volts[700:704, 1], volts[0, 2] = (np.nan, np.inf, np.nan, -np.inf), np.nan
    volts[9, 0] = 1e300  # Its square is infinite, which is of its own channel only.
    found, wanted = (spectrum(each, 380.0).density_db[1:] for each in (volts, filled))
    assert found == pytest.approx(wanted, abs=1e-3)
    assert spectrum(volts[:20], 380.0) is None


NAME = '/index/slip_detector'


def detectors_after(seconds):
    detectors = SimulatedDetectors(real_time=False)
    detectors.simulated[NAME].play(seconds)
    return detectors


def requested(**content):
    return ViewRequest({'fingers': [NAME], 'finger': NAME, 'channels': [3, 1], **content})


def columns(view, detectors, past=None):
    """Return the traces of the next frame: their header, and what they have."""
    header, arrays = unpacked(view.frame(detectors, past))
    return header['traces'], arrays


def test_a_past_stretch_ends_where_it_was_asked_to_though_the_track_goes_on():
    detectors = detectors_after(3.0)
    finger = detectors.fingers[NAME]
    until_ns = int(finger.track.samples.stamps_ns()[-1]) - 1_000_000_000
    view = requested(window_s=0.5, pixels=500, until_ns=until_ns)
    past = copy.deepcopy(finger.track)
    traces, arrays = columns(view, detectors, past)
    samples, width_ns = traces['samples'], traces['width_ns']
    end_ns = (samples['first'] + samples['count']) * width_ns
    assert end_ns == pytest.approx(until_ns, abs=2 * width_ns)
    assert np.isfinite(arrays['low']).any()
    finger.track.samples.clear()
    detectors.simulated[NAME].play(1.0)
    assert columns(view, detectors, past)[0]['samples']['count'] == 0
    view = requested(window_s=0.5, pixels=500, until_ns=until_ns)
    low = columns(view, detectors, past)[1]['low']
    assert np.array_equal(low, arrays['low'], equal_nan=True)


@settings(max_examples=15)
@given(st.lists(st.floats(0.01, 0.4), min_size=1, max_size=4))
def test_columns_are_the_same_however_frames_cut_them(cuts):
    detectors, first = detectors_after(0.5), requested(window_s=4.0, pixels=300)
    parts = []
    for cut in [*cuts, 0.0]:
        parts.append(columns(first, detectors)[1]['high'])
        detectors.simulated[NAME].play(cut)
    last_traces, last = columns(requested(window_s=4.0, pixels=300), detectors)
    together = np.concatenate(parts, axis=1)
    whole = last['high'][:, : together.shape[1]]
    assert np.array_equal(together[:, : whole.shape[1]], whole, equal_nan=True)
    assert last_traces['channels'] == [1, 3]


@settings(max_examples=40, deadline=None)
@given(st.floats(10.0, 2000.0), st.integers(1, 50), st.integers(0, 99), st.floats(0.02, 60.0))
def test_messages_that_come_on_time_leave_no_hole_and_a_gap_is_one(rate_hz, batch, seed, window_s):
    detectors, late = detectors_after(0.0), np.random.default_rng(seed).uniform(0.0, 0.6, 40)
    ends_s = 1000.0 + batch / rate_hz * (np.arange(40) + late + np.repeat([0.0, 8.0], 20))
    rows_s = (ends_s[:, np.newaxis] - np.arange(batch)[::-1] / rate_hz).ravel()
    ends_ns, rows_ns = (np.rint(1e9 * each).astype(np.int64) for each in (ends_s, rows_s))
    track, ones = detectors.fingers[NAME].track, np.ones((40 * batch, 16))
    track.add_samples(Samples(ones, rows_ns))
    track.add_levels(ends_ns, ones[:40], ones[:40] > 0.0, ones[:40, 0] > 0.0)
    traces, arrays = columns(requested(window_s=window_s), detectors)
    streams = {'samples': ('low', rows_ns), 'levels': ('level', ends_ns)}
    for stream, (name, stamps_ns) in streams.items():
        begins_ns = traces[stream]['first'] + np.arange(traces[stream]['count'])
        begins_ns *= traces['width_ns']
        before, after = stamps_ns[len(stamps_ns) // 2 - 1 :][:2]
        in_gap = (begins_ns > before) & (begins_ns + traces['width_ns'] <= after)
        assert np.array_equal(np.isnan(arrays[name][0]), in_gap)
    assert np.array_equal(arrays['slip'] == 0.0, in_gap)


@pytest.mark.parametrize('bytes_s', [12_500, 40_000, 10_000_000])
def test_a_page_gets_what_its_connection_takes(bytes_s):
    detectors, pace, took_s = detectors_after(30.0), Pace(), []
    view = requested(channels=[*range(1, 17)], window_s=30.0)
    for _ in range(300):
        took_s.append(len(view.frame(detectors, None, pace.join)) / bytes_s + 0.01)
        pace.drawn(took_s[-1], view.is_whole)
        detectors.simulated[NAME].play(took_s[-1])
    assert np.quantile(took_s, 0.95) < SLOW_S
    assert max(took_s) < 3 * SLOW_S
    assert (pace.join == 1) == (bytes_s == 10_000_000)
    assert pace.join < MOST_JOINED


def test_the_spectrum_comes_now_and_then_with_rest_behind_it():
    detectors = detectors_after(6.0)
    watching = requested(spectrum=14)
    header, arrays = unpacked(watching.frame(detectors))
    assert header['spectrum'] == {'name': NAME, 'channel': 14, 'step_hz': pytest.approx(0.5)}
    assert arrays['spectrum'].shape == (380,)
    assert 'rest' not in arrays
    assert 'spectrum' not in unpacked(watching.frame(detectors))[0]
    detectors.fingers[NAME].keep_rest()
    rest = unpacked(requested(spectrum=14).frame(detectors))[1]['rest']
    assert np.array_equal(rest, arrays['spectrum'])
    header, _ = unpacked(requested(spectrum=99).frame(detectors))
    assert header['spectrum'] == {'name': NAME, 'channel': 99}


@pytest.mark.parametrize(
    ('name', 'value'),
    [
        ('fingers', 3), ('fingers', [3]), ('channels', [1.5]), ('channels', [10**7]),
        ('window_s', 'long'), ('window_s', float('nan')), ('pixels', -1), ('until_ns', 2**70),
    ],
)  # fmt: skip
def test_what_a_page_may_not_ask_for_is_refused_in_words(name, value):
    with pytest.raises(ValueError, match=f'^{name} is ') as refused:
        requested(**{name: value})
    assert len(str(refused.value)) < 200


def test_any_other_view_is_drawn():
    detectors = detectors_after(0.5)
    for view in (
        requested(finger='/gone', fingers=['/gone', NAME, NAME]),
        requested(channels=[99, 1], spectrum=99, until_ns=-(2**62)),
        requested(channels=[], window_s=60.0, pixels=10, until_ns=2**62),
    ):
        for _ in range(2):
            header, _ = unpacked(view.frame(detectors))
            assert ('traces' in header) == (view.finger == NAME)
