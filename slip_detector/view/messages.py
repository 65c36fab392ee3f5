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

"""What a message of a page may hold: each field has one meaning, and is checked here."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from slip_detector.parameters import quote, refuse

#: The content of a message of a page, which is not trusted.
Message = Mapping[str, Any]

#: What a field may hold: in words, and as a function.
Allowed = tuple[str, Callable[[Any], bool]]

#: Allowed stamps: they and their sums fit 64 bits.
STAMPS_NS = (-(2.0**62), 2.0**62)

HIGHEST_CHANNEL = 1_000_000


def _number(low: float, high: float) -> Allowed:
    return f'{low:g} to {high:g}', lambda v: isinstance(v, int | float) and low <= v <= high


def _list(allowed: str, allows: Callable[[Any], bool]) -> Allowed:
    return f'a list, each {allowed}', lambda v: isinstance(v, list) and all(map(allows, v))


_TEXT = 'a text', lambda v: isinstance(v, str)
_FLAG = 'true, false', lambda v: isinstance(v, bool)
_CHANNEL = 'a whole number from 1', lambda v: type(v) is int and 0 < v <= HIGHEST_CHANNEL

#: The fields by their names. Which texts are possible is decided where they are looked up, which
#: values and slips by the detector and the file of labels.
FIELDS: dict[str, Allowed] = {
    **dict.fromkeys(('page', 'finger', 'recording', 'name', 'preset', 'kind'), _TEXT),
    **dict.fromkeys(('replace', 'mistaken', 'playing'), _FLAG),
    'fingers': _list(*_TEXT),
    'channels': _list(*_CHANNEL),
    'spectrum': _CHANNEL,
    'values': ('a value for each name', lambda v: isinstance(v, dict)),
    # Width and length of the traces, and the stamp at which they end.
    'pixels': _number(10, 4000),
    'window_s': _number(0.02, 60.0),
    'until_ns': _number(*STAMPS_NS),
    # Of a recording: length of a pixel, speed as a multiple of real time, where to go on.
    'pixel_s': _number(0.0, 1e9),
    'speed': _number(0.1, 10.0),
    'to_s': _number(0.0, math.inf),
}


def check(message: Message) -> None:
    """Raise a ValueError that names a field of a message with a value that is not allowed.

    Examples
    --------
    >>> check({'speed': 2.0, 'finger': '/index/slip_detector'})
    >>> check({'speed': '2'})
    Traceback (most recent call last):
    ValueError: speed is '2', allowed: 0.1 to 10
    """
    for name, (allowed, allows) in FIELDS.items():
        value = message.get(name)
        if value is not None and not allows(value):
            refuse(f'{name} is {quote(value)}', allowed)
