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

"""Finds decisions that mean nothing, as the chain's parameters do not fit the sensor.

A chain is looked at once a second or more rarely, after its rows, so that the rows cost nothing
more.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from slip_detector.chain.layout import CONTACT_ROWS
from slip_detector.chain.samples import Bools, Floats
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.parameters.fields import name_list

#: What a look finds: the channels, counted from 0, by the name of a fault.
Found = Mapping[str, Sequence[int]]

#: By the name of a fault, the time in seconds from which on it counts, and what to say of it.
FAULTS = {
    'upper': (3.0, 'noise floor of {} at its upper limit, noise_floor_range_db above noise_floor: '
     'it cannot reach the level at rest; learn noise_floor with slip_tune --quiet REST'),
    'lower': (10.0, 'noise floor of {} at its lower limit, with the level far below, so that slip '
     'may be missed: learn noise_floor with slip_tune --quiet REST'),
    'slip': (60.0, 'slip ON for a minute without a pause: if nothing slides, raise threshold, or '
     'learn it with slip_tune --quiet REST --false-alarms-per-hour'),
    'channels': (60.0, '{} ON for a minute without a pause: if nothing slides there, raise '
     'threshold, or leave them out with disabled_channels'),
    'cut off': (3.0, '{} cut off, again and again at the same extreme value: lower the force, or '
     'the gain of the sensor'),
}  # fmt: skip

#: How far the levels of all channels are below the lower limits of their noise floors where slip
#: may be missed. Levels at rest are about at a learnt floor. A level with a window of one sample
#: is now and then almost as far below.
FAR_DB = 26.0

#: A channel is cut off if, look after look, a second of it has at least ``VALUES`` different
#: values, at least ``SHARE`` of its samples at the same extreme value, ``CROWD`` times as many as
#: at the next value, and reaches the extreme ``OFTEN`` times by a step of at least ``STEP`` times
#: its range. Noise has few samples at its extreme, a signal that rests at its extreme reaches it
#: rarely, and one that wavers between a few values of a converter has few values.
VALUES, SHARE, CROWD, OFTEN, STEP = 16, 0.01, 2, 3, 0.05

#: Most names that are listed.
LISTED = 8


def words_of(found: Found, names: Sequence[str]) -> list[str]:
    """Return what to say of each fault that was found, with the names of its channels.

    Examples
    --------
    >>> words_of({'cut off': [0, 2]}, ['ch1', 'ch2', 'ch3'])[0][:38]
    'ch1, ch3 cut off, again and again at t'
    """
    return [
        FAULTS[fault][1].format(name_list([names[c] for c in channels], LISTED))
        for fault, channels in found.items()
    ]


class Watch:
    """Looks at one chain from time to time.

    Parameters
    ----------
    chain
        The chain; it is only read.

    Examples
    --------
    >>> from slip_detector import ChainConfig
    >>> parameters = {'decision': 'evidence', 'noise_floor': 1e-9, 'gain': 1.0, 'exponent': 1}
    >>> chain = SlipChain(ChainConfig(channels=2, **parameters))
    >>> watch, noise = Watch(chain), np.random.default_rng(0).normal(size=(380, 2))
    >>> for second in range(5):
    ...     found = watch.look([(noise, chain.update(noise))])
    >>> found
    {'upper': [0, 1]}
    """

    def __init__(self, chain: SlipChain) -> None:
        self._chain = chain
        # By fault, its value for each channel at the last look, NaN without the fault, and for how
        # many rows it has had that value.
        self._last: dict[str, tuple[Any, Any]] = dict.fromkeys(FAULTS, (np.nan, 0))

    def look(self, pieces: Collection[tuple[Floats, SlipResult]]) -> dict[str, list[int]]:
        """Return the channels with each fault that has lasted.

        Parameters
        ----------
        pieces
            The rows since the last look, in pieces of at least one row, with their results.
        """
        if not pieces:
            return {}
        config, (*_, (_, last)), found = self._chain.config, pieces, {}
        n, second = sum(len(rows) for rows, _ in pieces), config.samples(1.0)
        rows = np.concatenate([rows[-second:] for rows, _ in pieces])[-second:]
        rows[:, [channel - 1 for channel in config.disabled_channels]] = 0.0
        on, slip = last.channels[-1], last.slip[-1:]
        if on.any():  # Rare. A look at all rows takes a tenth of the time of the chain.
            on = np.all([each.channels.all(axis=0) for _, each in pieces], axis=0)
            slip = np.array([all(each.slip.all() for _, each in pieces)])
        faulty = {**self._faulty_floors(last.valid[-1]), 'slip': slip, 'channels': on & ~slip}
        values = {fault: np.where(where, 1.0, np.nan) for fault, where in faulty.items()}
        for fault, value in {**values, 'cut off': _cut_off_at(rows)}.items():
            before, count = self._last[fault]
            count = np.where(value == before, count + n, 0)
            self._last[fault] = value, count
            if channels := np.flatnonzero(count >= config.samples(FAULTS[fault][0])).tolist():
                found[fault] = channels
        return found

    def _faulty_floors(self, valid: Bools) -> dict[str, Bools]:
        """Return which valid channels have a floor that is too low, or far too high."""
        config, state = self._chain.config, self._chain.state
        contact = not config.contact_level_v or state[0, CONTACT_ROWS, 0] > 0
        if config.decision != 'evidence' or not contact:  # Out of contact floors rest.
            return {}
        floor_db, level_db = self._chain.floor_and_level_db()
        least_db, range_db = 20.0 * np.log10(config.noise_floor), config.noise_floor_range_db
        far_below = np.all((level_db < least_db - FAR_DB) | ~valid)
        too_low = (floor_db >= least_db + range_db) & (range_db > 0.0)
        return {'upper': valid & too_low, 'lower': valid & far_below}


def _cut_off_at(rows: Floats) -> Floats:
    """Return the extreme value at which a channel is cut off, NaN where it is not; shape (c,)."""
    ends = np.full(rows.shape[1], np.nan)
    for sign in (1.0, -1.0):
        signed = sign * rows
        # Most channels are at their extreme once.
        often = (signed == np.fmax.reduce(signed)).sum(axis=0) >= max(SHARE * len(rows), OFTEN)
        for c in np.flatnonzero(often):
            numbers = signed[np.isfinite(signed[:, c]), c]
            values, counts = np.unique(numbers, return_counts=True)
            steps = np.diff(numbers)[numbers[1:] == values[-1:]]
            large = np.count_nonzero(steps >= STEP * np.ptp(values))
            if len(values) >= VALUES and counts[-1] >= CROWD * counts[-2] and large >= OFTEN:
                ends[c] = sign * values[-1]
    return ends
