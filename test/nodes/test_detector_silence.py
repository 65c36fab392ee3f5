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

"""What subscribers hear of lost input and of changes: a detector called by hand, by a clock."""

from dataclasses import replace
from itertools import count
from threading import Thread
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.detector import SUCCESS, Detector
from slip_detector.nodes.messages import heartbeat_qos
from slip_detector.nodes.outputs import DEADLINE_BEATS
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.recordings.messages import JointStateWriter

PERIOD_S = 1 / 380
CONFIG = DetectorConfig(channels=4, groups={'a': (1, 2), 'b': (3, 4)}, threshold=1e-9)
AT_REST = replace(CONFIG, threshold=1e9)
CHANGES = (
    {'groups.a': None, 'groups.b': None, 'groups.all': [1, 2, 3, 4]},
    {'channels': 2, 'groups.b': None},
    {'channels': 2, 'groups.a': None, 'groups.b': None, 'groups.all': [1, 2]},
    {'groups.a': None, 'groups.c': [1, 2]},
    {'disabled_channels': [1, 2]},
    {'channel_names': ['ch1', 'p', 'q', 'ch4']},
    {'publish_groups': False},
    {'publish_channels': False},
    *({'heartbeat_hz': hz} for hz in (0.1, 9.0, 100.0)),
    *({'input_timeout_s': timeout_s} for timeout_s in (0.05, 0.2, 1.0)),
    {'vote': 1},
    {'decision': 'evidence', 'noise_floor': [1e-6], 'threshold': 1e-3},
    {'gain': 50.0, 'mains_hz': 50.0},
    {'sample_rate_hz': 400.0},
    {'max_gap_s': 1.0, 'flat_after_s': 0.0},
    {'input_field': 'velocity'},
    {'input_type': 'std_msgs/msg/Float32MultiArray', 'input_field': 'data'},
)
#: What is sent for the k-th time in place of good samples; None: nothing.
LOST = {
    'silence': lambda k, good: None,
    'other channels': lambda k, good: good | {'volts': np.ones(5), 'names': 'abcde'},
    'other names': lambda k, good: good | {'names': 'abcde'[k % 2 :][: good['volts'].size]},
    'no message': lambda k, good: good | {'raw': b'\0' * (k % 40)},
    'wild stamps': lambda k, good: good | {'off_s': k * 1e4 * (-1) ** k},
    'late stamps': lambda k, good: good | {'off_s': -0.01 * k},
    'stamps of before': lambda k, good: good | {'off_s': -1000.0},
    'stamps of later': lambda k, good: good | {'off_s': 1000.0},
    'several senders': lambda k, good: good | {'number': 10**6 * (k % 2) + k, 'publishers': 2},
}


class ByHand(Detector):
    """A detector without middleware: time passes, and samples come, when the test says so."""

    get_logger, destroy_publisher, destroy_subscription = Mock(), Mock(), Mock()
    get_fully_qualified_name = Mock(return_value='/slip_detector')
    get_publishers_info_by_topic = Mock(return_value=[])
    resolve_topic_name = Mock(return_value='voltages')
    # The machine's clock, how far behind it the replayed one is, if time is replayed, and timers.
    now_s, behind_s, due = 1e6, None, ()

    def __init__(self):
        self._configured, self._running, self._samples = False, {}, None

    def get_clock(self):
        now = Time(nanoseconds=round((self.now_s - (self.behind_s or 0.0)) * 1e9))
        return SimpleNamespace(ros_time_is_active=self.behind_s is not None, now=lambda: now)

    def create_publisher(self, message_type, topic, qos):
        publisher = Mock(publish=lambda message: self.heard.append((topic, message)))
        publisher.get_subscription_count.return_value = 1
        return publisher

    def create_subscription(self, *arguments, **options):
        return Mock(topic_name='voltages', **{'get_publisher_count.return_value': 1})

    def create_timer(self, period_s, call, clock):
        self.due.append([self.now_s + period_s, period_s, call])
        return self.due[-1]

    def destroy_timer(self, timer):
        self.due.remove(timer)

    def begin(self, config=CONFIG):
        """Begin anew, and decide that everything slips, or nothing."""
        self.on_shutdown(None)
        self.heard, self.due, self.requested, self.behind_s = [], [], config, None
        self.numbers, self.random = count(1), np.random.default_rng(0)
        assert (self.on_configure(None), self.on_activate(None)) == (SUCCESS, SUCCESS)
        self.play(0.5)
        assert self.said()['slip_valid']
        assert self.said()['slip/channel/ch4'] == self.said()['slip'] == (config == CONFIG)

    def let_pass(self, seconds):
        self.now_s += seconds
        for timer in [*self.due]:
            if timer in self.due and self.now_s >= timer[0]:
                timer[0] = self.now_s + timer[1]
                timer[2]()

    def play(self, seconds, change=lambda k, good: good):
        for k in range(round(seconds / PERIOD_S)):
            self.let_pass(PERIOD_S)
            sample = change(k, {'volts': self.random.standard_normal(self.requested.channels)})
            if sample is not None:
                self.send(**sample)

    def send(self, volts, *, off_s=0.0, sent_s=None, names='', number=0, publishers=1, raw=None):
        if self._samples is None or self._active.input_type != CONFIG.input_type:
            return
        self._samples.get_publisher_count.return_value = publishers
        sent_ns = round((sent_s or self.now_s) * 1e9)
        writer = JointStateWriter('tip', names or self.requested.names)
        raw = writer.serialize(sent_ns + round(off_s * 1e9), volts) if raw is None else raw
        number = number or next(self.numbers)
        info = {'source_timestamp': sent_ns + 1, 'publication_sequence_number': number}
        self._on_voltages(raw, info)

    def states(self, topic):
        """Return what a topic has said."""
        return [message.data for heard, message in self.heard if heard == topic]

    def said(self):
        """Return whether the last message of each topic has anything true."""
        said = {t: m.data for t, m in self.heard if isinstance(m, Bool)}
        return said | {t: any(m.position[:2]) for t, m in self.heard if isinstance(m, JointState)}


class AtOnce(Thread):
    """The thread that builds filters, which takes no time by the clock of the test."""

    def start(self):
        super().start()
        self.join()


@pytest.fixture(scope='module')
def node():
    node, clock = ByHand(), Mock()
    clock.monotonic, clock.monotonic_ns = lambda: node.now_s, lambda: round(node.now_s * 1e9)
    with pytest.MonkeyPatch.context() as patch:
        for module in ('detector', 'inputs'):
            patch.setattr(f'slip_detector.nodes.{module}.time', clock)
        patch.setattr('threading.Thread', AtOnce)
        yield node


@example(CONFIG, [CHANGES[0]], True, 'silence')
@example(AT_REST, [CHANGES[2]], False, 'other channels')
@given(
    st.sampled_from([CONFIG, AT_REST]),
    st.lists(st.sampled_from(CHANGES), max_size=3),
    st.booleans(),
    st.sampled_from([*LOST]),
)
def test_one_timeout_after_the_last_usable_sample_nothing_is_said_to_be_true(
    node, begins, changes, follows, way
):
    node.begin(begins)
    for change in [*changes, {'max_age_s': 100.0 * way.startswith('stamps of')}]:
        try:
            config = node.requested.with_values(change)
            node._check(config)
        except ValueError:  # It does not go with the others.
            continue
        node._apply(config)
        node.play(0.15 * follows)
    node.play(2 * PERIOD_S, LOST[way])  # After a change one of these may be usable.
    node.play(node.requested.input_timeout_s + PERIOD_S, LOST[way])
    assert not any(node.said().values()), node.said()


@pytest.mark.parametrize('first', ['message', 'timer'])
def test_what_waited_while_the_node_was_held_up_is_not_said_until_it_is_new_enough(node, first):
    node.begin()
    sent_s, ages_s = node.now_s, []
    for k in count():
        sent_s += PERIOD_S
        node.heard.clear()
        node.now_s += {0: 5.0, 500: 2.0}.get(k, 0.0)
        if sent_s > node.now_s:
            break
        if k or first == 'timer':
            node.let_pass(1e-4)
        node.send(node.random.standard_normal(4), sent_s=sent_s)
        ages_s += [node.now_s - sent_s] * any(node.states('slip_valid'))
    assert 0.9 < max(ages_s) / CONFIG.input_timeout_s <= 1.0


@pytest.mark.parametrize(('wrong', 'of'), [(1, 30), (3, 4)])
def test_stamps_that_are_wrong_now_and_then_interrupt_nothing_and_most_of_them_all(
    node, wrong, of
):
    def change(k, good):
        return good | {'off_s': node.random.uniform(-1e7, 1e7) * (k % of < wrong)}

    node.begin()
    node.heard.clear()
    node.play(3.0, change)
    if wrong == 1:
        assert all(node.states('slip') + node.states('slip_valid'))
    assert node.said()['slip'] == node.said()['slip_valid'] == (wrong == 1)


def test_no_change_in_the_middle_of_a_slip_interrupts_it_or_makes_an_onset(node):
    node.begin()
    for values in (
        {'threshold': 2e-9},
        {'passband_hz': [10.0, 60.0]},
        {'heartbeat_hz': 20.0},
        {'publish_channels': False},
        {'publish_groups': False, 'input_timeout_s': 0.4},
        {'publish_groups': True, 'publish_channels': True, 'heartbeat_hz': 10.0},
        {'groups.a': None, 'groups.b': None, 'groups.all': [4, 3, 1, 2]},
        {'disabled_channels': [4]},
        {'sample_rate_hz': 381.0},
    ):
        node.heard.clear()
        node._apply(node.requested.with_values(values))
        node.play(0.5)
        slip = node.states('slip')
        # A chain that starts again is OFF at first; that it comes ON again is no onset.
        assert all(slip + node.states('slip_valid')) == ('sample_rate_hz' not in values), values
        assert slip[-1]
        assert 'slip_onset' not in dict(node.heard)


def test_deactivated_it_says_nothing_and_leaves_no_state_that_is_not_true(node):
    node.begin()
    node.on_deactivate(None)
    assert not any(node.said().values())
    node.heard.clear()
    node.play(1.0)
    assert not node.heard
    node.on_activate(None)
    node.play(0.5)
    assert node.said()['slip'] == node.said()['slip_valid'] is True


def test_the_timeout_follows_a_replayed_clock_however_slow_it_is(node):
    node.begin()
    node.behind_s = 0.0
    for _ in range(1000):
        node.behind_s += 0.999 * PERIOD_S
        node.let_pass(PERIOD_S)
        assert node.said()['slip_valid']
    node.play(CONFIG.input_timeout_s, LOST['silence'])
    assert not any(node.said().values())


def test_a_recording_that_starts_again_goes_on(node):
    node.begin()
    node.behind_s = 0.0
    node.play(0.5)
    node.behind_s = 0.5
    # The first tenth of a second is taken for late samples.
    node.play(0.5, lambda k, good: good | {'off_s': -0.5})
    assert node.said()['slip'] == node.said()['slip_valid'] is True
    assert node._health.totals['restarts'] == 1


@pytest.mark.parametrize('own_hz', [0.5, 10.0])
def test_another_detector_whose_heart_beats_slowly_is_noticed_from_beat_to_beat(
    node, monkeypatch, own_hz
):
    node.begin()
    node._apply(CONFIG.with_values({'heartbeat_hz': own_hz}))
    profiles = [heartbeat_qos(DEADLINE_BEATS / hz) for hz in (own_hz, 0.5)]
    beating = Mock(return_value=[Mock(qos_profile=profile) for profile in profiles])
    monkeypatch.setattr(node, 'get_publishers_info_by_topic', beating)
    node._heartbeats.get_publisher_count.return_value = 2
    numbers, said = count(1), []
    for others in range(1000, 1004):
        for _ in range(round(2.0 * own_hz)):
            node._on_slip_valid(None, {'publication_sequence_number': next(numbers)})
            node.heard.clear()
            node.play(1 / own_hz)
            said += node.states('slip_valid')
        node._on_slip_valid(None, {'publication_sequence_number': others})
        said *= others > 1000
    assert said
    assert not any(said)
