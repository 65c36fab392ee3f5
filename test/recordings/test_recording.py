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

"""Pieces of a recording: gaps, stretches and rates as the detector node treats them."""

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.samples import Samples
from slip_detector.chain.stamps import StampGrid
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import Recording, open_recording
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


@given(
    steps=st.lists(
        st.sampled_from([1, 1, 1, 1, 1.3, 0.7, 2, 4, 9, 10.4, 11, 50, 0, -1, -3, -100]),
        min_size=1,
        max_size=60,
    ),
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
