"""The slip chain (the paper's Section 2): rows of volts in, ON/OFF slip out."""

import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.common_mode import COMMON_MODES
from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.filters import design
from slip_detector.chain.kernel import (
    Settings,
    room_size,
    run,
)
from slip_detector.chain.lanes import LANES
from slip_detector.chain.result import SlipResult
from slip_detector.chain.stages import COMMON_V, FIRST, FIXED_SLOTS, HELD, LAST, REPEATS
from slip_detector.chain.votes import vote_numbers
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BOOL = np.dtype(np.bool_)  # as an object: looking the type up costs more than the array


def _aligned_zeros(shape: tuple[int, ...]) -> Floats:
    """Return zeros that begin where a cache line does: a vector across two lines costs double."""
    size = int(np.prod(shape))
    room = np.zeros(size + LANES)
    skip = -(room.ctypes.data // room.itemsize) % LANES
    return room[skip : skip + size].reshape(shape)


def _tile_bases(enabled: Sequence[int], columns: int) -> list[int]:
    """Return first columns of tiles that hold all enabled channels; the last may overlap."""
    bases: list[int] = []
    for channel in enabled:
        if not bases or channel >= bases[-1] + LANES:
            bases.append(min(channel, columns - LANES))
    return bases


class SlipChain:
    """The chain with its state; the same object serves live nodes and whole recordings.

    A chain can be copied (``copy.deepcopy``) and saved (``pickle``) between two calls. All that it
    remembers of the rows so far is its ``state``.

    Parameters
    ----------
    config
        Its defaults are the paper's.

    Raises
    ------
    ValueError
        When a filter of the configuration cannot be run in float64.
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
        sections = design(config)
        envelope_rows = config.samples(config.envelope_window_s)
        level_rows = config.samples(config.decision_window_s)
        disabled = {channel - 1 for channel in config.disabled_channels}
        enabled = [c for c in range(config.channels) if c not in disabled]
        # The kernel sees a tile at least.
        self._columns = max(config.channels, LANES)
        bases = _tile_bases(enabled, self._columns)
        seats: dict[int, int] = {}
        # No sample is good enough for a channel that takes no part.
        ranges = np.full((len(bases), 2, LANES), [[np.inf], [-np.inf]])
        for t, base in enumerate(bases):
            for lane in range(LANES):
                if base + lane < config.channels and base + lane not in disabled:
                    seats.setdefault(base + lane, LANES * t + lane)
                    ranges[t, :, lane] = config.valid_range_v
        groups = [[c - 1 for c in m if c - 1 in seats] for m in config.groups.values()]
        members = [seats[c] for group in groups for c in group]
        places = np.full(LANES * len(bases), -1)
        places[members] = np.arange(len(members))
        bounds = np.cumsum([0] + [len(group) for group in groups])
        none = LANES * len(bases)
        self._layout = (
            np.concatenate([bases, enabled, [seats[c] for c in enabled], places, bounds, members]),
            np.array([seats.get(c, none) for c in range(config.channels)]),
        )
        self._settings = Settings(
            flat_rows=config.samples(config.flat_after_s) if config.flat_after_s else np.inf,
            threshold=config.threshold,
            common_mode=COMMON_MODES.index(config.common_mode),
            full_wave=config.rectify == 'full',
            exponent=config.exponent,
            vote=int(vote_numbers([config.vote])[0]),
            envelope_rows=envelope_rows,
            level_rows=level_rows,
            enabled=len(enabled),
            groups=len(groups),
            tiles=len(bases),
        )
        self._sections = sections
        self._numbers = np.concatenate([self._settings, ranges.ravel(), sections.ravel()])
        self._groups, self._channels = len(groups), config.channels
        self._width = 1 + 2 * len(groups) + 2 * config.channels
        slots = FIXED_SLOTS + 2 * len(sections) + envelope_rows + 1 + level_rows + 1
        self._tiles_shape = (len(bases), slots, LANES)
        # Columns that no tile holds are not written.
        held = {base + lane for base in bases for lane in range(LANES)}
        self._new_signals = np.empty if len(held) == self._columns else np.zeros
        self._votes: tuple[str | int, ...] | None = None
        self._plan_votes(())
        self.reset()
        # Compiling, or loading what an earlier run compiled, must not wait for the first sample.
        self.update(np.zeros((0, config.channels)))

    def _plan_votes(self, votes: tuple[str | int, ...]) -> None:
        """Prepare for the statistic of these votes."""
        numbers, (before, after) = vote_numbers(votes), self._layout
        self._places = np.concatenate([before, numbers, after])
        self._room = _aligned_zeros((room_size(self._settings, self._width, len(votes)),))
        self._votes = votes

    def reset(self) -> None:
        """Forget all rows: the next row is the first."""
        self.state = _aligned_zeros(self._tiles_shape)
        self.state[:, [LAST, FIRST]] = np.nan

    def take_filters(self, other: 'SlipChain') -> None:
        """Go on where another chain's filters are, with empty windows.

        Parameters
        ----------
        other
            Of the same channels, filters and common mode; its windows, threshold and vote may
            differ.

        Raises
        ------
        ValueError
            When its filters are others.
        """
        for name in ('channels', 'disabled_channels', 'valid_range_v', 'common_mode'):
            mine, its = getattr(self.config, name), getattr(other.config, name)
            if mine != its:
                raise ValueError(f'the other chain has {name} = {its}, allowed: {mine}')
        if not np.array_equal(self._sections, other._sections):
            raise ValueError('the other chain has other filters, allowed: the same')
        self.reset()
        of_filters = [*range(FIXED_SLOTS, FIXED_SLOTS + 2 * len(self._sections))]
        kept = [LAST, REPEATS, FIRST, HELD, COMMON_V, *of_filters]
        self.state[:, kept] = other.state[:, kept]

    def update(
        self,
        volts: ArrayLike,
        *,
        envelope: bool = True,
        level: bool = True,
        votes: Sequence[str | int] = (),
    ) -> SlipResult:
        """Take the next rows and decide on each.

        Parameters
        ----------
        volts : array_like, shape (n, c)
            Rows of volts, oldest first; none, one or many.
        envelope, level
            Whether these two are kept for the result.
        votes
            Those whose :attr:`SlipResult.vote_statistic` is computed: ``all``, ``mean`` or counts
            of channels, whatever the vote of the configuration is.

        Raises
        ------
        ValueError
            When the shape is not (n, c) or a vote is none.

        Examples
        --------
        >>> import numpy as np
        >>> chain = SlipChain(ChainConfig(channels=2, threshold=1e-6))
        >>> time_s = np.arange(380) / 380
        >>> volts = 4.0 + 1e-3 * np.outer(np.sin(2 * np.pi * 20 * time_s), [1.0, 0.5])
        >>> result = chain.update(volts, votes=['all', 'mean', 1])
        >>> bool(result.slip[-1])
        True
        >>> bool(np.all(result.slip == (result.vote_statistic[:, 0] > 1)))
        True
        """
        if votes != self._votes and tuple(votes) != self._votes:
            self._plan_votes(tuple(votes))
        rows = np.ascontiguousarray(volts, np.float64)
        channels = self._channels
        if rows.ndim != 2 or rows.shape[1] != channels:
            raise ValueError(f'volts has the shape {rows.shape}, allowed: (any, {channels})')
        if channels < LANES:
            padded = np.zeros((len(rows), LANES))
            padded[:, :channels] = rows
            rows = padded
        elif not rows.flags.writeable:  # another type to Numba, which would compile once more
            rows = rows.copy()
        n, many = len(rows), len(votes)
        flags = np.empty((n, self._width), BOOL)
        signals = self._new_signals((n, self._columns * (envelope + level) + many))
        kept = envelope + 2 * level + 4 * many
        run(rows, flags, signals, self.state, self._room, self._numbers, self._places, kept)
        return SlipResult(flags, signals, (self._groups, channels, many), envelope, level)
