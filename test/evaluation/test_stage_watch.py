"""Where the time of a detection goes, followed row by row."""

import numpy as np
import pytest

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.events import STAGES
from slip_detector.evaluation.stage_watch import StageWatch
from slip_detector.parameters.detector import ChainConfig

RATE_HZ = 400.0
CONFIG = ChainConfig(
    sample_rate_hz=RATE_HZ,
    channels=2,
    groups={'a': (1,), 'b': (2,)},
    passband_hz=(20.0, 100.0),
    stopbands_hz=(),
    gain=1.0,
    exponent=1,
    threshold=0.3,
)
START = 200


def followed(strengths, rows=200):
    """Watch a slip that begins at row ``START`` with so strong ridges on each channel."""
    time_s = np.arange(rows) / RATE_HZ
    ridges = np.sin(2 * np.pi * 50.0 * time_s)[:, np.newaxis] * strengths
    chain, watch = SlipChain(CONFIG), StageWatch(CONFIG)
    chain.update(np.zeros((START, 2)))
    watch.begin(chain, START)
    result = chain.update(ridges)
    rises = np.flatnonzero(result.slip)
    rise = int(rises[0]) if rises.size else None
    # In two parts, as a recording comes.
    cut = 3
    watch.follow(ridges[:cut], _part(chain, ridges, slice(0, cut)), START, None)
    watch.follow(
        ridges[cut:],
        _part(chain, ridges, slice(cut, None)),
        START + cut,
        None if rise is None else rise - cut,
    )
    return watch, rise


def _part(chain, ridges, rows):
    """Return what the chain made of some of the rows after the start."""
    again = SlipChain(chain.config)
    again.update(np.zeros((START, 2)))
    again.update(ridges[: rows.start])
    return again.update(ridges[rows])


def test_the_stages_sum_to_the_latency_in_their_order():
    watch, rise = followed([2.0, 0.0])
    stages = watch.stages()
    assert list(stages) == list(STAGES)
    assert sum(stages.values()) == rise
    assert min(stages.values()) >= 0
    # With a group of one channel the vote takes no time; windows of 40 ms do.
    assert stages['vote'] == 0
    assert stages['decision'] > 0


@pytest.mark.parametrize(
    ('strength', 'stage'), [(0.0, 'filter'), (0.2, 'filter'), (0.35, 'envelope')]
)
def test_a_slip_without_an_alarm_is_lost_at_the_first_stage_that_nothing_came_through(
    strength, stage
):
    watch, rise = followed([strength, 0.0])
    assert rise is None
    assert watch.stages() is None
    assert watch.lost_at() == stage


def test_only_the_group_that_decided_counts():
    alone, rise = followed([0.0, 2.0])
    both, same_rise = followed([0.31, 2.0])
    assert same_rise == rise
    assert both.stages() == alone.stages()
