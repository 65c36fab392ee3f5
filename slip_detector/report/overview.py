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

"""The overview of one recording for a report: bins of its rows, and its events.

For each bin and channel an overview has the lowest and the highest volts and the highest code of
the level. In a recording of some minutes a bin is one row.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Bools, Floats, Ints
from slip_detector.chain.slip_chain import SlipResult
from slip_detector.evaluation.evaluator import OpenedRecording
from slip_detector.evaluation.figures import FALSE, ReplayOutcome
from slip_detector.evaluation.matching import OnIntervals
from slip_detector.parameters import ChainConfig

Volts = NDArray[np.float32]
Codes = NDArray[np.uint8]

#: Outcomes of slips and alarms, the most important first.
OUTCOMES = ('missed', 'false alarm', 'late', 'detected', 'onset')

#: Most cells of the overviews of all recordings in a report: bins times channels.
MOST_CELLS = 3 * 2**19

#: Steps of a level's code for a factor of two, and the code of a level that equals the threshold;
#: in higher codes the channel is ON.
CODES_PER_OCTAVE, THRESHOLD_CODE = 16, 128

#: A sample with a larger magnitude is not drawn, as float32 ends at 3.4e38.
MOST_VOLTS = 1e30


class Event(NamedTuple):
    """A slip or a false alarm, as the evaluation matched them.

    Attributes
    ----------
    outcome : str
        One of :data:`OUTCOMES`.
    start_s, end_s : float
        Times of the alarm where the outcome is a false alarm, else of the true slip, counted from
        the first row.
    latency_s : float or None
        Time from the start of the slip to the start of its alarm; None where it has no alarm.
    parts : mapping
        The parts of the latency, in seconds, by the name of the stage.
    note : str
        What else the reader should know, for example at which stage a missed slip was lost.
    """

    outcome: str
    start_s: float
    end_s: float
    latency_s: float | None = None
    parts: Mapping[str, float] = {}
    note: str = ''


def events_of(outcome: ReplayOutcome, labelled: bool = True) -> list[Event]:
    """Return the scored slips and the false alarms of a recording in the order of their starts.

    Of a recording without labels, return the times in which the global decision is ON.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.evaluation.replay import Replay
    >>> quiet = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.arange(380) >= 190)
    >>> outcome = Replay(ChainConfig()).run([quiet])
    >>> [(event.outcome, event.start_s, event.note) for event in events_of(outcome)]
    [('missed', 0.5, 'lost at: filter')]
    """
    if not labelled:
        return [Event('onset', start_s, end_s) for start_s, end_s in outcome.on_s]
    alarms = [alarm for alarm in outcome.alarms if alarm.outcome == FALSE]
    events = [Event('false alarm', alarm.start_s, alarm.end_s) for alarm in alarms]
    for slip in outcome.slips:
        if slip.settling:
            continue
        name = 'missed' if slip.latency_s is None else 'late' if slip.late else 'detected'
        notes = [f'lost at: {slip.lost_at}'] if slip.lost_at else []
        notes += [f'label exact to {1e3 * slip.accuracy_s:.0f} ms'] if slip.accuracy_s else []
        note, parts = ', '.join(notes).replace('_', ' '), slip.stages_s or {}
        events.append(Event(name, slip.start_s, slip.end_s, slip.latency_s, parts, note))
    return sorted(events, key=lambda event: event.start_s)


def overview_of(config: ChainConfig, share: float, opened: OpenedRecording) -> 'Overview':
    """Return what observes the replay of a recording that was opened."""
    recording, rate_hz = opened.recording, opened.sample_rate_hz
    known = recording.channel_names, share, rate_hz, recording.is_labelled
    return Overview(recording.path.name, config, *known)


def level_codes(result: SlipResult, config: ChainConfig) -> Codes:
    """Return the codes of the levels, a byte for each sample, shape (n, c).

    A code is 0 where the channel is not valid, else from 1 to 255, and above
    :data:`THRESHOLD_CODE` exactly where the channel is ON.
    """
    with np.errstate(divide='ignore'):  # The logarithm of 0 is -inf, the lowest code.
        octaves = np.log2(result.level / config.threshold)
    most = 255 - THRESHOLD_CODE
    steps = np.clip(np.ceil(CODES_PER_OCTAVE * octaves), -most, most)
    # A quotient may round to 1 where the level is just above the threshold.
    steps = np.where(result.channels, np.maximum(steps, 1), np.minimum(steps, 0))
    return np.where(result.valid, steps + THRESHOLD_CODE, 0).astype(np.uint8)


class Overview:
    """The overview of one recording and of one chain's decisions on it.

    It is an observer of a replay, see :meth:`.Replay.run`. It keeps all rows, some 100 MB for an
    hour of 16 channels at 380 Hz, until :meth:`finish`.

    Parameters
    ----------
    name
        The name of the recording in the report.
    config
        The parameters of the chain.
    channel_names
        Names of the recording's channels; those of the configuration if not given.
    share
        The share of this overview in the cells of the report; see :data:`MOST_CELLS`.
    sample_rate_hz
        Rate of the recording, which turns rows into seconds; the chain's rate if not given.
    labelled
        Whether it is known where there is slip.

    Attributes
    ----------
    rows : int
        Number of rows so far, including those that are missing in gaps.
    truth, slip : OnIntervals
        When the label is slip, the global decision ON.
    groups : dict
        When each group is ON, by its name.
    bin_rows : int
        After :meth:`finish` number of rows in a bin, a power of two.
    low, high : ndarray of float32, shape (bins, c)
        After :meth:`finish` the extreme volts; NaN where the bin has no sample that is a number.
    codes : ndarray of uint8, shape (bins, c)
        After :meth:`finish` the highest codes; see :func:`level_codes`.
    events : sequence of Event

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.evaluation.replay import Replay
    >>> volts = np.full((400, 16), 4.3)
    >>> volts[200:] += np.sin(2 * np.pi * 20.0 * np.arange(200) / 380.0)[:, np.newaxis]
    >>> rows = Samples.evenly(volts, 380.0, np.arange(400) >= 200)
    >>> overview = Overview('trial', ChainConfig())
    >>> outcome = Replay(ChainConfig()).run([rows], observer=overview)
    >>> overview.rows, overview.bin_rows, overview.slip.edges
    (400, 1, [202, 400])
    """

    def __init__(
        self,
        name: str,
        config: ChainConfig,
        channel_names: tuple[str, ...] = (),
        share: float = 1.0,
        sample_rate_hz: float | None = None,
        labelled: bool = True,
    ) -> None:
        self.name, self.config, self.share = name, config, share
        self.channel_names = tuple(channel_names) or config.names
        self.sample_rate_hz = sample_rate_hz or config.sample_rate_hz
        self.rows, self.labelled = 0, labelled
        self.truth, self.slip = OnIntervals(), OnIntervals()
        self.groups = {name: OnIntervals() for name in config.groups}
        self.events: Sequence[Event] = ()
        self._intervals = self.slip, self.truth, *self.groups.values()
        # So far the numbers of the rows, their volts and their codes.
        self._pieces: list[tuple[Ints, Volts, Codes]] = []

    def add(self, volts: Floats, result: SlipResult, truth: Bools) -> None:
        """Take the next rows, what the chain makes of them, and their label."""
        samples = np.where(np.abs(volts) < MOST_VOLTS, volts, np.nan).astype(np.float32)
        numbers = self.rows + np.arange(len(volts))
        self._pieces.append((numbers, samples, level_codes(result, self.config)))
        signals = result.slip, truth, *result.groups.T
        for intervals, on in zip(self._intervals, signals, strict=True):
            intervals.add(on, self.rows)
        self.rows += len(volts)

    def gap(self, seconds: float) -> None:
        """Count the rows that are missing in a gap of the recording."""
        self._close_intervals()
        self.rows += round(seconds * self.sample_rate_hz)

    def finish(self, outcome: ReplayOutcome) -> None:
        """Merge the rows to bins, and take the events of the outcome."""
        self._close_intervals()
        self.events = events_of(outcome, self.labelled)
        bins = max(round(self.share * MOST_CELLS) // self.config.channels, 64)
        self.bin_rows = 1 << (max(self.rows - 1, 0) // bins).bit_length()
        numbers, volts, codes = map(np.concatenate, zip(*self._pieces, strict=True))
        self._pieces = []
        filled, firsts = np.unique(numbers // self.bin_rows, return_index=True)
        n = -(-self.rows // self.bin_rows)
        self.low = _spread(np.fmin.reduceat(volts, firsts), filled, n, np.nan)
        self.high = _spread(np.fmax.reduceat(volts, firsts), filled, n, np.nan)
        self.codes = _spread(np.maximum.reduceat(codes, firsts), filled, n, 0)

    def _close_intervals(self) -> None:
        for intervals in self._intervals:
            intervals.close(self.rows)


def _spread(values: NDArray[Any], places: Ints, n: int, empty: float) -> NDArray[Any]:
    """Return ``n`` rows with values at some places and ``empty`` in all others, in gaps."""
    rows = np.full((n, values.shape[1]), empty, values.dtype)
    rows[places] = values
    return rows
