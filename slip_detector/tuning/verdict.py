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

"""A whole search, as command and live page call it, and its verdict by held-out recordings."""

import dataclasses
import functools
import importlib.util
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from slip_detector.chain.filters import settling_rows
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters import (
    ChainConfig,
    EvaluationConfig,
    RecordingConfig,
    TuneConfig,
    name_list,
    refuse,
)
from slip_detector.recordings.labels import ENDING, MISTAKEN
from slip_detector.tuning.labels import contradictions, snap_labels
from slip_detector.tuning.learning import learn
from slip_detector.tuning.problem import COMPARED, Candidate, Problem, beats_chance, worse_figures
from slip_detector.tuning.search import Calls, Study, search
from slip_detector.tuning.tracks import Track, TrainingFiles

#: The chains that are compared on the recordings that were tuned on, the cheapest first.
COMPARED_CHAINS = 24

#: The fewest and the most trials of a search without a number, and how many values of recordings
#: all of them together may read.
TRIALS, VALUES = (200, 400), 1e9

#: In less rest than this, in seconds, false alarms hardly show.
LEAST_REST_S = 60.0


class TuningParameters(NamedTuple):
    """The sets of parameters that tuning needs."""

    chain: ChainConfig = ChainConfig()
    recording: RecordingConfig = RecordingConfig()
    evaluation: EvaluationConfig = EvaluationConfig()
    tune: TuneConfig = TuneConfig()

    @property
    def loader(self) -> RecordingLoader:
        """Opens recordings for the chain."""
        return RecordingLoader(self.chain, self.recording, self.evaluation)

    def problem(self, tracks: Sequence[Track], begin: ChainConfig | None = None) -> Problem:
        """Return the problem of a search that begins with a chain, else with the running one."""
        problem = Problem(tracks, begin or self.chain, None, self.evaluation, self.tune)
        return dataclasses.replace(problem, figures=problem.evaluate(self.chain).figures)


class Verdict(NamedTuple):
    """The chain that a search returns.

    Attributes
    ----------
    chain : ChainConfig
        The best chain found, or the running one.
    kept : str
        Why the running chain is kept; empty where it is not.
    tried : ChainConfig or None
        The best chain found, also where it is not taken; None where none was found.
    """

    chain: ChainConfig
    kept: str
    tried: ChainConfig | None = None


class TuningResult(NamedTuple):
    """What a search has found.

    Attributes
    ----------
    problem : Problem
        With the recordings that were tuned on.
    held : list of Track
        The held-out recordings.
    study : Study
        With all trials.
    verdict : Verdict
        The best chain found, or the given one.
    notes : list of str
        A line for each recording that has faults, is left out, contradicts its kind or has labels
        that were moved; what was learnt; one where the search was stopped, and where little rest
        is held out.
    """

    problem: Problem
    held: list[Track]
    study: Study
    verdict: Verdict
    notes: list[str]


def tune(
    files: TrainingFiles,
    parameters: TuningParameters,
    trials: int | None = None,
    *,
    seed: int = 0,
    storage: str | None = None,
    observe: Callable[..., None] = lambda **news: None,
    stop: Callable[[], bool] = lambda: False,
    calls: Calls | None = None,
) -> TuningResult:
    """Learn of a finger, search for a better chain, and judge the best one by what is held out.

    See :func:`.learning.learn`, :func:`.search.search`, :func:`choose` and :func:`judge`.

    Parameters
    ----------
    files
        The recordings to tune on and to hold out.
    parameters
        The chain that is tuned, and how.
    trials
        Number of trials that the study is to reach, including other searches and earlier runs.
        None: as many as a short time allows, see :data:`TRIALS`.
    seed
        Seed of the search.
    storage
        The storage of the study, see :class:`Study`; None: in memory.
    observe
        Called with news by name. ``step``: words on a step, as it begins. ``count``, ``trials``
        and ``best``: the number of trials so far, that of all, and the cheapest chain, if there is
        one; before the first trial, and after each trial and each batch. ``lines``: before the
        search on recordings that have faults, are left out or contradict their kind, see
        :func:`.labels.contradictions`, and on what was learnt; after it on what the result cannot
        tell.
    stop
        Returns whether to end the search with the result so far; first called when the recordings
        are read.
    calls
        Makes the calls for the points of a batch. None: they are made in this process.

    Raises
    ------
    ValueError
        When a recording cannot be read, there are too few slips, or the storage fails; names what
        is wrong.
    KeyboardInterrupt
        When it was stopped before it found anything.
    """
    if importlib.util.find_spec('optuna') is None:
        raise ValueError("needs optuna, which is not installed: pip install 'slip_detector[tune]'")
    if parameters.tune.trade:
        refuse('parameter trade is true', 'false; other weights ask for another compromise')
    training, held, notes = _read(files, parameters.chain)
    begin, learnt = learn(parameters.chain, training, observe)
    notes += learnt
    observe(lines=notes)
    stop()
    observe(step='searching')
    problem = parameters.problem(training, begin)
    values = sum(track.volts.size for track in training)
    many = trials or int(np.clip(VALUES / values, *TRIALS))
    study = Study(problem, seed, storage)

    def show(count: int) -> None:
        observe(count=count, trials=many, best=study.cheapest)

    show(study.follow())
    results = calls and functools.partial(calls, study.candidate_at)
    search(study, many, stop, show, results)
    late_notes = []
    if stop():
        if not study.trials:
            raise KeyboardInterrupt('stopped before anything was found')
        late_notes.append('Stopped early.')
    rest_s = sum(track.without_slip_s for track in held)
    if rest_s < LEAST_REST_S:
        few = f'Only {rest_s:.3g} s of rest are held out: false alarms hardly show in it'
        late_notes.append(few)
    observe(step='choosing the best, recording by recording')
    best = choose(study)
    observe(step='comparing on what was held out')
    verdict = judge(problem, parameters.chain, held, best)
    observe(lines=late_notes)
    return TuningResult(problem, held, study, verdict, notes + late_notes)


def _read(files: TrainingFiles, chain: ChainConfig) -> tuple[list[Track], list[Track], list[str]]:
    """Return recordings to tune on and to hold out, without mistaken ones, and notes on them."""
    training, held, notes = files.load()
    tracks, moved = snap_labels(training + held)
    sentences, mistakes = contradictions(chain, tracks)
    training, held = tracks[: len(training)], tracks[len(training) :]
    wrong = [track for track in training if track in mistakes and track.samples.accuracy_s]
    others = [track for track in training if track not in wrong]
    if wrong and any(track.slips for track in others):
        training = others
        left_out = name_list([track.name for track in wrong])
        sentences.append(f'Not tuned on: {left_out}. A mistake? {MISTAKEN}: true in its {ENDING}')
    return training, held, notes + moved + sentences


def choose(study: Study) -> Candidate | None:
    """Return the result of a search; None where no trial found a chain.

    The cheapest chains are compared by their costs in each recording, where the threshold comes
    from the other recordings. A chain costs as much as the best one if the difference is below
    one standard error (by the jackknife). The result is the nearest of these to the chain with
    which the search began. So with few slips, which cannot distinguish a good chain from a lucky
    one, the result stays close to that chain. Where too few recordings have slips to leave one
    out, the result is the nearest of the cheapest chains.

    The result's area under the ROC curve is not below both the area of the best and that of the
    running chain: the area is of many rows, so that few slips do not explain a lower one.
    """
    problem, space = study.problem, study.space
    if not study.trials:
        return None
    cheapest = sorted(study.trials, key=lambda trial: trial.candidate.cost_ms)[:COMPARED_CHAINS]
    tried = [trial.candidate for trial in cheapest]
    costs = [problem.cross_validate(candidate.chain) for candidate in tried]
    best = min(range(len(tried)), key=lambda k: costs[k][0])
    best_ms, best_costs_ms = costs[best]
    both = tried[best].figures, problem.figures or {'auc': None}
    least_area = min(figures['auc'] or 0.0 for figures in both) - COMPARED['auc'].step
    origin, distances = space.point(problem.origin), dict[int, float]()
    for k, (cost_ms, costs_ms) in enumerate(costs):
        error_ms = math.sqrt(costs_ms.size - 1) * float(np.std(costs_ms - best_costs_ms))
        if cost_ms <= best_ms + error_ms and (tried[k].figures['auc'] or 0.0) >= least_area:
            distances[k] = space.distance(cheapest[k].point, origin)
    return tried[min(distances, key=lambda k: distances[k])]


def judge(
    problem: Problem, running: ChainConfig, held: Sequence[Track], best: Candidate | None
) -> Verdict:
    """Choose between the running chain and the best one found, by the held-out recordings.

    There the best chain has to beat chance, and to be better in at least one and worse in none
    of :data:`.problem.COMPARED`.
    """
    if best is None:
        return Verdict(running, 'nothing that was tried finds slips')
    on_held = dataclasses.replace(problem, tracks=held, figures=None)
    if why := _why_not(on_held, best.chain, running):
        return Verdict(running, f'on what was held out, the best that was tried {why}', best.chain)
    return Verdict(best.chain, '', best.chain)


def _why_not(on_held: Problem, found: ChainConfig, running: ChainConfig) -> str:
    """Return why a chain is not taken in place of the running one; empty where it is."""
    after, before = (on_held.evaluate(chain).figures for chain in (found, running))
    slips = sum(len(track.slips) for track in on_held.tracks)
    if any(figures['matched'] + figures['missed'] < slips for figures in (after, before)):
        # A slip that begins while one of the chains settles is counted for neither.
        rows = max(settling_rows(chain) for chain in (found, running))
        on_held = dataclasses.replace(on_held, settling_rows=rows)
        after, before = (on_held.evaluate(chain).figures for chain in (found, running))
    if worse_figures(after, before):
        return 'is worse'
    if not after['matched']:
        return f'finds none of {after["missed"]} slips'
    if not beats_chance(after):
        return 'is no better than guessing'
    return '' if worse_figures(before, after) else 'is no better'
