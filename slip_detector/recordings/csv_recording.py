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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.fields import listed, shortened, shown_name
from slip_detector.recordings.labels import Labels, as_truth
from slip_detector.recordings.rates import checked_rate, rate_of
from slip_detector.recordings.recording import PIECE_ROWS, Recording, named_errors

TIME = 'time_s'

#: Limit of a time in seconds, as stamps are nanoseconds in 64 bits.
MOST_S = 9e9


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
    """

    named = True

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        self._truth_key = config.recording_truth_key
        with self._open() as lines:
            self._names = names = [name.strip() for name in next(lines, [])]
        if TIME not in names:
            raise ValueError(f'line 1 has no column {TIME}, there are: {listed(names) or "none"}')
        if len(set(names)) != len(names):
            raise ValueError('line 1 has a name twice, allowed: each column once')
        self.labelled = self._truth_key in names
        self.channel_names = tuple(n for n in names if n not in (TIME, self._truth_key))
        self._limit.check_channels(len(self.channel_names))
        if not self.channel_names:
            raise ValueError('has no samples')
        first = next(self._columns(), None)
        rate_hz = None if first is None else rate_of(first[0][:, names.index(TIME)])
        if rate_hz is None:
            raise ValueError(
                f'column {TIME} does not rise, allowed: two or more rows, each with its time'
            )
        self.sample_rate_hz = checked_rate(rate_hz)

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        channels = [self._names.index(name) for name in self.channel_names]
        for cells, stamps_ns in self._columns():
            truth = None
            if self.labelled:
                label = cells[:, self._names.index(self._truth_key)]
                truth = as_truth(label, self._truth_key)
            yield Samples(cells[:, channels], stamps_ns, truth)

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return a column of the file by its name; None if there is no such column."""
        if name not in self._names:
            return None
        column = self._names.index(name)
        with named_errors(self.path):
            return np.concatenate([cells[:, column] for cells, _ in self._columns()])

    def array_names(self) -> list[str]:
        """Return the names of all columns."""
        return sorted(self._names)

    @contextlib.contextmanager
    def _open(self) -> Iterator[Any]:
        """Open the file; errors are one line with its path."""
        try:
            # utf-8-sig: spreadsheets begin the file with a byte order mark.
            with open(self.path, newline='', encoding='utf-8-sig') as file:
                yield csv.reader(file)
        except (UnicodeError, csv.Error):
            raise ValueError('is broken or not csv') from None

    def _columns(self) -> Iterator[tuple[NDArray[np.float64], NDArray[np.int64]]]:
        """Yield numbers, (n, columns), and exact stamps, (n,), of some thousand lines."""
        time_at = self._names.index(TIME)
        cells: list[list[float]] = []
        stamps_ns: list[int] = []
        with self._open() as lines:
            next(lines)
            for line in lines:
                try:
                    if line:  # many programs write an empty line at the end
                        cells.append(self._numbers(line))
                        stamps_ns.append(_nanoseconds(line[time_at]))
                except ValueError as error:
                    why = shortened(str(error))
                    raise ValueError(f'line {lines.line_num}: {why}') from None
                if len(cells) == PIECE_ROWS:
                    yield np.array(cells), np.array(stamps_ns, dtype=np.int64)
                    cells, stamps_ns = [], []
        if cells:
            yield np.array(cells), np.array(stamps_ns, dtype=np.int64)

    def _numbers(self, line: list[str]) -> list[float]:
        # Python takes 1_0 and digits of other scripts for numbers.
        odd = [cell for cell in line if '_' in cell or not cell.isascii()]
        if odd:
            raise ValueError(f'has {shown_name(odd[0].strip())}, allowed: decimal numbers')
        numbers = list(map(float, line))
        if len(line) != len(self._names):
            raise ValueError(f'has {len(line)} columns, allowed: {len(self._names)}')
        return numbers


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
