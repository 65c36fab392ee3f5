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
from slip_detector.recordings.recording import PIECE_ROWS, Recording, named_errors

#: Name of the array of stamps, as this package writes it.
STAMPS_KEY = 'stamps_ns'


class NpzRecording(Recording):
    """An npz file with the rows and their rate, and perhaps labels and stamps; it is read whole.

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
        with self._archive() as archive:
            members = archive.zip.infolist()
            self._sizes = {one.filename.removesuffix('.npy'): one.file_size for one in members}
        volts, rate = (
            self._needed(key) for key in (config.recording_volts_key, config.recording_rate_key)
        )
        if volts.ndim != 2 or not volts.size or volts.dtype.kind not in 'fiu':
            raise ValueError(
                f'{config.recording_volts_key} has the shape {volts.shape} and type '
                f'{volts.dtype}, allowed: numbers of shape (rows, channels)'
            )
        if rate.size != 1 or rate.dtype.kind not in 'fiu':
            raise ValueError(
                f'{config.recording_rate_key} is {shortened(str(rate))}, allowed: a rate in Hz'
            )
        self.sample_rate_hz = checked_rate(float(rate.item()))
        n, channels = volts.shape
        self.channel_names = default_channel_names(channels)
        columns = {key: self.array(key) for key in (STAMPS_KEY, config.recording_truth_key)}
        for key, column in columns.items():
            if column is not None and column.size != n:
                raise ValueError(f'{key} has the shape {column.shape}, allowed: ({n},)')
        stamps_ns, label = columns.values()
        if stamps_ns is None:
            stamps_ns = np.rint(np.arange(n) * (1e9 / self.sample_rate_hz)).astype(np.int64)
        if stamps_ns.dtype.kind not in 'iu':
            raise ValueError(
                f'{STAMPS_KEY} has the type {stamps_ns.dtype}, allowed: whole nanoseconds'
            )
        truth = None if label is None else as_truth(label, config.recording_truth_key)
        self.labelled = truth is not None
        self._samples = Samples(volts, stamps_ns.astype(np.int64).reshape(-1), truth)

    def read(self) -> Iterator[Samples]:
        """Yield the rows of the file, some thousands at a time."""
        for first in range(0, len(self._samples.volts), PIECE_ROWS):
            part = self._samples.take(slice(first, first + PIECE_ROWS))
            yield part._replace(volts=np.asarray(part.volts, np.float64))

    def array(self, name: str) -> 'NDArray[Any] | None':
        """Return an array of the file by its name; None if there is no such array."""
        if name not in self._sizes:
            return None
        with named_errors(self.path), self._archive() as archive:
            self.check_size(self._sizes[name], name)
            return np.asarray(archive[name])

    def array_names(self) -> list[str]:
        """Return the names of all arrays."""
        return sorted(self._sizes)

    def _needed(self, name: str) -> NDArray[Any]:
        array = self.array(name)
        if array is None:
            raise ValueError(f'has no array {name}, there are: {listed(self.array_names())}')
        return array

    @contextlib.contextmanager
    def _archive(self) -> Iterator[Any]:
        with open(self.path, 'rb') as file, np.load(file, allow_pickle=False) as archive:
            yield archive
