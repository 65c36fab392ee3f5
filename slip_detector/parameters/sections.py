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

"""ROS parameter files: which of their sections are for which node or command."""

import re
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from slip_detector.parameters.fields import refuse, shown, shown_name
from slip_detector.parameters.files import read_yaml

#: The parameter set of each section of a parameter file of this package, by the name of its node
#: or command; ``slip_detector.parameters``, which defines the sets, enters them.
SECTIONS: dict[str, Any] = {}

#: What ROS takes for the full name of a node, with ``*`` for any name and ``**`` for any names.
_NAME = r'(\*\*?|[A-Za-z_][A-Za-z0-9_]{0,254})'
SECTION = re.compile(f'/?{_NAME}(/{_NAME})*')

#: Full name and parameters of a section. ``**`` in the name stands for any namespaces, or for all
#: nodes; names of parameters may be nested.
Section = tuple[str, dict[str, Any]]

#: Parameters that rclpy itself declares and reads for every node.
OF_RCLPY = ('use_sim_time', 'start_type_description_service')

#: What stands in place of a node's name in a section for all nodes.
ALL = ('**', '*')


def node_of(section: str) -> str:
    """Return the node that a section is for, without namespace; one of :data:`ALL` means all."""
    return section.rsplit('/', 1)[-1]


def matches(section: str, node: str) -> bool:
    """Return whether a section of a parameter file is for a node, by the rules of ROS.

    Examples
    --------
    >>> node = '/index/slip_driver'
    >>> [matches(name, node) for name in ('/**/slip_driver', '/*/slip_driver', '/**')]
    [True, True, True]
    >>> [matches(name, node) for name in ('slip_driver', '/thumb/slip_driver')]
    [False, False]
    """
    pattern = re.escape(f'/{section.lstrip("/")}')
    pattern = pattern.replace(r'/\*\*', r'(/\w+)*').replace(r'/\*', r'(/\w+)')
    return re.fullmatch(pattern, node) is not None


def sections_of(document: Mapping[str, Any], path: object, above: str = '') -> Iterator[Section]:
    """Yield the sections of the content of a ROS parameter file.

    Parameters
    ----------
    document
        The content of the file.
    path
        The file, for messages.
    above
        Names of the mappings around the document, joined by ``/``.

    Raises
    ------
    ValueError
        When a section has no parameters; names the file and the section.

    Examples
    --------
    >>> document = {'hand': {'slip_driver': {'ros__parameters': {'seed': 3}}}}
    >>> list(sections_of(document, 'hand.yaml'))
    [('hand/slip_driver', {'seed': 3})]
    """
    for name, content in document.items():
        section = f'{above}/{name}' if above else name
        below = dict(content) if isinstance(content, dict) else {}
        own = below.pop('ros__parameters', {} if below else None)
        if not isinstance(own, dict):
            raise ValueError(f'{path}: section {section} has no names under ros__parameters')
        yield from sections_of(below, path, section)
        if 'ros__parameters' in content:
            if not SECTION.fullmatch(section):
                text = 'letters, digits, _, as in /finger/slip_detector or /**/slip_detector'
                refuse(f'{path}: section {shown(section)} is no name of a node', text)
            check_values(own, path)
            yield section, own


def check_values(parameters: Mapping[str, Any], where: object) -> None:
    """Check that ROS reads these values too; a ValueError begins with ``where``.

    Examples
    --------
    >>> check_values({'passband_hz': [10, 100.0]}, 'a.yaml')
    Traceback (most recent call last):
    ValueError: a.yaml: passband_hz is [10, 100.0], allowed: numbers of one kind: write 10.0
    """
    for name, value in flattened(parameters).items():
        items = value if isinstance(value, list) else [value]
        kinds = {type(item) for item in items}
        if len(kinds) > 1 or not kinds <= {bool, int, float, str}:
            text = 'a number, a text, true or false, or a list of one of these kinds'
            if kinds == {int, float}:
                whole = next(item for item in items if isinstance(item, int))
                text = f'numbers of one kind: write {float(whole)}'
            said = 'nothing' if value is None else shown(value)
            refuse(f'{where}: {shown_name(name)} is {said}', text)


def our_sections(path: str | Path, *nodes: str) -> list[Section]:
    """Return the sections of a ROS parameter file for these nodes and those of this package.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has no such section; names the
        file.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> from slip_detector.parameters.files import shared_folder
    >>> [name for name, _ in our_sections(shared_folder() / 'config' / 'grasp.yaml')]
    ['/**/slip_detector', '/**/grasp_controller', '/**/slip_driver']
    """
    every = sections_of(read_yaml(path), path)
    ours = [section for section in every if node_of(section[0]) in (*SECTIONS, *ALL, *nodes)]
    if not ours:
        refuse(f'{path}: has no section of this package', ', '.join(SECTIONS))
    return ours


def parameters_for(
    path: str | Path, node: str, executable: str = ''
) -> tuple[dict[str, Any], set[str]]:
    """Return the parameters that a ROS parameter file has for a node of this package.

    Parameters
    ----------
    path
        The YAML file.
    node
        Name of the node: in full, or without namespace for the sections in any namespace.
    executable
        Name of its executable, whose sections count where none is for a node's own full name.

    Returns
    -------
    dict
        Flat names (``groups.TP``) and values, without the parameters of rclpy.
    set
        Those of the names that are given to this node, and not to all nodes.

    Raises
    ------
    ValueError
        When the file is missing, is not a ROS parameter file, or has sections for the node in
        several namespaces and the name does not tell which.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> from slip_detector.parameters.files import shared_folder
    >>> file = shared_folder() / 'config' / 'slip_detector.yaml'
    >>> parameters_for(file, 'slip_detector')[0]['groups.TP']
    [14, 16, 11, 9]
    """
    if node.startswith('/'):
        every, names = [*sections_of(read_yaml(path), path)], [node]
        if not any(matches(name, node) and node_of(name) not in ALL for name, _ in every):
            names += [f'{node.rpartition("/")[0]}/{executable}']
        sections = [each for each in every if any(matches(each[0], name) for name in names)]
    else:
        sections = [each for each in our_sections(path, node) if node_of(each[0]) in (node, *ALL)]
        named = [name for name, _ in sections if '*' not in name]
        if len(named) > 1:
            refuse(f'{path}: has sections for {", ".join(named)}', 'one namespace')
    flat = [(section, flattened(parameters)) for section, parameters in sections]
    values = {name: value for _, its in flat for name, value in its.items()}
    own = {name for section, its in flat if node_of(section) not in ALL for name in its}
    return {name: value for name, value in values.items() if name not in OF_RCLPY}, own


def given_to(path: str | Path, executable: str, node: str) -> dict[str, Any]:
    """Return what a parameter file gives to a node, by its full name, not to all nodes.

    ROS ignores sections that do not match, so that the node would run with its defaults. A node
    of another name than its executable's is given what is for that, if nothing is for itself.

    Raises
    ------
    ValueError
        When all sections for the executable, the default name of the node, are for nodes of other
        names, or no section is for this package; for a node of another name, when the file has a
        name for the executable and for all nodes, as ROS gives it the latter.
    """
    values, own = parameters_for(path, node, executable)
    for_all, its = parameters_for(path, node)
    if twice := sorted((own - its) & for_all.keys()):
        what = f'{path}: has {", ".join(twice)} for {executable} and for all nodes'
        refuse(what, f'a section for this node, {node}')
    default = f'{node.rpartition("/")[0]}/{executable}'
    ours = [] if own else [name for name, _ in our_sections(path) if node_of(name) == executable]
    if ours and not any(matches(name, default) for name in ours):
        what = f'{path}: has sections for {", ".join(ours)}, none for this node, {node}'
        refuse(what, f'{node} or /**/{node_of(node)}')
    return {name: values[name] for name in own}


def sections_for_others(path: str | Path, executable: str, nodes: Collection[str]) -> list[str]:
    """Return the sections of a parameter file for nodes of an executable, but for none of these.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / 'hand.yaml'
    ...     _ = file.write_text('/ringg/slip_driver: {ros__parameters: {seed: 3}}')
    ...     sections_for_others(file, 'slip_driver', ['/ring/slip_driver'])
    ['/ringg/slip_driver']
    """
    known = [*nodes, *(f'{node.rpartition("/")[0]}/{executable}' for node in nodes)]
    kinds = {*map(node_of, known)}
    names = [name for name, _ in sections_of(read_yaml(path), path) if node_of(name) in kinds]
    return [name for name in names if not any(matches(name, node) for node in known)]


def flattened(values: Mapping[str, Any], prefix: str = '') -> dict[str, Any]:
    """Return values by their names with points.

    Examples
    --------
    >>> flattened({'threshold': 0.5, 'groups': {'TP': [1, 2]}})
    {'threshold': 0.5, 'groups.TP': [1, 2]}
    """
    flat: dict[str, Any] = {}
    for key, value in values.items():
        name = f'{prefix}{key}'
        nested = isinstance(value, Mapping) and value
        flat |= flattened(value, f'{name}.') if nested else {name: value}
    return flat


def nodes_that_know(name: str) -> list[str]:
    """Return the nodes and commands of this package that have a parameter.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> nodes_that_know('sample_rate_hz'), nodes_that_know('channels')
    (['slip_detector'], ['slip_detector', 'slip_driver'])
    """
    head = name.partition('.')[0]
    return [node for node, its in SECTIONS.items() if head in its.__dataclass_fields__]
