"""What the chain decides on rows, and what it decides by."""

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


class SlipResult:
    """Decisions on the rows of one call: ``n`` rows of ``c`` channels in ``g`` groups.

    Attributes
    ----------
    flags : ndarray of bool, shape (n, 1 + 2 g + 2 c)
        All decisions side by side: equal rows are equal decisions.
    """

    __slots__ = ('_kept_envelope', '_kept_level', '_shape', '_signals', 'flags')

    def __init__(
        self,
        flags: Bools,
        signals: Floats,
        shape: tuple[int, int, int],
        envelope: bool,
        level: bool,
    ) -> None:
        self.flags, self._signals, self._shape = flags, signals, shape
        self._kept_envelope, self._kept_level = envelope, level

    @property
    def slip(self) -> Bools:
        """Any group is ON; shape (n,)."""
        return self.flags[:, 0]

    @property
    def groups(self) -> Bools:
        """Decision of each group, in the order of the configuration; shape (n, g)."""
        return self.flags[:, 1 : 1 + self._shape[0]]

    @property
    def can_vote(self) -> Bools:
        """Whether the group has as many valid channels as its vote takes; shape (n, g)."""
        return self.flags[:, 1 + self._shape[0] : 1 + 2 * self._shape[0]]

    @property
    def channels(self) -> Bools:
        """Level above the threshold; shape (n, c)."""
        return self.flags[:, 1 + 2 * self._shape[0] :][:, : self._shape[1]]

    @property
    def valid(self) -> Bools:
        """Enabled, a good sample, and not flat; shape (n, c)."""
        return self.flags[:, 1 + 2 * self._shape[0] + self._shape[1] :]

    @property
    def envelope(self) -> Floats:
        """RMS envelope (Eq. 6-8); shape (n, c)."""
        return self._columns('envelope', self._kept_envelope, 0)

    @property
    def level(self) -> Floats:
        """Mean of the envelope, which is held against the threshold; shape (n, c)."""
        return self._columns('level', self._kept_level, int(self._kept_envelope))

    @property
    def vote_statistic(self) -> Floats:
        """What the slip decision holds against 1, by each vote that was asked for; shape (n, v).

        Dimensionless, and above 1 exactly where ``slip`` would be ON by that vote. It is the
        largest over the groups of what :mod:`slip_detector.chain.votes` describes, divided by the
        threshold; a group that cannot vote has 0. At a threshold of 1 it is the number, in the
        unit of the level, that any other threshold can be held against: it is above that threshold
        exactly where a chain with it has ``slip`` ON.
        """
        return self._signals[:, self._signals.shape[1] - self._shape[2] :]

    def _columns(self, name: str, kept: bool, before: int) -> Floats:
        """Return the channels of a signal that has so many others before it."""
        if not kept:
            raise ValueError(f'{name} was not kept: call update with {name}=True')
        signals = self._kept_envelope + self._kept_level
        # Of few channels there are more columns, without meaning.
        columns = (self._signals.shape[1] - self._shape[2]) // signals
        return self._signals[:, columns * before :][:, : self._shape[1]]
