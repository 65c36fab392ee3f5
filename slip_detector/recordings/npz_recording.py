"""Recordings in npz files, read from their archive in pieces."""

import contextlib
import math
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings.labels import Labels
from slip_detector.recordings.recording import PIECE_ROWS, Recording
from slip_detector.recordings.rows import RecordedRows
from slip_detector.recordings.truth import as_truth

#: Name of the array of stamps that recordings written here have.
STAMPS_KEY = 'stamps_ns'

#: What a damaged archive raises; zipfile has RuntimeErrors for what it cannot undo.
_BROKEN = (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, UnicodeError)

#: What numpy raises for a damaged header of an array.
_BAD_HEADER = (ValueError, SyntaxError, TypeError, tokenize.TokenError)


class NpzRecording(Recording):
    """An npz file: rows, their rate, and perhaps a label and stamps, as arrays with names."""

    def __init__(self, path: Path, config: RecordingConfig, labels: 'Labels | None') -> None:
        super().__init__(path, labels, config.recording_resample)
        self._keys = (config.recording_volts_key, STAMPS_KEY, config.recording_truth_key)
        volts_key, _, truth_key = self._keys
        rate_key = config.recording_rate_key
        with _archive(path) as archive:
            self._names = [name.removesuffix('.npy') for name in archive.namelist()]
        for key in (volts_key, rate_key):
            if key not in self._names:
                raise ValueError(
                    f'{path}: has no array {key}, there are: {", ".join(self.array_names())}'
                )
        self.labelled = truth_key in self._names
        with _archive(path) as archive:
            members = self._members(archive)
        volts, rate = members[volts_key], self.array(rate_key)
        if len(volts.shape) != 2 or volts.dtype.kind not in 'fiu':
            raise ValueError(
                f'{path}: {volts_key} has the shape {volts.shape} and type {volts.dtype}, '
                'allowed: numbers of shape (rows, channels)'
            )
        if rate is None or rate.size != 1 or rate.dtype.kind not in 'fiu':
            raise ValueError(f'{path}: {rate_key} is {rate}, allowed: a rate in Hz')
        self.sample_rate_hz = float(rate.item())
        if not 0.0 < self.sample_rate_hz < math.inf:
            raise ValueError(f'{path}: {rate_key} is {rate}, allowed: a rate in Hz')
        n, channels = volts.shape
        if not n * channels:
            raise ValueError(f'{path}: has no samples')
        for key, member in members.items():
            if member.rows != n:
                raise ValueError(
                    f'{path}: {key} has {member.rows} rows, allowed: {n}, as {volts_key}'
                )
        if STAMPS_KEY in members and members[STAMPS_KEY].dtype.kind not in 'iu':
            raise ValueError(
                f'{path}: {STAMPS_KEY} has the type {members[STAMPS_KEY].dtype}, allowed: whole '
                'numbers of nanoseconds'
            )
        self.channel_names = tuple(f'ch{i + 1}' for i in range(channels))

    def _members(self, archive: zipfile.ZipFile) -> 'dict[str, _Member]':
        """Open the arrays that have something for each row."""
        return {key: _Member(archive, key) for key in self._keys if key in self._names}

    def read(self) -> Iterator[RecordedRows]:
        """Yield the rows of the file, some thousands at a time."""
        volts_key, stamps_key, truth_key = self._keys
        with _archive(self.path) as archive:
            members = self._members(archive)
            n = members[volts_key].rows
            for first in range(0, n, PIECE_ROWS):
                m = min(PIECE_ROWS, n - first)
                part = {key: member.read(m) for key, member in members.items()}
                if stamps_key in part:
                    stamps_ns = part[stamps_key].astype(np.int64).reshape(-1)
                else:
                    k = np.arange(first, first + m)
                    stamps_ns = np.rint(k * (1e9 / self.sample_rate_hz)).astype(np.int64)
                label = part.get(truth_key)
                truth = None if label is None else as_truth(label, truth_key, self.path)
                yield RecordedRows(part[volts_key].astype(np.float64), stamps_ns, truth)

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return an array of the file by its name; None where there is none."""
        if name not in self._names:
            return None
        with _archive(self.path) as archive:
            return _Member(archive, name).whole()

    def array_names(self) -> list[str]:
        """Return the names of all arrays."""
        return sorted(self._names)


@contextlib.contextmanager
def _archive(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open the archive and name the file where it is damaged."""
    try:
        # A member that is still open would keep a file open that zipfile itself has opened.
        with open(path, 'rb') as stream, zipfile.ZipFile(stream) as archive:
            yield archive
    except _BROKEN:
        raise ValueError(f'{path}: is broken or not npz') from None
    except _BadArrayError as error:
        raise ValueError(f'{path}: is broken or not npz ({error})') from None


class _BadArrayError(Exception):
    """A member of the archive is no array of numbers or texts."""


class _Member:
    """An array in the archive, read from its first row on.

    Parameters
    ----------
    archive
        The open archive.
    key
        Name of the array.
    """

    def __init__(self, archive: zipfile.ZipFile, key: str) -> None:
        name = f'{key}.npy'
        self._file: IO[bytes] = archive.open(name if name in archive.namelist() else key)
        try:
            version = np.lib.format.read_magic(self._file)
            read = np.lib.format.read_array_header_1_0
            if version != (1, 0):
                read = np.lib.format.read_array_header_2_0
            self.shape, self._fortran, self.dtype = read(self._file)
        except _BAD_HEADER:
            raise _BadArrayError(f'{key} is no array') from None
        if self.dtype.hasobject:
            raise _BadArrayError(f'Object arrays, as {key}, are not read')
        #: A label may come as a column.
        self.rows = self.shape[0] if self.shape else 1
        self._columns = math.prod(self.shape[1:])
        self._whole: NDArray[Any] | None = None
        self._next = 0

    def whole(self) -> NDArray[Any]:
        """Return all of it."""
        content = self._file.read()
        if len(content) != math.prod(self.shape) * self.dtype.itemsize:
            raise EOFError
        flat = np.frombuffer(content, self.dtype)
        return flat.reshape(self.shape, order='F' if self._fortran else 'C')

    def read(self, n: int) -> NDArray[Any]:
        """Return the next n rows."""
        if self._fortran and len(self.shape) > 1:  # The rows do not follow each other.
            if self._whole is None:
                self._whole = self.whole()
            self._next += n
            return self._whole[self._next - n : self._next]
        content = self._file.read(n * self._columns * self.dtype.itemsize)
        if len(content) != n * self._columns * self.dtype.itemsize:
            raise EOFError
        if self._next + n == self.rows:
            self._file.read(1)  # The checksum is looked at when the end is reached.
        self._next += n
        return np.frombuffer(content, self.dtype).reshape(n, *self.shape[1:])
