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

"""``python -m benchmarks fingers``: detectors taught on real fingers, judged on other recordings.

Each folder in that of ``--data`` is a finger, with labelled recordings in it and in folders of it.
They are divided (:mod:`benchmarks.fingers.parts`), and each part is judged by a chain that was
taught on the others, as ``slip_tune`` teaches. A finger without slips, and with ``--judge`` each,
is judged with the parameters that it is given. For each finger ``--json`` prints:

``parts``
    For each part ``judged_on``, its recordings; ``kept``: why the search kept what it began with,
    if so; ``notes``; the ``parameters`` that were found; and the ``figures`` of what was taught.
``chains``
    The figures on all parts together: of the chains that were ``taught``; of the ``paper``'s rule
    with as much of its bands as the rate allows, ON for 1.01 % of the rest that was taught on; and
    of the ``beginning`` of a search, with noise floors and mains as they were learnt. Or of the
    parameters that were ``given``.

The figures of a chain, of rows in which it has settled and the label is certain:

``slips``, ``recall``, ``recall_by_chance``, ``coverage``, ``false_alarms_per_minute``
    As ``slip_evaluate`` has them.
``on_percent``
    The share that is ON: of rows that ``slide``; of those of each kind in which nothing slides;
    ``between`` slips, or of recordings without a kind; of the robot's ``motion`` in these; and of
    ``all``. A guess that is as often ON is ON for this share of each, and its areas are 0.5.
``auc``
    The area under the ROC curve of slides against the rows of each kind.
``auc_of_rest``
    That of rest, between slips and of this kind, against them: above 0.5 where the chain
    recognises not what happens but the recording.
``joints``, ``joints_detected_percent``, ``joints_ms``
    Joints (:mod:`benchmarks.fingers.joints`) of a rest with a ``slide``, and with another
    ``rest``, before which it is OFF; how many of them turn it ON within 0.3 s; and the median of
    the times from the middle of a joint, of all of them, where that is defined.
``recordings_on_percent``
    The share of the rest of each recording that is ON.
"""

import argparse
import dataclasses
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fingers.judging import Judged, figures, judge, pooled
from benchmarks.fingers.parts import Tracks, divide, longest, recordings_in
from benchmarks.measurement import shared_options
from benchmarks.paper.protocol import PAPER_FALSE_POSITIVE_PERCENT
from slip_detector.evaluation.figures import Bound
from slip_detector.parameters import ChainConfig, DetectorConfig
from slip_detector.parameters.fields import refuse
from slip_detector.parameters.files import find_parameter_file
from slip_detector.recordings import open_recording
from slip_detector.report.tables import number_text, text_table
from slip_detector.tuning.learning import learn_from_quiet, learn_from_taps
from slip_detector.tuning.problem import searched
from slip_detector.tuning.tracks import TrainingFiles, load_tracks
from slip_detector.tuning.verdict import TuningParameters, tune
from slip_detector.view.tuning import beginning

#: Nothing is wanted of every finger.
WANTED: dict[str, Bound] = {}

TRIALS, QUICK_TRIALS = 200, 8

#: The highest frequency of a band, as a share of the rate.
TOP_SHARE = 0.45


def options() -> argparse.ArgumentParser:
    """Return the parser of the subcommand."""
    parser = shared_options(
        'fingers',
        'Teach detectors on a part of the recordings of real fingers, and judge them on the rest, '
        "beside the paper's rule. A finger takes some minutes.",
    )
    add = parser.add_argument
    add('--data', type=Path, required=True, metavar='FOLDER', help='has a folder for each finger')
    add('--finger', action='append', default=[], metavar='NAME', help='only this; repeatable')
    add(
        '--config', action='append', default=[], metavar='NAME=FILE', help='with which parameters '
        'a finger begins; repeatable (default: NAME.yaml in FOLDER, or what a new sensor has)',
    )  # fmt: skip
    add('--judge', action='store_true', help='judge these parameters, teach nothing')
    add('--trials', type=int, default=TRIALS, help='of each search (default: %(default)s)')
    add('--seed', type=int, default=0, help='of the searches (default: %(default)s)')
    return parser


def measure(words: argparse.Namespace) -> dict[str, Any]:
    """Measure each finger."""
    if not words.data.is_dir():
        refuse(f'--data is {words.data}', 'a folder with a folder for each finger')
    folders = (one for one in sorted(words.data.iterdir()) if one.is_dir())
    fingers = {one.name: paths for one in folders if (paths := recordings_in(one))}
    files = {name: str(words.data / f'{name}.yaml') for name in fingers}
    files = {name: file for name, file in files.items() if Path(file).is_file()}
    files |= {name: file for name, _, file in (one.partition('=') for one in words.config)}
    for name in {*words.finger, *files} - fingers.keys():
        refuse(f'{words.data}: has no recordings of {name}', ', '.join(fingers) or 'some')
    return {
        name: measure_finger(fingers[name], files.get(name, ''), words)
        for name in words.finger or fingers
    }


def measure_finger(paths: list[Path], file: str, words: argparse.Namespace) -> dict[str, Any]:
    """Judge each part of the recordings by what was taught on the others; or what is given."""
    parameters = parameters_of(file, paths[0])
    tracks, chain, config = load(paths, parameters), parameters.chain, parameters.evaluation
    if words.judge or not any(one.slips for one in tracks.values()):
        if not file:
            refuse(f'{paths[0].parent}: has no slips, or no parameters to judge', '--config')
        judged = [judge(chain, one, config, chain.mains_rows) for one in tracks.values()]
        return {'parts': [], 'chains': {'given': figures(judged)}}
    parts, together = [], dict[str, list[Judged]]()
    with tempfile.TemporaryDirectory() as folder:
        divided = divide(tracks, parameters.recording, Path(folder))
        loaded = [load(its, parameters) for its in divided]
        for its in loaded:
            others = dict(pair for part in loaded if part is not its for pair in part.items())
            chains, about = teach(parameters, others, words)
            rows = chains['beginning'].mains_rows
            for name, chain in chains.items():
                judged = [judge(chain, one, config, rows) for one in its.values()]
                together.setdefault(name, []).extend(judged)
            of_taught = figures(together['taught'][-len(its) :])
            parts.append({**about, 'judged_on': [*map(str, its)], 'figures': of_taught})
    return {'parts': parts, 'chains': {name: figures(every) for name, every in together.items()}}


def parameters_of(file: str, recording: Path) -> TuningParameters:
    """Return the parameters in a file, or what a recording tells of a new sensor."""
    if file:
        path = find_parameter_file(file)
        sets: Any = (type(one).from_yaml(path) for one in TuningParameters()[:-1])
        return TuningParameters(*sets)
    first = open_recording(recording)
    shape: Any = {'channels': len(first.channel_names), 'sample_rate_hz': first.sample_rate_hz}
    # The paper's bands may be beyond this rate; the beginning has its own.
    return TuningParameters(ChainConfig(**shape, passband_hz=(1.0, 0.0), stopbands_hz=()))


def load(paths: list[Path], parameters: TuningParameters) -> Tracks:
    """Read recordings; each is named by its folder too."""
    loaded = {path: load_tracks([str(path)], parameters.loader)[0] for path in paths}
    names = {path: f'{path.parent.name}/{path.name}' for path in paths}
    return {path: dataclasses.replace(one, name=names[path]) for path, one in loaded.items()}


def teach(
    parameters: TuningParameters, tracks: Tracks, words: argparse.Namespace
) -> tuple[dict[str, ChainConfig], dict[str, Any]]:
    """Return the chains to judge, one of them taught as ``docs/your_sensor.md`` says.

    With them comes what there is to say about the teaching.
    """
    values = beginning(DetectorConfig.from_parameters(parameters.chain.to_parameters()))
    known = {name: value for name, value in values.items() if name in vars(parameters.chain)}
    start = dataclasses.replace(parameters.chain, **known)
    quiet = longest(tracks, 'rest') or longest(tracks, '') or next(iter(tracks))
    learnt, notes = learn_from_quiet(str(quiet), start, parameters.loader)
    start = begin = dataclasses.replace(start, **learnt)
    if knocks := longest(tracks, 'taps'):
        slips = [str(path) for path, one in tracks.items() if one.slips]
        try:
            learnt, lines = learn_from_taps(str(knocks), slips, begin, parameters.loader)
            start = dataclasses.replace(begin, **learnt)
        except ValueError as error:
            lines = [str(error)]
        notes += lines
    files = TrainingFiles([str(path) for path in tracks], parameters.loader)
    trials = QUICK_TRIALS if words.quick else words.trials
    result = tune(files, parameters._replace(chain=start), trials, seed=words.seed)
    taught, kept = result.verdict.chain, result.verdict.kept
    chains = {'taught': taught, 'paper': papers(parameters, tracks), 'beginning': begin}
    about = {'kept': kept, 'notes': notes + result.notes, 'parameters': searched(taught)}
    return chains, about


def papers(parameters: TuningParameters, tracks: Tracks) -> ChainConfig:
    """Return the paper's rule with a threshold for as many false positives as the paper had."""
    its, top_hz = ChainConfig(), TOP_SHARE * parameters.chain.sample_rate_hz
    bands = [(low, min(high, top_hz)) for low, high in (its.passband_hz, *its.stopbands_hz)]
    passband_hz, *stopbands_hz = (band for band in bands if band[0] < band[1])
    kept = 'channels', 'sample_rate_hz', 'groups', 'disabled_channels', 'valid_range_v'
    given: Any = {name: getattr(parameters.chain, name) for name in kept}
    chain = ChainConfig(passband_hz=passband_hz, stopbands_hz=tuple(stopbands_hz), **given)
    judged = [judge(chain, one, parameters.evaluation) for one in tracks.values()]
    rest = pooled(judged, 'between', 'rest')
    times = float(np.quantile(rest, 1.0 - PAPER_FALSE_POSITIVE_PERCENT / 100.0))
    return dataclasses.replace(chain, threshold=chain.threshold * times)


def as_table(found: Mapping[str, Any]) -> str:
    """Return the figures as text: for each finger those of each chain, and those of each part."""
    tables = []
    for name, finger in found.items():
        parts = {f'taught, part {k}': one['figures'] for k, one in enumerate(finger['parts'], 1)}
        columns = {**finger['chains'], **parts}
        flat = [dict(_flat(column)) for column in columns.values()]
        # Of many recordings only what the chain that was given does fits on a line.
        heads = [head for head in flat[0] if all(head in one for one in flat)]
        rows = [[head, *(number_text(one[head], '.3g') for one in flat)] for head in heads]
        tables.append(f'{name}\n{text_table([["", *columns], *rows])}')
    return '\n\n'.join(tables)


def _flat(figures: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Yield each figure with its name."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from ((f'{name}, {of}', one) for of, one in value.items())
        else:
            yield name, value
