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

"""Recordings in npz files and in csv files."""

import contextlib
import csv
import decimal
import itertools
import zipfile
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples, Stamps
from slip_detector.parameters import (
    RATE_TOLERANCE,
    RecordingConfig,
    default_channel_names,
    name_list,
    quote,
    refuse,
    shortened,
)
from slip_detector.recordings.labels import Labels, read_truth
from slip_detector.recordings.rates import measure_rate, require_rate
from slip_detector.recordings.recording import PIECE_ROWS, Recording, name_errors

#: Name of the array of stamps in an npz, as this package writes it.
STAMPS_KEY = 'stamps_ns'

#: Name of the column of times in a csv.
TIME = 'time_s'

#: Limit of a time in seconds, as stamps are nanoseconds in 64 bits.
MOST_S = 9e9


class NpzRecording(Recording):
    """An npz file with rows and their rate, and perhaps labels and stamps; it is read whole."""

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        volts_key, rate_key = config.recording_volts_key, config.recording_rate_key
        truth_key, there = config.recording_truth_key, name_list(self.array_names())
        self.label_name = f'label {truth_key}, there are: {there}'
        volts, rate = self.array(volts_key), self.array(rate_key)
        if volts is None or rate is None:
            missing = volts_key if volts is None else rate_key
            raise ValueError(f'has no array {missing}, there are: {there}')
        if volts.ndim != 2 or not volts.size or volts.dtype.kind not in 'fiu':
            what = f'{volts_key} has the shape {volts.shape} and type {volts.dtype}'
            refuse(what, 'numbers of shape (rows, channels)')
        if rate.size != 1 or rate.dtype.kind not in 'fiu':
            raise ValueError(f'{rate_key} is {shortened(str(rate))}, allowed: a rate in Hz')
        self.sample_rate_hz = rate_hz = require_rate(float(rate.item()))
        self.n_rows = n = len(volts)
        self.channel_names = default_channel_names(volts.shape[1])
        stamps_ns, label = self.array(STAMPS_KEY), self.array(truth_key)
        for key, column in ((STAMPS_KEY, stamps_ns), (truth_key, label)):
            if column is not None and column.size != n:
                raise ValueError(f'{key} has the shape {column.shape}, allowed: ({n},)')
        even_ns = np.rint(np.arange(n) * (1e9 / rate_hz)).astype(np.int64)
        stamps_ns = even_ns if stamps_ns is None else _convert_stamps(stamps_ns.reshape(-1))
        stamped_hz = measure_rate(stamps_ns, STAMPS_KEY) if n > 1 else rate_hz
        # Of few rows jitter changes the rate.
        if abs(stamped_hz - rate_hz) > (RATE_TOLERANCE + 1 / n) * rate_hz:
            what = f'{STAMPS_KEY} has {stamped_hz:g} Hz, {rate_key} {rate_hz:g} Hz'
            refuse(what, 'the same rate in both')
        truth = None if label is None else read_truth(label, truth_key)
        self.has_truth |= truth is not None
        self._samples = Samples(volts, stamps_ns, truth)

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        for first in range(0, len(self._samples.volts), PIECE_ROWS):
            part = self._samples.take(slice(first, first + PIECE_ROWS))
            yield part._replace(volts=np.asarray(part.volts, np.float64))

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return an array of the file by its name; None if there is no such array."""
        with name_errors(self.path), self._archive() as archive:
            if name not in archive.files:
                return None
            self.check_size(archive.zip.getinfo(f'{name}.npy').file_size, name)
            return np.asarray(archive[name])

    def array_names(self) -> list[str]:
        """Return the names of all arrays."""
        with self._archive() as archive:
            return sorted(archive.files)

    @contextlib.contextmanager
    def _archive(self) -> Iterator[Any]:
        with open(self.path, 'rb') as file:
            if not zipfile.is_zipfile(file):
                refuse('is cut off, or no npz', 'what numpy.savez writes')
            with np.load(file, allow_pickle=False) as archive:
                yield archive


def _convert_stamps(stamps: NDArray[Any]) -> Stamps:
    """Return stamps as whole nanoseconds; raise a ValueError for other values."""
    if stamps.dtype.kind not in 'iuf':
        raise ValueError(f'{STAMPS_KEY} has the type {stamps.dtype}, allowed: whole nanoseconds')
    with np.errstate(invalid='ignore', over='ignore'):
        fits = (np.abs(stamps.astype(np.float64)) < MOST_S * 1e9) & (stamps % 1 == 0)
    if not fits.all():
        wrong = stamps[~fits][0]
        refuse(f'{STAMPS_KEY} has {wrong}', f'whole nanoseconds below {MOST_S * 1e9:g}')
    return stamps.astype(np.int64)


class CsvRecording(Recording):
    """A csv file with the time of each row in the column ``time_s``."""

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        self._truth_key = config.recording_truth_key
        # In many countries a semicolon or a tab is in place of the comma.
        with contextlib.closing(self._text()) as text:
            line = next(text, '')
        self._delimiter = max(',;\t', key=line.count)
        names = [name.strip() for name in next(csv.reader([line], delimiter=self._delimiter))]
        self._names = names = names[:-1] if names[-1:] == [''] else names
        self.has_truth |= self._truth_key in names
        self.label_name = f'label {self._truth_key}, there are: {name_list(names)}'
        self._truth_at = [k for k, name in enumerate(names) if name == self._truth_key]
        self._channels = [k for k, n in enumerate(names) if n not in (TIME, self._truth_key)]
        self.channel_names = tuple(names[k] for k in self._channels)
        if TIME not in names or not self.channel_names or len({*names, ''}) <= len(names):
            there = name_list([name or '(without name)' for name in names]) or 'none'
            allowed = f'{TIME} and one for each channel, each with a name of its own'
            refuse(f'line 1 has the columns {there}', allowed)
        stamps_ns = next((rows.stamps_ns for rows in self.read()), np.empty(0, np.int64))
        self.sample_rate_hz = require_rate(measure_rate(stamps_ns, f'the times in column {TIME}'))

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        # Closed here, as the traceback of an error would keep the file open.
        with contextlib.closing(self._text()) as text:
            rows = self._rows(text)
            while piece := list(itertools.islice(rows, PIECE_ROWS)):
                numbers, stamps_ns = (np.array(part) for part in zip(*piece, strict=True))
                truth: Any = (read_truth(numbers[:, k], self._truth_key) for k in self._truth_at)
                yield Samples(numbers[:, self._channels], stamps_ns, *truth)

    def _text(self) -> Generator[str, None, None]:
        """Yield the lines; the last only if it has an end, as it may be cut off in a number."""
        # utf-8-sig: spreadsheets begin the file with a byte order mark.
        with open(self.path, newline='', encoding='utf-8-sig') as file:
            for number, line in enumerate(file, 1):
                if number == 1 or line.endswith(('\n', '\r')):
                    yield line
                else:
                    what = f'line {number} has no end, so it may be cut off, and is left out'
                    self.counts.damage = f'{self.path.name}: {what}'

    def _rows(self, text: Iterator[str]) -> Iterator[tuple[list[float], int]]:
        """Yield the numbers and the exact stamp of each line."""
        time_at, n = self._names.index(TIME), len(self._names)
        lines = csv.reader(text, delimiter=self._delimiter)
        for cells in itertools.islice(lines, 1, None):
            line = ''.join(cells)
            if not line.strip():  # many programs write empty lines at the end
                continue
            try:
                numbers = [float(cell.strip() or 'nan') for cell in cells[:n]]
                # float64 would lose the digits of a date.
                time_s = decimal.Decimal(cells[time_at].strip())
                # Many programs write a comma at the end of each line. Python takes 1_0 for 10.
                fits = len(numbers) == n and not ''.join(cells[n:]).strip() and '_' not in line
                fits = fits and abs(time_s) < MOST_S
            except (ValueError, ArithmeticError, IndexError):
                fits = False
            if not fits:
                what = f'line {lines.line_num} is {quote(self._delimiter.join(cells))}'
                refuse(what, f'{n} decimal numbers, {TIME} below {MOST_S:g}')
            yield numbers, round(time_s * 1_000_000_000)
