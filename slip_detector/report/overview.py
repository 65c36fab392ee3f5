"""What a report shows of one recording, gathered piece by piece in bounded memory.

The volts of a channel become the lowest and highest of each bin of rows, its level the highest. A
short recording has bins of one row; each time there would be more bins than fit, two become one.
About the starts of slips and alarms the rows themselves are kept as well, up to a limit.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.result import SlipResult
from slip_detector.evaluation.replay import ReplayOutcome
from slip_detector.parameters.detector import ChainConfig

Bools = NDArray[np.bool_]
RowNumbers = NDArray[np.int64]
Volts = NDArray[np.float32]
Codes = NDArray[np.uint8]

#: Kinds of events, those first that a reader looks for.
KINDS = ('false alarm', 'missed', 'late', 'detected')

#: How much before and after the start of a slip or an alarm is kept row by row.
BEFORE_S, AFTER_S = 0.15, 0.3

#: Bins that are kept at most, times the number of channels.
MOST_CELLS = 2**20

#: Single rows that are kept at most for each bin. A report may show fewer: which ones matter most
#: is known when all have been seen.
ROWS_PER_BIN = 4

#: Steps of a level's code for a factor of two.
CODES_PER_OCTAVE = 16

#: Code of a level that equals the threshold: above it the channel is ON.
THRESHOLD_CODE = 128

#: Beyond this a sample is not drawn: float32 ends soon after.
MOST_VOLTS = 1e30


class Event(NamedTuple):
    """A slip or a false alarm, as the evaluation matched them.

    Attributes
    ----------
    kind : str
        One of :data:`KINDS`.
    start_s, end_s : float
        Of the alarm where the kind is a false alarm, else of the true slip; from the first row.
    latency_s : float or None
        From the start of the slip to that of its alarm; None where there is none.
    parts : mapping
        Where the time went: seconds by the name of the stage.
    note : str
        What else the reader should know, such as where a missed slip was lost.
    """

    kind: str
    start_s: float
    end_s: float
    latency_s: float | None = None
    parts: Mapping[str, float] = {}
    note: str = ''


class Snippet(NamedTuple):
    """Consecutive rows as they were.

    Attributes
    ----------
    start : int
        The first row.
    volts : ndarray of float32, shape (n, c)
        NaN for a sample that is no number.
    codes : ndarray of uint8, shape (n, c)
        As :func:`level_codes` has them.
    """

    start: int
    volts: Volts
    codes: Codes


def level_codes(result: SlipResult, threshold: float) -> Codes:
    """Write level / threshold on a logarithmic scale into a byte.

    Returns
    -------
    ndarray of uint8, shape (n, c)
        0 where the channel is not valid, else 1 to 255, :data:`CODES_PER_OCTAVE` for a factor of
        two; above :data:`THRESHOLD_CODE` where, and only where, the channel is ON.

    Examples
    --------
    >>> from slip_detector.chain.slip_chain import SlipChain
    >>> result = SlipChain(ChainConfig()).update(np.full((1, 16), 4.3))
    >>> int(level_codes(result, threshold=0.5)[0, 0])  # at rest: as low as a code can be
    1
    """
    with np.errstate(divide='ignore'):  # The logarithm of 0 is -inf, the lowest code.
        octaves = np.log2(result.level / threshold)
    most = 255 - THRESHOLD_CODE
    steps = np.clip(np.ceil(CODES_PER_OCTAVE * octaves), -most, most)
    # A quotient may round to 1 where the level is just above the threshold.
    steps = np.where(result.channels, np.maximum(steps, 1), np.minimum(steps, 0))
    return np.where(result.valid, steps + THRESHOLD_CODE, 0).astype(np.uint8)


class _Intervals:
    """The rows at which one decision is ON, as intervals."""

    def __init__(self) -> None:
        self._on = False
        self._changes: list[RowNumbers] = []

    def add(self, on: Bools, first_row: int) -> RowNumbers:
        """Take the next rows; returns the rows at which it went ON."""
        before = np.concatenate([[self._on], on[:-1]])
        changes = np.flatnonzero(on != before)
        self._on = bool(on[-1])
        if changes.size:
            self._changes.append(changes + first_row)
        return changes[on[changes]] + first_row

    def end(self, row: int) -> None:
        if self._on:
            self._changes.append(np.array([row]))
            self._on = False

    def pairs(self, rows: int) -> RowNumbers:
        """Return start and stop of each interval, shape (m, 2); the stop is the row after."""
        last = [np.array([rows])] if self._on else []
        changes = [np.empty(0, np.int64), *self._changes, *last]
        return np.concatenate(changes).reshape(-1, 2)


def events_of(outcome: ReplayOutcome) -> list[Event]:
    """Return what a report shows of slips and alarms."""
    shown = []
    for slip in outcome.slips:
        kind = 'missed' if slip.latency_s is None else 'late' if slip.late else 'detected'
        note = f'lost at: {slip.lost_at}'.replace('_', ' ') if slip.lost_at else ''
        parts = slip.stages_s or {}
        shown.append(Event(kind, slip.start_s, slip.end_s, slip.latency_s, parts, note))
    for alarm in outcome.alarms:
        if alarm.slip is None:
            shown.append(Event('false alarm', alarm.start_s, alarm.end_s))
    return sorted(shown, key=lambda event: event.start_s)


class Overview:
    """What a report shows of one recording as one chain saw it.

    Parameters
    ----------
    name
        What the reader knows the recording by.
    config
        Of the chain: its rate, threshold and groups.
    channel_names
        Those of the recording; the configuration's if not given.
    most_cells
        How many bins are kept at most, times the number of channels.
    sample_rate_hz
        Of the recording, by which rows become seconds; the chain's if not given.

    Attributes
    ----------
    rows : int
        How many there were, gaps included.
    bin_rows : int
        How many rows make a bin, a power of two.
    events : sequence of Event
        For the caller to set.
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
        # A power of two, so that whole pairs of bins become one.
        self._most_bins = 1 << max(most_cells // channels, 2).bit_length() - 1
        self._low = np.full((self._most_bins, channels), np.nan, np.float32)
        self._high = self._low.copy()
        self._codes = np.zeros((self._most_bins, channels), np.uint8)
        self._truth: _Intervals | None = None
        self._slip, self._groups = _Intervals(), [_Intervals() for _ in config.groups]
        self._room = ROWS_PER_BIN * self._most_bins
        self._before, self._after = config.samples(BEFORE_S), config.samples(AFTER_S)
        self._kept: list[tuple[RowNumbers, Volts, Codes]] = []
        self._tail = self._no_rows()
        self._starts: RowNumbers = np.empty(0, np.int64)

    def add(self, volts: ArrayLike, result: SlipResult, truth: ArrayLike | None) -> None:
        """Take the next rows.

        Parameters
        ----------
        volts : array_like, shape (n, c)
            Oldest row first; NaN for a sample that is missing.
        result : SlipResult
            Of these rows, with its level.
        truth : array_like of bool, shape (n,), or None
            Whether there is slip, where the recording says so, for all of its rows or for none.
        """
        values = np.asarray(volts, np.float64)
        if not len(values):
            return
        samples = np.where(np.abs(values) < MOST_VOLTS, values, np.nan).astype(np.float32)
        codes = level_codes(result, self.config.threshold)
        starts = self._slip.add(result.slip, self.rows)
        for group, on in zip(self._groups, result.groups.T, strict=True):
            group.add(on, self.rows)
        if truth is not None:
            self._truth = self._truth or _Intervals()
            slips = self._truth.add(np.asarray(truth, dtype=bool), self.rows)
            starts = np.union1d(starts, slips)
        self._fill_bins(samples, codes)
        self.rows += len(values)
        self._keep(samples, codes, starts)

    def gap(self, seconds: float) -> None:
        """Let time go on without rows."""
        self._take(self._wanted(self.rows), self.rows)
        self._tail, self._starts = self._no_rows(), self._starts[:0]
        for intervals in (self._slip, *self._groups, *([self._truth] if self._truth else [])):
            intervals.end(self.rows)
        self.rows += round(seconds * self.sample_rate_hz)
        self._coarsen_to(self.rows)

    def bins(self, bin_rows: int) -> tuple[Volts, Volts, Codes]:
        """Return the lowest and highest volts and the highest level's code of each bin.

        Parameters
        ----------
        bin_rows
            How many rows make a bin: a power of two, at least the attribute of that name.

        Returns
        -------
        low, high : ndarray of float32, shape (bins, c)
            NaN where no sample of the bin is a number.
        codes : ndarray of uint8, shape (bins, c)
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
        """Intervals of rows, start and stop, of the global decision; shape (m, 2)."""
        return self._slip.pairs(self.rows)

    @property
    def groups(self) -> dict[str, RowNumbers]:
        """Intervals of each group by its name, arrays of shape (m, 2)."""
        pairs = [group.pairs(self.rows) for group in self._groups]
        return dict(zip(self.config.groups, pairs, strict=True))

    @property
    def truth(self) -> RowNumbers | None:
        """Intervals of true slip, shape (m, 2); None where nothing is known of it."""
        return None if self._truth is None else self._truth.pairs(self.rows)

    @property
    def snippets(self) -> list[Snippet]:
        """The rows that were kept as they were, in order."""
        kept = [*self._kept, self._pick(self._wanted(self.rows)[: self._room])]
        rows, volts, codes = (np.concatenate(parts) for parts in zip(*kept, strict=True))
        cuts = np.flatnonzero(np.diff(rows) > 1) + 1
        pieces = (np.split(array, cuts) for array in (rows, volts, codes))
        return [Snippet(int(at[0]), v, c) for at, v, c in zip(*pieces, strict=True) if len(at)]

    def _coarsen_to(self, rows: int) -> None:
        """Make bins longer until so many rows fit."""
        half = self._most_bins // 2
        while rows > self._most_bins * self.bin_rows:
            self.bin_rows *= 2
            self._low[:half] = np.fmin(self._low[::2], self._low[1::2])
            self._high[:half] = np.fmax(self._high[::2], self._high[1::2])
            self._codes[:half] = np.maximum(self._codes[::2], self._codes[1::2])
            self._low[half:] = self._high[half:] = np.nan
            self._codes[half:] = 0

    def _fill_bins(self, volts: Volts, codes: Codes) -> None:
        """Enter rows that come after ``self.rows`` others."""
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

    def _keep(self, volts: Volts, codes: Codes, starts: RowNumbers) -> None:
        """Keep the rows that are near a start; the last ones wait for what comes after them."""
        self._tail = (
            np.concatenate([self._tail[0], volts]),
            np.concatenate([self._tail[1], codes]),
        )
        self._starts = np.concatenate([self._starts, starts])
        decided = max(self.rows - self._before, self.rows - len(self._tail[0]))
        self._take(self._wanted(decided), decided)

    def _no_rows(self) -> tuple[Volts, Codes]:
        channels = self.config.channels
        return np.empty((0, channels), np.float32), np.empty((0, channels), np.uint8)

    def _wanted(self, stop: int) -> RowNumbers:
        """Return which rows of the tail, up to a row of the recording, are near a start."""
        first = self.rows - len(self._tail[0])
        rows = np.arange(first, stop)
        from_here = np.searchsorted(self._starts, rows + self._before, 'right')
        to_here = np.searchsorted(self._starts, rows - self._after, 'left')
        return np.flatnonzero(from_here > to_here)

    def _pick(self, wanted: RowNumbers) -> tuple[RowNumbers, Volts, Codes]:
        volts, codes = self._tail
        return wanted + self.rows - len(volts), volts[wanted], codes[wanted]

    def _take(self, wanted: RowNumbers, decided: int) -> None:
        """Move rows out of the tail, which then begins at ``decided``."""
        fit = wanted[: self._room]
        self._room -= len(fit)
        if len(fit):
            self._kept.append(self._pick(fit))
        ahead = decided - (self.rows - len(self._tail[0]))
        self._tail = (self._tail[0][ahead:].copy(), self._tail[1][ahead:].copy())
        self._starts = self._starts[self._starts + self._after >= decided]
