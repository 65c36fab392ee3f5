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

"""How exact the chain is: its error against 50 digits, and those of its rivals, with run times.

The reference is :mod:`benchmarks.chain.reference`. An error is the largest difference of the level
(the windowed mean that is compared with the threshold) over the rows, as a share of the largest
level. Samples are multiples of 2**-18 V near 4.25 V: float32 represents them exactly, so that all
errors come from the design and the arithmetic.

The methods: ``chain`` is :class:`slip_detector.chain.slip_chain.SlipChain`; ``sections`` and
``polynomials`` are SciPy's ``sosfilt`` and ``lfilter`` on the same filters, in float64 and in
float32 (coefficients, samples, windows), with windows summed as the chain sums them.
``running sums`` is ``sections`` with windows as they are often written: add the new term, subtract
the old one. A method is ``unstable`` where a pole of its coefficients, as they are stored, is not
inside the unit circle, and ``lost`` where its error exceeds a tenth.

:func:`measure_chain_precision` gives one object (key ``precision`` of
``python -m benchmarks chain --json``):

``digits``
    Number of decimal digits of the reference.
``rates``
    One object for each sample rate: ``sample_rate_hz``, ``passband_hz``, ``stopbands_hz``,
    ``rows``, ``largest_pole_radius``, ``run_error`` (of the chain against its own float64
    coefficients run in 50 digits: the error without that of the design) and ``methods``. For each
    method, by its name, these are ``error``, ``envelope_error`` (null where a result is not
    finite), ``differing_decisions`` (rows that are ON in one and OFF in the other, with the
    median level as the threshold), ``state`` (``unstable``, ``lost`` or empty) and ``ns_per_row``
    of 16 channels.
``rates_note``
    Why the bands differ from the defaults.
``edges``
    The same without times, for bands at lower and lower edges, with ``network`` (which bands),
    ``lowest_edge_hz``, its share ``edge_share`` of the sample rate and ``refused``: the line with
    which the configuration is refused, else empty.
``long_run``
    A periodic signal: ``period_rows``; ``rows`` after which errors are taken over the last period,
    against the steady state; and in ``methods``, by the method's name, these ``errors``.
``extremes``
    One object for each case: ``case``, ``error`` of the chain (null where it has no meaning),
    ``others`` (errors of the rivals by name, where there are any), ``finite`` (whether all results
    are), ``largest_level`` and ``found``, what was found in words.
``slow_down``
    Time for a row of a ``denormal_input`` and of a ``decay_to_denormals``, as a multiple of that
    for an ordinary row.
``evidence``
    Of the decision by evidence (:mod:`benchmarks.chain.evidence_precision`):
    ``logarithm_error_db``, the worst error of the kernel's logarithm; ``rates``, for each sample
    rate ``rows``, ``mains_rows``, the worst ``floor_error_db`` and ``excess_error_db``, the
    ``level_error`` as a share of the ``largest_level`` (evidence in dB s) and
    ``differing_decisions``; ``slides``, for each rate floor and evidence that grow for ``rows``
    without a bound, against exact sums: ``floor_drift_db``, ``drift_db_s`` and what the evidence
    grows to, ``evidence_db_s``. ``level_error`` and ``drift_db`` are the worst of these.
    ``extremes`` are ``case``, ``finite`` (and all within its bounds) and ``found``.
``wanted``
    As in :mod:`benchmarks.chain.speed`; ``rates.error``, ``edges.error``, ``long_run.error`` and
    ``extremes.error`` are the largest errors of the chain there;
    ``evidence.logarithm_error_db``, ``evidence.level_error`` and ``evidence.drift_db`` are those
    of ``evidence``.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.chain import reference
from benchmarks.chain.errors import (
    BASELINE_V,
    ROWS_PER_CALL,
    SWING_V,
    ReferenceResult,
    quantised,
    run_reference,
    tones_v,
    worst_error,
)
from benchmarks.chain.evidence_precision import evidence_precision
from benchmarks.chain.extreme_inputs import denormal_slow_down, extreme_inputs
from benchmarks.chain.rivals import (
    METHODS,
    RUNNING_SUMS,
    WITH_RUNNING_SUMS,
    Method,
    PackageChain,
    run,
)
from benchmarks.timing import least_times_s
from benchmarks.verdicts import verdicts
from slip_detector.chain.compiled import COMPILED
from slip_detector.chain.filters import design, largest_pole_radius
from slip_detector.evaluation.figures import Bound
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]

#: What is wanted of the chain.
WANTED = {
    'rates.error': Bound(high=1e-8),
    'edges.error': Bound(high=1e-7),
    'long_run.error': Bound(high=1e-12),
    'extremes.error': Bound(high=1e-6),
    'evidence.logarithm_error_db': Bound(high=0.01),
    'evidence.level_error': Bound(high=1e-4),
    'evidence.drift_db': Bound(high=1e-5),
}

#: Relative error at which not one digit is right.
LOST = 0.1

TIMED_CHANNELS = 16

#: Rows of one period: the tones in it are multiples of 3.8 Hz at 380 Hz.
PERIOD_ROWS = 100

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


class PrecisionSizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    rates_hz : tuple of float
        Keys of ``RATES``.
    edge_shares : tuple of float
        Shares as in ``EDGE_SHARES``.
    fewest_rows, most_rows : int
        Least and largest number of rows that the reference runs.
    seconds : float
        Length of the signal that the reference runs at high rates.
    long_run_rows : tuple of int
        Numbers of rows of the long run after which its error is taken.
    slide_share : float
        Share of the long slides that is run.
    timed_rows : int
        Number of rows of 16 channels whose time is taken.
    rounds : int
        How often the sides take turns.
    """

    rates_hz: tuple[float, ...]
    edge_shares: tuple[float, ...]
    fewest_rows: int
    most_rows: int
    seconds: float
    long_run_rows: tuple[int, ...]
    slide_share: float
    timed_rows: int
    rounds: int


FULL = PrecisionSizes(
    tuple(RATES), EDGE_SHARES, 2000, 50_000, 0.4, (10**4, 10**6, 10**8), 1.0, 16_384, 40
)

QUICK = PrecisionSizes(
    (50.0, 380.0, 1e4), (1e-3, 1e-5, 0.99e-5), 600, 1500, 0.1, (10**4, 10**5), 0.01, 4096, 2
)  # fmt: skip

#: Without Numba the chain takes some 500 times as long.
INTERPRETED: dict[str, Any] = {
    'long_run_rows': (10_000, 30_000), 'slide_share': 2e-4, 'timed_rows': 4096, 'rounds': 1,
}  # fmt: skip


def method_errors(
    method: Method, samples: Floats, config: ChainConfig, wanted: ReferenceResult
) -> dict[str, Any]:
    """Run a method on one channel and compare it with the reference."""
    envelope, level = (part[:, 0] for part in run(method, samples[:, None], config))
    worst = worst_error(level, wanted.level)
    # Between two levels: at a level itself, rounding errors would decide about its row.
    middle = len(level) // 2
    threshold = np.sort(wanted.level[0])[middle - 1 : middle + 1].mean()
    state = ''
    if not method.is_stable():
        state = 'unstable'
    elif worst is None or worst > LOST:
        state = 'lost'
    return {
        'error': worst,
        'envelope_error': worst_error(envelope, wanted.envelope),
        'differing_decisions': int(((level > threshold) != (wanted.level[0] > threshold)).sum()),
        'state': state,
    }


def measure_chain_precision(quick: bool = False) -> dict[str, Any]:
    """Measure errors and run times; the keys are in the module's docstring.

    Parameters
    ----------
    quick
        Fewer rates and edges, and fewer rows.
    """
    sizes = QUICK if quick else FULL
    if not COMPILED:
        sizes = sizes._replace(**INTERPRETED)
    try:
        ChainConfig(sample_rate_hz=1e5)
        refused = ''
    except ValueError as problem:
        refused = str(problem)
    result: dict[str, Any] = {
        'digits': reference.DIGITS,
        'rates': [_rate(rate_hz, sizes) for rate_hz in sizes.rates_hz],
        'rates_note': "At 50 and 100 Hz the paper's 50 Hz is not below half the sample rate. At "
        f'100 kHz its lowest edge is refused: {refused}.',
        'edges': [
            _edge(network, share, sizes) for network in NETWORKS for share in sizes.edge_shares
        ],
        'long_run': long_run(sizes),
        'extremes': list(extreme_inputs(sizes.fewest_rows)),
        'evidence': evidence_precision(
            sizes.rates_hz, sizes.fewest_rows, sizes.seconds, sizes.slide_share
        ),
        'slow_down': denormal_slow_down(sizes.rounds),
    }
    worst = {
        'rates.error': [entry['methods']['chain']['error'] for entry in result['rates']],
        'edges.error': [
            entry['methods']['chain']['error'] for entry in result['edges'] if not entry['refused']
        ],
        'long_run.error': result['long_run']['methods']['chain']['errors'],
        'extremes.error': [
            entry['error'] for entry in result['extremes'] if entry['error'] is not None
        ],
    }
    for figure in ('logarithm_error_db', 'level_error', 'drift_db'):
        worst[f'evidence.{figure}'] = [result['evidence'][figure]]
    result['wanted'] = verdicts(WANTED, {name: max(errors) for name, errors in worst.items()})
    return result


def _rate(rate_hz: float, sizes: PrecisionSizes) -> dict[str, Any]:
    config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **RATES[rate_hz])
    entry = errors_of(config, max(sizes.fewest_rows, round(sizes.seconds * rate_hz)))
    for name, time_ns in times_ns(config, sizes).items():
        entry['methods'][name]['ns_per_row'] = time_ns
    return entry


def errors_of(config: ChainConfig, rows: int) -> dict[str, Any]:
    """Compare all methods with the reference in one configuration."""
    sections = design(config)
    samples = tones_v(config, rows)[:, 0]
    wanted = run_reference(config, samples)
    same_design = run_reference(config, samples, reference.exactly(sections))
    _, level = run(PackageChain(config), samples[:, None], config)
    return {
        'sample_rate_hz': config.sample_rate_hz,
        'passband_hz': config.passband_hz,
        'stopbands_hz': config.stopbands_hz,
        'rows': rows,
        'largest_pole_radius': largest_pole_radius(sections),
        'run_error': worst_error(level[:, 0], same_design.level),
        'methods': {
            name: method_errors(make(config), samples, config, wanted)
            for name, make in METHODS.items()
        },
    }


def times_ns(config: ChainConfig, sizes: PrecisionSizes) -> dict[str, float]:
    """Measure the time of each method for a row of 16 channels, in blocks that fit the cache."""
    config = ChainConfig(
        sample_rate_hz=config.sample_rate_hz,
        passband_hz=config.passband_hz,
        stopbands_hz=config.stopbands_hz,
        channels=TIMED_CHANNELS,
    )
    window = config.samples(config.envelope_window_s)
    piece = -(-ROWS_PER_CALL // window) * window
    pieces = [
        tones_v(config, piece, TIMED_CHANNELS, seed)
        for seed in range(max(1, sizes.timed_rows // piece))
    ]

    def side(method: Method) -> Callable[[], None]:
        def passes() -> None:
            with np.errstate(all='ignore'):
                for rows in pieces:
                    method.update(rows)

        return passes

    # An unstable method overflows soon, which does not change its run time.
    sides = [side(make(config)) for make in METHODS.values()]
    rows = piece * len(pieces)
    times_s = least_times_s(sides, sizes.rounds)
    return {name: s / rows * 1e9 for name, s in zip(METHODS, times_s, strict=True)}


#: By name, a sample rate and a function that returns the bands for a lowest edge.
NETWORKS: dict[str, tuple[float, Callable[[float], dict[str, Any]]]] = {
    'the whole default network scaled down': (
        380.0,
        lambda edge_hz: {
            'passband_hz': (14 * edge_hz, 100 * edge_hz),
            'stopbands_hz': ((edge_hz, 14 * edge_hz), (100 * edge_hz, 360 * edge_hz)),
        },
    ),
    'pass-band from the edge to 200 Hz, stop-band 200-400 Hz': (
        1e5,
        lambda edge_hz: {'passband_hz': (edge_hz, 200.0), 'stopbands_hz': ((200.0, 400.0),)},
    ),
}


def _edge(network: str, share: float, sizes: PrecisionSizes) -> dict[str, Any]:
    """Measure with one lowest edge, or return why it is refused."""
    rate_hz, bands = NETWORKS[network]
    lead = {'network': network, 'lowest_edge_hz': share * rate_hz, 'edge_share': share}
    # Rounded up in the last place: 1e-5 of the rate is the lowest edge that is allowed.
    edge_hz = float(np.nextafter(share * rate_hz, np.inf))
    try:
        config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **bands(edge_hz))
        radius = largest_pole_radius(design(config))
    except ValueError as problem:
        return lead | {'sample_rate_hz': rate_hz, 'refused': str(problem), 'methods': {}}
    # Four time constants of the slowest pole.
    rows = int(np.clip(4 / (1 - radius), sizes.fewest_rows, sizes.most_rows))
    return lead | {'refused': ''} | errors_of(config, rows)


def long_run(sizes: PrecisionSizes) -> dict[str, Any]:
    """Run a periodic signal for very long and compare its last period with the steady state."""
    config = ChainConfig(channels=1)
    random = np.random.default_rng(0)
    row = np.arange(PERIOD_ROWS)
    turns = row[:, None] * np.array([2, 5, 11]) / PERIOD_ROWS + random.random(3)
    period = BASELINE_V + quantised(SWING_V * np.sin(2 * np.pi * turns).mean(axis=1))
    filtered = reference.run_periodic(reference.design(config), period)
    _, level = reference.envelope_and_level(filtered, config, before='same')
    wanted = reference.as_two(level)
    # Blocks have whole periods and whole windows; 300 rows is the shortest such length.
    block_rows = 300 * (min(150_000, sizes.long_run_rows[0]) // 300 + 1)
    block = np.tile(period, block_rows // PERIOD_ROWS)[:, None]
    methods = {}
    counted = [-(-rows // block_rows) * block_rows for rows in sizes.long_run_rows]
    names = ('chain', RUNNING_SUMS, 'sections float32', 'polynomials float64')
    for name in names:
        method = WITH_RUNNING_SUMS[name](config)
        errors = []
        done = 0
        for rows in counted:
            while done < rows:
                _, last = method.update(block)
                done += block_rows
            errors.append(worst_error(last[-PERIOD_ROWS:, 0], wanted))
        methods[name] = {'errors': errors}
    return {'period_rows': PERIOD_ROWS, 'rows': counted, 'methods': methods}
