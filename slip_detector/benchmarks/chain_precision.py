"""How exact the chain is: its error against 50 digits, beside its run time and its rivals'.

The reference is :mod:`slip_detector.benchmarks.chain_reference`. An error is the worst difference
of the level (the windowed mean that is held against the threshold) over the rows, as a share of
the largest level. Samples are multiples of 2**-18 V about 4.25 V, so that float32 holds them
exactly and errors are of the design and the arithmetic alone.

The methods: ``chain`` is :class:`slip_detector.chain.SlipChain`; ``sections`` and ``polynomials``
are SciPy's ``sosfilt`` and ``lfilter`` on the same filters, in float64 and in float32
(coefficients, samples, windows), with windows summed as the chain sums them. ``running sums`` is
``sections`` with windows as many write them: add the new term, take off the old one. A method is
``unstable`` where a pole of its coefficients, as they are stored, is not inside the unit circle,
and ``lost`` where its error exceeds a tenth.

:func:`measure` gives one object (key ``precision`` of ``slip_benchmark chain --json``):

``digits``
    Of the reference.
``rates``
    One object for each sample rate: ``sample_rate_hz``, ``passband_hz``, ``stopbands_hz``,
    ``rows``, ``largest_pole_radius``, ``run_error`` (of the chain, against the same float64
    coefficients run in 50 digits: what is left of the error is the design's) and ``methods``. By
    name of the method these are ``error``, ``envelope_error`` (null where not all that came out
    is finite), ``differing_decisions`` (rows that are ON in one and OFF in the other; the
    threshold is in the middle of the levels), ``state`` (``unstable``, ``lost`` or
    empty) and ``ns_per_row``, of 16 channels.
``rates_note``
    Why the bands differ from the defaults.
``edges``
    The same, without times, for bands that go down, with ``network`` (which bands),
    ``lowest_edge_hz``, its share ``edge_share`` of the sample rate and ``refused``: the line with
    which the configuration is refused, else empty.
``long_run``
    Errors over the last period after so many ``rows`` of a signal of ``period_rows`` rows, against
    its steady state: by name of the method in ``methods``, ``errors``.
``extremes``
    One object a case: ``case``, ``error`` of the chain (null where it has no meaning), ``others``
    (errors of its rivals by name, where they tell something), ``finite`` (all that came out),
    ``largest_level`` and ``found``, in words.
``slow_down``
    Time a row of ``denormal_input`` and of a ``decay_to_denormals``, as a multiple of an ordinary
    one.
``wanted``
    As in :mod:`slip_detector.benchmarks.chain_speed`: ``rates.error``, ``edges.error``,
    ``long_run.error`` and ``extremes.error`` are the chain's worst ones.
"""

import textwrap
import warnings
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray
from scipy import signal

from slip_detector.benchmark import Bound, least_times_s, verdicts
from slip_detector.benchmarks import chain_reference as reference
from slip_detector.chain import SlipChain, SlipResult
from slip_detector.compiled import COMPILED
from slip_detector.config import ChainConfig
from slip_detector.filters import design, largest_pole_radius

Floats = NDArray[np.float64]
#: Rows of one type or the other.
Reals = NDArray[Any]

#: What is wanted of the chain.
WANTED = {
    'rates.error': Bound('<=', 1e-8),
    'edges.error': Bound('<=', 1e-7),
    'long_run.error': Bound('<=', 1e-12),
    'extremes.error': Bound('<=', 1e-6),
}

BASELINE_V = 4.25
STEP_V = 2.0**-18
SWING_V = 0.02

#: An error of this much has no right digit.
LOST = 0.1

TIMED_CHANNELS = 16
#: NumPy is fastest with about so many rows a call.
ROWS_PER_CALL = 4096

#: Rows of one period: the tones in it are multiples of 3.8 Hz at 380 Hz.
PERIOD_ROWS = 100

#: Bands where the paper's do not fit: 50 Hz is at or above half the sample rate, and at 100 kHz
#: the edge at 0.5 Hz is too low to be accepted.
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

EXPONENTS = (1, 2, 3, 4, 5, 6)


class Sizes(NamedTuple):
    """How much is measured.

    Attributes
    ----------
    rates_hz : tuple of float
        Of ``RATES``.
    edge_shares : tuple of float
        Of ``EDGE_SHARES``.
    fewest_rows, most_rows : int
        That the reference runs.
    seconds : float
        That it runs at a high rate.
    long_run_rows : tuple of int
        After which the error is noted.
    timed_rows : int
        Of 16 channels.
    rounds : int
        How often the sides take turns.
    """

    rates_hz: tuple[float, ...]
    edge_shares: tuple[float, ...]
    fewest_rows: int
    most_rows: int
    seconds: float
    long_run_rows: tuple[int, ...]
    timed_rows: int
    rounds: int


FULL = Sizes(tuple(RATES), EDGE_SHARES, 2000, 50_000, 0.4, (10**4, 10**6, 10**8), 16_384, 40)
QUICK = Sizes(
    (50.0, 380.0, 1e4), (1e-3, 1e-5, 0.99e-5), 600, 1500, 0.1, (10**4, 10**5), 4096, 2
)  # fmt: skip
#: Without Numba the chain takes some 500 times as long.
INTERPRETED: dict[str, Any] = {
    'long_run_rows': (10_000, 30_000), 'timed_rows': 4096, 'rounds': 1,
}  # fmt: skip


class Plain:
    """The chain's stages as a user of SciPy and NumPy would write them: a rival.

    Parameters
    ----------
    config
        The chain's.
    form
        ``sections`` or ``polynomials``.
    kind
        Type of all numbers: float64 or float32.
    running
        Whether windows are running sums; else sums of terms only, like the chain's.
    """

    def __init__(
        self, config: ChainConfig, form: str, kind: DTypeLike, running: bool = False
    ) -> None:
        self._config, self._kind, self._running = config, np.dtype(kind), running
        rate, shape = config.sample_rate_hz, {'sections': 'sos', 'polynomials': 'ba'}[form]
        low, high = config.passband_hz
        with warnings.catch_warnings():
            warnings.simplefilter('ignore')  # what SciPy thinks of the polynomials
            filters = [
                signal.butter(
                    config.passband_degree // 2, [low, high], 'bandpass', output=shape, fs=rate
                )
            ]
            filters += [
                signal.ellip(
                    config.stopband_degree // 2, config.stopband_ripple_db,
                    config.stopband_attenuation_db, pair, 'bandstop', output=shape, fs=rate,
                )
                for pair in config.stopbands_hz
            ]  # fmt: skip
        if form == 'sections':
            filters[0][0, :3] *= config.gain
        else:
            filters[0] = (config.gain * filters[0][0], filters[0][1])
        channels = config.channels
        self._stages: list[tuple[Callable[..., Any], tuple[Reals, ...], Reals]] = []
        for one in filters:
            if form == 'sections':
                coefficients: tuple[Reals, ...] = (one.astype(self._kind),)
                delays = np.zeros((len(one), 2, channels), self._kind)
                self._stages.append((signal.sosfilt, coefficients, delays))
            else:
                coefficients = tuple(part.astype(self._kind) for part in one)
                delays = np.zeros((len(one[1]) - 1, channels), self._kind)
                self._stages.append((signal.lfilter, coefficients, delays))
        self._windows = [
            np.zeros((config.samples(seconds), channels), self._kind)
            for seconds in (config.envelope_window_s, config.decision_window_s)
        ]
        self._sums = np.zeros((2, channels), self._kind)
        self._first: Reals | None = None

    def is_stable(self) -> bool:
        """Return whether all poles of the coefficients, as stored, are inside the circle."""
        for _, coefficients, _ in self._stages:
            sections = len(coefficients) == 1
            rows = coefficients[0][:, 3:] if sections else coefficients[1][None]
            if not all(is_stable(row) for row in rows):
                return False
        return True

    def update(self, volts: Floats) -> tuple[Reals, Reals]:
        """Take the next rows; return envelope and level.

        Parameters
        ----------
        volts : ndarray, shape (n, channels)
            A whole number of windows, which must be of one length.
        """
        if self._first is None:
            self._first = volts[0].copy()
        signals = (volts - self._first).astype(self._kind)
        for i, (function, coefficients, delays) in enumerate(self._stages):
            signals, after = function(*coefficients, signals, axis=0, zi=delays)
            self._stages[i] = function, coefficients, after
        if self._config.rectify == 'half':
            signals = np.maximum(signals, 0)
        power = np.square(signals)
        factor = power.copy()
        for _ in range(self._config.exponent - 1):
            power *= factor
        envelope = np.sqrt(self._means(power, 0))
        return envelope, self._means(envelope, 1)

    def _means(self, values: Reals, i: int) -> Reals:
        before = self._windows[i]
        window = len(before)
        joined = np.concatenate([before, values])
        self._windows[i] = joined[-window:]
        if self._running:
            change = values - joined[:-window]
            change[0] += self._sums[i]
            totals = np.cumsum(change, axis=0)
            self._sums[i] = totals[-1]
            return np.asarray(np.maximum(totals, 0) / self._kind.type(window))
        stretches = joined.reshape(-1, window, values.shape[1])
        totals = np.cumsum(stretches[1:], axis=1)
        tails = np.cumsum(stretches[:-1, :0:-1], axis=1)[:, ::-1]
        totals[:, :-1] += tails
        return np.asarray(totals.reshape(values.shape) / self._kind.type(window))


def is_stable(polynomial: Reals) -> bool:
    """Return whether all roots are inside the unit circle, by Schur and Cohn's test.

    It is exact; root finders are wrong by more than the distance of such roots to the circle.
    """
    values = [Fraction(float(value)) for value in polynomial]
    while len(values) > 1:
        share = values[-1] / values[0]
        if abs(share) >= 1:
            return False
        values = [a - share * b for a, b in zip(values[:-1], values[:0:-1], strict=True)]
    return True


class Chain:
    """The chain itself, behind the same two calls."""

    def __init__(self, config: ChainConfig) -> None:
        self._chain = SlipChain(config)

    def is_stable(self) -> bool:
        """Return true: other designs are refused."""
        return True

    def update(self, volts: Floats) -> tuple[Floats, Floats]:
        """Take the next rows; return envelope and level."""
        result = self._chain.update(volts)
        return result.envelope, result.level


Method = Chain | Plain

#: By name, how each method is made.
METHODS: dict[str, Callable[[ChainConfig], Method]] = {
    'chain': Chain,
    'sections float64': lambda config: Plain(config, 'sections', np.float64),
    'sections float32': lambda config: Plain(config, 'sections', np.float32),
    'polynomials float64': lambda config: Plain(config, 'polynomials', np.float64),
    'polynomials float32': lambda config: Plain(config, 'polynomials', np.float32),
}
RUNNING_SUMS = 'running sums float64'
WITH_RUNNING_SUMS = METHODS | {
    RUNNING_SUMS: lambda config: Plain(config, 'sections', np.float64, running=True)
}


def volts(config: ChainConfig, rows: int, channels: int = 1, seed: int = 0) -> Floats:
    """Make tones inside the pass-band and noise that swell and fade; exact in float32.

    Returns
    -------
    ndarray, shape (rows, channels)
    """
    random = np.random.default_rng(seed)
    low, high = config.passband_hz
    time_s = np.arange(rows)[:, None] / config.sample_rate_hz
    tones = sum(
        np.sin(2 * np.pi * (time_s * tone_hz + random.random(channels)))
        for tone_hz in (1.2 * low, np.sqrt(low * high), 0.9 * high)
    )
    swell = 0.55 - 0.45 * np.cos(6 * np.pi * np.arange(rows) / rows)[:, None]
    noise = random.standard_normal((rows, channels))
    return BASELINE_V + quantised(SWING_V * swell * (tones / 3 + noise / 4))


def quantised(signals: Floats) -> Floats:
    """Round to whole multiples of ``STEP_V``."""
    return np.round(signals / STEP_V) * STEP_V


def run(method: Method, samples: Floats, config: ChainConfig) -> tuple[Reals, Reals]:
    """Run a method over any number of rows; return envelope and level."""
    window = config.samples(config.envelope_window_s)
    filled = np.concatenate([samples, np.repeat(samples[-1:], -len(samples) % window, axis=0)])
    with np.errstate(all='ignore'):  # What overflows is told by its figures.
        envelope, level = method.update(filled)
    return envelope[: len(samples)], level[: len(samples)]


class Exact(NamedTuple):
    """The reference's result on one channel, as the sum of two float64 each; shape (n,)."""

    envelope: tuple[Floats, Floats]
    level: tuple[Floats, Floats]


def exact(config: ChainConfig, samples: Floats, sections: Any = None) -> Exact:
    """Run the reference on one channel; with its own design unless sections are given."""
    filtered = reference.run_filter(sections or reference.design(config), samples)
    envelope, level = reference.envelope_and_level(filtered, config)
    return Exact(reference.as_two(envelope), reference.as_two(level))


def error(values: Reals, wanted: tuple[Floats, Floats]) -> float | None:
    """Return the worst difference as a share of the largest value; None if not finite."""
    near, rest = wanted
    differences = np.abs((values.astype(np.float64) - near) - rest)
    worst = float(differences.max() / near.max())
    return worst if np.isfinite(worst) else None


def judge(method: Method, samples: Floats, config: ChainConfig, wanted: Exact) -> dict[str, Any]:
    """Run one channel and hold it against the reference."""
    envelope, level = (part[:, 0] for part in run(method, samples[:, None], config))
    worst = error(level, wanted.level)
    # Between the two rows in the middle: on the level of one of them the decision is a toss.
    middle = len(level) // 2
    threshold = np.sort(wanted.level[0])[middle - 1 : middle + 1].mean()
    state = ''
    if not method.is_stable():
        state = 'unstable'
    elif worst is None or worst > LOST:
        state = 'lost'
    return {
        'error': worst,
        'envelope_error': error(envelope, wanted.envelope),
        'differing_decisions': int(((level > threshold) != (wanted.level[0] > threshold)).sum()),
        'state': state,
    }


def measure(quick: bool = False) -> dict[str, Any]:
    """Measure all of it; the keys are in the module's docstring."""
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
        'extremes': list(extremes(sizes)),
        'slow_down': slow_down(sizes),
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
    result['wanted'] = verdicts(WANTED, {name: max(errors) for name, errors in worst.items()})
    return result


def _rate(rate_hz: float, sizes: Sizes) -> dict[str, Any]:
    config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **RATES[rate_hz])
    entry = errors_of(config, max(sizes.fewest_rows, round(sizes.seconds * rate_hz)))
    for name, time_ns in times_ns(config, sizes).items():
        entry['methods'][name]['ns_per_row'] = time_ns
    return entry


def errors_of(config: ChainConfig, rows: int) -> dict[str, Any]:
    """Hold all methods against the reference in one configuration."""
    sections = design(config)
    samples = volts(config, rows)[:, 0]
    wanted = exact(config, samples)
    same_design = exact(config, samples, reference.exactly(sections))
    _, level = run(Chain(config), samples[:, None], config)
    return {
        'sample_rate_hz': config.sample_rate_hz,
        'passband_hz': config.passband_hz,
        'stopbands_hz': config.stopbands_hz,
        'rows': rows,
        'largest_pole_radius': largest_pole_radius(sections),
        'run_error': error(level[:, 0], same_design.level),
        'methods': {
            name: judge(make(config), samples, config, wanted) for name, make in METHODS.items()
        },
    }


def times_ns(config: ChainConfig, sizes: Sizes) -> dict[str, float]:
    """Measure the time of a row of 16 channels by method, in blocks that stay in the cache."""
    config = ChainConfig(
        sample_rate_hz=config.sample_rate_hz,
        passband_hz=config.passband_hz,
        stopbands_hz=config.stopbands_hz,
        channels=TIMED_CHANNELS,
    )
    window = config.samples(config.envelope_window_s)
    piece = -(-ROWS_PER_CALL // window) * window
    pieces = [
        volts(config, piece, TIMED_CHANNELS, seed)
        for seed in range(max(1, sizes.timed_rows // piece))
    ]

    def side(method: Method) -> Callable[[], None]:
        def passes() -> None:
            with np.errstate(all='ignore'):
                for rows in pieces:
                    method.update(rows)

        return passes

    # An unstable method overflows soon, and sums of what is not finite take as long as others.
    sides = [side(make(config)) for make in METHODS.values()]
    rows = piece * len(pieces)
    times_s = least_times_s(sides, sizes.rounds)
    return {name: s / rows * 1e9 for name, s in zip(METHODS, times_s, strict=True)}


#: Bands that go down with their lowest edge, which is a share of the sample rate: by name, that
#: rate and how the bands follow from the edge.
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


def _edge(network: str, share: float, sizes: Sizes) -> dict[str, Any]:
    """Measure one point of a scan, or note why it is refused."""
    rate_hz, bands = NETWORKS[network]
    lead = {'network': network, 'lowest_edge_hz': share * rate_hz, 'edge_share': share}
    # Rounded up in the last place: 1e-5 of the rate is the lowest edge that is allowed.
    edge_hz = float(np.nextafter(share * rate_hz, np.inf))
    try:
        config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **bands(edge_hz))
        radius = largest_pole_radius(design(config))
    except ValueError as problem:
        return lead | {'sample_rate_hz': rate_hz, 'refused': str(problem), 'methods': {}}
    # Four times as long as the slowest pole takes to forget most of its start.
    rows = int(np.clip(4 / (1 - radius), sizes.fewest_rows, sizes.most_rows))
    return lead | {'refused': ''} | errors_of(config, rows)


def long_run(sizes: Sizes) -> dict[str, Any]:
    """Run a periodic signal for very long and hold its last period against the steady state."""
    config = ChainConfig(channels=1)
    random = np.random.default_rng(0)
    row = np.arange(PERIOD_ROWS)
    turns = row[:, None] * np.array([2, 5, 11]) / PERIOD_ROWS + random.random(3)
    period = BASELINE_V + quantised(SWING_V * np.sin(2 * np.pi * turns).mean(axis=1))
    filtered = reference.run_periodic(reference.design(config), period)
    _, level = reference.envelope_and_level(filtered, config, before='same')
    wanted = reference.as_two(level)
    # Whole periods and whole windows: 300 rows hold both.
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
            errors.append(error(last[-PERIOD_ROWS:, 0], wanted))
        methods[name] = {'errors': errors}
    return {'period_rows': PERIOD_ROWS, 'rows': counted, 'methods': methods}


#: Rows before an event, and after it until no trace may be left: the slowest pole of the default
#: network, at a radius of 0.993, makes 1e-23 of what it was. The last rows are looked at.
EVENT_ROW, EVENT_ROWS, AFTER_ROWS = 500, 8500, 760

#: Rows in which the default network makes denormals of a pulse.
DECAY_ROWS = 150_000


def extremes(sizes: Sizes) -> Iterator[dict[str, Any]]:
    """Yield what becomes of each extreme input."""
    yield from _exponents(sizes)
    yield from _events()
    yield from _rails()
    yield from _denormals(sizes)
    yield from _limits(sizes)


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


def _held_against_reference(
    case: str, config: ChainConfig, samples: Floats, found: str = ''
) -> dict[str, Any]:
    result = SlipChain(config).update(samples[:, None])
    return _case(case, result, found, error(result.level[:, 0], exact(config, samples).level))


def _exponents(sizes: Sizes) -> Iterator[dict[str, Any]]:
    samples = volts(ChainConfig(channels=1), sizes.fewest_rows)[:, 0]
    filtered = reference.run_filter(reference.design(ChainConfig()), samples)
    for rectify in ('full', 'half'):
        for exponent in EXPONENTS:
            config = ChainConfig(channels=1, rectify=rectify, exponent=exponent)
            _, level = reference.envelope_and_level(filtered, config)
            result = SlipChain(config).update(samples[:, None])
            worst = error(result.level[:, 0], reference.as_two(level))
            yield _case(f'exponent {exponent}, {rectify} wave', result, worst=worst)


def _events() -> Iterator[dict[str, Any]]:
    """Look for what a step and a spike leave behind when they have passed."""
    config = ChainConfig(channels=1)
    quiet = volts(config, EVENT_ROWS)[:, 0]
    for case, last_row in (
        ('spike of 1e6 V in one row, 19 s later', EVENT_ROW + 1),
        ('step of 1e6 V that stays, 19 s later', EVENT_ROWS),
    ):
        samples = quiet.copy()
        samples[EVENT_ROW:last_row] += 1e6
        near, rest = exact(config, samples).level
        after = near[-AFTER_ROWS:], rest[-AFTER_ROWS:]
        others = {}
        for name in (RUNNING_SUMS, 'sections float32', 'polynomials float64'):
            _, level = run(WITH_RUNNING_SUMS[name](config), samples[:, None], config)
            others[name] = error(level[-AFTER_ROWS:, 0], after)
        result = SlipChain(config).update(samples[:, None])
        yield _case(
            case, result, f'the small signal after it: level {after[0].max():.2g}',
            error(result.level[-AFTER_ROWS:, 0], after), others,
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


def _denormals(sizes: Sizes) -> Iterator[dict[str, Any]]:
    rows = sizes.fewest_rows
    for swing_v, exponent in ((1e-100, 1), (1e-24, 6), (1e-310, 1)):
        config = ChainConfig(channels=1, exponent=exponent)
        samples = swing_v * (volts(config, rows)[:, 0] - BASELINE_V) / SWING_V
        case = f'swing of {swing_v:g} V, exponent {exponent}'
        if swing_v > np.finfo(np.float64).tiny:
            yield _held_against_reference(case, config, samples)
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


def _limits(sizes: Sizes) -> Iterator[dict[str, Any]]:
    rows = sizes.fewest_rows
    square = np.where(np.arange(rows) // 10 % 2 == 0, 1.0, -1.0)
    config = ChainConfig(channels=1)
    yield _held_against_reference('square wave of 1e9 V, limit of the range', config, 1e9 * square)
    config = ChainConfig(channels=1, valid_range_v=(-1e12, 1e12), gain=1e6, exponent=6)
    found = 'the most that parameters take: nothing overflows'
    yield _held_against_reference(
        'square wave of 1e12 V, gain 1e6, exponent 6', config, 1e12 * square, found
    )
    config = ChainConfig(channels=1)
    samples = volts(config, rows)[:, 0]
    held = samples.copy()
    bad = np.arange(rows) % 100 == 50
    samples[bad] = np.where(np.arange(bad.sum()) % 2 == 0, 1e60, np.nan)
    held[bad] = held[np.flatnonzero(bad) - 1]
    result = SlipChain(config).update(samples[:, None])
    marked = bool(np.array_equal(result.valid[:, 0], ~bad))
    found = (
        'those rows' + (' ' if marked else ' NOT ') + 'out of the vote, the last good value held'
    )
    worst = error(result.level[:, 0], exact(config, held).level)
    yield _case('1e60 V and NaN in every 100th row', result, found, worst)


def slow_down(sizes: Sizes) -> dict[str, float]:
    """Compare the time of rows that bring denormals with that of ordinary ones."""
    config = ChainConfig()
    rows = ROWS_PER_CALL if COMPILED else 256
    ordinary = volts(config, rows, config.channels)
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
    times_s = least_times_s(sides, 2 * sizes.rounds)
    return {
        'denormal_input': times_s[1] / times_s[0],
        'decay_to_denormals': times_s[2] / times_s[0],
    }


TABLE_COLUMNS = 99

#: Methods by the heads of their columns, in the tables; the chain's come first.
COLUMNS = {
    'chain': 'chain',
    'sections float64': 'float64',
    'sections float32': 'float32',
    'polynomials float64': 'float64',
    'polynomials float32': 'float32',
}


def table(result: dict[str, Any]) -> str:
    """Lay the figures out as text.

    Parameters
    ----------
    result
        Of :func:`measure`.
    """

    def claim(name: str) -> str:
        entry = result['wanted'][name]
        said = f"the chain's worst: {entry['value']:.1e}"
        return f'  {said} (wanted {entry["bound"]}: {"met" if entry["met"] else "NOT met"})'

    lines = [
        f'Precision    worst error of the level as a share of the largest one, against '
        f'{result["digits"]} digits',
        '             "run": of the chain with its float64 coefficients taken as exact',
        '',
        *_heads(f'  {"rate":>7} {"band":>6} {"stop-bands [Hz]":<15}'),
    ]
    for entry in result['rates']:
        stops = ' '.join(_band(pair) for pair in entry['stopbands_hz'])
        lead = f'  {entry["sample_rate_hz"]:7g} {_band(entry["passband_hz"]):>6} {stops:<15}'
        lines.append(lead + _error_cells(entry))
    lines += [claim('rates.error'), *_wrapped(result['rates_note'], '  ')]
    lines += ['', '  ns a row of 16 channels, taking turns']
    for entry in result['rates']:
        cells = (f'{entry["methods"][name]["ns_per_row"]:9.0f}' for name in COLUMNS)
        first, *rest = cells
        lines.append(f'  {entry["sample_rate_hz"]:7g} {"":22}{first}{"":9}{"".join(rest)}')
    network = ''
    for entry in result['edges']:
        if entry['network'] != network:
            network = entry['network']
            lines += ['', f'  {network}, at {entry["sample_rate_hz"]:g} Hz']
            lines += _heads(f'  {"edge / rate":>11}  {"largest pole":<19}')
        if entry['refused']:
            lines += _wrapped(f'refused: {entry["refused"]}', f'  {entry["edge_share"]:11.2e}  ')
            continue
        lead = f'  {entry["edge_share"]:11.2e}  {entry["largest_pole_radius"]:<19.9f}'
        lines.append(lead + _error_cells(entry))
    lines.append(claim('edges.error'))
    long = result['long_run']
    lines += ['', '  error over the last period after ... rows at 380 Hz']
    lines.append(f'  {"":22}' + ''.join(f'{rows:14,}' for rows in long['rows']))
    for name, method in long['methods'].items():
        errors = ''.join(f'{_figure(worst):>14}' for worst in method['errors'])
        lines.append(f'  {name:<22}{errors}')
    lines += [claim('long_run.error'), '', '  extremes']
    for entry in result['extremes']:
        worst = '' if entry['error'] is None else f'error {_figure(entry["error"])}'
        said = ', '.join(part for part in (worst, entry['found']) if part)
        others = '; '.join(f'{name} {_figure(value)}' for name, value in entry['others'].items())
        said += '' if entry['finite'] else ', NOT finite'
        lines += _wrapped(
            f'{said}; rivals: {others}' if others else said, f'  {entry["case"]:<44} '
        )
    slow = result['slow_down']
    return '\n'.join(
        [
            *lines,
            claim('extremes.error'),
            f'  time a row, as a multiple of an ordinary one: denormal input '
            f'{slow["denormal_input"]:.2f},',
            f'  a pulse decayed to denormals {slow["decay_to_denormals"]:.2f}',
        ]
    )


def _band(edges_hz: tuple[float, float]) -> str:
    return f'{edges_hz[0]:g}-{edges_hz[1]:g}'


def _figure(worst: float | None) -> str:
    return 'not finite' if worst is None else f'{worst:.1e}'


def _heads(lead: str) -> list[str]:
    """Return the two lines over columns of errors; ``run`` is of the chain too."""
    first, *rest = COLUMNS.values()
    return [
        f'{"":{len(lead) + 18}}{"SciPy sections":>18}{"SciPy polynomials":>18}',
        lead + ''.join(f'{head:>9}' for head in (first, 'run', *rest)),
    ]


def _error_cells(entry: dict[str, Any]) -> str:
    cells = [
        entry['methods'][name]['state'] or _figure(entry['methods'][name]['error'])
        for name in COLUMNS
    ]
    cells.insert(1, _figure(entry['run_error']))
    return ''.join(f'{cell:>9}' for cell in cells)


def _wrapped(text: str, lead: str) -> list[str]:
    return textwrap.wrap(
        text, TABLE_COLUMNS, initial_indent=lead, subsequent_indent=' ' * len(lead)
    )
