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

"""Runs a chain over recordings, each from its first row."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from slip_detector.evaluation.loading import LabelledRecording, RecordingLoader
from slip_detector.evaluation.outcome import ReplayOutcome, figures_of_merit
from slip_detector.evaluation.replay import Observer, Replay
from slip_detector.recordings import RecordingCounts


class EvaluatedRecording(NamedTuple):
    """The outcome of a recording's replay, and the faults of the recording.

    Attributes
    ----------
    outcome : ReplayOutcome
    counts : RecordingCounts
        Gaps, bad samples and losses.
    observer : Observer or None
        The observer that received the rows, if there was one.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.evaluation.replay import Replay
    >>> from slip_detector.recordings import RecordingCounts
    >>> import numpy as np
    >>> rest = LabelledRows(np.full((760, 16), 4.3), truth=np.zeros(760, bool))
    >>> outcome = Replay(ChainConfig()).run([rest])
    >>> evaluated = EvaluatedRecording(outcome, RecordingCounts(gaps=1), observer=None)
    >>> evaluated.outcome.duration_s, evaluated.counts.gaps
    (2.0, 1)
    """

    outcome: ReplayOutcome
    counts: RecordingCounts
    observer: Observer | None


def recording_counts(evaluations: Iterable[EvaluatedRecording]) -> dict[str, int]:
    """Add up the faults of recordings.

    Returns
    -------
    dict
        ``bad_samples``: values that are not numbers; ``gaps`` that were bridged, and by how many
        rows, ``bridged_rows``; ``long_gaps``, after which the chain was reset; ``dropped``: rows
        whose stamp is not after the one before.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.parameters import ChainConfig
    >>> rest = LabelledRows(np.ones((5, 16)), truth=np.zeros(5, bool))
    >>> replayed = Replay(ChainConfig()).run([rest])
    >>> one = EvaluatedRecording(replayed, RecordingCounts(gaps=2, bridged_rows=7), observer=None)
    >>> recording_counts([one, one])['bridged_rows']
    14
    """
    counts = [one.counts for one in evaluations]
    return {
        'bad_samples': sum(one.bad_samples for one in counts),
        'gaps': sum(one.gaps for one in counts),
        'bridged_rows': sum(one.bridged_rows for one in counts),
        'long_gaps': sum(one.stretches - 1 for one in counts),
        'dropped': sum(one.dropped for one in counts),
    }


def recording_figures(evaluations: Iterable[EvaluatedRecording]) -> dict[str, Any]:
    """Return the figures of merit of recordings taken together, and their faults.

    Returns
    -------
    dict
        As :func:`.figures_of_merit` and :func:`recording_counts` return them.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.parameters import ChainConfig
    >>> rest = LabelledRows(np.ones((5, 16)), truth=np.zeros(5, bool))
    >>> replayed = Replay(ChainConfig()).run([rest])
    >>> figures = recording_figures([EvaluatedRecording(replayed, RecordingCounts(gaps=2), None)])
    >>> figures['rows'], figures['slips'], figures['gaps']
    (5, 0, 2)
    """
    several = list(evaluations)
    return {**figures_of_merit([one.outcome for one in several]), **recording_counts(several)}


class Evaluator:
    """Runs one chain over recordings, each on its own.

    It keeps no state between recordings, so that processes or threads can share it.

    Parameters
    ----------
    loader
        Opens the recordings; it has the parameters of the chain and of the evaluation.

    Raises
    ------
    ValueError
        When the chain cannot be built.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from slip_detector.parameters import ChainConfig, EvaluationConfig, RecordingConfig
    >>> slip = np.arange(760) >= 380
    >>> ridges = np.where(slip, np.sin(2 * np.pi * 20.0 * np.arange(760) / 380.0), 0.0)
    >>> loader = RecordingLoader(ChainConfig(), RecordingConfig(), EvaluationConfig())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.npz'
    ...     np.savez(path, volts=np.tile(ridges, (16, 1)).T, sample_rate_hz=380.0, slip=slip)
    ...     figures = recording_figures([Evaluator(loader).evaluate(path)])
    >>> figures['slips'], figures['missed'], figures['bad_samples']
    (1, 0, 0)
    """

    def __init__(self, loader: RecordingLoader) -> None:
        self.chain_config = loader.chain_config
        self._loader = loader
        self._replay()

    def evaluate(
        self, path: Path, watch: Callable[[LabelledRecording], Observer] | None = None
    ) -> EvaluatedRecording:
        """Run the chain over a recording from its first row.

        Parameters
        ----------
        path
            The recording.
        watch
            Makes an observer of the replay, given the opened recording.

        Raises
        ------
        ValueError
            When the recording cannot be read, does not suit the chain or has no labels; names
            the file.
        """
        opened = self._loader.open(path)
        observer = None if watch is None else watch(opened)
        outcome = self._replay().run(opened.rows, opened.sample_rate_hz, observer)
        return EvaluatedRecording(outcome, opened.recording.counts, observer)

    def _replay(self) -> Replay:
        return Replay(self._loader.chain_config, self._loader.config)
