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

"""The options of the commands that read recordings: where in them the rows and labels are."""

import argparse
import dataclasses
from itertools import chain
from pathlib import Path

from slip_detector.parameters.recording import RecordingConfig
from slip_detector.recordings import recording_sets


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """Add the options that say where in a recording the rows and labels are.

    Examples
    --------
    >>> parser = argparse.ArgumentParser()
    >>> add_recording_options(parser)
    >>> parser.parse_args(['--topic', '/left/voltages']).topic
    '/left/voltages'
    """
    group = parser.add_argument_group('what to read of a recording')
    group.add_argument(
        '--topic', metavar='NAME', help='topic of a bag that has the rows (default: voltages)'
    )
    group.add_argument(
        '--field',
        metavar='PATH',
        help='field of its messages with the channels, such as position, pac or pillars[].fz '
        '(default: position of a JointState, data of a MultiArray)',
    )
    group.add_argument(
        '--labels',
        metavar='FILE',
        help='YAML file of the intervals with slip, or a folder of such files (default: '
        'NAME.labels.yaml beside the recording, else the labels in the recording)',
    )
    group.add_argument(
        '--resample',
        action='store_true',
        default=None,
        help='resample a recording whose rate is not that of the chain',
    )


def with_recording_options(
    config: RecordingConfig, options: argparse.Namespace
) -> RecordingConfig:
    """Return the configuration with the values of the options of :func:`add_recording_options`.

    Raises
    ------
    ValueError
        When a value is not allowed.

    Examples
    --------
    >>> options = argparse.Namespace(topic='/taxels', field=None, labels=None, resample=None)
    >>> with_recording_options(RecordingConfig(), options).recording_topic
    '/taxels'
    """
    given = {
        f'recording_{name}': getattr(options, name)
        for name in ('topic', 'field', 'labels', 'resample')
    }
    changes = {name: value for name, value in given.items() if value is not None}
    return dataclasses.replace(config, **changes)


def paths_read(options: argparse.Namespace) -> list[Path]:
    """Return the recordings, and the file of labels, that a command reads.

    Raises
    ------
    ValueError
        For a folder without recordings.

    Examples
    --------
    >>> options = argparse.Namespace(recordings=['a.npz'], quiet='rest.npz', labels=None)
    >>> [path.name for path in paths_read(options)]
    ['a.npz', 'rest.npz']
    """
    lists = [getattr(options, name, None) or [] for name in ('recordings', 'held_out')]
    single = [getattr(options, name, None) for name in ('quiet', 'taps')]
    folders = [*lists, *([one] for one in single if one is not None)]
    found = chain.from_iterable(
        several for part in folders for several in recording_sets(part).values()
    )
    return [*found, *([Path(options.labels)] if options.labels else [])]
