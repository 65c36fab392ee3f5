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

"""Reads YAML files, and refuses what YAML 1.1 would read otherwise than a user expects.

Each name may occur once and a number must be decimal: YAML 1.1 takes the last of two equal names,
and reads ``1:30`` as 90 and ``020`` as 16. The size of a file, its depth and the number of its
values have limits, which are checked before values are built: aliases let a small file stand
for billions of values.
"""

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

from slip_detector.parameters.conversion import shortened
from slip_detector.parameters.files import read_limited

#: Largest size of a YAML file. A parameter file for a hundred channels has some 10 kB.
MOST_BYTES = 1_000_000

#: Deepest nesting of lists and mappings.
MOST_DEPTH = 32

#: Largest number of values in a file; an alias counts as all the values that it stands for.
MOST_VALUES = 100_000

#: Numbers that YAML 1.1 reads as a user expects.
_PLAIN_NUMBER = re.compile(
    r'[-+]?(0|[1-9][0-9]*|0x[0-9a-fA-F]+|([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?'
    r'|\.(inf|Inf|INF))|\.(nan|NaN|NAN)'
)

_NUMBER_TAGS = ('tag:yaml.org,2002:int', 'tag:yaml.org,2002:float')


class _Loader(yaml.SafeLoader):
    """Checks depth and number of values while the text is parsed into nodes.

    Parameters
    ----------
    text
        The text.
    path
        The file, for messages.
    """

    def __init__(self, text: str, path: str | Path) -> None:
        super().__init__(text)
        self._path, self._depth, self._values = path, 0, 0
        self._of_anchor: dict[str, int] = {}
        self._open: list[str] = []

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Parse the next node; an alias counts as the values that it stands for."""
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        where = f'{self._path}: line {event.start_mark.line + 1}'
        before = self._values
        is_alias = isinstance(event, yaml.AliasEvent)
        if is_alias and event.anchor in self._open:
            raise ValueError(f'{where} holds itself, allowed: names and values')
        self._values += self._of_anchor.get(event.anchor, 0) if is_alias else 1
        if self._values > MOST_VALUES:
            raise ValueError(f'{where} exceeds the limit, allowed: {MOST_VALUES} values')
        if self._depth == MOST_DEPTH:
            raise ValueError(f'{where} is nested too deeply, allowed: {MOST_DEPTH} deep')
        self._depth += 1
        if event.anchor is not None:
            self._open.append(event.anchor)
        node: yaml.Node | None = super().compose_node(parent, index)  # type: ignore[arg-type]
        if event.anchor is not None:
            self._open.pop()
            if not is_alias:
                self._of_anchor[event.anchor] = self._values - before
        self._depth -= 1
        return node


# launch_ros writes a list among the parameters of a launch file as a Python tuple.
_Loader.add_constructor(
    'tag:yaml.org,2002:python/tuple',
    _Loader.construct_yaml_seq,  # type: ignore[type-var]
)


def read_yaml(path: str | Path) -> dict[str, Any]:
    """Read a YAML file of names and values.

    Raises
    ------
    ValueError
        When the file is missing, is not YAML, has no names or is too large, or when a name occurs
        twice or a number is not decimal; names the file and the line.

    Examples
    --------
    >>> from slip_detector.parameters.shared_folder import shared_folder
    >>> list(read_yaml(shared_folder() / 'config' / 'slip_detector.yaml'))
    ['/**/slip_detector', '/**/slip_driver']
    """
    node = compose_yaml(path)
    for scalar in _scalars(node):
        if scalar.tag in _NUMBER_TAGS and not _PLAIN_NUMBER.fullmatch(scalar.value):
            raise ValueError(
                f'{path}: line {scalar.start_mark.line + 1}: {shortened(scalar.value)} is not a '
                'number as it looks, allowed: a decimal number, or a text in quotes'
            )
    try:
        with _yaml_errors(path):
            document = _Loader('', path).construct_document(node) if node else None
    except (LookupError, AttributeError):  # from PyYAML, for example for !!bool before a text
        raise ValueError(f'{path}: is not YAML (a value is not what its tag says)') from None
    except (ValueError, OverflowError) as error:  # for example an impossible date
        said = str(error)
        where = said if said.startswith(str(path)) else f'{path}: is not YAML ({said})'
        raise ValueError(where) from None
    if not isinstance(document, dict):
        raise ValueError(f'{path}: is not a YAML file of names and values')
    return {str(name): value for name, value in document.items()}


def compose_yaml(path: str | Path) -> yaml.Node | None:
    """Read a YAML file as a node, which knows its line numbers; None: the file is empty.

    Raises
    ------
    ValueError
        When the file cannot be read, is not YAML or is too large, or when a name occurs twice;
        names the file and the line.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / 'a.yaml'
    ...     _ = file.write_text('slip_s: [[1.0, 2.5]]')
    ...     compose_yaml(file).value[0][0].value
    'slip_s'
    """
    try:
        text = read_limited(path, MOST_BYTES).decode()
    except UnicodeDecodeError:
        raise ValueError(f'{path}: is not text, allowed: a YAML file') from None
    with _yaml_errors(path):
        node: yaml.Node | None = _Loader(text, path).get_single_node()
    _check_names(node, path)
    return node


@contextlib.contextmanager
def _yaml_errors(path: str | Path) -> Iterator[None]:
    """Within a block, turn an error of PyYAML into a one-line message with file and line."""
    try:
        yield
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = f' line {mark.line + 1}' if mark else ''
        problem = getattr(error, 'problem', None) or 'cannot be parsed'
        raise ValueError(f'{path}:{line} is not YAML ({shortened(problem)})') from None


def _nodes(node: yaml.Node | None) -> Iterator[yaml.Node]:
    """Yield a node and all nodes in it, each once."""
    left, seen = [node] if node else [], set()
    while left:
        one = left.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        yield one
        if isinstance(one, yaml.MappingNode):
            left += [part for pair in one.value for part in pair]
        elif isinstance(one, yaml.SequenceNode):
            left += one.value


def _scalars(node: yaml.Node | None) -> Iterator[yaml.ScalarNode]:
    """Yield the scalars of a node in the order of their lines."""
    found = [one for one in _nodes(node) if isinstance(one, yaml.ScalarNode)]
    yield from sorted(found, key=lambda one: one.start_mark.index)


def _check_names(node: yaml.Node | None, path: str | Path) -> None:
    """Check that no mapping has a name twice; ``1`` and ``'1'`` count as the same name."""
    for one in _nodes(node):
        if not isinstance(one, yaml.MappingNode):
            continue
        lines: dict[str, int] = {}
        for key, _ in one.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            line = key.start_mark.line + 1
            if key.value in lines:
                raise ValueError(
                    f'{path}: line {line}: has {shortened(key.value)} again, as in line '
                    f'{lines[key.value]}, allowed: once'
                )
            lines[key.value] = line
