"""A chain whose parameters change while it runs."""

import dataclasses
import threading
from collections import deque
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.result import SlipResult
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig

#: Rows kept for a new chain to settle on. The slowest pole of the paper's filters falls to a
#: thousandth in two seconds.
HISTORY_S = 5.0

#: What the chain remembers of the rows so far does not depend on these: they change at once.
OF_THE_DECISION = (
    'channel_names',
    'valid_range_v',
    'flat_after_s',
    'max_gap_s',
    'threshold',
    'vote',
    'groups',
)

#: With these, the rows kept are no longer rows of this input.
OF_THE_INPUT = ('sample_rate_hz', 'channels')


class LiveChain:
    """A :class:`SlipChain` for a stream of rows, whose configuration can be replaced.

    Parameters of the decision alone (threshold, vote, groups, ...) are replaced at once, and the
    filters keep their state. For any other a new chain is built in a thread beside the running
    one and fed with the rows of the last ``HISTORY_S``. :meth:`swap` puts it in the place of the
    running one, between two rows: it decides as if it had run for that long. Where the rate or
    the number of channels changes, it starts without any rows.

    Parameters
    ----------
    config
        To begin with.
    on_built
        Called, in the thread that built it, when a chain waits for :meth:`swap`.

    Examples
    --------
    >>> chain = LiveChain(ChainConfig(channels=2), on_built=lambda: None)
    >>> chain.change(ChainConfig(channels=2, threshold=0.1))
    True
    >>> chain.update(np.zeros((5, 2)), level=False).slip.shape
    (5,)
    """

    def __init__(self, config: ChainConfig, on_built: Callable[[], None]) -> None:
        self.config = config
        self._chain = SlipChain(config)
        self._on_built = on_built
        self._history: deque[NDArray[np.float64]] = deque()
        self._kept_rows = config.samples(HISTORY_S)
        self._rows_in_history = 0
        # Since the last reset.
        self._rows_seen = 0
        self._resets = 0
        # The last of these is the one wanted; what others build is thrown away.
        self._orders = 0
        self._built: tuple[int, SlipChain, int, int] | None = None

    def update(self, rows: NDArray[np.float64], *, level: bool) -> SlipResult:
        """Take the next rows, shape (n, c), and decide on each."""
        self._history.append(rows)
        self._rows_seen += len(rows)
        self._rows_in_history += len(rows)
        while self._rows_in_history - len(self._history[0]) >= self._kept_rows:
            self._rows_in_history -= len(self._history.popleft())
        return self._chain.update(rows, envelope=False, level=level)

    def reset(self) -> None:
        """Forget all rows: the next row is the first."""
        self._chain.reset()
        self._forget()

    def change(self, config: ChainConfig) -> bool:
        """Replace the configuration; return whether it holds from the next row on.

        Else a chain is being built, and :meth:`swap` is to be called when it is.
        """
        differ = {
            field.name
            for field in dataclasses.fields(ChainConfig)
            if getattr(config, field.name) != getattr(self.config, field.name)
        }
        self._orders += 1
        self._built = None
        if differ <= set(OF_THE_DECISION):
            if differ:
                chain = SlipChain(config)
                chain.state = self._chain.state
                self._chain = chain
            self.config = config
            return True
        settle_on = [] if differ & set(OF_THE_INPUT) else list(self._history)
        threading.Thread(
            target=self._build,
            args=(self._orders, config, settle_on, self._rows_seen, self._resets),
            daemon=True,
        ).start()
        return False

    def swap(self) -> bool:
        """Put the chain that was built last in the place of the running one.

        Returns
        -------
        bool
            False when there is none, or another has been ordered since.
        """
        if self._built is None or self._built[0] != self._orders:
            return False
        _, chain, seen, resets = self._built
        self._built = None
        config = chain.config
        same_input = all(getattr(config, n) == getattr(self.config, n) for n in OF_THE_INPUT)
        if not same_input:
            self._forget()
        elif resets != self._resets:
            chain.reset()
            seen = 0
        if self._rows_seen > seen:
            # The rows that came while it was built.
            behind = np.concatenate(list(self._history))[seen - self._rows_seen :]
            chain.update(behind, envelope=False, level=False)
        self._chain, self.config = chain, config
        self._kept_rows = config.samples(HISTORY_S)
        return True

    def _build(
        self,
        order: int,
        config: ChainConfig,
        settle_on: list[NDArray[np.float64]],
        seen: int,
        resets: int,
    ) -> None:
        chain = SlipChain(config)
        if settle_on:
            chain.update(np.concatenate(settle_on), envelope=False, level=False)
        if order == self._orders:
            self._built = (order, chain, seen, resets)
            self._on_built()

    def _forget(self) -> None:
        self._history.clear()
        self._rows_in_history = self._rows_seen = 0
        self._resets += 1
