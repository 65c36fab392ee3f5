"""Recordings: rows of volts with their stamps and labels, from bags, npz and csv files."""

import argparse
import dataclasses
from pathlib import Path

from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings.csv_files import CsvRecording
from slip_detector.recordings.labels import find_labels, read_labels
from slip_detector.recordings.npz import NpzRecording
from slip_detector.recordings.recording import PIECE_ROWS, RATE_TOLERANCE, Counts, Recording
from slip_detector.recordings.rows import Piece, Rows

__all__ = [
    'BAG_ENDINGS',
    'ENDINGS',
    'PIECE_ROWS',
    'RATE_TOLERANCE',
    'Counts',
    'Piece',
    'Recording',
    'Rows',
    'add_options',
    'is_recording',
    'open_recording',
    'with_options',
]

BAG_ENDINGS = ('.mcap', '.db3')

ENDINGS = ('.npz', '.csv', *BAG_ENDINGS)

#: What makes a folder a bag.
METADATA = 'metadata.yaml'


def is_recording(path: 'str | Path') -> bool:
    """Return whether a path is one recording, by its ending or as a folder that is a bag."""
    path = Path(path)
    if path.is_dir():
        return (path / METADATA).is_file()
    return path.suffix in ENDINGS


def open_recording(path: 'str | Path', config: 'RecordingConfig | None' = None) -> Recording:
    """Open a recording to read it in pieces.

    An npz file holds the rows under ``recording_volts_key``, the rate under
    ``recording_rate_key`` and perhaps the label under ``recording_truth_key``. A csv file has a
    line of names, a column ``time_s``, perhaps a column of the label, and a column for each
    channel. A bag (a rosbag2 folder, or one of its .mcap or .db3 files) has a topic
    ``recording_topic`` with the rows in the field ``recording_field``.

    Parameters
    ----------
    path
        The file or the folder of a bag.
    config
        Names of the parts of the recording; the defaults if not given.

    Raises
    ------
    ValueError
        When it is missing, broken or lacks a part; names the file and the part.
    """
    path, config = Path(path), config or RecordingConfig()
    try:
        labels_file = find_labels(config.recording_labels, path)
        labels = None if labels_file is None else read_labels(labels_file)
        if path.suffix == '.npz':
            return NpzRecording(path, config, labels)
        if path.suffix == '.csv':
            return CsvRecording(path, config, labels)
        if path.suffix in BAG_ENDINGS or path.is_dir():
            # Who reads no bags need not have what reads them.
            from slip_detector.recordings.bags import BagRecording

            return BagRecording(path, config, labels)
        raise ValueError(
            f'{path}: is {path.suffix or "without ending"}, allowed: {", ".join(ENDINGS)} or the '
            'folder of a bag'
        )
    except OSError as error:
        raise ValueError(f'{path}: cannot be read ({error.strerror or error})') from None


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where in a recording the rows and labels are."""
    group = parser.add_argument_group('what to read of a recording')
    group.add_argument(
        '--topic', metavar='NAME', help='topic of a bag that has the rows (default: voltages)'
    )
    group.add_argument(
        '--field',
        metavar='PATH',
        help='field of its messages with the channels, as position, pac or pillars[].fz '
        '(default: position of a JointState, data of a MultiArray)',
    )
    group.add_argument(
        '--labels',
        metavar='FILE',
        help='YAML file of the intervals with slip, or a folder of such files (default: '
        'NAME.labels.yaml beside the recording, else what the recording itself says)',
    )
    group.add_argument(
        '--resample',
        action='store_true',
        default=None,
        help='bring a recording of another rate to that of the chain',
    )


def with_options(config: RecordingConfig, options: argparse.Namespace) -> RecordingConfig:
    """Return the configuration with what the options of :func:`add_options` say.

    Raises
    ------
    ValueError
        When a value is not allowed.
    """
    given = {
        f'recording_{name}': getattr(options, name)
        for name in ('topic', 'field', 'labels', 'resample')
    }
    changes = {name: value for name, value in given.items() if value is not None}
    return dataclasses.replace(config, **changes)
