"""Write ROS parameter files, and see beforehand that files can be written."""

import copy
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.reading import read_yaml


def with_parameters(given: str | Path | None, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a parameter file with other values for the detector.

    Parameters
    ----------
    given
        The file to begin with; None: the defaults.
    changes
        By the name of the parameter, as ROS has them (flat lists).

    Returns
    -------
    dict
        The whole document: other nodes' sections too, without comments.

    Raises
    ------
    ValueError
        When the file cannot be read; names it.

    Examples
    --------
    >>> document = with_parameters(None, {'threshold': 0.25})
    >>> document['/**/slip_detector']['ros__parameters']['threshold']
    0.25
    """
    if given is None:
        document = yaml.safe_load(DetectorConfig().to_yaml())
    else:
        document = copy.deepcopy(read_yaml(given))
    sections = list(_sections(document))
    own = [parameters for name, parameters in sections if _last(name) == DetectorConfig.NODE]
    if not own:
        own = [{}]
        document[f'/**/{DetectorConfig.NODE}'] = {'ros__parameters': own[0]}
    for name, parameters in sections:
        # A section for all nodes may come after the detector's and would win.
        if _last(name) == '**':
            parameters.update({key: changes[key] for key in changes if key in parameters})
    own[-1].update(changes)
    return dict(document)


def _last(section: str) -> str:
    return section.rsplit('/', 1)[-1]


def _sections(
    document: Mapping[str, Any], namespace: str = ''
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the name and the parameters of each section, to be changed in place."""
    for name, content in document.items():
        section = f'{namespace}/{name}' if namespace else str(name)
        if isinstance(content, dict) and isinstance(content.get('ros__parameters'), dict):
            yield section, content['ros__parameters']
        elif isinstance(content, dict):
            yield from _sections(content, section)


def write_file(path: Path, document: Mapping[str, Any], comments: Iterable[str]) -> None:
    """Write a document with comments above it, whole or not at all.

    Raises
    ------
    ValueError
        When it cannot be written; names it.
    """
    text = ''.join(f'# {line}'.rstrip() + '\n' for line in comments)
    text += yaml.safe_dump(document, sort_keys=False, default_flow_style=None, allow_unicode=True)
    try:
        with tempfile.TemporaryDirectory(dir=path.parent, prefix=f'.{path.name}.') as folder:
            new = Path(folder) / path.name
            new.write_text(text, encoding='utf-8')
            os.replace(new, path)
    except OSError as error:
        raise ValueError(f'{path}: cannot be written ({error.strerror})') from None


def check_writable(path: Path) -> None:
    """See that a file can be written before much work is done for it.

    Raises
    ------
    ValueError
        When it cannot; names it.
    """
    try:
        if path.is_dir():
            raise IsADirectoryError(0, 'is a folder')
        if path.exists() and not path.is_file():  # What replaces a device would break it.
            raise OSError(0, 'is no file')
        existed = path.exists()
        with open(path, 'ab'):
            pass
        if not existed:
            path.unlink()
        with tempfile.TemporaryFile(dir=path.parent):  # A new file takes the place of an old one.
            pass
    except OSError as error:
        raise ValueError(f'{path}: cannot be written ({error.strerror})') from None


def writable_folder(folder: Path) -> Path:
    """Make a folder where there is none, and return it.

    Raises
    ------
    ValueError
        When it cannot be made; names it.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f'{folder}: cannot be made ({error.strerror})') from None
    return folder
