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

"""Where the time of a detection goes, followed row by row."""

import dataclasses

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


def followed(strengths, rows=200, config=CONFIG):
    """Watch a slip that begins at row ``START`` with so strong ridges on each channel."""
    time_s = np.arange(rows) / RATE_HZ
    ridges = np.sin(2 * np.pi * 50.0 * time_s)[:, np.newaxis] * strengths
    chain, watch = SlipChain(config), StageWatch(config)
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
    return again.update(ridges[rows], floor=chain.config.decision == 'evidence')


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


def by_evidence(**values):
    given = {'decision': 'evidence', 'noise_floor': 0.1, 'threshold': 0.2, 'flat_after_s': 0.0}
    return dataclasses.replace(CONFIG, **given | values)


def test_the_stages_of_evidence_are_passing_the_floor_by_the_offset_and_the_threshold():
    config = by_evidence()
    watch, rise = followed([2.0, 0.0], config=config)
    stages = watch.stages()
    assert sum(stages.values()) == rise
    # The excess is at its cap at once: what is above the offset of it grows to the threshold.
    grown = config.threshold / (config.evidence_cap_db - config.evidence_offset_db)
    assert stages['decision'] == pytest.approx(grown * RATE_HZ, abs=2)
    assert stages['filter'] + stages['envelope'] <= 5
    # Floor and offset together are 0.15.
    quiet, rise = followed([0.1, 0.0], config=config)
    assert rise is None
    assert quiet.lost_at() == 'filter'
    slow, rise = followed([0.5, 0.0], config=by_evidence(threshold=1.2), rows=40)
    assert rise is None
    assert slow.lost_at() == 'decision'
