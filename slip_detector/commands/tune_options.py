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

"""The options of ``slip_tune``."""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from slip_detector.commands.command_line import Parser, whole_number
from slip_detector.commands.recording_options import add_recording_options
from slip_detector.commands.worker_options import add_worker_options

NAME = 'slip_tune'

TRIALS = 200

#: Options that only a search has.
OF_SEARCH = ('held_out', 'report', 'plot', 'storage', 'jobs', 'cluster')


def _parser() -> argparse.ArgumentParser:
    parser = Parser(
        prog=NAME,
        description='Search the bands, stop-bands, exponent, windows, decision, threshold, votes '
        'and common mode that catch slips of labelled recordings soonest without false alarms. '
        'Some recordings are held out: on these the result is never worse than the given '
        'parameters. Ctrl-C ends the search with the result so far, and the same command '
        'continues it.',
    )
    parser.add_argument(
        'recordings', nargs='*', metavar='RECORDING', help='a recording or a folder of them'
    )
    parser.add_argument(
        '--out', type=Path, required=True, metavar='FILE', help='the parameter file to write'
    )
    parser.add_argument('--report', type=Path, metavar='FILE', help='an HTML report to write')
    parser.add_argument(
        '--plot', nargs='?', const=Path('out'), type=Path, metavar='FOLDER',
        help='write its figures as pictures to a folder (default: out)',
    )  # fmt: skip
    parser.add_argument(
        '--config', metavar='FILE',
        help='a ROS parameter file to start from: what is not searched keeps its value there; the '
        f'section {NAME} has the weights (default: the default parameters)',
    )  # fmt: skip
    parser.add_argument(
        '--trials', type=whole_number(1), default=TRIALS, metavar='N',
        help='number of trials of the study, including earlier runs (default: %(default)s)',
    )  # fmt: skip
    add_worker_options(parser, 'search')
    parser.add_argument(
        '--storage', metavar='URL',
        help='where the study is kept and shared: the path of a journal (.journal), '
        'sqlite:///FILE, postgresql://USER@HOST/NAME (default: a journal beside --out)',
    )  # fmt: skip
    parser.add_argument(
        '--seed',
        type=int,
        default=0,
        metavar='N',
        help='seed of the search (default: %(default)s)',
    )
    held = parser.add_mutually_exclusive_group()
    held.add_argument(
        '--hold-out', type=_share, default=1 / 3, metavar='SHARE',
        help='share of the recordings, or of the time of a single one, to hold out (default: 1/3)',
    )  # fmt: skip
    held.add_argument(
        '--held-out', action='append', default=[], metavar='RECORDING',
        help='hold out these recordings, or folders of them, and tune on all other RECORDINGs; '
        'repeatable',
    )  # fmt: skip
    add_recording_options(parser)
    quiet = parser.add_argument_group('learn from a recording, without a search')
    quiet.add_argument(
        '--quiet', metavar='RECORDING',
        help='a recording without slip, in which mains hum is sought and, where evidence decides, '
        'the noise floors are learnt',
    )  # fmt: skip
    quiet.add_argument(
        '--false-alarms-per-hour', type=_rate, metavar='R',
        help='set the threshold too: the allowed rate, above 0',
    )  # fmt: skip
    quiet.add_argument(
        '--taps', metavar='RECORDING',
        help='a recording of knocks: impact_v is set between its steps and those of the slips of '
        'the RECORDINGs',
    )  # fmt: skip
    return parser


def _refuse(
    parser: argparse.ArgumentParser,
    options: argparse.Namespace,
    what: str,
    names: Sequence[str],
) -> None:
    """End the process where an option of the search is given with one that searches nothing."""
    for name in names:
        if getattr(options, name):
            word = 'RECORDING' if name == 'recordings' else f'--{name.replace("_", "-")}'
            parser.error(f'{what} searches nothing, allowed: no {word} with it')


def _share(text: str) -> float:
    try:
        share = float(text)
    except ValueError:
        share = 0.0
    if not 0.0 < share < 1.0:
        raise argparse.ArgumentTypeError(f'is {text!r}, allowed: a number between 0 and 1')
    return share


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = 0.0
    if not 0.0 < rate < math.inf:
        raise argparse.ArgumentTypeError(f'is {text!r}, allowed: a number above 0')
    return rate


def arguments_of(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read and check the arguments; end the process with the exit code 2 where they are wrong.

    Examples
    --------
    >>> options = arguments_of(['--out', 'tuned.yaml', 'recordings'])
    >>> options.recordings, options.trials, options.seed
    (['recordings'], 200, 0)
    """
    parser = _parser()
    options = parser.parse_args(argv)
    if options.quiet is None and options.false_alarms_per_hour is not None:
        parser.error('--false-alarms-per-hour goes with --quiet')
    if options.quiet is not None:
        _refuse(parser, options, '--quiet', ('recordings', 'taps', *OF_SEARCH))
    elif not options.recordings:
        parser.error('the following arguments are required: RECORDING (or --quiet)')
    elif options.taps is not None:
        _refuse(parser, options, '--taps', OF_SEARCH)
    return options
