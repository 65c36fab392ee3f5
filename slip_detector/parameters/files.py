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

"""Files: written whole or not at all, folders, and the files that come with the package."""

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

#: Prefix of the temporary folder in which a file is written before it is moved to its place.
UNFINISHED = '.unfinished_'

#: The folder of the user's cache (XDG base directory specification), an absolute path; without a
#: home it is one where nothing can be written.
_CACHES = os.environ.get('XDG_CACHE_HOME', ''), os.path.expanduser('~/.cache'), os.devnull
CACHE = next(filter(os.path.isabs, _CACHES))


def shared_folder() -> Path:
    """Return the folder that holds ``config``: the source tree's or the installed package's.

    Raises
    ------
    ValueError
        When the package was installed without it.

    Examples
    --------
    >>> (shared_folder() / 'config' / 'slip_detector.yaml').is_file()
    True
    """
    for parent in Path(__file__).resolve().parents:
        for folder in (parent, parent / 'share' / 'slip_detector'):
            if (folder / 'config' / 'scenes').is_dir() and (folder / 'package.xml').is_file():
                return folder
    raise ValueError('the package was installed without its config folder: install it again')


def find_parameter_file(name: str) -> Path:
    """Return a parameter file, given by its path or by its name in the package.

    Raises
    ------
    ValueError
        When there is none.

    Examples
    --------
    >>> find_parameter_file('onset.yaml').parent.name
    'config'
    """
    own = shared_folder() / 'config'
    paths = Path(name), own / name
    found = [path for path in paths if os.path.exists(path) and not os.path.isdir(path)]
    files = [*sorted(own.glob('*.yaml')), *sorted(own.glob('sensors/*.yaml'))]
    names = ', '.join(str(path.relative_to(own)) for path in files)
    if not found:
        choices = f'the path of a parameter file, or one of {names}'
        raise ValueError(f'config is {name!r}, allowed: {choices}')
    return found[0]


def check_plain(path: str | Path) -> None:
    """Raise an error if a path is a pipe, a device or a socket, which may never end.

    Examples
    --------
    >>> check_plain('/dev/zero')
    Traceback (most recent call last):
    ValueError: /dev/zero: is no file, allowed: a file
    """
    # These take an error, as of a folder that may not be read, for "no".
    if os.path.exists(path) and not (os.path.isfile(path) or os.path.isdir(path)):
        raise ValueError(f'{path}: is no file, allowed: a file')


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """Write a file or folder atomically: it replaces ``path`` only after the block succeeds.

    Within the block, write to the temporary path that is given. It is flushed to the disk before
    it replaces the file. So the file is complete or unchanged, also when the disk is full, the
    process is killed or the power fails.

    Parameters
    ----------
    path
        A file, or a folder that does not exist yet.

    Raises
    ------
    ValueError
        For any OSError within the block or after it; names the file.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = Path(folder) / 'report.html'
    ...     with whole_file(report) as new:
    ...         _ = new.write_text('A second of rest')
    ...         print(report.exists())
    ...     print(report.read_text())
    False
    A second of rest
    """
    # Replace the target of a symbolic link, not the link: in a workspace built with
    # --symlink-install the configurations are links.
    place = Path(os.path.realpath(path))
    check_plain(place)
    with (
        file_errors_of(path),
        tempfile.TemporaryDirectory(dir=place.parent, prefix=UNFINISHED) as folder,
    ):
        new = Path(folder) / Path(path).name  # Its ending may say what to write.
        yield new
        for file in filter(Path.is_file, [new, *new.rglob('*')]):
            with open(file, 'rb') as opened:
                os.fsync(opened.fileno())
        os.replace(new, place)


@contextlib.contextmanager
def file_errors_of(path: str | Path, done: str = 'written') -> Iterator[None]:
    """Within a block, turn an error of the file system into a ValueError of one line."""
    try:
        yield
    except OSError as error:
        raise ValueError(f'{path}: cannot be {done} ({error.strerror or error})') from None


def writable_folder(folder: Path) -> Path:
    """Return a folder, which is made if it does not exist; a ValueError if it cannot be made."""
    with file_errors_of(folder):
        folder.mkdir(parents=True, exist_ok=True)
    return folder
