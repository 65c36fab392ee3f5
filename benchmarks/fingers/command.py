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
    The share of all these rows that is ON. A guess that is as often ON covers as much of the
    slips, is ON for as much of each kind, and has areas of 0.5.
``kinds``
    For each kind of rows in which nothing slides, ``motion`` of the robot among them:
    ``on_percent``; ``auc``, the area under the ROC curve of slides against them; and
    ``auc_of_rest``, that of rest against them, which is high where the chain recognises not what
    happens but the recording.
``joints``
    Of joints (:mod:`benchmarks.fingers.joints`) of a rest with a ``slide``, and with another
    ``rest``: the number of ``joints`` and how many are ``on_before``; of the others
    ``detected_percent``, within 0.3 s, and after which time from the middle, ``median_ms``.
``recordings_on_percent``
    The share of the rest of each recording that is ON.
"""

import argparse
import dataclasses
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fingers.judging import OF_SLIPS, Judged, figures, judge, rows_of
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

#: Length of the cross-fade of a joint without mains.
FADE_S = 0.08

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
        refuse(f'--data: is {words.data}', 'a folder with a folder for each finger')
    folders = {one.name: one for one in sorted(words.data.iterdir()) if one.is_dir()}
    given = dict(one.partition('=')[::2] for one in words.config)
    for name in {*words.finger, *given} - folders.keys():
        refuse(f'{words.data}: has no folder {name!r}', ', '.join(folders) or 'one for each')
    trials = QUICK_TRIALS if words.quick else words.trials
    found = {}
    for name in words.finger or folders:
        beside = words.data / f'{name}.yaml'
        file = find_parameter_file(given[name]) if name in given else beside
        parameters = parameters_of(folders[name], file if file.exists() else None)
        tracks = load(parameters, recordings_in(folders[name]))
        if words.judge or not any(one.slips for one in tracks.values()):
            on_all = judged_on(parameters, parameters.chain, tracks, parameters.chain.mains_rows)
            found[name] = {'parts': [], 'chains': {'given': figures(on_all)}}
        else:
            found[name] = measure_taught(parameters, tracks, trials, words.seed)
    return found


def parameters_of(folder: Path, file: Path | None) -> TuningParameters:
    """Return the parameters in a file, or those that the recordings of a new sensor tell."""
    if file:
        sets: Any = (type(one).from_yaml(file) for one in TuningParameters()[:-1])
        return TuningParameters(*sets)
    paths = recordings_in(folder)
    if not paths:
        refuse(f'{folder}: has no recordings', 'those of a finger')
    first = open_recording(paths[0])
    shape: Any = {'channels': len(first.channel_names), 'sample_rate_hz': first.sample_rate_hz}
    # Bands of the paper may be beyond this rate; the beginning has its own.
    return TuningParameters(ChainConfig(**shape, passband_hz=(1.0, 0.0), stopbands_hz=()))


def load(parameters: TuningParameters, paths: list[Path]) -> Tracks:
    """Read recordings."""
    loaded = {path: load_tracks([str(path)], parameters.loader)[0] for path in paths}
    return {
        path: dataclasses.replace(one, name='/'.join(path.parts[-2:]))
        for path, one in loaded.items()
    }


def judged_on(
    parameters: TuningParameters, chain: ChainConfig, tracks: Tracks, mains_rows: int
) -> list[Judged]:
    """Judge a chain on each recording."""
    fade_rows = mains_rows or chain.samples(FADE_S)
    return [judge(chain, one, parameters.evaluation, fade_rows) for one in tracks.values()]


def measure_taught(
    parameters: TuningParameters, tracks: Tracks, trials: int, seed: int
) -> dict[str, Any]:
    """Judge each part by what was taught on the others."""
    parts, together = [], dict[str, list[Judged]]()
    with tempfile.TemporaryDirectory() as folder:
        divided = divide(tracks, parameters.recording, Path(folder))
        loaded = [load(parameters, paths) for paths in divided]
        for its in loaded:
            others = {
                path: one for part in loaded if part is not its for path, one in part.items()
            }
            chains, about = teach(parameters, others, trials, seed)
            judged = {
                name: judged_on(parameters, chain, its, chains['beginning'].mains_rows)
                for name, chain in chains.items()
            }
            for name, several in judged.items():
                together.setdefault(name, []).extend(several)
            names = [one.name for one in its.values()]
            parts.append({'judged_on': names, **about, 'figures': figures(judged['taught'])})
    return {'parts': parts, 'chains': {name: figures(every) for name, every in together.items()}}


def teach(
    parameters: TuningParameters, tracks: Tracks, trials: int, seed: int
) -> tuple[dict[str, ChainConfig], dict[str, Any]]:
    """Return the chains, one of them taught as in ``docs/your_sensor.md``, and what is to say."""
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
    result = tune(files, parameters._replace(chain=start), trials, seed=seed)
    taught, kept = result.verdict.chain, result.verdict.kept
    chains = {'taught': taught, 'paper': papers(parameters, tracks), 'beginning': begin}
    notes += result.notes
    return chains, {'kept': kept, 'notes': notes, 'parameters': searched(taught)}


def papers(parameters: TuningParameters, tracks: Tracks) -> ChainConfig:
    """Return the paper's rule with a threshold for as many false positives as the paper had."""
    given, its = parameters.chain, ChainConfig()
    top_hz = TOP_SHARE * given.sample_rate_hz
    bands = [(low, min(high, top_hz)) for low, high in (its.passband_hz, *its.stopbands_hz)]
    passband_hz, *stopbands_hz = (band for band in bands if band[0] < band[1])
    kept = 'channels', 'sample_rate_hz', 'groups', 'disabled_channels', 'valid_range_v'
    chain = ChainConfig(
        passband_hz=passband_hz,
        stopbands_hz=tuple(stopbands_hz),
        **{name: getattr(given, name) for name in kept},
    )
    rest = rows_of(judged_on(parameters, chain, tracks, 0), 'rest')
    times = np.quantile(rest, 1.0 - PAPER_FALSE_POSITIVE_PERCENT / 100.0)
    return dataclasses.replace(chain, threshold=float(chain.threshold * times))


def as_table(found: Mapping[str, Any]) -> str:
    """Return the figures as text, a table for each finger."""
    return '\n\n'.join(f'{name}\n{text_table(_table(one))}' for name, one in found.items())


def _table(finger: Mapping[str, Any]) -> list[list[str]]:
    """Return the figures of each chain, and of what was taught on each part."""
    columns = dict(finger['chains'])
    for number, part in enumerate(finger['parts'], start=1):
        columns[f'taught, part {number}'] = part['figures']
    kinds = next(iter(columns.values()))['kinds']
    rows: dict[str, tuple[str, ...]] = {
        name.replace('_', ' '): ('.2f', name) for name in (*OF_SLIPS, 'on_percent')
    }
    for what, form, name in (
        ('ON in {} [%]', '.1f', 'on_percent'),
        ('area of slides against {}', '.3f', 'auc'),
        ('area of rest against {}', '.3f', 'auc_of_rest'),
    ):
        rows |= {what.format(kind): (form, 'kinds', kind, name) for kind in kinds}
    for kind in ('slide', 'rest'):
        for name in ('joints', 'on_before', 'detected_percent', 'median_ms'):
            rows[f'rest to {kind}, {name.replace("_", " ")}'] = ('.0f', 'joints', kind, name)
    table = [['', *columns]]
    for head, (form, *keys) in rows.items():
        cells = []
        for column in columns.values():
            value: Any = column
            for key in keys:
                value = value[key]
            cells.append(number_text(value, form))
        table.append([head, *cells])
    return table
