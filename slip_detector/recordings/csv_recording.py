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

import csv
import decimal
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.fields import listed, shown
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
        self._names = names = [name.strip() for name in next(self._lines(), [])]
        self.labelled = self._truth_key in names
        self._channels = [k for k, n in enumerate(names) if n not in (TIME, self._truth_key)]
        self.channel_names = tuple(names[k] for k in self._channels)
        if TIME not in names or not self.channel_names or len(set(names)) != len(names):
            raise ValueError(
                f'line 1 has the columns {listed(names) or "none"}, allowed: {TIME} and one for '
                'each channel, each name once'
            )
        first = next(self.read(), None)
        stamps_ns = np.empty(0, np.int64) if first is None else first.stamps_ns
        self.sample_rate_hz = checked_rate(rate_of(stamps_ns, f'the times in column {TIME}'))

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        rows = self._rows()
        while some := list(itertools.islice(rows, PIECE_ROWS)):
            numbers, stamps_ns = (np.array(part) for part in zip(*some, strict=True))
            truth = None
            if self.labelled:
                label = numbers[:, self._names.index(self._truth_key)]
                truth = as_truth(label, self._truth_key)
            yield Samples(numbers[:, self._channels], stamps_ns, truth)

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return a column of the file by its name; None if there is no such column."""
        if name not in self._names:
            return None
        column = self._names.index(name)
        with named_errors(self.path):
            return np.array([numbers[column] for numbers, _ in self._rows()])

    def array_names(self) -> list[str]:
        """Return the names of all columns."""
        return sorted(self._names)

    def _lines(self) -> Iterator[list[str]]:
        # utf-8-sig: spreadsheets begin the file with a byte order mark.
        with open(self.path, newline='', encoding='utf-8-sig') as file:
            yield from csv.reader(file)

    def _rows(self) -> Iterator[tuple[list[float], int]]:
        """Yield the numbers and the exact stamp of each line."""
        time_at, n = self._names.index(TIME), len(self._names)
        for number, line in enumerate(self._lines(), 1):
            if number == 1 or not line:  # many programs write an empty line at the end
                continue
            try:
                numbers = list(map(float, line))
                # float64 would lose the digits of a date.
                time_s = decimal.Decimal(line[time_at].strip())
                fits = len(line) == n and abs(time_s) < MOST_S
            except (ValueError, ArithmeticError, IndexError):
                fits = False
            if not fits:
                raise ValueError(
                    f'line {number} is {shown(",".join(line))}, allowed: {n} decimal numbers, '
                    f'{TIME} below {MOST_S:g}'
                )
            yield numbers, round(time_s * 1_000_000_000)
