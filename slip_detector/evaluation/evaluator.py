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

"""Opens recordings that suit a chain, reads them in pieces, and runs the chain over each."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.live_chain import words_of
from slip_detector.chain.samples import Bools, Samples
from slip_detector.evaluation.figures import ReplayOutcome, decision_figures, figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import (
    ChainConfig,
    DetectorConfig,
    EvaluationConfig,
    RecordingConfig,
    as_yaml,
    default_channel_names,
    fitting,
    refuse,
)
from slip_detector.recordings import Recording, RecordingCounts, open_recording, rates_differ
from slip_detector.recordings.labels import labels_name

#: The message on a recording whose labels a person has found to be wrong.
MISTAKEN = 'marked as a mistake in the file of labels'

#: Counts of a recording that are among the figures.
FAULTS = ('bad_samples', 'gaps', 'bridged_rows', 'dropped')


class OpenedRecording(NamedTuple):
    """A recording that suits the chain.

    Attributes
    ----------
    rows : iterator of Samples
        The pieces of the recording, which can be read once. Reading raises a ValueError where the
        file is broken.
    sample_rate_hz : float
        Rate of these rows.
    recording : Recording
        Its ``counts`` are complete when all pieces have been read.

    """

    rows: Iterator[Samples]
    sample_rate_hz: float
    recording: Recording


class RecordingLoader(NamedTuple):
    """Opens recordings and checks that they suit a chain.

    Attributes
    ----------
    chain_config : ChainConfig
        The parameters of the chain.
    recording_config : RecordingConfig
        Where in a recording the samples and labels are.
    config : EvaluationConfig
        What counts as detected, and which rows are rows of motion.

    Examples
    --------
    >>> import tempfile
    >>> loader = RecordingLoader()
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.npz'
    ...     np.savez(path, volts=np.full((100, 16), 4.3), sample_rate_hz=380.0, slip=np.zeros(100))
    ...     opened = loader.open(path)
    ...     sum(len(piece.volts) for piece in opened.rows)
    100
    """

    chain_config: ChainConfig = ChainConfig()
    recording_config: RecordingConfig = RecordingConfig()
    config: EvaluationConfig = EvaluationConfig()

    def open(self, path: Path, require_truth: bool = True) -> OpenedRecording:
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
            the file. One that does not suit it has as ``advice`` the parameters that do.
        """
        recording = open_recording(path, self.recording_config)
        config, names = self.chain_config, recording.channel_names
        try:
            if len(names) != config.channels:
                text = f'{config.channels}, the parameter channels'
                refuse(f'{path}: has {len(names)} channels', text)
            unnamed = default_channel_names(len(names))
            if config.channel_names and names not in (config.channel_names, unnamed):
                text = f'{", ".join(config.channel_names)}, the parameter channel_names'
                refuse(f'{path}: has the channels {", ".join(names)}', text)
            recording.check_rate(config.sample_rate_hz)
        except ValueError as error:
            vars(error)['advice'] = self._advice(recording)
            raise
        if require_truth and recording.mistaken:
            raise ValueError(f'{path}: {MISTAKEN}')
        if require_truth and not recording.is_labelled:
            raise ValueError(
                f'{path}: has no {recording.label_name}; allowed: one to label the slips, or a '
                f'file of labels beside it, {labels_name(path)} (--labels: elsewhere)'
            )
        is_resampled = rates_differ(recording.sample_rate_hz, config.sample_rate_hz)
        rate_hz = (config if is_resampled else recording).sample_rate_hz
        return OpenedRecording(self._rows(recording), rate_hz, recording)

    def _advice(self, recording: Recording) -> str:
        """Return the content of a parameter file that suits a recording."""
        config, names = self.chain_config, recording.channel_names
        values = fitting(config, len(names), recording.sample_rate_hz, names)
        parameters = {**config.with_values(values).to_parameters(), **recording.input}
        document = DetectorConfig.from_parameters(parameters).to_document(whole=False)
        document |= self.recording_config.to_document(whole=False)
        advice = 'save it as my_sensor.yaml, then add --config my_sensor.yaml'
        return as_yaml(document, [f'This fits {recording.path}: {advice}']).rstrip()

    def _rows(self, recording: Recording) -> Iterator[Samples]:
        """Yield the pieces of a recording with their labels and the motion of the robot."""
        moving, config = self._moving(recording), self.chain_config
        recording.valid_range_v = config.valid_range_v
        for piece in recording.pieces(config.sample_rate_hz, config.max_gap_s):
            truth = np.zeros(len(piece.volts), bool) if piece.truth is None else piece.truth
            rows = None if moving is None else moving[piece.row_numbers]
            yield piece._replace(truth=truth, moving=rows)

    def _moving(self, recording: Recording) -> Bools | None:
        """Return which rows are rows of motion, shape (n,), from the recorded velocities."""
        key, columns = self.config.motion_key, list(self.config.motion_columns)
        if not key:
            return None
        velocities, names = recording.array(key), recording.array(f'{key}_names')
        if velocities is None:
            there = ', '.join(recording.array_names()) or 'none'
            raise ValueError(f'{recording.path}: has no array {key}, there are: {there}')
        table = np.atleast_2d(velocities.T).T
        if columns:
            known = [] if names is None else [str(name) for name in names.ravel()]
            if len(known) != table.shape[1] or {known.count(name) for name in columns} != {1}:
                text = f'one for each of {table.shape[1]} columns, with each of {columns} once'
                refuse(f'{recording.path}: {key}_names has the names {known}', text)
            table = table[:, [known.index(name) for name in columns]]
        fits = table.dtype.kind in 'fiu' and table.ndim == 2 and len(table) == recording.n_rows
        if not fits or not np.isfinite(table).all():
            what = f'{key} has the shape {velocities.shape} and type {velocities.dtype}'
            text = f'finite numbers, a row or number for each of {recording.n_rows} rows'
            refuse(f'{recording.path}: {what}', text)
        speed = np.linalg.norm(table.astype(np.float64), axis=1)
        return np.asarray(speed > self.config.moving_above)


class EvaluatedRecording(NamedTuple):
    """The outcome of a recording's replay, and the faults of the recording.

    Attributes
    ----------
    outcome : ReplayOutcome
    counts : RecordingCounts
        Gaps, bad samples and losses.
    observer : Any
        What received the rows for a report; None without one.
    channel_names : tuple of str
    labelled : bool
        Whether it is known where there is slip; else there are decisions, but no scores.
    mistaken : bool
        Whether it is not labelled because its labels are marked as a mistake.
    """

    outcome: ReplayOutcome
    counts: RecordingCounts
    observer: Any = None
    channel_names: tuple[str, ...] = ()
    labelled: bool = True
    mistaken: bool = False

    @property
    def invalid_percent(self) -> dict[str, float]:
        """The share of the rows in which a channel was not valid, if there are such rows."""
        named = zip(self.channel_names, self.outcome.invalid_rows, strict=False)
        return {name: 100.0 * rows / self.outcome.rows for name, rows in named if rows}

    @property
    def warnings(self) -> list[str]:
        """Why decisions on the recording may mean nothing, and what to do."""
        marked = [f'{MISTAKEN}, so in no figure'] if self.mistaken else []
        return [*marked, *words_of(self.outcome.wrong, self.channel_names)]


def recording_figures(evaluations: Iterable[EvaluatedRecording]) -> dict[str, Any]:
    """Return the figures of merit of recordings taken together, and their faults.

    Returns
    -------
    dict
        The figures of :func:`.figures_of_merit` for the recordings with labels, None where no
        recording has labels; for all recordings the figures of :func:`.decision_figures`, and
        ``bad_samples``: values that are not numbers, or outside ``valid_range_v``; ``gaps`` that
        were bridged, and by how many rows, ``bridged_rows``; ``long_gaps``, after which the chain
        was reset; ``dropped``: rows whose stamp is not after the stamp before.

    Examples
    --------
    >>> rest = Samples.evenly(np.ones((5, 16)), 380.0, truth=np.zeros(5))
    >>> replayed = Replay(ChainConfig()).run([rest])
    >>> figures = recording_figures([EvaluatedRecording(replayed, RecordingCounts(gaps=2))])
    >>> figures['rows'], figures['slips'], figures['gaps']
    (5, 0, 2)
    """
    several = list(evaluations)
    labelled = [recording.outcome for recording in several if recording.labelled]
    figures = figures_of_merit(labelled)
    if several and not labelled:
        figures = dict.fromkeys(figures)
    figures |= decision_figures([recording.outcome for recording in several])
    for name in FAULTS:
        figures[name] = sum(getattr(recording.counts, name) for recording in several)
    figures['long_gaps'] = sum(recording.counts.stretches - 1 for recording in several)
    return figures


def evaluate_recording(
    loader: RecordingLoader, path: Path, observe: Callable[[OpenedRecording], Any] | None = None
) -> EvaluatedRecording:
    """Run a chain over a recording from its first row.

    Parameters
    ----------
    loader
        Opens the recording; it has the parameters of the chain and of the evaluation.
    path
        The recording.
    observe
        Returns what observes the replay, see :meth:`.Replay.run`; None: nothing does.

    Raises
    ------
    ValueError
        When the chain cannot be built, or the recording cannot be read or does not suit the chain;
        names the file.

    Examples
    --------
    >>> import tempfile
    >>> slip = np.arange(760) >= 380
    >>> ridges = np.where(slip, np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0), 0.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.npz'
    ...     np.savez(path, volts=np.tile(ridges, (16, 1)).T, sample_rate_hz=380.0, slip=slip)
    ...     figures = recording_figures([evaluate_recording(RecordingLoader(), path)])
    >>> figures['slips'], figures['missed'], figures['bad_samples']
    (1, 0, 0)
    """
    replay = Replay(loader.chain_config, loader.config)
    opened = loader.open(path, require_truth=False)
    recording, observer = opened.recording, observe(opened) if observe else None
    outcome = replay.run(opened.rows, opened.sample_rate_hz, observer)
    known = recording.channel_names, recording.is_labelled, recording.mistaken
    return EvaluatedRecording(outcome, recording.counts, observer, *known)
