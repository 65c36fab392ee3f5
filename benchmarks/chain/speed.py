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

"""How fast the chain is, against rivals that are measured in the same run.

:func:`measure_chain_speed` gives one object (keys of ``python -m benchmarks chain --json``):

``blocks``
    All stages on blocks of rows, from volts to decisions: ``rows``, ``channels``, ``rounds``,
    ``slip_share`` (of the rows), ``rows_per_call`` (where rows are given in pieces), and
    ``ns_per_row`` of each side. With all rows in one call the sides are ``chain``, ``kept`` (the
    chain with envelope and level kept) and ``numpy`` (SciPy and NumPy, an expression for each
    stage); in pieces ``chain_in_pieces``, ``kept_in_pieces``, ``median_in_pieces`` (with the
    median as common mode), ``evidence_in_pieces`` (the same filters with all that evidence has),
    ``in_place_in_pieces`` (NumPy without temporary arrays) and ``cpp_in_pieces``. From these
    follow ``speedup`` (against ``numpy``), ``in_place_speedup``,
    ``cpp_ratio`` (the run time as a multiple of that of C++; null without C++), and as multiples
    of the run time of decisions alone ``kept_ratio``, ``whole_kept_ratio`` (in one call),
    ``median_ratio`` and ``evidence_ratio``. ``cpp_left_out`` says why there is no C++,
    ``cpp_command`` how it was compiled. ``agreement`` is the share of equal decisions of each
    rival: ``numpy``, ``in_place`` and ``cpp``.
``one_row``
    One row per call against one bare ``scipy.signal.sosfilt``: ``channels``, ``calls``,
    ``rounds``, ``chain_us_per_call``, ``sosfilt_us_per_call``, ``speedup``; and the memory of a
    call beyond the arrays of its result: ``kept_bytes_per_call`` after it,
    ``peak_bytes_per_call`` during it (by number of channels) and
    ``temporary_bytes_per_channel``, by which the peak grows with each channel.
``channels``
    The chain with different numbers of channels, envelope and level kept: ``channel_samples`` of a
    call, ``rounds``, ``ns_per_channel_sample`` and its ``ratio`` to that of 16 channels (both by
    number of channels), the largest ratio ``worst_ratio``, and ``last_ratio``, that of the most
    channels.
``wanted``
    For each claim, by ``section.figure``: the measured ``value``, the ``bound`` as text and
    whether it is ``met``, null where nothing is judged.
"""

import argparse
import sys
import time
import tracemalloc
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from benchmarks.chain.block_speed import measure_blocks
from benchmarks.noise import swelling_noise_v
from benchmarks.processes import print_figures
from benchmarks.timing import garbage_collection_off, least_times_s
from benchmarks.verdicts import values_of, verdicts
from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.filters import design
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.figures import Bound
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]

#: The bounds that are wanted, by section and figure.
WANTED = {
    'blocks.speedup': Bound(low=10.0),
    'blocks.in_place_speedup': Bound(low=5.0),
    'blocks.cpp_ratio': Bound(high=0.7),
    'blocks.kept_ratio': Bound(high=1.5),
    'blocks.whole_kept_ratio': Bound(high=1.5),
    'blocks.median_ratio': Bound(high=2.0),
    'blocks.evidence_ratio': Bound(high=2.0),
    'one_row.speedup': Bound(low=11.0),
    'one_row.kept_bytes_per_call': Bound(high=1.0, strict=True),
    # A temporary array has at least one byte for each channel.
    'one_row.temporary_bytes_per_channel': Bound(high=1.0, strict=True),
    'channels.worst_ratio': Bound(high=1.5),
    'channels.last_ratio': Bound(high=0.8),
}


class SpeedSizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    rows : int
        Rows of 16 channels, for ``blocks``.
    channel_samples : int
        Samples of one call times channels, for ``channels``.
    calls : int
        Calls of one round, for ``one_row``.
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

CHANNEL_COUNTS = (16, 64, 1024, 10_000)


def measure_chain_speed(quick: bool = False) -> dict[str, Any]:
    """Measure the chain; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Measure few rows and rounds, and judge nothing.

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
        'blocks': measure_blocks(sizes.rows, sizes.rounds),
        'one_row': measure_one_row(sizes),
        'channels': measure_channels(sizes),
    }
    result['wanted'] = verdicts(WANTED, values_of(WANTED, result), judged=not quick)
    return result


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

    sides = [chain_calls, sosfilt_calls]
    chain_s, sosfilt_s = least_times_s(sides, sizes.one_row_rounds, time.thread_time)
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
        Number of channels of a row.
    calls
        Number of calls over which the kept bytes are averaged.

    Returns
    -------
    kept : float
        Bytes per call that are still allocated after the result is deleted.
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
    times_s = least_times_s(passes, sizes.rounds, time.thread_time)
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
        'last_ratio': ratio[str(CHANNEL_COUNTS[-1])],
    }


def _pass_of(chain: SlipChain, rows: Floats) -> Callable[[], None]:
    def run() -> None:
        chain.update(rows)

    return run


def main(arguments: list[str] | None = None) -> int:
    """Measure as a process of its own; return the exit code."""
    parser = argparse.ArgumentParser(description='Print the figures of the speed as one object.')
    parser.add_argument('--quick', action='store_true')
    words = parser.parse_args(arguments)
    return print_figures(lambda: measure_chain_speed(words.quick))


if __name__ == '__main__':
    sys.exit(main())
