"""The kernel: what the reference gives, however the rows are cut, compiled or interpreted."""

import copy
import inspect
import os
import pickle
import subprocess
import sys
import textwrap
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from slip_detector.chain import slip_chain as chain_module
from slip_detector.chain.lanes import LANES
from slip_detector.chain.slip_chain import COMPILED, SlipChain
from slip_detector.chain.stages import WORD_ROWS
from slip_detector.parameters.detector import COMMON_MODES, ChainConfig
from support.chain_cases import VOTES, bits, noise, sine
from support.interpreted import interpreted_chain
from support.reference import _vote as reference_vote
from support.reference import reference

CHECKOUT = Path(chain_module.__file__).parents[2]

# The interpreted kernel is some 500 times slower.
EXAMPLES = 300 if COMPILED else 100

FEW_EXAMPLES = 60 if COMPILED else 15
MOST_ROWS = 200 if COMPILED else 120


def bits_in_pieces(chain, pieces):
    results = [chain.update(piece) for piece in pieces]
    return tuple(
        np.concatenate([getattr(result, name) for result in results]).tobytes()
        for name in ('flags', 'envelope', 'level')
    )


@st.composite
def configs(draw, **fixed):
    """Draw a configuration over all that the chain can do, of filters that are well in reach."""
    rate = draw(st.sampled_from([100.0, 380.0, 1000.0, 2012.5]), label='rate')
    # The last of several tiles mostly overlaps the one before it.
    channels = draw(st.one_of(st.integers(1, 40), st.integers(LANES + 1, 70)))
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
    # A threshold amid the levels, which do not depend on it, so that there is something to decide.
    levels = SlipChain(config).update(volts).level
    levels = levels[levels > 0]
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
    volts = np.round(3 + noise(2, 3 * WORD_ROWS + 5, 7), 1)
    volts[noise(3, *volts.shape) > 1.8] = np.nan
    whole = bits(SlipChain(config).update(volts))
    pieces = [piece for row in volts for piece in (row[None], volts[:0])]
    assert bits_in_pieces(SlipChain(config), pieces) == whole


def test_windows_longer_than_a_block_give_the_same_bits_however_cut():
    config = ChainConfig(channels=2, envelope_window_s=0.2, decision_window_s=0.3)
    volts = noise(4, 260, 2)
    whole = bits(SlipChain(config).update(volts))
    for step in (1, 31, WORD_ROWS, 33, 76, 114):
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
    assert twin.state.tobytes() != chain.state.tobytes()


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


@pytest.mark.skipif(not COMPILED, reason='there is no compiled kernel to compare with')
@pytest.mark.parametrize('common_mode', COMMON_MODES)
@pytest.mark.parametrize('vote', ['all', 1, 'mean'])
@settings(max_examples=10)
@given(data=st.data())
def test_the_interpreted_kernel_gives_the_bits_of_the_compiled_one(common_mode, vote, data):
    config = data.draw(configs(common_mode=common_mode, vote=vote, threshold=0.05))
    volts = data.draw(recordings(config))
    votes = data.draw(st.sampled_from([(), ('all', 'mean', 1, 2, 3)]), label='votes')
    compiled = SlipChain(config).update(volts, votes=votes)
    plain = interpreted_chain(config).update(volts, votes=votes)
    assert bits(plain) == bits(compiled)
    assert plain.vote_statistic.tobytes() == compiled.vote_statistic.tobytes()
    # A row a call, from the other side.
    half = len(volts) // 2
    rows = interpreted_chain(config)
    pieces = [rows.update(piece) for piece in [volts[:half], *volts[half : half + 20, None]]]
    flags = np.concatenate([piece.flags for piece in pieces])
    assert flags.tobytes() == compiled.flags[: half + 20].tobytes()


WITHOUT_NUMBA = """
    import sys, warnings
    import numpy as np
    sys.modules['numba'] = None
    from slip_detector.chain.slip_chain import COMPILED, SlipChain
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
        env=os.environ | {'PYTHONPATH': str(CHECKOUT)},
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
