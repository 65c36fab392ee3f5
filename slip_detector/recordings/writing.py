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

"""Writes recordings as bags, npz or csv files, by the ending of the path."""

import csv
import os
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.parameters.files import whole_file, write_errors_of
from slip_detector.recordings.bag_writer import PLUGINS, BagWriter

_NPZ_KEYS = ('volts', 'stamps_ns', 'slip', 'position_m')


def write_recording(
    path: 'str | Path',
    pieces: Iterable[Samples],
    sample_rate_hz: float,
    channel_names: Sequence[str],
    frame_id: str = 'fingertip',
) -> None:
    """Write a recording that :func:`~slip_detector.recordings.open_recording` reads.

    Parameters
    ----------
    path
        The new file: .npz, .csv, .mcap or .db3. Without an ending it is the folder of a bag (MCAP
        with metadata.yaml, as ``ros2 bag record`` writes it). In bags the rows are on
        ``voltages``, the truth on ``slip_truth`` and the position on ``platform_position``.
    pieces
        The rows, at least one; the truth is in all pieces or in none.
    sample_rate_hz
        Rate of the rows; written to npz only.
    channel_names
        A name for each channel; not written to npz.
    frame_id
        Frame of the messages in a bag.

    Raises
    ------
    ValueError
        When the path exists already, has another ending or cannot be written; names it.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.recordings import open_recording, write_recording
    >>> rows = Samples(np.full((100, 2), 4.3), np.arange(100) * 10_000_000)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.csv'
    ...     write_recording(path, [rows], sample_rate_hz=100.0, channel_names=['a', 'b'])
    ...     recording = open_recording(path)
    >>> recording.channel_names, round(recording.sample_rate_hz, 6), recording.has_truth
    (('a', 'b'), 100.0, False)
    """
    path = Path(path)
    writers: dict[str, Callable[[Path], None]] = {
        '.npz': lambda to: _write_npz(to, pieces, sample_rate_hz),
        '.csv': lambda to: _write_csv(to, pieces, channel_names),
        **{
            ending: lambda to: _write_bag(to, pieces, channel_names, frame_id)
            for ending in ('', *PLUGINS)
        },
    }
    if path.suffix not in writers:
        raise ValueError(
            f'{path}: is {path.suffix}, allowed: .npz, .csv, .mcap, .db3 or without ending'
        )
    if path.exists():
        raise ValueError(f'{path}: already exists, allowed: a new path')
    with write_errors_of(path):
        path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as new:
        writers[path.suffix](new)


def _write_csv(path: Path, pieces: Iterable[Samples], names: Sequence[str]) -> None:
    first = True
    with open(path, 'w', newline='', encoding='utf-8') as file:
        lines = csv.writer(file)
        for piece in pieces:
            truth: list[list[int]] = [[] for _ in piece.volts]
            if piece.truth is not None:
                truth = [[int(slip)] for slip in piece.truth]
            if first:
                lines.writerow(['time_s', *names, *(['slip'] if piece.truth is not None else [])])
                first = False
            for stamp_ns, row, slip in zip(
                piece.stamps_ns.tolist(), piece.volts.tolist(), truth, strict=True
            ):
                sign, (seconds, rest) = '-' * (stamp_ns < 0), divmod(abs(stamp_ns), 1_000_000_000)
                # The repr of a float is read back to the same bits.
                lines.writerow([f'{sign}{seconds}.{rest:09d}', *map(repr, row), *slip])


def _write_npz(path: Path, pieces: Iterable[Samples], sample_rate_hz: float) -> None:
    columns = {
        key: [column for column in parts if column is not None]
        for key, parts in zip(_NPZ_KEYS, zip(*pieces, strict=True), strict=False)
    }
    arrays: dict[str, Any] = {key: np.concatenate(p) for key, p in columns.items() if p}
    np.savez(path, sample_rate_hz=sample_rate_hz, **arrays)


def _write_bag(path: Path, pieces: Iterable[Samples], names: Sequence[str], frame_id: str) -> None:
    """Write the folder of a bag or, if the path has an ending, only the file with its messages."""
    bag = BagWriter(path.with_suffix(''), names, frame_id, path.suffix or '.mcap')
    try:
        for piece in pieces:
            bag.write(piece)
    except BaseException:
        bag.abort()
        raise
    bag.close()
    if path.suffix:
        os.replace(bag.path, path)
