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

"""The decisions of the chain, and the signals that they are based on."""

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.kernel import KEEP_ENVELOPE, KEEP_EXCESS, KEEP_FLOOR, KEEP_LEVEL

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

    __slots__ = ('_kept', '_shape', '_signals', 'flags')

    def __init__(
        self, flags: Bools, signals: Floats, shape: tuple[int, int, int], kept: int
    ) -> None:
        self.flags, self._signals, self._shape, self._kept = flags, signals, shape, kept

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
        """Whether the channel is ON; shape (n, c).

        It is where its level is above the threshold; with evidence it then stays ON until the
        level is not above half of it.
        """
        return self.flags[:, 1 + 2 * self._shape[0] :][:, : self._shape[1]]

    @property
    def valid(self) -> Bools:
        """Whether the channel is enabled, its sample good and it is not flat; shape (n, c)."""
        return self.flags[:, 1 + 2 * self._shape[0] + self._shape[1] :]

    @property
    def envelope(self) -> Floats:
        """RMS envelope (Eq. 6-8); shape (n, c)."""
        return self._columns('envelope', KEEP_ENVELOPE)

    @property
    def level(self) -> Floats:
        """The number that is held against the threshold; shape (n, c).

        It is the mean of the envelope, or the evidence in dB s.
        """
        return self._columns('level', KEEP_LEVEL)

    @property
    def floor(self) -> Floats:
        """Noise floor in dB of the envelope's unit; shape (n, c)."""
        return self._columns('floor', KEEP_FLOOR)

    @property
    def excess(self) -> Floats:
        """How far the envelope counts above the floor, in dB; shape (n, c).

        It is 0 where it does not count: before the windows are full, where the channel is not
        valid, and for some time from an impact on.
        """
        return self._columns('excess', KEEP_EXCESS)

    @property
    def after_impact(self) -> Bools:
        """Whether excess is held at 0 after an impact, kept with it; shape (n,)."""
        if not self._kept & KEEP_EXCESS:
            raise ValueError('after_impact was not kept: call update with excess=True')
        held: Bools = self._signals[:, self._signals.shape[1] - self._shape[2] - 1] != 0.0
        return held

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

    def _columns(self, name: str, signal: int) -> Floats:
        """Return the channels of a signal, which is one of the bits of what is kept."""
        if not self._kept & signal:
            raise ValueError(f'{name} was not kept: call update with {name}=True')
        before = (self._kept & (signal - 1)).bit_count()
        # With few channels there are further columns, which have no meaning.
        others = self._shape[2] + bool(self._kept & KEEP_EXCESS)
        columns = (self._signals.shape[1] - others) // self._kept.bit_count()
        return self._signals[:, columns * before :][:, : self._shape[1]]
