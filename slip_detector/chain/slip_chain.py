"""The slip chain (the paper's Section 2): rows of volts in, ON/OFF slip out.

One kernel runs all stages. It is plain Python that Numba compiles; where Numba is missing the
same functions run interpreted, to the same bits. Rows are taken in blocks of ``BLOCK_ROWS`` and
channels in tiles of at most ``TILE_LANES``, so that a tile's state stays in the first-level cache
and the inner loops, over the lanes of a tile, become vector instructions. Nothing that is
computed for a row depends on where a block or a call begins, hence any cut of the rows gives the
same bits.
"""

import dataclasses
import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.chain.compiled import COMPILED, compiled
from slip_detector.chain.filters import design
from slip_detector.parameters.detector import ChainConfig

BLOCK_ROWS = 32
TILE_LANES = 32
VECTOR_LANES = 8  # doubles in the widest vector register

#: Up to so many channels are ordered for the median by exchanges, a block of rows at a time.
EXCHANGED_CHANNELS = 32

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

# Slots of a tile's state before those of the sections and windows, one value a lane each.
LAST, COUNT, FIRST, HELD, ENVELOPE_HEAD, LEVEL_HEAD, FIXED_SLOTS = range(7)

BOOL = np.dtype(np.bool_)  # as an object: looking the type up costs more than the array

# Numbers of a configuration that the kernel needs, by their place in one array.
(LOW, HIGH, FLAT_ROWS, THRESHOLD, COMMON_MODE, FULL_WAVE, EXPONENT, VOTE, ENVELOPE_ROWS,
 LEVEL_ROWS) = range(10)  # fmt: skip

# Numbers that a chain remembers, beside those of its channels.
ENVELOPE_ROW, LEVEL_ROW, COMMON_V = range(3)

# Place of the filter's sections in a chain's plan.
SECTIONS = 3

COMMON_MODES = ('none', 'mean', 'median')
NO_COMMON_MODE, MEAN, MEDIAN = range(3)
VOTE_ALL, VOTE_MEAN = 0, -1


@compiled
def _check_samples(volts, start, rows, a, b, low, high, flat_rows, tile, flags, valid):
    """Mark bad and flat samples of one tile; remember the last good value and its repeats."""
    last, count = tile[LAST], tile[COUNT]
    for r in range(start, start + rows):
        row, marks = volts[r][a:b], flags[r][valid + a : valid + b]
        for i in range(row.size):
            value = row[i]
            before, repeats = last[i], count[i]
            ok = (value >= low) & (value <= high)  # false for NaN too
            again = repeats + 1.0
            again = again if value == before else 0.0
            again = again if ok else repeats
            count[i] = again
            last[i] = value if ok else before
            marks[i] = ok & (again < flat_rows)


@compiled
def exchange(a, b):
    """Put the larger of each pair of values into ``a``, the smaller into ``b``."""
    for i in range(a.size):
        u, v = a[i], b[i]
        a[i] = u if u > v else v
        b[i] = v if u > v else u


@compiled
def _medians(volts, start, rows, tiles, deviations, shared):
    """Write the medians of rows in which all channels count, side by side in vector registers.

    A sort of one row has a branch that no processor foresees for each pair.
    """
    channels, lanes = volts.shape[1], tiles.shape[2]
    for i in range(channels):
        first, lane = tiles[i // lanes, FIRST, i % lanes], deviations[i]
        for k in range(rows):
            lane[k] = volts[start + k, i] - first
    # The larger half is enough: what is left is below it.
    for i in range(channels // 2 + 1):
        for j in range(channels - 1, i, -1):
            exchange(deviations[j - 1][:rows], deviations[j][:rows])
    low, high = deviations[channels // 2], deviations[(channels - 1) // 2]
    for k in range(rows):
        shared[k] = 0.5 * (low[k] + high[k])


@compiled
def _common_mode(
    volts, start, rows, low, high, kind, tiles, flags, valid, counters, deviations, shared
):
    """Write each row's mean or median deviation of the valid channels to ``shared``.

    Deviations are from each channel's first good value: baselines differ by far more than the
    signal, and a channel that leaves for a row would otherwise step all others. A channel that
    starts late is taken to have followed the others until then.
    """
    lanes = tiles.shape[2]
    if kind == MEDIAN and deviations.shape[1] == BLOCK_ROWS:
        whole = True
        for i in range(volts.shape[1]):
            whole &= not np.isnan(tiles[i // lanes, FIRST, i % lanes])
        for k in range(rows):
            marks = flags[start + k][valid:]
            for i in range(marks.size):
                whole &= marks[i]
        if whole:
            _medians(volts, start, rows, tiles, deviations, shared)
            counters[COMMON_V] = shared[rows - 1]
            return
    for k in range(rows):
        row, marks = volts[start + k], flags[start + k][valid:]
        n = 0
        for i in range(row.size):
            first = tiles[i // lanes, FIRST, i % lanes]
            if marks[i] and not np.isnan(first):
                deviations[n, 0] = row[i] - first
                n += 1
        if n and kind == MEAN:
            total = 0.0
            for i in range(n):
                total += deviations[i, 0]
            counters[COMMON_V] = total / n
        elif n:
            values = deviations[:n, 0]
            values.sort()
            middle = 0.5 * (values[(n - 1) // 2] + values[n // 2])
            counters[COMMON_V] = middle
        shared[k] = counters[COMMON_V]
        for i in range(row.size):
            first = tiles[i // lanes, FIRST, i % lanes]
            if np.isnan(first) and row[i] >= low and row[i] <= high:
                tiles[i // lanes, FIRST, i % lanes] = row[i] - shared[k]


@compiled
def _load(volts, start, rows, a, b, low, high, shared, tile, block):
    """Write the filter input of one tile to ``block``: deviations from the first good value.

    The network passes no constant, so the deviation from the first value, filtered from rest, is
    the value itself filtered from the steady state of that value; without its rounding errors.
    """
    first, held = tile[FIRST], tile[HELD]
    for k in range(rows):
        row, x = volts[start + k][a:b], block[k]
        common = shared[k]
        for i in range(row.size):
            value = row[i]
            begin, before = first[i], held[i]
            ok = (value >= low) & (value <= high)
            begin = value if ok & np.isnan(begin) else begin
            deviation = (value - begin) - common
            deviation = deviation if ok else before
            first[i] = begin
            held[i] = deviation
            x[i] = deviation


@compiled
def _filter(block, rows, sections, delays):
    """Run a block through the sections (transposed direct form II), two at a time, in place.

    What a section keeps for the next row must be stored before that row can start; a second
    section in the same pass works while the first one waits.
    """
    for s in range(0, sections.shape[0], 2):
        b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
        a1, a2 = sections[s, 4], sections[s, 5]
        d0, d1, d2 = sections[s + 1, 0], sections[s + 1, 1], sections[s + 1, 2]
        c1, c2 = sections[s + 1, 4], sections[s + 1, 5]
        z0, z1 = delays[2 * s], delays[2 * s + 1]
        w0, w1 = delays[2 * s + 2], delays[2 * s + 3]
        for k in range(rows):
            x = block[k]
            for i in range(x.size):
                u = x[i]
                v = b0 * u + z0[i]
                z0[i] = (b1 * u + z1[i]) - a1 * v
                z1[i] = b2 * u - a2 * v
                y = d0 * v + w0[i]
                w0[i] = (d1 * v + w1[i]) - c1 * y
                w1[i] = d2 * v - c2 * y
                x[i] = y


@compiled
def _rectified_power(block, power, rows, full_wave, exponent):
    """Rectify (Eq. 3) and raise to the exponent (Eq. 5), then square for the RMS (Eq. 6)."""
    if exponent == 3:  # The paper's, in one pass.
        for k in range(rows):
            x, p = block[k], power[k]
            for i in range(x.size):
                u = x[i]
                half = u if u > 0.0 else 0.0
                u = abs(u) if full_wave else half
                cube = u * u * u
                p[i] = cube * cube
        return
    for k in range(rows):
        x, p = block[k], power[k]
        for i in range(x.size):
            u = x[i]
            half = u if u > 0.0 else 0.0
            x[i] = abs(u) if full_wave else half
            p[i] = x[i]
    for _ in range(exponent - 1):
        for k in range(rows):
            x, p = block[k], power[k]
            for i in range(x.size):
                p[i] *= x[i]
    for k in range(rows):
        p = power[k]
        for i in range(p.size):
            p[i] *= p[i]


@compiled
def _window_means(values, rows, window, position, head, tail, root):
    """Replace each value by the mean of the last ``window`` values, zeros before the first.

    Time is cut into stretches of ``window`` rows: a sum is the head of the present stretch and
    the tail of the one before, whose tails are summed once when it ends. Only sums of terms, no
    differences: a huge value leaves nothing behind when it leaves the window. With ``root`` it is
    the root of the mean.

    Returns the position within the stretch after the last row.
    """
    per = 1.0 / window
    for k in range(rows):
        v = values[k]
        new, old = tail[position], tail[position + 1]
        for i in range(v.size):
            u = v[i]
            total = head[i] + u
            head[i] = total
            new[i] = u
            mean = (total + old[i]) * per
            v[i] = np.sqrt(mean) if root else mean
        position += 1
        if position == window:
            position = 0
            for j in range(window - 2, -1, -1):
                a, b = tail[j], tail[j + 1]
                for i in range(v.size):
                    a[i] += b[i]
            for i in range(v.size):
                head[i] = 0.0
    return position


@compiled
def _keep(values, rows, signals, start, a, b):
    """Copy a tile's values to columns ``a`` to ``b`` of the result."""
    for k in range(rows):
        v, to = values[k], signals[start + k][a:b]
        for i in range(to.size):
            to[i] = v[i]


@compiled
def _score(level, rows, group_of, threshold, flags, start, valid, scores):
    """Add the logarithms of level / threshold of a tile's valid channels to their groups."""
    for k in range(rows):
        marks = flags[start + k][valid:]
        for i in range(group_of.size):
            if marks[i]:
                mean = level[k, i]
                ratio = np.log(mean / threshold) if mean > 0.0 else -np.inf
                scores[k, group_of[i]] += ratio


@compiled
def _vote(start, rows, members, bounds, vote, scores, flags, channels, valid):
    """Let each group's valid channels vote (Table 1) and take the OR of the groups."""
    n_groups = bounds.size - 1
    for k in range(rows):
        row = flags[start + k]
        if k > 0 and vote != VOTE_MEAN:
            # As good as always the channels say what they said in the row before.
            before = flags[start + k - 1]
            now, then = row[channels:], before[channels:]
            differ = False
            for i in range(now.size):
                differ |= now[i] ^ then[i]
            if not differ:
                for i in range(channels):
                    row[i] = before[i]
                continue
        on, marks = row[channels:valid], row[valid:]
        slip = False
        for g in range(n_groups):
            n_valid = 0
            n_on = 0
            for j in range(bounds[g], bounds[g + 1]):
                mark = marks[members[j]]
                n_valid += mark
                n_on += mark & on[members[j]]
            if vote == VOTE_ALL:
                able = n_valid > 0
                decision = able & (n_on == n_valid)
            elif vote == VOTE_MEAN:
                able = n_valid > 0
                decision = able & (scores[k, g] > 0.0)
            else:
                able = n_valid >= vote
                decision = n_on >= vote
            row[1 + g] = decision
            row[1 + n_groups + g] = able
            slip = slip | decision
        row[0] = slip


@compiled
def _run(
    volts, flags, signals, tiles, counters, blocks, deviations, by_row, sections, members, bounds,
    group_of, settings, keep_envelope, keep_level,
):  # fmt: skip
    """Run all stages over all rows, from ``volts`` to ``flags`` and ``signals``.

    Each argument costs a call some 50 ns, hence the single numbers come in two arrays.
    """
    n_channels, n_groups = volts.shape[1], bounds.size - 1
    channels = 1 + 2 * n_groups  # first column of the channels' decisions, and of their validity
    valid = channels + n_channels
    n_tiles, lanes = tiles.shape[0], tiles.shape[2]
    block, power = blocks[0], blocks[1]
    shared, scores = by_row[:, 0], by_row[:, 1:]
    low, high, flat_rows = settings[LOW], settings[HIGH], settings[FLAT_ROWS]
    threshold, vote = settings[THRESHOLD], int(settings[VOTE])
    common_mode, full_wave = int(settings[COMMON_MODE]), settings[FULL_WAVE] != 0.0
    exponent = int(settings[EXPONENT])
    envelope_rows, level_rows = int(settings[ENVELOPE_ROWS]), int(settings[LEVEL_ROWS])
    envelope_tail = FIXED_SLOTS + 2 * sections.shape[0]
    level_tail = envelope_tail + envelope_rows + 1
    for start in range(0, volts.shape[0], BLOCK_ROWS):
        rows = min(BLOCK_ROWS, volts.shape[0] - start)
        if vote == VOTE_MEAN:
            scores[:rows] = 0.0
        if common_mode != NO_COMMON_MODE:
            for t in range(n_tiles):
                a, b = t * lanes, min((t + 1) * lanes, n_channels)
                _check_samples(
                    volts, start, rows, a, b, low, high, flat_rows, tiles[t], flags, valid
                )
            _common_mode(
                volts, start, rows, low, high, common_mode, tiles, flags, valid, counters,
                deviations, shared,
            )  # fmt: skip
        envelope_row, level_row = int(counters[ENVELOPE_ROW]), int(counters[LEVEL_ROW])
        at_envelope, at_level = envelope_row, level_row
        for t in range(n_tiles):
            a, b = t * lanes, min((t + 1) * lanes, n_channels)
            tile = tiles[t]
            if common_mode == NO_COMMON_MODE:
                _check_samples(volts, start, rows, a, b, low, high, flat_rows, tile, flags, valid)
            _load(volts, start, rows, a, b, low, high, shared, tile, block)
            _filter(block, rows, sections, tile[FIXED_SLOTS:envelope_tail])
            _rectified_power(block, power, rows, full_wave, exponent)
            at_envelope = _window_means(
                power, rows, envelope_rows, envelope_row, tile[ENVELOPE_HEAD],
                tile[envelope_tail:level_tail], True,
            )  # fmt: skip
            if keep_envelope:
                _keep(power, rows, signals, start, a, b)
            at_level = _window_means(
                power, rows, level_rows, level_row, tile[LEVEL_HEAD], tile[level_tail:], False
            )
            for k in range(rows):
                p, on = power[k], flags[start + k][channels + a : channels + b]
                for i in range(on.size):
                    on[i] = p[i] > threshold
            if keep_level:
                left = n_channels if keep_envelope else 0
                _keep(power, rows, signals, start, left + a, left + b)
            if vote == VOTE_MEAN:
                _score(power, rows, group_of[a:b], threshold, flags, start, valid + a, scores)
        counters[ENVELOPE_ROW], counters[LEVEL_ROW] = at_envelope, at_level
        _vote(start, rows, members, bounds, vote, scores, flags, channels, valid)


def _aligned_zeros(shape):
    """Return zeros that begin where a cache line does: a vector across two lines costs double."""
    size = int(np.prod(shape))
    room = np.zeros(size + VECTOR_LANES)
    skip = -(room.ctypes.data // room.itemsize) % VECTOR_LANES
    return room[skip : skip + size].reshape(shape)


class SlipResult:
    """Decisions on the rows of one call: ``n`` rows of ``c`` channels in ``g`` groups.

    Attributes
    ----------
    flags : ndarray of bool, shape (n, 1 + 2 g + 2 c)
        All decisions side by side: equal rows are equal decisions.
    """

    __slots__ = ('_kept_envelope', '_kept_level', '_shape', '_signals', 'flags')

    def __init__(
        self, flags: Bools, signals: Floats, shape: tuple[int, int], envelope: bool, level: bool
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
        return self._kept('envelope', self._kept_envelope, self._signals[:, : self._shape[1]])

    @property
    def level(self) -> Floats:
        """Mean of the envelope, which is held against the threshold; shape (n, c)."""
        return self._kept('level', self._kept_level, self._signals[:, -self._shape[1] :])

    @staticmethod
    def _kept(name: str, kept: bool, signal: Floats) -> Floats:
        if not kept:
            raise ValueError(f'{name} was not kept: call update with {name}=True')
        return signal


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
        lanes += -lanes % VECTOR_LANES
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
        group_of = np.zeros(len(enabled), dtype=np.int64)
        for group, mine in enumerate(members):
            group_of[mine] = group
        settings = np.zeros(10)
        settings[[LOW, HIGH]] = config.valid_range_v
        settings[FLAT_ROWS] = (
            config.samples(config.flat_after_s) if config.flat_after_s else np.inf
        )
        settings[THRESHOLD] = config.threshold
        settings[COMMON_MODE] = COMMON_MODES.index(config.common_mode)
        settings[FULL_WAVE], settings[EXPONENT] = config.rectify == 'full', config.exponent
        settings[ENVELOPE_ROWS], settings[LEVEL_ROWS] = envelope_rows, level_rows
        settings[VOTE] = {'all': VOTE_ALL, 'mean': VOTE_MEAN}.get(str(config.vote), config.vote)
        self._result_shape = (len(members), config.channels)
        exchanged = config.common_mode == 'median' and len(enabled) <= EXCHANGED_CHANNELS
        self._plan = (
            # Room to work in, overwritten by each call.
            _aligned_zeros((2, BLOCK_ROWS, lanes)),
            np.zeros((len(enabled), BLOCK_ROWS if exchanged else 1)),
            np.zeros((BLOCK_ROWS, 1 + len(members))),
            sections,
            # Unsigned, so that the kernel need not look for indices counted from the end.
            np.array([c for mine in members for c in mine], dtype=np.uint64),
            np.cumsum([0] + [len(mine) for mine in members]),
            group_of,
            settings,
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
        if not np.array_equal(self._plan[SECTIONS], other._plan[SECTIONS]):
            raise ValueError('the other chain has other filters, allowed: the same')
        end = FIXED_SLOTS + 2 * len(self._plan[SECTIONS])
        tiles = self.state.tiles
        tiles[:] = 0.0
        tiles[:, :end] = other.state.tiles[:, :end]
        tiles[:, [ENVELOPE_HEAD, LEVEL_HEAD]] = 0.0
        self.state.counters[:] = 0.0
        self.state.counters[COMMON_V] = other.state.counters[COMMON_V]

    def update(self, volts: ArrayLike, *, envelope: bool = True, level: bool = True) -> SlipResult:
        """Take the next rows and decide on each.

        Parameters
        ----------
        volts : array_like, shape (n, c)
            Rows of volts, oldest first; none, one or many.
        envelope, level
            Whether these two are kept for the result.

        Raises
        ------
        ValueError
            When the shape is not (n, c).
        """
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
        signals = np.empty((n, c * (envelope + level)))
        state = self.state
        _run(
            rows, flags, signals, state.tiles, state.counters, *self._plan,
            envelope, level,
        )  # fmt: skip
        if self._enabled is not None:
            flags, signals = self._spread(flags, signals, self._enabled)
        return SlipResult(flags, signals, shape, envelope, level)

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
