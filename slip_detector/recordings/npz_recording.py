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

"""Recordings in npz files, which are read in pieces.

numpy.load would read all rows at once: 170 MB for an hour of 16 channels at 380 Hz. A piece has
some MB, and the driver gets its first sample at once.
"""

import contextlib
import io
import math
import re
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Samples
from slip_detector.parameters.detector import default_channel_names
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.parameters.fields import listed
from slip_detector.recordings.labels import Labels
from slip_detector.recordings.rate import checked_rate
from slip_detector.recordings.reading_limit import PIECE_ROWS, ReadingLimit
from slip_detector.recordings.recording import Recording
from slip_detector.recordings.truth import as_truth

#: Name of the array of stamps, as this package writes it.
STAMPS_KEY = 'stamps_ns'

#: Longest header of an array, the same as in numpy.
MOST_HEADER = 10_000

#: Matches names of arrays that are probably times.
_TIMES = re.compile('stamp|time|clock|second|(^|_)(t|ts|ns|us|ms|sec)(_|$)', re.IGNORECASE)

#: If the rate is an array of fewer values, the error message shows them.
MOST_SHOWN = 10

#: Errors of a damaged archive; RuntimeError is that of zipfile for unknown encryption or
#: compression.
_BROKEN = (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, UnicodeError)

#: Errors that NumPy raises for a damaged array.
_BAD_ARRAY = (ValueError, SyntaxError, TypeError, tokenize.TokenError)


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

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name) / 'trial.npz'
    >>> np.savez(path, volts=np.full((2, 2), 4.3), sample_rate_hz=100.0, force_n=[0.0, 0.1])
    >>> recording = NpzRecording(path, RecordingConfig(), labels=None)
    >>> recording.channel_names, recording.sample_rate_hz, recording.array('force_n').tolist()
    (('ch1', 'ch2'), 100.0, [0.0, 0.1])
    >>> folder.cleanup()
    """

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config)
        self._keys = (config.recording_volts_key, STAMPS_KEY, config.recording_truth_key)
        volts_key, _, truth_key = self._keys
        rate_key = config.recording_rate_key
        with _archive(path) as archive:
            self._names = [name.removesuffix('.npy') for name in archive.namelist()]
        for key in (volts_key, rate_key):
            if key not in self._names:
                raise ValueError(
                    f'{path}: has no array {key}, there are: ' + listed(self.array_names())
                )
        self.labelled = truth_key in self._names
        with _archive(path) as archive:
            arrays = self._arrays(archive)
            rate_of_file = _RowArray(archive, rate_key, self._limit)
        volts = arrays[volts_key]
        if len(volts.shape) != 2 or volts.dtype.kind not in 'fiu':
            raise ValueError(
                f'{path}: {volts_key} has the shape {volts.shape} and type {volts.dtype}, '
                'allowed: numbers of shape (rows, channels)'
            )
        size = math.prod(rate_of_file.shape)
        rate = self.array(rate_key) if size < MOST_SHOWN else f'{size} values'
        if isinstance(rate, str) or rate is None or size != 1 or rate.dtype.kind not in 'fiu':
            raise ValueError(f'{path}: {rate_key} is {rate}, allowed: a rate in Hz')
        self.sample_rate_hz = checked_rate(float(rate.item()), path)
        n, channels = volts.shape
        if min(n, channels) < 1:
            raise ValueError(f'{path}: has no samples')
        self._limit.check_channels(channels)
        for key, array in arrays.items():
            if array.n_rows != n:
                raise ValueError(
                    f'{path}: {key} has {array.n_rows} rows, allowed: {n}, as {volts_key}'
                )
            if key != volts_key and array.shape not in ((n,), (n, 1)):
                raise ValueError(f'{path}: {key} has the shape {array.shape}, allowed: ({n},)')
        if STAMPS_KEY in arrays and arrays[STAMPS_KEY].dtype.kind not in 'iu':
            raise ValueError(
                f'{path}: {STAMPS_KEY} has the type {arrays[STAMPS_KEY].dtype}, allowed: whole '
                'numbers of nanoseconds'
            )
        self.channel_names = default_channel_names(channels)
        self._check_no_other_stamps(n)

    def _check_no_other_stamps(self, n: int) -> None:
        """Refuse an array of stamps under another name, which would be ignored silently."""
        if STAMPS_KEY in self._names:
            return
        with _archive(self.path) as archive:
            for name in sorted(set(self._names) - set(self._keys)):
                if _TIMES.search(name) and _RowArray(archive, name, self._limit).n_rows == n > 1:
                    raise ValueError(
                        f'{self.path}: has {name} but no {STAMPS_KEY}, allowed: the stamps as '
                        f'{STAMPS_KEY}, in whole nanoseconds, or no times'
                    )

    def _arrays(self, archive: zipfile.ZipFile) -> 'dict[str, _RowArray]':
        """Open the arrays that have a value for each row."""
        return {
            key: _RowArray(archive, key, self._limit) for key in self._keys if key in self._names
        }

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        volts_key, stamps_key, truth_key = self._keys
        with _archive(self.path) as archive:
            arrays = self._arrays(archive)
            n = arrays[volts_key].n_rows
            for first in range(0, n, PIECE_ROWS):
                m = min(PIECE_ROWS, n - first)
                part = {key: array.read(m) for key, array in arrays.items()}
                if stamps_key in part:
                    stamps_ns = part[stamps_key].astype(np.int64).reshape(-1)
                else:
                    k = np.arange(first, first + m)
                    stamps_ns = np.rint(k * (1e9 / self.sample_rate_hz)).astype(np.int64)
                label = part.get(truth_key)
                truth = None if label is None else as_truth(label, truth_key, self.path)
                yield Samples(part[volts_key].astype(np.float64), stamps_ns, truth)

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return an array of the file by its name; None if there is no such array."""
        if name not in self._names:
            return None
        with _archive(self.path) as archive:
            return _RowArray(archive, name, self._limit).whole()

    def array_names(self) -> list[str]:
        """Return the names of all arrays."""
        return sorted(self._names)


@contextlib.contextmanager
def _archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open the archive; errors are one line with its path."""
    try:
        # Opened here, as zipfile would keep its own file open while a member is open.
        with open(path, 'rb') as stream, zipfile.ZipFile(stream) as archive:
            yield archive
    except _BROKEN:
        raise ValueError(f'{path}: is broken or not npz') from None
    except _BadArrayError as error:
        raise ValueError(f'{path}: is broken or not npz ({error})') from None


class _BadArrayError(Exception):
    """A member of the archive is not an array of numbers or texts."""


class _RowArray:
    """An array in the archive, whose rows are read in order.

    Parameters
    ----------
    archive
        The open archive.
    name
        Name of the array.
    limit
        The memory limit.

    Attributes
    ----------
    shape : tuple of int
    dtype : numpy.dtype
    """

    def __init__(self, archive: zipfile.ZipFile, name: str, limit: ReadingLimit) -> None:
        self._archive, self._name, self._limit = archive, name, limit
        self._file = _open_array(archive, name)
        try:
            self.shape, self._fortran, self.dtype = _read_header(self._file)
        except _BAD_ARRAY:
            raise _BadArrayError(f'{name} is no array') from None
        if self.dtype.hasobject:
            raise _BadArrayError(f'Object arrays, as {name}, are not read')
        self._next = 0
        self._whole: NDArray[Any] | None = None

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return self.shape[0] if self.shape else 1

    def whole(self) -> NDArray[Any]:
        """Return the whole array."""
        self._limit.check(math.prod(self.shape) * self.dtype.itemsize, self._name)
        try:
            with _open_array(self._archive, self._name) as file:
                array = np.lib.format.read_array(file, allow_pickle=False)
                file.read(1)  # zipfile verifies the checksum when it reaches the end
        except (*_BAD_ARRAY, MemoryError) as error:
            raise _BadArrayError(f'{self._name}: {" ".join(str(error).split())}') from None
        return np.asarray(array)

    def read(self, n: int) -> NDArray[Any]:
        """Return the next n rows."""
        first, self._next = self._next, self._next + n
        if self._fortran and len(self.shape) > 1:  # The rows are not contiguous.
            if self._whole is None:
                self._whole = self.whole()
            return self._whole[first : self._next]
        size = n * math.prod(self.shape[1:]) * self.dtype.itemsize
        content = self._file.read(size)
        if len(content) != size:
            raise EOFError
        if self._next == self.n_rows:
            self._file.read(1)  # zipfile verifies the checksum when it reaches the end
        return np.frombuffer(content, self.dtype).reshape(n, *self.shape[1:])


def _read_header(file: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype[Any]]:
    """Return shape, order and type of an array; numpy would read a header of any length."""
    if np.lib.format.read_magic(file) == (1, 0):
        return np.lib.format.read_array_header_1_0(file)
    length = file.read(4)
    if int.from_bytes(length, 'little') > MOST_HEADER:
        raise ValueError('the header is too long')
    header = io.BytesIO(length + file.read(int.from_bytes(length, 'little')))
    return np.lib.format.read_array_header_2_0(header)


def _open_array(archive: zipfile.ZipFile, name: str) -> IO[bytes]:
    member = f'{name}.npy'
    return archive.open(member if member in archive.namelist() else name)
