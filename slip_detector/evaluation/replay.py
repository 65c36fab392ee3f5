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
from slip_detector.evaluation.figures import ALREADY_ON, STAGES, ReplayOutcome, TrueSlip
from slip_detector.evaluation.matching import OnIntervals, ScoredRows, unscored_rows
from slip_detector.evaluation.scores import UNCERTAIN, RowClasses, ScoreTally, row_classes
from slip_detector.parameters import ChainConfig, EvaluationConfig

#: Number of values that the chain is given at a time, so that its results stay in the cache.
BLOCK_VALUES = 131072

#: The chain is looked at (:mod:`.watch`) after each of these blocks, and after each of so many
#: seconds at the beginning of a piece, which may be all there is.
FIRST_LOOKS = 10

#: How many rows the latency of a slip spends in each stage, and where it is lost if it is missed.
PassedStages = tuple[dict[str, int], str]

#: Those of a slip that is not followed, as the decision is ON when it begins.
UNFOLLOWED: PassedStages = {}, ALREADY_ON


def only_filters(config: ChainConfig) -> ChainConfig:
    """Return the configuration of a chain whose envelope is the filtered signal of another.

    Its windows have one sample, so the signal is only rectified and raised to the exponent.
    """
    one_s = 1.0 / config.sample_rate_hz
    return dataclasses.replace(
        config, envelope_window_s=one_s, decision_window_s=one_s, decision='mean'
    )


class _Stages:
    """Runs slips through a chain once more, to find what their latency is spent in."""

    def __init__(self, config: ChainConfig) -> None:
        self._config, self._chain = config, SlipChain(config)
        self._filters = SlipChain(only_filters(config))

    def passed(self, before: Floats, volts: Floats) -> PassedStages:
        """Follow a slip from a chain's state before it, up to the row in which its alarm rises.

        Filtered signal and envelope are compared with the threshold; where evidence decides, with
        the channel's noise floor plus ``evidence_offset_db``, above which evidence grows.
        """
        config, chain, filters = self._config, self._chain, self._filters
        chain.state = before
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
            return {}, STAGES[int(reached.argmin())]
        # A later stage may be above the threshold before the one that feeds it, as the windows
        # still hold rows from before the slip. Then the earlier stage ends at the same row.
        firsts = np.where(reached, signals.argmax(axis=1), rises[0])
        ends = np.minimum.accumulate(firsts[::-1])[::-1]
        return dict(zip(STAGES, np.diff(ends, prepend=0).tolist(), strict=True)), ALREADY_ON


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
        self.chain, self.stages = SlipChain(chain_config), _Stages(chain_config)

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
        self._slips: list[PassedStages] = []
        # The volts of the last slip, while its alarm may still rise; the chain's state before it.
        self._followed: list[Floats] | None = None
        self._before = self._chain.state
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
        self._end_slip()

    def _block(self, volts: Floats, truth: Bools, classes: RowClasses) -> None:
        """Take rows with at most one slip, which is at their beginning."""
        row = self._row
        if truth[0] and not self._labels.on:
            self._end_slip()
            self._slips.append(UNFOLLOWED)
            self._followed = None if self._on.on else []
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
        if self._followed is not None:
            self._followed.append(volts)
            ended = not self._labels.on and self._row >= self._labels.edges[-1] + self._tail_rows
            if ended or on.any():
                self._end_slip()

    def _end_slip(self) -> None:
        """Find the stages of the last slip, if it is still followed."""
        if self._followed is None:
            return
        volts, self._followed = np.concatenate(self._followed), None
        if not self._labels.on:
            start, end = self._labels.edges[-2:]
            volts = volts[: end + self._tail_rows - start]
        self._slips[-1] = self._replay.stages.passed(self._before, volts)

    def outcome(self) -> ReplayOutcome:
        self._end_stretch()
        stretches, labels, on = (signal.closed() for signal in self._signals)
        config, rate_hz, accuracy_s = self._replay.config, self._rate_hz, self._last.accuracy_s
        known = rate_hz, accuracy_s, self._last.kind
        rows = ScoredRows(labels, stretches, self._settling, config, *known)
        alarms, alarm_of, events = rows.match_decision(on)
        late_rows = round((config.late_after_s + accuracy_s) * rate_hz)
        slips = []
        for s, (label, (stages, lost_at)) in enumerate(zip(labels, self._slips, strict=True)):
            found, settling = s in alarm_of, not rows.scored[s]
            start = round(alarms[alarm_of[s]].start_s * rate_hz) if found else label.start
            latency = start - label.start
            # The rise that was followed may belong to an alarm that began before the slip.
            exact = found and sum(stages.values()) == latency and not accuracy_s
            parts = {stage: length / rate_hz for stage, length in stages.items()}
            slips.append(
                TrueSlip(
                    start_s=label.start / rate_hz,
                    end_s=label.end / rate_hz,
                    alarm=alarm_of.get(s),
                    latency_s=latency / rate_hz if found else None,
                    accuracy_s=accuracy_s,
                    settling=settling,
                    late=latency > late_rows,
                    stages_s=parts if exact else None,
                    lost_at=None if found or settling else lost_at,
                    on_at_start=(stages, lost_at) == UNFOLLOWED,
                )
            )
        invalid_rows = (_length(stretches) - self._valid_rows).astype(np.int64)
        invalid_rows[[channel - 1 for channel in self._config.disabled_channels]] = 0
        return ReplayOutcome(
            rows=_length(stretches),
            slip_rows=_length(labels),
            moving_rows=self._moving_rows,
            settling_rows=rows.settling_rows,
            sample_rate_hz=rate_hz,
            slips=tuple(slips),
            alarms=tuple(alarms),
            events=events,
            scores=self._replay.tally.collect(),
            on_s=tuple((start / rate_hz, end / rate_hz) for start, end in on),
            invalid_rows=tuple(invalid_rows.tolist()),
            wrong=self._wrong,
        )


def _length(intervals: Sequence[tuple[int, int]]) -> int:
    return sum(end - start for start, end in intervals)
