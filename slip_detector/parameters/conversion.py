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

"""Conversion of values from YAML, ROS or Python to parameter types, and their form in messages."""

import contextlib
import dataclasses
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any, get_args

from slip_detector.parameters.fields import allowed, default_of

#: Allowed names of channels and groups; they become parts of topic names.
NAME_PATTERN = re.compile(r'[A-Za-z][A-Za-z0-9_]*')

#: Most characters of a value that a message shows.
LONGEST_SHOWN = 200


def shown(value: Any) -> str:
    """Return the representation of a value for a message, shortened to keep that readable.

    Examples
    --------
    >>> shown('fast'), shown([1] * 1000)[-9:]
    ("'fast'", ', 1, 1...')
    """
    return shortened(repr(value))


def shortened(text: str) -> str:
    """Return a text, cut off with ``...`` if it is too long for a message.

    Examples
    --------
    >>> shortened('fast'), len(shortened('a' * 1000))
    ('fast', 200)
    """
    return text if len(text) <= LONGEST_SHOWN else f'{text[: LONGEST_SHOWN - 3]}...'


def shown_name(name: str) -> str:
    """Return a user's name for a message: in quotes if it is long or has unprintable characters.

    Examples
    --------
    >>> shown_name('left'), shown_name('left' * 100)[-7:]
    ('left', 'left...')
    """
    return name if name.isprintable() and len(name) < LONGEST_SHOWN else shown(name)


def listed(names: Sequence[str], most: int = 40) -> str:
    """Return names as a comma-separated text; of a long list only the first ones.

    Examples
    --------
    >>> listed(['ch1', 'ch2']), listed([f'ch{k}' for k in range(1, 11)], most=3)
    ('ch1, ch2', 'ch1, ch2, ch3 and 7 more')
    """
    text = ', '.join(map(shown_name, names[:most]))
    return text if len(names) <= most else f'{text} and {len(names) - most} more'


def _number(value: Any, kind: type, where: str) -> Any:
    """Return a value as int or float; raise a ValueError if it is not a number of that type."""
    if isinstance(value, str) and value.isascii() and '_' not in value and kind is float:
        # PyYAML reads 1e9 as text (YAML 1.1 wants 1.0e+9), ROS reads it as a number. Python's 1_0
        # is a number in neither.
        with contextlib.suppress(ValueError):
            value = float(value)
    wanted = 'a whole number' if kind is int else 'a number'
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f'{where} is {shown(value)}, allowed: {wanted}')
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f'{where} has too many digits, allowed: {wanted} below 1e308') from None
    if math.isnan(number):
        raise ValueError(f'{where} is not a number, allowed: {wanted}')
    if kind is int and not number.is_integer():
        raise ValueError(f'{where} is {shown(value)}, allowed: {wanted}')
    return kind(value)


def _check_range(value: float, field: 'dataclasses.Field[Any]', where: str) -> None:
    low, high = field.metadata['low'], field.metadata['high']
    if (low is not None and value < low) or (high is not None and value > high):
        unit = f' {field.metadata["unit"]}' if field.metadata['unit'] else ''
        raise ValueError(f'{where} is {value:g}{unit}, allowed: {allowed(field)}')


def converted(value: Any, field: 'dataclasses.Field[Any]', where: str) -> Any:
    """Convert a value from YAML, ROS or Python to the type of its parameter.

    Parameters
    ----------
    value
        A value of any type.
    field
        The dataclass field that describes the parameter; see
        :func:`slip_detector.parameters.fields.parameter`.
    where
        The name of the parameter in messages.

    Raises
    ------
    ValueError
        When the value cannot be converted or is out of range.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> stopbands = ChainConfig.__dataclass_fields__['stopbands_hz']
    >>> converted([0.5, 7, '48', 52], stopbands, 'parameter stopbands_hz')
    ((0.5, 7.0), (48.0, 52.0))
    """
    default = default_of(field)
    if field.name == 'vote':
        return _vote(value, where)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise ValueError(f'{where} is {shown(value)}, allowed: true, false')
        return value
    if isinstance(default, (int, float)):
        value = _number(value, type(default), where)
        _check_range(value, field, where)
        return value
    if isinstance(default, str):
        choices = field.metadata['choices']
        if not isinstance(value, str) or (choices and value not in choices):
            raise ValueError(f'{where} is {shown(value)}, allowed: {allowed(field) or "text"}')
        return value
    if isinstance(default, dict):
        return _groups(value, where)
    if field.name == 'noise_floor' and (isinstance(value, str) or not hasattr(value, '__iter__')):
        value = [value]
    if isinstance(value, str) or not hasattr(value, '__iter__'):
        raise ValueError(f'{where} is {shown(value)}, allowed: a list')
    if field.name == 'channel_names':
        return _names(value, where)
    if str in get_args(field.type):
        return _texts(value, where)
    return _numbers(list(value), default, field, where)


def _numbers(
    items: list[Any], default: tuple[Any, ...], field: 'dataclasses.Field[Any]', where: str
) -> tuple[Any, ...]:
    """Return numbers as a tuple, or as a tuple of pairs, which may be given as a flat list."""
    pairs = bool(default) and isinstance(default[0], tuple)
    flat: list[Any] = []
    for item in items:
        if pairs and not isinstance(item, str) and hasattr(item, '__iter__'):
            flat.extend(item)
        else:
            flat.append(item)
    kind = int if field.name.endswith('_channels') else float
    numbers = [_number(item, kind, where) for item in flat]
    for number in numbers:
        _check_range(number, field, where)
    if pairs:
        if len(numbers) % 2:
            raise ValueError(f'{where} has {len(numbers)} numbers, allowed: pairs [low, high]')
        return tuple(zip(numbers[::2], numbers[1::2], strict=True))
    any_length = Ellipsis in get_args(field.type)
    if not any_length and len(numbers) != len(default):
        raise ValueError(f'{where} has {len(numbers)} numbers, allowed: {len(default)}')
    return tuple(numbers)


def _vote(value: Any, where: str) -> str | int:
    if value in ('all', 'mean'):
        return str(value)
    text = str(value)
    if not isinstance(value, bool) and re.fullmatch('[0-9]{1,9}', text) and int(text) >= 1:
        return int(text)
    raise ValueError(f'{where} is {shown(value)}, allowed: all, mean, or a whole number from 1')


def _names(value: Any, where: str) -> tuple[str, ...]:
    names = tuple(value)
    for name in names:
        if not isinstance(name, str) or not NAME_PATTERN.fullmatch(name):
            raise ValueError(
                f'{where} has {shown(name)}, allowed: letters, digits and _, a letter first'
            )
    check_once(names, where, 'name')
    return names


def check_once(values: Sequence[Any], where: str, what: str) -> None:
    """Check that no value occurs twice.

    Raises
    ------
    ValueError
        When one does; names the smallest of them.

    Examples
    --------
    >>> check_once((1, 3, 2, 3), 'parameter disabled_channels', 'channel')
    Traceback (most recent call last):
    ValueError: parameter disabled_channels has 3 twice, allowed: each channel once
    """
    doubled = sorted(value for value, count in Counter(values).items() if count > 1)
    if doubled:
        raise ValueError(f'{where} has {shown(doubled[0])} twice, allowed: each {what} once')


def _texts(value: Any, where: str) -> tuple[str, ...]:
    for text in value:
        if not isinstance(text, str) or not text:
            raise ValueError(f'{where} has {shown(text)}, allowed: a list of names')
    return tuple(value)


def _groups(value: Any, where: str) -> dict[str, tuple[int, ...]]:
    if not isinstance(value, Mapping):
        raise ValueError(f'{where} is {shown(value)}, allowed: a list of channel numbers per name')
    _names(list(value), where)
    groups = {}
    for name, members in value.items():
        inner = f'{where}.{name}'
        if isinstance(members, str) or not hasattr(members, '__iter__'):
            raise ValueError(f'{inner} is {shown(members)}, allowed: a list of channel numbers')
        groups[name] = tuple(_number(member, int, inner) for member in members)
    return groups
