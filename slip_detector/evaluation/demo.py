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

"""The figures of merit of a trial, of the messages that a program has received from the nodes."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.samples import Bools, Floats
from slip_detector.evaluation import figures
from slip_detector.parameters import ChainConfig

#: Latency that more than one in a hundred samples has only where a node was held up.
HELD_UP_MS = 50.0


class Heard(NamedTuple):
    """The messages of a trial.

    Attributes
    ----------
    stamps_s, volts : ndarray
        Times since the first sample, and volts, of the samples.
    position_stamps_s, positions_m : ndarray
        Times and positions of the plate.
    latencies_s : ndarray
        Time from the stamp of each sample to the receipt of its decision.
    changes : mapping
        For each topic of a decision the times at which the state changed, and the new states.
    """

    stamps_s: Floats
    volts: Floats
    position_stamps_s: Floats
    positions_m: Floats
    latencies_s: Floats
    changes: Mapping[str, tuple[Floats, Bools]]

    @property
    def motion_s(self) -> tuple[float, float] | None:
        """When the plate started and stopped (Eq. 9); None if it did not move."""
        moved = np.flatnonzero(np.diff(self.positions_m))
        if not moved.size:
            return None
        return self.position_stamps_s[moved[0]], self.position_stamps_s[moved[-1] + 1]


def states_at(changed_at: NDArray[Any], states: Bools, at: NDArray[Any]) -> Bools:
    """Return the state at each time ``at``: that of the last change before; at first False.

    Examples
    --------
    >>> states_at(np.array([10, 20]), np.array([True, False]), np.array([5, 10, 19, 20]))
    array([False,  True,  True, False])
    """
    from_none_on = np.concatenate([[False], states])
    return np.asarray(from_none_on[np.searchsorted(changed_at, at, side='right')])


def demo_figures(heard: Heard, config: ChainConfig) -> dict[str, Any]:
    """Compute the paper's figures of merit from the received messages.

    A delay begins at the stamp of the last sample at which the plate still stood (Eq. 9) and ends
    at the receipt of the first ON after it, as a grasp controller would see it. It is None if
    there is no such ON, or nothing moves.
    """
    times_s, moves = heard.stamps_s, heard.motion_s
    start_s, end_s = moves or (np.inf, np.inf)

    def delay_ms(topic: str) -> float | None:
        at_s, states = heard.changes[topic]
        on_s = at_s[states & (at_s >= start_s)]
        return (float(on_s[0]) - start_s) * 1e3 if on_s.size else None

    slip = states_at(*heard.changes['slip'], times_s)
    rest = (times_s < start_s) | (times_s > end_s)
    channels = {name: delay_ms(f'slip/channel/{name}') for name in config.names}
    mean, sd = figures.mean_and_sd(channels.values())
    median, p99 = np.percentile(heard.latencies_s, [50, 99]) * 1e3
    return {
        'motion': {'start_s': start_s, 'end_s': end_s} if moves else None,
        'channel_delay_ms': channels,
        'mean_delay_ms': mean,
        'sd_delay_ms': sd,
        'group_delay_ms': {name: delay_ms(f'slip/group/{name}') for name in config.groups},
        'global_delay_ms': delay_ms('slip'),
        'false_positive_percent': figures.percent(int((slip & rest).sum()), int(rest.sum())),
        'latency_ms': {'median': median, 'p99': p99},
    }


def demo_words(result: Mapping[str, Any]) -> str:
    """Return in a line what happened in a trial with these figures of :func:`demo_figures`.

    Examples
    --------
    >>> result = {'motion': None, 'global_delay_ms': None, 'false_positive_percent': 0.0}
    >>> demo_words({**result, 'latency_ms': {'median': 0.4, 'p99': 1.8}})
    'Nothing slid. Slip was ON for 0.0 % of the time at rest. Decisions took 0.4 ms.'
    """
    slip_ms, (median_ms, p99_ms) = result['global_delay_ms'], result['latency_ms'].values()
    seen = 'The plate slid, and slip was not seen' if result['motion'] else 'Nothing slid'
    if slip_ms is not None:
        seen = f'Slip was seen {slip_ms:.0f} ms after the plate began to slide'
    rest = f'Slip was ON for {result["false_positive_percent"]:.1f} % of the time at rest'
    took = f'Decisions took {median_ms:.1f} ms'
    if p99_ms > HELD_UP_MS:
        took += f', one in a hundred {p99_ms:.0f} ms: other work on this machine held up the nodes'
    return f'{seen}. {rest}. {took}.'
