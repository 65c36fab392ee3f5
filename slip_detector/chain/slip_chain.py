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

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from slip_detector.chain import kernel, layout, stages
from slip_detector.chain.filters import design, design_low
from slip_detector.chain.layout import FlagLayout, flag_layout, state_layout, tiles_of
from slip_detector.chain.samples import Bools, Floats
from slip_detector.chain.stamps import StampGrid
from slip_detector.parameters import ChainConfig
from slip_detector.vectors import LANES

#: The signals that a result may have beside decisions, in the order of the kernel.
SIGNALS = ('envelope', 'level', 'floor', 'excess')

#: Constants, as the look-up takes as long as making an array.
BOOL_TYPE, FLOAT_TYPE = np.dtype(np.bool_), np.dtype(np.float64)

#: Share of the memory that a chain may take; while parameters change there are two chains.
MEMORY_SHARE = 0.25


class SlipResult:
    """Decisions on the rows of one call: ``n`` rows of ``c`` channels in ``g`` groups.

    Examples
    --------
    >>> chain = SlipChain(ChainConfig(channels=2))
    >>> result = chain.update(np.full((5, 2), 4.3), envelope=False)
    >>> result.slip.shape, result.channels.shape, result.level.shape
    ((5,), (5, 2), (5, 2))
    """

    __slots__ = ('_flags', '_kept', '_layout', '_signals')

    def __init__(
        self, flags: Bools, signals: Floats, layout: FlagLayout, kept: tuple[bool, ...]
    ) -> None:
        # Both arrays have columns of whole tiles; ``kept`` says which of ``SIGNALS`` there are.
        self._flags, self._signals = flags, signals
        self._layout, self._kept = layout, kept

    @property
    def flags(self) -> Bools:
        """All decisions side by side, as :func:`.flag_names` names them; shape (n, k)."""
        return self._flags[:, : self._layout.flags]

    @property
    def slip(self) -> Bools:
        """Whether any group is ON; shape (n,)."""
        return self._flags[:, 0]

    @property
    def groups(self) -> Bools:
        """Decision of each group, in the order of the configuration; shape (n, g)."""
        return self._flags[:, self._layout.groups_at : self._layout.can_vote_at]

    @property
    def can_vote(self) -> Bools:
        """Whether the group has as many valid channels as its vote needs; shape (n, g)."""
        return self._flags[:, self._layout.can_vote_at : self._layout.channels_at]

    @property
    def channels(self) -> Bools:
        """Whether the channel is ON; shape (n, c).

        A channel is ON while its level is above the threshold; with evidence it stays ON until the
        level falls to half the threshold.
        """
        return self._flags[:, self._layout.channels_at : self._layout.valid_at]

    @property
    def valid(self) -> Bools:
        """Whether the channel is enabled and not flat, and its sample is good; shape (n, c)."""
        return self._flags[:, self._layout.valid_at : self._layout.flags]

    @property
    def envelope(self) -> Floats:
        """RMS envelope (Eq. 6-8); shape (n, c)."""
        return self._columns('envelope')

    @property
    def level(self) -> Floats:
        """What is compared with the threshold; shape (n, c).

        It is the mean of the envelope, or the evidence in dB s.
        """
        return self._columns('level')

    @property
    def floor(self) -> Floats:
        """The noise floor, lifted by activity, in dB of the envelope's unit; shape (n, c).

        It is not lifted while the channel is not valid, and out of contact. Before it begins it is
        shown as ``noise_floor``, and as NaN without one.
        """
        return self._columns('floor')

    @property
    def excess(self) -> Floats:
        """Excess of the envelope over the floor, within its limits, in dB; shape (n, c).

        The excess is 0 before the windows are full, while the channel is not valid, out of
        contact, and for ``impact_hold_s`` from an impact on.
        """
        return self._columns('excess')

    @property
    def vote_statistic(self) -> Floats:
        """The decision statistic of each vote that was asked for; shape (n, v).

        The statistic is above 1 exactly where ``slip`` would be ON with that vote. It is the
        largest of the groups' numbers, which :mod:`slip_detector.chain.votes` describes, divided
        by the threshold; a group that cannot vote has 0. The statistic of a chain with a threshold
        of 1 exceeds another threshold exactly where a chain with that threshold has ``slip`` ON.
        """
        return self._signals[:, self._first_column(len(SIGNALS)) :]

    def _columns(self, name: str) -> Floats:
        signal, channels = SIGNALS.index(name), self.valid.shape[1]
        if not self._kept[signal]:
            raise ValueError(f'{name} was not kept: call update with {name}=True')
        return self._signals[:, self._first_column(signal) :][:, :channels]

    def _first_column(self, signal: int) -> int:
        """Return where a signal begins, behind those before it that are kept."""
        return LANES * tiles_of(self.valid.shape[1]) * sum(self._kept[:signal])


class SlipChain:
    """The chain with its state, for live nodes and for whole recordings.

    A chain can be copied (``copy.deepcopy``) and saved (``pickle``) between two calls. All that
    depends on earlier rows is in its ``state``.

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
        self.config = config = config or ChainConfig()
        self._sections, self._low_sections = design(config), design_low(config)
        check_memory(config)
        self._votes: tuple[str | int, ...] = ()
        self._plan = kernel.plan_of(config, self._sections, self._low_sections, ())
        self._flags = flag_layout(config)
        self._channels, self._columns = config.channels, tiles_of(config.channels) * LANES
        self._padded_flags = max(self._flags.flags, LANES)
        # The kernel does not write the columns of tiles without an enabled channel.
        self._new_signals = np.zeros if config.disabled_channels else np.empty
        self.reset()
        # Compile the kernel, or load it from the cache, before the first sample comes.
        self.update(np.zeros((0, config.channels)))

    def reset(self) -> None:
        """Forget all rows; the next row is treated as the first."""
        slots = self._plan.settings[0]
        self.state = kernel.aligned((tiles_of(self.config.channels), slots.slots, LANES))
        self.state[:, [layout.LAST, layout.FIRST]] = np.nan
        self.state[:, slots.comb_slot + 1 : slots.envelope_slot] = np.nan
        if self.config.mains_rows:
            self.state[:, layout.HELD] = np.nan
        self.state[:, slots.steps_slot + 1 :] = np.nan
        # NaN: a floor that is not learnt, or not given, begins at the first envelope.
        learnt = self.config.decision == 'evidence' and self.config.noise_floor_learnt
        self.state[:, layout.FLOOR] = self._plan.limits[:, stages.LEAST_DB] if learnt else np.nan

    def restart(self) -> None:
        """Begin again after a gap: forget all rows, but keep the noise floors.

        Whether there is contact is unknown after a gap. Contact is held as after a touch: in a
        still grip nothing touches, and a slip that follows must not wait for a touch.
        """
        floors = self.state[:, layout.FLOOR].copy()
        self.reset()
        self.state[:, layout.FLOOR] = floors
        self.state[0, layout.CONTACT_ROWS, 0] = self._plan.settings[0].contact_rows

    def take_floors(self, other: 'SlipChain', rest: Floats) -> None:
        """Begin with noise floors that are as far below the level at rest as another chain's.

        Parameters
        ----------
        other
            A chain on the same input; one that decides by the mean has no floors.
        rest : ndarray, shape (n, c)
            Rows that show the levels of both chains, if possible without slip. A channel that is
            not valid in these rows keeps its floor.
        """
        below_db = _rest_db(other.config, rest) - other.floor_and_level_db()[0]
        below_db *= self.config.exponent / other.config.exponent
        # A floor that is unknown in the other chain, and not learnt, begins at the level.
        begins = self.config.noise_floor_learnt and self.config.floors
        unknown_db = np.nan if begins else 0.0
        below_db = np.where(np.isfinite(below_db), below_db, unknown_db)
        floors_db = _rest_db(self.config, rest) - below_db
        known = np.flatnonzero(np.isfinite(floors_db))
        self.state[:, layout.FLOOR].flat[known] = floors_db[known]

    def floor_and_level_db(self) -> tuple[Floats, Floats]:
        """Return noise floors and levels after the last row, both of shape (c,), with evidence.

        A floor that has not begun is NaN.

        Examples
        --------
        >>> chain = SlipChain(ChainConfig(channels=2, decision='evidence', noise_floor=1e-3))
        >>> chain.floor_and_level_db()[0]
        array([nan, nan])
        """
        window, channels = self._plan.settings[0].envelope_slot, self.config.channels
        position = int(self.state[:, window, 0].max())  # 0 in a tile without enabled channels.
        power = self.state[:, window + 1] + self.state[:, window + 2 + position]
        with np.errstate(divide='ignore'):
            level_db = 10.0 * np.log10(power / self.config.samples(self.config.envelope_window_s))
        floor_db = self.state[:, layout.FLOOR]
        return floor_db.flatten()[:channels], level_db.flatten()[:channels]

    def take_filters(self, other: 'SlipChain') -> None:
        """Take over the state of another chain's filters, with empty windows.

        Parameters
        ----------
        other
            A chain with the same channels, valid range, filters, mains and common mode. Its
            windows, threshold, decision and vote may differ; this one decides by the mean.
        """
        self.reset()
        slots = self._plan.settings[0]
        kept = [*range(layout.HOLD_ROWS), *range(slots.delay_slot, slots.envelope_slot)]
        self.state[:, kept] = other.state[:, kept]

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
            self._plan = kernel.plan_of(self.config, self._sections, self._low_sections, votes)
            self._votes = tuple(votes)
        rows, columns = np.ascontiguousarray(volts, FLOAT_TYPE), self._columns
        shape = rows.shape
        if len(shape) != 2 or shape[1] != self._channels:
            allowed = f'(any, {self._channels})'
            raise ValueError(f'volts has the shape {shape}, allowed: {allowed}')
        n, signal_columns = shape[0], columns * (envelope + level) + len(votes)
        if floor or excess:
            if self.config.decision != 'evidence':
                raise ValueError('floor and excess are not kept, allowed: with decision: evidence')
            signal_columns += columns * (floor + excess)
        if shape[1] < columns:
            padded = np.zeros((n, columns))
            padded[:, : shape[1]] = rows
            rows = padded
        flags = np.empty((n, self._padded_flags), BOOL_TYPE)
        signals = self._new_signals((n, signal_columns))
        kept = envelope, level, floor, excess
        kernel.compiled_run()(rows, flags, signals, self.state, self._plan, kept)
        return SlipResult(flags, signals, self._flags, kept)


def _rest_db(config: ChainConfig, rows: Floats) -> Floats:
    """Return the level where each channel's floor would settle; not finite where none is known."""
    result = SlipChain(config).update(rows, level=False)
    settling = config.mains_rows + config.samples(config.envelope_window_s)
    # In rows that repeat a sample, and before the windows have moved, the level is no noise.
    moves = result.valid & (rows != np.concatenate([rows[:1], rows[:-1]])) & (result.envelope > 0)
    age = np.cumsum(np.maximum.accumulate(moves, axis=0), axis=0)
    levels = np.where(moves & (age > settling), result.envelope, np.inf)
    level: Floats = np.quantile(levels, stages.QUANTILE, axis=0, method='lower')
    with np.errstate(divide='ignore'):
        return 20.0 * np.log10(level)


def check_memory(config: ChainConfig, kept_s: float = 0.0) -> None:
    """Check that a chain, and the rows that are kept for the next chain, fit into memory.

    Parameters
    ----------
    config
        Configuration of the chain.
    kept_s
        Time for which rows are kept.

    Raises
    ------
    ValueError
        When they need more than :data:`MEMORY_SHARE` of the machine's memory.
    """
    slots = state_layout(config, len(design(config)), len(design_low(config)))['slots']
    kept = config.channels * config.sample_rate_hz * kept_s
    needed = 8 * (float(tiles_of(config.channels) * LANES) * slots + kept)
    allowed = MEMORY_SHARE * os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES')
    if needed > allowed:
        raise ValueError(
            f'parameter channels is {config.channels}: with these windows and this rate they take '
            f'{needed / 1e9:.3g} GB of memory, allowed: {allowed / 1e9:.3g} GB'
        )


def compile_chain() -> None:
    """Run each compiled function of the chain and of the stamps once.

    Without a cache this takes seconds. The compiled functions serve any configuration, and all
    later processes of the same user.
    """
    SlipChain()
    grid = StampGrid(period_s=1.0, max_gap_s=1.0)
    grid.mend(np.array([0, 1_000_000_000]))
    grid.arrive(2_000_000_000)
