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

"""A chain whose parameters change while it runs, and a watch over its decisions.

The watch finds decisions that mean nothing, as the parameters do not fit the sensor. It looks at
the chain once a second or more rarely, after its rows, so that the rows cost nothing more.
"""

import threading
from collections import deque
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.filters import evidence_falls_s, settling_rows
from slip_detector.chain.layout import CONTACT_ROWS, FLOOR, HOLD_ROWS
from slip_detector.chain.samples import Bools, Floats
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.parameters import ChainConfig, DetectorConfig, name_list, names_that_affect

#: Time for which rows are kept, with which a new chain starts. The slowest response of the paper's
#: filters falls to a thousandth in two seconds. During slip as many rows at rest are kept, too.
HISTORY_S = 5.0

#: Most pieces of rows that are kept for the next look.
MOST_UNSEEN = 10_000

#: Parameters that can change at once, as the state of the chain does not depend on them.
DECISION_PARAMETERS = names_that_affect(ChainConfig, 'decision')

#: Properties on which the layout of the state depends. A decision that changes one of them needs a
#: new chain.
LAYOUT_PROPERTIES = {'low_band_hz', 'impact_rows'}

#: Parameters after whose change the kept rows cannot be used. Some belong to the detector: another
#: field of a message is another signal.
INPUT_PARAMETERS = names_that_affect(DetectorConfig, 'input')

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
        # Out of contact floors rest.
        if config.decision != 'evidence' or not contact or not config.floors:
            return {}
        floor_db, level_db = self._chain.floor_and_level_db()
        least_db, range_db = 20.0 * np.log10(config.floors), config.noise_floor_range_db
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


class LiveChain:
    """A :class:`SlipChain` for a stream of rows, whose configuration can be replaced.

    Rows may come in one thread while another thread changes the configuration: no row waits for
    the design of filters or for a new chain. :meth:`change` orders a chain, and :meth:`swap` puts
    it in place of the running chain, between two rows.

    When only parameters of the decision change (threshold, vote, groups, ..., and those of floors,
    evidence, contact and impacts), the new chain is ready at once and takes over the state of the
    running one, unless it needs other state than that has. Otherwise a separate thread builds the
    chain, and it gets the rows of the last ``HISTORY_S``: it decides as if it had run for that
    long, with noise floors that follow from the running chain's. When the rate, the number of
    channels or the input changes, it starts without any rows.

    Parameters
    ----------
    config
        The first configuration.

    Attributes
    ----------
    unsettled_rows : int
        Number of the next rows in which slip may come ON because the configuration changed.

    Examples
    --------
    >>> chain = LiveChain(DetectorConfig(channels=2))
    >>> chain.change(DetectorConfig(channels=2, threshold=0.1)) and chain.swap()
    True
    >>> chain.update(np.zeros((5, 2)), level=False).slip.shape
    (5,)
    """

    def __init__(self, config: DetectorConfig) -> None:
        self.config = config
        self.unsettled_rows = 0
        self._chain = SlipChain(config)
        self._watch = Watch(self._chain)
        # The rows since the last look, with their results.
        self._unseen: deque[tuple[NDArray[np.float64], SlipResult]] = deque(maxlen=MOST_UNSEEN)
        # Rows wait for this lock: nothing may hold it for long.
        self._lock = threading.Lock()
        self._history: deque[NDArray[np.float64]] = deque()
        self._rows_in_history = 0
        self._kept_rows = config.samples(HISTORY_S)
        # The history when slip last came ON, if there was no slip in it, and the rows since slip.
        self._rest: list[NDArray[np.float64]] = []
        self._rows_at_rest = 0
        # The chain that is to be built next; whether the one that is being built is wanted.
        self._ordered: DetectorConfig | None = None
        self._wanted, self._building = False, threading.Lock()
        # A configuration that can be taken, with a new chain if it is for the chain, and the rows
        # in which that settles.
        self._ready: tuple[DetectorConfig, SlipChain | None, int] | None = None

    def update(self, rows: NDArray[np.float64], *, level: bool) -> SlipResult:
        """Process the next rows, shape (n, c), and decide on each."""
        with self._lock:
            self._history.append(rows)
            self.unsettled_rows = max(self.unsettled_rows - len(rows), 0)
            self._rows_in_history += len(rows)
            while self._rows_in_history - len(self._history[0]) >= self._kept_rows:
                self._rows_in_history -= len(self._history.popleft())
            result = self._chain.update(rows, envelope=False, level=level)
            self._unseen.append((rows, result))
            if 1 not in result.slip.tobytes():  # Faster than NumPy.
                self._rows_at_rest += len(rows)
            elif self._rows_at_rest:
                if self._rows_at_rest >= self._rows_in_history - len(rows):
                    self._rest = list(self._history)
                self._rows_at_rest = 0
            return result

    def look(self) -> Found:
        """Return why decisions may mean nothing, see :class:`.Watch`."""
        with self._lock:
            found = self._watch.look(self._unseen)
            self._unseen.clear()
            return found

    def reset(self) -> None:
        """Forget all rows; the next row is treated as the first."""
        with self._lock:
            for chain in (self._chain, self._ready and self._ready[1]):
                if chain:
                    chain.reset()
            self.unsettled_rows = 0
            self._forget()

    def restart(self) -> None:
        """Begin again after a gap: forget all rows, but keep the noise floors."""
        with self._lock:
            self._chain.restart()
            self._history.clear()
            self._rows_in_history, self._rows_at_rest = 0, -1  # A slip may go on.

    def change(self, config: DetectorConfig) -> bool:
        """Order another configuration; return whether :meth:`swap` may be called for it at once.

        If not, a chain is built first. An order replaces an earlier one for which that has not
        begun yet; what is built already is swapped in until then. If it can be swapped in at once,
        it replaces all earlier ones.
        """
        with self._lock:
            differ = self._differ(config)
            if differ <= DECISION_PARAMETERS:
                self._ready = config, SlipChain(config) if differ else None, 0
                self._ordered, self._wanted = None, False
                return True
            self._ordered = config
        threading.Thread(target=self._build, args=[config], daemon=True).start()
        return False

    def swap(self) -> bool:
        """Replace the running chain by the one that became ready last.

        Returns
        -------
        bool
            False if no chain is ready that has not been swapped in already.
        """
        with self._lock:
            if self._ready is None:
                return False
            (config, chain, settling), self._ready = self._ready, None
            differ = self._differ(config)
            self.config, self._kept_rows = config, config.samples(HISTORY_S)
            if chain is None:
                return True
            if differ <= DECISION_PARAMETERS:
                chain.state = self._chain.state
                # A hold time that is left would go on when its stage is switched on again.
                if not config.impact_v:
                    chain.state[0, HOLD_ROWS, 0] = 0.0
                if not config.contact_level_v:
                    chain.state[0, CONTACT_ROWS, 0] = 0.0
            else:
                if differ & INPUT_PARAMETERS:
                    self._forget()
                elif self._history:
                    floors = chain.state[:, FLOOR].copy()
                    rows = np.concatenate(list(self._history))
                    chain.update(rows, envelope=False, level=False)
                    # The floors are those after the last of these rows.
                    np.copyto(chain.state[:, FLOOR], floors, where=~np.isnan(floors))
                settling -= self._rows_in_history
            self._chain, self._watch = chain, Watch(chain)
            self._unseen.clear()
            responds = evidence_falls_s(config) if config.decision == 'evidence' else 0.0
            settling = max(settling, config.samples(responds))
            self.unsettled_rows = max(self.unsettled_rows, settling)
            return True

    def _differ(self, config: DetectorConfig) -> set[str]:
        """Return the parameters of the chain and its input that differ from the running ones."""
        names = INPUT_PARAMETERS | LAYOUT_PROPERTIES | {*ChainConfig.__dataclass_fields__}
        old = self.config
        return {name for name in names if getattr(old, name, None) != getattr(config, name, None)}

    def _build(self, config: DetectorConfig) -> None:
        """Build a chain, unless another was ordered meanwhile."""
        with self._building:
            with self._lock:
                if self._ordered is not config:
                    return
                self._ordered, self._wanted = None, True
            chain = SlipChain(config)
            settling = min(settling_rows(config), config.samples(HISTORY_S))
            with self._lock:
                slipped = self._rows_at_rest < self._rows_in_history
                rest = (slipped and self._rest) or list(self._history)
                other_input = self._differ(config) & INPUT_PARAMETERS
            if config.decision == 'evidence' and rest and not other_input:
                chain.take_floors(self._chain, np.concatenate(rest))
            with self._lock:
                if self._wanted:
                    self._ready = config, chain, settling

    def _forget(self) -> None:
        self._history.clear()
        self._rest, self._rows_at_rest, self._rows_in_history = [], 0, 0
