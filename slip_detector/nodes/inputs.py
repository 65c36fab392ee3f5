"""Samples out of messages of any type."""

import importlib
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.config import DetectorConfig
from slip_detector.fields import FieldReader
from slip_detector.nodes.messages import stamp_ns

_TYPE = re.compile(r'(?P<package>\w+)/(msg/)?(?P<name>\w+)')


class Input:
    """What the messages of ``input_type`` hold: rows, their stamp, perhaps names.

    Attributes
    ----------
    message_class : type
        Of the messages.
    has_names : bool
        Whether a message says the channels' names, in ``name``.
    replayed : bool
        Whether the time is: then the middleware's stamps tell how fast, not when.

    Raises
    ------
    ValueError
        When the type is not installed, or has no such field.
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
        self.replayed = False

    def rows(self, message: Any) -> NDArray[np.float64]:
        """Return the samples of a message, shape (n, channels), oldest first.

        Raises
        ------
        ValueError
            When the field is not in it.
        """
        return self._field(message)

    def stamp_ns(self, message: Any, info: dict[str, int]) -> int | None:
        """Return when the last sample of a message was taken.

        That is the stamp of its header or, where there is none or it was left empty, when it was
        published; None: unknown.
        """
        if self._has_header:
            at_ns = stamp_ns(message.header.stamp)
            if at_ns:
                return at_ns
        return None if self.replayed else info['source_timestamp']

    def frame_id(self, message: Any) -> str:
        """Return where the samples were taken, as far as the message says."""
        return str(message.header.frame_id) if self._has_header else ''


def message_class(name: str) -> Any:
    """Return the class of a message type, ``package/msg/Type`` or ``package/Type``.

    Raises
    ------
    ValueError
        When it is not installed.
    """
    match = _TYPE.fullmatch(name)
    try:
        if match:
            module = importlib.import_module(f'{match["package"]}.msg')
            return getattr(module, match['name'])
    except (ImportError, AttributeError):
        pass
    raise ValueError(
        f'parameter input_type is {name!r}, allowed: the name of an installed message type, '
        'as sensor_msgs/msg/JointState'
    )
