"""The detector node: samples in, slip out."""

import time
from collections import Counter

import numpy as np
from numpy.typing import NDArray
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Header

from slip_detector.chain import SlipChain, SlipResult
from slip_detector.config import DetectorConfig
from slip_detector.fields import FieldReader
from slip_detector.nodes.messages import (
    event_qos,
    sensor_qos,
    stamp_ns,
    state_qos,
    time_message,
)
from slip_detector.nodes.parameters import declare
from slip_detector.timeline import Timeline

#: The promised longest silence of ``slip``, in periods of the heartbeat.
DEADLINE_BEATS = 2.0

#: The input is looked at this often in ``input_timeout_s``, and given up after so many looks in
#: vain: between 0.8 and 0.9 of the timeout after its last sample.
LOOKS, LOOKS_IN_VAIN = 10, 8

#: One line of a kind on the log in this time.
LOG_PERIOD_NS = 1_000_000_000


class Detector(Node):
    """Runs the chain on each sample and publishes what changed."""

    def __init__(self) -> None:
        super().__init__('slip_detector')
        self.config = config = declare(self, DetectorConfig)
        self.counts: Counter[str] = Counter()
        self._logged_ns: dict[str, int] = {}
        self._chain = SlipChain(config)
        self._read = FieldReader('position')
        self._timeline = Timeline(1 / config.sample_rate_hz, config.max_gap_s)
        self._period_ns = 1e9 / config.sample_rate_hz
        self._names: list[str] | None = list(config.channel_names) or None
        self._frame_id = ''
        self._last_row: NDArray[np.float64] | None = None
        self._heard = False
        self._looks_in_vain = 0

        beat = state_qos(DEADLINE_BEATS / config.heartbeat_hz)
        self._slip = self._publisher(Bool, 'slip', beat)
        self._slip_valid = self._publisher(Bool, 'slip_valid', beat)
        self._onset = self._publisher(Header, 'slip_onset', event_qos())
        self._envelope = self._publisher(JointState, '~/envelope', sensor_qos())
        groups = config.groups if config.publish_groups else ()
        channels = config.names if config.publish_channels else ()
        disabled = {channel - 1 for channel in config.disabled_channels}
        n_groups = len(config.groups)
        # Column of the result's flags -> who hears of its changes.
        self._listeners: dict[int, Publisher] = {0: self._slip}
        for g, name in enumerate(groups):
            self._listeners[1 + g] = self._publisher(Bool, f'slip/group/{name}', state_qos())
        for c, name in enumerate(channels):
            if c not in disabled:
                self._listeners[1 + 2 * n_groups + c] = self._publisher(
                    Bool, f'slip/channel/{name}', state_qos()
                )
        self._can_vote = slice(1 + n_groups, 1 + 2 * n_groups)
        self._messages = (Bool(data=False), Bool(data=True))
        self._all_off = np.zeros(1 + 2 * n_groups + 2 * config.channels, np.bool_)
        self._flags = self._all_off
        self._flags_bytes = self._flags.tobytes()
        self._valid = False
        for publisher in (*self._listeners.values(), self._slip_valid):
            publisher.publish(self._messages[False])

        self.create_subscription(JointState, 'voltages', self._on_voltages, sensor_qos())
        # A clock that is set back, or that nobody publishes, must not stop the heart. Only where
        # time is replayed does the timeout follow it.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        replayed = self.get_parameter('use_sim_time').value
        self.create_timer(1 / config.heartbeat_hz, self._beat, clock=steady)
        self.create_timer(
            config.input_timeout_s / LOOKS,
            self._look_for_input,
            clock=self.get_clock() if replayed else steady,
        )
        self.get_logger().info(
            f'{config.channels - len(disabled)} channels at {config.sample_rate_hz:g} Hz, '
            f'groups {", ".join(config.groups)}'
        )

    def _publisher(self, message_type: type, topic: str, qos: QoSProfile) -> Publisher:
        """Create a publisher that does not look for subscribers with another QoS.

        rclpy would do so in each turn of the executor, which for 24 publishers costs more than
        all else together; such a subscriber is warned on its own side as well.
        """
        events = PublisherEventCallbacks(use_default_callbacks=False)
        return self.create_publisher(message_type, topic, qos, event_callbacks=events)

    def _on_voltages(self, message: JointState) -> None:
        """Check a sample, run it through the chain and publish what changed."""
        row = self._read(message)
        if row.shape[1] != self.config.channels:
            self._drop(
                'channels',
                f'a message has {row.shape[1]} channels, allowed: {self.config.channels}',
            )
            return
        if message.name != self._names and not self._take_names(message.name):
            return
        at_ns = stamp_ns(message.header.stamp)
        arrival = self._timeline.arrive(at_ns)
        if arrival.missing or arrival.reset or not arrival.accepted:
            if not arrival.accepted:
                self._drop('backwards', 'the stamp of a message is not after the one before')
                return
            row = self._mend(row, arrival.missing)
        self._heard = True
        listened = self._envelope.get_subscription_count() > 0
        result = self._chain.update(row, envelope=False, level=listened)
        self._last_row = row[-1:]
        self._frame_id = message.header.frame_id
        first_ns = at_ns - round((len(row) - 1) * self._period_ns)
        for i in range(len(row)):
            self._announce(result.flags[i], first_ns + round(i * self._period_ns))
        if listened:
            self._publish_envelope(message, result)

    def _take_names(self, names: list[str]) -> bool:
        """Take the names of the first sample for those of all; refuse others later."""
        if self._names is None and len(names) in (0, self.config.channels):
            self._names = list(names)
            return True
        wanted = f'{self.config.channels} names' if self._names is None else _short(self._names)
        self._drop('names', f'the channels of a message are {_short(names)}, allowed: {wanted}')
        return False

    def _mend(self, row: NDArray[np.float64], missing: int) -> NDArray[np.float64]:
        """Bridge a short gap with the last row, start anew after a long one."""
        if missing and self._last_row is not None:
            self._log('bridged', f'{missing} samples missing, bridged with the last one', missing)
            return np.concatenate([np.repeat(self._last_row, missing, axis=0), row])
        self._log('reset', 'the input had a gap or its clock was set, the chain starts anew')
        self._chain.reset()
        return row

    def _announce(self, flags: NDArray[np.bool_], at_ns: int) -> None:
        """Publish each decision that differs from the last."""
        flags_bytes = flags.tobytes()
        if flags_bytes != self._flags_bytes:
            before, self._flags, self._flags_bytes = self._flags, flags, flags_bytes
            for column in np.flatnonzero(flags != before).tolist():
                publisher = self._listeners.get(column)
                if publisher is not None:
                    publisher.publish(self._messages[bool(flags[column])])
            if flags[0] and not before[0]:
                self._onset.publish(Header(stamp=time_message(at_ns), frame_id=self._frame_id))
        valid = bool(self._flags[self._can_vote].any())
        if valid != self._valid:
            self._valid = valid
            self._slip_valid.publish(self._messages[valid])

    def _publish_envelope(self, message: JointState, result: SlipResult) -> None:
        self._envelope.publish(
            JointState(
                header=message.header,
                name=self.config.names,
                position=result.level[-1],
                effort=result.channels[-1].astype(np.float64),
            )
        )

    def _beat(self) -> None:
        self._slip.publish(self._messages[bool(self._flags[0])])
        self._slip_valid.publish(self._messages[self._valid])

    def _look_for_input(self) -> None:
        """Withdraw the decisions when no sample comes any more."""
        if self._heard:
            self._heard, self._looks_in_vain = False, 0
            return
        self._looks_in_vain += 1
        if self._looks_in_vain == LOOKS_IN_VAIN and self._last_row is not None:
            self._log('silent', 'no input any more')
            self._announce(self._all_off, 0)

    def _drop(self, kind: str, what: str) -> None:
        self._log(kind, f'{what}: dropped')

    def _log(self, kind: str, what: str, count: int = 1) -> None:
        """Count, and say so at most once a second and kind."""
        self.counts[kind] += count
        now_ns = time.monotonic_ns()
        if now_ns - self._logged_ns.get(kind, -LOG_PERIOD_NS) >= LOG_PERIOD_NS:
            self._logged_ns[kind] = now_ns
            self.get_logger().warning(f'{what} ({self.counts[kind]} so far)')


def _short(names: list[str]) -> str:
    text = ', '.join(names[:4])
    return f'{text}, ... ({len(names)})' if len(names) > 4 else text or 'without names'
