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

"""Quality-of-service profiles of topics, the clock of timers, and conversion of stamps."""

from builtin_interfaces.msg import Time
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSProfile, ReliabilityPolicy

#: The clock of timers, which is never set: a replayed one may stand still.
STEADY = Clock(clock_type=ClockType.STEADY_TIME)


def stamp_ns(stamp: Time) -> int:
    """Return a stamp in nanoseconds."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def time_message(nanoseconds: int) -> Time:
    """Return nanoseconds as a stamp."""
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def sensor_qos() -> QoSProfile:
    """Return the profile of samples: best effort, with a queue of one second at 1 kHz."""
    return QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


def event_qos(depth: int = 10) -> QoSProfile:
    """Return the profile of events: all are delivered, none is kept for late subscribers."""
    return QoSProfile(depth=depth)  # Reliable and volatile, by default.


def state_qos(depth: int = 1, deadline_s: float = 0.0) -> QoSProfile:
    """Return the profile of states: a late subscriber gets the last one at once.

    Parameters
    ----------
    depth
        Queue length, for a subscriber that may be busy and must not miss a change.
    deadline_s
        Longest time between messages that a publisher promises or a subscriber requests; 0: any.
    """
    deadline, kept = Duration(seconds=deadline_s), DurabilityPolicy.TRANSIENT_LOCAL
    return QoSProfile(depth=depth, durability=kept, deadline=deadline)


def heartbeat_qos(deadline_s: float) -> QoSProfile:
    """Return the profile of states that are repeated.

    A subscriber that requests the same times, or longer ones, gets an event when the messages stop
    (deadline) and when no publisher is alive (liveliness). Only a publisher that publishes is
    alive, not one that hangs.
    """
    profile = state_qos(deadline_s=deadline_s)
    profile.liveliness = LivelinessPolicy.MANUAL_BY_TOPIC
    profile.liveliness_lease_duration = Duration(seconds=deadline_s)
    return profile
