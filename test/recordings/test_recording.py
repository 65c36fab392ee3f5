"""Pieces of a recording: gaps, stretches and rates as the detector node treats them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.chain.stamps import StampGrid
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings import (
    is_recording,
    npz_recording,
    open_recording,
)
from slip_detector.recordings.recording import RecordingCounts
from slip_detector.recordings.resample import Resampler
from slip_detector.recordings.rows import Piece
from support.recorded import read_recording

RATE_HZ = 100.0
PERIOD_NS = 10_000_000


def save(path, volts, stamps_ns=None, rate_hz=RATE_HZ, **arrays):
    if stamps_ns is not None:
        arrays['stamps_ns'] = stamps_ns
    np.savez(path, volts=volts, sample_rate_hz=rate_hz, **arrays)
    return path


def joined(pieces):
    """Return the stretches: volts, stamps, truth and source rows of each."""
    stretches = []
    for piece in pieces:
        if piece.new_stretch:
            stretches.append([])
        stretches[-1].append(piece)
    return [[np.concatenate([p[i] for p in parts]) for i in (0, 1, 2, 4)] for parts in stretches]


def as_the_node_does(volts, stamps_ns, truth, max_gap_s):
    """Feed the rows one by one to a grid, as nodes/detector.py does."""
    grid, counts = StampGrid(1 / RATE_HZ, max_gap_s), RecordingCounts(rows=0)
    stretches, last = [[]], None
    for i, stamp_ns in enumerate(stamps_ns.tolist()):
        arrival = grid.arrive(stamp_ns)
        if not arrival.accepted:
            counts.dropped += 1
            continue
        if arrival.reset:
            stretches.append([])
        for k in range(arrival.missing):
            at_ns = stamp_ns - round(arrival.missing * PERIOD_NS) + round(k * PERIOD_NS)
            stretches[-1].append((volts[last], at_ns, truth[last], last))
        counts.gaps += arrival.missing > 0
        counts.bridged_rows += arrival.missing
        stretches[-1].append((volts[i], stamp_ns, truth[i], i))
        last = i
    counts.rows = sum(map(len, stretches))
    counts.stretches = len(stretches)
    return [[np.array(column) for column in zip(*s, strict=True)] for s in stretches], counts


@given(
    steps=st.lists(
        st.sampled_from([1, 1, 1, 1, 1.3, 0.7, 2, 4, 9, 10.4, 11, 50, 0, -1, -3, -100]),
        min_size=1,
        max_size=60,
    ),
    piece_rows=st.integers(1, 12),
    max_gap_s=st.sampled_from([0.0, 0.05, 0.1]),
)
def test_any_stamps_are_treated_as_the_node_treats_them(
    tmp_path_factory, steps, piece_rows, max_gap_s
):
    stamps_ns = np.cumsum([5e9, *(step * PERIOD_NS for step in steps)]).astype(np.int64)
    n = len(stamps_ns)
    volts = np.random.default_rng(0).normal(size=(n, 2))
    truth = np.arange(n) % 3 == 0
    path = save(tmp_path_factory.mktemp('any') / 'a.npz', volts, stamps_ns, slip=truth)
    recording = open_recording(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(npz_recording, 'PIECE_ROWS', piece_rows)
        stretches = joined(recording.pieces(RATE_HZ, max_gap_s))
    wanted, counts = as_the_node_does(volts, stamps_ns, truth, max_gap_s)
    assert recording.counts == counts
    assert len(stretches) == len(wanted)
    for mine, theirs in zip(stretches, wanted, strict=True):
        for column, other in zip(mine, theirs, strict=True):
            np.testing.assert_array_equal(column, other)


@given(st.integers(1, 40), st.integers(1, 50))
def test_the_size_of_the_pieces_makes_no_difference(tmp_path_factory, n, piece_rows):
    volts = np.asfortranarray(np.random.default_rng(1).normal(size=(n, 3)))  # both orders are read
    path = save(tmp_path_factory.mktemp('cut') / 'a.npz', volts, slip=np.arange(n) % 2)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(npz_recording, 'PIECE_ROWS', piece_rows)
        pieces = list(open_recording(path).pieces())
    assert {len(piece.volts) for piece in pieces[:-1]} <= {piece_rows}
    np.testing.assert_array_equal(np.concatenate([piece.volts for piece in pieces]), volts)
    assert [piece.new_stretch for piece in pieces] == [True, *[False] * (len(pieces) - 1)]
    np.testing.assert_array_equal(read_recording(path).truth, np.arange(n) % 2 == 1)


def test_a_second_reading_counts_from_zero(tmp_path):
    recording = open_recording(save(tmp_path / 'a.npz', np.full((30, 2), np.nan)))
    for _ in range(2):
        assert sum(len(piece.volts) for piece in recording.pieces()) == 30
        assert recording.counts == RecordingCounts(rows=30, stretches=1, bad_samples=60)


@pytest.mark.parametrize(('rate_hz', 'allowed'), [(98.01, True), (102.0, True), (97.9, False)])
def test_a_rate_more_than_two_percent_off_is_an_error_with_both_and_the_option(
    tmp_path, rate_hz, allowed
):
    path = save(tmp_path / 'a.npz', np.ones((30, 2)), rate_hz=rate_hz)
    if allowed:
        assert sum(len(piece.volts) for piece in open_recording(path).pieces(RATE_HZ)) == 30
        return
    with pytest.raises(
        ValueError, match=r'97\.9 Hz where the parameter sample_rate_hz is 100 Hz'
    ) as e:
        next(open_recording(path).pieces(RATE_HZ))
    assert str(e.value).startswith(f'{path}: has ')
    assert str(e.value).endswith('at most 2% apart, or --resample (recording_resample: true)')


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
    path = save(tmp_path / 'a.npz', volts, rate_hz=from_hz, slip=(time_s >= 1.0) & (time_s < 2.0))
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
    read, *_ = resampled(save(tmp_path / 'a.npz', volts, rate_hz=1000.0), 380.0)
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
    path = save(
        tmp_path_factory.mktemp('cut') / 'a.npz', volts, rate_hz=from_hz, slip=volts[:, 0] > 0
    )
    for mine, whole in zip(
        resampled(path, 150.0, piece_rows), resampled(path, 150.0), strict=True
    ):
        assert mine.tobytes() == whole.tobytes()


def test_a_baseline_stays_to_the_bit_and_a_bad_value_stays_where_it_was(tmp_path):
    volts = np.full((2000, 2), 4.3)
    volts[1000, 1] = np.inf
    read, *_ = resampled(save(tmp_path / 'a.npz', volts, rate_hz=1000.0), 380.0)
    bad = ~np.isfinite(read)
    assert not bad[:, 0].any()
    assert np.flatnonzero(bad[:, 1]).tolist() in ([], [380])
    np.testing.assert_array_equal(read[~bad], 4.3)


def test_each_stretch_is_resampled_on_its_own(tmp_path):
    stamps_ns = np.concatenate([np.arange(500), 5000 + np.arange(500)]) * 1_000_000
    volts = np.repeat([[1.0], [9.0]], 500, axis=0)
    path = save(tmp_path / 'a.npz', volts, stamps_ns, rate_hz=1000.0)
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


def test_other_arrays_of_a_file_are_given_by_name(tmp_path):
    recording = open_recording(save(tmp_path / 'a.npz', np.ones((5, 2)), velocity=np.arange(5)))
    np.testing.assert_array_equal(recording.array('velocity'), np.arange(5))
    assert recording.array('nothing') is None
    assert recording.array_names() == ['sample_rate_hz', 'velocity', 'volts']
    (tmp_path / 'a.csv').write_text('time_s,a,v\n0,1,5\n1,2,6\n')
    np.testing.assert_array_equal(open_recording(tmp_path / 'a.csv').array('v'), [5, 6])


def test_a_csv_keeps_its_gaps_and_its_nanoseconds(tmp_path):
    lines = ['1700000000.123456789,1', '1700000000.133456789,2', '1700000000.143456788,3']
    (tmp_path / 'a.csv').write_text('\n'.join(['time_s,a', *lines, '1700000009,4']))
    recording = open_recording(tmp_path / 'a.csv')
    pieces = list(recording.pieces())
    stamps_ns = np.concatenate([piece.stamps_ns for piece in pieces]) - 1_700_000_000_000_000_000
    assert stamps_ns.tolist() == [123_456_789, 133_456_789, 143_456_788, 9_000_000_000]
    assert recording.counts.stretches == 2


def test_a_recording_is_known_by_its_ending_or_its_metadata(tmp_path):
    for ending in ('.npz', '.csv', '.mcap', '.db3'):
        assert is_recording(tmp_path / f'a{ending}')
    assert not is_recording(tmp_path / 'a.yaml')
    assert not is_recording(tmp_path)
    (tmp_path / 'metadata.yaml').touch()
    assert is_recording(tmp_path)
