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

"""Base class of all recordings; it handles gaps in the stamps like the detector node."""

import contextlib
import dataclasses
import itertools
import sys
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples
from slip_detector.chain.stamps import StampGrid
from slip_detector.parameters import RATE_TOLERANCE, RecordingConfig, rates_differ, refuse
from slip_detector.recordings.labels import Labels, label_times
from slip_detector.recordings.rates import MOST_FACTOR, resample

#: Number of rows that are read at a time: enough to be fast, and only some MB for 100 channels.
PIECE_ROWS = 8192

#: Longest error on a file.
MOST_CHARACTERS = 1500


@dataclasses.dataclass
class RecordingCounts:
    """Counts of a reading, which are complete when all pieces have been read.

    Attributes
    ----------
    rows : int
        Rows that were returned, including those that bridge gaps.
    bridged_rows : int
        Rows that bridge short gaps: copies of the last row before the gap.
    gaps : int
        Short gaps that were bridged.
    stretches : int
        Stretches: runs of rows without a long gap; at least one.
    bad_samples : int
        Values that are NaN, infinite or outside of ``valid_range_v``.
    dropped : int
        Rows that were left out: their stamp does not fit those before, or their channels are not
        those of the first message.
    damage : str
        One line on the part of a recording that could not be read; empty if all was read.
    """

    rows: int = 0
    bridged_rows: int = 0
    gaps: int = 0
    stretches: int = 0
    bad_samples: int = 0
    dropped: int = 0
    damage: str = ''


@contextlib.contextmanager
def name_errors(path: Path) -> Iterator[None]:
    """Within a block, turn any error of reading a file into a ValueError of one line.

    NumPy, zipfile, csv and rosbags raise many kinds of error for a damaged file.
    """
    try:
        yield
    except Exception as error:
        text = f'is broken, or not {path.suffix} ({type(error).__name__}: {error})'
        if isinstance(error, OSError):
            text = f'cannot be read ({error.strerror or error})'
        elif isinstance(error, ValueError):
            text = str(error).removeprefix(f'{path}: ')
        text = textwrap.shorten(text, MOST_CHARACTERS, placeholder='...')
        raise ValueError(f'{path}: {text}') from None


class Recording(ABC):
    """A recording that is read in pieces; see :func:`open_recording`.

    Each file format has a derived class that reads the rows.

    Attributes
    ----------
    path : Path
    sample_rate_hz : float
    channel_names : tuple of str
        ch1, ch2, ... where the recording has no names.
    has_truth : bool
        Whether the true slip is known.
    label_name : str
        Name of the label that was looked for, for the error where there is none.
    accuracy_s : float
        How exact the label is; 0: exact.
    kind : str
        One of :data:`.labels.KINDS`, recordings in which nothing slides; '': none of them.
    mistaken : bool
        Whether a person has marked the labels as a mistake; the recording then has no labels.
    input : dict
        ``input_type`` and ``input_field`` for a detector of a bag's messages; empty without a bag.
    counts : RecordingCounts
        Counts of the last reading.
    valid_range_v : tuple of float
        Values outside of it count as bad samples, as do NaN and infinity.
    n_rows : int or None
        Number of rows, of a bag by its messages; None: not known before all are read.
    """

    path: Path
    sample_rate_hz: float
    channel_names: tuple[str, ...]
    label_name: str
    n_rows: 'int | None' = None
    valid_range_v = (-sys.float_info.max, sys.float_info.max)

    def __init__(self, path: Path, labels: 'Labels | None', config: RecordingConfig) -> None:
        self.path, self._limit_mb = path, config.recording_limit_mb
        self.counts, self.input = RecordingCounts(), dict[str, str]()
        self._labels, self._resample = labels, config.recording_resample
        self.has_truth, self.accuracy_s = labels is not None, labels.accuracy_s if labels else 0.0
        self.kind = labels.kind if labels else ''
        self.mistaken = labels is not None and labels.mistaken

    @property
    def is_labelled(self) -> bool:
        """Whether it is known where there is slip, or that there is none."""
        return not self.mistaken and (self.has_truth or bool(self.kind))

    @abstractmethod
    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return another array of an npz by its name; None if there is no such array."""
        return None

    def array_names(self) -> list[str]:
        """Return the names that :meth:`array` knows."""
        return []

    def check_size(self, n_bytes: float, what: str) -> None:
        """Raise an error, before anything is allocated, for what is larger than the limit."""
        if n_bytes > 1e6 * self._limit_mb:
            text = f'{self._limit_mb:g} MB (recording_limit_mb)'
            refuse(f'{self.path}: {what} takes {n_bytes / 1e6:.0f} MB', text)

    def check_rate(self, wanted_hz: float) -> None:
        """Raise an error for a chain's rate that differs, unless it is resampled to that."""
        rate_hz = self.sample_rate_hz
        factor = max(rate_hz / wanted_hz, wanted_hz / rate_hz)
        if rates_differ(rate_hz, wanted_hz) and not (self._resample and factor <= MOST_FACTOR):
            what = f'has {rate_hz:g} Hz where the parameter sample_rate_hz is {wanted_hz:g} Hz'
            text = f'--resample (recording_resample: true) up to a factor of {MOST_FACTOR}'
            refuse(f'{self.path}: {what}', f'at most {RATE_TOLERANCE:.0%} apart, or {text}')

    def rows(self) -> Generator[Samples, None, None]:
        """Yield all rows as they were recorded, with labels if there are any.

        Yields
        ------
        Samples
            At least one row each.

        Raises
        ------
        ValueError
            When the file is broken or a label ends after the recording; names the file and the
            place.
        """
        self.counts = RecordingCounts()
        labels, (low_v, high_v) = self._labels, self.valid_range_v
        n = first_ns = last_ns = 0
        with name_errors(self.path):
            for rows in self.read():
                first_ns = first_ns if n else int(rows.stamps_ns[0])
                last_ns, n = int(rows.stamps_ns[-1]), n + len(rows.volts)
                good = (rows.volts >= low_v) & (rows.volts <= high_v)
                self.counts.bad_samples += int(np.count_nonzero(~good))
                after_ns = rows.stamps_ns - first_ns
                label = label_times(after_ns, labels.edges_ns, labels.accuracy_s) if labels else {}
                known: dict[str, Any] = {'accuracy_s': self.accuracy_s, 'kind': self.kind, **label}
                yield rows._replace(**({'truth': None} if self.mistaken else known))
        damage, seconds = self.counts.damage, (last_ns - first_ns) * 1e-9
        if damage:
            self.counts.damage = f'{damage}: {n} samples up to {seconds:.3f} s are read'
        end_s = seconds + 1 / self.sample_rate_hz
        if labels and not damage and (labels.edges_s > end_s).any():
            what = 'the slip [{:g}, {:g}] s is outside the recording'.format(*labels.edges_s[-1])
            refuse(f'{labels.path}: {what} {self.path.name}', f'0 to {end_s:.6g} s')

    def pieces(
        self, chain_rate_hz: 'float | None' = None, max_gap_s: float = 0.1
    ) -> Iterator[Samples]:
        """Yield the rows as the detector node passes them to its chain.

        A row whose stamp does not fit is dropped (see :class:`.StampGrid`). A gap of up to
        ``max_gap_s`` is bridged with the last row; after a longer gap a new stretch begins.

        Parameters
        ----------
        chain_rate_hz
            Rate for which the chain is configured; None: the rate of the recording.
        max_gap_s
            Longest gap that is bridged.

        Yields
        ------
        Samples
            At least one row each, evenly spaced within a stretch, with ``row_numbers``.

        Raises
        ------
        ValueError
            When the file is broken, or its rate differs from that of the chain and resampling is
            not configured; names the file.

        Examples
        --------
        >>> import tempfile
        >>> from pathlib import Path
        >>> import numpy as np
        >>> from slip_detector.recordings import open_recording
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = Path(folder) / 'trial.npz'
        ...     when = np.array([0, 1, 2, 4, 5, 90, 91, 92, 93, 94])  # two gaps, one is long
        ...     stamps_ns = when * 10_000_000
        ...     np.savez(path, volts=np.ones((10, 2)), sample_rate_hz=100.0, stamps_ns=stamps_ns)
        ...     recording = open_recording(path)
        ...     pieces = list(recording.pieces(max_gap_s=0.1))
        >>> [len(piece.volts) for piece in pieces], recording.counts.bridged_rows
        ([6, 2], 1)
        """
        rate_hz, wanted_hz = self.sample_rate_hz, chain_rate_hz or self.sample_rate_hz
        apart = rates_differ(rate_hz, wanted_hz)
        self.check_rate(wanted_hz)
        pieces = self._stretches(rate_hz if apart else wanted_hz, max_gap_s)
        if apart:
            pieces = self._resample_stretches(pieces, rate_hz, wanted_hz)
        for piece in pieces:
            self.counts.rows += len(piece.volts)
            self.counts.stretches += piece.new_stretch
            yield piece

    def _resample_stretches(
        self, pieces: Iterator[Samples], from_hz: float, to_hz: float
    ) -> Iterator[Samples]:
        parts: list[Samples] = []
        for piece in itertools.chain(pieces, [None]):
            if parts and (piece is None or piece.new_stretch):
                stretch = parts[0].then(*parts[1:])
                n_bytes = stretch.volts.nbytes * max(1.0, to_hz / from_hz)
                self.check_size(n_bytes, 'a stretch to resample')
                yield resample(stretch, from_hz, to_hz)
                parts = []
            parts += [] if piece is None else [piece]

    def _stretches(self, rate_hz: float, max_gap_s: float) -> Iterator[Samples]:
        """Yield the rows with bridged gaps; each piece is within one stretch."""
        grid = StampGrid(1 / rate_hz, max_gap_s)
        n, last = 0, None
        for rows in self.rows():
            piece = rows._replace(row_numbers=np.arange(n, n + len(rows.volts)))
            n += len(rows.volts)
            steps_ns = np.diff(piece.stamps_ns)
            bridged_ns = steps_ns[(steps_ns > 0) & (steps_ns <= 1e9 * max_gap_s)].sum()
            n_bytes = bridged_ns / grid.period_ns * piece.volts[0].nbytes
            self.check_size(n_bytes, 'what bridges the gaps')
            mended = grid.mend(piece.stamps_ns)
            self.counts.gaps += mended.gaps
            self.counts.bridged_rows += mended.bridged
            self.counts.dropped += mended.dropped
            # The last row before this piece may have to bridge its first gap.
            before = (piece if last is None else last).take(slice(-1, None))
            piece = before.then(piece).take(mended.places + 1)
            piece = piece._replace(stamps_ns=mended.stamps_ns)
            is_new = last is None or mended.first_is_new
            for of_stretch in mended.stretches:
                last = piece.take(of_stretch)._replace(new_stretch=is_new)
                is_new = True
                yield last
