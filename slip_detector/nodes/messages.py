"""What the nodes' topics share: quality of service and stamps."""

from builtin_interfaces.msg import Time
from rclpy.duration import Duration
from rclpy.qos import (
    DurabilityPolicy,
    HistoryPolicy,
    LivelinessPolicy,
    QoSProfile,
    ReliabilityPolicy,
)


def stamp_ns(stamp: Time) -> int:
    """Return a stamp in nanoseconds.

    Examples
    --------
    >>> stamp_ns(Time(sec=2, nanosec=5))
    2000000005
    """
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def time_message(nanoseconds: int) -> Time:
    """Return nanoseconds as a stamp.

    Examples
    --------
    >>> time_message(2_000_000_005)
    builtin_interfaces.msg.Time(sec=2, nanosec=5)
    """
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def sensor_qos() -> QoSProfile:
    """Return the profile of samples: best effort, with room for a stall of the reader.

    It is a second at 1 kHz.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=1000,
        reliability=ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.VOLATILE,
    )


def event_qos() -> QoSProfile:
    """Return the profile of events: each arrives, none is kept for late subscribers."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=10,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.VOLATILE,
    )


def state_qos(depth: int = 1, deadline_s: float | None = None) -> QoSProfile:
    """Return the profile of states: a late subscriber gets the last one at once.

    Parameters
    ----------
    depth
        How many messages are kept for a subscriber that is busy and must not miss a change.
    deadline_s
        Longest time from message to message that is promised, or asked for.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
        deadline=Duration() if deadline_s is None else Duration(seconds=deadline_s),
    )


def heartbeat_qos(deadline_s: float) -> QoSProfile:
    """Return the profile of states that are repeated.

    A subscriber that asks for the same, or for longer times, is told when the messages stop
    (deadline) and when no publisher is alive (liveliness). A publisher is alive while it
    publishes: one that hangs is not.

    Parameters
    ----------
    deadline_s
        Longest time from message to message that the publisher promises.
    """
    profile = state_qos(deadline_s=deadline_s)
    profile.liveliness = LivelinessPolicy.MANUAL_BY_TOPIC
    profile.liveliness_lease_duration = Duration(seconds=deadline_s)
    return profile
