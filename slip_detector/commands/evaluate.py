"""Evaluate the chain on recordings: how soon it finds the slips, and what it takes for one.

No ROS here: the chain runs over each recording as the detector node would, from its first row.

``slip_evaluate --json RECORDING...`` prints one object:

``sets``
    By the name of each set, which is a folder: the figures of all its recordings together, see
    :func:`slip_detector.evaluation.replay.figures_of_merit`; what was wrong with them, see
    :func:`slip_detector.evaluation.evaluator.recording_counts`; and under ``recordings``, by the
    name of each file, the same of it alone, with what was ``lost`` of it and its ``slip_events``
    and ``alarm_events``, see :class:`slip_detector.evaluation.events.TrueSlip` and ``Alarm``.
``all``
    The figures and counts over all sets.
``written``
    With ``--plot`` or ``--report``: the files.

``slip_evaluate --protocol paper`` takes no recordings: it simulates the paper's three plates, ten
trials on each, and prints the paper's Table 2 beside ours (``evaluation/protocol.py``).
"""

import argparse
import dataclasses
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from slip_detector.commands.command_line import Parser, run
from slip_detector.commands.recording_options import add_recording_options, with_recording_options
from slip_detector.evaluation.evaluator import EvaluatedRecording, Evaluator, recording_figures
from slip_detector.evaluation.loading import RecordingLoader
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.parameters.recording import RecordingConfig
from slip_detector.parameters.writing import check_writable, writable_folder
from slip_detector.recordings import ENDINGS, is_recording
from slip_detector.report.evaluation_tables import evaluation_tables

NAME = 'slip_evaluate'

#: Options of what to read of a recording.
READING = ('topic', 'field', 'labels', 'resample')


#: More simulated trials than this are taken for a slip of the keys.
MOST_TRIALS = 1000


def recording_sets(arguments: Sequence[str]) -> dict[str, list[Path]]:
    """Sort files and folders into sets of recordings.

    Parameters
    ----------
    arguments
        Paths: a folder that is no bag stands for all recordings in it, those of one folder belong
        together.

    Returns
    -------
    dict
        Name of each set, which is that of its folder (the whole path where two folders have the
        same name), and its files, those of a folder in the order of their names.

    Raises
    ------
    ValueError
        For a folder without recordings or a recording given twice.
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
        files = sorted(filter(is_recording, folder.iterdir()))
    except OSError as error:
        raise ValueError(f'{folder}: cannot be read ({error.strerror})') from None
    if not files:
        raise ValueError(f'{folder}: has no recordings, allowed: {", ".join(ENDINGS)} or bags')
    return files


def evaluate(
    arguments: Sequence[str], evaluator: Evaluator, with_overviews: bool = False
) -> dict[str, dict[str, EvaluatedRecording]]:
    """Evaluate sets of recordings.

    Parameters
    ----------
    arguments
        As :func:`recording_sets` has them.
    evaluator
        Of the chain.
    with_overviews
        Whether what a report shows is gathered.

    Returns
    -------
    dict
        By the name of the set and that of the file.

    Raises
    ------
    ValueError
        When a recording cannot be evaluated; names it.
    """
    sets = recording_sets(arguments)
    watch = None
    if with_overviews:
        from slip_detector.report.evaluation_report import overview_factory

        watch = overview_factory(evaluator.chain_config, sum(map(len, sets.values())))
    return {
        name: {file.name: evaluator.evaluate(file, watch) for file in files}
        for name, files in sets.items()
    }


def as_report(sets: Mapping[str, Mapping[str, EvaluatedRecording]]) -> dict[str, Any]:
    """Return all figures as plain numbers and text, as the module's docstring has them."""
    return {
        'sets': {
            name: {
                **recording_figures(files.values()),
                'recordings': {file: _alone(one) for file, one in files.items()},
            }
            for name, files in sets.items()
        },
        'all': recording_figures([one for files in sets.values() for one in files.values()]),
    }


def _alone(one: EvaluatedRecording) -> dict[str, Any]:
    return {
        **recording_figures([one]),
        'lost': one.counts.lost,
        'slip_events': [dataclasses.asdict(slip) for slip in one.outcome.slips],
        'alarm_events': [dataclasses.asdict(alarm) for alarm in one.outcome.alarms],
    }


def _parser() -> Parser:
    parser = Parser(
        prog=NAME,
        description='Run the slip chain over labelled recordings and print how well it does: '
        'areas under the ROC curve, delays, success rate and false positives as the paper has '
        'them, and slips and alarms matched one to one, with the latency and where its time went. '
        'Or, with --protocol paper, simulate the trials of the paper and print delays, success '
        'rate and false positives beside those that it reports, and for each figure what is '
        'wanted and whether it is met. The exit code is 0 whatever the figures are.',
    )
    parser.add_argument(
        'recordings',
        nargs='*',
        metavar='RECORDING',
        help=f'a recording ({", ".join(ENDINGS)} or the folder of a bag) or a folder of them',
    )
    parser.add_argument(
        '--config',
        metavar='FILE',
        help='a ROS parameter file with the sections slip_detector, slip_driver (names of the '
        f'parts of a recording) and {NAME} (what counts as detected, how to tell motion); else '
        'the defaults',
    )
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    parser.add_argument(
        '--plot',
        nargs='?',
        const=Path('out'),
        type=Path,
        metavar='FOLDER',
        help='write pictures to a folder (default: out): timelines of the recordings, latencies '
        'and ROC curve; with --protocol the counterparts of the figures 2, 4, 5, 6 and 7 of the '
        'paper',
    )
    parser.add_argument(
        '--report',
        type=Path,
        metavar='FILE.html',
        help='write the same as a page to look through, with the timelines to zoom into',
    )
    add_recording_options(parser)
    protocol = parser.add_argument_group('with --protocol')
    protocol.add_argument(
        '--protocol',
        choices=('paper',),
        help='simulate, in place of recordings, the protocol of the paper: the plates of 400, 440 '
        'and 480 um, the same trials through the chain, through others of its windows and bands',
    )
    protocol.add_argument(
        '--trials',
        type=_whole_number(1, MOST_TRIALS),
        metavar='N',
        help='trials on each plate (default: 10)',
    )
    protocol.add_argument(
        '--seed',
        type=_whole_number(0, 2**31 - 1),
        metavar='FIRST',
        help='seed of the first trial, the next have the next (default: 0)',
    )
    return parser


def _whole_number(low: int, high: int) -> Callable[[str], int]:
    """Return what reads an argument that is a whole number."""

    def read(text: str) -> int:
        if not text.isdecimal() or not low <= int(text) <= high:
            raise argparse.ArgumentTypeError(
                f'is {text!r}, allowed: a whole number, {low} to {high}'
            )
        return int(text)

    return read


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read the arguments and see that they go together."""
    parser = _parser()
    options = parser.parse_args(argv)
    of_protocol, of_recordings = ('trials', 'seed'), (*READING, 'report')
    for name in of_recordings if options.protocol else of_protocol:
        if getattr(options, name) is not None:
            what, where = (
                ('recordings', 'without') if options.protocol else ('simulated trials', 'with')
            )
            parser.error(f'--{name} is for {what}, allowed: {where} --protocol')
    if options.protocol and options.recordings:
        parser.error('--protocol simulates its trials, allowed: no RECORDING with it')
    if not options.protocol and not options.recordings:
        parser.error('the following arguments are required: RECORDING (or --protocol)')
    return options


def _of_recordings(options: argparse.Namespace) -> tuple[dict[str, Any], Callable[..., str]]:
    """Return the figures of the recordings, and what lays them out."""
    file = options.config
    config = ChainConfig.from_yaml(file) if file else ChainConfig()
    recording_config = RecordingConfig.from_yaml(file) if file else RecordingConfig()
    evaluation_config = EvaluationConfig.from_yaml(file) if file else EvaluationConfig()
    evaluator = Evaluator(
        RecordingLoader(
            config, with_recording_options(recording_config, options), evaluation_config
        )
    )
    page = options.report
    if page:  # to be said before an hour of recordings is read
        check_writable(page)
    look = page or options.plot
    sets = evaluate(options.recordings, evaluator, bool(look))
    report = as_report(sets)
    if look:
        from slip_detector.report.evaluation_report import write_evaluation_report

        written = write_evaluation_report(sets, config, page, options.plot)
        report['written'] = [str(path) for path in written]
    return report, evaluation_tables


def _of_protocol(options: argparse.Namespace) -> tuple[dict[str, Any], Callable[..., str]]:
    """Return the figures of the paper's protocol, and what lays them out."""
    # Who evaluates recordings need not load the simulation.
    from slip_detector.evaluation import protocol
    from slip_detector.report.protocol_table import protocol_table

    config = ChainConfig.from_yaml(options.config) if options.config else ChainConfig()
    trials = protocol.TRIALS if options.trials is None else options.trials
    draw = None
    if options.plot:
        from slip_detector.report.protocol_pictures import draw_protocol

        folder = writable_folder(options.plot)
        draw = partial(draw_protocol, folder)
    report = protocol.run_protocol(config, trials, options.seed or 0, draw)
    return report, protocol_table


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point of ``slip_evaluate``.

    Parameters
    ----------
    argv
        The arguments; those of the process if not given.

    Returns
    -------
    int
        Exit code, see :func:`slip_detector.commands.command_line.run`.
    """
    options = _arguments(argv)

    def work() -> str:
        report, layout = (_of_protocol if options.protocol else _of_recordings)(options)
        return json.dumps(report, indent=2) if options.json else layout(report)

    return run(NAME, work)


if __name__ == '__main__':
    sys.exit(main())
