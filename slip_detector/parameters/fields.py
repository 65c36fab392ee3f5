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

"""The description of one parameter, as the metadata of a dataclass field."""

import dataclasses
from typing import Any


def parameter(
    default: Any,
    meaning: str,
    *,
    unit: str = '',
    low: float | None = None,
    high: float | None = None,
    choices: tuple[str, ...] = (),
    allows: str = '',
    heading: str = '',
    affects: tuple[str, ...] = (),
) -> Any:
    """Return a dataclass field that describes one parameter; conversion and checks read it.

    Parameters
    ----------
    default
        The default value; its type is the parameter's type. In YAML a tuple is a list, and a tuple
        of pairs is a flat list.
    meaning
        One sentence, for the ROS descriptor of the parameter and for docs/parameters.md.
    unit
        SI unit.
    low, high
        Inclusive bounds of a number, or of each number of a list.
    choices
        The allowed values of a text.
    allows
        The allowed values in words, where bounds and choices do not tell them.
    heading
        Heading over this parameter and the following ones, up to the next heading, in
        docs/parameters.md and on the live page.
    affects
        What a change reaches: ``decision`` if the state of a running chain does not depend on the
        parameter, ``outputs`` if the topics of the decisions do.

    Examples
    --------
    >>> import dataclasses
    >>> from slip_detector.parameters.sets import ParameterSet
    >>> @dataclasses.dataclass(frozen=True)
    ... class Gripper(ParameterSet):
    ...     force_n: float = parameter(2.0, 'Grip force.', unit='N', low=0.1, high=40.0)
    >>> Gripper(force_n=3)
    Gripper(force_n=3.0)
    >>> Gripper(force_n=99)
    Traceback (most recent call last):
    ValueError: parameter force_n is 99 N, allowed: 0.1 to 40 N
    """
    metadata = {
        'meaning': meaning,
        'unit': unit,
        'low': low,
        'high': high,
        'choices': choices,
        'allows': allows,
        'heading': heading,
        'affects': affects,
    }
    if isinstance(default, dict):
        return dataclasses.field(default_factory=lambda: dict(default), metadata=metadata)
    return dataclasses.field(default=default, metadata=metadata)


def names_that_affect(config_class: type[Any], part: str) -> frozenset[str]:
    """Return the names of the parameters whose fields say that they affect a part.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> 'threshold' in names_that_affect(ChainConfig, 'decision')
    True
    """
    fields = dataclasses.fields(config_class)
    return frozenset(field.name for field in fields if part in field.metadata['affects'])


def default_of(field: 'dataclasses.Field[Any]') -> Any:
    """Return the default of a dataclass field, also if it has a default factory.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> default_of(ChainConfig.__dataclass_fields__['threshold'])
    0.5
    """
    if field.default is not dataclasses.MISSING:
        return field.default
    assert field.default_factory is not dataclasses.MISSING
    return field.default_factory()


def allowed(field: 'dataclasses.Field[Any]') -> str:
    """Return the allowed values of a parameter in words.

    Examples
    --------
    >>> from slip_detector.parameters import GraspConfig
    >>> allowed(GraspConfig.__dataclass_fields__['deadline_s'])
    '0.001 to 60 s'
    """
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


def under_headings(config_class: type[Any]) -> dict[str, list['dataclasses.Field[Any]']]:
    """Return the fields of a parameter set by their headings, in order of definition.

    Examples
    --------
    >>> from slip_detector.parameters import ChainConfig
    >>> [field.name for field in under_headings(ChainConfig)['Interference']]
    ['common_mode', 'mains_hz']
    """
    found: dict[str, list[dataclasses.Field[Any]]] = {}
    heading = ''
    for field in dataclasses.fields(config_class):
        heading = field.metadata['heading'] or heading
        found.setdefault(heading, []).append(field)
    return found
