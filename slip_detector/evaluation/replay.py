"""Runs one chain over a recording, piece by piece, and computes the figures of the whole.

The memory that this takes grows with the number of slips and alarms, not with the rows.
"""

import dataclasses
import itertools
from collections.abc import Iterable, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.result import SlipResult
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.events import (
    ALREADY_ON,
    FALSE,
    REPEAT,
    TRUE,
    Alarm,
    TrueSlip,
    event_figures,
)
from slip_detector.evaluation.labelled_rows import (
    MOTION,
    Kinds,
    LabelledRows,
    Stamps,
    rows_in_gap,
)
from slip_detector.evaluation.matching import OnIntervals, match, tolerance_rows
from slip_detector.evaluation.paper_figures import mean_and_sd, paper_figures
from slip_detector.evaluation.scores import ScoreCounts, ScoreTally
from slip_detector.evaluation.stage_watch import StageWatch
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: Number of values that the chain is given at a time, so that its results stay in the cache.
BLOCK_VALUES = 131072

#: Length of the block that begins with a slip. The alarm is mostly in it, and then the following
#: rows need no envelope.
WATCHED_ROWS = 64


class Observer(Protocol):
    """Receives the rows of a recording during its replay, as the overview of a report does."""

    def add(self, volts: Floats, result: SlipResult, truth: Bools, /) -> None:
        """Take the next rows; the result has their level, with evidence floor and excess too."""

    def gap(self, seconds: float, /) -> None:
        """Take the length of the gap before the next rows."""


@dataclasses.dataclass(frozen=True)
class ReplayOutcome:
    """What a chain made of a recording.

    Attributes
    ----------
    rows, slip_rows : int
    moving_rows : int or None
        Number of rows of motion; None where the recording has no velocities.
    on_rows : int
        Number of rows without slip in which the global decision is ON.
    sample_rate_hz : float
        Rate of the recording.
    slips : tuple of TrueSlip
    alarms : tuple of Alarm
    scores : ScoreCounts or None
        Scores of the decision statistic; None where they were not asked for.
    """

    rows: int
    slip_rows: int
    moving_rows: int | None
    on_rows: int
    sample_rate_hz: float
    slips: tuple[TrueSlip, ...]
    alarms: tuple[Alarm, ...]
    scores: ScoreCounts | None

    @property
    def duration_s(self) -> float:
        """Time of its rows, gaps left out."""
        return self.rows / self.sample_rate_hz

    @property
    def quiet_s(self) -> float:
        """Time of its rows without slip."""
        return (self.rows - self.slip_rows) / self.sample_rate_hz


def figures_of_merit(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    """Return the figures of merit of recordings, at least one, taken together.

    Returns
    -------
    dict
        Numbers, None where one is not defined: ``rows``, ``slip_rows``, ``moving_rows`` and
        ``duration_s``; areas under the ROC curve of the decision statistic, for rows with slip
        against all other rows (``auc_all``) and against rows of motion (``auc_moving``); the
        figures of :func:`slip_detector.evaluation.paper_figures.paper_figures` and of
        :func:`slip_detector.evaluation.events.event_figures`.

    Examples
    --------
    >>> rest = LabelledRows(np.full((760, 16), 4.3), truth=np.zeros(760, bool))
    >>> figures = figures_of_merit([Replay(ChainConfig()).run([rest])])
    >>> figures['duration_s'], figures['false_alarms'], figures['recall']
    (2.0, 0, None)
    """
    slips = [slip for one in outcomes for slip in one.slips]
    rows, slip_rows = sum(one.rows for one in outcomes), sum(one.slip_rows for one in outcomes)
    moving = [one.moving_rows for one in outcomes if one.moving_rows is not None]
    scores = ScoreCounts.pooled([one.scores for one in outcomes if one.scores is not None])
    return {
        'rows': rows,
        'slip_rows': slip_rows,
        'moving_rows': sum(moving) if moving else None,
        'duration_s': sum(one.duration_s for one in outcomes),
        'auc_all': scores.auc(),
        'auc_moving': scores.auc([MOTION]) if moving else None,
        **paper_figures(slips, sum(one.on_rows for one in outcomes), rows - slip_rows),
        **event_figures(
            slips,
            [alarm for one in outcomes for alarm in one.alarms],
            sum(one.quiet_s for one in outcomes),
        ),
    }


class Replay:
    """Runs one chain over recordings, each from its first row as the detector node would.

    Parameters
    ----------
    chain_config
        The parameters of the chain.
    config
        What counts as detected.
    scores, stages
        Whether the outcome has the scores of the ROC curve, and the parts of each latency. What
        is left out takes no time.

    Raises
    ------
    ValueError
        When the chain cannot be built.

    Examples
    --------
    >>> volts = np.zeros((760, 16))
    >>> volts[380:] = np.sin(2 * np.pi * 20.0 * np.arange(380) / 380.0)[:, np.newaxis]
    >>> slips = LabelledRows(volts, truth=np.arange(760) >= 380)
    >>> outcome = Replay(ChainConfig()).run([slips])
    >>> figures = figures_of_merit([outcome])
    >>> figures['matched'], figures['false_alarms'], figures['success_percent']
    (1, 0, 100.0)
    """

    def __init__(
        self,
        chain_config: ChainConfig,
        config: EvaluationConfig | None = None,
        *,
        scores: bool = True,
        stages: bool = True,
    ) -> None:
        self.config = config or EvaluationConfig()
        self.chain = SlipChain(chain_config)
        self.tally = ScoreTally() if scores else None
        self.watch = StageWatch(chain_config) if stages else None

    def run(
        self,
        pieces: Iterable[LabelledRows],
        sample_rate_hz: float | None = None,
        observer: Observer | None = None,
    ) -> ReplayOutcome:
        """Replay a recording.

        Parameters
        ----------
        pieces
            The whole recording, in pieces of any length.
        sample_rate_hz
            Rate of the recording, which turns rows into times; the chain's rate if not given.
        observer
            Is given all rows and gaps in their order.

        Raises
        ------
        ValueError
            When the number of channels in a piece is not that of the chain.
        """
        self.chain.reset()
        run = _Run(self, sample_rate_hz or self.chain.config.sample_rate_hz, observer)
        for piece in pieces:
            run.add(piece)
        return run.outcome()


@dataclasses.dataclass
class _Slip:
    """What is known of a slip so far.

    Attributes
    ----------
    start : int
        Its first row.
    first_on : ndarray of int, shape (c,)
        The row of the first ON of each enabled channel during the slip; -1 before it.
    """

    start: int
    first_on: NDArray[np.int64]
    on_at_start: bool
    on_while: bool = False
    stages: dict[str, int] | None = None
    lost_at: str | None = None


class _Run:
    """The replay of one recording, and what is known of it so far."""

    def __init__(self, replay: Replay, rate_hz: float, observer: Observer | None) -> None:
        self._replay, self._rate_hz, self._observer = replay, rate_hz, observer
        self._chain, self._tally, self._watch = replay.chain, replay.tally, replay.watch
        config, chain_config = replay.config, self._chain.config
        self._early, self._tail = tolerance_rows(config, rate_hz)
        self._late_after = round(config.late_after_s * rate_hz)
        disabled = {channel - 1 for channel in chain_config.disabled_channels}
        self._enabled = [c for c in range(chain_config.channels) if c not in disabled]
        self._block_rows = max(BLOCK_VALUES // chain_config.channels, 1)
        self._row = 0  # with the rows that are missing in gaps
        self._rows = self._slip_rows = self._moving_rows = self._on_rows = 0
        self._moves = False
        self._last_stamps_ns: Stamps | None = None
        self._labels, self._alarms = OnIntervals(), OnIntervals()
        self._slips: list[_Slip] = []

    def add(self, piece: LabelledRows) -> None:
        volts, truth = np.asarray(piece.volts, np.float64), np.asarray(piece.truth, np.bool_)
        n = len(volts)
        if truth.shape != (n,):
            raise ValueError(f'truth has the shape {truth.shape}, allowed: ({n},), as volts')
        if not n:
            return
        if piece.new_stretch and self._rows:
            self._begin_stretch(piece.stamps_ns)
        kinds = piece.kinds
        if piece.moving is not None:
            self._moves = True
            self._moving_rows += int(np.count_nonzero(piece.moving))
        # A block ends before each slip: the chain is then as it was when the slip began.
        starts = np.flatnonzero(truth & ~np.concatenate([[self._labels.on], truth[:-1]]))
        cuts = {*range(0, n, self._block_rows), *starts.tolist(), n}
        if self._watch:
            cuts.update(row for row in (starts + WATCHED_ROWS).tolist() if row < n)
        for a, b in itertools.pairwise(sorted(cuts)):
            self._block(volts[a:b], truth[a:b], kinds[a:b])
        self._last_stamps_ns = piece.stamps_ns

    def _begin_stretch(self, stamps_ns: Stamps | None) -> None:
        self._end_stretch()
        missing = rows_in_gap(self._last_stamps_ns, stamps_ns, self._rate_hz)
        self._row += missing
        if self._observer and missing:
            self._observer.gap(missing / self._rate_hz)
        self._chain.restart()

    def _end_stretch(self) -> None:
        self._labels.close(self._row)
        self._alarms.close(self._row)
        self._end_watch()

    def _block(self, volts: Floats, truth: Bools, kinds: Kinds) -> None:
        """Take rows with at most one slip, which is at their beginning."""
        if truth[0] and not self._labels.on:
            self._begin_slip()
        watching = self._watch is not None and self._watch.watching
        votes = (self._chain.config.vote,) if self._tally else ()
        level = self._observer is not None
        # An observer is given all that evidence is made of, the watch the floors.
        evidence = self._chain.config.decision == 'evidence'
        floor, excess = evidence and (watching or level), evidence and level
        result = self._chain.update(
            volts, envelope=watching, level=level, floor=floor, excess=excess, votes=votes
        )
        on = np.ascontiguousarray(result.slip)
        self._labels.add(truth, self._row)
        self._alarms.add(on, self._row)
        n_slip = int(np.count_nonzero(truth))
        if n_slip:
            self._note_first_on(result, on[:n_slip], n_slip)
        if watching:
            self._follow(volts, result, on)
        self._rows += len(on)
        self._slip_rows += n_slip
        self._on_rows += int(np.count_nonzero(on[n_slip:]))
        if self._tally:
            self._tally.add(result.vote_statistic[:, 0], kinds)
        if self._observer:
            self._observer.add(volts, result, truth)
        self._row += len(on)

    def _begin_slip(self) -> None:
        self._end_watch()
        slip = _Slip(self._row, np.full(len(self._enabled), -1), on_at_start=self._alarms.on)
        self._slips.append(slip)
        if slip.on_at_start:
            slip.lost_at = ALREADY_ON  # unless it has another alarm
        elif self._watch:
            self._watch.begin(self._chain, self._row)

    def _note_first_on(self, result: SlipResult, on: Bools, n_slip: int) -> None:
        slip = self._slips[-1]
        slip.on_while |= bool(on.any())
        waiting = np.flatnonzero(slip.first_on < 0)
        if waiting.size:
            channels = result.channels[:n_slip, np.array(self._enabled)[waiting]]
            found = channels.any(axis=0)
            slip.first_on[waiting[found]] = self._row + channels.argmax(axis=0)[found]

    def _follow(self, volts: Floats, result: SlipResult, on: Bools) -> None:
        """Give the watch the rows in which the alarm of the last slip may rise."""
        assert self._watch is not None
        n = len(on)
        if not self._labels.on:
            n = min(n, self._labels.edges[-1] + self._tail - self._row)
        rises = np.flatnonzero(on[: max(n, 0)])
        if n > 0:
            rise = int(rises[0]) if rises.size else None
            self._watch.follow(volts[:n], result, self._row, rise)
        if n < len(on) or rises.size:
            self._end_watch()

    def _end_watch(self) -> None:
        """Note the parts of the last slip's latency, or where the slip was lost."""
        if self._watch and self._watch.watching:
            slip = self._slips[-1]
            slip.stages = self._watch.stages()
            slip.lost_at = None if slip.stages else self._watch.lost_at()
            self._watch.watching = False

    def outcome(self) -> ReplayOutcome:
        self._end_stretch()
        labels, alarms = self._labels.closed(), self._alarms.closed()
        alarm_of, slip_of = match(labels, [a.start for a in alarms], self._early, self._tail)
        slips = [
            self._true_slip(slip, label.end, None if k is None else alarms[k].start, k)
            for slip, label, k in zip(self._slips, labels, alarm_of, strict=True)
        ]
        kinds = [
            FALSE if k is None else TRUE if alarm_of[k] == a else REPEAT
            for a, k in enumerate(slip_of)
        ]
        return ReplayOutcome(
            rows=self._rows,
            slip_rows=self._slip_rows,
            moving_rows=self._moving_rows if self._moves else None,
            on_rows=self._on_rows,
            sample_rate_hz=self._rate_hz,
            slips=tuple(slips),
            alarms=tuple(
                Alarm(alarm.start / self._rate_hz, alarm.end / self._rate_hz, kind, slip)
                for alarm, kind, slip in zip(alarms, kinds, slip_of, strict=True)
            ),
            scores=self._tally.take() if self._tally else None,
        )

    def _true_slip(self, slip: _Slip, end: int, rise: int | None, alarm: int | None) -> TrueSlip:
        rate_hz = self._rate_hz
        latency = None if rise is None else rise - slip.start
        delays_s = tuple(
            None if row < 0 else (row - slip.start) / rate_hz for row in slip.first_on.tolist()
        )
        own = slip.stages if latency is not None and latency >= 0 else None
        return TrueSlip(
            start_s=slip.start / rate_hz,
            end_s=end / rate_hz,
            alarm=alarm,
            latency_s=None if latency is None else latency / rate_hz,
            late=latency is not None and latency > self._late_after,
            stages_s=None if own is None else {name: n / rate_hz for name, n in own.items()},
            lost_at=slip.lost_at if latency is None else None,
            on_at_start=slip.on_at_start,
            on_while=slip.on_while,
            channel_delays_s=delays_s,
            delay_s=mean_and_sd(delays_s)[0],
        )
