"""All thresholds and votes from one pass."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.evaluation.replay import LabelledRows, Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.space import thresholds, votes_of
from slip_detector.tuning.sweep import Statistics, sweep_thresholds
from slip_detector.tuning.tracks import track_of

CHANNELS = 7
CONFIG = ChainConfig(
    channels=CHANNELS,
    groups={'left': (1, 2, 3), 'right': (4, 5, 6, 7)},
    stopbands_hz=(),
    flat_after_s=0.0,
    gain=1.0,
)


def rows(seed, n, gap_at=None, bad_share=0.0, moving=False):
    """Noise that swells in the labelled intervals and, less, elsewhere."""
    random = np.random.default_rng(seed)
    truth = np.zeros(n, bool)
    for start in random.integers(0, n, 4):
        truth[start : start + random.integers(1, n // 4)] = True
    swell = np.interp(np.arange(n), np.linspace(0, n, 12), random.uniform(0.1, 2.0, 12))
    volts = (swell + truth)[:, None] * random.standard_normal((n, CHANNELS))
    volts[random.random(volts.shape) < bad_share] = np.nan
    stamps = np.round(np.arange(n) * 1e9 / 380.0).astype(np.int64)
    motion = random.random(n) < 0.5 if moving else None
    if gap_at is None:
        return [LabelledRows(volts, truth, stamps, False, motion)]
    stamps[gap_at:] += 700_000_000
    first, second = slice(0, gap_at), slice(gap_at, n)
    return [
        LabelledRows(
            volts[part], truth[part], stamps[part], part is second, motion and motion[part]
        )
        for part in (first, second)
    ]


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    exponent=st.integers(1, 4),
    common_mode=st.sampled_from(['none', 'median']),
    bad_share=st.sampled_from([0.0, 0.02]),
    gap_at=st.sampled_from([None, 300]),
    early_s=st.sampled_from([0.0, 0.05]),
    disabled=st.sampled_from([(), (2,), (4, 5)]),
)
def test_each_threshold_and_vote_gives_what_a_chain_with_them_gives(
    seed, exponent, common_mode, bad_share, gap_at, early_s, disabled
):
    config = dataclasses.replace(
        CONFIG, exponent=exponent, common_mode=common_mode, disabled_channels=disabled
    )
    evaluation = EvaluationConfig(early_s=early_s, tail_s=0.08)
    recordings = [rows(seed, 900, gap_at, bad_share), rows(seed + 1, 600, None, bad_share)]
    tracks = [track_of('a', pieces, 380.0) for pieces in recordings]
    votes = votes_of(config)
    one_pass = Statistics(config, votes)
    statistic = [one_pass.of(track) for track in tracks]
    random = np.random.default_rng(seed)
    for vote in votes:
        limits = thresholds([part[vote] for part in statistic], tracks, exponent)
        assert (np.diff(limits) > 0).all()
        swept = sweep_thresholds([part[vote] for part in statistic], tracks, limits, evaluation)
        for k in random.integers(0, len(limits), 3).tolist():
            if vote == 'mean':  # equal up to the last bits only
                near = [np.abs(part[vote] / limits[k] - 1).min() < 1e-12 for part in statistic]
                if any(near):
                    continue
            chain = dataclasses.replace(config, vote=vote, threshold=float(limits[k]))
            replay = Replay(chain, evaluation, scores=False, stages=False)
            outcomes = [replay.run(pieces, 380.0) for pieces in recordings]
            latencies = [
                np.nan if slip.latency_s is None else slip.latency_s * 1e3
                for one in outcomes
                for slip in one.slips
            ]
            np.testing.assert_allclose(swept.latencies_ms[:, k], latencies, rtol=1e-12)
            false = sum(alarm.kind == 'false' for one in outcomes for alarm in one.alarms)
            assert swept.false_alarms[k] == false
            assert swept.quiet_s == pytest.approx(sum(one.quiet_s for one in outcomes))


def test_the_track_replays_as_the_recording_does():
    pieces = rows(3, 900, gap_at=400, bad_share=0.02)
    replay = Replay(dataclasses.replace(CONFIG, threshold=0.3, vote='mean'), scores=False)
    assert replay.run(track_of('a', pieces, 380.0).rows(), 380.0) == replay.run(pieces, 380.0)
