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

"""Recordings in csv files: a header of names, a column of times, a column for each channel."""

import contextlib
import csv
import decimal
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, TextIO

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.fields import listed, shortened, shown_name
from slip_detector.recordings.labels import Labels
from slip_detector.recordings.rate import checked_rate, rate_of
from slip_detector.recordings.reading_limit import PIECE_ROWS
from slip_detector.recordings.recording import Recording
from slip_detector.recordings.truth import as_truth

TIME = 'time_s'

#: Characters allowed per channel in a line: the limit of a line is this times the most channels.
MOST_CELL = 64

#: Limit of a time in seconds, as stamps are nanoseconds in 64 bits.
MOST_S = 9e9


class _Lines(NamedTuple):
    """Lines of the file: numbers, (n, columns), and stamps, (n,), exact to the nanosecond."""

    cells: NDArray[np.float64]
    stamps_ns: NDArray[np.int64]


class CsvRecording(Recording):
    """A csv file with the time of each row in the column ``time_s``.

    Parameters
    ----------
    path
        The file.
    config
        Name of the column with the labels.
    labels
        Labels written by hand; None: none.

    Raises
    ------
    ValueError
        When a line or a column is missing or wrong; names it.

    Examples
    --------
    >>> import os, tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name) / 'trial.csv'
    >>> lines = 'time_s,a,b', '0.00,4.3,4.2', '0.01,4.3,4.2'
    >>> _ = path.write_text(os.linesep.join(lines))
    >>> recording = CsvRecording(path, RecordingConfig(), labels=None)
    >>> recording.channel_names, [piece.volts.shape for piece in recording.pieces()]
    (('a', 'b'), [(2, 2)])
    >>> folder.cleanup()
    """

    named = True

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        self._truth_key = config.recording_truth_key
        with self._open() as lines:
            self._names = names = [name.strip() for name in next(lines, [])]
        if TIME not in names:
            there = listed(names) or 'none'
            raise ValueError(f'{path}: line 1 has no column {TIME}, there are: {there}')
        if len(set(names)) != len(names):
            raise ValueError(f'{path}: line 1 has a name twice, allowed: each column once')
        self.labelled = self._truth_key in names
        self.channel_names = tuple(n for n in names if n not in (TIME, self._truth_key))
        self._limit.check_channels(len(self.channel_names))
        if not self.channel_names:
            raise ValueError(f'{path}: has no samples')
        first = next(self._lines(), None)
        rate_hz = None if first is None else rate_of(first.cells[:, names.index(TIME)])
        if rate_hz is None:
            raise ValueError(
                f'{path}: column {TIME} does not rise, allowed: two or more rows, each with its '
                'time'
            )
        self.sample_rate_hz = checked_rate(rate_hz, path)

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        columns = [self._names.index(name) for name in self.channel_names]
        for lines in self._lines():
            truth = None
            if self.labelled:
                label = lines.cells[:, self._names.index(self._truth_key)]
                truth = as_truth(label, self._truth_key, self.path)
            yield Samples(lines.cells[:, columns], lines.stamps_ns, truth)

    def array(self, name: str) -> 'NDArray[np.float64] | None':
        """Return a column of the file by its name; None if there is no such column."""
        if name not in self._names:
            return None
        column = self._names.index(name)
        return np.concatenate([lines.cells[:, column] for lines in self._lines()])

    def array_names(self) -> list[str]:
        """Return the names of all columns."""
        return sorted(self._names)

    @contextlib.contextmanager
    def _open(self) -> 'Iterator[csv._reader]':  # type: ignore[name-defined]
        """Open the file; errors are one line with its path."""
        try:
            # utf-8-sig: spreadsheets begin the file with a byte order mark.
            with open(self.path, newline='', encoding='utf-8-sig') as file:
                yield csv.reader(self._limited(file))
        except (UnicodeError, csv.Error):
            raise ValueError(f'{self.path}: is broken or not csv') from None

    def _limited(self, file: TextIO) -> Iterator[str]:
        """Yield the lines of the file; refuse a line longer than the most channels can need."""
        most = self._limit.channels * MOST_CELL
        number = 0
        while line := file.readline(most + 1):
            number += 1
            if len(line) > most:
                raise ValueError(
                    f'{self.path}: line {number} has more than {most} characters, allowed: fewer'
                )
            yield line

    def _lines(self) -> Iterator[_Lines]:
        """Yield the lines after the first as numbers, some thousands at a time."""
        columns, time_at = len(self._names), self._names.index(TIME)
        cells: list[list[float]] = []
        stamps_ns: list[int] = []
        with self._open() as lines:
            next(lines)
            for line in lines:
                if not line:  # many programs write an empty line at the end
                    continue
                try:
                    _check_digits(line)
                    cells.append(list(map(float, line)))
                    if len(line) != columns:
                        raise ValueError(f'has {len(line)} columns, allowed: {columns}')
                    stamps_ns.append(_nanoseconds(line[time_at]))
                except ValueError as error:
                    said = shortened(str(error))
                    raise ValueError(f'{self.path}: line {lines.line_num}: {said}') from None
                if len(cells) == PIECE_ROWS:
                    yield _Lines(np.array(cells), np.array(stamps_ns, dtype=np.int64))
                    cells, stamps_ns = [], []
        if cells:
            yield _Lines(np.array(cells), np.array(stamps_ns, dtype=np.int64))


def _check_digits(line: list[str]) -> None:
    """Refuse text that only Python takes for a number: 1_0, digits of other scripts."""
    text = ''.join(line)
    if '_' in text or not text.isascii():
        odd = next(cell for cell in line if '_' in cell or not cell.isascii())
        raise ValueError(f'has {shown_name(odd.strip())}, allowed: decimal numbers')


def _nanoseconds(text: str) -> int:
    """Convert seconds from text to nanoseconds; float64 would lose the digits of a date."""
    try:
        seconds = decimal.Decimal(text.strip())
        fits = seconds.is_finite() and abs(seconds) < MOST_S
    except decimal.DecimalException:  # an exponent beyond the range of Decimal
        fits = False
    if not fits:
        raise ValueError(f'{TIME} is {shown_name(text.strip())}, allowed: below {MOST_S:g} s')
    return int((seconds * 1_000_000_000).to_integral_value())
