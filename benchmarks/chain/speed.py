"""How fast the chain is, always against a rival measured in the same run.

:func:`measure_chain_speed` gives one object (keys of ``python -m benchmarks chain --json``):

``blocks``
    All stages on one block of rows against the same in SciPy and NumPy, from volts to decisions:
    ``rows``, ``channels``, ``rounds``, ``chain_ns_per_row``, ``numpy_ns_per_row``, ``speedup``,
    and ``agreement``, the share of equal decisions for ``slip``, ``groups`` and ``channels``, with
    ``slip_share``, the share of rows with slip. ``tuned`` has ``rows_per_call``,
    ``chain_ns_per_row``, ``numpy_ns_per_row`` and ``speedup`` against the NumPy chain at its best:
    in place, and in blocks that stay in the cache.
``one_row``
    One row per call against one bare ``scipy.signal.sosfilt``: ``channels``, ``calls``,
    ``rounds``, ``chain_us_per_call``, ``sosfilt_us_per_call``, ``speedup``; and the memory of a
    call beyond the arrays of its result: ``kept_bytes_per_call`` after it,
    ``peak_bytes_per_call`` during it (by number of channels), ``temporary_bytes_per_channel``,
    which is what the peak grows by with the channels.
``channels``
    The chain by number of channels: ``channel_samples`` of a call, ``rounds``,
    ``ns_per_channel_sample``, ``ratio`` to 16 channels (both by number of channels) and
    ``worst_ratio``.
``wanted``
    For each claim, by ``section.figure``: the measured ``value``, the ``bound`` as text and
    whether it is ``met``, null where nothing is judged.
"""

import tracemalloc
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from benchmarks.chain.numpy_chain import NumpyChain
from benchmarks.timing import garbage_collection_off, least_times_s
from benchmarks.verdicts import verdicts
from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.filters import design
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.bounds import Bound
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]

#: What is wanted, by section and figure.
WANTED = {
    'blocks.speedup': Bound(low=10.0),
    'one_row.speedup': Bound(low=8.0),
    'one_row.kept_bytes_per_call': Bound(high=1.0, strict=True),
    # The least temporary that could be per channel is a byte.
    'one_row.temporary_bytes_per_channel': Bound(high=1.0, strict=True),
    'channels.worst_ratio': Bound(high=1.5),
}


class SpeedSizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    rows : int
        Of 16 channels, for ``blocks``.
    channel_samples : int
        Of one call, for ``channels``.
    calls : int
        Of one round, for ``one_row``.
    rounds : int
        How often the sides take turns.
    one_row_rounds : int
        The same for ``one_row``, whose rounds are short.
    """

    rows: int
    channel_samples: int
    calls: int
    rounds: int
    one_row_rounds: int


FULL = SpeedSizes(200_000, 3_200_000, 500, 20, 60)
QUICK = SpeedSizes(20_000, 320_000, 200, 3, 10)
#: Without Numba the chain takes some 500 times as long.
FULL_INTERPRETED = SpeedSizes(10_000, 20_000, 100, 3, 10)
QUICK_INTERPRETED = SpeedSizes(2_000, 10_000, 20, 2, 2)

#: NumPy is fastest with about so many rows a call: all that a call touches stays in the
#: second-level cache, and what a call costs by itself does not show.
ROWS_PER_CALL = 4096

CHANNEL_COUNTS = (16, 64, 1024, 10_000)

#: Rounding differs between the two sides, so a level next to the threshold may be above it for
#: one and below it for the other; more such decisions than this are a fault.
LEAST_AGREEMENT = 1 - 1e-5

BASELINE_V = 4.3


def measure_chain_speed(quick: bool = False) -> dict[str, Any]:
    """Measure the chain; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Few rows and rounds; nothing is judged.

    Raises
    ------
    RuntimeError
        When the chain and its rivals decide differently.
    """
    if COMPILED:
        sizes = QUICK if quick else FULL
    else:
        sizes = QUICK_INTERPRETED if quick else FULL_INTERPRETED
    result: dict[str, Any] = {
        'blocks': measure_blocks(sizes),
        'one_row': measure_one_row(sizes),
        'channels': measure_channels(sizes),
    }
    values = {}
    for claim in WANTED:
        section, figure = claim.split('.')
        values[claim] = result[section][figure]
    result['wanted'] = verdicts(WANTED, values, judged=not quick)
    return result


def swelling_noise_v(rows: int, n_channels: int, seed: int = 0) -> Floats:
    """Make noise that swells and fades every 2 s (at 380 Hz), so that slip comes and goes."""
    random = np.random.default_rng(seed)
    swell_v = 0.02 * (1 + np.sin(2 * np.pi * np.arange(rows) / 760))
    return np.asarray(BASELINE_V + swell_v[:, None] * random.standard_normal((rows, n_channels)))


def measure_blocks(sizes: SpeedSizes) -> dict[str, Any]:
    """Compare all stages on blocks of rows with :class:`NumpyChain`."""
    config = ChainConfig()
    rows = swelling_noise_v(sizes.rows, config.channels)
    pieces = [rows[i : i + ROWS_PER_CALL] for i in range(0, len(rows), ROWS_PER_CALL)]
    chain = SlipChain(config)
    plain, tuned = NumpyChain(config, rows[0]), NumpyChain(config, rows[0], in_place=True)
    mine = chain.update(rows)
    agreement = {}
    theirs = zip(
        ('slip', 'groups', 'channels'), plain.update(rows), tuned.update(rows), strict=True
    )
    for name, of_plain, of_tuned in theirs:
        ours = getattr(mine, name)
        agreement[name] = float(min((ours == of_plain).mean(), (ours == of_tuned).mean()))
    if min(agreement.values()) < LEAST_AGREEMENT:
        raise RuntimeError(f'the chain and its NumPy rivals decide differently: {agreement}')

    def chain_pass(parts: list[Floats]) -> Callable[[], None]:
        def run() -> None:
            for part in parts:
                chain.update(part, envelope=False, level=False)  # decisions, as the rivals

        return run

    def rival_pass(rival: NumpyChain, parts: list[Floats]) -> Callable[[], None]:
        def run() -> None:
            for part in parts:
                rival.update(part)

        return run

    sides = [chain_pass([rows]), rival_pass(plain, [rows])]
    sides += [chain_pass(pieces), rival_pass(tuned, pieces)]
    times_ns = [time_s / len(rows) * 1e9 for time_s in least_times_s(sides, sizes.rounds)]
    return {
        'rows': len(rows),
        'channels': config.channels,
        'rounds': sizes.rounds,
        'chain_ns_per_row': times_ns[0],
        'numpy_ns_per_row': times_ns[1],
        'speedup': times_ns[1] / times_ns[0],
        'agreement': agreement,
        'slip_share': float(mine.slip.mean()),
        'tuned': {
            'rows_per_call': min(ROWS_PER_CALL, len(rows)),
            'chain_ns_per_row': times_ns[2],
            'numpy_ns_per_row': times_ns[3],
            'speedup': times_ns[3] / times_ns[2],
        },
    }


def measure_one_row(sizes: SpeedSizes) -> dict[str, Any]:
    """Compare one row per call with one bare call of sosfilt on the same row."""
    config = ChainConfig()
    block = swelling_noise_v(sizes.calls, config.channels)
    rows = [block[i : i + 1] for i in range(len(block))]
    chain, sections = SlipChain(config), design(config)
    delays = signal.sosfilt_zi(sections)[:, :, None] * rows[0]

    def chain_calls() -> None:
        for row in rows:
            chain.update(row)

    def sosfilt_calls() -> None:
        zi = delays
        for row in rows:
            _, zi = signal.sosfilt(sections, row, axis=0, zi=zi)

    chain_s, sosfilt_s = least_times_s([chain_calls, sosfilt_calls], sizes.one_row_rounds)
    few, many = config.channels, 64 * config.channels
    kept, few_peak = memory_of_a_call(few, 1000)
    _, many_peak = memory_of_a_call(many, 1)
    return {
        'channels': config.channels,
        'calls': sizes.calls,
        'rounds': sizes.one_row_rounds,
        'chain_us_per_call': chain_s / sizes.calls * 1e6,
        'sosfilt_us_per_call': sosfilt_s / sizes.calls * 1e6,
        'speedup': sosfilt_s / chain_s,
        'kept_bytes_per_call': kept,
        'peak_bytes_per_call': {str(few): few_peak, str(many): many_peak},
        'temporary_bytes_per_channel': (many_peak - few_peak) / (many - few),
    }


def memory_of_a_call(n_channels: int, calls: int) -> tuple[float, int]:
    """Measure the memory of one-row calls beyond the arrays of their result.

    Parameters
    ----------
    n_channels
        Of a row.
    calls
        Over which what is kept is averaged.

    Returns
    -------
    kept : float
        Bytes per call that are still held when the result is gone.
    peak : int
        Most bytes during a call: headers of the result's arrays and Python's own objects.
    """
    chain = SlipChain(ChainConfig(channels=n_channels))
    row = swelling_noise_v(1, n_channels)
    with garbage_collection_off():
        tracemalloc.start()
        try:
            for _ in range(10):
                chain.update(row)
            before = tracemalloc.get_traced_memory()[0]
            for _ in range(calls):
                chain.update(row)
            after = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            start = tracemalloc.get_traced_memory()[0]
            result = chain.update(row)
            peak = tracemalloc.get_traced_memory()[1] - start
        finally:
            tracemalloc.stop()
    arrays = result.flags.nbytes + result.envelope.nbytes + result.level.nbytes
    return max(0, after - before) / calls, peak - arrays


def measure_channels(sizes: SpeedSizes) -> dict[str, Any]:
    """Measure the chain on 16 to 10,000 channels in groups of four."""
    passes = []
    for n in CHANNEL_COUNTS:
        groups = {f'g{i}': tuple(range(4 * i + 1, 4 * i + 5)) for i in range(n // 4)}
        chain = SlipChain(ChainConfig(channels=n, groups=groups))
        passes.append(_pass_of(chain, swelling_noise_v(sizes.channel_samples // n, n)))
    times_s = least_times_s(passes, sizes.rounds)
    ns_per = {}
    for n, time_s in zip(CHANNEL_COUNTS, times_s, strict=True):
        ns_per[str(n)] = time_s / (sizes.channel_samples // n * n) * 1e9
    ratio = {n: ns / ns_per[str(CHANNEL_COUNTS[0])] for n, ns in ns_per.items()}
    return {
        'channel_samples': sizes.channel_samples,
        'rounds': sizes.rounds,
        'ns_per_channel_sample': ns_per,
        'ratio': ratio,
        'worst_ratio': max(ratio.values()),
    }


def _pass_of(chain: SlipChain, rows: Floats) -> Callable[[], None]:
    def run() -> None:
        chain.update(rows)

    return run
