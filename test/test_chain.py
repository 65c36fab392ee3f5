"""The chain against the independent reference, against itself and against hand-made cases."""

import copy
import inspect
import os
import pickle
import subprocess
import sys
import textwrap
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st
from reference import _vote as reference_vote
from reference import reference

from slip_detector import chain as chain_module
from slip_detector.chain import BLOCK_ROWS, COMPILED, TILE_LANES, SlipChain
from slip_detector.config import ChainConfig
from slip_detector.filters import design, largest_pole_radius

PACKAGE_ROOT = Path(chain_module.__file__).parents[1]

# The interpreted kernel is some 500 times slower.
EXAMPLES = 300 if COMPILED else 100
FEW_EXAMPLES = 60 if COMPILED else 15
MOST_ROWS = 200 if COMPILED else 120

VOTES = ('all', 1, 2, 'mean')
COMMON_MODES = ('none', 'mean', 'median')

# A small chain that is quick to settle, for the hand-made cases.
FAST = {
    'sample_rate_hz': 400.0,
    'passband_hz': (20.0, 100.0),
    'stopbands_hz': (),
    'gain': 1.0,
    'exponent': 1,
    'flat_after_s': 0.0,
    'envelope_window_s': 0.04,
    'decision_window_s': 0.04,
}


def bits(result):
    return result.flags.tobytes(), result.envelope.tobytes(), result.level.tobytes()


def bits_in_pieces(chain, pieces):
    results = [chain.update(piece) for piece in pieces]
    return tuple(
        np.concatenate([getattr(result, name) for result in results]).tobytes()
        for name in ('flags', 'envelope', 'level')
    )


def sine(n, hz=50.0, rate=400.0):
    return np.sin(2 * np.pi * hz / rate * np.arange(n))


def noise(seed, *shape):
    return np.random.default_rng(seed).normal(size=shape)


@st.composite
def configs(draw, **fixed):
    """Draw a configuration over all that the chain can do, of filters that are well in reach."""
    rate = draw(st.sampled_from([100.0, 380.0, 1000.0, 2012.5]), label='rate')
    # Half of the time more than one tile.
    channels = draw(st.one_of(st.integers(1, 40), st.integers(TILE_LANES + 1, 40)))
    order = draw(st.permutations(range(1, channels + 1)), label='order')
    enabled = order[: draw(st.integers(1, channels), label='enabled')]
    disabled = order[len(enabled) :]
    if draw(st.booleans(), label='all enabled'):
        enabled, disabled = order, []
    n_groups = draw(st.integers(1, min(len(enabled), 6)), label='groups')
    groups = {f'g{i}': enabled[i::n_groups] for i in range(n_groups)}
    # A vote of more channels than a group has enabled is refused.
    votes = st.one_of(
        st.sampled_from(['all', 'mean']), st.integers(1, min(len(m) for m in groups.values()))
    )
    if disabled and draw(st.booleans(), label='a group lists a disabled channel'):
        groups['g0'] = [*groups['g0'], disabled[0]]
    if draw(st.booleans(), label='high-pass'):
        passband = (draw(st.floats(0.01, 0.3)) * rate, 0.0)
        degree = draw(st.integers(1, 4))
    else:
        low = draw(st.floats(0.01, 0.2)) * rate
        passband = (low, low + draw(st.floats(0.03, 0.25)) * rate)
        degree = draw(st.sampled_from([2, 4, 6]))
    stopbands = []
    for _ in range(draw(st.integers(0, 3), label='stop-bands')):
        low = draw(st.floats(0.005, 0.3)) * rate
        stopbands.append((low, low + draw(st.floats(0.02, 0.18)) * rate))
    values = {
        'sample_rate_hz': rate,
        'channels': channels,
        'disabled_channels': disabled,
        'valid_range_v': draw(st.sampled_from([(-1e9, 1e9), (-7.0, 8.0)])),
        'flat_after_s': draw(st.sampled_from([0.0, 1.0, 5.0, 30.0])) / rate,
        'common_mode': draw(st.sampled_from(COMMON_MODES)),
        'passband_hz': passband,
        'passband_degree': degree,
        'gain': draw(st.sampled_from([0.5, 1.0, 100.0])),
        'stopbands_hz': stopbands,
        'stopband_degree': draw(st.sampled_from([2, 4])),
        'stopband_ripple_db': draw(st.sampled_from([0.01, 0.5])),
        'stopband_attenuation_db': draw(st.sampled_from([20.0, 40.0])),
        'rectify': draw(st.sampled_from(['full', 'half'])),
        'exponent': draw(st.integers(1, 6)),
        'envelope_window_s': draw(st.integers(1, 50)) / rate,
        'decision_window_s': draw(st.integers(1, 50)) / rate,
        'vote': draw(votes),
        'groups': groups,
    }
    return ChainConfig(**values | fixed)


@st.composite
def recordings(draw, config, rows=None):
    """Draw rows with baselines, hum, noise, bad samples, late starters and still stretches."""
    n = rows or draw(st.integers(1, MOST_ROWS), label='rows')
    c = config.channels
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1), label='seed'))
    phases = rng.uniform(0.01, 0.4, c) * np.arange(n)[:, None] + rng.uniform(0, 1, c)
    volts = rng.uniform(-4, 5, c) + rng.uniform(0, 1, c) * np.sin(2 * np.pi * phases)
    volts += 0.2 * rng.normal(size=(n, c)) * rng.integers(0, 2, c)
    volts += 0.5 * np.sin(2 * np.pi * 0.13 * np.arange(n))[:, None]
    if draw(st.booleans(), label='coarse converter'):
        volts = np.round(volts * 4) / 4
    if draw(st.booleans(), label='still stretches'):
        for column in range(c):
            a, b = sorted(rng.integers(0, n + 1, 2))
            volts[a:b, column] = volts[min(a, n - 1), column]
    if draw(st.booleans(), label='bad samples'):
        bad = rng.uniform(size=(n, c)) < 0.05
        volts[bad] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -2e9], size=bad.sum())
    if draw(st.booleans(), label='late starters'):
        for column in rng.permutation(c)[: c // 2 + 1]:
            volts[: rng.integers(0, n + 1), column] = np.nan
    return volts


def reference_of(config, volts):
    names = list(inspect.signature(reference).parameters)[1:]
    return reference(volts, **{name: getattr(config, name) for name in names})


def round_off(config, volts, envelope):
    """Return how far two exact ways of computing envelope or level may lie apart.

    The two ways filter the baseline differently: their filtered signals differ by the round-off
    of the volts through the network, ``delta``. The power makes k delta / peak of it.
    """
    low, high = config.valid_range_v
    good = np.abs(volts[(volts >= low) & (volts <= high)])
    delta = 1e-12 * config.gain * good.max(initial=0.0)
    # One sample in the window can be this much larger than the envelope.
    peak = np.sqrt(config.samples(config.envelope_window_s)) * envelope.max(initial=0.0)
    base = peak ** (1 / config.exponent)
    return (base + delta) ** config.exponent - base**config.exponent + 1e-12 * peak


def log_score(config, level, valid):
    """Return each group's mean logarithm of level / threshold over its valid channels."""
    scores = np.full((len(level), len(config.groups)), -np.inf)
    for g, members in enumerate(config.groups.values()):
        columns = np.array(members) - 1
        for k in range(len(level)):
            levels = level[k, columns[valid[k, columns]]]
            if levels.size and levels.all():
                scores[k, g] = np.mean(np.log(levels) - np.log(config.threshold))
    return scores


def assert_same_votes(config, result, groups, rounding=1e-9):
    """Compare the groups' decisions, but for mean votes that round-off decides."""
    differ = result.groups != groups
    if config.vote == 'mean':
        differ &= np.abs(log_score(config, result.level, result.valid)) > rounding
    assert not differ.any()
    assert np.array_equal(result.slip, result.groups.any(axis=1))


# --- against the reference -----------------------------------------------------------------


@settings(max_examples=EXAMPLES)
@given(st.data())
def test_any_configuration_gives_what_the_reference_gives(data):
    config = data.draw(configs())
    volts = data.draw(recordings(config))
    truth = reference_of(config, volts)
    # A threshold amid the levels, so that there is something to decide.
    levels = truth.level[truth.level > 0]
    share = data.draw(st.floats(0.0, 1.0), label='share of levels below the threshold')
    threshold = float(np.quantile(levels, share)) if levels.size else 0.5
    config = ChainConfig(**config.__dict__ | {'threshold': max(threshold, 1e-30)})
    truth = reference_of(config, volts)

    result = SlipChain(config).update(volts)

    tolerance = round_off(config, volts, truth.envelope)
    note(f'{config}, tolerance {tolerance}')
    assert np.abs(result.envelope - truth.envelope).max() <= tolerance
    assert np.abs(result.level - truth.level).max() <= tolerance
    assert np.array_equal(result.valid, truth.valid)
    assert np.array_equal(result.can_vote, truth.can_vote)
    clear = np.abs(truth.level - config.threshold) > tolerance
    assert np.array_equal(result.channels[clear], truth.channels[clear])
    enabled = np.ones(config.channels, dtype=bool)
    enabled[np.array(config.disabled_channels, dtype=int) - 1] = False
    assert np.array_equal(result.channels, (result.level > config.threshold) & enabled)
    # The vote on the chain's own levels has no tolerance.
    votes, _ = reference_vote(
        result.level, result.channels, result.valid, config.threshold, config.groups, config.vote
    )
    assert_same_votes(config, result, votes)


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', VOTES)
def test_the_default_chain_decides_as_the_reference_through_a_whole_trial(common_mode, vote):
    rate, n = 380.0, 1500 if COMPILED else 400
    volts = np.linspace(1, 5, 16) + 0.002 * noise(1, n, 16)
    sliding = slice(n // 3, 2 * n // 3)
    volts[sliding] += 0.03 * sine(n, 22.0, rate)[sliding, None] * np.linspace(0.5, 1.5, 16)
    volts[n // 2 : n // 2 + 40, 4] = np.nan
    config = ChainConfig(common_mode=common_mode, vote=vote)
    truth = reference_of(config, volts)
    result = SlipChain(config).update(volts)
    tolerance = round_off(config, volts, truth.envelope)
    assert tolerance < 1e-8 * truth.level.max()
    assert np.abs(result.level - truth.level).max() <= tolerance
    for name in ('slip', 'groups', 'can_vote', 'channels', 'valid'):
        assert np.array_equal(getattr(result, name), getattr(truth, name)), name
    assert common_mode != 'none' or (result.slip.any() and not result.slip.all())


# --- streaming -----------------------------------------------------------------------------


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', ['all', 1, 'mean'])
@settings(max_examples=FEW_EXAMPLES // 3)
@given(data=st.data())
def test_any_cut_of_the_rows_gives_the_same_bits(common_mode, vote, data):
    config = data.draw(configs(common_mode=common_mode, vote=vote, threshold=0.05))
    volts = data.draw(recordings(config))
    cuts = data.draw(st.lists(st.integers(0, len(volts)), max_size=12), label='cuts')
    whole = bits(SlipChain(config).update(volts))
    assert bits_in_pieces(SlipChain(config), np.split(volts, sorted(cuts))) == whole


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', VOTES)
def test_single_rows_and_empty_calls_give_the_same_bits(common_mode, vote):
    config = ChainConfig(channels=7, common_mode=common_mode, vote=vote, flat_after_s=0.02)
    volts = np.round(3 + noise(2, 3 * BLOCK_ROWS + 5, 7), 1)
    volts[noise(3, *volts.shape) > 1.8] = np.nan
    whole = bits(SlipChain(config).update(volts))
    pieces = [piece for row in volts for piece in (row[None], volts[:0])]
    assert bits_in_pieces(SlipChain(config), pieces) == whole


def test_windows_longer_than_a_block_give_the_same_bits_however_cut():
    config = ChainConfig(channels=2, envelope_window_s=0.2, decision_window_s=0.3)
    volts = noise(4, 260, 2)
    whole = bits(SlipChain(config).update(volts))
    for step in (1, 31, BLOCK_ROWS, 33, 76, 114):
        pieces = np.split(volts, range(step, len(volts), step))
        assert bits_in_pieces(SlipChain(config), pieces) == whole


def test_an_empty_call_returns_empty_results_and_changes_nothing():
    chain = SlipChain()
    chain.update(noise(5, 10, 16))
    before = pickle.dumps(chain.state)
    result = chain.update(np.zeros((0, 16)))
    assert result.slip.shape == (0,)
    assert result.groups.shape == result.can_vote.shape == (0, 4)
    assert result.channels.shape == result.valid.shape == (0, 16)
    assert result.level.shape == result.envelope.shape == (0, 16)
    assert pickle.dumps(chain.state) == before


@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_reset_makes_the_chain_new(common_mode):
    config = ChainConfig(common_mode=common_mode)
    volts = 2 + noise(6, 90, 16)
    chain = SlipChain(config)
    chain.update(100 * noise(7, 77, 16))
    chain.reset()
    assert bits(chain.update(volts)) == bits(SlipChain(config).update(volts))


@pytest.mark.parametrize(
    'copied', [copy.deepcopy, lambda chain: pickle.loads(pickle.dumps(chain))]
)
@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_a_copy_made_in_mid_stream_goes_on_with_the_same_bits(copied, common_mode):
    config = ChainConfig(channels=9, common_mode=common_mode, vote='mean')
    volts = 2 + noise(8, 120, 9)
    chain = SlipChain(config)
    chain.update(volts[:50])
    twin = copied(chain)
    assert twin.config == config
    rest = bits(chain.update(volts[50:]))
    assert bits(twin.update(volts[50:])) == rest
    chain.update(volts[:1])
    assert twin.state.tiles.tobytes() != chain.state.tiles.tobytes()


def test_a_result_keeps_its_values_when_the_chain_goes_on():
    chain = SlipChain()
    result = chain.update(noise(9, 40, 16))
    before = bits(result)
    chain.update(noise(10, 40, 16))
    chain.reset()
    assert bits(result) == before


def test_the_input_is_not_written_to():
    config = ChainConfig(channels=3, disabled_channels=(2,), common_mode='median')
    volts = noise(11, 50, 3)
    volts[20:30, 0] = np.nan
    before = volts.tobytes()
    SlipChain(config).update(volts)
    SlipChain(ChainConfig(channels=3)).update(volts)
    assert volts.tobytes() == before


# --- the interpreted kernel ----------------------------------------------------------------


@pytest.fixture
def interpreted(monkeypatch):
    """Put the plain functions in place of all compiled ones, as without Numba."""
    compiled = [name for name, value in vars(chain_module).items() if hasattr(value, 'py_func')]
    assert '_run' in compiled
    for name in compiled:
        monkeypatch.setattr(chain_module, name, getattr(chain_module, name).py_func)


@pytest.mark.skipif(not COMPILED, reason='there is no compiled kernel to compare with')
@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', ['all', 1, 'mean'])
def test_the_interpreted_kernel_gives_the_bits_of_the_compiled_one(common_mode, vote, request):
    cases = []

    @settings(max_examples=10)
    @given(st.data())
    def collect(data):
        config = data.draw(configs(common_mode=common_mode, vote=vote, threshold=0.05))
        volts = data.draw(recordings(config))
        cases.append((config, volts, SlipChain(config).update(volts)))

    collect()
    assert len(cases) >= 10
    request.getfixturevalue('interpreted')
    for config, volts, compiled in cases:
        plain = SlipChain(config).update(volts)
        for name in ('envelope', 'level', 'channels', 'valid', 'can_vote'):
            assert getattr(plain, name).tobytes() == getattr(compiled, name).tobytes(), name
        assert_same_votes(config, plain, compiled.groups)


WITHOUT_NUMBA = """
    import sys, warnings
    import numpy as np
    sys.modules['numba'] = None
    from slip_detector.chain import COMPILED, SlipChain
    assert not COMPILED
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter('always')
        chain = SlipChain()
        results = [chain.update(piece) for piece in np.array_split(np.load(sys.argv[1]), 3)]
    for warning in caught:
        print(warning.category.__name__, warning.filename == '<string>', warning.message)
    np.save(sys.argv[2], np.concatenate([result.flags for result in results]))
"""


def test_without_numba_there_is_one_warning_and_the_same_decisions(tmp_path):
    volts = 4.3 + 0.04 * noise(12, 200, 16)
    np.save(tmp_path / 'volts.npy', volts)
    run = subprocess.run(
        [
            sys.executable,
            '-c',
            textwrap.dedent(WITHOUT_NUMBA),
            str(tmp_path / 'volts.npy'),
            str(tmp_path / 'flags.npy'),
        ],
        env=os.environ | {'PYTHONPATH': str(PACKAGE_ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    lines = run.stdout.splitlines()
    assert len(lines) == 1
    # The warning points at the caller's line.
    assert lines[0].startswith('RuntimeWarning True Numba is not installed')
    flags = SlipChain().update(volts).flags
    assert 0 < flags.sum() < flags.size
    assert np.array_equal(np.load(tmp_path / 'flags.npy'), flags)


@pytest.mark.skipif(not COMPILED, reason='without Numba there is a warning, tested elsewhere')
def test_with_numba_there_is_no_warning():
    with warnings.catch_warnings():
        warnings.resetwarnings()
        warnings.simplefilter('error')
        SlipChain().update(noise(13, 5, 16))


# --- baselines and huge values -------------------------------------------------------------


@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_a_constant_baseline_gives_no_level_from_the_first_row(common_mode):
    volts = np.full((200, 16), 4.3)
    volts[:, 3:9] = [-1.7, 0.1, 3.3, 1e3, -1e8, 0.0]
    result = SlipChain(ChainConfig(common_mode=common_mode)).update(volts)
    assert not result.level.any()
    assert not result.envelope.any()
    assert not result.slip.any()


@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_signals_differing_by_a_baseline_give_the_same_bits(common_mode):
    config = ChainConfig(common_mode=common_mode)
    # Multiples of 2**-20 V: the sum with a baseline is exact.
    volts = np.round(noise(14, 100, 16) * 2**20) / 2**20
    baselines = np.arange(-8.0, 8.0) / 4
    chain = SlipChain(config)
    result = chain.update(volts)
    assert result.level.any()
    assert bits(SlipChain(config).update(volts + baselines)) == bits(result)


def rows_to_forget(config, size, rest):
    """Return after how many rows the network's answer to a pulse of some size is below rest."""
    radius = largest_pole_radius(design(config))
    # A factor for the network's gain and for poles that lie together.
    return int(np.log(rest / (1e6 * config.gain * size)) / np.log(radius))


@pytest.mark.parametrize('stopbands', [(), ((0.5, 7.0), (50.0, 180.0))])
@pytest.mark.parametrize('common_mode', ['none', 'mean'])
def test_a_huge_pulse_leaves_no_trace(stopbands, common_mode):
    config = ChainConfig(channels=2, stopbands_hz=stopbands, common_mode=common_mode)
    after = rows_to_forget(config, 1e6, 1e-12)
    windows = config.samples(config.envelope_window_s) + config.samples(config.decision_window_s)
    volts = 0.1 * noise(15, 20 + after + windows + 100, 2)
    calm = SlipChain(config).update(volts)
    hit = volts.copy()
    hit[15:20, 0] += 1e6
    shaken = SlipChain(config).update(hit)
    assert shaken.level[40, 0] > 1e15 * calm.level.max()
    end = slice(20 + after + windows, None)
    assert calm.level[end].min() > 1e-3
    # The filters are linear and have forgotten; what is left is each row's own rounding.
    assert np.allclose(shaken.level[end], calm.level[end], rtol=1e-9, atol=0.0)
    assert np.array_equal(shaken.flags[end], calm.flags[end])


def test_a_huge_step_leaves_no_more_than_the_rounding_of_its_size():
    config = ChainConfig(channels=1, exponent=1, flat_after_s=0.0)
    after = rows_to_forget(config, 1e6, 1e-12)
    # Multiples of 2**-20 V: on top of the step they are still exact.
    volts = np.round(0.1 * noise(16, 20 + after + 100, 1) * 2**20) / 2**20
    calm = SlipChain(config).update(volts)
    hit = volts.copy()
    hit[15:] += 1e6
    shaken = SlipChain(config).update(hit)
    # The sections carry 1e6 V at 2**-53 with the gain of 100, and sum some 100 rows of it.
    tolerance = 100 * 1e6 * config.gain * 2.0**-53
    assert tolerance < 1e-5 * calm.level[-100:].max()
    assert np.abs(shaken.level[-100:] - calm.level[-100:]).max() < tolerance


def test_a_window_forgets_a_huge_value_at_once_when_it_leaves():
    # A high-pass at a quarter of the rate of degree 1 has its pole at the origin: what leaves the
    # windows is all there is to forget.
    config = ChainConfig(
        **FAST | {'passband_hz': (100.0, 0.0), 'passband_degree': 1, 'channels': 1, 'exponent': 3}
    )
    assert largest_pole_radius(design(config)) < 1e-15
    volts = noise(17, 120, 1)
    volts[0] = 0.0
    calm = SlipChain(config).update(volts).level
    for row in range(30, 55):
        hit = volts.copy()
        hit[row] = 1e6
        shaken = SlipChain(config).update(hit).level
        # The pulse is 2 rows long, the windows 16 each; the pole keeps 1e-16 of it a row more.
        end = row + 2 + 16 + 16
        assert shaken[end - 4, 0] > 1e10
        assert np.allclose(shaken[end:], calm[end:], rtol=1e-9, atol=0.0)


# --- bad samples ---------------------------------------------------------------------------

BURSTS = {
    'nan': np.nan,
    'inf': np.inf,
    'minus inf': -np.inf,
    'above the range': 10.5,
    'below the range': -3.0,
    'largest float': np.finfo(float).max,
}


@pytest.mark.parametrize('value', BURSTS.values(), ids=BURSTS)
@pytest.mark.parametrize('first', [0, 40])
def test_a_bad_burst_in_one_channel_touches_no_other(value, first):
    config = ChainConfig(channels=5, valid_range_v=(-2.0, 10.0), vote='mean')
    volts = 4 + 0.1 * noise(18, 120, 5)
    hit = volts.copy()
    hit[first : first + 30, 2] = value
    calm, shaken = (SlipChain(config).update(rows) for rows in (volts, hit))
    others = [0, 1, 3, 4]
    for name in ('level', 'envelope', 'channels', 'valid'):
        a, b = getattr(calm, name), getattr(shaken, name)
        assert a[:, others].tobytes() == b[:, others].tobytes(), name
    marks = np.ones(120, dtype=bool)
    marks[first : first + 30] = False
    assert np.array_equal(shaken.valid[:, 2], marks)
    assert np.isfinite(shaken.level).all()
    # Held, not stepped: the channel itself stays in the order of its signal.
    assert shaken.level.max() <= 2 * calm.level.max()


@pytest.mark.parametrize('value', BURSTS.values(), ids=BURSTS)
@pytest.mark.parametrize('common_mode', ['mean', 'median'])
@pytest.mark.parametrize('first', [0, 40])
def test_a_bad_burst_moves_the_common_mode_no_further_than_the_channels_lie_apart(
    value, common_mode, first
):
    config = ChainConfig(
        channels=5, valid_range_v=(-2.0, 10.0), common_mode=common_mode, exponent=1
    )
    hum = sine(160, 50.0, 380.0)[:, None]
    volts = np.arange(1.0, 6.0) + hum + 0.01 * noise(19, 160, 5)
    hit = volts.copy()
    hit[first : first + 30, 2] = value
    calm, shaken = (SlipChain(config).update(rows) for rows in (volts, hit))
    # The mean of some of the deviations lies among them all: the inputs differ by no more than
    # their spread, once more as the burst can take the first value, and the network makes at
    # most the sum of its absolute impulse response of that. Both windows are means.
    deviations = volts - volts[0]
    spread = np.ptp(deviations, axis=1).max()
    kernel = SlipChain(
        ChainConfig(
            channels=1, exponent=1, envelope_window_s=1e-9 + 1 / 380, decision_window_s=0.003
        )
    )
    impulse = np.zeros((3000 if COMPILED else 1500, 1))
    impulse[1] = 1.0
    norm = kernel.update(impulse).level.sum()
    others = [0, 1, 3, 4]
    change = np.abs(shaken.level - calm.level)[:, others].max()
    assert 0 < change <= 2 * spread * norm
    assert np.array_equal(shaken.valid[:, others], calm.valid[:, others])
    # The hum that all share is gone, with the burst as without.
    plain = SlipChain(ChainConfig(channels=5, valid_range_v=(-2.0, 10.0), exponent=1)).update(
        volts
    )
    assert shaken.level[:, others].max() < 0.1 * plain.level.max()


@pytest.mark.parametrize('common_mode', ['mean', 'median'])
def test_a_late_starter_is_taken_to_have_followed_the_others(common_mode):
    config = ChainConfig(channels=4, common_mode=common_mode)
    # All channels go the same way from different baselines: nothing is left of it.
    volts = np.array([1.0, 2.0, 3.0, 4.0]) + np.round(noise(20, 90, 1) * 2**20) / 2**20
    volts[:37, 3] = np.nan
    result = SlipChain(config).update(volts)
    assert not result.level.any()
    assert np.array_equal(result.valid[:, 3], np.arange(90) >= 37)


@pytest.mark.parametrize('common_mode', COMMON_MODES)
def test_a_channel_that_never_worked_gives_no_level_and_no_vote(common_mode):
    config = ChainConfig(channels=3, common_mode=common_mode, vote=2)
    volts = noise(21, 80, 3)
    volts[:, 1] = np.nan
    result = SlipChain(config).update(volts)
    assert not result.level[:, 1].any()
    assert not result.valid[:, 1].any()
    assert result.valid[:, [0, 2]].all()
    assert result.can_vote.all()


def test_the_ends_of_the_valid_range_are_valid():
    config = ChainConfig(channels=2, valid_range_v=(-1.0, 1.0))
    volts = np.array([[1.0, -1.0], [np.nextafter(1.0, 2), np.nextafter(-1.0, -2)], [-1.0, 1.0]])
    valid = SlipChain(config).update(volts).valid
    assert valid.tolist() == [[True, True], [False, False], [True, True]]


# --- flat channels -------------------------------------------------------------------------


@pytest.mark.parametrize('flat_after_s', [0.02, 0.25])
def test_a_flat_channel_leaves_the_vote_after_its_time_and_returns_at_once(flat_after_s):
    config = ChainConfig(**FAST | {'channels': 3, 'flat_after_s': flat_after_s})
    wait = config.samples(flat_after_s)
    volts = noise(22, wait + 60, 3)
    start, end = 20, 20 + wait + 17
    volts[start:end, 1] = volts[start, 1]
    valid = SlipChain(config).update(volts).valid
    assert valid[:, [0, 2]].all()
    assert np.array_equal(np.flatnonzero(~valid[:, 1]), np.arange(start + wait, end))


def test_a_bad_sample_does_not_wake_a_flat_channel():
    config = ChainConfig(**FAST | {'channels': 1, 'flat_after_s': 0.05})
    volts = np.full((60, 1), 2.5)
    volts[30] = np.nan
    valid = SlipChain(config).update(volts).valid
    assert np.array_equal(np.flatnonzero(valid), np.arange(20))


def test_without_a_flat_time_a_still_channel_stays_valid():
    config = ChainConfig(**FAST | {'channels': 2, 'flat_after_s': 0.0})
    assert SlipChain(config).update(np.full((500, 2), 4.3)).valid.all()


def test_a_flat_channel_no_longer_holds_its_group_off():
    config = ChainConfig(**FAST | {'channels': 3, 'flat_after_s': 0.25, 'threshold': 0.1})
    volts = np.repeat(sine(200, 47.0)[:, None], 3, axis=1)
    volts[:, 1] = 1.0
    result = SlipChain(config).update(volts)
    assert result.channels[50:, [0, 2]].all()
    assert not result.channels[:, 1].any()
    assert np.array_equal(np.flatnonzero(result.slip), np.arange(100, 200))


# --- votes ---------------------------------------------------------------------------------

NAN = float('nan')

# Levels as multiples of the threshold (powers of 2, so exact), the vote, ON, able to vote.
VOTE_CASES = [
    ((2, 2, 2), 'all', True, True),
    ((2, 2, 0.5), 'all', False, True),
    ((2, 2, 1), 'all', False, True),
    ((2, 2, 0), 'all', False, True),
    ((2, 2, NAN), 'all', True, True),
    ((2, NAN, NAN), 'all', True, True),
    ((0.5, NAN, NAN), 'all', False, True),
    ((NAN, NAN, NAN), 'all', False, False),
    ((2, 0.5, 0.5), 1, True, True),
    ((0.5, 0.5, 0.5), 1, False, True),
    ((2, NAN, NAN), 1, True, True),
    ((NAN, NAN, NAN), 1, False, False),
    ((2, 2, 0.5), 2, True, True),
    ((2, 0.5, 0.5), 2, False, True),
    ((2, 2, NAN), 2, True, True),
    ((2, 0.5, NAN), 2, False, True),
    ((2, NAN, NAN), 2, False, False),
    ((2, 2, 2), 3, True, True),
    ((2, 2, 0.5), 3, False, True),
    ((2, 2, NAN), 3, False, False),
    ((4, 0.5, 1), 'mean', True, True),
    ((4, 0.125, 1), 'mean', False, True),
    ((0.5, 0.5, 8), 'mean', True, True),
    ((0.5, 0.5, 2), 'mean', False, True),
    ((1, 1, 1), 'mean', False, True),
    ((1024, 1024, 0), 'mean', False, True),
    ((4, 0.5, NAN), 'mean', True, True),
    ((4, 0.125, NAN), 'mean', False, True),
    ((2, NAN, NAN), 'mean', True, True),
    ((NAN, NAN, NAN), 'mean', False, False),
]


def volts_of_levels(levels, n=100):
    """Return rows at whose end the FAST chain's levels are these multiples of the first value."""
    return sine(n)[:, None] * np.array(levels, dtype=float)


def threshold_of_one(n=100):
    config = ChainConfig(**FAST | {'channels': 1})
    return float(SlipChain(config).update(volts_of_levels([1.0], n)).level[-1, 0])


@pytest.mark.parametrize(('levels', 'vote', 'on', 'able'), VOTE_CASES)
def test_the_valid_channels_of_a_group_vote(levels, vote, on, able):
    threshold = threshold_of_one()
    assert threshold > 0.1
    config = ChainConfig(**FAST | {'channels': 3, 'vote': vote, 'threshold': threshold})
    result = SlipChain(config).update(volts_of_levels(levels))
    known = np.nan_to_num(np.array(levels, dtype=float))
    assert np.array_equal(result.level[-1], known * threshold)
    assert np.array_equal(result.channels[-1], known > 1)
    assert np.array_equal(result.valid[-1], ~np.isnan(levels))
    assert (bool(result.groups[-1, 0]), bool(result.can_vote[-1, 0])) == (on, able)
    assert bool(result.slip[-1]) == on


@pytest.mark.parametrize('vote', ['all', 1, 2, 'mean'])
def test_one_bad_row_takes_a_channel_from_the_vote_for_that_row_only(vote):
    config = ChainConfig(**FAST | {'channels': 2, 'vote': vote, 'threshold': 0.1})
    volts = volts_of_levels((1, 1))
    volts[70, 1] = np.nan
    result = SlipChain(config).update(volts)
    assert np.array_equal(np.flatnonzero(~result.valid[:, 1]), [70])
    # Its level holds on, so the channel's own output does too.
    assert result.channels[60:80].all()
    others = np.arange(len(volts)) != 70
    assert result.can_vote[others].all()
    assert result.slip[60:70].all()
    assert result.slip[71:80].all()
    assert bool(result.can_vote[70, 0]) == bool(result.slip[70]) == (vote != 2)


@pytest.mark.parametrize('vote', VOTES)
def test_a_group_without_a_valid_channel_is_off_and_the_others_decide(vote):
    groups = {'dead': (2, 4), 'alive': (5, 1), 'calm': (3, 6)}
    config = ChainConfig(
        **FAST | {'channels': 6, 'groups': groups, 'vote': vote, 'threshold': 0.1}
    )
    volts = volts_of_levels((1, NAN, 2**-10, NAN, 1, 2**-10))
    result = SlipChain(config).update(volts)
    assert result.groups[-1].tolist() == [False, True, False]
    assert result.can_vote[-1].tolist() == [False, True, True]
    assert result.slip[-1]
    assert not result.groups[:, 0].any()


@pytest.mark.parametrize('vote', VOTES)
def test_slip_is_on_while_any_group_is(vote):
    groups = {'a': (1, 2), 'b': (3, 4)}
    config = ChainConfig(
        **FAST | {'channels': 4, 'groups': groups, 'vote': vote, 'threshold': 0.05}
    )
    volts = np.zeros((400, 4))
    volts[50:150, :2] = sine(100)[:, None]
    volts[220:320, 2:] = sine(100)[:, None]
    result = SlipChain(config).update(volts)
    first, second = result.groups.T
    assert first[100]
    assert second[270]
    assert not (first & second).any()
    assert np.array_equal(result.slip, first | second)
    assert not result.slip[200]


def test_the_default_groups_are_those_of_table_1():
    config = ChainConfig(**FAST | {'threshold': 0.1})
    levels = np.zeros(16)
    levels[np.array([1, 3, 8, 6]) - 1] = 1.0
    result = SlipChain(config).update(volts_of_levels(levels))
    assert list(config.groups) == ['TP', 'TD', 'LR', 'LU']
    assert result.groups[-1].tolist() == [False, True, False, False]


# --- disabled channels ---------------------------------------------------------------------


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', VOTES)
def test_disabled_channels_show_nothing_and_change_nothing(common_mode, vote):
    shared = {'common_mode': common_mode, 'vote': vote, 'threshold': 0.01}
    config = ChainConfig(
        channels=7,
        disabled_channels=(7, 1, 4),
        groups={'a': (2, 6, 4), 'b': (3, 5), 'off': (1, 7)},
        **shared,
    )
    small = ChainConfig(channels=4, groups={'a': (1, 4), 'b': (2, 3)}, **shared)
    volts = 3 + 0.1 * noise(23, 150, 7)
    volts[:, [0, 3, 6]] = [np.nan, 1e7, np.inf]
    volts[50:60, 1] = np.nan
    enabled, disabled = [1, 2, 4, 5], [0, 3, 6]
    wide, narrow = SlipChain(config).update(volts), SlipChain(small).update(volts[:, enabled])
    for name in ('channels', 'valid', 'level', 'envelope'):
        assert not getattr(wide, name)[:, disabled].any(), name
        assert getattr(wide, name)[:, enabled].tobytes() == getattr(narrow, name).tobytes(), name
    for name in ('groups', 'can_vote'):
        assert np.array_equal(getattr(wide, name)[:, :2], getattr(narrow, name)), name
        assert not getattr(wide, name)[:, 2].any(), name
    assert np.array_equal(wide.slip, narrow.slip)
    assert wide.slip.any()


@pytest.mark.parametrize(('envelope', 'level'), [(True, False), (False, True), (False, False)])
def test_disabled_channels_are_zero_whatever_is_kept(envelope, level):
    config = ChainConfig(channels=4, disabled_channels=(2,))
    volts = noise(24, 60, 4)
    whole = SlipChain(config).update(volts)
    part = SlipChain(config).update(volts, envelope=envelope, level=level)
    assert np.array_equal(part.flags, whole.flags)
    for name, kept in (('envelope', envelope), ('level', level)):
        if kept:
            assert np.array_equal(getattr(part, name), getattr(whole, name))
            assert not getattr(part, name)[:, 1].any()


# --- tiles ---------------------------------------------------------------------------------


@pytest.mark.parametrize('channels', [TILE_LANES, TILE_LANES + 1, 40, 100])
def test_many_channels_give_the_bits_of_each_channel_alone(channels):
    volts = np.linspace(-3, 4, channels) + noise(25, 90, channels)
    volts[noise(26, 90, channels) > 2] = np.nan
    together = SlipChain(ChainConfig(channels=channels, flat_after_s=0.02)).update(volts)
    alone = SlipChain(ChainConfig(channels=1, flat_after_s=0.02))
    for c in range(channels):
        alone.reset()
        single = alone.update(volts[:, c : c + 1])
        for name in ('level', 'envelope', 'channels', 'valid'):
            column = getattr(together, name)[:, c]
            assert column.tobytes() == getattr(single, name).tobytes(), (c, name)


@pytest.mark.parametrize('common_mode', ['mean', 'median'])
def test_the_common_mode_is_shared_by_all_tiles(common_mode):
    config = ChainConfig(channels=70, common_mode=common_mode)
    # Exact sums, so that a motion that all share is removed exactly.
    volts = np.arange(70.0) / 8 + np.round(noise(27, 80, 1) * 2**20) / 2**20
    assert not SlipChain(config).update(volts).level.any()
    volts[:, 69] += sine(80, 22.0, 380.0)
    result = SlipChain(config).update(volts)
    assert result.level[-1].argmax() == 69


def test_a_group_over_two_tiles_votes_as_one():
    n = 100
    config = ChainConfig(
        **FAST | {'channels': 70, 'threshold': 0.1, 'groups': {'even': range(2, 71, 2),
                                                                 'odd': range(1, 71, 2)}}
    )  # fmt: skip
    levels = np.ones(70)
    assert SlipChain(config).update(volts_of_levels(levels, n)).groups[-1].all()
    levels[68] = 0.0
    assert SlipChain(config).update(volts_of_levels(levels, n)).groups[-1].tolist() == [
        True,
        False,
    ]


@pytest.mark.parametrize('vote', VOTES)
def test_a_bad_channel_of_any_tile_leaves_its_group_vote(vote):
    groups = {'odd': range(1, 71, 2), 'even': range(2, 71, 2)}
    config = ChainConfig(
        **FAST | {'channels': 70, 'threshold': 0.1, 'groups': groups, 'vote': vote}
    )
    for seat in (0, TILE_LANES, 69):
        levels = np.full(70, 1 / 1024)
        levels[seat] = 1024.0
        alone = levels.copy()
        # Its group is ON only by the one channel, and only while that is valid.
        alone[seat % 2 :: 2] = np.nan
        alone[seat] = 1024.0
        dead = levels.copy()
        dead[seat] = np.nan
        group = seat % 2
        result = SlipChain(config).update(volts_of_levels(alone))
        assert result.groups[-1, group] == (vote != 2), seat
        assert not result.groups[-1, 1 - group], seat
        assert not SlipChain(config).update(volts_of_levels(dead)).groups.any(), seat


# --- input and output ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ('volts', 'shape'),
    [
        (np.zeros((3, 5)), '(3, 5)'),
        (np.zeros((0, 15)), '(0, 15)'),
        (np.zeros(16), '(16,)'),
        (np.zeros((1, 2, 16)), '(1, 2, 16)'),
        ([], '(0,)'),
        ([[1.0, 2.0]], '(1, 2)'),
    ],
)
def test_a_wrong_shape_is_an_error_that_names_both_shapes(volts, shape):
    chain = SlipChain()
    with pytest.raises(ValueError, match='shape') as caught:
        chain.update(volts)
    message = str(caught.value)
    assert shape in message
    assert '(any, 16)' in message
    assert '\n' not in message
    # And nothing happened to the chain.
    rows = noise(28, 40, 16)
    assert bits(chain.update(rows)) == bits(SlipChain().update(rows))


def test_what_was_not_kept_is_an_error_that_says_so():
    volts = noise(29, 60, 16)
    whole = SlipChain().update(volts)
    for kept, lost in (('level', 'envelope'), ('envelope', 'level')):
        result = SlipChain().update(volts, **{lost: False})
        assert np.array_equal(getattr(result, kept), getattr(whole, kept))
        assert np.array_equal(result.flags, whole.flags)
        with pytest.raises(ValueError, match=f'{lost} was not kept.*{lost}=True'):
            getattr(result, lost)
    result = SlipChain().update(volts, level=False, envelope=False)
    assert np.array_equal(result.flags, whole.flags)
    for lost in ('level', 'envelope'):
        with pytest.raises(ValueError, match=f'{lost} was not kept'):
            getattr(result, lost)


def test_what_is_kept_does_not_change_what_follows():
    volts = noise(30, 100, 16)
    chain = SlipChain()
    chain.update(volts[:33], envelope=False, level=False)
    whole = SlipChain().update(volts)
    assert chain.update(volts[33:]).level.tobytes() == whole.level[33:].tobytes()


INPUTS = {
    'float32': lambda volts: volts.astype(np.float32),
    'float16': lambda volts: volts.astype(np.float16),
    'int64': lambda volts: volts.astype(np.int64),
    'uint8': lambda volts: volts.astype(np.uint8),
    'big endian': lambda volts: volts.astype('>f8'),
    'lists': lambda volts: volts.tolist(),
    'rows in a list': list,
    'Fortran order': np.asfortranarray,
    'every other column': lambda volts: np.repeat(volts, 2, axis=1)[:, ::2],
    'backwards in memory': lambda volts: volts[::-1].copy()[::-1],
    'read-only': lambda volts: np.frombuffer(volts.tobytes()).reshape(volts.shape),
}


@pytest.mark.parametrize('made', INPUTS.values(), ids=INPUTS)
def test_any_kind_of_numbers_is_taken(made):
    # Small whole numbers are the same in every type.
    volts = np.random.default_rng(31).integers(0, 100, (70, 16)).astype(np.float64)
    assert bits(SlipChain().update(made(volts))) == bits(SlipChain().update(volts))


def test_flags_hold_all_decisions_side_by_side():
    config = ChainConfig(channels=5, groups={'a': (1, 2), 'b': (3, 4, 5)}, threshold=0.01)
    volts = noise(32, 60, 5)
    volts[20:30, 3] = np.nan
    result = SlipChain(config).update(volts)
    parts = (result.slip[:, None], result.groups, result.can_vote, result.channels, result.valid)
    assert [part.shape[1] for part in parts] == [1, 2, 2, 5, 5]
    assert all(part.dtype == np.bool_ for part in parts)
    assert np.array_equal(result.flags, np.hstack(parts))
    assert np.array_equal(result.channels, result.level > config.threshold)


# --- memory --------------------------------------------------------------------------------


def overhead_of_one_row(config):
    """Return by how many bytes the peak of a one-row call exceeds the arrays of its result."""
    chain = SlipChain(config)
    rows = noise(33, 5, config.channels)
    for k in range(4):
        chain.update(rows[k : k + 1])
    row = rows[4:]
    tracemalloc.start()
    try:
        chain.update(row)
        tracemalloc.reset_peak()
        before = tracemalloc.get_traced_memory()[0]
        result = chain.update(row)
        peak = tracemalloc.get_traced_memory()[1] - before
    finally:
        tracemalloc.stop()
    return peak - result.flags.nbytes - result.level.nbytes - result.envelope.nbytes


@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', ['all', 'mean'])
def test_a_row_takes_no_memory_beyond_its_result(common_mode, vote):
    few, many = (
        overhead_of_one_row(ChainConfig(channels=n, common_mode=common_mode, vote=vote))
        for n in (16, 8000)
    )
    # Array headers and the call's own objects, the same for any number of channels; one temporary
    # of a byte per channel would be 8 kB more.
    assert few < 6000
    assert many < few + 2000


@pytest.mark.parametrize('disabled', [(), (3,)])
def test_many_calls_leave_nothing_behind(disabled):
    chain = SlipChain(ChainConfig(disabled_channels=disabled))
    rows = noise(34, 1, 16)
    for _ in range(20):
        chain.update(rows)
    before = sys.getallocatedblocks()
    for _ in range(500):
        chain.update(rows)
    # One object a call would be 500.
    assert sys.getallocatedblocks() - before < 100
