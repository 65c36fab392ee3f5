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

"""Topics of a bag, and the types of their messages."""

import functools
from typing import Any, NamedTuple

from slip_detector.parameters.fields import shortened, shown_name

JOINT_STATE = 'sensor_msgs/msg/JointState'
BOOL = 'std_msgs/msg/Bool'

#: Most characters of a type definition; the largest definitions of ROS have some 60,000.
MOST_DEFINITION = 200_000

#: Most elements of a fixed-length array of texts or messages: rosbags compiles code for each.
MOST_ELEMENTS = 2000

#: Separator of the definitions of several types in one text.
_RULE = '=' * 80 + '\n'


class Topic(NamedTuple):
    """A topic of a bag.

    Attributes
    ----------
    name : str
    msgtype : str
        Type of the messages, for example ``sensor_msgs/msg/JointState``.
    encoding : str
        Format of the definition: ``ros2msg``, ``ros2idl``, or '' if there is no definition.
    definition : str
        Definition of the type.

    Examples
    --------
    >>> Topic('/voltages', JOINT_STATE, encoding='', definition='').msgtype
    'sensor_msgs/msg/JointState'
    """

    name: str
    msgtype: str
    encoding: str
    definition: str


#: Topic, time of receipt in nanoseconds, serialised message.
Message = tuple[str, int, bytes]


@functools.cache
def standard_typestore() -> Any:
    """Return the type store of rosbags for ROS 2 Jazzy, whose types are written to bags.

    It is cached, as a store compiles code for each type that is used.

    Examples
    --------
    >>> JOINT_STATE in standard_typestore().types
    True
    """
    from rosbags.typesys import Stores, get_typestore

    return get_typestore(Stores.ROS2_JAZZY)


@functools.lru_cache(maxsize=64)
def typestore_of(topic: Topic) -> Any:
    """Return a type store of rosbags with the type of a topic.

    If the definition in the bag is broken, as some recorders write it, the definition of ROS is
    used. The store is cached for the same topic of other recordings, as it compiles code for its
    types.

    Raises
    ------
    ValueError
        When ROS does not have the type, and the bag does not define it or its definition is
        broken.

    Examples
    --------
    >>> tactile = Topic('/skin', 'skin/msg/Tactile', 'ros2msg', 'float64[] volts')
    >>> list(typestore_of(tactile).types['skin/msg/Tactile'].__dataclass_fields__)[:1]
    ['volts']
    """
    from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

    known = get_typestore(Stores.LATEST)
    if not topic.encoding:
        if topic.msgtype not in known.fielddefs:
            raise ValueError(
                f'the bag does not define the type {shown_name(topic.msgtype)} of '
                f'{shown_name(topic.name)}'
            )
        return known
    store = get_typestore(Stores.EMPTY)
    try:
        if len(topic.definition) > MOST_DEFINITION:
            raise ValueError(f'{len(topic.definition)} characters, allowed: {MOST_DEFINITION}')
        if topic.encoding == 'ros2msg':
            store.register(get_types_from_msg(topic.definition, topic.msgtype))
        else:
            parts = topic.definition.split(_RULE)
            # If there are several definitions, the first line of each is the name of its type.
            texts = parts if len(parts) == 1 else [part.partition('\n')[2] for part in parts[1:]]
            for text in texts:
                store.register(get_types_from_idl(text))
        _check_arrays(store)
        store.get_msgdef(topic.msgtype)
    except Exception as error:
        if topic.msgtype in known.fielddefs:
            return known
        why = ' '.join(str(error).split())
        msgtype = shown_name(topic.msgtype)
        raise ValueError(
            f'the definition of {msgtype} cannot be read ({shortened(why)})'
        ) from None
    return store


def _check_arrays(store: Any) -> None:
    """Check that no type has an array of fixed length that is too long to compile."""
    from rosbags.interfaces import Nodetype

    for msgtype, (_, fields) in store.fielddefs.items():
        for name, (kind, inner) in fields:
            if kind == Nodetype.ARRAY:
                (element, what), length = inner
                numbers = element == Nodetype.BASE and what[0] != 'string'
                if length > MOST_ELEMENTS and not numbers:
                    raise ValueError(
                        f'{msgtype}.{name} has {length} elements, allowed: {MOST_ELEMENTS}'
                    )
