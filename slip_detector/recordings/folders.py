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

"""Sorts the recordings of a command line into sets by their folders."""

from collections.abc import Sequence
from pathlib import Path

from slip_detector.recordings.reading import ENDINGS, is_recording


def recording_sets(arguments: Sequence[str]) -> dict[str, list[Path]]:
    """Sort files and folders into sets of recordings.

    Parameters
    ----------
    arguments
        Paths of recordings, and of folders of recordings. The recordings in one folder are a set.

    Returns
    -------
    dict
        The files of each set by its name: the name of the folder, or its path if two folders have
        the same name. The files of a folder in ``arguments`` are sorted by name.

    Raises
    ------
    ValueError
        For a folder without recordings or a recording given twice.

    Examples
    --------
    >>> sets = recording_sets(['left/a.npz', 'right/a.npz', 'left/b.mcap'])
    >>> {name: [file.name for file in files] for name, files in sets.items()}
    {'left': ['a.npz', 'b.mcap'], 'right': ['a.npz']}
    """
    by_folder: dict[Path, list[Path]] = {}
    for argument in map(Path, arguments):
        folder = argument.is_dir() and not is_recording(argument)
        files = _recordings_in(argument) if folder else [argument]
        for file in files:
            mine = by_folder.setdefault(file.parent.resolve(), [])
            if file.name in [other.name for other in mine]:
                raise ValueError(f'{file}: is given twice, allowed: each once')
            mine.append(file)
    names = [folder.name for folder in by_folder]
    return {
        folder.name if folder.name and names.count(folder.name) == 1 else str(folder): files
        for folder, files in by_folder.items()
    }


def _recordings_in(folder: Path) -> list[Path]:
    try:
        # ROS 1 bags are listed too: opening one gives an error that tells how to convert it.
        files = sorted(filter(is_recording, folder.iterdir())) or sorted(folder.glob('*.bag'))
    except OSError as error:
        raise ValueError(f'{folder}: cannot be read ({error.strerror})') from None
    if not files:
        raise ValueError(f'{folder}: has no recordings, allowed: {", ".join(ENDINGS)} or bags')
    return files
