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

"""The chain at extreme inputs: its results, the traces that inputs leave, and the run time."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.chain import reference
from benchmarks.chain.errors import (
    BASELINE_V,
    ROWS_PER_CALL,
    SWING_V,
    run_reference,
    tones_v,
    worst_error,
)
from benchmarks.chain.rivals import RUNNING_SUMS, WITH_RUNNING_SUMS, run
from benchmarks.timing import least_times_s
from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]

EXPONENTS = (1, 2, 3, 4, 5, 6)

#: Rows before an event, rows after it until no trace may be left (the slowest pole of the default
#: network, at a radius of 0.993, has decayed to 1e-23 by then), and last rows, which are compared.
EVENT_ROW, EVENT_ROWS, AFTER_ROWS = 500, 8500, 760

#: Rows after which a pulse has decayed to denormals in the default network.
DECAY_ROWS = 150_000


def extreme_inputs(rows: int) -> Iterator[dict[str, Any]]:
    """Yield the result of the chain on each extreme input.

    Parameters
    ----------
    rows
        Number of rows that the reference runs.

    Yields
    ------
    dict
        One object of ``extremes``, see :mod:`benchmarks.chain.precision`.
    """
    yield from _exponents(rows)
    yield from _events()
    yield from _rails()
    yield from _denormals(rows)
    yield from _limits(rows)


def _case(
    case: str,
    result: SlipResult,
    found: str = '',
    worst: float | None = None,
    others: dict[str, float | None] | None = None,
) -> dict[str, Any]:
    parts = (result.envelope, result.level)
    return {
        'case': case,
        'error': worst,
        'others': others or {},
        'finite': all(bool(np.isfinite(part).all()) for part in parts),
        'largest_level': float(result.level.max()),
        'found': found,
    }


def _compared_case(
    case: str, config: ChainConfig, samples: Floats, found: str = ''
) -> dict[str, Any]:
    result = SlipChain(config).update(samples[:, None])
    return _case(
        case, result, found, worst_error(result.level[:, 0], run_reference(config, samples).level)
    )


def _exponents(rows: int) -> Iterator[dict[str, Any]]:
    samples = tones_v(ChainConfig(channels=1), rows)[:, 0]
    filtered = reference.run_filter(reference.design(ChainConfig()), samples)
    for rectify in ('full', 'half'):
        for exponent in EXPONENTS:
            config = ChainConfig(channels=1, rectify=rectify, exponent=exponent)
            _, level = reference.envelope_and_level(filtered, config)
            result = SlipChain(config).update(samples[:, None])
            worst = worst_error(result.level[:, 0], reference.as_two(level))
            yield _case(f'exponent {exponent}, {rectify} wave', result, worst=worst)


def _events() -> Iterator[dict[str, Any]]:
    """Look for traces of a spike and a step after they have passed."""
    config = ChainConfig(channels=1)
    quiet = tones_v(config, EVENT_ROWS)[:, 0]
    for case, last_row in (
        ('spike of 1e6 V in one row, 19 s later', EVENT_ROW + 1),
        ('step of 1e6 V that stays, 19 s later', EVENT_ROWS),
    ):
        samples = quiet.copy()
        samples[EVENT_ROW:last_row] += 1e6
        near, rest = run_reference(config, samples).level
        after = near[-AFTER_ROWS:], rest[-AFTER_ROWS:]
        others = {}
        for name in (RUNNING_SUMS, 'sections float32', 'polynomials float64'):
            _, level = run(WITH_RUNNING_SUMS[name](config), samples[:, None], config)
            others[name] = worst_error(level[-AFTER_ROWS:, 0], after)
        result = SlipChain(config).update(samples[:, None])
        yield _case(
            case, result, f'the small signal after it: level {after[0].max():.2g}',
            worst_error(result.level[-AFTER_ROWS:, 0], after), others,
        )  # fmt: skip


def _rails() -> Iterator[dict[str, Any]]:
    config = ChainConfig(channels=1)
    for rail_v in (0.0, 4.3, 5.0):
        result = SlipChain(config).update(np.full((1000, 1), rail_v))
        flat_rows = config.samples(config.flat_after_s)
        out = bool(result.valid[:flat_rows].all() and not result.valid[flat_rows:].any())
        zero = bool((result.level == 0).all() and (result.envelope == 0).all())
        found = 'level exactly 0' if zero else 'level not 0'
        found += f', {"out of" if out else "NOT out of"} the vote after {config.flat_after_s:g} s'
        yield _case(f'constant {rail_v:g} V', result, found, 0.0 if zero else None)


def _denormals(rows: int) -> Iterator[dict[str, Any]]:
    for swing_v, exponent in ((1e-100, 1), (1e-24, 6), (1e-310, 1)):
        config = ChainConfig(channels=1, exponent=exponent)
        samples = swing_v * (tones_v(config, rows)[:, 0] - BASELINE_V) / SWING_V
        case = f'swing of {swing_v:g} V, exponent {exponent}'
        if swing_v > np.finfo(np.float64).tiny:
            yield _compared_case(case, config, samples)
            continue
        filtered = reference.run_filter(reference.design(config), samples)
        _, level = reference.envelope_and_level(filtered, config)
        result = SlipChain(config).update(samples[:, None])
        found = f'OFF; the level is {float(max(level)):.1g}, far below any threshold that is taken'
        yield _case(f'{case} (denormal)', result, found)
    chain = SlipChain(ChainConfig(channels=1))
    chain.update([[BASELINE_V], [BASELINE_V + 1.0]])
    result = chain.update(np.full((DECAY_ROWS if COMPILED else 20_000, 1), BASELINE_V))
    found = f'the level ends at {result.level[-1, 0]:g}'
    yield _case(f'a pulse of 1 V, {len(result.level):,} rows later', result, found)


def _limits(rows: int) -> Iterator[dict[str, Any]]:
    square = np.where(np.arange(rows) // 10 % 2 == 0, 1.0, -1.0)
    config = ChainConfig(channels=1)
    yield _compared_case('square wave of 1e9 V, limit of the range', config, 1e9 * square)
    config = ChainConfig(channels=1, valid_range_v=(-1e12, 1e12), gain=1e6, exponent=6)
    found = 'the most that parameters take: nothing overflows'
    yield _compared_case(
        'square wave of 1e12 V, gain 1e6, exponent 6', config, 1e12 * square, found
    )
    config = ChainConfig(channels=1)
    samples = tones_v(config, rows)[:, 0]
    held = samples.copy()
    bad = np.arange(rows) % 100 == 50
    samples[bad] = np.where(np.arange(bad.sum()) % 2 == 0, 1e60, np.nan)
    held[bad] = held[np.flatnonzero(bad) - 1]
    result = SlipChain(config).update(samples[:, None])
    marked = bool(np.array_equal(result.valid[:, 0], ~bad))
    found = (
        'those rows' + (' ' if marked else ' NOT ') + 'out of the vote, the last good value held'
    )
    worst = worst_error(result.level[:, 0], run_reference(config, held).level)
    yield _case('1e60 V and NaN in every 100th row', result, found, worst)


def denormal_slow_down(rounds: int) -> dict[str, float]:
    """Compare the time of rows that lead to denormals with that of ordinary ones.

    Returns
    -------
    dict
        ``denormal_input`` and ``decay_to_denormals``, as multiples of an ordinary row's time.
    """
    config = ChainConfig()
    rows = ROWS_PER_CALL if COMPILED else 256
    ordinary = tones_v(config, rows, config.channels)
    denormal = 1e-310 * (ordinary - BASELINE_V) / SWING_V
    still = np.full((rows, config.channels), BASELINE_V)
    chains = [SlipChain(config) for _ in range(3)]
    chains[2].update(ordinary)
    for _ in range(DECAY_ROWS // rows if COMPILED else 0):
        chains[2].update(still)

    def side(chain: SlipChain, samples: Floats) -> Callable[[], None]:
        def one_pass() -> None:
            chain.update(samples)

        return one_pass

    sides = [
        side(chain, samples)
        for chain, samples in zip(chains, (ordinary, denormal, still), strict=True)
    ]
    times_s = least_times_s(sides, 2 * rounds)
    return {
        'denormal_input': times_s[1] / times_s[0],
        'decay_to_denormals': times_s[2] / times_s[0],
    }
