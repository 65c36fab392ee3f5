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

"""A chain whose parameters change while it runs."""

import dataclasses
import threading
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.filters import evidence_falls_s, settling_rows
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.parameters.detector import ChainConfig, DetectorConfig
from slip_detector.parameters.fields import names_that_affect

#: Time for which rows are kept; a new chain starts with them. The slowest response of the paper's
#: filters falls to a thousandth in two seconds.
HISTORY_S = 5.0

#: Parameters that can change at once, as the state of the chain does not depend on them.
DECISION_PARAMETERS = names_that_affect(ChainConfig, 'decision')

#: Unless these parameters change, the new chain takes over the noise floors, which the rows of
#: :data:`HISTORY_S` would determine less well.
FILTER_PARAMETERS = names_that_affect(ChainConfig, 'filters')

#: One chain is built for all changes within this time after the first.
GATHER_S = 0.1

#: Parameters after whose change the kept rows cannot be used; some are the detector's: another
#: field of a message is another signal.
INPUT_PARAMETERS = names_that_affect(DetectorConfig, 'input')


class Replacement(NamedTuple):
    """A chain that is ready to replace the running one.

    Attributes
    ----------
    chain : SlipChain or None
        None if only parameters changed that belong to the node and not to the chain.
    config : ChainConfig
        The whole configuration.
    settled : tuple of int or None
        The numbers of rows and of resets when the chain got the kept rows; None if it takes over
        the state of the running one.
    settling : int
        Number of rows whose decisions may still be an effect of the change.

    Examples
    --------
    >>> config = ChainConfig(threshold=0.7)
    >>> Replacement(SlipChain(config), config).settling
    0
    """

    chain: SlipChain | None
    config: ChainConfig
    settled: tuple[int, int] | None = None
    settling: int = 0


class LiveChain:
    """A :class:`SlipChain` for a stream of rows, whose configuration can be replaced.

    Rows may come in one thread while another changes the configuration: no row waits for the
    design of filters or for a new chain. :meth:`change` orders a chain, and :meth:`swap` replaces
    the running one by it, between two rows.

    When only parameters of the decision change (threshold, vote, groups, ..., and those of floors,
    evidence and impacts), the new chain is ready at once and takes over the state of the running
    one. Otherwise a separate thread waits ``GATHER_S`` for further changes, builds the chain and
    gives it the rows of the last ``HISTORY_S``: it decides as if it had run for that long. When
    the rate, the number of channels or the input changes, it starts without any rows.

    Parameters
    ----------
    config
        The first configuration.
    on_built
        Called when a chain has been built and waits for :meth:`swap`, in the thread that built it.

    Attributes
    ----------
    unsettled_rows : int
        In this many of the next rows slip may come ON because the configuration changed, and not
        because slip begins.

    Examples
    --------
    >>> chain = LiveChain(ChainConfig(channels=2), on_built=lambda: None)
    >>> chain.change(ChainConfig(channels=2, threshold=0.1)) and chain.swap()
    True
    >>> chain.update(np.zeros((5, 2)), level=False).slip.shape
    (5,)
    """

    def __init__(self, config: ChainConfig, on_built: Callable[[], None]) -> None:
        self.config = config
        self.unsettled_rows = 0
        self._chain = SlipChain(config)
        self._on_built = on_built
        # Rows wait for this lock: nothing may hold it for longer than a row takes.
        self._lock = threading.Lock()
        self._history: deque[NDArray[np.float64]] = deque()
        self._kept_rows = config.samples(HISTORY_S)
        self._rows_in_history = 0
        self._rows_seen = 0  # since the last reset
        self._resets = 0
        # The configuration to build a chain for, and whether a thread waits to build it.
        self._ordered: ChainConfig | None = None
        self._gathering = False
        self._replacement: Replacement | None = None

    def update(self, rows: NDArray[np.float64], *, level: bool) -> SlipResult:
        """Process the next rows, shape (n, c), and decide on each."""
        with self._lock:
            self._history.append(rows)
            self._rows_seen += len(rows)
            self.unsettled_rows = max(self.unsettled_rows - len(rows), 0)
            self._rows_in_history += len(rows)
            while self._rows_in_history - len(self._history[0]) >= self._kept_rows:
                self._rows_in_history -= len(self._history.popleft())
            return self._chain.update(rows, envelope=False, level=level)

    def reset(self) -> None:
        """Forget all rows; the next row is treated as the first."""
        with self._lock:
            self._chain.reset()
            self.unsettled_rows = 0
            self._forget()

    def restart(self) -> None:
        """Begin again after a gap: forget all rows, but keep the noise floors."""
        with self._lock:
            self._chain.restart()
            self._forget()

    def change(self, config: ChainConfig) -> bool:
        """Order another configuration; return whether :meth:`swap` may be called for it at once.

        If not, a chain is built first, and then ``on_built`` is called. An order replaces an
        earlier one that has not been swapped in yet.
        """
        with self._lock:
            differ = self._differ(config)
            decision_only = differ <= DECISION_PARAMETERS
            self._replacement = None
            if decision_only:
                chain = SlipChain(config) if differ else None
                self._replacement = Replacement(chain, config, settling=_responds_rows(config))
            self._ordered = None if decision_only else config
            gather = not decision_only and not self._gathering
            self._gathering |= gather
        if gather:
            timer = threading.Timer(GATHER_S, self._build)
            timer.daemon = True
            timer.start()
        return decision_only

    def swap(self) -> bool:
        """Replace the running chain by the one that was ordered last.

        Returns
        -------
        bool
            False if no chain is ready or the last one has been swapped in already.
        """
        with self._lock:
            if self._replacement is None:
                return False
            (chain, config, settled, settling), self._replacement = self._replacement, None
            if settled is not None:
                assert chain is not None
                self._catch_up(chain, *settled)
                self._keep_floors(chain)
                settling = max(settling - self._rows_in_history, _responds_rows(config))
            elif chain is not None:
                chain.state = self._chain.state
            if chain is not None:
                self._chain = chain
                self.unsettled_rows = max(self.unsettled_rows, settling)
            self.config = config
            self._kept_rows = config.samples(HISTORY_S)
            return True

    def _differ(self, config: ChainConfig) -> set[str]:
        """Return the parameters of the chain and its input that differ from the running ones."""
        names = {field.name for field in dataclasses.fields(ChainConfig)} | INPUT_PARAMETERS
        return {
            name
            for name in names
            if getattr(config, name, None) != getattr(self.config, name, None)
        }

    def _build(self) -> None:
        """Build the ordered chain; call ``on_built`` unless another was ordered meanwhile."""
        with self._lock:
            self._gathering = False
            config = self._ordered
            if config is None:
                return
            same_input = not self._differ(config) & INPUT_PARAMETERS
            settle_on = list(self._history) if same_input else []
            seen, resets = self._rows_seen, self._resets
        chain = SlipChain(config)
        settling = min(settling_rows(config), config.samples(HISTORY_S))
        if settle_on:
            chain.update(np.concatenate(settle_on), envelope=False, level=False)
        with self._lock:
            if config is not self._ordered:
                return
            self._ordered = None
            self._replacement = Replacement(chain, config, (seen, resets), settling)
        self._on_built()

    def _catch_up(self, chain: SlipChain, seen: int, resets: int) -> None:
        """Give a new chain the rows that have come since it was built."""
        if self._differ(chain.config) & INPUT_PARAMETERS:
            self._forget()
        elif resets != self._resets:
            chain.reset()
            seen = 0
        if self._rows_seen > seen:
            behind = np.concatenate(list(self._history))[seen - self._rows_seen :]
            chain.update(behind, envelope=False, level=False)

    def _keep_floors(self, chain: SlipChain) -> None:
        """Give a new chain the noise floors of the running one if they are comparable."""
        evidence = chain.config.decision == self.config.decision == 'evidence'
        if evidence and not self._differ(chain.config) & (FILTER_PARAMETERS | INPUT_PARAMETERS):
            chain.take_floors(self._chain)

    def _forget(self) -> None:
        self._history.clear()
        self._rows_in_history = self._rows_seen = 0
        self._resets += 1


def _responds_rows(config: ChainConfig) -> int:
    """Return the least number of rows after which a change of the decision has taken effect."""
    return config.samples(evidence_falls_s(config)) if config.decision == 'evidence' else 1
