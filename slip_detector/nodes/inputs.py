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

"""Reads samples from messages of any type, and detects several nodes that send on a topic."""

import contextlib
import importlib
import os
import re
import time
from pathlib import Path
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from slip_detector.nodes.messages import stamp_ns
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.recordings.messages import FieldReader, JointStateReader, Sample

#: Most messages of a publisher that may be lost in a row; after a larger step of the numbers it
#: counts as another publisher.
MOST_LOST = 1000

#: Most publishers that can be distinguished.
MOST_SENDERS = 8

_TYPE = re.compile(r'(?P<package>\w+)/(msg/)?(?P<name>\w+)')


class Input:
    """Reads rows, stamps and channel names, if any, from messages of ``input_type``.

    Parameters
    ----------
    config
        The detector's parameters, of which ``input_type`` and ``input_field`` are used.

    Attributes
    ----------
    message_class : type
        The class of the messages.
    has_names : bool
        Whether the messages have the names of the channels, in the field ``name``.

    Raises
    ------
    ValueError
        When the type is not installed or has no such field.

    Examples
    --------
    >>> source = Input(DetectorConfig(input_type='sensor_msgs/JointState', input_field='position'))
    >>> source.message_class.__name__, source.has_names
    ('JointState', True)
    """

    def __init__(self, config: DetectorConfig) -> None:
        self.message_class = message_class(config.input_type)
        self._field = FieldReader(config.input_field)
        fields = self.message_class.get_fields_and_field_types()
        first = re.split(r'[.\[]', config.input_field, maxsplit=1)[0]
        if first not in fields:
            raise ValueError(
                f'parameter input_field is {config.input_field!r}, allowed: in a '
                f'{config.input_type} a path that begins with {", ".join(fields)}'
            )
        self._has_header = fields.get('header') == 'std_msgs/Header'
        self.has_names = fields.get('name') == 'sequence<string>'
        self._type = config.input_type
        # The usual kind of input, one message for each sample, for which there is a faster reader.
        quick = self.message_class is JointState and config.input_field == 'position'
        self._reader = JointStateReader() if quick else None

    def read(self, raw: bytes, info: dict[str, int | None], replayed: bool = False) -> Sample:
        """Return the samples of a serialised message.

        The stamp is that of the header. Without a header, or with the stamp 0, it is the time at
        which the message was published, or None if time is replayed. As a busy machine publishes
        late, lost messages are then noticed by the number of the message, not by its time.

        Parameters
        ----------
        raw
            The serialised message.
        info
            The middleware's information on the message, of which ``source_timestamp`` and
            ``publication_sequence_number`` are used.
        replayed
            Whether time is replayed from a bag. Then the time at which the middleware published a
            message does not tell when its samples were taken.

        Raises
        ------
        ValueError
            When the message cannot be read or does not have the field.
        """
        sample = None
        if self._reader is not None:
            with contextlib.suppress(ValueError):  # Perhaps the middleware can read it.
                sample = self._reader.read(raw)
        if sample is None:
            sample = self._read_whole(raw)
        if sample.stamp_ns:
            return sample
        if replayed:
            return sample._replace(stamp_ns=None)
        return sample._replace(
            stamp_ns=info['source_timestamp'], number=info['publication_sequence_number']
        )

    def _read_whole(self, raw: bytes) -> Sample:
        try:
            message = deserialize_message(raw, self.message_class)
        except RuntimeError:  # Its text speaks of the middleware's code.
            raise ValueError(f'a message is no {self._type}') from None
        rows = self._field(message)
        header = message.header if self._has_header else None
        return Sample(
            rows,
            None if header is None else stamp_ns(header.stamp),
            list(message.name) if self.has_names else [],
            '' if header is None else str(header.frame_id),
        )


def message_class(name: str) -> Any:
    """Return the class of a message type.

    A module is imported only if the ament index has the type: importing any other module would run
    code that has nothing to do with messages.

    Parameters
    ----------
    name
        ``package/msg/Type`` or ``package/Type``.

    Raises
    ------
    ValueError
        When the type is not installed.

    Examples
    --------
    >>> message_class('sensor_msgs/JointState') is JointState
    True
    """
    match = _TYPE.fullmatch(name)
    if match and f'msg/{match["name"]}.msg' in _interfaces_of(match['package']):
        with contextlib.suppress(ImportError, AttributeError):
            module = importlib.import_module(f'{match["package"]}.msg')
            return getattr(module, match['name'])
    raise ValueError(
        f'parameter input_type is {name!r}, allowed: the name of an installed message type, '
        'such as sensor_msgs/msg/JointState'
    )


def _interfaces_of(package: str) -> set[str]:
    """Return the interface files of a package in the ament index, such as ``msg/JointState.msg``.

    The index is in the folders of ``AMENT_PREFIX_PATH``, and where rclpy is installed, as its
    wheels do not set that variable.
    """
    prefixes = [Path(text) for text in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)]
    prefixes += Path(rclpy.__file__).parents[4:5]  # of lib/python3.12/site-packages/rclpy
    for prefix in prefixes:
        file = prefix / 'share/ament_index/resource_index/rosidl_interfaces' / package
        with contextlib.suppress(OSError):
            return set(file.read_text(encoding='utf-8').split())
    return set()


class Senders:
    """Detects by the numbers of messages whether several publishers send on a topic.

    The middleware numbers the messages of each publisher. With one publisher each message has the
    next number; if two publishers send, the numbers alternate between two sequences. A publisher
    that exists but does not send is ignored: one that was killed stays known for some twenty
    seconds, and one that is silent does no harm. If a topic has several publishers, the accepted
    one is replaced only after it has been silent for the window. If the middleware does not number
    messages, each publisher counts as sending.

    Parameters
    ----------
    window_s
        Time for which several publishers count as sending after they were heard in turns, and for
        which an accepted publisher may be silent.

    Examples
    --------
    >>> senders = Senders(window_s=1.0)
    >>> [senders.accepts(number, publishers=1) for number in (7, 8, 10)], senders.several
    ([True, True, True], False)
    >>> [senders.accepts(number, publishers=2) for number in (11, 1, 12, 2)], senders.several
    ([True, False, False, False], True)
    """

    def __init__(self, window_s: float) -> None:
        self.window_s = window_s
        # The last number of each sequence, that of the latest message at the end.
        self._last_numbers: list[int] = []
        self._several_s = float('-inf')
        # The last number of the accepted publisher, and when it was heard.
        self._accepted: int | None = None
        self._accepted_s = float('-inf')

    @property
    def several(self) -> bool:
        """Whether several publishers have been heard in turns within the window."""
        return time.monotonic() - self._several_s < self.window_s

    def accepts(self, number: int | None, publishers: int) -> bool:
        """Note a message; return whether it comes from the only publisher that sends.

        Parameters
        ----------
        number
            The middleware's number of the message; None if it has none.
        publishers
            Number of publishers that are connected to the subscription.
        """
        now_s = time.monotonic()
        if publishers < 2:
            self._last_numbers = [] if number is None else [number]
            self._several_s = float('-inf')
            self._accepted, self._accepted_s = number, now_s
            return True
        if number is None:
            self._several_s = now_s
            return False
        before = number - 1
        known = before in self._last_numbers
        if known:
            if self._last_numbers[-1] != before:
                self._several_s = now_s
            self._last_numbers.remove(before)
        self._last_numbers = [*self._last_numbers[1 - MOST_SENDERS :], number]
        goes_on = self._accepted is not None and 0 <= before - self._accepted <= MOST_LOST
        # Another publisher is accepted when the one before has been silent.
        if goes_on or (known and now_s - self._accepted_s >= self.window_s):
            self._accepted, self._accepted_s = number, now_s
            return not self.several
        return False


def publishing_nodes(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that have a publisher of a topic.

    A node that was killed is among them for some twenty seconds.
    """
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f'{each.node_namespace.rstrip("/")}/{each.node_name}' for each in found)
