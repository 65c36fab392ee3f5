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

"""The result of the chain: decisions, and the signals that they are based on."""

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
        """Whether the group has as many valid channels as its vote needs; shape (n, g)."""
        return self.flags[:, 1 + self._shape[0] : 1 + 2 * self._shape[0]]

    @property
    def channels(self) -> Bools:
        """Whether the channel is ON; shape (n, c).

        It is ON while its level is above the threshold; with evidence it stays ON until the level
        falls to half the threshold.
        """
        return self.flags[:, 1 + 2 * self._shape[0] :][:, : self._shape[1]]

    @property
    def valid(self) -> Bools:
        """Whether the channel is enabled and not flat, and its sample is good; shape (n, c)."""
        return self.flags[:, 1 + 2 * self._shape[0] + self._shape[1] :]

    @property
    def envelope(self) -> Floats:
        """RMS envelope (Eq. 6-8); shape (n, c)."""
        return self._columns('envelope', KEEP_ENVELOPE)

    @property
    def level(self) -> Floats:
        """The number that is compared with the threshold; shape (n, c).

        It is the mean of the envelope, or the evidence in dB s.
        """
        return self._columns('level', KEEP_LEVEL)

    @property
    def floor(self) -> Floats:
        """Noise floor in dB of the envelope's unit; shape (n, c)."""
        return self._columns('floor', KEEP_FLOOR)

    @property
    def excess(self) -> Floats:
        """Excess of the envelope over the floor, within its limits, in dB; shape (n, c).

        It is 0 before the windows are full, while the channel is not valid, and for
        ``impact_hold_s`` from an impact on.
        """
        return self._columns('excess', KEEP_EXCESS)

    @property
    def after_impact(self) -> Bools:
        """Whether excess is held at 0 after an impact; kept if excess is; shape (n,)."""
        if not self._kept & KEEP_EXCESS:
            raise ValueError('after_impact was not kept: call update with excess=True')
        held: Bools = self._signals[:, self._signals.shape[1] - self._shape[2] - 1] != 0.0
        return held

    @property
    def vote_statistic(self) -> Floats:
        """The decision statistic of each vote that was asked for; shape (n, v).

        It is dimensionless, and above 1 exactly where ``slip`` would be ON with that vote. Of the
        groups' numbers, which :mod:`slip_detector.chain.votes` describes, it is the largest,
        divided by the threshold; a group that cannot vote has 0. With a threshold of 1 the
        statistic has the unit of the level and serves any other threshold: it exceeds that
        threshold exactly where a chain with that threshold has ``slip`` ON.
        """
        return self._signals[:, self._signals.shape[1] - self._shape[2] :]

    def _columns(self, name: str, signal: int) -> Floats:
        """Return the columns of a signal, given by its name and its bit."""
        if not self._kept & signal:
            raise ValueError(f'{name} was not kept: call update with {name}=True')
        before = (self._kept & (signal - 1)).bit_count()
        # Fewer channels than a tile has lanes are padded with columns without meaning.
        others = self._shape[2] + bool(self._kept & KEEP_EXCESS)
        columns = (self._signals.shape[1] - others) // self._kept.bit_count()
        return self._signals[:, columns * before :][:, : self._shape[1]]
