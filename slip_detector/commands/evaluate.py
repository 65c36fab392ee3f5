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

"""The command ``slip_evaluate``.

Run the slip chain over recordings and print what it decides and, where slips are labelled, how
well it does: areas under the ROC curve; slips and alarms matched one to one, with the latencies
and their parts by stage. The exit code is 0 whatever the figures are.

The command uses no ROS: the chain runs over each recording from the first row, as in the detector
node. A recording that cannot be read or does not suit the chain is left out, and named.

``slip_evaluate --json RECORDING...`` prints one object:

``sets``
    For each set of recordings, by the name of its folder: the figures of all its recordings
    together, see :func:`slip_detector.evaluation.figures.figures_of_merit`, and counts of their
    faults, see :func:`slip_detector.evaluation.evaluator.recording_figures`. Under
    ``recordings``, by the name of the file, the same for each recording, with ``lost`` (which
    part of a damaged file could not be read), ``warnings`` (why decisions may mean nothing),
    ``on_intervals_s`` (start and end of each time ON), ``invalid_percent`` (of the channels that
    are not always valid), ``labelled``, ``mistaken`` (whether the labels are marked as a mistake),
    and ``slip_events`` and ``alarm_events``, see
    :class:`slip_detector.evaluation.figures.TrueSlip` and ``Alarm``; None without labels.
``all``
    The figures and counts over all sets.
``answer``
    Sentences on what holds, and what is wrong with recordings.
``note``
    Where recordings have no labels: how to label them.
``left_out``
    By the reason, the recordings that cannot be read or do not suit the chain.
``not_evaluated``
    After Ctrl-C: the recordings that were not evaluated.
``written``
    With ``--report``: the file.
"""

import dataclasses
import itertools
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from slip_detector.commands import workers
from slip_detector.commands.command_line import INTERRUPTED, Parser, run
from slip_detector.evaluation import evaluator
from slip_detector.evaluation.evaluator import EvaluatedRecording, RecordingLoader
from slip_detector.parameters import name_list
from slip_detector.recordings import group_recordings
from slip_detector.recordings.labels import ENDING, KEY
from slip_detector.report.overview import overview_of
from slip_detector.report.page import write_evaluation_report
from slip_detector.report.texts import answer, bad_recordings, by_name, evaluation_tables

NAME = 'slip_evaluate'


def evaluate(
    files: Sequence[Path],
    loader: RecordingLoader,
    calls: workers.Calls | None = None,
    for_report: bool = False,
) -> dict[Path, EvaluatedRecording | ValueError]:
    """Evaluate recordings, in parallel where there are several workers.

    Parameters
    ----------
    files
        The recordings.
    loader
        Opens them; it has the parameters of the chain and of the evaluation.
    calls
        Evaluates in other processes, see :func:`.workers.processes`; None: in this one.
    for_report
        Whether overviews for a report are gathered.

    Returns
    -------
    dict
        What came of each recording; the error where it cannot be read or does not suit the chain.
        After Ctrl-C some are missing.
    """
    observe = partial(overview_of, loader.chain_config, 1 / len(files)) if for_report else None
    function = partial(_evaluate_one, loader, observe)
    results: dict[Path, EvaluatedRecording | ValueError] = {}
    with workers.progress_bar(len(files), 'recording') as bar, suppress(KeyboardInterrupt):
        for place, result in calls(function, files) if calls else enumerate(map(function, files)):
            results[files[place]] = result
            bar.update()
    return results


def _evaluate_one(
    loader: RecordingLoader, observe: Any, path: Path
) -> EvaluatedRecording | ValueError:
    try:
        return evaluator.evaluate_recording(loader, path, observe=observe)
    except ValueError as error:
        return error


def as_report(sets: Mapping[str, Mapping[str, EvaluatedRecording]]) -> dict[str, Any]:
    """Return ``sets``, ``all``, ``answer`` and ``note`` for JSON; see the module's docstring."""
    every = [recording for files in sets.values() for recording in files.values()]
    report: dict[str, Any] = {
        'sets': {
            name: {
                **evaluator.recording_figures(files.values()),
                'recordings': {file: _collect_figures(files[file]) for file in files},
            }
            for name, files in sets.items()
        },
        'all': evaluator.recording_figures(every),
    }
    named = by_name(report['sets'])
    report['answer'] = [*answer(report['all']), *bad_recordings(named)]
    bare = [name for name, of in named.items() if not (of['labelled'] or of['mistaken'])]
    if unlabelled := name_list(bare):
        how = f'{KEY}: [[start, end]] in seconds in a file NAME{ENDING} beside the recording'
        note = f'no labels; scores need {how}, by hand or by slip_view --bag'
        report['note'] = f'{unlabelled}: {note}'
    return report


def _collect_figures(recording: EvaluatedRecording) -> dict[str, Any]:
    """Return the figures and events of one recording."""
    outcome, counts = recording.outcome, recording.counts
    figures = {
        **evaluator.recording_figures([recording]),
        'labelled': recording.labelled,
        'mistaken': recording.mistaken,
        'lost': counts.damage,
        'warnings': recording.warnings,
        'on_intervals_s': outcome.on_s,
        'invalid_percent': recording.invalid_percent,
        'slip_events': [dataclasses.asdict(slip) for slip in outcome.slips],
        'alarm_events': [dataclasses.asdict(alarm) for alarm in outcome.alarms],
    }
    without = {'slip_events': None, 'alarm_events': None}
    return figures if recording.labelled else figures | without


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code: that of :func:`.run`, or 130 after Ctrl-C."""
    parser = Parser(prog=NAME, description=__doc__.split('\n\n')[1])
    parser.add_argument('--json', action='store_true', help='print one JSON object')
    workers.add_options(parser, 'evaluate recordings in parallel', recordings='+')
    options = parser.parse_args(argv)
    page, left = options.report, list[str]()

    def work() -> str:
        loader = workers.apply_options(options, RecordingLoader())
        # Errors are reported before an hour of recordings is read.
        workers.check_apart({'--report': page}, options.config, options.labels)
        sets = group_recordings(options.recordings)
        files = [*itertools.chain(*sets.values())]
        with workers.processes(options.jobs) as calls:
            results = evaluate(files, loader, calls, page is not None)
        left[:] = [str(file) for file in files if file not in results]
        evaluated: dict[str, dict[str, EvaluatedRecording]] = {}
        left_out = dict[str, list[str]]()
        for name, file in [(name, file) for name, of in sets.items() for file in of]:
            if isinstance(result := results.get(file), EvaluatedRecording):
                evaluated.setdefault(name, {})[file.name] = result
            elif result:
                left_out.setdefault(str(result).removeprefix(f'{file}: '), []).append(str(file))
        if not evaluated:
            first = results.get(files[0])
            raise first if isinstance(first, ValueError) else KeyboardInterrupt
        report = as_report(evaluated) | {'left_out': left_out}
        report['answer'] += [
            f'Left out: {name_list(of, 3)}: {why}' for why, of in left_out.items()
        ]
        if left:
            report['not_evaluated'] = left
        if page:
            write_evaluation_report(page, evaluated, report, options.config)
            report['written'] = [str(page)]
        text = evaluation_tables(report, options.verbose)
        return json.dumps(report, indent=2) if options.json else text

    return run(NAME, work) or (INTERRUPTED if left else 0)
