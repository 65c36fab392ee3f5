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

"""Sets of parameters: frozen dataclasses that ROS, YAML files and Python all give values.

One field of a frozen dataclass is one ROS parameter, with a default, a unit, a range and a
meaning. The nodes, the command lines, the YAML files and the core all use its name. Checks that
need more than one parameter are in ``__post_init__``. An error is a ``ValueError`` of one line
with the parameter, its value and what is allowed.
"""

import copy
import dataclasses
import difflib
import logging
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from slip_detector.parameters import sections
from slip_detector.parameters.fields import Field, allowed, convert, quote, quote_name, refuse

LOG = logging.getLogger(__name__)

if TYPE_CHECKING:
    from typing_extensions import Self, dataclass_transform
else:  # Python 3.10 has none.

    def dataclass_transform(**_):
        """Return a decorator that tells type checkers what the subclasses of a class are."""
        return lambda base: base


ConfigType = TypeVar('ConfigType', bound='ParameterSet')


@dataclass_transform(frozen_default=True)
class ParameterSet:
    """Base class of all sets of parameters, frozen dataclasses: conversion, checks and YAML.

    Examples
    --------
    >>> from slip_detector.parameters import GraspConfig
    >>> GraspConfig(grip_n=2).grip_n
    2.0
    >>> GraspConfig.from_parameters({'grip': 2.0})
    Traceback (most recent call last):
    ValueError: unknown parameter grip = 2.0; did you mean grip_n?
    >>> list(GraspConfig().to_document())
    ['/**/grasp_controller']
    """

    #: Name of the node or command whose section of a parameter file has these parameters.
    NODE = ''

    __dataclass_fields__: ClassVar[dict[str, Field]]

    def __init_subclass__(cls) -> None:
        """Make this class a dataclass."""
        dataclasses.dataclass(frozen=True)(cls)

    def __post_init__(self) -> None:
        """Convert and check every field on its own, but for defaults, which are right."""
        for field in dataclasses.fields(self):
            if (value := getattr(self, field.name)) is not field.default:
                value = convert(value, field, f'parameter {field.name}')
                object.__setattr__(self, field.name, value)

    def require(self, holds: bool, name: str, allowed_text: str = '', what: str = '') -> None:
        """Raise the ValueError of a parameter that does not go with the others.

        Parameters
        ----------
        holds
            Whether the parameter goes with the others.
        name
            The name of the parameter.
        allowed_text
            What is allowed; empty: as the field says.
        what
            What is wrong with the parameter; empty: its value.
        """
        if not holds:
            value, field = getattr(self, name), self.__dataclass_fields__[name]
            is_number = isinstance(value, (int, float))
            text = f'{value:g} {field.metadata["unit"]}' if is_number else quote(value)
            what = what or f'is {text}'.rstrip()
            refuse(f'parameter {name} {what}', allowed_text or allowed(field))

    def remarks(self) -> list[str]:
        """Return what a user should know of values that are allowed."""
        return []

    def limits(self) -> dict[str, str]:
        """Return what the other parameters allow, by the names of the parameters that they limit.

        Examples
        --------
        >>> from slip_detector.parameters import ChainConfig
        >>> ChainConfig().limits()['vote']
        'at most 4, the enabled channels of the smallest group'
        """
        found: dict[str, str] = {}
        again: Any = copy.copy(self)
        vars(again)['require'] = lambda _, name, text='', what='': found.setdefault(name, text)
        again.__post_init__()
        return found

    @classmethod
    def from_parameters(
        cls: type[ConfigType],
        parameters: Mapping[str, Any],
        where: str = '',
        own: Collection[str] | None = None,
        warn: Callable[[str], Any] = LOG.warning,
    ) -> ConfigType:
        """Build a set from names and values in the form that ROS uses.

        Parameters
        ----------
        parameters
            Values by name; nested names are joined by a point (``groups.TP``).
        where
            Prefix of messages, for example the path of a file.
        own
            Names of the values that are for this node, not for all nodes of the robot; None: all.
        warn
            A function for warnings of an unknown name among the values for all nodes that is
            nearly a name of this set, or is a quality of service.

        Raises
        ------
        ValueError
            For a value that is not allowed, or an unknown name of a value for this node.
        """
        lead, known = f'{where}: ' if where else '', cls.__dataclass_fields__
        values: dict[str, Any] = {}
        groups: dict[str, Any] = {}
        for key, value in parameters.items():
            name = str(key)  # YAML has names that are numbers.
            head, _, tail = name.partition('.')
            if name in known:
                values[name] = value
            elif head == 'groups' in known and tail:
                groups[tail] = value
            else:
                is_own = own is None or name in own
                hint = cls._hint(name, is_own)
                label = f'parameter {quote_name(name)} = {quote(value)}'
                if is_own:
                    raise ValueError(f'{lead}unknown {label}; {hint}')
                if hint:
                    warn(f'{lead}left out: {label}, given to all nodes; {hint}')
        if groups and 'groups' in values:
            refuse(f'{lead}parameter groups is given beside groups.<name>', 'one of both')
        try:
            return cls(**values, **({'groups': groups} if groups else {}))
        except ValueError as error:
            raise ValueError(f'{lead}{error}') from None

    @classmethod
    def _hint(cls, name: str, is_own: bool) -> str:
        """Return what an unknown name may mean; empty if it may be a name of another node."""
        if name.startswith('qos_overrides'):  # As other nodes of rclpy have them.
            return 'the quality of service of the topics cannot be changed'
        owners = sections.nodes_that_know(name) if cls.NODE else []
        if owners and not (is_own and cls.NODE in owners):
            return f'it is a parameter of {", ".join(owners)}' if is_own else ''
        head, known = name.partition('.')[0], sorted(cls.__dataclass_fields__)
        # Most letters, or all but one.
        share = 0.6 if is_own else min(0.8, 1.0 - 1.0 / max(len(head), 1))
        near = difflib.get_close_matches(head, known, 1, share)
        if near:
            return f'did you mean {near[0]}?'
        return f'allowed: {", ".join(known)}' if is_own else ''

    @classmethod
    def from_yaml(cls: type[ConfigType], path: str | Path, node: str = '') -> ConfigType:
        """Read the node's section of a ROS parameter file.

        The whole section is checked, also if this set has only some of the parameters of the node.
        Of the sections for all nodes (``/**``) only parameters of this node are taken; a warning
        is logged for a name there that is nearly one of them.

        Parameters
        ----------
        path
            The YAML file.
        node
            Full name of the node; empty: in any namespace.

        Raises
        ------
        ValueError
            When the file cannot be read, has sections for the node in several namespaces, or holds
            a value that is not allowed; names the file.
        """
        values, own, _ = sections.parameters_for(path, cls.NODE, node)
        whole_set = sections.set_of(cls.NODE) if cls.NODE in sections.SECTIONS else cls
        whole = whole_set.from_parameters(values, str(path), own)
        return cls(**{name: getattr(whole, name) for name in cls.__dataclass_fields__})

    def with_values(self, values: Mapping[str, Any]) -> 'Self':
        """Return a copy with other values, by flat names; None deletes a group.

        Raises
        ------
        ValueError
            For an unknown name, values that are not allowed, or a parameter that cannot be
            deleted.

        Examples
        --------
        >>> from slip_detector.parameters import GraspConfig
        >>> GraspConfig().with_values({'grip_n': 2}).grip_n
        2.0
        """
        merged = {**self.to_parameters(), **values}
        for name, value in values.items():
            if value is None and not name.startswith('groups.'):
                refuse(f'parameter {name} cannot be deleted', 'groups.<name>')
        return self.from_parameters({n: v for n, v in merged.items() if v is not None})

    def changes_to(self, other: 'ParameterSet', kept: Collection[str] = ()) -> dict[str, Any]:
        """Return the values with which this becomes another configuration; None deletes a group.

        The parameters in ``kept`` stay as they are.

        Examples
        --------
        >>> from slip_detector.parameters import GraspConfig
        >>> GraspConfig().changes_to(GraspConfig(grip_n=2, step_n=1), kept=['step_n'])
        {'grip_n': 2.0}
        """
        before, after = self.to_parameters(), other.to_parameters()
        names = [name for name in {**before, **after} if before.get(name) != after.get(name)]
        return {name: after.get(name) for name in names if name.partition('.')[0] not in kept}

    def to_parameters(self) -> dict[str, Any]:
        """Return names and values in the form that ROS uses: flat lists, ``groups.TP``."""
        return sections.flattened(self.to_yaml())

    def to_document(self, whole: bool = True) -> dict[str, Any]:
        """Return the content of a ROS parameter file that :meth:`from_yaml` and the node read.

        The file has all parameters, or only those that differ from the defaults.
        """
        defaults = {} if whole else type(self)().to_yaml()
        values = {n: v for n, v in self.to_yaml().items() if whole or v != defaults[n]}
        return {f'/**/{self.NODE}': {'ros__parameters': values}} if values else {}

    def to_yaml(self) -> dict[str, Any]:
        """Return names and values in the form of a YAML file: flat lists, nested groups."""
        return {
            field.name: _plain(getattr(self, field.name)) for field in dataclasses.fields(self)
        }


def _plain(value: Any) -> Any:
    """Return a value with lists in place of tuples, and a flat one in place of pairs."""
    if isinstance(value, dict):
        return {name: [*items] for name, items in value.items()}
    if isinstance(value, tuple):
        return [n for item in value for n in (item if isinstance(item, tuple) else (item,))]
    return value
