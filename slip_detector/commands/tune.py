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

"""The command ``slip_tune``.

Learn from a finger's recordings how to detect its slips: noise and mains from rest, impacts from
taps, contact from a finger that touches nothing; then search for the parameters that detect
labelled slips soonest without false alarms. Of a folder its recordings are read, and those of the
folders in it. Of each kind every third recording, from the second on, is held out; there the
result is never worse than the given parameters. Ctrl-C ends the search with the result so far,
and the same command continues it.

It uses no ROS. :func:`slip_detector.tuning.verdict.tune` does the work.
"""

import argparse
import datetime
import json
import shlex
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from slip_detector.commands import workers
from slip_detector.commands.command_line import (
    Parser,
    interrupts_noted,
    positive_number,
    run,
    whole_number,
)
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import DetectorConfig, parameter_file, write_yaml
from slip_detector.recordings.labels import KINDS
from slip_detector.report.texts import answer, bad_recordings, compared, rounded, text_table
from slip_detector.tuning.learning import learn_from_quiet
from slip_detector.tuning.problem import Candidate, searched_parameters
from slip_detector.tuning.tracks import Track, TrainingFiles
from slip_detector.tuning.verdict import TRIALS, TuningParameters, tune

NAME = 'slip_tune'

#: Options that only a search has.
SEARCH_OPTIONS = ('recordings', 'held_out', 'report', 'storage', 'jobs', 'json', *KINDS)

STOPPING = '\nstopping; results so far are kept (Ctrl-C again: end at once)\n'

#: Number of lines on the progress of a search where no bar can be shown.
LINES = 10


def _arguments(argv: Sequence[str] | None) -> argparse.Namespace:
    """Read and check the arguments; end the process with the exit code 2 where they are wrong."""
    parser = Parser(prog=NAME, description=__doc__.split('\n\n')[1])
    add = parser.add_argument
    add('--out', type=Path, required=True, metavar='FILE', help='the parameter file to write')
    workers.add_options(parser, 'search')
    text = 'trials in all, with earlier runs (default: {} to {}, more where recordings are short)'
    add('--trials', type=whole_number(1), metavar='N', help=text.format(*TRIALS))
    text = 'where trials are kept and shared: a journal (.journal; default: one beside --out), '
    add('--storage', metavar='URL', help=f'{text}sqlite:///FILE, postgresql://...')
    add('--seed', type=whole_number(0), default=0, metavar='N', help='seed (default: %(default)s)')
    several: Any = {'action': 'append', 'default': [], 'metavar': 'RECORDING'}
    text = 'a recording, or a folder of them, to hold out; all others are tuned on; repeatable'
    add('--held-out', **several, help=text)
    text = 'print progress and result as one JSON object a line (docs/tuning.md)'
    add('--json', action='store_true', help=text)
    title = 'kinds of recordings without labels, in which nothing slides'
    add = parser.add_argument_group(title, 'see docs/recordings.md').add_argument
    for kind in KINDS:
        text = f'a recording of the kind {kind}, or a folder of them; repeatable'
        add(f'--{kind}', **several, help=text)
    add = parser.add_argument_group('learn from a recording, without a search').add_argument
    text = 'a recording without slip, from which to learn noise floors and mains for evidence'
    add('--quiet', metavar='RECORDING', help=text)
    text = 'also set the threshold, for at most R false alarms an hour'
    add('--false-alarms-per-hour', type=positive_number, metavar='R', help=text)
    options = parser.parse_args(argv)
    rate, quiet = options.false_alarms_per_hour, options.quiet is not None
    if not quiet and rate is not None:
        parser.error('--false-alarms-per-hour goes with --quiet')
    if not quiet and not options.recordings:
        parser.error('the following arguments are required: RECORDING (or --quiet)')
    for name in SEARCH_OPTIONS:
        if quiet and getattr(options, name):
            word = 'RECORDING' if name == 'recordings' else f'--{name.replace("_", "-")}'
            parser.error(f'--quiet searches nothing, allowed: no {word} with it')
    return options


def _observer(bar: Any, as_json: bool) -> Callable[..., None]:
    """Return a function that shows what a search tells; see :func:`.verdict.tune`."""
    state: dict[str, Any] = {'step': '', 'share': 0.0, 'lines': []}

    def observe(
        step: str = '',
        lines: Sequence[str] = (),
        count: int | None = None,
        trials: int = 1,
        best: Candidate | None = None,
    ) -> None:
        state['lines'] = [*state['lines'], *lines]
        if count is not None:
            step = f'{count} of {trials} trials'
            if best:
                matched, missed = best.figures['matched'], best.figures['missed']
                percent = rounded(best.figures['false_time_percent'])
                step += f', so far finds {matched} of {matched + missed} slips'
                step += f', ON without slip {percent} %'
            bar.total, before, state['share'] = trials, state['share'], count / trials
            bar.update(count - bar.n)
            if bar.disable and int(LINES * state['share']) > int(LINES * before):
                lines = [*lines, step]
        state['step'] = step or state['step']
        if as_json:
            print(json.dumps(state), flush=True)
        elif lines:
            bar.write('\n'.join(lines), file=sys.stderr)
        bar.set_description_str(state['step'])

    observe('reading the recordings')
    return observe


def _describe(tracks: Sequence[Track]) -> str:
    """Return the names of tracks, with the number of all slips and the length of all."""
    n = sum(len(track.slips) for track in tracks)
    minutes = sum(track.duration_s for track in tracks) / 60.0
    names = ', '.join(track.name for track in tracks)
    return f'{names} ({n} slip{"" if n == 1 else "s"} in {minutes:.3g} min)'


def _search(
    options: argparse.Namespace, parameters: TuningParameters, where: str, stop: Callable[[], bool]
) -> tuple[dict[str, Any], list[str], Callable[[Path], None]]:
    """Search; return the result, lines about it, and a function that writes the report."""
    of_kinds = [(kind, path) for kind in KINDS for path in getattr(options, kind)]
    files = TrainingFiles(options.recordings, parameters.loader, options.held_out, of_kinds)
    with (
        workers.processes(options.jobs) as calls,
        workers.progress_bar(options.trials, 'trial') as bar,
    ):
        study: Any = {'trials': options.trials, 'seed': options.seed, 'storage': where}
        observe = _observer(bar, options.json)
        result = tune(files, parameters, **study, observe=observe, stop=stop, calls=calls)
    # It takes a while to load.
    from slip_detector.report.page import replay_variant, write_page

    problem, held, study, verdict, notes = result
    given_chain, tried_chain = parameters.chain, verdict.tried or verdict.chain
    chains = {'given': given_chain, 'not taken' if verdict.kept else 'tuned': tried_chain}
    parts = {'held out': held, 'tuned on': problem.tracks}
    variants = [
        replay_variant(name, Replay(chain, problem.evaluation), parts)
        for name, chain in chains.items()
    ]
    before, after = (variant.figures['all held out'] for variant in variants)
    answers = answer(after, before)
    if verdict.kept:
        tried = [f'What was tried: {" ".join(answers)}'] if verdict.tried else []
        kept = f'Nothing better was found: {verdict.kept}.'
        answers = [kept, f'The given parameters stay. {answer(before)[0]}', *tried]
    lines = [
        f'{study.follow()} trials, {len(study.trials)} of them usable, seed {options.seed}',
        f'Tuned on: {_describe(problem.tracks)}',
        f'Held out, and not tuned on: {_describe(held)}',
        *notes,
    ]
    rows, values = compared(before, after), given_chain.to_parameters().items()
    changes = dict(pair for pair in tried_chain.to_parameters().items() if pair not in values)
    summary = {
        'step': '', 'share': 1.0, 'lines': notes, 'answer': answers, 'kept': verdict.kept,
        'changes': {**searched_parameters(tried_chain), **changes}, 'table': rows,
    }  # fmt: skip
    other, taken = variants[::-1] if verdict.kept else variants
    # The figures of each recording are after those of each part.
    sentences = answers + bad_recordings(dict([*taken.figures.items()][len(parts) :]))
    page = 'Tuning of the slip detector', [other, taken], sentences, lines, options.out
    table = text_table([['', *chains], *rows], '<>><').splitlines()
    return summary, [*lines, 'On what was held out:', *table], lambda path: write_page(path, *page)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments, or those of the process; return the exit code."""
    options = _arguments(argv)

    def work() -> str:
        parameters = workers.apply_options(options, TuningParameters())
        outputs = {'--out': options.out, '--report': options.report}
        where = options.storage or f'{options.out}.study.journal'
        workers.check_apart(outputs, options.config, options.labels, where)
        paths = [str(path) for path in outputs.values() if path is not None]
        with interrupts_noted(STOPPING) as stop:
            if options.quiet is not None:
                quiet = parameters.chain, parameters.loader, options.false_alarms_per_hour
                changes, answers = learn_from_quiet(options.quiet, *quiet)
                lines = list[str]()
            else:
                result, lines, write_report = _search(options, parameters, where, stop)
                answers, changes = result['answer'], {} if result['kept'] else result['changes']
            file = options.config
            config = DetectorConfig.from_yaml(file) if file else DetectorConfig()
            document = parameter_file({'/slip_detector': config.with_values(changes)}, file)
            now = datetime.datetime.now(datetime.timezone.utc)
            command = shlex.join([NAME, *(sys.argv[1:] if argv is None else argv)])
            title = f'Written by {NAME} on {now:%Y-%m-%d %H:%M} UTC:'
            comments = [title, f'  {command}', *answers, *lines]
            write_yaml(options.out, document, comments)
            if options.report is not None:
                try:
                    write_report(options.report)
                except ValueError as error:
                    raise ValueError(f'{error}; {options.out} is written') from None
        if options.json:
            return json.dumps({**result, 'written': paths})
        said = [*(lines if options.verbose else ()), *answers, f'Written: {", ".join(paths)}']
        return '\n'.join(said)

    return run(NAME, work)
