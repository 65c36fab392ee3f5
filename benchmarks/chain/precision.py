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

"""How exact the chain is: its error against 50 digits, and those of its rivals.

The reference is :mod:`benchmarks.chain.reference`. An error is the largest difference of the level
(the windowed mean that is compared with the threshold) over the rows, as a share of the largest
level. Samples are multiples of 2**-18 V near 4.25 V: float32 represents them exactly, so that all
errors come from the design and the arithmetic.

The rivals are SciPy's ``sosfilt`` and ``lfilter`` on the same filters, in float64 and in float32
(coefficients, samples, windows).

:func:`measure_chain_precision` gives one object (key ``precision`` of
``python -m benchmarks chain --json``):

``rates``
    One object for each sample rate: ``sample_rate_hz``, ``rows``, ``errors`` of ``chain`` and
    rivals, huge where a result is not finite, and their run times ``ns_per_row`` for 16 channels,
    measured in turns.
``edges``
    The same for the paper's bands scaled down to lower and lower edges, with the lowest edge's
    share ``edge_share`` of the sample rate and ``refused``: the line with which the configuration
    is refused, else empty.
``long_run``
    Errors of the chain in a periodic signal, by the number of rows after which they are taken over
    the last period, against the steady state.
``extremes``
    Error of the chain by case.
``evidence``
    Of the decision by evidence, for each sample rate: ``rows``, the worst ``floor_error_db`` and
    ``excess_error_db``, the ``level_error`` as a share of the largest level (evidence in dB s) and
    ``differing_decisions``.
``rates_error``, ``edges_error``, ``long_run_error``, ``extremes_error``, ``evidence_error``
    The largest errors of the chain in these parts.
"""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.chain import reference
from benchmarks.chain.rivals import scipy_levels
from benchmarks.measurement import least_times_s
from slip_detector.chain.filters import design, largest_pole_radius
from slip_detector.chain.samples import Floats
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.compiled import COMPILED
from slip_detector.parameters import ChainConfig

#: Numbers, each the sum of two float64.
Exact = tuple[Floats, Floats]

#: Samples are multiples of a step; tones swing by this.
BASELINE_V, STEP_V, SWING_V = 4.25, 2.0**-18, 0.02

#: Noise of a channel at rest, and its factor in a slide.
NOISE_V, SLIDE = 2e-3, 6.0

#: Forms of the filters and types of all numbers of the rivals.
RIVALS = {
    'sections float32': ('sos', np.float32),
    'polynomials float64': ('ba', np.float64),
    'polynomials float32': ('ba', np.float32),
}

#: Rows of one period: the tones in it are multiples of 3.8 Hz at 380 Hz.
PERIOD_ROWS = 100

#: Rows before an event, rows after it until no trace may be left (the slowest pole of the default
#: network, at a radius of 0.993, has decayed to 1e-23 by then), and last rows, which are compared.
EVENT_ROW, EVENT_ROWS, AFTER_ROWS = 500, 8500, 760

#: Bands for rates at which the paper's do not fit: 50 Hz is at or above half the sample rate, and
#: at 100 kHz the edge at 0.5 Hz is too low to be accepted.
RATES: dict[float, dict[str, Any]] = {
    50.0: {'passband_hz': (7.0, 20.0), 'stopbands_hz': ((0.5, 7.0),)},
    100.0: {'passband_hz': (7.0, 40.0), 'stopbands_hz': ((0.5, 7.0),)},
    380.0: {},
    1e3: {},
    1e4: {},
    1e5: {'stopbands_hz': ((1.0, 7.0), (50.0, 180.0))},
}

#: Lowest edge as a share of the sample rate; the last one is refused.
EDGE_SHARES = (1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 0.99e-5)


def measure_chain_precision(quick: bool = False) -> dict[str, Any]:
    """Measure errors; the keys are in the module's docstring."""
    quick = quick or not COMPILED
    fewest, most = (600, 1500) if quick else (2000, 50_000)
    rows = {
        rate_hz: fewest if quick else max(fewest, round(0.4 * rate_hz))
        for rate_hz in (RATES if not quick else (50.0, 380.0))
    }
    rates = [
        errors_of(ChainConfig(sample_rate_hz=rate_hz, channels=1, **RATES[rate_hz]), n)
        | {'ns_per_row': ns_per_row(ChainConfig(sample_rate_hz=rate_hz, **RATES[rate_hz]), quick)}
        for rate_hz, n in rows.items()
    ]
    shares = (1e-3, 0.99e-5) if quick else EDGE_SHARES
    edges = [_edge(share, fewest, most) for share in shares]
    long = long_run((10**4,) if quick else (10**4, 10**6, 10**8))
    extreme = dict(extremes(fewest))
    evidence = [evidence_errors(rate_hz, n) for rate_hz, n in rows.items()]
    return {
        'rates': rates,
        'edges': edges,
        'long_run': long,
        'extremes': extreme,
        'evidence': evidence,
        'rates_error': max(entry['errors']['chain'] for entry in rates),
        'edges_error': max(entry['errors']['chain'] for entry in edges if not entry['refused']),
        'long_run_error': max(long.values()),
        'extremes_error': max(extreme.values()),
        'evidence_error': max(entry['level_error'] for entry in evidence),
    }


def quantised(signals: Floats) -> Floats:
    """Round to multiples of ``STEP_V``."""
    return np.round(signals / STEP_V) * STEP_V


def tones_v(config: ChainConfig, rows: int, channels: int = 1) -> Floats:
    """Make tones inside the pass-band, with noise, that swell and fade; exact in float32."""
    random = np.random.default_rng(0)
    low, high = config.passband_hz
    time_s = np.arange(rows)[:, None] / config.sample_rate_hz
    tones = sum(
        np.sin(2 * np.pi * (time_s * tone_hz + random.random(channels)))
        for tone_hz in (1.2 * low, np.sqrt(low * high), 0.9 * high)
    )
    swell = 0.55 - 0.45 * np.cos(6 * np.pi * np.arange(rows) / rows)[:, None]
    noise = random.standard_normal((rows, channels))
    return BASELINE_V + quantised(SWING_V * swell * (tones / 3 + noise / 4))


def exact_level(config: ChainConfig, samples: Floats) -> Exact:
    """Run the reference on one channel."""
    filtered = reference.run_filter(reference.design(config), samples)
    return reference.as_two(reference.envelope_and_level(filtered, config)[1])


def worst_error(values: NDArray[Any], wanted: Exact) -> float:
    """Return the worst difference as a share of the largest value; huge if it is not finite.

    Examples
    --------
    >>> worst_error(np.array([1.0, 4.5]), (np.array([1.0, 4.0]), np.zeros(2)))
    0.125
    """
    near, rest = wanted
    difference = np.abs((values.astype(np.float64) - near) - rest).max()
    return float(np.nan_to_num(difference / (near.max() or 1.0), nan=np.finfo(float).max))


def errors_of(config: ChainConfig, rows: int) -> dict[str, Any]:
    """Compare all methods with the reference in one configuration of one channel."""
    samples = tones_v(config, rows)
    wanted = exact_level(config, samples[:, 0])
    level = SlipChain(config).update(samples).level[:, 0]
    errors = {'chain': worst_error(level, wanted)}
    for name, form in RIVALS.items():
        errors[name] = worst_error(scipy_levels(config, samples, *form)[:, 0], wanted)
    return {
        'sample_rate_hz': config.sample_rate_hz,
        'rows': rows,
        'errors': errors,
    }


def ns_per_row(config: ChainConfig, quick: bool) -> dict[str, float]:
    """Measure the run times of all methods in turns, for 16 channels."""
    rows, chain = (2_000 if quick else 50_000), SlipChain(config)
    samples = tones_v(config, rows, config.channels)
    sides: dict[str, Callable[[], object]] = {'chain': lambda: chain.update(samples)}
    for name, form in RIVALS.items():
        sides[name] = partial(scipy_levels, config, samples, *form)
    times_s = least_times_s(list(sides.values()), 1 if quick else 5, time.thread_time)
    return {name: 1e9 * taken_s / rows for name, taken_s in zip(sides, times_s, strict=True)}


def _edge(share: float, fewest: int, most: int) -> dict[str, Any]:
    """Measure the whole default network scaled down to a lowest edge, or why it is refused."""
    # Rounded up in the last place: 1e-5 of the rate is the lowest edge that is allowed.
    edge_hz = float(np.nextafter(share * 380.0, np.inf))
    passband_hz = 14 * edge_hz, 100 * edge_hz
    stopbands_hz = (edge_hz, passband_hz[0]), (passband_hz[1], 360 * edge_hz)
    try:
        config = ChainConfig(channels=1, passband_hz=passband_hz, stopbands_hz=stopbands_hz)
        radius = largest_pole_radius(design(config))
    except ValueError as problem:
        return {'edge_share': share, 'refused': str(problem)}
    # Four time constants of the slowest pole.
    rows = int(np.clip(4 / (1 - radius), fewest, most))
    return {'edge_share': share, 'refused': ''} | errors_of(config, rows)


def long_run(long_rows: tuple[int, ...]) -> dict[int, float]:
    """Run a periodic signal for very long and compare its last period with the steady state.

    At a radius of 0.993 the reference has reached that after 10,000 rows, to 1e-30.
    """
    config = ChainConfig(channels=1)
    random = np.random.default_rng(0)
    turns = np.arange(PERIOD_ROWS)[:, None] * np.array([2, 5, 11]) / PERIOD_ROWS
    period = np.sin(2 * np.pi * (turns + random.random(3))).mean(axis=1)
    period = BASELINE_V + quantised(SWING_V * period)
    block = np.tile(period, 10_000 // PERIOD_ROWS)[:, None]
    near, rest = exact_level(config, block[:, 0])
    wanted = near[-PERIOD_ROWS:], rest[-PERIOD_ROWS:]
    chain, errors, done = SlipChain(config), {}, 0
    for rows in long_rows:
        while done < rows:
            last = chain.update(block).level[-PERIOD_ROWS:, 0]
            done += len(block)
        errors[rows] = worst_error(last, wanted)
    return errors


def extremes(rows: int) -> Iterator[tuple[str, float]]:
    """Yield the error of the chain on each extreme input, against the reference."""

    def error(samples: Floats, last: int = 0, held: Floats | None = None, **values: Any) -> Any:
        config = ChainConfig(channels=1, **values)
        level = SlipChain(config).update(samples[:, None]).level[-last:, 0]
        near, rest = exact_level(config, samples if held is None else held)
        return worst_error(level, (near[-last:], rest[-last:]))

    tones = tones_v(ChainConfig(channels=1), rows)[:, 0]
    for exponent in (1, 2, 3, 6):
        for rectify in ('full', 'half'):
            found = error(tones, rectify=rectify, exponent=exponent)
            yield f'exponent {exponent}, {rectify} wave', found
    quiet = tones_v(ChainConfig(channels=1), EVENT_ROWS)[:, 0]
    for case, rows_long in (('spike of 1e6 V in one row', 1), ('step of 1e6 V', EVENT_ROWS)):
        samples = quiet.copy()
        samples[EVENT_ROW : EVENT_ROW + rows_long] += 1e6
        yield f'{case}, 19 s later', error(samples, AFTER_ROWS)
    yield 'constant 4.3 V', error(np.full(1000, 4.3))
    swing = (tones - BASELINE_V) / SWING_V
    yield 'swing of 1e-100 V, exponent 1', error(1e-100 * swing, exponent=1)
    yield 'swing of 1e-24 V, exponent 6', error(1e-24 * swing, exponent=6)
    square = np.where(np.arange(rows) // 10 % 2 == 0, 1.0, -1.0)
    yield 'square wave of 1e9 V, limit of the range', error(1e9 * square)
    most: dict[str, Any] = {'valid_range_v': (-1e12, 1e12), 'gain': 1e6, 'exponent': 6}
    yield 'square wave of 1e12 V, gain 1e6, exponent 6', error(1e12 * square, **most)
    samples, held, bad = tones.copy(), tones.copy(), np.arange(50, rows, 100)
    samples[bad] = np.resize([1e60, np.nan], bad.size)
    held[bad] = held[bad - 1]
    yield '1e60 V and NaN in every 100th row', error(samples, held=held)


# --- evidence ------------------------------------------------------------------------------


def evidence_config(rate_hz: float, **values: Any) -> ChainConfig:
    """Return a chain of one channel that decides by evidence, with a comb for 50 Hz."""
    given: dict[str, Any] = {
        'passband_hz': (min(60.0, 0.2 * rate_hz), 0.0), 'passband_degree': 2, 'stopbands_hz': (),
        'gain': 1.0, 'exponent': 1, 'mains_hz': 50.0, 'envelope_window_s': 0.05,
        'flat_after_s': 0.0, 'noise_floor': 1e-4, 'threshold': 0.1,
    }  # fmt: skip
    given |= {'sample_rate_hz': rate_hz, 'channels': 1, 'decision': 'evidence'}
    return ChainConfig(**given | values)


def slide_v(rows: int) -> Floats:
    """Make one channel of noise that is louder in the middle third; exact in float32."""
    noise = np.random.default_rng(0).standard_normal(rows)
    noise[rows // 3 : 2 * rows // 3] *= SLIDE
    return BASELINE_V + quantised(NOISE_V * noise)


def evidence_errors(rate_hz: float, rows: int, **values: Any) -> dict[str, Any]:
    """Compare floor, excess and evidence with the reference at one sample rate."""
    config = evidence_config(rate_hz, **values)
    rows = max(rows, 4 * (config.mains_rows + config.samples(config.envelope_window_s)))
    samples = slide_v(rows)
    # Differences of samples are exact, as these are multiples of a power of two.
    combed = np.zeros(rows)
    combed[config.mains_rows :] = samples[config.mains_rows :] - samples[: -config.mains_rows]
    filtered = reference.run_filter(reference.design(config), combed)
    floors, excesses, levels, on = reference.evidence(filtered, config)
    result = SlipChain(config).update(samples[:, None], floor=True, excess=True)

    def error_db(found: Floats, wanted: list[Any]) -> float:
        near, rest = reference.as_two(wanted)
        return float(np.abs((found[:, 0] - near) - rest).max())

    return {
        'sample_rate_hz': rate_hz,
        'rows': rows,
        'floor_error_db': error_db(result.floor, floors),
        'excess_error_db': error_db(result.excess, excesses),
        'level_error': worst_error(result.level[:, 0], reference.as_two(levels)),
        'differing_decisions': int((result.channels[:, 0] != np.array(on)).sum()),
    }
