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

"""Recordings: rows of volts with their stamps and labels, in bags, npz and csv files."""

import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from slip_detector.parameters import RecordingConfig, check_plain, rates_differ, refuse
from slip_detector.recordings.array_recordings import CsvRecording, NpzRecording
from slip_detector.recordings.bag_recording import BagRecording
from slip_detector.recordings.bag_storage import BAG_ENDINGS, METADATA
from slip_detector.recordings.labels import find_labels, read_labels
from slip_detector.recordings.recording import Recording, RecordingCounts, name_errors
from slip_detector.recordings.writing import write_recording

__all__ = [
    'ENDINGS',
    'Recording',
    'RecordingCounts',
    'by_number',
    'group_recordings',
    'is_recording',
    'open_recording',
    'rates_differ',
    'write_recording',
]

_CLASSES: dict[str, Any] = {'.npz': NpzRecording, '.csv': CsvRecording}
_CLASSES |= dict.fromkeys(BAG_ENDINGS, BagRecording)

ENDINGS = tuple(_CLASSES)


def is_recording(path: 'str | Path') -> bool:
    """Return whether a path is a recording: a file with a known ending, or the folder of a bag.

    Examples
    --------
    >>> from slip_detector.recordings import is_recording
    >>> is_recording('trial.mcap'), is_recording('trial.labels.yaml')
    (True, False)
    """
    path = Path(path)
    if not path.is_dir():
        return path.suffix in ENDINGS
    # Where there is no metadata, the recorder was killed.
    first = (path / f'{path.name}_0{ending}' for ending in BAG_ENDINGS)
    return any(map(Path.is_file, (path / METADATA, *first)))


def open_recording(path: 'str | Path', config: 'RecordingConfig | None' = None) -> Recording:
    """Open a recording to read it in pieces.

    An npz file has the rows under ``recording_volts_key``, the rate under ``recording_rate_key``
    and perhaps the labels under ``recording_truth_key``. A csv file has a header of names, a
    column ``time_s``, perhaps a column of labels, and a column for each channel. A bag (a rosbag2
    folder, one of its .mcap or .db3 files, or a .bag of ROS 1) has a topic ``recording_topic``
    with the rows in the field ``recording_field``.

    Parameters
    ----------
    path
        The file or the folder of a bag.
    config
        Where in the recording the samples and labels are; None: the defaults.

    Raises
    ------
    ValueError
        When the file is missing or broken or lacks a part; names the file and the part.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from slip_detector.recordings import open_recording
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / 'trial.npz'
    ...     np.savez(path, volts=np.full((100, 2), 4.3), sample_rate_hz=100.0)
    ...     recording = open_recording(path)
    ...     n = sum(len(piece.volts) for piece in recording.pieces())
    >>> recording.sample_rate_hz, n
    (100.0, 100)
    """
    path, config = Path(path), config or RecordingConfig()
    labels_file = find_labels(config.recording_labels, path)
    labels = None if labels_file is None else read_labels(labels_file)
    with name_errors(path):
        path.stat()
        check_plain(path)
        if path.suffix not in _CLASSES and not path.is_dir():
            allowed = f'{", ".join(ENDINGS)} or the folder of a bag'
            refuse(f'is {path.suffix or "without ending"}', allowed)
        recording: Recording = _CLASSES.get(path.suffix, BagRecording)(path, config, labels)
        return recording


def by_number(name: str | Path) -> tuple[str, str]:
    """Return the key by which names are sorted: numbers in them count by their value.

    Examples
    --------
    >>> sorted(['slip_10', 'slip_9', 'rest'], key=by_number)
    ['rest', 'slip_9', 'slip_10']
    """
    return re.sub('[0-9]+', lambda number: number[0].zfill(20), str(name)), str(name)


def group_recordings(arguments: Sequence[str]) -> dict[str, list[Path]]:
    """Sort files and folders into sets of recordings.

    Parameters
    ----------
    arguments
        Paths of recordings, and of folders of recordings: of a folder its recordings are meant,
        and those of the folders in it. The recordings in one folder are a set.

    Returns
    -------
    dict
        The files of each set by its name: the name of the folder, or its path if two folders have
        the same name. They are sorted by name, with numbers in it by their value. A file that is
        given twice is there once.

    Raises
    ------
    ValueError
        For a path that does not exist, or a folder without recordings; names it.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for path in (Path(folder) / 'slips' / '1.npz', Path(folder) / 'rest.npz'):
    ...         path.parent.mkdir(exist_ok=True)
    ...         path.touch()
    ...     sets = group_recordings([folder])
    >>> [[file.name for file in files] for files in sets.values()]
    [['rest.npz'], ['1.npz']]
    """
    by_folder: dict[Path, dict[str, Path]] = {}
    for argument in map(Path, arguments):
        with name_errors(argument):
            argument.stat()
            files = _recordings_of(argument)
            if not files:
                raise ValueError(
                    f'has no recordings, allowed: {", ".join(ENDINGS)} or folders of bags'
                )
        for file in files:
            by_folder.setdefault(file.parent.resolve(), {})[file.name] = file
    names = [folder.name for folder in by_folder]
    sets = dict[str, list[Path]]()
    for folder, named in by_folder.items():
        is_unique = folder.name and names.count(folder.name) == 1
        sets[folder.name if is_unique else str(folder)] = sorted(named.values(), key=by_number)
    return sets


def _recordings_of(path: Path) -> list[Path]:
    """Return a recording, or those in a folder and in the folders in it."""
    if is_recording(path) or not path.is_dir():
        return [path]
    inside = sorted(path.iterdir(), key=by_number)
    folders = [folder for folder in inside if folder.is_dir() and not is_recording(folder)]
    others = (folder.iterdir() for folder in folders)
    return [*filter(is_recording, itertools.chain(inside, *others))]
