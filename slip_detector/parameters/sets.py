"""Sets of parameters: one field of a frozen dataclass is one ROS parameter.

The field holds its default, unit, range and meaning; the node, the command lines, the YAML files
and the core all use its name. Checks that need more than one parameter stand in
``__post_init__``; whatever is wrong is a ``ValueError`` of one line that names the parameter, its
value and what is allowed.
"""

import contextlib
import dataclasses
import difflib
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

import yaml

#: Parameters that rclpy itself declares and reads, on every node.
OF_RCLPY = ('use_sim_time', 'start_type_description_service', 'qos_overrides')

NAME_PATTERN = re.compile(r'[A-Za-z][A-Za-z0-9_]*')

ConfigType = TypeVar('ConfigType', bound='ParameterSet')


def parameter(
    default: Any,
    meaning: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    allows: str = '',
) -> Any:
    """Make a dataclass field that describes one parameter.

    Parameters
    ----------
    default
        Its type is the parameter's type; a tuple is a list of any length, a tuple of pairs is
        written as a flat list.
    meaning
        One sentence; ends up in the parameter's ROS descriptor and in the README.
    unit
        SI unit.
    low, high
        Inclusive bounds of a number, or of each number of a list.
    choices
        What a text parameter may say.
    allows
        What is allowed, in words, where bounds and choices do not tell.
    """
    metadata = {
        'meaning': meaning,
        'unit': unit,
        'low': low,
        'high': high,
        'choices': choices,
        'allows': allows,
    }
    if isinstance(default, dict):
        return dataclasses.field(default_factory=lambda: dict(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def default_of(field: 'dataclasses.Field[Any]') -> Any:
    """Return the default of a dataclass field, whichever way it is given."""
    if field.default is not dataclasses.MISSING:
        return field.default
    assert field.default_factory is not dataclasses.MISSING
    return field.default_factory()


def allowed(field: 'dataclasses.Field[Any]') -> str:
    """Say in words which values a parameter takes."""
    metadata = field.metadata
    if metadata['allows']:
        return str(metadata['allows'])
    if metadata['choices']:
        return ', '.join(metadata['choices'])
    unit = f' {metadata["unit"]}' if metadata['unit'] else ''
    low, high = metadata['low'], metadata['high']
    if low is not None and high is not None:
        return f'{low:g} to {high:g}{unit}'
    if low is not None:
        return f'at least {low:g}{unit}'
    return 'true, false' if isinstance(default_of(field), bool) else ''


def _number(value: Any, kind: type, where: str) -> Any:
    """Convert to int or float without losing anything, or say what is wrong."""
    if isinstance(value, str) and kind is float:
        # PyYAML reads 1e9 as text (YAML 1.1 wants 1.0e+9), ROS reads it as a number.
        with contextlib.suppress(ValueError):
            value = float(value)
    wanted = 'a whole number' if kind is int else 'a number'
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f'{where} is {value!r}, allowed: {wanted}')
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f'{where} has too many digits, allowed: {wanted} below 1e308') from None
    if math.isnan(number):
        raise ValueError(f'{where} is not a number, allowed: {wanted}')
    if kind is int and not number.is_integer():
        raise ValueError(f'{where} is {value!r}, allowed: {wanted}')
    return kind(value)


def _in_range(value: float, field: 'dataclasses.Field[Any]', where: str) -> None:
    low, high = field.metadata['low'], field.metadata['high']
    if (low is not None and value < low) or (high is not None and value > high):
        unit = f' {field.metadata["unit"]}' if field.metadata['unit'] else ''
        raise ValueError(f'{where} is {value:g}{unit}, allowed: {allowed(field)}')


def _converted(value: Any, field: 'dataclasses.Field[Any]', where: str) -> Any:
    """Bring a value from YAML, ROS or Python to the field's type and check it on its own."""
    default = default_of(field)
    if field.name == 'vote':
        return _vote(value, where)
    if isinstance(default, bool):
        if not isinstance(value, bool):
            raise ValueError(f'{where} is {value!r}, allowed: true, false')
        return value
    if isinstance(default, (int, float)):
        value = _number(value, type(default), where)
        _in_range(value, field, where)
        return value
    if isinstance(default, str):
        choices = field.metadata['choices']
        if not isinstance(value, str) or (choices and value not in choices):
            raise ValueError(f'{where} is {value!r}, allowed: {allowed(field) or "text"}')
        return value
    if isinstance(default, dict):
        return _groups(value, where)
    if isinstance(value, str) or not hasattr(value, '__iter__'):
        raise ValueError(f'{where} is {value!r}, allowed: a list')
    if field.name == 'channel_names':
        return _names(value, where)
    if str in get_args(field.type):
        return _texts(value, where)
    return _numbers(list(value), default, field, where)


def _numbers(
    items: list[Any], default: tuple[Any, ...], field: 'dataclasses.Field[Any]', where: str
) -> tuple[Any, ...]:
    """Convert a list of numbers, or of pairs given flat or nested."""
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
        _in_range(number, field, where)
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
    if not isinstance(value, bool) and text.isdecimal() and int(text) >= 1:
        return int(text)
    raise ValueError(f'{where} is {value!r}, allowed: all, mean, or a whole number from 1')


def _names(value: Any, where: str) -> tuple[str, ...]:
    names = tuple(value)
    for name in names:
        if not isinstance(name, str) or not NAME_PATTERN.fullmatch(name):
            raise ValueError(
                f'{where} has {name!r}, allowed: letters, digits and _, a letter first'
            )
    doubled = sorted({name for name in names if names.count(name) > 1})
    if doubled:
        raise ValueError(f'{where} has {doubled[0]!r} twice, allowed: each name once')
    return names


def _texts(value: Any, where: str) -> tuple[str, ...]:
    for text in value:
        if not isinstance(text, str) or not text:
            raise ValueError(f'{where} has {text!r}, allowed: a list of names')
    return tuple(value)


def _groups(value: Any, where: str) -> dict[str, tuple[int, ...]]:
    if not isinstance(value, Mapping):
        raise ValueError(f'{where} is {value!r}, allowed: a list of channel numbers per name')
    _names(list(value), where)
    groups = {}
    for name, members in value.items():
        inner = f'{where}.{name}'
        if isinstance(members, str) or not hasattr(members, '__iter__'):
            raise ValueError(f'{inner} is {members!r}, allowed: a list of channel numbers')
        groups[name] = tuple(_number(member, int, inner) for member in members)
    return groups


@dataclasses.dataclass(frozen=True)
class ParameterSet:
    """What all sets of parameters share: conversion, checks and YAML."""

    #: The node (or the command) whose section of a parameter file has these parameters.
    NODE = ''

    def __init_subclass__(cls) -> None:
        """Make a set that names its node known as the set of that section."""
        if 'NODE' in cls.__dict__:
            SECTIONS[cls.NODE] = cls

    def __post_init__(self) -> None:
        """Convert and check every field on its own."""
        for field in dataclasses.fields(self):
            value = _converted(getattr(self, field.name), field, f'parameter {field.name}')
            object.__setattr__(self, field.name, value)

    @classmethod
    def from_parameters(
        cls: type[ConfigType], parameters: Mapping[str, Any], where: str = ''
    ) -> ConfigType:
        """Build from names and values as ROS has them (``groups.TP`` for a nested name).

        Raises
        ------
        ValueError
            For an unknown name or a value that is not allowed; ``where`` leads the message.
        """
        lead = f'{where}: ' if where else ''
        known = {field.name for field in dataclasses.fields(cls)}
        values: dict[str, Any] = {}
        for name, value in parameters.items():
            head, _, tail = name.partition('.')
            if head not in known or (tail and head != 'groups'):
                near = difflib.get_close_matches(name, known, 1)
                hint = (
                    f'did you mean {near[0]}?' if near else f'allowed: {", ".join(sorted(known))}'
                )
                raise ValueError(f'{lead}unknown parameter {name} = {value!r}; {hint}')
            if tail:
                values.setdefault(head, {})[tail] = value
            else:
                values[name] = value
        try:
            return cls(**values)
        except ValueError as error:
            raise ValueError(f'{lead}{error}') from None

    @classmethod
    def from_yaml(cls: type[ConfigType], path: str | Path) -> ConfigType:
        """Read the node's section of a ROS parameter file.

        The whole section is checked, also where this set is a part of it.

        Raises
        ------
        ValueError
            When the file cannot be read or holds a value that is not allowed; names the file.
        """
        whole = SECTIONS[cls.NODE].from_parameters(read_parameter_file(path, cls.NODE), str(path))
        return cls(**{field.name: getattr(whole, field.name) for field in dataclasses.fields(cls)})

    def to_parameters(self) -> dict[str, Any]:
        """Return names and values as ROS has them: flat lists, ``groups.TP`` for nested names."""
        values: dict[str, Any] = {}
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, dict):
                values.update({f'{field.name}.{key}': list(item) for key, item in value.items()})
            elif isinstance(value, tuple) and value and isinstance(value[0], tuple):
                values[field.name] = [edge for pair in value for edge in pair]
            elif isinstance(value, tuple):
                values[field.name] = list(value)
            else:
                values[field.name] = value
        return values

    def to_yaml(self) -> str:
        """Write the set as a ROS parameter file that :meth:`from_yaml` and the node read."""
        nested: dict[str, Any] = {}
        for name, value in self.to_parameters().items():
            head, _, tail = name.partition('.')
            if tail:
                nested.setdefault(head, {})[tail] = value
            else:
                nested[head] = value
        document = {f'/**/{self.NODE}': {'ros__parameters': nested}}
        return yaml.safe_dump(document, sort_keys=False, default_flow_style=None)


#: By the name of a section of a parameter file: the set with all its parameters. A set that is a
#: part of it (the chain's of the detector's) is a base class of it, and so comes before it.
SECTIONS: dict[str, type[ParameterSet]] = {}


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Read a YAML file of names and values.

    Raises
    ------
    ValueError
        When the file is missing, is not YAML or holds something else; names file and line.
    """
    try:
        document = yaml.safe_load(Path(path).read_text(encoding='utf-8'))
    except OSError as error:
        raise ValueError(f'{path}: cannot be read ({error.strerror})') from None
    except UnicodeDecodeError:
        raise ValueError(f'{path}: is not text, allowed: a YAML file') from None
    except ValueError as error:  # a date that is none, for one
        raise ValueError(f'{path}: is not YAML ({error})') from None
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = f' line {mark.line + 1}' if mark else ''
        problem = getattr(error, 'problem', None) or 'cannot be parsed'
        raise ValueError(f'{path}:{line} is not YAML ({problem})') from None
    if not isinstance(document, dict):
        raise ValueError(f'{path}: is not a YAML file of names and values')
    return {str(name): value for name, value in document.items()}


def read_parameter_file(path: str | Path, node: str) -> dict[str, Any]:
    """Read the parameters that a ROS parameter file has for a node.

    Sections for any namespace (``/**``, ``/**/node``) and one for a certain namespace apply.

    Parameters
    ----------
    path
        The YAML file.
    node
        Name of the node, without namespace.

    Returns
    -------
    dict
        Flat names (``groups.TP``) and values, without those that rclpy reads itself; empty when
        the file has no section for the node.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has the node in several
        namespaces, of which only a running node knows its own.
    """
    merged: dict[str, Any] = {}
    of_namespaces: list[str] = []
    for section, parameters in our_sections(path):
        last = section.rsplit('/', 1)[-1]
        if last == node and '*' not in section:
            of_namespaces.append(section)
        if last in (node, '**'):
            merged.update(_flattened(parameters))
    if len(of_namespaces) > 1:
        raise ValueError(
            f'{path}: has sections for {", ".join(of_namespaces)}, allowed: one namespace'
        )
    return {name: value for name, value in merged.items() if name.split('.')[0] not in OF_RCLPY}


def our_sections(path: str | Path) -> list[tuple[str, Mapping[str, Any]]]:
    """Read the sections of a ROS parameter file that concern this package.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has none; names the file.
    """
    sections = [
        (section, parameters)
        for section, parameters in _sections(read_yaml(path), str(path))
        if section.rsplit('/', 1)[-1] in (*SECTIONS, '**')
    ]
    if not sections:
        raise ValueError(f'{path}: has no section of this package, allowed: {", ".join(SECTIONS)}')
    return sections


def _sections(document: Mapping[str, Any], path: str, namespace: str = '') -> Any:
    """Yield the full name and the parameters of each node section, nested as ROS allows."""
    for name, content in document.items():
        section = f'{namespace}/{name}' if namespace else str(name)
        if not isinstance(content, Mapping) or not content:
            raise ValueError(f'{path}: section {section} has no ros__parameters')
        if 'ros__parameters' not in content:
            yield from _sections(content, path, section)
        elif isinstance(content['ros__parameters'], Mapping):
            yield section, content['ros__parameters']
        else:
            raise ValueError(f'{path}: section {section} has no names under ros__parameters')


def _flattened(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f'{prefix}{key}'
        if isinstance(value, Mapping):
            flat.update(_flattened(value, f'{name}.'))
        else:
            flat[name] = value
    return flat
