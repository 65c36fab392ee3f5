"""Writes ROS parameter files, and checks beforehand that files can be written."""

import contextlib
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.reading import node_of, read_yaml, sections_of


def with_parameters(given: str | Path | None, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of a parameter file with changed values for the detector.

    Parameters
    ----------
    given
        The file to start from; None: the defaults of the detector.
    changes
        New values by the name of the parameter, in the form that ROS uses (flat lists).

    Returns
    -------
    dict
        The whole document, with the sections of other nodes but without comments.

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
        document: dict[str, Any] = yaml.safe_load(DetectorConfig().to_yaml())
    else:
        document = read_yaml(given)
    sections = list(sections_of(document, str(given)))
    own = [parameters for name, parameters in sections if node_of(name) == DetectorConfig.NODE]
    if not own:
        own = [{}]
        document[f'/**/{DetectorConfig.NODE}'] = {'ros__parameters': own[0]}
    for name, parameters in sections:
        # A section for all nodes that comes after the detector's would override it.
        if node_of(name) == '**':
            parameters.update({key: changes[key] for key in changes if key in parameters})
    own[-1].update(changes)
    return document


def write_file(path: Path, document: Mapping[str, Any], comments: Iterable[str]) -> None:
    """Write a document with comments above it; the file is never left incomplete.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'tuned.yaml'
    ...     write_file(path, {'slip_detector': {'ros__parameters': {'vote': 2}}}, ['Tuned.'])
    ...     print(path.read_text().splitlines()[0])
    # Tuned.
    """
    text = ''.join(f'# {line}'.rstrip() + '\n' for line in comments)
    text += yaml.safe_dump(document, sort_keys=False, default_flow_style=None, allow_unicode=True)
    with (
        write_errors_of(path),
        tempfile.TemporaryDirectory(dir=path.parent, prefix=f'.{path.name}.') as folder,
    ):
        new = Path(folder) / path.name
        new.write_text(text, encoding='utf-8')
        os.replace(new, path)


@contextlib.contextmanager
def write_errors_of(path: str | Path) -> Iterator[None]:
    """Within a block, make each error of the file system one line that names the path.

    Raises
    ------
    ValueError
        For any OSError within the block.

    Examples
    --------
    >>> with write_errors_of('pictures'):
    ...     raise OSError(28, 'No space left on device')
    Traceback (most recent call last):
    ValueError: pictures: cannot be written (No space left on device)
    """
    try:
        yield
    except OSError as error:
        raise ValueError(f'{path}: cannot be written ({error.strerror or error})') from None


def check_writable(path: Path) -> None:
    """Raise an error if a file cannot be written, before much work is done for it.

    Raises
    ------
    ValueError
        When the file cannot be written; names it.

    Examples
    --------
    >>> check_writable(Path('no such folder') / 'tuned.yaml')
    Traceback (most recent call last):
    ValueError: no such folder/tuned.yaml: cannot be written (No such file or directory)
    """
    with write_errors_of(path):
        if path.is_dir():
            raise IsADirectoryError(0, 'is a folder')
        if path.exists() and not path.is_file():  # A device must not be replaced by a file.
            raise OSError(0, 'is no file')
        existed = path.exists()
        with open(path, 'ab'):
            pass
        if not existed:
            path.unlink()
        with tempfile.TemporaryFile(dir=path.parent):  # A new file will replace the old one.
            pass


def writable_folder(folder: Path) -> Path:
    """Make a folder where there is none, and return it.

    Raises
    ------
    ValueError
        When the folder cannot be made; names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     writable_folder(Path(folder) / 'out').is_dir()
    True
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ValueError(f'{folder}: cannot be made ({error.strerror})') from None
    return folder
