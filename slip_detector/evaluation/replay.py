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

"""Runs one chain over a recording, piece by piece.

Memory grows with the number of slips and alarms, not with the rows.
"""

import dataclasses
import itertools
from collections.abc import Iterable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Samples
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.chain.stamps import missing_rows
from slip_detector.evaluation.figures import (
    ALREADY_ON,
    FALSE,
    REPEAT,
    SETTLING,
    STAGES,
    TRUE,
    Alarm,
    ReplayOutcome,
    TrueSlip,
    mean_and_sd,
)
from slip_detector.evaluation.matching import OnIntervals, RowInterval, ScoredRows
from slip_detector.evaluation.scores import Kinds, ScoreTally, kinds_of
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

#: Number of values that the chain is given at a time, so that its results stay in the cache.
BLOCK_VALUES = 131072

#: Takes the place of a row that has not come.
NEVER = np.iinfo(np.int64).max


class Observer(Protocol):
    """Receives the rows of a recording during its replay, as the overview of a report does."""

    def add(self, volts: Floats, result: SlipResult, truth: Bools, /) -> None:
        """Take the next rows; the result has their level, and with evidence floor and excess."""

    def gap(self, seconds: float, /) -> None:
        """Take the length of the gap before the next rows."""


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
        the outcome does not have is not computed.

    Raises
    ------
    ValueError
        When the chain cannot be built.

    Examples
    --------
    >>> from slip_detector.evaluation.figures import figures_of_merit
    >>> volts = np.zeros((760, 16))
    >>> volts[380:] = np.sin(2 * np.pi * 20.0 * np.arange(380) / 380.0)[:, np.newaxis]
    >>> slips = Samples.evenly(volts, 380.0, truth=np.arange(760) >= 380)
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
        self.watch = _StageWatch(chain_config) if stages else None

    def run(
        self,
        pieces: Iterable[Samples],
        sample_rate_hz: float | None = None,
        observer: Observer | None = None,
    ) -> ReplayOutcome:
        """Replay a recording.

        Parameters
        ----------
        pieces
            The whole recording with its labels, in pieces of any length.
        sample_rate_hz
            Rate of the recording, which turns rows into times; the chain's rate if not given.
        observer
            Receives all rows and gaps in their order.

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


class _StageWatch:
    """Divides the latency of a detection into the parts of filter, envelope, decision and vote.

    From the start of a slip on, two further chains run until its alarm: one like the chain that is
    replayed, for the envelope, and one with windows of one sample, whose envelope is the filtered
    signal, rectified and raised to the exponent. So the algorithm is written once, and few rows
    run three times.

    Filtered signal and envelope are compared with the threshold; where evidence decides, with the
    channel's noise floor plus ``evidence_offset_db``, above which evidence grows.
    """

    def __init__(self, config: ChainConfig) -> None:
        one_s = 1.0 / config.sample_rate_hz
        self._chain, self._config = SlipChain(config), config
        self._filters = SlipChain(
            dataclasses.replace(
                config, envelope_window_s=one_s, decision_window_s=one_s, decision='mean'
            )
        )
        self._members = [np.array(members) - 1 for members in config.groups.values()]

    def begin(self, chain: SlipChain) -> None:
        """Start at a slip, before the chain that is replayed receives its first row."""
        self._chain.state[:] = chain.state
        self._filters.take_filters(chain)
        # The first row above the threshold, for each of the first three stages and each channel.
        self._first = np.full((3, self._config.channels), NEVER)
        self._row = 0

    def follow(self, volts: Floats) -> None:
        """Take the next rows, at least one; with the alarm, if it rises, in the last of them."""
        evidence = self._config.decision == 'evidence'
        result = self._result = self._chain.update(volts, level=False, floor=evidence)
        filtered = self._filters.update(volts, level=False).envelope
        least: Floats | float = self._config.threshold
        if evidence:
            least = 10.0 ** ((result.floor + self._config.evidence_offset_db) / 20.0)
        passed = filtered > least, result.envelope > least, result.channels
        for first, through in zip(self._first, passed, strict=True):
            valid = through & result.valid
            new = valid.any(axis=0) & (first == NEVER)
            first[new] = self._row + valid.argmax(axis=0)[new]
        self._row += len(volts)

    def stages(self) -> dict[str, int]:
        """Return the rows spent in each stage, from slip to alarm, which has come."""
        deciding = self._members[int(self._result.groups[-1].argmax())]
        # A later stage may be above the threshold before the one that feeds it, as the windows
        # still hold rows from before the slip. Then the earlier stage ends at the same row.
        above = [*self._first[:, deciding].min(axis=1).tolist(), self._row - 1]
        ends = np.minimum.accumulate(above[::-1])[::-1]
        return dict(zip(STAGES, np.diff(ends, prepend=0).tolist(), strict=True))

    def lost_at(self) -> str:
        """Return the first stage at which no channel was above the threshold, or the vote."""
        lost = (self._first == NEVER).all(axis=1)
        return STAGES[int(lost.argmax()) if lost.any() else -1]


@dataclasses.dataclass
class _Slip:
    """A slip, as far as the replay has come.

    Attributes
    ----------
    start : int
        Its first row.
    first_on : ndarray of int, shape (c,)
        The row of the first ON of each enabled channel during the slip; -1 without an ON so far.
    """

    start: int
    first_on: NDArray[np.int64]
    on_at_start: bool
    on_while: bool = False
    stages: dict[str, int] | None = None
    lost_at: str | None = None


class _Run:
    """The replay of one recording, and its counts and intervals so far."""

    def __init__(self, replay: Replay, rate_hz: float, observer: Observer | None) -> None:
        self._replay, self._rate_hz, self._observer = replay, rate_hz, observer
        self._chain, self._tally, self._watch = replay.chain, replay.tally, replay.watch
        config = self._chain.config
        disabled = {channel - 1 for channel in config.disabled_channels}
        self._enabled = [c for c in range(config.channels) if c not in disabled]
        self._block_rows = max(BLOCK_VALUES // config.channels, 1)
        self._tail_rows = round(replay.config.tail_s * rate_hz)
        self._late_rows = round(replay.config.late_after_s * rate_hz)
        self._row = 0  # Number of the next row; rows that are missing in gaps count.
        self._rows = self._slip_rows = self._on_rows = 0
        self._moving_rows: int | None = None
        self._last_ns = 0
        self._labels, self._on = OnIntervals(), OnIntervals()
        self._stretches: list[RowInterval] = []
        self._stretch_start = 0
        self._slips: list[_Slip] = []
        self._watching = False  # whether the alarm of the last slip may still rise

    def add(self, piece: Samples) -> None:
        volts, truth = np.asarray(piece.volts, np.float64), np.asarray(piece.truth, np.bool_)
        n = len(volts)
        if truth.shape != (n,):
            raise ValueError(f'truth has the shape {truth.shape}, allowed: ({n},), as volts')
        if not n:
            return
        if piece.new_stretch and self._rows:
            self._begin_stretch(int(piece.stamps_ns[0]))
        if piece.moving is not None:
            self._moving_rows = (self._moving_rows or 0) + int(np.count_nonzero(piece.moving))
        kinds = kinds_of(truth, piece.moving)
        # A block ends before each slip, so that the watch can copy the chain's state at that row.
        starts = np.flatnonzero(truth & ~np.concatenate([[self._labels.on], truth[:-1]]))
        cuts = {*range(0, n, self._block_rows), *starts.tolist(), n}
        for a, b in itertools.pairwise(sorted(cuts)):
            self._block(volts[a:b], truth[a:b], kinds[a:b])
        self._last_ns = int(piece.stamps_ns[-1])

    def _begin_stretch(self, first_ns: int) -> None:
        self._end_stretch()
        missing = missing_rows(self._last_ns, first_ns, self._rate_hz)
        self._row += missing
        self._stretch_start = self._row
        if self._observer and missing:
            self._observer.gap(missing / self._rate_hz)
        self._chain.restart()

    def _end_stretch(self) -> None:
        self._labels.close(self._row)
        self._on.close(self._row)
        if self._row > self._stretch_start:
            self._stretches.append(RowInterval(self._stretch_start, self._row))
        self._end_watch()

    def _block(self, volts: Floats, truth: Bools, kinds: Kinds) -> None:
        """Take rows with at most one slip, which is at their beginning."""
        if truth[0] and not self._labels.on:
            self._begin_slip()
        votes = (self._chain.config.vote,) if self._tally else ()
        # An observer receives floor and excess, which make evidence.
        level = self._observer is not None
        evidence = level and self._chain.config.decision == 'evidence'
        result = self._chain.update(
            volts, envelope=False, level=level, floor=evidence, excess=evidence, votes=votes
        )
        on = np.ascontiguousarray(result.slip)
        self._labels.add(truth, self._row)
        self._on.add(on, self._row)
        n_slip = int(np.count_nonzero(truth))
        if n_slip:
            self._note_first_on(result, on[:n_slip], n_slip)
        if self._watching:
            self._follow(volts, on)
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
        slip = _Slip(self._row, np.full(len(self._enabled), -1), on_at_start=self._on.on)
        self._slips.append(slip)
        if slip.on_at_start:
            slip.lost_at = ALREADY_ON  # Used only if no later alarm finds the slip.
        elif self._watch:
            self._watch.begin(self._chain)
            self._watching = True

    def _note_first_on(self, result: SlipResult, on: Bools, n_slip: int) -> None:
        slip = self._slips[-1]
        slip.on_while |= bool(on.any())
        waiting = np.flatnonzero(slip.first_on < 0)
        if waiting.size:
            channels = result.channels[:n_slip, np.array(self._enabled)[waiting]]
            found = channels.any(axis=0)
            slip.first_on[waiting[found]] = self._row + channels.argmax(axis=0)[found]

    def _follow(self, volts: Floats, on: Bools) -> None:
        """Give the watch the rows in which the alarm of the last slip may rise."""
        assert self._watch is not None
        able = len(on)
        if not self._labels.on:
            able = min(able, max(self._labels.edges[-1] + self._tail_rows - self._row, 0))
        rises = np.flatnonzero(on[:able])
        n = rises[0] + 1 if rises.size else able
        if n:
            self._watch.follow(volts[:n])
        if rises.size:
            self._slips[-1].stages = self._watch.stages()
            self._watching = False
        elif able < len(on):
            self._end_watch()

    def _end_watch(self) -> None:
        """Note where the last slip was lost, if its alarm has not come."""
        if self._watching:
            assert self._watch is not None
            self._slips[-1].lost_at = self._watch.lost_at()
            self._watching = False

    def outcome(self) -> ReplayOutcome:
        self._end_stretch()
        on, rate_hz = self._on.closed(), self._rate_hz
        labels, config = self._labels.closed(), self._replay.config
        scored = ScoredRows(
            labels, self._stretches, settling_rows(self._chain.config), config, rate_hz
        )
        alarms = scored.alarms(on)
        rises = [alarm.start for alarm in alarms]
        alarm_of, slip_of = scored.match(rises)
        slips = [
            self._true_slip(
                s, labels[s].end, scored, alarm, None if alarm is None else rises[alarm]
            )
            for s, alarm in enumerate(alarm_of)
        ]
        kinds = []
        for a, (settles, of) in enumerate(zip(scored.settling(rises), slip_of, strict=True)):
            if settles or (of is not None and slips[of].settling):
                kinds.append(SETTLING)
            elif of is None:
                kinds.append(FALSE)
            else:
                kinds.append(TRUE if alarm_of[of] == a else REPEAT)
        return ReplayOutcome(
            rows=self._rows,
            slip_rows=self._slip_rows,
            moving_rows=self._moving_rows,
            on_rows=self._on_rows,
            settling_rows=scored.settling_rows,
            rest_rows=scored.rest_rows,
            on_rest_rows=scored.on_rest_rows(on),
            sample_rate_hz=rate_hz,
            slips=tuple(slips),
            alarms=tuple(
                Alarm(alarm.start / rate_hz, alarm.end / rate_hz, kind, of)
                for alarm, kind, of in zip(alarms, kinds, slip_of, strict=True)
            ),
            scores=self._tally.collect() if self._tally else None,
        )

    def _true_slip(
        self, number: int, end: int, rows: ScoredRows, alarm: int | None, rise: int | None
    ) -> TrueSlip:
        """Return a slip with its alarm, which rises at the row ``rise``."""
        slip, rate_hz = self._slips[number], self._rate_hz
        latency = None if rise is None else rise - slip.start
        missed = rise is None and bool(rows.scored[number])
        delays_s = tuple(
            None if row < 0 else (row - slip.start) / rate_hz for row in slip.first_on.tolist()
        )
        # The watched rise may belong to an alarm that began before the slip.
        stages = slip.stages if slip.stages and sum(slip.stages.values()) == latency else None
        return TrueSlip(
            start_s=slip.start / rate_hz,
            end_s=end / rate_hz,
            alarm=alarm,
            latency_s=None if latency is None else latency / rate_hz,
            settling=not rows.scored[number],
            lead_s=float(rows.leads_s[number]),
            window_s=float(rows.windows_s[number]),
            late=latency is not None and latency > self._late_rows,
            stages_s=None if stages is None else {k: n / rate_hz for k, n in stages.items()},
            lost_at=(ALREADY_ON if slip.stages else slip.lost_at) if missed else None,
            on_at_start=slip.on_at_start,
            on_while=slip.on_while,
            channel_delays_s=delays_s,
            delay_s=mean_and_sd(delays_s)[0],
        )
