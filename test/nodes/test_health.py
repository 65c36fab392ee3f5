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

import dataclasses
import math
import time

import numpy as np
import pytest

from slip_detector.nodes.health import ERROR, OK, WARN, Health
from slip_detector.parameters.detector import DetectorConfig

CONFIG = DetectorConfig(valid_range_v=(0.0, 5.0))


def feed(health, rows, first=0, rate_hz=380.0, valid=None, age_s=0.001):
    """Note rows one by one, as the node does."""
    valid = np.isfinite(rows) & (rows >= 0) & (rows <= 5) if valid is None else valid
    for k, row in enumerate(rows):
        stamp_ns = 10**18 + round((first + k) * 1e9 / rate_hz)
        health.note_rows(row[None], valid[k][None], stamp_ns, age_s, 1e-4)


def good(n):
    return 2.0 + 0.01 * np.random.default_rng(0).standard_normal((n, 16))


def sum_up(health, slip=False, valid=True):
    """Sum up a second; return the statuses of input, channels and decisions, and their levels."""
    health._summed_s = time.monotonic() - 1.0
    statuses = health.summary(slip, valid)
    assert [status.name for status in statuses] == ['input', 'channels', 'decisions']
    return statuses, [status.level for status in statuses]


def values(status):
    return {pair.key: pair.value for pair in status.values}


def test_all_is_well():
    health = Health(CONFIG)
    for second in range(2):
        feed(health, good(380), 380 * second)
        statuses, levels = sum_up(health, slip=True)
    assert levels == [OK] * 3
    said = '380.0 samples a second', 'all 16 channels are valid', 'slip is ON'
    assert tuple(status.message for status in statuses) == said
    assert values(statuses[0])['measured rate [Hz]'] == '380.00'
    assert values(statuses[1])['valid now'] == '16 of 16'
    assert values(statuses[2])['time per row [ms]'] == '0.100'


@pytest.mark.parametrize(('before', 'after'), [(0.975, 0.975), (1.0, 0.975), (1.0, 1.1)])
def test_a_rate_off_by_more_than_2_percent_is_an_error_within_5_seconds(before, after):
    health, end_s, statuses = Health(CONFIG), 0.0, []
    for second in range(8):
        rate_hz = 380 * (before if second < 3 else after)
        rows = good(round(rate_hz))
        feed(health, rows, first=end_s * rate_hz, rate_hz=rate_hz)
        end_s += len(rows) / rate_hz
        statuses.append(sum_up(health)[0][0])
    assert [status.level for status in statuses[:3]] == [OK if before == 1.0 else ERROR] * 3
    assert statuses[-1].level == ERROR
    assert float(values(statuses[-1])['measured rate [Hz]']) == pytest.approx(380 * after, 1e-3)


def test_other_publishers_and_warnings_of_the_chain_are_named():
    health = Health(CONFIG)
    health.senders = ['/index/slip_driver', '/slip_driver']
    health.detectors = ['/slip_detector', '/slip_detector']
    health.warnings = ['noise floor of ch1 at its upper limit: learn it']
    feed(health, good(380))
    (of_input, _, decisions), levels = sum_up(health, valid=False)
    assert of_input.message == (
        'the input is published by /index/slip_driver, /slip_driver: only one of them may'
    )
    assert 'slip is published by /slip_detector, /slip_detector:' in decisions.message
    assert 'slip_valid is false' in decisions.message
    assert levels == [ERROR, OK, ERROR]
    health.senders = health.detectors = []
    feed(health, good(380), 380)
    (_, _, decisions), levels = sum_up(health)
    assert (levels, decisions.message) == ([OK, OK, WARN], health.warnings[0])


@pytest.mark.parametrize(
    ('value', 'kind'),
    [
        (math.nan, 'not a number'),
        (5.0, 'at the upper rail'),
        (-0.5, 'at the lower rail'),
        (2.0, 'flat'),
    ],
)
def test_a_channel_that_gives_nothing_is_named_unless_it_is_disabled(value, kind):
    rows, valid = good(380), np.ones((380, 16), bool)
    rows[100:, 4] = value
    valid[100:, 4] = value == 5.0
    for disabled in (False, True):
        health = Health(dataclasses.replace(CONFIG, disabled_channels=(5,) * disabled))
        feed(health, rows, valid=valid)
        (_, status, _), _ = sum_up(health)
        assert status.level == (OK if disabled else WARN)
        assert values(status)[kind] == ('-' if disabled else 'ch5')
        assert disabled or status.message.startswith(f'{kind}: ch5: ')
        n_valid = 16 if value == 5.0 else 15
        assert values(status)['valid now'] == f'{n_valid} of {15 if disabled else 16}'
        assert values(status)['disabled'] == ('ch5' if disabled else '-')


def test_what_was_lost_is_complained_of_once_and_counted_on():
    health = Health(CONFIG)
    feed(health, good(100))
    health.totals['lost and bridged'] += 7
    health.totals['dropped, wrong number of channels'] += 1
    (status, *_), _ = sum_up(health)
    assert status.level == ERROR
    worst, other = status.message.split('; ')
    assert worst == '1 samples dropped: not as many channels as configured'
    assert other.startswith('7 samples lost and bridged')
    feed(health, good(100), 100)
    (status, *_), _ = sum_up(health)
    assert (status.level, values(status)['lost and bridged']) == (OK, '7')


def test_that_nothing_has_been_heard_is_no_error_at_first():
    health = Health(CONFIG)
    assert sum_up(health, valid=False)[1] == [WARN] * 3
    health._begun_s -= 3.0
    assert sum_up(health, valid=False)[1] == [ERROR] * 3
    # Of samples that are dropped it is not said that none come.
    health.totals['dropped, wrong names'] += 2
    words = '2 samples dropped: other channel names than before or configured'
    assert sum_up(health, valid=False)[0][0].message == words


def test_what_is_odd_about_the_stamps_is_said():
    health = Health(CONFIG)
    health.stamps = 'coarse'
    feed(health, good(100), age_s=10.0)
    (status, *_), _ = sum_up(health)
    assert 'stamps are coarse: rows are counted' in status.message
    assert 'stamps are 10.0 s behind the clock' in status.message
    assert (status.level, values(status)['stamps']) == (WARN, 'coarse')


def test_a_slow_sensor_is_not_taken_for_one_that_loses_samples():
    health = Health(CONFIG)
    for k, row in enumerate(good(300)):  # Each eighth sample comes after a bridged row.
        rows = np.repeat(row[None], 2 if k % 8 == 7 else 1, axis=0)
        health.totals['lost and bridged'] += len(rows) - 1
        health.note_rows(rows, np.ones(rows.shape, bool), round(k * 1e9 / 300), 0.001, 1e-4)
    assert values(sum_up(health)[0][0])['measured rate [Hz]'] == '300.00'
