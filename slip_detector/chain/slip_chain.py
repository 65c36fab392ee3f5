"""The slip chain (the paper's Section 2): rows of volts in, ON/OFF slip out."""

import dataclasses
import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.filters import design
from slip_detector.chain.kernel import (
    BLOCK_ROWS,
    COMMON_MODES,
    COMMON_V,
    ENVELOPE_HEAD,
    EXCHANGED_CHANNELS,
    FIRST,
    FIXED_SLOTS,
    LAST,
    LEVEL_HEAD,
    TILE_LANES,
    VOTE_ROWS,
    Settings,
    run,
    statistics_of_votes,
)
from slip_detector.chain.lanes import LANES
from slip_detector.chain.result import SlipResult
from slip_detector.chain.votes import vote_numbers
from slip_detector.parameters.detector import ChainConfig

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

BOOL = np.dtype(np.bool_)  # as an object: looking the type up costs more than the array


def _aligned_zeros(shape: tuple[int, ...]) -> Floats:
    """Return zeros that begin where a cache line does: a vector across two lines costs double."""
    size = int(np.prod(shape))
    room = np.zeros(size + LANES)
    skip = -(room.ctypes.data // room.itemsize) % LANES
    return room[skip : skip + size].reshape(shape)


@dataclasses.dataclass
class ChainState:
    """All that a chain remembers between two calls.

    Attributes
    ----------
    tiles : ndarray, shape (tiles, slots, lanes)
        Per channel: last good value, its repeats, first good value, held filter input, the
        sections' delays and both windows.
    counters : ndarray, shape (3,)
        Rows into the present stretch of the envelope's and of the level's window, and the last
        row's common mode.
    """

    tiles: Floats
    counters: Floats


class SlipChain:
    """The chain with its state; the same object serves live nodes and whole recordings.

    A chain can be copied (``copy.deepcopy``) and saved (``pickle``) between two calls.

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
        disabled = {channel - 1 for channel in config.disabled_channels}
        enabled = [c for c in range(config.channels) if c not in disabled]
        # The kernel sees the enabled channels only; None stands for all of them.
        self._enabled = np.array(enabled, dtype=np.int64) if disabled else None
        n_tiles = -(-len(enabled) // TILE_LANES)
        lanes = -(-len(enabled) // n_tiles)
        lanes += -lanes % LANES
        sections = design(config)
        if len(sections) % 2:
            # The kernel takes them in pairs; this one lets everything through.
            sections = np.concatenate([sections, [[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]])
        envelope_rows = config.samples(config.envelope_window_s)
        level_rows = config.samples(config.decision_window_s)
        slots = FIXED_SLOTS + 2 * len(sections) + envelope_rows + 1 + level_rows + 1
        self._tiles_shape = (n_tiles, slots, lanes)
        seat = {channel + 1: i for i, channel in enumerate(enabled)}
        members = [[seat[c] for c in m if c in seat] for m in config.groups.values()]
        in_groups = [seat for mine in members for seat in mine]
        # Unsigned, so that the kernel need not look for indices counted from the end.
        self._place = np.argsort(in_groups).astype(np.uint64)
        self._bounds = np.cumsum([0] + [len(mine) for mine in members])
        vote = vote_numbers([config.vote])
        settings = Settings(
            low_v=config.valid_range_v[0],
            high_v=config.valid_range_v[1],
            flat_rows=config.samples(config.flat_after_s) if config.flat_after_s else np.inf,
            threshold=config.threshold,
            common_mode=COMMON_MODES.index(config.common_mode),
            full_wave=config.rectify == 'full',
            exponent=config.exponent,
            vote=int(vote[0]),
            envelope_rows=envelope_rows,
            level_rows=level_rows,
        )
        self._result_shape = (len(members), config.channels)
        voters = len(enabled) if config.vote == 'mean' else 0
        self._sections = sections
        exchanged = config.common_mode == 'median' and len(enabled) <= EXCHANGED_CHANNELS
        self._plan = (
            # Room to work in, overwritten by each call.
            _aligned_zeros((2, BLOCK_ROWS, lanes)),
            np.zeros((len(enabled), BLOCK_ROWS if exchanged else 1)),
            np.zeros(BLOCK_ROWS),
            np.zeros((voters, BLOCK_ROWS)),
            np.zeros((len(members), BLOCK_ROWS)),
            sections,
            np.array(in_groups, dtype=np.uint64),
            self._bounds,
            self._place,
            vote,
            np.array(settings),
        )
        self.reset()
        # Compiling, or loading what an earlier run compiled, must not wait for the first sample.
        self.update(np.zeros((0, config.channels)))

    def reset(self) -> None:
        """Forget all rows: the next row is the first."""
        tiles = _aligned_zeros(self._tiles_shape)
        tiles[:, LAST] = tiles[:, FIRST] = np.nan
        self.state = ChainState(tiles, np.zeros(3))

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
        end = FIXED_SLOTS + 2 * len(self._sections)
        tiles = self.state.tiles
        tiles[:] = 0.0
        tiles[:, :end] = other.state.tiles[:, :end]
        tiles[:, [ENVELOPE_HEAD, LEVEL_HEAD]] = 0.0
        self.state.counters[:] = 0.0
        self.state.counters[COMMON_V] = other.state.counters[COMMON_V]

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
        numbers = vote_numbers(votes) if votes else None
        rows = np.ascontiguousarray(volts, np.float64)
        shape = self._result_shape
        if rows.ndim != 2 or rows.shape[1] != shape[1]:
            raise ValueError(f'volts has the shape {rows.shape}, allowed: (any, {shape[1]})')
        if not rows.flags.writeable:  # another type to Numba, which would compile once more
            rows = rows.copy()
        if self._enabled is not None:
            rows = np.ascontiguousarray(rows[:, self._enabled])
        n, c = rows.shape
        flags = np.empty((n, 1 + 2 * shape[0] + 2 * c), BOOL)
        kept_level = level or numbers is not None
        signals = np.empty((n, c * (envelope + kept_level)))
        state = self.state
        run(
            rows, flags, signals, state.tiles, state.counters, *self._plan,
            envelope, kept_level,
        )  # fmt: skip
        if numbers is None:
            statistic = np.empty((n, 0))
        else:
            statistic = self._vote_statistic(signals[:, -c:], flags, numbers)
            if not level:
                signals = signals[:, :-c]
        if self._enabled is not None:
            flags, signals = self._spread(flags, signals, self._enabled)
        return SlipResult(flags, signals, statistic, shape, envelope, level)

    def _vote_statistic(self, level: Floats, flags: Bools, numbers: NDArray[np.int64]) -> Floats:
        n, c = level.shape
        statistic = np.empty((len(numbers), n + -n % LANES))
        room = np.empty((c, VOTE_ROWS))
        statistics_of_votes(level, flags, self._place, self._bounds, numbers, room, statistic)
        statistic /= self.config.threshold
        return np.asarray(statistic[:, :n].T)

    def _spread(
        self, flags: Bools, signals: Floats, enabled: NDArray[np.int64]
    ) -> tuple[Bools, Floats]:
        """Put the columns of the enabled channels where they are among all channels."""
        n, (groups, c) = len(flags), self._result_shape
        first = 1 + 2 * groups
        wide = np.zeros((n, first + 2 * c), np.bool_)
        wide[:, :first] = flags[:, :first]
        wide[:, first + np.concatenate([enabled, enabled + c])] = flags[:, first:]
        kept = signals.shape[1] // len(enabled)
        spread = np.zeros((n, kept, c))
        spread[:, :, enabled] = signals.reshape(n, kept, len(enabled))
        return wide, spread.reshape(n, kept * c)
