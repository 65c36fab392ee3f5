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

"""Atomic writing of files, reading with a size limit, and checks that a file can be written."""

import contextlib
import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

#: Prefix of the temporary folder in which a file is written before it is moved to its place.
UNFINISHED = '.unfinished_'


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
    with (
        write_errors_of(path),
        tempfile.TemporaryDirectory(dir=place.parent, prefix=UNFINISHED) as folder,
    ):
        new = Path(folder) / place.name
        yield new
        for part in [*new.rglob('*'), new]:
            _bring_to_disk(part)
        os.replace(new, place)
        # Some file systems, such as network mounts, cannot flush a folder.
        with contextlib.suppress(OSError):
            _bring_to_disk(place.parent)


def _bring_to_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def read_limited(path: str | Path, most_bytes: int) -> bytes:
    """Return the content of a file, but read no more than a limit: a device may never end.

    Raises
    ------
    ValueError
        When the file cannot be read or is larger than ``most_bytes``; names it.

    Examples
    --------
    >>> read_limited('/dev/zero', 1000)
    Traceback (most recent call last):
    ValueError: /dev/zero: has more than 1000 bytes, allowed: fewer
    """
    try:
        with open(path, 'rb') as file:
            content = file.read(most_bytes + 1)
    except OSError as error:
        raise ValueError(f'{path}: cannot be read ({error.strerror})') from None
    if len(content) > most_bytes:
        raise ValueError(f'{path}: has more than {most_bytes} bytes, allowed: fewer')
    return content


@contextlib.contextmanager
def write_errors_of(path: str | Path) -> Iterator[None]:
    """Within a block, turn an error of the file system into a one-line message with the path.

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
    """Raise an error if a file cannot be written, so that long work is not done in vain.

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
        if path.exists() and not path.is_file():  # Writing would replace a device by a file.
            raise OSError(0, 'is no file')
        place, existed = Path(os.path.realpath(path)), path.exists()
        with open(path, 'ab'):
            pass
        if not existed:
            place.unlink()
        with tempfile.TemporaryFile(dir=place.parent):  # whole_file needs to write beside it.
            pass


def check_apart(written: Mapping[str, Path | None], read: Sequence[str | Path] = ()) -> None:
    """Raise an error if a file to write is also read, or written for another option.

    Parameters
    ----------
    written
        Files to write, by the option that names each; None: the option is not given.
    read
        Files that are read.

    Raises
    ------
    ValueError
        When two of these files are the same; names the option and the file.

    Examples
    --------
    >>> check_apart({'--out': Path('tuned.yaml'), '--report': Path('./tuned.yaml')})
    Traceback (most recent call last):
    ValueError: --report tuned.yaml: is written by --out too, allowed: a file of its own
    """
    taken = {Path(path).resolve(): 'is read' for path in read}
    for option, path in written.items():
        if path is None:
            continue
        place = path.resolve()
        if place in taken:
            raise ValueError(f'{option} {path}: {taken[place]} too, allowed: a file of its own')
        taken[place] = f'is written by {option}'


def writable_folder(folder: Path) -> Path:
    """Return a folder, which is made if it does not exist.

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
