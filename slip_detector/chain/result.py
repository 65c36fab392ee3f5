"""The decisions of the chain, and the signals that they are based on."""

import numpy as np
from numpy.typing import NDArray

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


class SlipResult:
    """Decisions on the rows of one call: ``n`` rows of ``c`` channels in ``g`` groups.

    Attributes
    ----------
    flags : ndarray of bool, shape (n, 1 + 2 g + 2 c)
        All decisions side by side, in the order of the properties below.

    Examples
    --------
    >>> from slip_detector import ChainConfig, SlipChain
    >>> chain = SlipChain(ChainConfig(channels=2))
    >>> result = chain.update(np.full((5, 2), 4.3), envelope=False)
    >>> result.slip.shape, result.channels.shape, result.level.shape
    ((5,), (5, 2), (5, 2))
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
        """Whether any group is ON; shape (n,)."""
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
        """Whether the level is above the threshold; shape (n, c)."""
        return self.flags[:, 1 + 2 * self._shape[0] :][:, : self._shape[1]]

    @property
    def valid(self) -> Bools:
        """Whether the channel is enabled, its sample good and it is not flat; shape (n, c)."""
        return self.flags[:, 1 + 2 * self._shape[0] + self._shape[1] :]

    @property
    def envelope(self) -> Floats:
        """RMS envelope (Eq. 6-8); shape (n, c)."""
        return self._columns('envelope', self._kept_envelope, 0)

    @property
    def level(self) -> Floats:
        """Mean of the envelope, which is compared with the threshold; shape (n, c)."""
        return self._columns('level', self._kept_level, int(self._kept_envelope))

    @property
    def vote_statistic(self) -> Floats:
        """The decision statistic of each vote that was asked for; shape (n, v).

        It is dimensionless, and above 1 exactly where ``slip`` would be ON with that vote. It is
        the largest number of all groups that :mod:`slip_detector.chain.votes` describes, divided
        by the threshold; a group that cannot vote has 0. At a threshold of 1 the statistic has the
        unit of the level, and can be compared with any other threshold: it is above that threshold
        exactly where a chain with it has ``slip`` ON.
        """
        return self._signals[:, self._signals.shape[1] - self._shape[2] :]

    def _columns(self, name: str, kept: bool, before: int) -> Floats:
        """Return the channels of a signal; ``before`` is the number of signals before it."""
        if not kept:
            raise ValueError(f'{name} was not kept: call update with {name}=True')
        signals = self._kept_envelope + self._kept_level
        # With few channels there are further columns, which have no meaning.
        columns = (self._signals.shape[1] - self._shape[2]) // signals
        return self._signals[:, columns * before :][:, : self._shape[1]]
