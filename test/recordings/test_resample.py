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

"""Resampling: what both rates hold is kept, whatever the pieces, and what not is taken out."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings import (
    npz_recording,
    open_recording,
)
from slip_detector.recordings.piece import Piece
from slip_detector.recordings.resample import MOST_ROWS, Resampler
from support.recorded import save_rows


def resampled(path, rate_hz, piece_rows=8192):
    recording = open_recording(path, RecordingConfig(recording_resample=True))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(npz_recording, 'PIECE_ROWS', piece_rows)
        pieces = list(recording.pieces(rate_hz))
    columns = [[piece[i] for piece in pieces] for i in (0, 1, 2)]
    return [None if column[0] is None else np.concatenate(column) for column in columns]


@pytest.mark.parametrize('from_hz', [60.0, 200.0, 379.0 * 1.03, 1000.0, 1234.5])
def test_resampling_keeps_what_both_rates_hold_and_the_times(tmp_path, from_hz):
    to_hz, n = 380.0, int(3 * from_hz)
    tone_hz = 0.2 * min(from_hz, to_hz)
    time_s = np.arange(n) / from_hz
    volts = 4.3 + np.sin(2 * np.pi * np.outer(time_s, [tone_hz, tone_hz / 3]) + [0.3, 0])
    path = save_rows(
        tmp_path / 'a.npz', volts, rate_hz=from_hz, slip=(time_s >= 1.0) & (time_s < 2.0)
    )
    read, stamps_ns, truth = resampled(path, to_hz)
    at_s = np.arange(len(read)) / to_hz
    assert abs(len(read) - (n - 1) / from_hz * to_hz) <= 1
    np.testing.assert_allclose(stamps_ns * 1e-9, at_s, atol=1e-8)
    inner = (at_s > 0.8) & (at_s < 2.2)
    wanted = 4.3 + np.sin(2 * np.pi * np.outer(at_s, [tone_hz, tone_hz / 3]) + [0.3, 0])
    np.testing.assert_allclose(read[inner], wanted[inner], atol=2e-3)
    assert np.all(truth[(at_s > 1.0 + 1 / from_hz) & (at_s < 2.0 - 1 / from_hz)])
    assert not truth[(at_s < 1.0 - 1 / from_hz) | (at_s > 2.0 + 1 / from_hz)].any()


def test_what_the_new_rate_cannot_hold_is_taken_out(tmp_path):
    time_s = np.arange(6000) / 1000.0
    volts = 4.3 + np.sin(2 * np.pi * np.outer(time_s, [250.0, 190.0]))
    read, *_ = resampled(save_rows(tmp_path / 'a.npz', volts, rate_hz=1000.0), 380.0)
    # 250 Hz would fold to 130 Hz, where the chain listens.
    assert np.abs(read[100:-100] - 4.3).max() < 1e-3


@pytest.mark.parametrize(('from_hz', 'to_hz'), [(1000.0, 380.0), (380.0, 1000.0), (400.0, 390.0)])
def test_the_passband_is_flat_and_the_stopband_far_down(from_hz, to_hz):
    half_hz = min(from_hz, to_hz) / 2
    n = int(4 * from_hz)
    tones_hz = np.array([0.1, 0.4, 0.6, 0.95, 0.97, 1.0]) * half_hz
    volts = np.sin(2 * np.pi * np.outer(np.arange(n) / from_hz, tones_hz))
    piece = Piece(volts, np.arange(n), None, True, np.arange(n))
    out = np.concatenate([part.volts for part in Resampler(from_hz, to_hz).pieces(iter([piece]))])
    at_s = np.arange(len(out)) / to_hz
    inner = (at_s > 1) & (at_s < 3)
    wanted = np.sin(2 * np.pi * np.outer(at_s, tones_hz))
    assert np.abs(out - wanted)[inner, :3].max() < 1e-3
    assert np.abs(out[inner, 3:]).max() < 10 ** (-70 / 20)


@given(
    st.integers(1, 200),
    st.integers(1, 60),
    st.sampled_from([60.0, 97.0, 400.0, 1000.0]),
    st.sets(st.integers(1, 199), max_size=4),
)
def test_resampling_does_not_depend_on_the_pieces(tmp_path_factory, n, piece_rows, from_hz, bad):
    volts = np.random.default_rng(2).normal(size=(n, 2))
    volts[[k for k in bad if k < n], 1] = np.nan
    path = save_rows(
        tmp_path_factory.mktemp('cut') / 'a.npz', volts, rate_hz=from_hz, slip=volts[:, 0] > 0
    )
    for mine, whole in zip(
        resampled(path, 150.0, piece_rows), resampled(path, 150.0), strict=True
    ):
        assert mine.tobytes() == whole.tobytes()


def test_a_baseline_stays_to_the_bit_and_a_bad_value_stays_where_it_was(tmp_path):
    volts = np.full((2000, 2), 4.3)
    volts[1000, 1] = np.inf
    read, *_ = resampled(save_rows(tmp_path / 'a.npz', volts, rate_hz=1000.0), 380.0)
    bad = ~np.isfinite(read)
    assert not bad[:, 0].any()
    assert np.flatnonzero(bad[:, 1]).tolist() in ([], [380])
    np.testing.assert_array_equal(read[~bad], 4.3)


def test_each_stretch_is_resampled_on_its_own(tmp_path):
    stamps_ns = np.concatenate([np.arange(500), 5000 + np.arange(500)]) * 1_000_000
    volts = np.repeat([[1.0], [9.0]], 500, axis=0)
    path = save_rows(tmp_path / 'a.npz', volts, stamps_ns, rate_hz=1000.0)
    recording = open_recording(path, RecordingConfig(recording_resample=True))
    pieces = list(recording.pieces(380.0))
    starts = [piece for piece in pieces if piece.new_stretch]
    assert [piece.stamps_ns[0] for piece in starts] == [0, 5_000_000_000]
    assert [float(piece.volts[0, 0]) for piece in starts] == [1.0, 9.0]
    values = np.unique(np.concatenate([piece.volts for piece in pieces]))
    assert values.tolist() == [1.0, 9.0]
    assert recording.counts.stretches == 2
    assert recording.counts.rows == sum(len(piece.volts) for piece in pieces)


def test_a_resampler_needs_no_truth():
    piece = Piece(np.ones((50, 1)), np.arange(50), None, True, np.arange(50))
    (out, *rest) = Resampler(100.0, 200.0).pieces(iter([piece]))
    assert out.truth is None
    assert sum(len(part.volts) for part in (out, *rest)) == 99


@pytest.mark.parametrize(('from_hz', 'to_hz'), [(1.0, 1001.0), (1001.0, 1.0)])
def test_rates_too_far_apart_are_refused_with_both(tmp_path, from_hz, to_hz):
    path = tmp_path / 'a.npz'
    np.savez(path, volts=np.zeros((10, 2)), sample_rate_hz=from_hz)
    recording = open_recording(path, RecordingConfig(recording_resample=True))
    with pytest.raises(ValueError, match=rf'has {from_hz:g} Hz .* {to_hz:g} Hz, .* at most 1000'):
        next(recording.pieces(to_hz))


def test_a_row_that_becomes_a_thousand_is_given_in_pieces_of_known_size(tmp_path):
    path = tmp_path / 'a.npz'
    np.savez(path, volts=np.tile([[0.0], [1.0]], (50, 2)), sample_rate_hz=1.0)
    recording = open_recording(path, RecordingConfig(recording_resample=True))
    lengths = [len(piece.volts) for piece in recording.pieces(1000.0)]
    assert max(lengths) == MOST_ROWS
    assert sum(lengths) == 99_001
