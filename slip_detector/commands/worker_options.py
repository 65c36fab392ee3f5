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

"""The options of the commands that can use several processes or a cluster."""

import argparse
import dataclasses
import os
from collections.abc import Sequence

from slip_detector.commands.command_line import whole_number
from slip_detector.commands.workers import Workers
from slip_detector.parameters.recording import RecordingConfig


def add_worker_options(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the options for the number of processes, or for a cluster.

    Parameters
    ----------
    parser
        The parser of the command.
    what
        What the processes do, for the help.

    Examples
    --------
    >>> parser = argparse.ArgumentParser()
    >>> add_worker_options(parser, 'search')
    >>> parser.parse_args(['--jobs', '4']).jobs
    4
    """
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        '--jobs', type=whole_number(1), metavar='N', help=f'processes that {what} (default: 1)'
    )
    where.add_argument(
        '--cluster', metavar='ADDRESS',
        help=f'scheduler of a Dask cluster whose workers {what}, such as tcp://HOST:8786; they '
        'must see the recordings under the same paths',
    )  # fmt: skip


def workers_of(options: argparse.Namespace) -> Workers:
    """Return the workers that the options of :func:`add_worker_options` ask for.

    Examples
    --------
    >>> with workers_of(argparse.Namespace(jobs=None, cluster=None)) as workers:
    ...     workers.here
    True
    """
    return Workers(options.jobs or 1, options.cluster)


def paths_for_workers(options: argparse.Namespace, paths: Sequence[str]) -> list[str]:
    """Return paths for the workers: absolute for a cluster, whose workers run in other folders.

    Examples
    --------
    >>> paths_for_workers(argparse.Namespace(cluster=None), ['trial.npz'])
    ['trial.npz']
    >>> on_cluster = argparse.Namespace(cluster='tcp://arm:8786')
    >>> paths_for_workers(on_cluster, ['trial.npz']) == [os.path.abspath('trial.npz')]
    True
    """
    return [os.path.abspath(path) for path in paths] if options.cluster else list(paths)


def config_for_workers(options: argparse.Namespace, config: RecordingConfig) -> RecordingConfig:
    """Return the configuration with a path of the labels that the workers can open.

    Examples
    --------
    >>> config = RecordingConfig(recording_labels='labels')
    >>> config_for_workers(argparse.Namespace(cluster=None), config).recording_labels
    'labels'
    """
    labels = config.recording_labels
    if not labels:
        return config
    return dataclasses.replace(config, recording_labels=paths_for_workers(options, [labels])[0])
