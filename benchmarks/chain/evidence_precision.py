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

"""How exact the decision by evidence is, and its results on extreme inputs.

:func:`evidence_precision` gives the part ``evidence`` of :mod:`benchmarks.chain.precision`.
"""

from collections.abc import Iterator
from fractions import Fraction
from typing import Any

import mpmath  # type: ignore[import-untyped]
import numpy as np
from mpmath import mpf
from numpy.typing import NDArray

from benchmarks.chain import reference
from benchmarks.chain.errors import BASELINE_V, quantised, worst_error
from slip_detector.chain.compiled import LANES, compiled, load, store
from slip_detector.chain.slip_chain import SlipChain, SlipResult
from slip_detector.chain.stages import LEAST_EXCESS_DB, root_decibels
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]

#: Noise of a channel at rest, and its factor in a slide.
NOISE_V, SLIDE = 2e-3, 6.0

#: An hour at the paper's rate, and six minutes at the highest one.
LONG_SLIDES_S = {380.0: 3600.0, 1e5: 360.0}

ROWS_PER_CALL = 50_000

#: Rows before an event and after it, and the last ones, which are judged.
EVENT_ROW, EVENT_ROWS, AFTER_ROWS = 500, 8500, 760


@compiled
def _decibels(squares: Floats, out: Floats) -> None:
    for at in range(0, squares.size, LANES):
        store(root_decibels(load(squares, (at,))), out, (at,))  # type: ignore[no-untyped-call]


def evidence_config(rate_hz: float, **values: Any) -> ChainConfig:
    """Return a chain of one channel that decides by evidence, with a comb for 50 Hz."""
    given: dict[str, Any] = {
        'sample_rate_hz': rate_hz,
        'channels': 1,
        'passband_hz': (min(60.0, 0.2 * rate_hz), 0.0),
        'passband_degree': 2,
        'stopbands_hz': (),
        'gain': 1.0,
        'exponent': 1,
        'mains_hz': 50.0,
        'envelope_window_s': 0.05,
        'decision_window_s': 0.05,
        'flat_after_s': 0.0,
        'decision': 'evidence',
        'noise_floor': 1e-4,
        'threshold': 0.1,
    }
    return ChainConfig(**given | values)


def slide_v(rows: int) -> Floats:
    """Make one channel of noise that is louder in the middle third; exact in float32."""
    noise = np.random.default_rng(0).standard_normal(rows)
    noise[rows // 3 : 2 * rows // 3] *= SLIDE
    return BASELINE_V + quantised(NOISE_V * noise)


def evidence_precision(
    rates_hz: tuple[float, ...], fewest_rows: int, seconds: float, share: float
) -> dict[str, Any]:
    """Measure errors and drift of the evidence; the keys are in :mod:`benchmarks.chain.precision`.

    Parameters
    ----------
    rates_hz
        Sample rates.
    fewest_rows, seconds
        Least number of rows, and length, of the signal that the reference runs.
    share
        Share of the long slides that is run.
    """
    rates = [_rate(rate, max(fewest_rows, round(seconds * rate))) for rate in rates_hz]
    slides = [_long_slide(rate, share * slide_s) for rate, slide_s in LONG_SLIDES_S.items()]
    return {
        'logarithm_error_db': logarithm_error_db(),
        'rates': rates,
        'slides': slides,
        'extremes': list(evidence_extremes(share * LONG_SLIDES_S[380.0])),
        'level_error': max(entry['level_error'] for entry in rates),
        'drift_db': max(max(entry['floor_drift_db'], entry['drift_db_s']) for entry in slides),
    }


def logarithm_error_db() -> float:
    """Return the worst error of the kernel's logarithm against 50 digits, in dB of the root."""
    random = np.random.default_rng(0)
    squares = 2.0 ** random.uniform(-1022, 1023, 64 * LANES)
    # Random numbers, and those between 1 and 2: the error is the same in every octave.
    squares[: 32 * LANES] = np.linspace(1, 2, 32 * LANES, endpoint=False)
    found = np.empty_like(squares)
    _decibels(squares, found)
    with mpmath.workdps(reference.DIGITS):
        errors = [
            abs(mpf(mine) - 10 * mpmath.log10(mpf(square)))
            for square, mine in zip(squares.tolist(), found.tolist(), strict=True)
        ]
    return float(max(errors))


def _rate(rate_hz: float, rows: int) -> dict[str, Any]:
    """Compare floor, excess and evidence with the reference at one sample rate."""
    config = evidence_config(rate_hz)
    rows = max(rows, 4 * (config.mains_rows + config.samples(config.envelope_window_s)))
    samples = slide_v(rows)
    # Differences of samples are exact, as these are multiples of a power of two.
    combed = np.zeros(rows)
    combed[config.mains_rows :] = samples[config.mains_rows :] - samples[: -config.mains_rows]
    filtered = reference.run_filter(reference.design(config), combed)
    floors, excesses, levels, on = reference.evidence(filtered, config)
    result = SlipChain(config).update(samples[:, None], floor=True, excess=True)
    return {
        'sample_rate_hz': rate_hz,
        'rows': rows,
        'mains_rows': config.mains_rows,
        'floor_error_db': _absolute_error(result.floor[:, 0], floors),
        'excess_error_db': _absolute_error(result.excess[:, 0], excesses),
        'level_error': worst_error(result.level[:, 0], reference.as_two(levels)),
        'largest_level': float(max(levels)),
        'differing_decisions': int((result.channels[:, 0] != np.array(on)).sum()),
    }


def _absolute_error(values: Floats, wanted: list[Any]) -> float:
    near, rest = reference.as_two(wanted)
    return float(np.abs((values - near) - rest).max())


def _long_slide(rate_hz: float, slide_s: float) -> dict[str, Any]:
    """Let floor and evidence grow for long without bounds, and compare them with exact sums."""
    config = evidence_config(
        rate_hz, noise_floor=1e-9, noise_floor_learnt=True, noise_floor_range_db=300.0,
        noise_floor_rate_db_s=0.03, evidence_limit_db_s=1e6,
    )  # fmt: skip
    chain = SlipChain(config)
    block_rows = min(ROWS_PER_CALL, round(slide_s * rate_hz))
    block = slide_v(block_rows)[:, None]
    blocks = round(slide_s * rate_hz) // block_rows
    for _ in range(blocks):
        result = chain.update(block, floor=True, envelope=False)
    # The envelope is above the floor by more than the cap in all rows that count.
    rows = blocks * block_rows - config.mains_rows - config.samples(config.envelope_window_s)
    rate, gain = Fraction(rate_hz), Fraction(config.evidence_cap_db - config.evidence_offset_db)
    with mpmath.workdps(reference.DIGITS):
        least = 20 * mpmath.log10(mpf(config.noise_floors[0]))
        risen = rows * Fraction(config.noise_floor_rate_db_s) / rate
        floor = least + mpf(risen.numerator) / risen.denominator
        evidence = rows * gain / rate
        evidence = mpf(evidence.numerator) / evidence.denominator
        return {
            'sample_rate_hz': rate_hz,
            'rows': rows,
            'floor_drift_db': float(abs(mpf(float(result.floor[-1, 0])) - floor)),
            'drift_db_s': float(abs(mpf(float(result.level[-1, 0])) - evidence)),
            'evidence_db_s': float(evidence),
        }


def _case(case: str, config: ChainConfig, result: SlipResult, found: str) -> dict[str, Any]:
    """Return one object of ``extremes``; ``finite`` also requires that all bounds are kept."""
    parts = (result.envelope, result.level, result.floor, result.excess)
    finite = all(bool(np.isfinite(part).all()) for part in parts)
    least_db = float(20.0 * np.log10(config.noise_floors[0]))
    bounded = (
        result.level.min() >= 0.0
        and result.level.max() <= config.evidence_limit_db_s
        and result.excess.min() >= LEAST_EXCESS_DB
        and result.excess.max() <= config.evidence_cap_db
        and result.floor.min() >= least_db - 1e-9
        and result.floor.max() <= least_db + config.noise_floor_range_db + 1e-9
    )
    return {'case': case, 'finite': finite and bool(bounded), 'found': found}


def evidence_extremes(slide_s: float) -> Iterator[dict[str, Any]]:
    """Yield the results of the evidence on extreme inputs.

    Parameters
    ----------
    slide_s
        Length of the long slide.
    """
    quiet = slide_v(3 * 2000)[:, None][:2000]
    for case, samples, values, found in (
        ('rest of exact zeros', np.full((2000, 1), 4.3), {}, 'excess -8.7 dB, OFF'),
        ('swing of 1e-310 V (denormal)', 1e-310 * (quiet - BASELINE_V), {}, 'OFF'),
        ('swing of 1e-160 V, its square denormal', 1e-160 * (quiet - 4.25), {}, 'OFF'),
        (
            'the least floor that is taken, 1e-30', quiet, {'noise_floor': 1e-30},
            'as any other floor',
        ),
        (
            '1e12 V, gain 1e6, exponent 6', 1e12 * np.sign(quiet - BASELINE_V),
            {'valid_range_v': (-1e12, 1e12), 'gain': 1e6, 'exponent': 6, 'noise_floor': 1e30},
            'the most that parameters take: nothing overflows',
        ),
    ):  # fmt: skip
        config = evidence_config(380.0, **values)
        result = SlipChain(config).update(samples, floor=True, excess=True)
        said = found.replace('OFF', 'NOT OFF' if result.channels.any() else 'OFF')
        yield _case(case, config, result, said)
    # With a constant floor, the excess shows all that is left of an event.
    config = evidence_config(
        380.0, noise_floor=1e-3, noise_floor_learnt=True, noise_floor_rate_db_s=0.0
    )
    calm_v = slide_v(3 * EVENT_ROWS)[:EVENT_ROWS, None]
    calm = SlipChain(config).update(calm_v, excess=True)
    for case, last_row in (
        ('spike of 1e6 V in one row, 19 s later', EVENT_ROW + 1),
        ('step of 1e6 V that stays, 19 s later', EVENT_ROWS),
    ):
        samples = calm_v.copy()
        samples[EVENT_ROW:last_row] += 1e6
        result = SlipChain(config).update(samples, floor=True, excess=True)
        error = np.abs(result.excess - calm.excess)[-AFTER_ROWS:].max()
        found = f'the excess differs by {error:.1g} dB from that without it'
        yield _case(case, config, result, found)
    config = evidence_config(380.0)
    rows = round(slide_s * 380.0)
    slide = slide_v(3 * rows)[rows : 2 * rows, None]
    result = SlipChain(config).update(slide, floor=True, excess=True)
    ended = float(result.level[-1, 0])
    found = f'the evidence ends at {ended:.3g} dB s, the floor {result.floor[-1, 0]:.1f} dB'
    yield _case(f'a slide of {slide_s:,.0f} s', config, result, found)
    try:
        evidence_config(380.0, noise_floor=0.0)
    except ValueError as problem:
        found = f'refused: {problem}'
        yield {'case': 'a noise floor of 0', 'finite': True, 'found': found}
