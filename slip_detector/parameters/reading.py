"""Read ROS parameter files."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

#: Parameters that rclpy itself declares and reads, on every node.
OF_RCLPY = ('use_sim_time', 'start_type_description_service', 'qos_overrides')

#: By the name of a section of a parameter file, a node's or a command's: the set with all its
#: parameters. The sets enter themselves when they are defined; a set that is a part of another
#: (the chain's of the detector's) is a base class of it, and so is replaced by it.
SECTIONS: dict[str, type[Any]] = {}


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
    except ValueError as error:  # for example an impossible date
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

    The section for all nodes (``/**``) applies, those for the node in any namespace
    (``/**/node``) and one in a certain namespace. Of the section for all nodes, parameters of
    other nodes of this package are left out.

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
    left_out = names_for_others(path, node)
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
    return {
        name: value
        for name, value in merged.items()
        if name.split('.')[0] not in OF_RCLPY and name not in left_out
    }


def names_for_others(path: str | Path, node: str) -> set[str]:
    """Return the names that a parameter file gives to all nodes, and only others know.

    Parameters
    ----------
    path
        The YAML file.
    node
        Name of the node, without namespace.

    Raises
    ------
    ValueError
        When the file is missing or is not a ROS parameter file.
    """
    for_all: set[str] = set()
    for_node: set[str] = set()
    for section, parameters in _sections(read_yaml(path), str(path)):
        last = section.rsplit('/', 1)[-1]
        if last == '**':
            for_all.update(_flattened(parameters))
        elif last == node:
            for_node.update(_flattened(parameters))
    return {
        name
        for name in for_all - for_node
        if (known := nodes_that_know(name)) and node not in known
    }


def nodes_that_know(name: str) -> list[str]:
    """Return the nodes and commands of this package that have a parameter.

    Parameters
    ----------
    name
        Of the parameter; of ``groups.TP`` the part before the point counts.

    Examples
    --------
    >>> import slip_detector.parameters
    >>> nodes_that_know('sample_rate_hz'), nodes_that_know('channels')
    (['slip_detector'], ['slip_detector', 'slip_driver'])
    """
    head = name.partition('.')[0]
    return [
        node
        for node, parameters in SECTIONS.items()
        if head in {field.name for field in dataclasses.fields(parameters)}
    ]


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
