"""The chain's numerical error against 50 digits, and that the 50 digits are right."""

import json

import mpmath
import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from mpmath import mpf
from scipy import signal

from benchmarks import chain_precision, chain_reference
from benchmarks import command as benchmark
from benchmarks.chain_errors import volts
from benchmarks.chain_precision import RATES, WANTED, errors_of
from benchmarks.chain_precision_table import table
from benchmarks.chain_rivals import (
    METHODS,
    RUNNING_SUMS,
    WITH_RUNNING_SUMS,
    is_stable,
    run,
)
from slip_detector.chain.filters import design, response
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import LOWEST_EDGE, ChainConfig

ORDINARY = [
    {},
    {'passband_degree': 8, 'stopband_degree': 2},
    {'passband_degree': 6, 'stopband_degree': 6, 'stopband_attenuation_db': 60.0},
    {'passband_hz': (10.0, 150.0), 'stopbands_hz': ()},
    {'passband_hz': (7.0, 0.0), 'passband_degree': 3},
    {'passband_hz': (7.0, 0.0), 'passband_degree': 4, 'stopbands_hz': ((45.0, 55.0),)},
    {'sample_rate_hz': 2000.0, 'stopband_degree': 10, 'stopband_ripple_db': 0.5},
]


def gains(sections, shares):
    """Return the network's complex gains in 50 digits at shares of the sample rate."""
    found = []
    with mpmath.workdps(chain_reference.DIGITS):
        for share in shares:
            z = mpmath.expjpi(2 * mpf(share))
            gain = mpf(1)
            for b0, b1, b2, a1, a2 in sections:
                gain *= (z * (z * b0 + b1) + b2) / (z * (z + a1) + a2)
            found.append(gain)
    return found


# --- the reference -------------------------------------------------------------------------


@pytest.mark.parametrize('values', ORDINARY)
def test_the_reference_designs_the_filters_that_scipy_designs(values):
    config = ChainConfig(**values)
    frequency_hz = np.linspace(0.002, 0.498, 60) * config.sample_rate_hz
    mine = gains(chain_reference.design(config), frequency_hz / config.sample_rate_hz)
    theirs = response(design(config), frequency_hz, config.sample_rate_hz)
    assert np.abs(np.array(mine, complex) - theirs).max() <= 1e-12 * np.abs(theirs).max()


@pytest.mark.parametrize('values', ORDINARY[:4])
def test_the_reference_has_the_gains_by_which_its_filters_are_defined(values):
    config = ChainConfig(**values)
    rate = mpf(config.sample_rate_hz)
    passband = chain_reference.design(ChainConfig(**values | {'stopbands_hz': ()}))
    with mpmath.workdps(chain_reference.DIGITS):
        half_power = config.gain * mpmath.sqrt(mpf(1) / 2)
        for gain in gains(passband, [mpf(edge) / rate for edge in config.passband_hz]):
            assert abs(abs(gain) / half_power - 1) < 1e-40
        ripple = mpf(10) ** (-mpf(config.stopband_ripple_db) / 20)
        for pair in config.stopbands_hz:
            one = chain_reference.design(ChainConfig(**values | {'stopbands_hz': (pair,)}))
            for edge in pair:
                (gain,) = gains(one[len(passband) :], [mpf(edge) / rate])
                assert abs(abs(gain) / ripple - 1) < 1e-40


@pytest.mark.parametrize('values', ORDINARY)
def test_the_reference_runs_as_scipy_and_numpy_do(values):
    config = ChainConfig(**values)
    samples = volts(ChainConfig(), 400)[:, 0]
    filtered = chain_reference.run_filter(chain_reference.design(config), samples)
    envelope, level = chain_reference.envelope_and_level(filtered, config)
    out = signal.sosfilt(design(config), samples - samples[0])
    assert np.allclose(np.array(filtered, float), out, rtol=0, atol=1e-12)
    window = np.ones(config.samples(config.envelope_window_s))
    window /= window.size
    wanted = np.sqrt(np.convolve(np.abs(out) ** 6, window)[:400])
    assert np.allclose(np.array(envelope, float), wanted, rtol=0, atol=1e-12 * wanted.max())
    wanted = np.convolve(wanted, window)[:400]
    assert np.allclose(np.array(level, float), wanted, rtol=0, atol=1e-12 * wanted.max())


def test_the_steady_state_is_where_a_long_run_ends():
    config = ChainConfig()
    sections = chain_reference.design(config)
    period = volts(config, 20)[:, 0]
    filtered = chain_reference.run_periodic(sections, period)
    # At a radius of 0.993, 10,000 rows leave 1e-30 of the start.
    long = chain_reference.run_filter(sections, np.tile(period, 500))
    assert max(abs(a - b) for a, b in zip(filtered, long[-20:], strict=True)) < 1e-28
    _, level = chain_reference.envelope_and_level(filtered, config, before='same')
    _, wanted = chain_reference.envelope_and_level(filtered * 4, config)
    assert max(abs(a - b) for a, b in zip(level, wanted[-20:], strict=True)) < 1e-40


def test_windows_of_the_reference_keep_nothing_of_a_huge_value():
    config = ChainConfig(exponent=6, envelope_window_s=2 / 380, decision_window_s=1 / 380)
    small = mpf(10) ** -20
    _, level = chain_reference.envelope_and_level([small, mpf(10) ** 30, small, small], config)
    with mpmath.workdps(chain_reference.DIGITS):
        assert abs(level[-1] / small**6 - 1) < 1e-45


# --- the chain against it ------------------------------------------------------------------


@pytest.fixture(scope='module')
def precision():
    return chain_precision.measure(quick=True)


@pytest.mark.parametrize('rate_hz', RATES)
def test_the_chain_is_exact_at_every_rate(rate_hz):
    config = ChainConfig(sample_rate_hz=rate_hz, channels=1, **RATES[rate_hz])
    # Both windows and something in them.
    entry = errors_of(config, max(1000, 2 * config.samples(config.envelope_window_s) + 500))
    chain = entry['methods']['chain']
    assert chain['error'] <= WANTED['rates.error'].value
    assert chain['envelope_error'] <= WANTED['rates.error'].value
    assert entry['run_error'] <= WANTED['rates.error'].value
    assert chain['differing_decisions'] == 0
    assert chain['state'] == ''
    for name in ('sections float32', 'polynomials float64', 'polynomials float32'):
        rival = entry['methods'][name]
        assert rival['state'] or rival['error'] >= 5 * chain['error'], name


def test_polynomials_and_float32_are_lost_at_rates_where_the_chain_is_not(precision):
    methods = next(entry for entry in precision['rates'] if entry['sample_rate_hz'] == 1e4)
    methods = methods['methods']
    assert methods['chain']['error'] < 1e-10
    assert methods['polynomials float64']['error'] > 1e-8
    assert methods['sections float32']['error'] > 1e-4
    assert methods['polynomials float32']['state'] == 'unstable'
    assert methods['polynomials float32']['differing_decisions'] > 0


def test_every_accepted_edge_is_exact_and_what_is_refused_says_so_first(precision):
    taken = [entry for entry in precision['edges'] if not entry['refused']]
    refused = [entry for entry in precision['edges'] if entry['refused']]
    assert {entry['network'] for entry in taken} == {entry['network'] for entry in refused}
    assert min(entry['edge_share'] for entry in taken) == LOWEST_EDGE
    for entry in taken:
        chain, *_, polynomials = (
            entry['methods'][name] for name in ('chain', 'polynomials float64')
        )
        assert chain['error'] <= WANTED['edges.error'].value
        assert chain['differing_decisions'] == 0
        assert polynomials['error'] > 100 * chain['error']
    for entry in refused:
        assert entry['edge_share'] < LOWEST_EDGE
        assert 'allowed: ' in entry['refused']
        assert '\n' not in entry['refused']
        assert entry['methods'] == {}


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-5, -0.9),
    st.floats(-6, 0.5),
    st.sampled_from([1, 2, 3, 4, 10]),
    st.sampled_from(['pass', 'stop']),
)
def test_what_is_accepted_has_the_gain_it_should_have(low_power, width_power, order, kind):
    low = max(10**low_power, LOWEST_EDGE)
    pair = low, min(low * (1 + 10**width_power), 0.45)
    values = {'passband_hz': pair, 'passband_degree': 2 * order, 'stopbands_hz': ()}
    if kind == 'stop':
        values = {
            'passband_hz': (0.1, 0.4), 'stopbands_hz': (pair,), 'stopband_degree': 2 * order
        }  # fmt: skip
    config = ChainConfig(
        sample_rate_hz=1.0, channels=1, envelope_window_s=15.0, decision_window_s=15.0, **values
    )
    try:
        sections = design(config)
    except ValueError:
        reject()
    width = pair[1] - pair[0]
    shares = [float(share) for share in low + width * np.linspace(-0.2, 1.1, 14)]
    wanted = gains(chain_reference.design(config), shares)
    found = gains(chain_reference.exactly(sections), shares)
    largest = max(abs(gain) for gain in wanted)
    assert max(abs(a - b) for a, b in zip(wanted, found, strict=True)) <= 1e-6 * largest


def test_the_error_does_not_grow_with_the_rows(precision):
    errors = precision['long_run']['methods']['chain']['errors']
    assert len(errors) == len(precision['long_run']['rows']) >= 2
    assert max(errors) <= WANTED['long_run.error'].value


def cases(precision, word):
    found = [entry for entry in precision['extremes'] if word in entry['case']]
    assert found
    return found


def test_nothing_is_ever_other_than_finite(precision):
    assert all(entry['finite'] for entry in precision['extremes'])


def test_exponents_with_either_rectifier(precision):
    found = cases(precision, 'wave')
    assert len([entry for entry in found if entry['case'].startswith('exponent')]) == 12
    for entry in found:
        assert entry['error'] <= 1e-11
        assert entry['largest_level'] > 0


def test_a_spike_and_a_step_of_a_million_volts_leave_nothing(precision):
    (spike,) = cases(precision, 'spike of 1e6 V')
    assert spike['largest_level'] > 1e20
    assert spike['error'] <= 1e-11
    # What a sum that is updated keeps of it hides the signal for ever.
    assert spike['others'][RUNNING_SUMS] > 1
    (step,) = cases(precision, 'step of 1e6 V')
    # The offset stays, and with it its rounding errors: 1e-6 of a signal of 20 mV on 1e6 V.
    assert step['error'] <= WANTED['extremes.error'].value


def test_a_constant_rail_is_exactly_zero_and_leaves_the_vote(precision):
    found = cases(precision, 'constant')
    assert len(found) == 3
    for entry in found:
        assert entry['largest_level'] == 0
        assert entry['error'] == 0
        assert entry['found'] == 'level exactly 0, out of the vote after 1 s'


def test_denormals_are_off_and_what_is_tiny_is_exact(precision):
    (denormal,) = cases(precision, '(denormal)')
    assert denormal['largest_level'] == 0
    (pulse,) = cases(precision, 'a pulse of 1 V')
    assert pulse['found'] == 'the level ends at 0'
    for word in ('1e-100 V', '1e-24 V'):
        (entry,) = cases(precision, word)
        assert 0 < entry['largest_level'] < 1e-90
        assert entry['error'] <= 1e-11


def test_the_largest_values_overflow_nowhere(precision):
    (largest,) = cases(precision, 'gain 1e6, exponent 6')
    assert 1e100 < largest['largest_level'] < 1e150
    assert largest['error'] <= 1e-11
    (beyond,) = cases(precision, '1e60 V and NaN')
    assert beyond['error'] <= 1e-11
    assert 'out of the vote' in beyond['found']
    assert 'NOT' not in beyond['found']


# --- the rivals ----------------------------------------------------------------------------


@pytest.mark.parametrize('name', WITH_RUNNING_SUMS)
@pytest.mark.parametrize('values', [{}, {'exponent': 2, 'rectify': 'half'}])
def test_every_rival_does_what_the_chain_does(name, values):
    config = ChainConfig(channels=3, **values)
    samples = volts(config, 600, 3)
    wanted = SlipChain(config).update(samples)
    whole = run(WITH_RUNNING_SUMS[name](config), samples, config)
    tolerance = {'sections float32': 1e-3, 'polynomials float32': 0.2}.get(name, 1e-8)
    for found, of_chain in zip(whole, (wanted.envelope, wanted.level), strict=True):
        assert np.allclose(found, of_chain, rtol=0, atol=tolerance * of_chain.max())
    method = WITH_RUNNING_SUMS[name](config)
    pieces = [run(method, piece, config)[1] for piece in np.split(samples, [15, 300])]
    assert np.allclose(np.concatenate(pieces), whole[1], rtol=0, atol=tolerance * whole[1].max())


@pytest.mark.parametrize('name', METHODS)
def test_rivals_compute_in_their_type(name):
    config = ChainConfig(channels=1)
    level = run(METHODS[name](config), volts(config, 60), config)[1]
    assert level.dtype == (np.float32 if name.endswith('32') else np.float64)


@pytest.mark.parametrize(
    ('roots', 'stable'),
    [
        ([0.5, -0.9], True),
        ([1.0, 0.3], False),
        ([0.9 + 0.5j, 0.9 - 0.5j], False),
        ([0.6 + 0.7j, 0.6 - 0.7j, -0.99], True),
        ([0.2, 0.3, -1.001], False),
        ([0.0, 0.0, 0.5], True),
    ],
)
def test_stability_is_told_by_where_the_poles_are(roots, stable):
    assert is_stable(np.real(np.poly(roots))) is stable


def test_poles_that_lie_together_next_to_the_circle_are_told_apart():
    polynomial = np.poly([1 - 2.0**-13] * 4)  # of 52 bits: exact
    assert is_stable(polynomial)
    assert not is_stable(np.array([1.0, -4.0, 6.0, -4.0, 1.0]))


# --- what is printed -----------------------------------------------------------------------


def keys_of(part):
    if isinstance(part, dict):
        return set(part).union(*map(keys_of, part.values()))
    return set().union(*map(keys_of, part)) if isinstance(part, list) else set()


def test_every_key_is_documented(precision):
    names = {*WITH_RUNNING_SUMS, 'value', 'bound', 'met'}
    for key in keys_of(precision) - names:
        assert f'``{key}``' in chain_precision.__doc__, key
    assert '``precision``' in benchmark.__doc__


def test_the_claims_are_the_chains_worst_errors(precision):
    assert set(precision['wanted']) == set(WANTED)
    rates = [entry['methods']['chain']['error'] for entry in precision['rates']]
    assert precision['wanted']['rates.error']['value'] == max(rates)
    for name, entry in precision['wanted'].items():
        assert entry['met'] is WANTED[name].met(entry['value'])


def test_the_table_says_what_each_method_does(precision):
    text = table(precision)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 99
    for word in ('50 digits', 'unstable', 'refused: parameter', '(wanted <= 1e-07: met)'):
        assert word in text
    for entry in precision['extremes']:
        assert entry['case'] in text
    for entry in precision['rates']:
        error = f'{entry["methods"]["chain"]["error"]:.1e}'
        assert any(f'{entry["sample_rate_hz"]:g}' in line and error in line for line in lines)


def test_the_table_says_honestly_what_is_bad(precision):
    entry = precision['rates'][0]
    methods = entry['methods'] | {'chain': entry['methods']['chain'] | {'state': 'lost'}}
    extreme = precision['extremes'][0] | {'finite': False, 'error': None}
    text = table(
        precision
        | {
            'rates': [entry | {'methods': methods}],
            'extremes': [extreme],
            'wanted': {name: one | {'met': False} for name, one in precision['wanted'].items()},
        }
    )
    assert text.count('NOT met') == len(WANTED)
    assert 'NOT finite' in text
    assert any('lost' in line for line in text.splitlines() if line.startswith('       50 '))


def test_the_command_prints_and_draws_the_precision_alone(
    precision, monkeypatch, tmp_path, capsys
):
    monkeypatch.setattr(chain_precision, 'measure', lambda quick: precision)
    picture = tmp_path / 'new' / 'picture.png'
    words = ['chain', '--quick', '--part', 'precision']
    assert benchmark.main([*words, '--json', '--plot', str(picture)]) == 0
    parsed = json.loads(capsys.readouterr().out)
    assert set(parsed) == {'machine', 'quick', 'precision'}
    assert parsed['precision'] == json.loads(json.dumps(precision))
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert benchmark.main(words) == 0
    assert table(precision) in capsys.readouterr().out


def test_a_picture_of_what_is_not_measured_is_an_error(capsys):
    assert benchmark.main(['chain', '--part', 'speed', '--plot']) == 1
    error = capsys.readouterr().err
    assert error.startswith('slip_benchmark: --plot')
    assert error.count('\n') == 1
