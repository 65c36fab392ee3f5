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

"""Sets of parameters: one field of a frozen dataclass is one ROS parameter.

A field has a default, a unit, a range and a meaning. The nodes, the command lines, the YAML files
and the core all use its name. Checks that need more than one parameter are in ``__post_init__``.
An error is a ``ValueError`` of one line with the parameter, its value and what is allowed.
"""

import dataclasses
import difflib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, TypeVar

import yaml

from slip_detector.parameters.conversion import converted, listed, shown, shown_name
from slip_detector.parameters.reading import SECTIONS, nodes_that_know, read_parameter_file

ConfigType = TypeVar('ConfigType', bound='ParameterSet')


@dataclasses.dataclass(frozen=True)
class ParameterSet:
    """Base class of all sets of parameters: conversion, checks and YAML.

    Examples
    --------
    >>> from slip_detector.parameters import GraspConfig
    >>> GraspConfig(grip_n=2).grip_n
    2.0
    >>> GraspConfig.from_parameters({'grip': 2.0})
    Traceback (most recent call last):
    ValueError: unknown parameter grip = 2.0; did you mean grip_n?
    >>> GraspConfig().to_yaml().splitlines()[0]
    '/**/grasp_controller:'
    """

    #: Name of the node or command whose section of a parameter file has these parameters.
    NODE = ''

    def __init_subclass__(cls) -> None:
        """Make this class the parameter set of its node's section, if it defines ``NODE``."""
        if 'NODE' in cls.__dict__:
            SECTIONS[cls.NODE] = cls

    def __post_init__(self) -> None:
        """Convert and check every field on its own."""
        for field in dataclasses.fields(self):
            value = converted(getattr(self, field.name), field, f'parameter {field.name}')
            object.__setattr__(self, field.name, value)

    @classmethod
    def from_parameters(
        cls: type[ConfigType], parameters: Mapping[str, Any], where: str = ''
    ) -> ConfigType:
        """Build a set from names and values in the form that ROS uses.

        Parameters
        ----------
        parameters
            Values by name; nested names are joined by a point (``groups.TP``).
        where
            Prefix of error messages, for example the path of a file.

        Raises
        ------
        ValueError
            For an unknown name or a value that is not allowed.
        """
        lead = f'{where}: ' if where else ''
        known = {field.name for field in dataclasses.fields(cls)}
        values: dict[str, Any] = {}
        nested: dict[str, dict[str, Any]] = {}
        for name, value in parameters.items():
            name = str(name)  # noqa: PLW2901 - in YAML it may be a number
            head, point, tail = name.partition('.')
            if head not in known or (point and (head != 'groups' or not tail)):
                hint = _hint(name, cls.NODE, known)
                label = f'{shown_name(name)} = {shown(value)}'
                raise ValueError(f'{lead}unknown parameter {label}; {hint}')
            if point:
                nested.setdefault(head, {})[tail] = value
            else:
                values[name] = value
        for head in nested.keys() & values.keys():
            names = listed([f'{head}.{tail}' for tail in nested[head]])
            raise ValueError(f'{lead}parameter {head} is given beside {names}, allowed: either')
        try:
            return cls(**values, **nested)
        except ValueError as error:
            raise ValueError(f'{lead}{error}') from None

    @classmethod
    def from_yaml(cls: type[ConfigType], path: str | Path) -> ConfigType:
        """Read the node's section of a ROS parameter file.

        The whole section is checked, also if this set has only some of the parameters.

        Raises
        ------
        ValueError
            When the file cannot be read or holds a value that is not allowed; names the file.
        """
        whole = SECTIONS[cls.NODE].from_parameters(read_parameter_file(path, cls.NODE), str(path))
        return cls(**{field.name: getattr(whole, field.name) for field in dataclasses.fields(cls)})

    def to_parameters(self) -> dict[str, Any]:
        """Return names and values in the form that ROS uses: flat lists, ``groups.TP``."""
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
        """Return the text of a ROS parameter file that :meth:`from_yaml` and the node read."""
        nested: dict[str, Any] = {}
        for name, value in self.to_parameters().items():
            head, _, tail = name.partition('.')
            if tail:
                nested.setdefault(head, {})[tail] = value
            else:
                nested[head] = value
        document = {f'/**/{self.NODE}': {'ros__parameters': nested}}
        return yaml.safe_dump(document, sort_keys=False, default_flow_style=None)


def _hint(name: str, node: str, known: Collection[str]) -> str:
    """Return a hint at what the user may have meant by an unknown name."""
    owners = nodes_that_know(name) if node else []
    near = difflib.get_close_matches(name, known, 1)
    if owners and node not in owners:
        return f'it is a parameter of {", ".join(owners)}'
    return f'did you mean {near[0]}?' if near else f'allowed: {", ".join(sorted(known))}'
