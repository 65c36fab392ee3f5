"""Figures of merit of decisions against their definitions."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slip_detector.chain.slip_chain import COMPILED, SlipChain
from slip_detector.evaluation.scores import (
    MOTION,
    REST,
    SCORE_RESOLUTION,
    SLIP,
    DecisionStatistic,
    ScoreCounts,
    ScoreTally,
    false_positive_percent,
    first_on_delay_s,
    mean_delay,
)
from slip_detector.parameters.detector import ChainConfig

# The decision statistic.


@st.composite
def chains(draw):
    """Draw a configuration and rows for it, with bad samples, held values and quiet channels."""
    channels = draw(st.integers(1, 12), label='channels')
    enabled = draw(st.integers(1, channels), label='enabled')
    order = draw(st.permutations(range(1, channels + 1)), label='order')
    n_groups = draw(st.integers(1, min(enabled, 3)), label='groups')
    groups = {f'g{i}': tuple(order[:enabled][i::n_groups]) for i in range(n_groups)}
    fewest = min(map(len, groups.values()))
    config = ChainConfig(
        sample_rate_hz=400.0,
        channels=channels,
        groups=groups,
        disabled_channels=tuple(order[enabled:]),
        passband_hz=(20.0, 100.0),
        stopbands_hz=(),
        gain=1.0,
        exponent=draw(st.integers(1, 3), label='exponent'),
        envelope_window_s=draw(st.sampled_from([0.0025, 0.02]), label='envelope'),
        decision_window_s=draw(st.sampled_from([0.0025, 0.02]), label='decision'),
        flat_after_s=draw(st.sampled_from([0.0, 0.01]), label='flat'),
        vote=draw(st.sampled_from(['all', 'mean', *range(1, fewest + 1)]), label='vote'),
    )
    seed = draw(st.integers(0, 2**32 - 1), label='seed')
    rng = np.random.default_rng(seed)
    volts = rng.normal(size=(120, channels)) * rng.choice([0.0, 0.5, 1.0, 2.0], channels)
    volts[rng.random(volts.shape) < draw(st.sampled_from([0.0, 0.02, 0.5]), label='bad')] = np.nan
    if draw(st.booleans(), label='held'):
        volts[40:80, rng.random(channels) < 0.5] = 1.0
    return config, volts


def replaced(config, **changes):
    return ChainConfig(**{**config.__dict__, **changes})


@settings(max_examples=300 if COMPILED else 30)
@given(chains(), st.floats(0.01, 0.99))
def test_the_statistic_is_above_one_where_the_chain_says_slip_at_any_threshold(drawn, share):
    config, volts = drawn
    first = SlipChain(config).update(volts)
    # A threshold out of the midst of the levels, so that there is something to decide.
    levels = first.level[first.valid & (first.level > 0.0)]
    threshold = float(np.quantile(levels, share)) if levels.size else 1.0
    config = replaced(config, threshold=threshold)
    result = SlipChain(config).update(volts)
    statistic = DecisionStatistic(config)(result)
    assert statistic.shape == (len(volts),)
    ratio = result.level / threshold
    rounding = np.isclose(ratio, 1.0, rtol=1e-9) & result.valid
    sure = ~rounding.any(axis=1) & ~np.isclose(statistic, 1.0, rtol=1e-9)
    np.testing.assert_array_equal((statistic > 1.0)[sure], result.slip[sure])
    # And so it is the score of a ROC curve: a limit on it is another threshold.
    other = replaced(config, threshold=2.0 * threshold)
    sure &= ~np.isclose(ratio, 2.0, rtol=1e-9).any(axis=1) & ~np.isclose(statistic, 2.0, rtol=1e-9)
    np.testing.assert_array_equal(
        (statistic > 2.0)[sure], SlipChain(other).update(volts).slip[sure]
    )


@pytest.mark.parametrize(
    ('vote', 'valid', 'expected'),
    [
        ('all', [1, 1, 1, 1], 0.5),
        ('all', [0, 1, 1, 1], 1.0),
        ('all', [0, 0, 0, 1], 8.0),
        ('all', [0, 0, 0, 0], 0.0),
        (1, [1, 1, 1, 1], 8.0),
        (2, [1, 1, 1, 1], 4.0),
        (2, [1, 1, 0, 1], 1.0),
        (3, [1, 1, 0, 0], 0.0),
        (1, [0, 0, 0, 0], 0.0),
        ('mean', [1, 1, 1, 1], 2.0),
        ('mean', [0, 1, 0, 1], np.sqrt(8.0)),
        ('mean', [0, 0, 0, 0], 0.0),
    ],
)
def test_the_statistic_of_a_group_by_hand(vote, valid, expected):
    config = ChainConfig(channels=4, vote=vote, threshold=2.0)
    result = SimpleNamespace(level=np.array([[1.0, 2.0, 8.0, 16.0]]), flags=np.array([valid]) == 1)
    np.testing.assert_allclose(DecisionStatistic(config)(result), [expected])


def test_the_statistic_of_a_silent_channel_is_zero_in_the_geometric_mean():
    config = ChainConfig(channels=2, vote='mean', threshold=1.0)
    result = SimpleNamespace(level=np.array([[0.0, 9.0]]), flags=np.ones((1, 2), bool))
    assert DecisionStatistic(config)(result) == [0.0]


def test_the_statistic_is_that_of_the_group_nearest_to_slip():
    groups = {'a': (1, 4), 'b': (2, 3)}
    config = ChainConfig(channels=4, groups=groups, threshold=1.0)
    level = np.array([[1.0, 2.0, 5.0, 9.0], [3.0, 0.0, 5.0, 4.0]])
    result = SimpleNamespace(level=level, flags=np.ones((2, 4), bool))
    np.testing.assert_array_equal(DecisionStatistic(config)(result), [2.0, 3.0])


def test_the_statistic_needs_the_level():
    result = SlipChain().update(np.zeros((3, 16)), level=False)
    with pytest.raises(ValueError, match='level was not kept'):
        DecisionStatistic(ChainConfig())(result)


def test_the_statistic_of_no_rows_is_empty():
    result = SlipChain().update(np.zeros((0, 16)))
    assert DecisionStatistic(ChainConfig())(result).shape == (0,)


# Area under the ROC curve.


TALLY = ScoreTally()


def counted(score, kind):
    TALLY.add(score, kind)
    return TALLY.take()


def area(positives, negatives):
    """Return the share of pairs in order, ties counting half; None without pairs."""
    differences = np.subtract.outer(positives, negatives)
    return (0.5 * (1.0 + np.sign(differences))).mean() if differences.size else None


KINDS = st.sampled_from([REST, MOTION, SLIP])
SCORED = st.lists(
    st.tuples(st.integers(0, 6).map(float) | st.floats(1e-30, 1e30), KINDS), max_size=30
)


@given(SCORED)
def test_auc_is_the_share_of_pairs_in_order_and_ties_count_half(rows):
    counts = counted([s for s, _ in rows], [k for _, k in rows])
    by_kind = [np.array([s for s, k in rows if k == kind]) for kind in (REST, MOTION, SLIP)]
    for against in ([REST, MOTION], [MOTION]):
        others = np.concatenate([by_kind[kind] for kind in against])
        pairs = by_kind[SLIP][:, np.newaxis], others[np.newaxis]
        near = np.isclose(*pairs, rtol=SCORE_RESOLUTION, atol=0.0) & (pairs[0] != pairs[1])
        expected = area(by_kind[SLIP], others)
        found = counts.auc(against)
        if expected is None:
            assert found is None
        else:
            assert found == pytest.approx(expected, abs=0.5 * near.mean() + 1e-12)


def test_auc_of_many_close_scores_is_true_to_its_resolution():
    rng = np.random.default_rng(0)
    scores = np.concatenate([rng.lognormal(0.5, 0.3, 2000), rng.lognormal(0.0, 0.3, 3000)])
    kinds = np.repeat([SLIP, REST], [2000, 3000])
    exact = area(scores[:2000], scores[2000:])
    assert counted(scores, kinds).auc() == pytest.approx(exact, abs=1e-4)


def test_scores_beyond_all_bounds_are_still_ordered():
    # 0 is below all, and what does not fit into 32 bit is above all.
    assert counted([1e60, 0.0, 1e-30, 1e30], [SLIP, REST, REST, REST]).auc() == 1.0
    assert counted([0.0, 1e60, 1e-30], [SLIP, REST, REST]).auc() == 0.0


@given(st.lists(SCORED, max_size=4))
def test_pooled_counts_are_those_of_all_rows(parts):
    pooled = ScoreCounts.pooled([counted([s for s, _ in p], [k for _, k in p]) for p in parts])
    rows = [row for part in parts for row in part]
    whole = counted([s for s, _ in rows], [k for _, k in rows])
    np.testing.assert_array_equal(pooled.classes, whole.classes)
    np.testing.assert_array_equal(pooled.counts, whole.counts)


def test_what_has_been_taken_is_forgotten():
    counted([1.0, 2.0], [SLIP, REST])
    assert counted([], []).classes.size == 0


@given(SCORED)
def test_the_roc_curve_is_the_shares_at_or_above_each_limit(rows):
    score, kind = np.array([s for s, _ in rows]), np.array([k for _, k in rows])
    false_share, true_share, limit = counted(score, kind).roc()
    assert (np.diff(limit) < 0.0).all()
    for share, mine in ((false_share, kind != SLIP), (true_share, kind == SLIP)):
        if not mine.any():
            assert np.isnan(share).all()
            continue
        # Between two limits there is no score: a hair below it stands for the limit.
        expected = [(score[mine] >= at * (1.0 - 1e-6)).mean() for at in limit]
        np.testing.assert_allclose(share, expected)


# The paper's figures.


def test_the_delay_runs_from_the_start_of_slip_to_the_first_on_after_it():
    on = [True, False, False, True, True]
    time_s = [0.0, 0.5, 1.0, 1.5, 2.0]
    assert first_on_delay_s(on, time_s, 0.25) == 1.25
    assert first_on_delay_s(on, time_s, 1.5) == 0.0  # At the start counts.
    assert first_on_delay_s(on, time_s, 0.0) == 0.0
    assert first_on_delay_s(on, time_s, 2.1) is None
    assert first_on_delay_s([False] * 5, time_s, 0.0) is None
    assert first_on_delay_s([], [], 0.0) is None


@given(
    st.lists(st.booleans(), min_size=1, max_size=30),
    st.floats(-1, 31).map(lambda x: round(x, 2)),
)
def test_nothing_is_on_between_the_start_of_slip_and_its_delay(on, start_s):
    time_s = np.arange(len(on), dtype=float)
    delay_s = first_on_delay_s(on, time_s, start_s)
    after = np.array(on) & (time_s >= start_s)
    assert (delay_s is None) == (not after.any())
    if delay_s is not None:
        assert delay_s >= 0.0
        at = round(start_s + delay_s)
        assert start_s + delay_s == pytest.approx(at)
        assert after[at]
        assert not after[:at].any()


def test_the_mean_delay_is_over_the_channels_that_have_one():
    mean, sd = mean_delay([0.03, None, 0.05, 0.04, None])
    assert mean == pytest.approx(0.04)
    assert sd == pytest.approx(0.01)


def test_mean_and_deviation_of_too_few_delays_are_not_defined():
    assert mean_delay([]) == (None, None)
    assert mean_delay([None, None]) == (None, None)
    assert mean_delay([None, 0.02]) == (0.02, None)


@given(hnp.arrays(bool, st.tuples(st.integers(0, 40), st.just(2))))
def test_false_positives_are_the_share_of_on_among_rows_without_slip(rows):
    on, truth = rows.T
    percent = false_positive_percent(on, truth)
    without = int(np.count_nonzero(~truth))
    if not without:
        assert percent is None
    else:
        assert percent == pytest.approx(100.0 * np.count_nonzero(on & ~truth) / without)
