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

"""Runs one chain over a recording, piece by piece, and follows each slip to its alarm.

Memory grows with the number of slips and alarms, and with the longest slip that is missed, not
with the rows.
"""

import dataclasses
import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.live_chain import Watch
from slip_detector.chain.samples import Bools, Floats, Samples
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.stamps import missing_rows
from slip_detector.evaluation import figures
from slip_detector.evaluation.figures import STAGES, Alarm, ReplayOutcome, TrueSlip
from slip_detector.evaluation.matching import NONE, OnIntervals, ScoredRows, rows_on, unscored_rows
from slip_detector.evaluation.scores import UNCERTAIN, RowClasses, ScoreTally, row_classes
from slip_detector.parameters import ChainConfig, EvaluationConfig

#: Number of values that the chain is given at a time, so that its results stay in the cache.
BLOCK_VALUES = 131072

#: The chain is looked at (:mod:`.watch`) after each of these blocks, and after each of so many
#: seconds at the beginning of a piece, which may be all there is.
FIRST_LOOKS = 10

#: What is known of a slip that is not followed, as the decision is ON when it begins: how many
#: rows its latency spends in each stage, and where it is lost if it is missed.
UNFOLLOWED: tuple[dict[str, int], str] = {}, figures.ALREADY_ON


def only_filters(config: ChainConfig) -> ChainConfig:
    """Return the configuration of a chain whose envelope is the filtered signal of another.

    Its windows have one sample, so the signal is only rectified and raised to the exponent.
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
    >>> figures['matched'], figures['false_alarms']
    (1, 0)
    """

    def __init__(self, chain_config: ChainConfig, config: EvaluationConfig | None = None) -> None:
        self.config, self.tally = config or EvaluationConfig(), ScoreTally()
        self.chain, self.second = SlipChain(chain_config), SlipChain(chain_config)
        self.filters = SlipChain(only_filters(chain_config))

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
            Receives all rows and gaps in their order, and then the outcome, as the overview of a
            report does, by ``add(volts, result, truth)``, ``gap(seconds)`` and
            ``finish(outcome)``. The result has envelope and level.

        Raises
        ------
        ValueError
            When the number of channels in a piece is not that of the chain.
        """
        self.chain.reset()
        run = _Run(self, sample_rate_hz or self.chain.config.sample_rate_hz, observer)
        for piece in pieces:
            if len(piece.volts):
                run.add(piece)
        outcome = run.outcome()
        if observer:
            observer.finish(outcome)
        return outcome


class _Run:
    """The replay of one recording, and its counts and intervals so far."""

    def __init__(self, replay: Replay, rate_hz: float, observer: Any) -> None:
        self._replay, self._rate_hz, self._observer = replay, rate_hz, observer
        self._chain, self._config = replay.chain, replay.chain.config
        self._row = 0  # Number of the next row; rows that are missing in gaps count.
        self._settling = settling_rows(self._config)
        self._unscored = unscored_rows(self._settling, replay.config, rate_hz)
        self._tail_rows = round(replay.config.tail_s * rate_hz)
        self._moving_rows: int | None = None
        self._valid_rows = np.zeros(self._config.channels)
        self._last = Samples(np.zeros((0, 0)), np.zeros(0, np.int64))  # The last piece.
        self._signals = OnIntervals(), OnIntervals(), OnIntervals()
        self._stretches, self._labels, self._on = self._signals
        self._slips: list[tuple[dict[str, int], str]] = []  # As UNFOLLOWED.
        # The volts of the last slip, while its alarm may still rise; the chain's state before it.
        self._followed, self._before = list[Floats](), self._chain.state
        self._watch, self._wrong = Watch(replay.chain), dict[str, list[int]]()

    def add(self, piece: Samples) -> None:
        volts, truth = np.asarray(piece.volts, np.float64), np.asarray(piece.truth, np.bool_)
        n = len(volts)
        if piece.new_stretch and self._row:
            self._end_stretch()
            last_ns, first_ns = int(self._last.stamps_ns[-1]), int(piece.stamps_ns[0])
            missing = missing_rows(last_ns, first_ns, self._rate_hz)
            self._row += missing
            if self._observer and missing:
                self._observer.gap(missing / self._rate_hz)
            self._chain.restart()
        if piece.moving is not None:
            self._moving_rows = (self._moving_rows or 0) + int(np.count_nonzero(piece.moving))
        classes = row_classes(truth, piece.moving, piece.certain, piece.kind)
        # A block ends before each slip, so that the slip can be followed from there on.
        starts = np.flatnonzero(truth & ~np.concatenate([[self._labels.on], truth[:-1]]))
        block_rows = max(BLOCK_VALUES // self._config.channels, 1)
        seconds = range(0, n, self._config.samples(1.0))[:FIRST_LOOKS]
        cuts = {*range(0, n, block_rows), *seconds, *starts.tolist(), n}
        for a, b in itertools.pairwise(sorted(cuts)):
            self._block(volts[a:b], truth[a:b], classes[a:b])
        self._last = piece

    def _end_stretch(self) -> None:
        for intervals in self._signals:
            intervals.close(self._row)
        self._follow()

    def _block(self, volts: Floats, truth: Bools, classes: RowClasses) -> None:
        """Take rows with at most one slip, which is at their beginning."""
        row = self._row
        if truth[0] and not self._labels.on:
            self._follow()
            self._slips.append(UNFOLLOWED)
            self._followed = [] if self._on.on else [volts[:0]]
            self._before = self._chain.state.copy()
        drawn = self._observer is not None
        votes = (self._config.vote,)
        result = self._chain.update(volts, envelope=drawn, level=drawn, votes=votes)
        self._wrong.update(self._watch.look([(volts, result)]))
        on = np.ascontiguousarray(result.slip)
        self._stretches.add(np.ones_like(on), row)
        classes[: max(self._stretches.edges[-1] + self._unscored - row, 0)] = UNCERTAIN
        self._labels.add(truth, row)
        self._on.add(on, row)
        self._valid_rows += np.ones(len(on)) @ result.valid
        self._replay.tally.add(result.vote_statistic[:, 0], classes)
        if self._observer:
            self._observer.add(volts, result, truth)
        self._row += len(on)
        if self._followed:
            self._followed.append(volts)
            ended = not self._labels.on and self._row >= self._labels.edges[-1] + self._tail_rows
            if ended or on.any():
                self._follow()

    def _follow(self) -> None:
        """Run the last slip through the stages once more, up to the row in which its alarm rises.

        Filtered signal and envelope are compared with the threshold; where evidence decides, with
        the channel's noise floor plus ``evidence_offset_db``, above which evidence grows.
        """
        if not self._followed:
            return
        config, volts, self._followed = self._config, np.concatenate(self._followed), []
        if not self._labels.on:
            start, end = self._labels.edges[-2:]
            volts = volts[: end + self._tail_rows - start]
        chain, filters = self._replay.second, self._replay.filters
        chain.state = self._before
        filters.take_filters(chain)
        filtered = filters.update(volts, level=False).envelope
        evidence, least = config.decision == 'evidence', np.array(config.threshold)
        result = chain.update(volts, level=False, floor=evidence)
        if evidence:
            least = 10.0 ** ((result.floor + config.evidence_offset_db) / 20.0)
        rises, columns = np.flatnonzero(result.slip)[:1], np.arange(config.channels)
        if rises.size:  # From here on only the group that decides counts.
            deciding = int(result.groups[rises[0]].argmax())
            columns = np.array(list(config.groups.values())[deciding]) - 1
        passed = filtered > least, result.envelope > least, result.channels
        through = [(signal & result.valid)[:, columns].any(axis=1) for signal in passed]
        until = slice(int(rises[0]) + 1 if rises.size else None)
        signals = np.array([*through, result.slip])[:, until]
        reached = signals.any(axis=1)
        if not rises.size:
            self._slips[-1] = {}, STAGES[int(reached.argmin())]
            return
        # A later stage may be above the threshold before the one that feeds it, as the windows
        # still hold rows from before the slip. Then the earlier stage ends at the same row.
        firsts = np.where(reached, signals.argmax(axis=1), rises[0])
        ends = np.minimum.accumulate(firsts[::-1])[::-1]
        stages = dict(zip(STAGES, np.diff(ends, prepend=0).tolist(), strict=True))
        self._slips[-1] = stages, figures.ALREADY_ON

    def outcome(self) -> ReplayOutcome:
        self._end_stretch()
        stretches, labels, on = (signal.closed() for signal in self._signals)
        config, rate_hz, accuracy_s = self._replay.config, self._rate_hz, self._last.accuracy_s
        rows = ScoredRows(labels, stretches, self._settling, config, rate_hz, accuracy_s)
        alarms = rows.alarms(on)
        rises = [alarm.start for alarm in alarms]
        alarm_of, slip_of = rows.match(rises)
        rise_of = np.array([*rises, NONE])[alarm_of]
        late_rows = round((config.late_after_s + accuracy_s) * rate_hz)
        slips = []
        for s, (stages, lost_at) in enumerate(self._slips):
            found, settling = bool(alarm_of[s] != NONE), not rows.scored[s]
            latency = int(rise_of[s]) - labels[s].start
            # The rise that was followed may belong to an alarm that began before the slip.
            exact = found and sum(stages.values()) == latency and not accuracy_s
            parts = {stage: length / rate_hz for stage, length in stages.items()}
            slips.append(
                TrueSlip(
                    start_s=labels[s].start / rate_hz,
                    end_s=labels[s].end / rate_hz,
                    alarm=int(alarm_of[s]) if found else None,
                    latency_s=latency / rate_hz if found else None,
                    accuracy_s=accuracy_s,
                    settling=settling,
                    late=found and latency > late_rows,
                    stages_s=parts if exact else None,
                    lost_at=None if found or settling else lost_at,
                    on_at_start=(stages, lost_at) == UNFOLLOWED,
                )
            )
        # The last element stands for no slip, ``NONE``.
        settles = rows.settling(rises) | ~np.append(rows.scored, True)[slip_of]
        first = np.append(alarm_of, NONE)[slip_of] == np.arange(len(alarms))
        cases = {figures.SETTLING: settles, figures.FALSE: slip_of == NONE, figures.TRUE: first}
        kinds = np.select([*cases.values()], [*cases], figures.REPEAT).tolist()
        found_alarms = [
            Alarm(start / rate_hz, end / rate_hz, kind, None if s == NONE else s)
            for (start, end), kind, s in zip(alarms, kinds, slip_of.tolist(), strict=True)
        ]
        on_rows = (rows_on(on, *part).sum(keepdims=True) for part in (rows.certain, rows.rest))
        many_false = np.array([kinds.count(figures.FALSE)])
        invalid_rows = (_length(stretches) - self._valid_rows).astype(np.int64)
        invalid_rows[[channel - 1 for channel in self._config.disabled_channels]] = 0
        return ReplayOutcome(
            rows=_length(stretches),
            slip_rows=_length(labels),
            moving_rows=self._moving_rows,
            settling_rows=rows.settling_rows,
            sample_rate_hz=rate_hz,
            slips=tuple(slips),
            alarms=tuple(found_alarms),
            events=rows.events(self._last.kind, rise_of[:, np.newaxis], many_false, *on_rows),
            scores=self._replay.tally.collect(),
            on_s=tuple((start / rate_hz, end / rate_hz) for start, end in on),
            invalid_rows=tuple(invalid_rows.tolist()),
            wrong=self._wrong,
        )


def _length(intervals: Sequence[tuple[int, int]]) -> int:
    return sum(end - start for start, end in intervals)
