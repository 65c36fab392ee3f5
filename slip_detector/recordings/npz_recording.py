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

"""Recordings in npz files."""

import contextlib
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import default_channel_names
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.fields import listed, shortened
from slip_detector.recordings.labels import Labels, as_truth
from slip_detector.recordings.rates import checked_rate
from slip_detector.recordings.recording import PIECE_ROWS, Recording

#: Name of the array of stamps, as this package writes it.
STAMPS_KEY = 'stamps_ns'

#: Matches names of arrays that are probably times.
_TIMES = re.compile('stamp|time|clock|second|(^|_)(t|ts|ns|us|ms|sec)(_|$)', re.IGNORECASE)


class NpzRecording(Recording):
    """An npz file with the rows and their rate, and perhaps labels and stamps.

    Parameters
    ----------
    path
        The file.
    config
        Names of the arrays.
    labels
        Labels written by hand; None: none.

    Raises
    ------
    ValueError
        When the file is damaged, or an array is missing or wrong; names both.
    """

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        self._keys = (config.recording_volts_key, STAMPS_KEY, config.recording_truth_key)
        volts_key, _, truth_key = self._keys
        rate_key = config.recording_rate_key
        with self._archive() as archive:
            self._names = sorted(archive.files)
        for key in (volts_key, rate_key):
            if key not in self._names:
                raise ValueError(f'has no array {key}, there are: {listed(self._names)}')
        self.labelled = truth_key in self._names
        shape, dtype = self._shape_and_type(volts_key)
        if len(shape) != 2 or dtype.kind not in 'fiu':
            raise ValueError(
                f'{volts_key} has the shape {shape} and type {dtype}, allowed: numbers of '
                'shape (rows, channels)'
            )
        rate = self._loaded(rate_key)
        if rate.size != 1 or rate.dtype.kind not in 'fiu':
            raise ValueError(f'{rate_key} is {shortened(str(rate))}, allowed: a rate in Hz')
        self.sample_rate_hz = checked_rate(float(rate.item()))
        n, channels = shape
        if min(n, channels) < 1:
            raise ValueError('has no samples')
        self._limit.check_channels(channels)
        self.channel_names = default_channel_names(channels)
        self._check_columns(n)

    def _check_columns(self, n: int) -> None:
        """Check stamps and labels, and that no stamps are ignored as they have another name."""
        volts_key, stamps_key, truth_key = self._keys
        for key in {stamps_key, truth_key}.intersection(self._names):
            shape, dtype = self._shape_and_type(key)
            rows = shape[0] if shape else 1
            if rows != n:
                raise ValueError(f'{key} has {rows} rows, allowed: {n}, as {volts_key}')
            if shape not in ((n,), (n, 1)):
                raise ValueError(f'{key} has the shape {shape}, allowed: ({n},)')
            if key == stamps_key and dtype.kind not in 'iu':
                raise ValueError(
                    f'{key} has the type {dtype}, allowed: whole numbers of nanoseconds'
                )
        times = [name for name in self._names if _TIMES.search(name) and name not in self._keys]
        for name in [] if stamps_key in self._names or n == 1 else times:
            if self._shape_and_type(name)[0][:1] == (n,):
                raise ValueError(
                    f'has {name} but no {stamps_key}, allowed: the stamps as '
                    f'{stamps_key}, in whole nanoseconds, or no times'
                )

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        volts, stamps_ns, label = (self.array(key) for key in self._keys)
        assert volts is not None
        n = len(volts)
        if stamps_ns is None:
            stamps_ns = np.rint(np.arange(n) * (1e9 / self.sample_rate_hz))
        stamps_ns = stamps_ns.astype(np.int64).reshape(-1)
        truth = None if label is None else as_truth(label, self._keys[2])
        for first in range(0, n, PIECE_ROWS):
            rows = slice(first, first + PIECE_ROWS)
            part = np.asarray(volts[rows], dtype=np.float64)
            yield Samples(part, stamps_ns[rows], None if truth is None else truth[rows])

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return an array of the file by its name; None if there is no such array."""
        return self._loaded(name) if name in self._names else None

    def array_names(self) -> list[str]:
        """Return the names of all arrays."""
        return self._names

    def _loaded(self, name: str) -> NDArray[Any]:
        shape, dtype = self._shape_and_type(name)
        self._limit.check(math.prod(shape) * dtype.itemsize, name)
        with self._archive(name) as archive:
            return np.asarray(archive[name])

    def _shape_and_type(self, name: str) -> tuple[tuple[int, ...], np.dtype[Any]]:
        """Return what the header of an array says, without reading the array."""
        read = np.lib.format
        with self._archive(name) as archive:
            members = archive.zip.namelist()
            with archive.zip.open(f'{name}.npy' if f'{name}.npy' in members else name) as file:
                if read.read_magic(file) == (1, 0):
                    shape, _, dtype = read.read_array_header_1_0(file)
                else:
                    shape, _, dtype = read.read_array_header_2_0(file)
        return shape, dtype

    @contextlib.contextmanager
    def _archive(self, name: str = '') -> Iterator[Any]:
        """Open the archive; errors are one line with its path and the array that is read."""
        try:
            with open(self.path, 'rb') as file, np.load(file, allow_pickle=False) as archive:
                yield archive
        except OSError:
            raise
        except Exception as error:  # zipfile and numpy raise many kinds of error
            why = shortened(' '.join(str(error).split()))
            text = f' ({name}: {why})' if name else ''
            raise ValueError(f'{self.path}: is broken or not npz{text}') from None
