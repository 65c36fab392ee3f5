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
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Bools, Floats, Ints, Samples
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.chain.stamps import missing_rows
from slip_detector.chain.watch import Watch
from slip_detector.evaluation import figures
from slip_detector.evaluation.figures import STAGES, Alarm, ReplayOutcome, TrueSlip, mean_and_sd
from slip_detector.evaluation.matching import NONE, OnIntervals, ScoredRows, rows_on, unscored_rows
from slip_detector.evaluation.scores import UNCERTAIN, Kinds, ScoreTally, kinds_of
from slip_detector.parameters import ChainConfig, EvaluationConfig

#: Number of values that the chain is given at a time, so that its results stay in the cache.
BLOCK_VALUES = 131072

#: The chain is looked at (:mod:`.watch`) after each of these blocks, and after each of so many
#: seconds at the beginning of a piece, which may be all there is.
FIRST_LOOKS = 10

#: Takes the place of a row that has not come.
NEVER = np.iinfo(np.int64).max


def only_filters(config: ChainConfig) -> ChainConfig:
    """Return the configuration of a chain whose envelope is the filtered signal of another.

    Its windows have one sample, so the signal is only rectified and raised to the exponent.

    Examples
    --------
    >>> only_filters(ChainConfig(sample_rate_hz=500.0)).envelope_window_s
    0.002
    """
    one_s = 1.0 / config.sample_rate_hz
    return dataclasses.replace(
        config, envelope_window_s=one_s, decision_window_s=one_s, decision='mean'
    )


class Replay:
    """Runs one chain over recordings, each from its first row as the detector node would.

    Parameters
    ----------
    chain_config
        The parameters of the chain.
    config
        What counts as detected.

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

    def __init__(self, chain_config: ChainConfig, config: EvaluationConfig | None = None) -> None:
        self.config = config or EvaluationConfig()
        self.chain = SlipChain(chain_config)
        self.tally, self.filters = ScoreTally(), SlipChain(only_filters(chain_config))

    def run(
        self, pieces: Iterable[Samples], sample_rate_hz: float | None = None, observer: Any = None
    ) -> ReplayOutcome:
        """Replay a recording.

        Parameters
        ----------
        pieces
            The whole recording with its labels, in pieces of any length.
        sample_rate_hz
            Rate of the recording, which turns rows into times; the chain's rate if not given.
        observer
            Receives all rows and gaps in their order, as the overview of a report does, by
            ``add(volts, result, truth)`` and ``gap(seconds)``. The result has envelope and level.

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
    """A slip, as far as the replay has come.

    Attributes
    ----------
    start : int
        Its first row.
    first : ndarray of int, shape (4, c)
        The first row, for each channel, in which it passes each of the first three stages, until
        the alarm comes or can come no more; and its first ON during the slip.
    """

    start: int
    on_at_start: bool
    first: Ints
    stages: dict[str, int] | None = None


def _note_first(first: Ints, on: Bools, row: int) -> None:
    """Note the first row, from ``row`` on, in which each channel is ON; shapes (c,), (n, c)."""
    new = on.any(axis=0) & (first == NEVER)
    first[new] = row + on.argmax(axis=0)[new]


class _Run:
    """The replay of one recording, and its counts and intervals so far."""

    def __init__(self, replay: Replay, rate_hz: float, observer: Any) -> None:
        self._replay, self._rate_hz, self._observer = replay, rate_hz, observer
        self._accuracy_s, self._kind = 0.0, ''
        self._chain, self._config = replay.chain, replay.chain.config
        self._row = 0  # Number of the next row; rows that are missing in gaps count.
        self._settling = settling_rows(self._config)
        self._unscored = unscored_rows(self._settling, replay.config, rate_hz)
        self._moving_rows: int | None = None
        self._valid_rows = np.zeros(self._config.channels)
        self._last_ns = 0
        self._signals = OnIntervals(), OnIntervals(), OnIntervals()
        self._stretches, self._labels, self._on = self._signals
        self._slips: list[_Slip] = []
        self._watch, self._wrong = Watch(replay.chain), dict[str, list[int]]()
        self._watching = False  # whether the alarm of the last slip may still rise

    def add(self, piece: Samples) -> None:
        volts, truth = np.asarray(piece.volts, np.float64), np.asarray(piece.truth, np.bool_)
        n, self._accuracy_s, self._kind = len(volts), piece.accuracy_s, piece.kind
        if not n:
            return
        if piece.new_stretch and self._row:
            self._end_stretch()
            missing = missing_rows(self._last_ns, int(piece.stamps_ns[0]), self._rate_hz)
            self._row += missing
            if self._observer and missing:
                self._observer.gap(missing / self._rate_hz)
            self._chain.restart()
        if piece.moving is not None:
            self._moving_rows = (self._moving_rows or 0) + int(np.count_nonzero(piece.moving))
        kinds = kinds_of(truth, piece.moving, piece.certain, piece.kind)
        # A block ends before each slip, so that the stages can be watched from that row on.
        starts = np.flatnonzero(truth & ~np.concatenate([[self._labels.on], truth[:-1]]))
        block_rows = max(BLOCK_VALUES // self._config.channels, 1)
        seconds = range(0, n, self._config.samples(1.0))[:FIRST_LOOKS]
        cuts = {*range(0, n, block_rows), *seconds, *starts.tolist(), n}
        for a, b in itertools.pairwise(sorted(cuts)):
            self._block(volts[a:b], truth[a:b], kinds[a:b])
        self._last_ns = int(piece.stamps_ns[-1])

    def _end_stretch(self) -> None:
        for intervals in self._signals:
            intervals.close(self._row)
        self._watching = False

    def _block(self, volts: Floats, truth: Bools, kinds: Kinds) -> None:
        """Take rows with at most one slip, which is at their beginning."""
        row = self._row
        if truth[0] and not self._labels.on:
            first = np.full((4, self._config.channels), NEVER)
            self._slips.append(_Slip(row, self._on.on, first))
            self._watching = not self._on.on
            self._replay.filters.take_filters(self._chain)
        result = self._chain.update(
            volts,
            envelope=self._watching or self._observer is not None,
            level=self._observer is not None,
            floor=self._watching and self._config.decision == 'evidence',
            votes=(self._config.vote,),
        )
        self._wrong.update(self._watch.look([(volts, result)]))
        on = np.ascontiguousarray(result.slip)
        self._stretches.add(np.ones_like(on), row)
        kinds[: max(self._stretches.edges[-1] + self._unscored - row, 0)] = UNCERTAIN
        self._labels.add(truth, row)
        self._on.add(on, row)
        self._valid_rows += np.ones(len(on)) @ result.valid
        if truth[0]:
            _note_first(self._slips[-1].first[3], result.channels[: np.count_nonzero(truth)], row)
        if self._watching:
            self._follow(volts, result)
        self._replay.tally.add(result.vote_statistic[:, 0], kinds)
        if self._observer:
            self._observer.add(volts, result, truth)
        self._row += len(on)

    def _follow(self, volts: Floats, result: SlipResult) -> None:
        """Follow the last slip through the stages until its alarm comes or can come no more.

        Filtered signal and envelope are compared with the threshold; where evidence decides, with
        the channel's noise floor plus ``evidence_offset_db``, above which evidence grows.
        """
        slip, config, able = self._slips[-1], self._config, len(volts)
        if not self._labels.on:
            tail_rows = round(self._replay.config.tail_s * self._rate_hz)
            able = min(able, max(self._labels.edges[-1] + tail_rows - self._row, 0))
        rises = np.flatnonzero(result.slip[:able])
        n = int(rises[0]) + 1 if rises.size else able
        self._watching = not rises.size and able == len(volts)
        if not n:
            return
        least: Floats | float = config.threshold
        if config.decision == 'evidence':
            least = 10.0 ** ((result.floor[:n] + config.evidence_offset_db) / 20.0)
        filtered = self._replay.filters.update(volts[:n], level=False).envelope
        passed = filtered > least, result.envelope[:n] > least, result.channels[:n]
        for first, through in zip(slip.first, passed, strict=False):
            _note_first(first, through & result.valid[:n], self._row)
        if rises.size:
            group = list(config.groups.values())[int(result.groups[n - 1].argmax())]
            deciding = slip.first[:3, np.array(group) - 1].min(axis=1)
            # A later stage may be above the threshold before the one that feeds it, as the windows
            # still hold rows from before the slip. Then the earlier stage ends at the same row.
            above = np.append(deciding, self._row + n - 1) - slip.start
            ends = np.minimum.accumulate(above[::-1])[::-1]
            slip.stages = dict(zip(STAGES, np.diff(ends, prepend=0).tolist(), strict=True))

    def outcome(self) -> ReplayOutcome:
        self._end_stretch()
        stretches, labels, on = (signal.closed() for signal in self._signals)
        config, rate_hz, accuracy_s = self._replay.config, self._rate_hz, self._accuracy_s
        scored = ScoredRows(labels, stretches, self._settling, config, rate_hz, accuracy_s)
        alarms = scored.alarms(on)
        rises = [alarm.start for alarm in alarms]
        alarm_of, slip_of = scored.match(rises)
        its_rises = np.array([*rises, NONE])[alarm_of]
        on_in_slips = rows_on(on, self._labels.edges[::2], self._labels.edges[1::2])
        late_rows = round((config.late_after_s + accuracy_s) * rate_hz)
        disabled = [channel - 1 for channel in self._config.disabled_channels]
        slips = []
        for s, (slip, its_rise) in enumerate(zip(self._slips, its_rises.tolist(), strict=True)):
            latency = None if its_rise == NONE else its_rise - slip.start
            settles, stages_s = not scored.scored[s], None
            ons = np.delete(slip.first[3], disabled).tolist()
            delays_s = tuple(None if row == NEVER else (row - slip.start) / rate_hz for row in ons)
            # The rise that was watched may belong to an alarm that began before the slip.
            if slip.stages and sum(slip.stages.values()) == latency and not accuracy_s:
                stages_s = {stage: rows / rate_hz for stage, rows in slip.stages.items()}
            slips.append(
                TrueSlip(
                    start_s=slip.start / rate_hz,
                    end_s=labels[s].end / rate_hz,
                    alarm=None if latency is None else int(alarm_of[s]),
                    latency_s=None if latency is None else latency / rate_hz,
                    accuracy_s=accuracy_s,
                    settling=settles,
                    late=latency is not None and latency > late_rows,
                    stages_s=stages_s,
                    lost_at=self._lost_at(slip) if latency is None and not settles else None,
                    on_at_start=slip.on_at_start,
                    on_while=bool(on_in_slips[s]),
                    channel_delays_s=delays_s,
                    delay_s=mean_and_sd(delays_s)[0],
                )
            )
        invalid_rows = (_length(stretches) - self._valid_rows).astype(np.int64)
        invalid_rows[disabled] = 0
        found = []
        alarm_settles = scored.settling(rises)
        for a, (alarm, of) in enumerate(zip(alarms, slip_of.tolist(), strict=True)):
            true = figures.TRUE if of != NONE and alarm_of[of] == a else figures.REPEAT
            kind = figures.FALSE if of == NONE else true
            if alarm_settles[a] or (of != NONE and slips[of].settling):
                kind = figures.SETTLING
            its_slip = None if of == NONE else of
            found.append(Alarm(alarm.start / rate_hz, alarm.end / rate_hz, kind, its_slip))
        on_rows = (rows_on(on, *part).sum(keepdims=True) for part in (scored.certain, scored.rest))
        false = sum(alarm.kind == figures.FALSE for alarm in found)
        return ReplayOutcome(
            rows=_length(stretches),
            slip_rows=_length(labels),
            moving_rows=self._moving_rows,
            on_rows=_length(on) - int(on_in_slips.sum()),
            settling_rows=scored.settling_rows,
            sample_rate_hz=rate_hz,
            slips=tuple(slips),
            alarms=tuple(found),
            events=scored.events(self._kind, its_rises[:, None], np.array([false]), *on_rows),
            scores=self._replay.tally.collect(),
            kind=self._kind,
            on_s=tuple((one.start / rate_hz, one.end / rate_hz) for one in on),
            invalid_rows=tuple(invalid_rows.tolist()),
            wrong=self._wrong,
        )

    def _lost_at(self, slip: _Slip) -> str:
        """Return where a missed slip was lost."""
        if slip.on_at_start or slip.stages:
            return figures.ALREADY_ON
        lost = (slip.first[:3] == NEVER).all(axis=1)
        return STAGES[int(lost.argmax()) if lost.any() else 3]


def _length(intervals: Sequence[tuple[int, int]]) -> int:
    return sum(end - start for start, end in intervals)
