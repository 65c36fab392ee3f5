"""The options of the commands that can work on many things side by side."""

import argparse
import dataclasses
import os
from collections.abc import Sequence

from slip_detector.commands.command_line import whole_number
from slip_detector.commands.workers import Workers
from slip_detector.parameters.recording import RecordingConfig


def add_worker_options(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the options that say how many work, and where.

    Parameters
    ----------
    parser
        Of the command.
    what
        What the processes do.
    """
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        '--jobs', type=whole_number(1), metavar='N', help=f'processes that {what} (default: 1)'
    )
    where.add_argument(
        '--cluster', metavar='ADDRESS',
        help=f'scheduler of a Dask cluster whose workers {what}, as tcp://HOST:8786; they must '
        'see the recordings under the same paths',
    )  # fmt: skip


def workers_of(options: argparse.Namespace) -> Workers:
    """Return the workers that the options of :func:`add_worker_options` ask for."""
    return Workers(options.jobs or 1, options.cluster)


def paths_for_workers(options: argparse.Namespace, paths: Sequence[str]) -> list[str]:
    """Return paths as the workers are to be given them: a cluster's stand in other folders."""
    return [os.path.abspath(path) for path in paths] if options.cluster else list(paths)


def config_for_workers(options: argparse.Namespace, config: RecordingConfig) -> RecordingConfig:
    """Return what describes a recording with its paths as :func:`paths_for_workers` has them."""
    labels = config.recording_labels
    if not labels:
        return config
    return dataclasses.replace(config, recording_labels=paths_for_workers(options, [labels])[0])
