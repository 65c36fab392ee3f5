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

"""What is said of the detector's input and load."""

import math
import time

import numpy as np
import pytest

from slip_detector.nodes.health import ERROR, OK, WARN, Health
from slip_detector.parameters.detector import DetectorConfig

CONFIG = DetectorConfig(valid_range_v=(0.0, 5.0))
PERIOD_NS = 1e9 / 380


def fed(health, rows, first=0, period_ns=PERIOD_NS, valid=None, spent_s=1e-4):
    """Note rows one by one, as the node does."""
    valid = np.isfinite(rows) & (rows >= 0) & (rows <= 5) if valid is None else valid
    for k, row in enumerate(rows):
        stamp_ns = 10**18 + round((first + k) * period_ns)
        health.note_rows(row[None], valid[k][None], stamp_ns, 0.001, spent_s)
    return first + len(rows)


def good(n):
    return 2.0 + 0.01 * np.random.default_rng(0).standard_normal((n, 16))


def summed(health, slip=False, valid=True):
    """Sum up a second."""
    health._summed_s = time.monotonic() - 1.0
    statuses = health.summary(slip, valid)
    assert [status.name for status in statuses] == ['input', 'channels', 'decisions']
    return statuses


def values(status):
    return {pair.key: pair.value for pair in status.values}


def test_all_is_well():
    health = Health(CONFIG)
    first = fed(health, good(380))
    summed(health)
    fed(health, good(380), first)
    statuses = summed(health, slip=True)
    assert [status.level for status in statuses] == [OK] * 3
    assert statuses[0].message == '380.0 samples a second'
    assert values(statuses[0])['measured rate [Hz]'] == '380.00'
    assert statuses[1].message == 'all 16 channels are valid'
    assert values(statuses[1])['valid now'] == '16 of 16'
    assert statuses[2].message == 'slip is ON'
    assert values(statuses[2])['time per row [ms]'] == '0.100'


@pytest.mark.parametrize(('before', 'after'), [(0.975, 0.975), (1.0, 0.975), (1.0, 1.1)])
def test_a_rate_off_by_more_than_2_percent_is_an_error_within_5_seconds(before, after):
    health, end_ns, statuses = Health(CONFIG), 0, []
    for second in range(8):
        period_ns = PERIOD_NS / (before if second < 3 else after)
        stamps_ns = end_ns + np.rint(np.arange(1, round(1e9 / period_ns) + 1) * period_ns)
        end_ns = int(stamps_ns[-1])
        for row, stamp_ns in zip(good(len(stamps_ns)), stamps_ns.tolist(), strict=True):
            health.note_rows(row[None], np.ones((1, 16), bool), int(stamp_ns), 0.001, 1e-4)
        statuses.append(summed(health)[0])
    assert [status.level for status in statuses[:3]] == [OK if before == 1.0 else ERROR] * 3
    assert statuses[-1].level == ERROR
    assert float(values(statuses[-1])['measured rate [Hz]']) == pytest.approx(380 * after, 1e-3)


def test_who_publishes_beside_the_one_that_may_is_named():
    health = Health(CONFIG)
    first = fed(health, good(380))
    health.senders = ['/index/slip_driver', '/slip_driver']
    health.detectors = ['/slip_detector', '/slip_detector']
    statuses = summed(health, valid=False)
    assert statuses[0].message == (
        'the input is published by /index/slip_driver, /slip_driver: only one of them may'
    )
    assert 'slip is published by /slip_detector, /slip_detector:' in statuses[2].message
    assert [status.level for status in statuses] == [ERROR, OK, ERROR]
    health.senders = health.detectors = []
    fed(health, good(380), first)
    assert [status.level for status in summed(health)] == [OK] * 3


@pytest.mark.parametrize(
    ('value', 'kind'),
    [(math.nan, 'not a number'), (5.0, 'at the upper rail'), (-0.5, 'at the lower rail')],
)
def test_a_channel_that_gives_nothing_is_named(value, kind):
    health = Health(CONFIG)
    rows = good(380)
    rows[100:, 4] = value
    fed(health, rows)
    status = summed(health)[1]
    assert status.level == WARN
    assert status.message.startswith(f'{kind}: ch5: ')
    assert values(status)[kind] == 'ch5'
    assert values(status)['valid now'] == ('16 of 16' if value == 5.0 else '15 of 16')


def test_disabled_channels_are_not_complained_of():
    health = Health(DetectorConfig(disabled_channels=(3,)))
    rows = good(100)
    rows[:, 2] = np.nan
    valid = np.ones(rows.shape, bool)
    valid[:, 2] = False
    fed(health, rows, valid=valid)
    status = summed(health)[1]
    assert status.level == OK
    assert values(status)['valid now'] == '15 of 15'
    assert values(status)['disabled'] == 'ch3'


def test_what_was_lost_is_complained_of_once_and_counted_on():
    health = Health(CONFIG)
    first = fed(health, good(100))
    health.totals['lost and bridged'] += 7
    health.totals['dropped, wrong number of channels'] += 1
    status = summed(health)[0]
    assert status.level == ERROR
    worst, other = status.message.split('; ')
    assert worst == '1 samples dropped: not as many channels as configured'
    assert other.startswith('7 samples lost and bridged')
    fed(health, good(100), first)
    status = summed(health)[0]
    assert status.level == OK
    assert values(status)['lost and bridged'] == '7'


def test_that_nothing_has_been_heard_is_no_error_at_first():
    health = Health(CONFIG)
    assert [status.level for status in summed(health, valid=False)] == [WARN] * 3
    health._begun_s -= 3.0
    assert [status.level for status in summed(health, valid=False)] == [ERROR] * 3
    # Of samples that are dropped it is not said that none come.
    health.totals['dropped, wrong names'] += 2
    words = '2 samples dropped: other channel names than before or configured'
    assert summed(health, valid=False)[0].message == words


def test_decisions_that_mean_nothing_are_warned_of():
    health = Health(CONFIG)
    fed(health, good(380))
    health.warnings = ['noise floor of ch1 at its upper limit: learn it']
    statuses = summed(health)
    assert [status.level for status in statuses] == [OK, OK, WARN]
    assert statuses[2].message == health.warnings[0]


def test_what_is_odd_about_the_stamps_is_said():
    health = Health(CONFIG)
    health.stamps = 'coarse'
    for k, row in enumerate(good(100)):
        health.note_rows(row[None], np.ones((1, 16), bool), round(k * PERIOD_NS), 10.0, 1e-4)
    status = summed(health)[0]
    assert 'stamps are coarse: rows are counted' in status.message
    assert 'stamps are 10.0 s behind the clock' in status.message
    assert (status.level, values(status)['stamps']) == (WARN, 'coarse')


def test_a_slow_sensor_is_not_taken_for_one_that_loses_samples():
    health = Health(CONFIG)
    for k, row in enumerate(good(300)):  # Each eighth sample comes after a bridged row.
        rows = np.repeat(row[None], 2 if k % 8 == 7 else 1, axis=0)
        health.totals['lost and bridged'] += len(rows) - 1
        health.note_rows(rows, np.ones(rows.shape, bool), round(k * 1e9 / 300), 0.001, 1e-4)
    assert values(summed(health)[0])['measured rate [Hz]'] == '300.00'
