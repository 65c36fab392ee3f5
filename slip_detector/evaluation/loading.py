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

"""Opens recordings for an evaluation or a search, checks them, and reads them in pieces."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.labelled_rows import LabelledRows
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings import Recording, open_recording, rates_differ
from slip_detector.recordings.labels import labels_name

Bools = NDArray[np.bool_]


class LabelledRecording(NamedTuple):
    """A recording that suits the chain.

    Attributes
    ----------
    rows : iterator of LabelledRows
        The pieces of the recording, which can be read once. Reading raises a ValueError where the
        file is broken.
    sample_rate_hz : float
        Rate of these rows.
    channel_names : tuple of str
    recording : Recording
        Its ``counts`` are complete when all pieces have been read.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name) / 'rest.npz'
    >>> np.savez(path, volts=np.full((760, 16), 4.3), sample_rate_hz=380.0, slip=np.zeros(760))
    >>> loader = RecordingLoader(ChainConfig(), RecordingConfig(), EvaluationConfig())
    >>> opened = loader.open(path)
    >>> opened.sample_rate_hz, sum(len(piece.volts) for piece in opened.rows)
    (380.0, 760)
    >>> opened.recording.counts.rows
    760
    >>> folder.cleanup()
    """

    rows: Iterator[LabelledRows]
    sample_rate_hz: float
    channel_names: tuple[str, ...]
    recording: Recording


class RecordingLoader:
    """Opens recordings and checks that they suit a chain.

    Parameters
    ----------
    chain_config
        The parameters of the chain.
    recording_config
        Where in a recording the samples and labels are.
    config
        What counts as detected, and which rows are rows of motion.

    Examples
    --------
    >>> import tempfile
    >>> loader = RecordingLoader(ChainConfig(), RecordingConfig(), EvaluationConfig())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.npz'
    ...     np.savez(path, volts=np.full((100, 16), 4.3), sample_rate_hz=380.0, slip=np.zeros(100))
    ...     opened = loader.open(path)
    ...     sum(len(piece.volts) for piece in opened.rows)
    100
    """

    def __init__(
        self,
        chain_config: ChainConfig,
        recording_config: RecordingConfig,
        config: EvaluationConfig,
    ) -> None:
        self.chain_config, self.config = chain_config, config
        self._recording_config = recording_config

    def open(self, path: Path, require_truth: bool = True) -> LabelledRecording:
        """Open a recording and check that it suits the chain.

        Parameters
        ----------
        path
            The recording.
        require_truth
            Whether a recording without labels is refused; else it is taken to have no slip.

        Raises
        ------
        ValueError
            When the recording cannot be read, does not suit the chain or has no labels; names
            the file.
        """
        recording = open_recording(path, self._recording_config)
        config = self.chain_config
        if len(recording.channel_names) != config.channels:
            raise ValueError(
                f'{path}: has {len(recording.channel_names)} channels, allowed: '
                f'{config.channels}, the parameter channels'
            )
        named = recording.named and config.channel_names
        if named and recording.channel_names != config.channel_names:
            raise ValueError(
                f'{path}: has the channels {", ".join(recording.channel_names)}, allowed: '
                f'{", ".join(config.channel_names)}, the parameter channel_names'
            )
        if require_truth and not recording.has_truth:
            raise ValueError(
                f'{path}: {self._no_truth(recording)}, or a file of labels beside it, '
                f'{labels_name(path)} (--labels: elsewhere)'
            )
        wanted_hz = config.sample_rate_hz
        # A recording of another rate is resampled, or reading it raises an error.
        rate_hz = recording.sample_rate_hz
        if rates_differ(rate_hz, wanted_hz):
            rate_hz = wanted_hz
        return LabelledRecording(
            self._rows(recording),
            rate_hz,
            recording.channel_names,
            recording,
        )

    def _no_truth(self, recording: Recording) -> str:
        config, there = self._recording_config, ', '.join(recording.array_names())
        if there:
            return f'has no label {config.recording_truth_key}, there are: {there}; allowed: one'
        return (
            f'has no topic {config.recording_truth_topic} or {config.recording_position_topic} '
            'to label the slips, allowed: one'
        )

    def _rows(self, recording: Recording) -> Iterator[LabelledRows]:
        """Yield the pieces of a recording with their labels and the motion of the robot."""
        moving = self._moving(recording)
        wanted_hz = self.chain_config.sample_rate_hz
        last = -1
        for piece in recording.pieces(wanted_hz, self.chain_config.max_gap_s):
            truth = np.zeros(len(piece.volts), bool) if piece.truth is None else piece.truth
            assert piece.row_numbers is not None
            last = int(piece.row_numbers[-1])
            if moving is None:
                yield LabelledRows(piece.volts, truth, piece.stamps_ns, piece.new_stretch)
                continue
            if last >= len(moving):
                raise self._other_length(recording, moving)
            yield LabelledRows(
                piece.volts, truth, piece.stamps_ns, piece.new_stretch, moving[piece.row_numbers]
            )
        # The last rows may have been dropped; resampling may end a row before the last.
        spare = 1 if rates_differ(recording.sample_rate_hz, wanted_hz) else 0
        left = 0 if moving is None else len(moving) - 1 - last - recording.counts.dropped
        if moving is not None and left > spare:
            raise self._other_length(recording, moving)

    def _other_length(self, recording: Recording, moving: Bools) -> ValueError:
        return ValueError(
            f'{recording.path}: {self.config.motion_key} has {len(moving)} rows, allowed: as '
            'many as the recording has'
        )

    def _moving(self, recording: Recording) -> Bools | None:
        """Return which rows are rows of motion, shape (n,), from the recorded velocities."""
        key, path = self.config.motion_key, recording.path
        if not key:
            return None
        velocities = recording.array(key)
        if velocities is None:
            there = ', '.join(recording.array_names()) or 'none'
            raise ValueError(f'{path}: has no array {key}, there are: {there}')
        numbers = velocities.dtype.kind in 'fiu' and velocities.ndim in (1, 2) and velocities.size
        if not numbers:
            raise ValueError(
                f'{path}: {key} has the shape {velocities.shape} and type {velocities.dtype}, '
                'allowed: numbers of shape (rows,) or (rows, columns)'
            )
        table = velocities.astype(np.float64).reshape(len(velocities), -1)
        if self.config.motion_columns:
            names = recording.array(f'{key}_names')
            table = table[:, self._columns(names, table.shape[1], path)]
        if not np.isfinite(table).all():
            row = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0]) + 1
            raise ValueError(f'{path}: {key} is not finite in row {row}, allowed: finite numbers')
        return np.asarray(np.linalg.norm(table, axis=1) > self.config.moving_above)

    def _columns(self, names: NDArray[Any] | None, n_columns: int, path: Path) -> list[int]:
        """Return the numbers of the configured columns of motion."""
        where = f'{path}: {self.config.motion_key}_names'
        if names is None or names.shape != (n_columns,):
            found = 'is not there' if names is None else f'has the shape {names.shape}'
            raise ValueError(f'{where} {found}, allowed: a name for each of {n_columns} columns')
        known = [str(name) for name in names]
        for name in self.config.motion_columns:
            if known.count(name) != 1:
                raise ValueError(
                    f'{where} has {name} {known.count(name)} times, allowed: once; there are: '
                    f'{", ".join(known)}'
                )
        return [known.index(name) for name in self.config.motion_columns]
