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
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from slip_detector.chain.samples import Samples
from slip_detector.nodes.messages import stamp_ns
from slip_detector.parameters import DetectorConfig, name_list, refuse
from slip_detector.recordings.messages import FieldReader, JointStateReader

#: Most messages of a publisher that may be lost in a row; after a larger step of the numbers it
#: counts as another publisher.
MOST_LOST = 1000

#: Most names of nodes that are listed; of further ones only the number is given.
LISTED = 8

#: The stamps of samples whose time is not known.
NO_STAMPS = np.empty(0, np.int64)

_TYPE = re.compile(r'(?P<package>\w+)/(msg/)?(?P<name>\w+)')


class Input:
    """Reads rows, stamps and channel names, if any, from messages of ``input_type``.

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
    """

    def __init__(self, config: DetectorConfig) -> None:
        self.message_class = find_message_class(config.input_type)
        self._field = FieldReader(config.input_field)
        fields = self.message_class.get_fields_and_field_types()
        if not self._field.begins_in(self.message_class):
            text = f'in a {config.input_type} a path that begins with {", ".join(fields)}'
            refuse(f'parameter input_field is {config.input_field!r}', text)
        self._has_header = fields.get('header') == 'std_msgs/Header'
        self.has_names = fields.get('name') == 'sequence<string>'
        self._type, self._period_ns = config.input_type, 1e9 / config.sample_rate_hz
        # The usual kind of input, one message for each sample, for which there is a faster reader.
        quick = self.message_class is JointState and config.input_field == 'position'
        self._reader = JointStateReader() if quick else None

    def read(
        self, raw: bytes, info: dict[str, int | None], replayed: bool = False
    ) -> tuple[Samples, int | None]:
        """Return the samples of a serialised message, and its number if that tells of losses.

        The stamp of the last sample is that of the header; those before are a period apart.
        Without a header, or with the stamp 0, it is the time at which the message was published;
        if time is replayed, it is not known. As a busy machine publishes late, lost messages are
        then noticed by the number of the message, not by its time.

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
        if self._reader is not None:
            samples = self._reader.read([raw])
            at_ns: int | None = int(samples.stamps_ns[0])
            if at_ns:
                return samples, None
        else:
            try:
                message = deserialize_message(raw, self.message_class)
            except RuntimeError:  # Its text speaks of the middleware's code.
                raise ValueError(f'a message is no {self._type}') from None
            header = message.header if self._has_header else Header()
            at_ns, frame_id = stamp_ns(header.stamp), str(header.frame_id)
            names = tuple(message.name) if self.has_names else ()
            samples = Samples(self._field(message), NO_STAMPS, names=names, frame_id=frame_id)
        number = None
        if not at_ns and not replayed:
            at_ns, number = info['source_timestamp'], info['publication_sequence_number']
        if not at_ns:
            return samples._replace(stamps_ns=NO_STAMPS), number
        before_ns = np.rint(np.arange(len(samples.volts))[::-1] * self._period_ns)
        return samples._replace(stamps_ns=at_ns - before_ns.astype(np.int64)), number

    def advice(self, numbers: int, channels: int) -> str:
        """Return the fields that a message of so many numbers lacks, if it may be a batch.

        Examples
        --------
        >>> batches = DetectorConfig(input_type='std_msgs/Float32MultiArray', input_field='data')
        >>> Input(batches).advice(64, 16), Input(batches).advice(63, 16)
        (' (a batch needs layout.dim: sample of size 4, channel of size 16)', '')
        """
        samples, left = divmod(numbers, channels)
        if left or samples < 2 or not self._type.endswith('MultiArray'):
            return ''
        sizes = f'sample of size {samples}, channel of size {channels}'
        return f' (a batch needs layout.dim: {sizes})'


def find_message_class(name: str) -> Any:
    """Return the class of a message type, ``package/msg/Type`` or ``package/Type``.

    Only a package with a folder ``msg`` is imported: importing another module would run code that
    has nothing to do with messages. Raises a ValueError when the type is not installed.
    """
    match = _TYPE.fullmatch(name)
    if match and any(Path(folder, match['package'], 'msg').is_dir() for folder in sys.path):
        with contextlib.suppress(ImportError, AttributeError):
            module = importlib.import_module(f'{match["package"]}.msg')
            found = getattr(module, match['name'])
            if hasattr(found, 'get_fields_and_field_types'):
                return found
    text = 'the name of an installed message type, such as sensor_msgs/msg/JointState'
    raise ValueError(f'parameter input_type is {name!r}, allowed: {text}')


class Senders:
    """Detects by the numbers of messages whether several publishers send on a topic.

    The middleware numbers the messages of each publisher. With one publisher each message has the
    next number, or a higher one if some were lost; if two publishers send, their numbers do not
    continue each other. A publisher that does not send is ignored: one that was killed stays
    known for some twenty seconds, and one that is silent does no harm. If a topic has several
    publishers, the accepted one is replaced only after it has been silent for the window.
    If the middleware does not number messages, each publisher counts as sending.

    Parameters
    ----------
    window_s
        Returns the time, which may change, for which several publishers count as sending after
        they were heard in turns, and for which an accepted publisher may be silent.
    what
        What they publish.
    names
        Returns the names of the nodes that publish it.

    Examples
    --------
    >>> senders = Senders(window_s=lambda: 1.0)
    >>> [senders.accepts(number, publishers=1) for number in (7, 8, 10)], senders.several
    ([True, True, True], False)
    >>> [senders.accepts(number, publishers=2) for number in (11, 1, 12, 2)], senders.several
    ([True, False, False, False], True)
    """

    def __init__(
        self, window_s: Callable[[], float], what: str = '', names: Callable[[], list[str]] = list
    ) -> None:
        self._window_s, self._what, self._names = window_s, what, names
        self._several_s = float('-inf')
        # The last number of the accepted publisher, and when it was heard.
        self._accepted, self._accepted_s = 0, float('-inf')

    @property
    def several(self) -> bool:
        """Whether several publishers have been heard in turns within the window."""
        return time.monotonic() - self._several_s < self._window_s()

    def complaint(self) -> str:
        """Return who publishes if several send, else an empty text.

        Nodes that only have a publisher are included: the middleware does not tell who sends.
        """
        return describe_rivals(self._what, self._names()) if self.several else ''

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
        if number is None:
            self._several_s = now_s if publishers > 1 else float('-inf')
            return publishers < 2
        if publishers < 2 or now_s - self._accepted_s >= self._window_s():
            self._several_s = float('-inf')
        elif not 0 < number - self._accepted <= MOST_LOST:
            self._several_s = now_s
            return False
        self._accepted, self._accepted_s = number, now_s
        return not self.several


def describe_rivals(what: str, names: list[str]) -> str:
    """Return what is wrong where several nodes publish what only one may."""
    return f'{what} is published by {name_list(names, LISTED)}: only one of them may'


def find_publishing_nodes(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that have a publisher of a topic.

    A node that was killed is among them for some twenty seconds.
    """
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f'{each.node_namespace.rstrip("/")}/{each.node_name}' for each in found)
