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

"""Pieces of a recording: gaps and stretches as the node treats them; rates, found and changed."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.chain.stamps import StampGrid
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import Recording, open_recording
from slip_detector.recordings.rates import measure_rate, require_rate, resample
from slip_detector.recordings.recording import RecordingCounts
from support.config_cases import message_of
from support.recorded import RATE_HZ, save_rows, stretches_of

PERIOD_NS = 10_000_000


class InPieces(Recording):
    """Rows in memory, that are read some at a time."""

    sample_rate_hz = RATE_HZ

    def __init__(self, samples, piece_rows):
        super().__init__(Path('any'), None, RecordingConfig())
        self._samples, self._piece_rows = samples, piece_rows

    def read(self):
        for first in range(0, len(self._samples.volts), self._piece_rows):
            yield self._samples.take(slice(first, first + self._piece_rows))


#: Periods from one stamp to the next.
STEPS = st.sampled_from([1, 1, 1, 1, 1.3, 0.7, 2, 4, 9, 10.4, 11, 50, 0, -1, -3, -100])


@given(
    steps=st.lists(STEPS, min_size=1, max_size=60),
    piece_rows=st.integers(1, 12),
    max_gap_s=st.sampled_from([0.0, 0.05, 0.1]),
)
def test_however_it_is_cut_a_recording_is_mended_as_its_stamps_are(steps, piece_rows, max_gap_s):
    stamps_ns = np.cumsum([5e9, *(step * PERIOD_NS for step in steps)]).astype(np.int64)
    n = len(stamps_ns)
    volts = np.random.default_rng(0).normal(size=(n, 2))
    truth = np.arange(n) % 3 == 0
    recording = InPieces(Samples(volts, stamps_ns, truth), piece_rows)
    stretches = stretches_of(recording.pieces(RATE_HZ, max_gap_s))
    mended = StampGrid(1 / RATE_HZ, max_gap_s).mend(stamps_ns)
    for mine, of_stretch in zip(stretches, mended.stretches, strict=True):
        places = mended.places[of_stretch]
        np.testing.assert_array_equal(mine.volts, volts[places])
        np.testing.assert_array_equal(mine.stamps_ns, mended.stamps_ns[of_stretch])
        np.testing.assert_array_equal(mine.truth, truth[places])
        np.testing.assert_array_equal(mine.row_numbers, places)
    found = recording.counts
    assert (found.rows, found.stretches) == (mended.places.size, len(stretches))
    judged = mended.gaps, mended.bridged, mended.dropped
    assert (found.gaps, found.bridged_rows, found.dropped) == judged


def test_a_second_reading_counts_from_zero(tmp_path):
    recording = open_recording(save_rows(tmp_path / 'a.npz', np.full((30, 2), np.nan)))
    for _ in range(2):
        assert sum(len(piece.volts) for piece in recording.pieces()) == 30
        assert recording.counts == RecordingCounts(rows=30, stretches=1, bad_samples=60)


def test_a_rate_more_than_two_percent_off_is_an_error_with_both_and_the_option(tmp_path):
    path = tmp_path / 'a.npz'
    for rate_hz in (98.01, 102.0):
        recording = open_recording(save_rows(path, np.ones((30, 2)), rate_hz=rate_hz))
        assert sum(len(piece.volts) for piece in recording.pieces(RATE_HZ)) == 30
    save_rows(path, np.ones((30, 2)), rate_hz=97.9)
    said = message_of(next, open_recording(path).pieces(RATE_HZ))
    wrong = 'has 97.9 Hz where the parameter sample_rate_hz is 100 Hz'
    assert said.startswith(f'{path}: {wrong}, allowed: at most 2% apart, or --resample (recording')


def test_values_outside_of_the_valid_range_are_bad_samples_as_nan_and_infinity_are(tmp_path):
    volts = np.full((30, 2), 3.0)
    volts[10:14, 1] = 0.0, 9.0, np.nan, np.inf
    recording = open_recording(save_rows(tmp_path / 'a.npz', volts))
    for valid_range_v, n in (((-1e9, 1e9), 2), ((1.0, 5.0), 4)):
        recording.valid_range_v = valid_range_v
        list(recording.pieces())
        assert recording.counts.bad_samples == n


RATES_HZ = st.floats(0.1, 1e4)


def rate(times_s):
    return measure_rate(np.rint(1e9 * np.asarray(times_s)).astype(np.int64), 'the stamps')


@given(RATES_HZ, st.integers(0, 99), st.floats(0.0, 0.3))
def test_jitter_is_averaged(rate_hz, seed, jitter):
    moved = jitter * np.random.default_rng(seed).uniform(-0.5, 0.5, 500)
    assert rate((np.arange(500) + moved) / rate_hz) == pytest.approx(rate_hz, rel=2e-3)


@given(RATES_HZ, st.integers(0, 99), st.floats(0.0, 0.5), st.floats(0.0, 20.0))
def test_messages_that_come_late_and_in_bunches_do_not_change_it(rate_hz, seed, delay, stall):
    rng = np.random.default_rng(seed)
    held = stall * (rng.random(1024) < 0.01)
    moved = np.maximum.accumulate(np.arange(1024) + rng.exponential(delay, 1024) + held)
    times_s = (moved + 1e-6 * np.arange(1024)) / rate_hz
    assert rate(times_s) == pytest.approx(rate_hz, rel=2e-2)


@given(RATES_HZ, st.integers(0, 99), st.floats(0.0, 0.15), st.floats(0.0, 0.3))
def test_rows_that_are_lost_do_not_change_it(rate_hz, seed, lost, jitter):
    rng = np.random.default_rng(seed)
    moved = np.arange(1024) + jitter * rng.uniform(-0.5, 0.5, 1024)
    assert rate(moved[rng.random(1024) >= lost] / rate_hz) == pytest.approx(rate_hz, rel=1e-2)


@given(RATES_HZ, st.lists(st.integers(0, 98), max_size=5, unique=True), st.floats(3.0, 1e4))
def test_gaps_and_steps_back_do_not_count(rate_hz, places, periods):
    steps = np.ones(99)
    steps[places] = periods
    times_s = np.concatenate([[0.0], np.cumsum(steps)]) / rate_hz
    assert rate(times_s) == pytest.approx(rate_hz, rel=1e-5)
    assert rate(np.concatenate([times_s, times_s])) == pytest.approx(rate_hz, rel=1e-5)


@pytest.mark.parametrize('times_s', [[], [1.0], [1.0, 1.0, 1.0], [3.0, 2.0, 1.0]])
def test_without_two_stamps_that_rise_there_is_no_rate(times_s):
    with pytest.raises(ValueError, match='the stamps do not rise, allowed: two or more'):
        rate(times_s)


def test_a_rate_is_one_that_a_chain_can_have():
    for rate_hz in (1.0, 380.0, 1e6):
        assert require_rate(rate_hz) == rate_hz
    for rate_hz in (5e-324, 1e-300, 0.999, 1.001e6, 3.8e8, 1e300, np.inf, np.nan, -380.0, 0.0):
        with pytest.raises(ValueError, match=r'^has .* Hz, allowed: 1 to 1e\+06 Hz$'):
            require_rate(rate_hz)


@pytest.mark.parametrize(('from_hz', 'to_hz'), [(1000.0, 380.0), (380.0, 1000.0), (400.0, 390.0)])
def test_the_passband_is_flat_and_the_stopband_far_down(from_hz, to_hz):
    half_hz = min(from_hz, to_hz) / 2
    n = int(4 * from_hz)
    tones_hz = np.array([0.1, 0.4, 0.6, 0.95, 0.97, 1.0]) * half_hz
    volts = np.sin(2 * np.pi * np.outer(np.arange(n) / from_hz, tones_hz))
    out = resample(Samples(volts, np.arange(n)), from_hz, to_hz).volts
    at_s = np.arange(len(out)) / to_hz
    inner = (at_s > 1) & (at_s < 3)
    wanted = np.sin(2 * np.pi * np.outer(at_s, tones_hz))
    assert np.abs(out - wanted)[inner, :3].max() < 1e-3
    assert np.abs(out[inner, 3:]).max() < 10 ** (-70 / 20)


def test_a_baseline_stays_to_the_bit_and_a_bad_value_stays_where_it_was():
    volts = np.full((2000, 2), 4.3)
    volts[1000, 1] = np.inf
    read = resample(Samples(volts, np.arange(2000) * 1_000_000), 1000.0, 380.0).volts
    bad = ~np.isfinite(read)
    assert not bad[:, 0].any()
    assert np.flatnonzero(bad[:, 1]).tolist() in ([], [380])
    np.testing.assert_array_equal(read[~bad], 4.3)


def test_of_a_coarse_clock_the_rows_are_counted():
    assert rate(np.arange(2000) // 4 * 0.01) == pytest.approx(400.0, rel=0.01)


def test_each_stretch_is_resampled_on_its_own(tmp_path):
    stamps_ns = np.concatenate([np.arange(500), 5000 + np.arange(500)]) * 1_000_000
    volts = np.repeat([[1.0], [9.0]], 500, axis=0)
    slip = volts[:, 0] > 5.0
    path = save_rows(tmp_path / 'a.npz', volts, stamps_ns, rate_hz=1000.0, slip=slip)
    recording = open_recording(path, RecordingConfig(recording_resample=True))
    pieces = list(recording.pieces(380.0))
    for piece in pieces:
        np.testing.assert_array_equal(piece.truth, piece.volts[:, 0] > 5.0)
        assert np.abs(np.diff(piece.stamps_ns) - 1e9 / 380.0).max() < 1e4
    starts = [piece for piece in pieces if piece.new_stretch]
    assert [piece.stamps_ns[0] for piece in starts] == [0, 5_003_000_000]
    assert [float(piece.volts[0, 0]) for piece in starts] == [1.0, 9.0]
    values = np.unique(np.concatenate([piece.volts for piece in pieces]))
    assert values.tolist() == [1.0, 9.0]
    assert recording.counts.stretches == 2
    assert recording.counts.rows == sum(len(piece.volts) for piece in pieces)
