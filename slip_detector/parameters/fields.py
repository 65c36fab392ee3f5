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

"""The description of one parameter as a dataclass field, and the conversion of its values."""

import contextlib
import dataclasses
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NoReturn, get_args, get_origin

Field = dataclasses.Field[Any]

#: Allowed names of channels and groups; they become parts of topic names, which have at most 247
#: characters.
NAME_PATTERN = re.compile('[A-Za-z][A-Za-z0-9_]{0,63}')

#: Most characters of a value that a message shows.
LONGEST_SHOWN = 200


def parameter(
    default: Any,
    meaning: str,
    within: tuple[Any, ...] = (None, None, ''),
    *,
    choices: tuple[str, ...] = (),
    allows: str = '',
    heading: str = '',
    affects: str = '',
    searched_with: tuple[str, ...] = (),
    rising: bool = False,
    read: Callable[..., Any] | None = None,
) -> Any:
    """Return a dataclass field that describes one parameter; conversion and checks read it.

    Parameters
    ----------
    default
        The default value; its type is the parameter's type. In YAML a tuple is a list, and a tuple
        of pairs is a flat list.
    meaning
        One sentence, for the ROS descriptor of the parameter and for docs/parameters.md.
    within
        Inclusive bounds of a number, or of each number of a list, and its SI unit, if it has one:
        ``(0.0, 60.0, 's')``; None: any number.
    choices
        The allowed values of a text.
    allows
        The allowed values in words, where bounds and choices do not say them.
    heading
        Heading over this parameter and the following ones, up to the next heading, in
        docs/parameters.md and on the live page.
    affects
        What a change reaches, separated by spaces: ``input``, other samples than before;
        ``decision``, what the chain makes of the envelope without any state of its own;
        ``display``, the topics that the live page listens to; ``start``, only how a node starts.
    searched_with
        The decisions with which the tuner searches the parameter.
    rising
        Whether each number of a list must be above the one before it.
    read
        A function that converts and checks a value, called as :func:`convert`; None: the function
        for values of this type.

    Examples
    --------
    >>> from slip_detector.parameters.sets import ParameterSet
    >>> class Gripper(ParameterSet):
    ...     force_n: float = parameter(2.0, 'Grip force.', (0.1, 40.0, 'N'))
    >>> Gripper(force_n=3)
    Gripper(force_n=3.0)
    >>> Gripper(force_n=99)
    Traceback (most recent call last):
    ValueError: parameter force_n is 99 N, allowed: 0.1 to 40 N
    """
    low, high, unit = (*within, '')[:3]
    metadata = {
        **{'default': default, 'meaning': meaning, 'low': low, 'high': high, 'unit': unit},
        **{'choices': choices, 'allows': allows, 'heading': heading},
        **{'affects': affects.split(), 'searched_with': searched_with},
        **{'rising': rising, 'read': read},
    }
    if isinstance(default, dict):
        return dataclasses.field(default_factory=default.copy, metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def names_that_affect(config_class: type[Any], part: str) -> frozenset[str]:
    """Return the names of the parameters whose fields say that they affect a part.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> sorted(names_that_affect(ChainConfig, 'input'))
    ['channels', 'sample_rate_hz']
    """
    fields = dataclasses.fields(config_class)
    return frozenset(field.name for field in fields if part in field.metadata['affects'])


def allowed(field: Field) -> str:
    """Return the allowed values of a parameter in words.

    Examples
    --------
    >>> from slip_detector.parameters import GraspConfig
    >>> allowed(GraspConfig.__dataclass_fields__['deadline_s'])
    '0.001 to 60 s'
    """
    metadata = field.metadata
    if metadata['allows'] or metadata['choices']:
        return metadata['allows'] or ', '.join(metadata['choices'])
    unit = f' {metadata["unit"]}' if metadata['unit'] else ''
    low, high = metadata['low'], metadata['high']
    if low is not None:
        return f'{low:g} to {high:g}{unit}'
    return 'true, false' if field.type is bool else ''


def under_headings(config_class: type[Any]) -> dict[str, list[Field]]:
    """Return the fields of a parameter set by their headings, in order of definition."""
    found: dict[str, list[Field]] = {}
    heading = ''
    for field in dataclasses.fields(config_class):
        heading = field.metadata['heading'] or heading
        found.setdefault(heading, []).append(field)
    return found


def shortened(text: str) -> str:
    """Return a text, cut off with ``...`` if it is too long for a message."""
    return text if len(text) <= LONGEST_SHOWN else f'{text[: LONGEST_SHOWN - 3]}...'


def quote(value: Any) -> str:
    """Return the representation of a value for a message, shortened to keep that readable."""
    return shortened(repr(value).replace('\n', ' '))  # NumPy shows arrays in lines.


def quote_name(name: str) -> str:
    """Return a user's name for a message: in quotes if it is long or has unprintable characters.

    Examples
    --------
    >>> quote_name('left'), quote_name('left' * 100)[-7:]
    ('left', 'left...')
    """
    return name if name.isprintable() and len(name) < LONGEST_SHOWN else quote(name)


def name_list(names: Sequence[str], most: int = 40) -> str:
    """Return names as a comma-separated text; of a long list only the first ones.

    Examples
    --------
    >>> name_list([f'ch{k}' for k in range(1, 11)], most=3)
    'ch1, ch2, ch3 and 7 more'
    """
    text = ', '.join(map(quote_name, names[:most]))
    return text if len(names) <= most else f'{text} and {len(names) - most} more'


def refuse(what: str, allowed_text: str) -> NoReturn:
    """Raise the ValueError of a value that is not allowed: what is wrong, and what is allowed."""
    raise ValueError(f'{what}, allowed: {allowed_text}')


def convert(value: Any, field: Field, where: str) -> Any:
    """Convert a value from YAML, ROS or Python to the type of its parameter.

    Parameters
    ----------
    value
        A value of any type.
    field
        The field that describes the parameter; see :func:`parameter`.
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
    >>> convert([0.5, 7, '48', 52], stopbands, 'parameter stopbands_hz')
    ((0.5, 7.0), (48.0, 52.0))
    """
    read = field.metadata['read'] or _READERS.get(field.type, _read_numbers)
    return read(_of_python(value), field, where)


def _of_python(value: Any) -> Any:
    """Return a value of NumPy, a number or an array, as one of Python."""
    return value.tolist() if hasattr(value, 'tolist') else value


def _is_single(value: Any) -> bool:
    return isinstance(value, str) or not hasattr(value, '__iter__')


def _refuse_value(value: Any, where: str, allowed_text: str) -> NoReturn:
    refuse(f'{where} is {quote(value)}', allowed_text)


def _items(value: Any, where: str) -> Iterable[Any]:
    """Return a value that is a list."""
    if _is_single(value):
        _refuse_value(value, where, 'a list')
    return value  # type: ignore[no-any-return]


def _read_number(value: Any, field: Field, where: str, kind: Any = None) -> Any:
    """Return a number of a kind, that of the field or of its items, within the field's bounds."""
    value, kind = _of_python(value), kind or field.type
    # A number in quotes is a text.
    types = int | float if kind is int else int | float | str
    number = math.nan
    if isinstance(value, types) and not isinstance(value, bool):
        with contextlib.suppress(ValueError, OverflowError):
            number = float(value)
    if math.isnan(number) or (kind is int and not number.is_integer()):
        _refuse_value(value, where, 'a whole number' if kind is int else 'a number')
    low, high = field.metadata['low'], field.metadata['high']
    if low is not None and not low <= number <= high:
        refuse(f'{where} is {number:g} {field.metadata["unit"]}'.rstrip(), allowed(field))
    return kind(value)


def _read_numbers(value: Any, field: Field, where: str) -> Any:
    """Return numbers as a tuple, or as a tuple of pairs, which may be given as a flat list.

    A single number is a list where the list may have any length.
    """
    items = get_args(field.type)
    pairs, is_open = get_origin(items[0]) is tuple, Ellipsis in items
    if is_open and not pairs and _is_single(value):
        value = [value]
    flat = [n for v in _items(value, where) for n in (v if pairs and not _is_single(v) else (v,))]
    kind = int if items[0] is int else float
    numbers = tuple(_read_number(item, field, where, kind) for item in flat)
    if pairs and len(numbers) % 2:
        refuse(f'{where} has {len(numbers)} numbers', 'pairs [low, high]')
    if not is_open and len(numbers) != len(items):
        refuse(f'{where} has {len(numbers)} numbers', f'{len(items)}')
    if field.metadata['rising'] and list(numbers) != sorted({*numbers}):
        _refuse_value(numbers, where, 'each number above the one before it')
    return tuple(zip(numbers[::2], numbers[1::2], strict=True)) if pairs else numbers


def _read_choice(value: Any, field: Field, where: str) -> Any:
    """Return a text or a Boolean that is one of the field's choices, if it has any."""
    choices, kind = field.metadata['choices'] or (value,), type(field.metadata['default'])
    if isinstance(value, kind) and value in choices and '\0' not in str(value):
        return value
    _refuse_value(value, where, allowed(field) or 'text')


def read_paths(value: Any, field: Field, where: str) -> Any:
    """Return a text; a list of paths is joined by commas."""
    return _read_choice(value if _is_single(value) else ', '.join(map(str, value)), field, where)


def _read_vote(value: Any, field: Field, where: str) -> str | int:
    """Return a vote: ``all``, ``mean``, or a number of channels."""
    if value in ('all', 'mean'):
        return str(value)
    if not isinstance(value, bool) and re.fullmatch('0*[1-9][0-9]{0,8}', str(value)):
        return int(value)
    _refuse_value(value, where, 'all, mean, or a whole number from 1')


def _read_texts(value: Any, field: Field, where: str) -> tuple[str, ...]:
    """Return texts, none of them empty, each once."""
    names = tuple(map(_of_python, _items(value, where)))
    for name in names:
        if not isinstance(name, str) or not name:
            refuse(f'{where} has {quote(name)}', 'a list of names')
    repeated = [name for name, count in Counter(names).items() if count > 1]
    if repeated:
        refuse(f'{where} has {quote(min(repeated))} twice', 'each name once')
    return names


def read_names(value: Any, field: Field, where: str) -> tuple[str, ...]:
    """Return names that can become parts of topic names, each once."""
    for name in _items(value, where):
        if not isinstance(name, str) or not NAME_PATTERN.fullmatch(name):
            refuse(f'{where} has {quote(name)}', 'up to 64 letters, digits, _, letter first')
    return _read_texts(value, field, where)


def _read_groups(value: Any, field: Field, where: str) -> dict[str, tuple[int, ...]]:
    """Return the members of each group by its name."""
    if not isinstance(value, Mapping) or any(_is_single(_of_python(v)) for v in value.values()):
        _refuse_value(value, where, 'a list of channel numbers per name')
    return {
        name: tuple(_read_number(c, field, f'{where}.{name}', int) for c in value[name])
        for name in read_names(value, field, where)
    }


#: What reads the values of a type; all other types are lists of numbers.
_READERS: dict[Any, Callable[[Any, Field, str], Any]] = {
    **dict.fromkeys((int, float), _read_number),
    **dict.fromkeys((bool, str), _read_choice),
    tuple[str, ...]: _read_texts,
    str | int: _read_vote,
    dict[str, tuple[int, ...]]: _read_groups,
}
