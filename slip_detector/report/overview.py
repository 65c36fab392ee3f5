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

"""The overview of one recording for a report, gathered piece by piece in bounded memory.

Rows are gathered in bins. For each bin and channel the overview keeps the lowest and the highest
volts and the highest level. In a short recording a bin is one row. When there are more bins than
fit, neighbouring bins are merged in pairs. Near the starts of slips and alarms the rows themselves
are kept too, up to a limit.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.slip_chain import SlipResult
from slip_detector.evaluation.figures import FALSE, ReplayOutcome
from slip_detector.evaluation.matching import OnIntervals
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.signal_codes import Codes, signal_codes, signals_of

RowNumbers = NDArray[np.int64]
Volts = NDArray[np.float32]

#: Kinds of events, the most important first.
EVENT_KINDS = ('false alarm', 'missed', 'late', 'detected')

#: Times before and after the start of a slip or an alarm within which single rows are kept.
BEFORE_S, AFTER_S = 0.15, 0.3

#: Largest number of cells (bins times channels) that the overviews of a report share.
MOST_CELLS = 2**20

#: Each overview has at least this many cells, however many recordings share a report.
LEAST_CELLS = 2**15

#: Largest number of single rows that are kept, as a multiple of the largest number of bins. A
#: report may show fewer: which rows matter most is known only after the last one.
ROWS_PER_BIN = 4

#: A sample with a larger magnitude is not drawn, as float32 ends at 3.4e38.
MOST_VOLTS = 1e30


class Event(NamedTuple):
    """A slip or a false alarm, as the evaluation matched them.

    Attributes
    ----------
    kind : str
        One of :data:`EVENT_KINDS`.
    start_s, end_s : float
        Times of the alarm where the kind is a false alarm, else of the true slip, counted from the
        first row.
    latency_s : float or None
        Time from the start of the slip to the start of its alarm; None where it has no alarm.
    parts : mapping
        The parts of the latency, in seconds, by the name of the stage.
    note : str
        What else the reader should know, for example at which stage a missed slip was lost.

    Examples
    --------
    >>> Event('detected', 4.0, 5.0, 0.04, {'filter': 0.012, 'vote': 0.028}).latency_s
    0.04
    """

    kind: str
    start_s: float
    end_s: float
    latency_s: float | None = None
    parts: Mapping[str, float] = {}
    note: str = ''


class Snippet(NamedTuple):
    """Consecutive rows, each with its own volts and levels.

    Attributes
    ----------
    start : int
        The number of the first row.
    volts : ndarray of float32, shape (n, c)
        NaN where a sample is not a number.
    codes : ndarray of uint8, shape (n, s c)
        The s signals, as :func:`signal_codes` writes them.

    Examples
    --------
    >>> Snippet(380, np.ones((10, 2)), np.zeros((10, 2), np.uint8)).start
    380
    """

    start: int
    volts: Volts
    codes: Codes


def cells_of_each(recordings: int) -> int:
    """Return the largest number of cells of each overview where recordings share a report.

    Examples
    --------
    >>> cells_of_each(1) == MOST_CELLS, cells_of_each(1000) == LEAST_CELLS
    (True, True)
    """
    return max(MOST_CELLS // recordings, LEAST_CELLS)


def events_of(outcome: ReplayOutcome) -> list[Event]:
    """Return the scored slips and the false alarms of a recording in the order of their starts.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.evaluation.replay import Replay
    >>> quiet = Samples.evenly(np.full((380, 16), 4.3), 380.0, np.arange(380) >= 190)
    >>> outcome = Replay(ChainConfig()).run([quiet])
    >>> [(event.kind, event.start_s, event.note) for event in events_of(outcome)]
    [('missed', 0.5, 'lost at: filter')]
    """
    shown = []
    for slip in outcome.slips:
        if slip.settling:
            continue
        kind = 'missed' if slip.latency_s is None else 'late' if slip.late else 'detected'
        note = f'lost at: {slip.lost_at}'.replace('_', ' ') if slip.lost_at else ''
        parts = slip.stages_s or {}
        shown.append(Event(kind, slip.start_s, slip.end_s, slip.latency_s, parts, note))
    for alarm in outcome.alarms:
        if alarm.kind == FALSE:
            shown.append(Event('false alarm', alarm.start_s, alarm.end_s))
    return sorted(shown, key=lambda event: event.start_s)


class Overview:
    """The overview of one recording and of one chain's decisions on it.

    It is an observer of a replay, which passes rows to :meth:`add` and gaps to :meth:`gap`.

    Parameters
    ----------
    name
        The name of the recording in the report.
    config
        The parameters of the chain.
    channel_names
        Names of the recording's channels; those of the configuration if not given.
    most_cells
        Largest number of bins times the number of channels.
    sample_rate_hz
        Rate of the recording, which turns rows into seconds; the chain's rate if not given.

    Attributes
    ----------
    rows : int
        Number of rows so far, including those that are missing in gaps.
    bin_rows : int
        Number of rows in a bin, a power of two.
    events : sequence of Event
        Slips and false alarms; empty until the caller sets them.

    Examples
    --------
    >>> from slip_detector.chain.slip_chain import SlipChain
    >>> volts = np.full((400, 16), 4.3)
    >>> volts[200:] += np.sin(2 * np.pi * 20.0 * np.arange(200) / 380.0)[:, np.newaxis]
    >>> overview = Overview('trial', ChainConfig(), most_cells=16 * 128)
    >>> overview.add(volts, SlipChain(ChainConfig()).update(volts), truth=np.arange(400) >= 200)
    >>> overview.rows, overview.bin_rows
    (400, 4)
    >>> overview.truth, overview.slip
    (array([[200, 400]]), array([[202, 400]]))
    """

    def __init__(
        self,
        name: str,
        config: ChainConfig,
        channel_names: Sequence[str] = (),
        most_cells: int = MOST_CELLS,
        sample_rate_hz: float | None = None,
    ) -> None:
        self.name, self.config = name, config
        self.channel_names = tuple(channel_names) or config.names
        self.sample_rate_hz = sample_rate_hz or config.sample_rate_hz
        self.rows, self.bin_rows = 0, 1
        self.events: Sequence[Event] = ()
        channels = config.channels
        # A power of two, so that the bins can be merged in pairs.
        self._most_bins = 1 << max(most_cells // channels, 2).bit_length() - 1
        self._low = np.full((self._most_bins, channels), np.nan, np.float32)
        self._high = self._low.copy()
        signals = len(signals_of(config))
        self._codes = np.zeros((self._most_bins, signals * channels), np.uint8)
        self._truth: OnIntervals | None = None
        self._slip, self._groups = OnIntervals(), [OnIntervals() for _ in config.groups]
        self._after_impact = OnIntervals()
        self._rows_left = ROWS_PER_BIN * self._most_bins
        self._before, self._after = config.samples(BEFORE_S), config.samples(AFTER_S)
        self._kept: list[tuple[RowNumbers, Volts, Codes]] = []
        self._tail = self._no_rows()
        self._starts: RowNumbers = np.empty(0, np.int64)

    def add(self, volts: ArrayLike, result: SlipResult, truth: ArrayLike | None) -> None:
        """Take the next rows.

        Parameters
        ----------
        volts : array_like, shape (n, c)
            Oldest row first; NaN where a sample is missing.
        result : SlipResult
            The chain's result for these rows, with the level, and with evidence also floor and
            excess.
        truth : array_like of bool, shape (n,), or None
            Whether there is slip; None in each call for a recording without labels.
        """
        values = np.asarray(volts, np.float64)
        if not len(values):
            return
        samples = np.where(np.abs(values) < MOST_VOLTS, values, np.nan).astype(np.float32)
        codes = signal_codes(result, self.config)
        if self.config.decision == 'evidence':
            self._after_impact.add(result.after_impact, self.rows)
        starts = self._slip.add(result.slip, self.rows)
        for group, on in zip(self._groups, result.groups.T, strict=True):
            group.add(on, self.rows)
        if truth is not None:
            self._truth = self._truth or OnIntervals()
            starts += self._truth.add(np.asarray(truth, dtype=bool), self.rows)
        self._fill_bins(samples, codes)
        self.rows += len(values)
        self._keep(samples, codes, sorted(starts))

    def gap(self, seconds: float) -> None:
        """Count the rows that are missing in a gap of the recording."""
        self._keep_wanted(self._wanted(self.rows), self.rows)
        self._tail, self._starts = self._no_rows(), self._starts[:0]
        for intervals in (
            self._slip,
            *self._groups,
            self._after_impact,
            *([self._truth] if self._truth else []),
        ):
            intervals.close(self.rows)
        self.rows += round(seconds * self.sample_rate_hz)
        self._coarsen_to(self.rows)

    def bins(self, bin_rows: int) -> tuple[Volts, Volts, Codes]:
        """Return the lowest and highest volts and the highest code of each signal in each bin.

        Parameters
        ----------
        bin_rows
            Number of rows in a bin: a power of two, at least the attribute ``bin_rows``.

        Returns
        -------
        low, high : ndarray of float32, shape (bins, c)
            NaN where the bin has no sample that is a number.
        codes : ndarray of uint8, shape (bins, s c)
            The codes of each of s signals; see :func:`signal_codes`.
        """
        n = -(-self.rows // self.bin_rows)
        low, high, codes = self._low[:n], self._high[:n], self._codes[:n]
        starts = np.arange(0, n, bin_rows // self.bin_rows)
        if not n or len(starts) == n:
            return low, high, codes
        return (
            np.fmin.reduceat(low, starts),
            np.fmax.reduceat(high, starts),
            np.maximum.reduceat(codes, starts),
        )

    @property
    def duration_s(self) -> float:
        """Time from the first row to the end of the last."""
        return self.rows / self.sample_rate_hz

    @property
    def slip(self) -> RowNumbers:
        """Intervals in which the global decision is ON, shape (m, 2).

        An interval is its first row and the first row after it.
        """
        return self._pairs(self._slip)

    @property
    def groups(self) -> dict[str, RowNumbers]:
        """Intervals in which each group is ON, by its name: arrays of shape (m, 2)."""
        pairs = [self._pairs(group) for group in self._groups]
        return dict(zip(self.config.groups, pairs, strict=True))

    @property
    def after_impact(self) -> RowNumbers:
        """Intervals in which an impact is held, shape (m, 2); none without evidence."""
        return self._pairs(self._after_impact)

    @property
    def truth(self) -> RowNumbers | None:
        """Intervals of true slip, shape (m, 2); None for a recording without labels."""
        return None if self._truth is None else self._pairs(self._truth)

    @property
    def snippets(self) -> list[Snippet]:
        """The single rows that were kept, in order."""
        kept = [*self._kept, self._pick(self._wanted(self.rows)[: self._rows_left])]
        rows, volts, codes = (np.concatenate(parts) for parts in zip(*kept, strict=True))
        cuts = np.flatnonzero(np.diff(rows) > 1) + 1
        pieces = (np.split(array, cuts) for array in (rows, volts, codes))
        return [Snippet(int(at[0]), v, c) for at, v, c in zip(*pieces, strict=True) if len(at)]

    def _pairs(self, intervals: OnIntervals) -> RowNumbers:
        """Return intervals as an array, shape (m, 2); an open one ends at the last row."""
        edges = [*intervals.edges, self.rows] if intervals.on else intervals.edges
        return np.array(edges, np.int64).reshape(-1, 2)

    def _coarsen_to(self, rows: int) -> None:
        """Merge neighbouring bins until this number of rows fits."""
        half = self._most_bins // 2
        while rows > self._most_bins * self.bin_rows:
            self.bin_rows *= 2
            self._low[:half] = np.fmin(self._low[::2], self._low[1::2])
            self._high[:half] = np.fmax(self._high[::2], self._high[1::2])
            self._codes[:half] = np.maximum(self._codes[::2], self._codes[1::2])
            self._low[half:] = self._high[half:] = np.nan
            self._codes[half:] = 0

    def _fill_bins(self, volts: Volts, codes: Codes) -> None:
        """Enter the next rows into their bins; ``self.rows`` does not count them yet."""
        self._coarsen_to(self.rows + len(volts))
        first, ahead = divmod(self.rows, self.bin_rows)
        starts = np.maximum(np.arange(-ahead, len(volts), self.bin_rows), 0)
        bins = slice(first, first + len(starts))
        for into, function, values in (
            (self._low, np.fmin, volts),
            (self._high, np.fmax, volts),
            (self._codes, np.maximum, codes),
        ):
            into[bins] = function(into[bins], function.reduceat(values, starts))

    def _keep(self, volts: Volts, codes: Codes, starts: list[int]) -> None:
        """Keep the rows that are near a start.

        The last rows stay in the tail, as a start that follows soon may be near them.
        """
        self._tail = (
            np.concatenate([self._tail[0], volts]),
            np.concatenate([self._tail[1], codes]),
        )
        self._starts = np.append(self._starts, np.array(starts, np.int64))
        decided = max(self.rows - self._before, self.rows - len(self._tail[0]))
        self._keep_wanted(self._wanted(decided), decided)

    def _no_rows(self) -> tuple[Volts, Codes]:
        channels = self.config.channels
        return np.empty((0, channels), np.float32), self._codes[:0]

    def _wanted(self, stop: int) -> RowNumbers:
        """Return the places, in the tail, of rows before row ``stop`` that are near a start."""
        first = self.rows - len(self._tail[0])
        rows = np.arange(first, stop)
        from_here = np.searchsorted(self._starts, rows + self._before, 'right')
        to_here = np.searchsorted(self._starts, rows - self._after, 'left')
        return np.flatnonzero(from_here > to_here)

    def _pick(self, wanted: RowNumbers) -> tuple[RowNumbers, Volts, Codes]:
        volts, codes = self._tail
        return wanted + self.rows - len(volts), volts[wanted], codes[wanted]

    def _keep_wanted(self, wanted: RowNumbers, decided: int) -> None:
        """Keep rows of the tail, and cut off the tail before row ``decided``."""
        fit = wanted[: self._rows_left]
        self._rows_left -= len(fit)
        if len(fit):
            self._kept.append(self._pick(fit))
        ahead = decided - (self.rows - len(self._tail[0]))
        self._tail = (self._tail[0][ahead:].copy(), self._tail[1][ahead:].copy())
        self._starts = self._starts[self._starts + self._after >= decided]
