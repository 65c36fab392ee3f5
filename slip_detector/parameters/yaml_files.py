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

"""YAML files that mean what they look like, for ROS too: read up to a limit, and written whole."""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, ClassVar, NoReturn

import yaml

from slip_detector.parameters.fields import shortened
from slip_detector.parameters.files import check_plain, file_errors_of, whole_file

#: Largest size of a YAML file. A parameter file for a hundred channels has some 10 kB.
MOST_BYTES = 1_000_000

# What a parser of YAML calls the types of values; an odd one may not be given.
_TYPES = ('odd', 'bool', 'int', 'float', 'null', 'str', 'python/tuple')
_ODD, _BOOL, _INT, _FLOAT, _NULL, _STR, _TUPLE = (f'tag:yaml.org,2002:{name}' for name in _TYPES)

#: The plain values that ROS takes for no text. Odd are those that it or YAML does not take for
#: what they look like: ``020`` is 16, ``1:30`` is 90, and ``y`` is true.
_PLAIN = {
    _ODD: r'[yYnN]|[-+]?((?i:inf|nan|infinity)|0[0-9]+|0[bBxX][\w.]+([pP][-+]?[0-9]+)?'
    r'|[0-9][0-9_:]*[_:][0-9_:.]*)',
    _BOOL: 'yes|Yes|YES|no|No|NO|true|True|TRUE|false|False|FALSE|on|On|ON|off|Off|OFF',
    _INT: '[-+]?[0-9]+',
    _FLOAT: r'[-+]?(([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?|\.(inf|Inf|INF|nan|NaN|NAN))',
    _NULL: '~|null|Null|NULL|',
}


def _refuse(place: Any, problem: str) -> NoReturn:
    raise yaml.MarkedYAMLError(problem=problem, problem_mark=place.start_mark)


class _Types:
    """Gives plain values the types that they have for ROS, when files are read and written."""

    yaml_implicit_resolvers: ClassVar = {
        None: [(kind, re.compile(f'({pattern})\\Z')) for kind, pattern in _PLAIN.items()]
    }


class _Loader(_Types, yaml.SafeLoader):
    """Refuses, while it parses, what YAML or ROS would read otherwise than it looks."""

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Parse the next node."""
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):  # As ROS does: some lines can stand for billions.
            _refuse(event, 'has an alias, allowed: the value itself')
        if event.tag not in (None, _STR, _TUPLE):  # ROS ignores it.
            _refuse(event, f'has the tag {shortened(event.tag)}, allowed: none')
        node: Any = super().compose_node(parent, index)  # type: ignore[arg-type]
        is_scalar = isinstance(node, yaml.ScalarNode)
        if isinstance(parent, yaml.MappingNode) and index is None:
            if not is_scalar or not node.value:
                _refuse(node, 'has a name that is no text, allowed: a text')
            node.tag = _STR
        elif is_scalar and _is_odd(node.tag, node.value):
            what = f'{shortened(node.value)} is not what it looks like'
            _refuse(node, f'{what}, allowed: a decimal number, or a text in quotes')
        names = set()
        for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            if key.value in names:  # YAML takes the last one.
                _refuse(key, f'has {shortened(key.value)} again, allowed: once')
            names.add(key.value)
        return node  # type: ignore[no-any-return]


def _is_odd(kind: str, text: str) -> bool:
    """Return whether YAML or ROS reads a value otherwise than it looks."""
    too_long = kind == _INT and not -(2**63) <= int(text[:21]) < 2**63
    return too_long or kind == _ODD or '\0' in text  # For ROS a text ends there.


# launch_ros writes a list among the parameters of a launch file as a Python tuple.
_as_list: Any = _Loader.construct_yaml_seq
_Loader.add_constructor(_TUPLE, _as_list)


class _Dumper(_Types, yaml.SafeDumper):
    """Writes a value that occurs twice twice, not as an alias, which ROS does not read."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Read a YAML file of names and values.

    Each name may occur once in its mapping, a number must be decimal, and there are no aliases and
    no tags. Values have the types that ROS gives them.

    Raises
    ------
    ValueError
        When the file is missing, is not YAML, has no names, is too large, or has what is not
        allowed; names the file and the line.

    Examples
    --------
    >>> from slip_detector.parameters.files import shared_folder
    >>> list(read_yaml(shared_folder() / 'config' / 'slip_detector.yaml'))
    ['/**/slip_detector', '/**/slip_driver']
    """
    check_plain(path)
    with file_errors_of(path, 'read'), open(path, 'rb') as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise ValueError(f'{path}: has more than {MOST_BYTES} bytes, allowed: fewer')
    document = parsed_yaml(content, path)
    if isinstance(document, dict):
        return document
    raise ValueError(f'{path}: is not a YAML file of names and values')


def parsed_yaml(content: bytes, where: object) -> Any:
    """Return what YAML says, as in :func:`read_yaml`; a ValueError begins with ``where``.

    Examples
    --------
    >>> parsed_yaml(b'[1e-3, .5]', 'a.yaml')
    [0.001, 0.5]
    """
    try:
        return _Loader(content.decode()).get_single_data()
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        said = f'line {line}: {shortened(error.problem or "is not YAML")}'
    except (yaml.YAMLError, ValueError):
        said = 'is not YAML (it is not text)'
    except RecursionError:
        said = 'is nested too deeply, allowed: 200 levels'
    raise ValueError(f'{where}: {said}')


def write_yaml(path: Path, document: Mapping[str, Any], comments: Iterable[str] = ()) -> None:
    """Write a document with comments above it; a ValueError names a file that cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'tuned.yaml'
    ...     write_yaml(path, {'slip_detector': {'ros__parameters': {'vote': 2}}}, ['Tuned.'])
    ...     print(path.read_text().splitlines()[0])
    # Tuned.
    """
    with whole_file(path) as new:
        new.write_text(as_yaml(document, comments), encoding='utf-8')


def as_yaml(document: Mapping[str, Any], comments: Iterable[str] = ()) -> str:
    """Return the text of a document with comments above it."""
    lines = ''.join(f'# {line}'.rstrip() + '\n' for line in comments)
    text: str = yaml.dump(document, Dumper=_Dumper, sort_keys=False, default_flow_style=None)
    return lines + text
