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
from types import SimpleNamespace

import numpy as np
import pytest

from slip_detector.nodes.health import ERROR, OK, WARN, Health, Note
from slip_detector.nodes.inputs import Senders
from slip_detector.parameters.detector import DetectorConfig

CONFIG = DetectorConfig(valid_range_v=(0.0, 5.0))


class Observed(Health):
    """The health of a detector whose chain, outputs and stamps are as a test says."""

    def __init__(self, config=CONFIG):
        self.chain = SimpleNamespace(config=config, look=dict)
        self.outputs = SimpleNamespace(slip=False, valid=True, onsets=0)
        self.stamps = SimpleNamespace(kind='regular', wrong=0)
        super().__init__(self.chain, self.outputs)
        self.senders = self.detectors = Senders(lambda: 1.0)
        self.forget(self.stamps)

    def feed(self, rows, first=0, rate_hz=380.0, valid=None, age_s=0.001):
        """Note rows one by one, as the node does."""
        valid = np.isfinite(rows) & (rows >= 0) & (rows <= 5) if valid is None else valid
        for k, row in enumerate(rows):
            stamp_ns = 10**18 + round((first + k) * 1e9 / rate_hz)
            self.note(Note(row[None], valid[k][None], stamp_ns, age_s, 1e-4))

    def sum_up(self):
        """Sum up a second; return the statuses of the four tasks."""
        self._summed_s = time.monotonic() - 1.0
        statuses = self.summary()
        names = [status.name for status in statuses]
        assert names == ['input', 'timing', 'channels', 'decisions']
        return statuses


def good(n):
    return 2.0 + 0.01 * np.random.default_rng(0).standard_normal((n, 16))


def levels(statuses):
    return [status.level for status in statuses]


def values(status):
    return {pair.key: pair.value for pair in status.values}


def test_all_is_well():
    health = Observed()
    health.outputs.slip = True
    for second in range(2):
        health.feed(good(380), 380 * second)
        statuses = health.sum_up()
    assert levels(statuses) == [OK] * 4
    said = (
        '380 samples since the last report',
        '380.0 samples a second',
        'all 16 channels are valid',
        'slip is ON',
    )
    assert tuple(status.message for status in statuses) == said
    of_input, timing, channels, decisions = map(values, statuses)
    assert of_input['samples'] == '760'
    assert timing['measured rate [Hz]'] == '380.00'
    assert channels['valid now'] == '16 of 16'
    assert decisions['time per row [ms]'] == '0.100'


@pytest.mark.parametrize(('before', 'after'), [(0.975, 0.975), (1.0, 0.975), (1.0, 1.1)])
def test_a_rate_off_by_more_than_2_percent_is_an_error_within_5_seconds(before, after):
    health, end_s, statuses = Observed(), 0.0, []
    for second in range(8):
        rate_hz = 380 * (before if second < 3 else after)
        rows = good(round(rate_hz))
        health.feed(rows, first=end_s * rate_hz, rate_hz=rate_hz)
        end_s += len(rows) / rate_hz
        statuses.append(health.sum_up()[1])
    assert levels(statuses[:3]) == [OK if before == 1.0 else ERROR] * 3
    assert statuses[-1].level == ERROR
    assert float(values(statuses[-1])['measured rate [Hz]']) == pytest.approx(380 * after, 1e-3)


def test_other_publishers_and_warnings_of_the_chain_are_named():
    health = Observed()
    names = ['/index/slip_driver', '/slip_driver']
    health.senders = Senders(lambda: 1.0, 'the input', lambda: names)
    health.detectors = Senders(lambda: 1.0, 'slip', lambda: ['/slip_detector'] * 2)
    for each in (health.senders, health.detectors):
        # Without numbers each publisher is taken to send.
        assert not each.accepts(None, publishers=2)
    health.chain.look = lambda: {'upper': [0]}
    health.outputs.valid = False
    health.feed(good(380))
    statuses = health.sum_up()
    said = 'the input is published by /index/slip_driver, /slip_driver: only one of them may'
    assert statuses[0].message == said
    assert 'slip is published by /slip_detector, /slip_detector:' in statuses[3].message
    assert 'slip_valid is false' in statuses[3].message
    assert levels(statuses) == [ERROR, OK, OK, ERROR]
    for each in (health.senders, health.detectors):
        assert each.accepts(None, publishers=1)
    health.outputs.valid = True
    health.feed(good(380), 380)
    statuses = health.sum_up()
    assert levels(statuses) == [OK, OK, OK, WARN]
    assert statuses[3].message.startswith('noise floor of ch1 at its upper limit')


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
        health = Observed(dataclasses.replace(CONFIG, disabled_channels=(5,) * disabled))
        health.feed(rows, valid=valid)
        status = health.sum_up()[2]
        assert status.level == (OK if disabled else WARN)
        assert values(status)[kind] == ('-' if disabled else 'ch5')
        assert disabled or status.message.startswith(f'{kind}: ch5: ')
        n_valid = 16 if value == 5.0 else 15
        assert values(status)['valid now'] == f'{n_valid} of {15 if disabled else 16}'
        assert values(status)['disabled'] == ('ch5' if disabled else '-')


def test_what_was_lost_is_complained_of_once_and_counted_on():
    health = Observed()
    health.feed(good(100))
    health.totals['lost and bridged'] += 7
    health.totals['dropped, wrong number of channels'] += 1
    status = health.sum_up()[0]
    assert status.level == ERROR
    worst, other = status.message.split('; ')
    assert worst == '1 samples dropped: not as many channels as configured'
    assert other.startswith('7 samples lost and bridged')
    health.feed(good(100), 100)
    status = health.sum_up()[0]
    assert (status.level, values(status)['lost and bridged']) == (OK, '7')


def test_that_nothing_has_been_heard_is_no_error_at_first():
    health = Observed()
    health.outputs.valid = False
    assert levels(health.sum_up()) == [WARN, OK, WARN, WARN]
    health._begun_s -= 3.0
    statuses = health.sum_up()
    assert levels(statuses) == [ERROR, OK, ERROR, ERROR]
    assert statuses[1].message == 'no samples'
    # Of samples that are dropped it is not said that none come.
    health.totals['dropped, wrong names'] += 2
    words = '2 samples dropped: other channel names than before or configured'
    assert health.sum_up()[0].message == words


def test_what_is_odd_about_the_stamps_is_said():
    health = Observed()
    health.stamps.kind, health.stamps.wrong = 'coarse', 3
    health.feed(good(100), age_s=10.0)
    of_input, timing, *_ = health.sum_up()
    assert of_input.message.startswith('3 samples taken in their order: the stamp is later')
    assert 'stamps are coarse: rows are counted' in timing.message
    assert 'stamps are 10.0 s behind the clock' in timing.message
    assert (timing.level, values(timing)['stamps']) == (WARN, 'coarse')


def test_a_slow_sensor_is_not_taken_for_one_that_loses_samples():
    health = Observed()
    for k, row in enumerate(good(300)):  # Each eighth sample comes after a bridged row.
        rows = np.repeat(row[None], 2 if k % 8 == 7 else 1, axis=0)
        health.totals['lost and bridged'] += len(rows) - 1
        health.note(Note(rows, np.ones(rows.shape, bool), round(k * 1e9 / 300), 0.001, 1e-4))
    assert values(health.sum_up()[1])['measured rate [Hz]'] == '300.00'
