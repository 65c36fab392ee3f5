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
    of the ``beginning`` of a search, with noise and impacts as they were learnt. Or of the
    parameters that were ``given``.

The figures of a chain, of rows in which it has settled and the label is certain:

``slips``, ``recall``, ``recall_by_chance``, ``coverage``, ``false_alarms_per_minute``
    As ``slip_evaluate`` has them.
``slide_on_percent``, ``all_on_percent``, ``<kind>_on_percent``
    The share that is ON: of rows that slide, of all rows, and of the rows of each kind in which
    nothing slides; ``between`` slips, and in recordings without a kind; and where the robot is
    ``moving`` in these. A guess that is as often ON is ON for the same share of each.
``<kind>_auc``
    The area under the ROC curve of slides against rows of a kind; of a guess 0.5.
``<kind>_auc_of_rest``
    That of rest, between slips and of this kind, against them: above 0.5 where the chain
    recognises not what happens but the recording.
``joints_of_slide``, ``joints_of_slide_detected_percent``, ``joints_of_slide_ms``
    Joints (:mod:`benchmarks.fingers.joints`) of a rest with a slide, before which it is OFF; how
    many of them turn it ON within 0.3 s; and the median of the times from the middle of a joint,
    of all of them, where that is defined. ``joints_of_rest`` and so on: the same of joints of a
    rest with another rest.

Of parameters that are given there is also the share of each recording that is ON, in per cent, by
its name.
"""

import argparse
import dataclasses
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.fingers.judging import Judged, figures, judge, pooled
from benchmarks.fingers.parts import Tracks, divide, recordings_in
from benchmarks.measurement import Bound, shared_options
from benchmarks.paper.protocol import PAPER_FALSE_POSITIVE_PERCENT
from slip_detector.parameters import ChainConfig, find_parameter_file, refuse
from slip_detector.recordings import open_recording
from slip_detector.report.texts import number_text, text_table
from slip_detector.tuning.learning import LOW_HZ, LOW_SHARE, learn
from slip_detector.tuning.problem import searched_parameters
from slip_detector.tuning.tracks import TrainingFiles, load_tracks
from slip_detector.tuning.verdict import TuningParameters, tune

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
    fingers = {one.name: one for one in sorted(words.data.iterdir()) if one.is_dir()}
    files = {name: words.data / f'{name}.yaml' for name in fingers}
    given = {name: str(file) for name, file in files.items() if file.is_file()}
    given |= {name: file for name, _, file in (one.partition('=') for one in words.config)}
    for name in {*words.finger, *given} - fingers.keys():
        refuse(f'{words.data}: has no folder {name}', ', '.join(fingers) or 'one of a finger')
    names = words.finger or fingers
    return {name: measure_finger(fingers[name], given.get(name, ''), words) for name in names}


def measure_finger(folder: Path, file: str, words: argparse.Namespace) -> dict[str, Any]:
    """Judge each part of the recordings by what was taught on the others; or what is given."""
    paths = recordings_in(folder)
    parameters = parameters_of(file, paths[0])
    tracks, chain, config = load(paths, parameters), parameters.chain, parameters.evaluation
    if words.judge or not any(one.slips for one in tracks.values()):
        if not file:
            refuse(f'{folder}: has no slips, or no parameters to judge', '--config')
        judged = [judge(chain, one, config, chain.mains_rows) for one in tracks.values()]
        found = figures(judged)
        for track, one in zip(tracks.values(), judged, strict=True):
            found[track.name] = figures([one])['all_on_percent']
        return {'parts': [], 'chains': {'given': found}}
    parts, together = [], dict[str, list[Judged]]()
    with tempfile.TemporaryDirectory() as cut:
        divided = divide(tracks, parameters.recording, Path(cut))
        loaded = [load(its, parameters) for its in divided]
        for its in loaded:
            others = dict(pair for part in loaded if part is not its for pair in part.items())
            chains, about = teach(parameters, others, words)
            rows = chains['beginning'].mains_rows
            for name, chain in chains.items():
                judged = [judge(chain, one, config, rows) for one in its.values()]
                together.setdefault(name, []).extend(judged)
            about['judged_on'] = [one.name for one in its.values()]
            parts.append({**about, 'figures': figures(together['taught'][-len(its) :])})
    return {'parts': parts, 'chains': {name: figures(every) for name, every in together.items()}}


def parameters_of(file: str, recording: Path) -> TuningParameters:
    """Return the parameters in a file, or what a recording tells of a new sensor."""
    if file:
        path = find_parameter_file(file)
        sets: Any = (type(one).from_yaml(path) for one in TuningParameters())
        return TuningParameters(*sets)
    first = open_recording(recording)
    many, rate_hz = len(first.channel_names), first.sample_rate_hz
    # The paper's bands may be beyond this rate.
    passband_hz = min(LOW_HZ, LOW_SHARE * rate_hz), 0.0
    shape: Any = {'channels': many, 'sample_rate_hz': rate_hz, 'passband_hz': passband_hz}
    return TuningParameters(ChainConfig(**shape, stopbands_hz=()))


def load(paths: list[Path], parameters: TuningParameters) -> Tracks:
    """Read recordings; each is named by its folder too."""
    loaded = {}
    for path in paths:
        (track,) = load_tracks([str(path)], parameters.loader)
        loaded[path] = dataclasses.replace(track, name=f'{path.parent.name}/{path.name}')
    return loaded


def teach(
    parameters: TuningParameters, tracks: Tracks, words: argparse.Namespace
) -> tuple[dict[str, ChainConfig], dict[str, Any]]:
    """Return the chains to judge, one of them taught as ``slip_tune`` does, and what it says."""
    begin, _ = learn(parameters.chain, [*tracks.values()], lambda step: None)
    files = TrainingFiles([str(path) for path in tracks], parameters.loader)
    trials = QUICK_TRIALS if words.quick else words.trials
    result = tune(files, parameters, trials, seed=words.seed)
    taught, kept = result.verdict.chain, result.verdict.kept
    chains = {'taught': taught, 'paper': papers(parameters, tracks), 'beginning': begin}
    return chains, {'kept': kept, 'notes': result.notes, 'parameters': searched_parameters(taught)}


def papers(parameters: TuningParameters, tracks: Tracks) -> ChainConfig:
    """Return the paper's rule with a threshold for as many false positives as the paper had."""
    its, top_hz = ChainConfig(), TOP_SHARE * parameters.chain.sample_rate_hz
    bands = [(low, min(high, top_hz)) for low, high in (its.passband_hz, *its.stopbands_hz)]
    passband_hz, *stopbands_hz = (band for band in bands if band[0] < band[1])
    rule = {**searched_parameters(its), 'passband_hz': passband_hz, 'stopbands_hz': stopbands_hz}
    chain = dataclasses.replace(parameters.chain, **rule)
    judged = [judge(chain, one, parameters.evaluation) for one in tracks.values()]
    false = PAPER_FALSE_POSITIVE_PERCENT / 100.0
    times = float(np.quantile(pooled(judged, 'between', 'rest'), 1.0 - false))
    return dataclasses.replace(chain, threshold=chain.threshold * times)


def as_table(found: Mapping[str, Any]) -> str:
    """Return the figures as text: for each finger those of each chain, and those of each part."""
    tables = []
    for name, finger in found.items():
        parts = {f'taught, part {k}': one['figures'] for k, one in enumerate(finger['parts'], 1)}
        columns = {**finger['chains'], **parts}
        first, *_ = columns.values()
        of = {head: [one.get(head) for one in columns.values()] for head in first}
        rows = [[head, *(number_text(each, '.3g') for each in its)] for head, its in of.items()]
        tables.append(f'{name}\n{text_table([["", *columns], *rows])}')
    return '\n\n'.join(tables)
