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

"""The slip chain (the paper's Section 2): from rows of volts to ON/OFF slip."""

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.filters import design
from slip_detector.chain.kernel import (
    CACHED_VALUES,
    KEEP_EXCESS,
    KEEP_FLOOR,
    kernel,
)
from slip_detector.chain.lanes import LANES
from slip_detector.chain.memory import check_memory, state_shape
from slip_detector.chain.plan import plan_of
from slip_detector.chain.result import SlipResult
from slip_detector.chain.stages import (
    AGE,
    COMB_AGE,
    COMB_ROW,
    COMMON_V,
    FIRST,
    FIXED_SLOTS,
    FLOOR,
    HELD,
    LAST,
    REPEATS,
)
from slip_detector.chain.tiles import aligned, least_floors_db, tile_bases_of
from slip_detector.parameters.detector import ChainConfig

BOOL_TYPE = np.dtype(np.bool_)  # a constant, as the look-up takes longer than making an array


class SlipChain:
    """The chain with its state, for live nodes and for whole recordings.

    A chain can be copied (``copy.deepcopy``) and saved (``pickle``) between two calls. Its
    ``state`` holds everything that depends on earlier rows.

    Parameters
    ----------
    config
        The parameters; the defaults are the paper's.

    Raises
    ------
    ValueError
        When a filter of the configuration cannot be run in float64.

    Examples
    --------
    >>> chain = SlipChain()  # the paper's parameters: 16 channels at 380 Hz
    >>> result = chain.update(np.full((100, 16), 4.3))
    >>> result.groups.shape
    (100, 4)
    >>> bool(result.slip.any())
    False
    """

    def __init__(self, config: ChainConfig | None = None) -> None:
        if not COMPILED:
            warnings.warn(
                'Numba is not installed: the slip chain runs interpreted, slower, with the same '
                'decisions',
                RuntimeWarning,
                stacklevel=2,
            )
        self.config = config = config or ChainConfig()
        self._sections = design(config)
        self._evidence = config.decision == 'evidence'
        check_memory(config)
        self._votes: tuple[str | int, ...] = ()
        self._plan = plan_of(config, self._sections, self._votes)
        self._tiles_shape = state_shape(config)
        self._columns, self._channels = max(config.channels, LANES), config.channels
        self._groups = len(config.groups)
        self._width = 1 + 2 * self._groups + 2 * config.channels
        # The kernel does not write columns that are in no tile, as those of disabled channels.
        self._new_signals = np.zeros if config.disabled_channels else np.empty
        self.reset()
        # Compile the kernel, or load it from the cache, before the first sample comes.
        self.update(np.zeros((0, config.channels)))

    def reset(self) -> None:
        """Forget all rows; the next row is treated as the first."""
        self.state = aligned(np.zeros, self._tiles_shape)
        self.state[:, [LAST, FIRST]] = np.nan
        if self._evidence:
            # NaN: a floor that is not learnt begins at the first envelope.
            learnt = self.config.noise_floor_learnt
            self.state[:, FLOOR] = least_floors_db(self.config) if learnt else np.nan

    def restart(self) -> None:
        """Begin again after a gap: forget all rows, but keep the noise floors.

        Examples
        --------
        >>> chain = SlipChain(ChainConfig(decision='evidence', noise_floor=1e-3))
        >>> chain.restart()
        """
        floors = self.state[:, FLOOR].copy()
        self.reset()
        self.state[:, FLOOR] = floors

    def take_floors(self, other: 'SlipChain') -> None:
        """Take over the noise floors of another chain that decides by evidence.

        Parameters
        ----------
        other
            A chain with as many channels. Channels that are disabled in it keep their floors here.

        Raises
        ------
        ValueError
            When one of the two does not decide by evidence, or their numbers of channels differ.

        Examples
        --------
        >>> config = ChainConfig(decision='evidence', noise_floor=1e-3)
        >>> SlipChain(config).take_floors(SlipChain(config))
        """
        if not (self._evidence and other._evidence and self._channels == other._channels):
            raise ValueError(
                'noise floors are taken over from a chain that has none for these channels, '
                'allowed: decision: evidence in both, and as many channels'
            )
        floors = np.full(self._columns, np.nan)
        for base, tile in zip(tile_bases_of(other.config), other.state, strict=True):
            floors[base : base + LANES] = tile[FLOOR]
        floors[[channel - 1 for channel in other.config.disabled_channels]] = np.nan
        for base, tile in zip(tile_bases_of(self.config), self.state, strict=True):
            its = floors[base : base + LANES]
            tile[FLOOR] = np.where(np.isnan(its), tile[FLOOR], its)

    def take_filters(self, other: 'SlipChain') -> None:
        """Take over the state of another chain's filters, with empty windows.

        Parameters
        ----------
        other
            A chain with the same channels, valid range, filters, mains and common mode. Its
            windows, threshold, decision and vote may differ.

        Raises
        ------
        ValueError
            When one of these differs that must be the same.
        """
        same = ('channels', 'disabled_channels', 'valid_range_v', 'common_mode', 'mains_hz')
        for name in same:
            mine, its = getattr(self.config, name), getattr(other.config, name)
            if mine != its:
                raise ValueError(f'the other chain has {name} = {its}, allowed: {mine}')
        if not np.array_equal(self._sections, other._sections):
            raise ValueError('the other chain has other filters, allowed: the same')
        self.reset()
        end = FIXED_SLOTS + 2 * len(self._sections) + self.config.mains_rows
        of_filters = [COMB_ROW, COMB_AGE, *range(FIXED_SLOTS, end)]
        kept = [LAST, REPEATS, FIRST, HELD, COMMON_V, *of_filters]
        self.state[:, kept] = other.state[:, kept]
        # The comb is filled, the windows are empty.
        self.state[:, AGE] = np.minimum(self.state[:, COMB_AGE], self.config.mains_rows)

    def update(
        self,
        volts: ArrayLike,
        *,
        envelope: bool = True,
        level: bool = True,
        floor: bool = False,
        excess: bool = False,
        votes: Sequence[str | int] = (),
    ) -> SlipResult:
        """Process the next rows and decide on each.

        Parameters
        ----------
        volts : array_like, shape (n, c)
            Rows of volts, oldest first; none, one or many.
        envelope, level
            Whether the result has these signals.
        floor, excess
            Whether the result has these signals, which only the decision by evidence has.
        votes
            The votes whose :attr:`SlipResult.vote_statistic` is computed: ``all``, ``mean`` or
            numbers of channels. They do not depend on the vote of the configuration.

        Raises
        ------
        ValueError
            When the shape is not (n, c), a vote is not allowed or a signal does not exist.

        Examples
        --------
        >>> chain = SlipChain(ChainConfig(channels=2, threshold=1e-6))
        >>> time_s = np.arange(380) / 380
        >>> volts = 4.0 + 1e-3 * np.outer(np.sin(2 * np.pi * 20 * time_s), [1.0, 0.5])
        >>> result = chain.update(volts, votes=['all', 'mean', 1])
        >>> bool(result.slip[-1])
        True
        >>> bool(np.all(result.slip == (result.vote_statistic[:, 0] > 1)))
        True
        """
        if votes is not self._votes and tuple(votes) != self._votes:
            self._plan = plan_of(self.config, self._sections, votes)
            self._votes = tuple(votes)
        rows = np.ascontiguousarray(volts, np.float64)
        channels = self._channels
        if rows.ndim != 2 or rows.shape[1] != channels:
            raise ValueError(f'volts has the shape {rows.shape}, allowed: (any, {channels})')
        if channels < LANES:
            padded = np.zeros((len(rows), LANES))
            padded[:, :channels] = rows
            rows = padded
        n, many = len(rows), len(votes)
        kept = envelope | level << 1  # KEEP_ENVELOPE and KEEP_LEVEL
        signal_columns = self._columns * (envelope + level) + many
        if floor or excess:
            if not self._evidence:
                raise ValueError('floor and excess are not kept, allowed: with decision: evidence')
            kept += KEEP_FLOOR * floor + KEEP_EXCESS * excess
            signal_columns += self._columns * (floor + excess) + excess
        flags = np.empty((n, self._width), BOOL_TYPE)
        shape = (n, signal_columns)
        if n * shape[1] > CACHED_VALUES:
            signals = aligned(self._new_signals, shape)
        else:
            signals = self._new_signals(shape)
        kernel()(rows, flags, signals, self.state, self._plan, kept)
        return SlipResult(flags, signals, (self._groups, channels, many), kept)
