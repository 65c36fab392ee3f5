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
import pickle
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from slip_detector.chain.filters import settling_rows
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters import ChainConfig, EvaluationConfig, RecordingConfig, TuneConfig
from slip_detector.parameters.fields import name_list
from slip_detector.recordings.labels import KINDS
from slip_detector.tuning.kinds import contradictions
from slip_detector.tuning.problem import ON_STEP, Candidate, Figures, Problem, better_than_chance
from slip_detector.tuning.search import Calls, Study, candidates_at, search
from slip_detector.tuning.teaching import learn
from slip_detector.tuning.tracks import Track, TrainingFiles

#: So many chains at most are judged, the cheapest first, if one is not enough.
JUDGED = 20

#: Areas under the ROC curve that differ by less than this count as equal; so do coverages, and
#: other figures.
AUC_STEP, COVERAGE_STEP, EQUAL = 1e-3, 5e-3, 1e-9

#: The figures that must not get worse: words, unit, whether more is better, the step up to which
#: two count as equal, and by how much one of them may get worse where ``trade`` is set.
COMPARED = {
    'false_time_percent': ('false time', ' %', False, EQUAL, 5.0),
    'false_alarms_per_minute': ('false alarms', ' in a minute of rest', False, EQUAL, 5.0),
    'latency_median_all_ms': ('median latency', ' ms', False, EQUAL, 50.0),
    'sooner_than_chance': ('sooner than chance', '', True, EQUAL, 0.1),
    'coverage': ('time of slips that is ON', '', True, COVERAGE_STEP, 0.1),
    'auc': ('area under the ROC curve', '', True, AUC_STEP, 0.02),
    **{f'{kind}_on_percent': (f'time ON in {kind}', ' %', False, ON_STEP, 5.0) for kind in KINDS},
}

#: In less rest than this, in seconds, false alarms hardly show.
LEAST_REST_S = 60.0


class TuningParameters(NamedTuple):
    """The sets of parameters that tuning needs.

    Examples
    --------
    >>> TuningParameters().chain.threshold
    0.5
    """

    chain: ChainConfig = ChainConfig()
    recording: RecordingConfig = RecordingConfig()
    evaluation: EvaluationConfig = EvaluationConfig()
    tune: TuneConfig = TuneConfig()
    running: ChainConfig | None = None

    @property
    def loader(self) -> RecordingLoader:
        """Opens recordings for the chain."""
        return RecordingLoader(self.chain, self.recording, self.evaluation)

    def problem(self, tracks: Sequence[Track]) -> Problem:
        """Return the problem of a search on tracks."""
        problem = Problem(tracks, self.chain, None, self.evaluation, self.tune, self.running)
        running = self.running or self.chain
        return dataclasses.replace(problem, figures=problem.as_it_is(running).figures)


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
    traded : str
        In what it is worse nevertheless, as ``trade`` is set; empty: in nothing.

    Examples
    --------
    >>> Verdict(ChainConfig(threshold=0.7), kept='').chain.threshold
    0.7
    """

    chain: ChainConfig
    kept: str
    tried: ChainConfig | None = None
    traded: str = ''


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
        A line for each recording that has faults, is left out or contradicts its kind; one where
        the search was stopped, where little rest is held out, where the cheapest chain is not the
        one that was judged or taken, and where that is worse in one figure.
    """

    problem: Problem
    held: list[Track]
    study: Study
    verdict: Verdict
    notes: list[str]


def tune(
    files: TrainingFiles,
    parameters: TuningParameters,
    trials: int,
    *,
    seed: int = 0,
    storage: str | None = None,
    progress: Callable[[int, Candidate | None], None] = lambda count, best: None,
    doubt: Callable[[list[str]], None] = lambda sentences: None,
    stop: Callable[[], bool] = lambda: False,
    calls: Calls | None = None,
    step: Callable[[str], None] = lambda words: None,
) -> TuningResult:
    """Learn of a finger, search for a better chain, and judge the best one by what is held out.

    Without evidence the search begins as for a new sensor. Noise is learnt of the longest
    recording of rest and impacts of the longest of taps, as far as there are any.

    Parameters
    ----------
    files
        The recordings to tune on and to hold out.
    parameters
        The chain that is tuned, and how.
    trials
        Number of trials that the study is to reach, including other searches and earlier runs.
    seed
        Seed of the search.
    storage
        The storage of the study, see :class:`Study`; None: in memory.
    progress
        Called with the number of trials so far and the chain that would be judged if the search
        ended now, before the first trial, and after each trial and each batch.
    doubt
        Called before the search with a line on each recording that has faults, is left out or
        contradicts its kind, see :func:`.kinds.contradictions`, and on what was learnt.
    stop
        Returns whether to end the search with the result so far; first called when the recordings
        are read.
    calls
        Makes the calls for the points of a batch. None: they are made in this process.
    step
        Called with words on each step as it begins.

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
    training, held, notes = files.load()
    sentences, mistakes = contradictions(parameters.chain, training + held)
    wrong = [track for track in mistakes if track.samples.accuracy_s]
    parts = [[track for track in part if track not in wrong] for part in (training, held)]
    if wrong and all(any(track.slips for track in part) for part in parts):
        training, held = parts
        left_out = name_list([track.name for track in wrong])
        sentences.append(f'Left out, as keys that were pressed by mistake: {left_out}')
    notes += sentences
    running = parameters.running or parameters.chain
    begin, learnt = learn(parameters.chain, training, step)
    notes += learnt
    doubt(notes)
    stop()
    step('searching')
    problem = parameters._replace(chain=begin, running=running).problem(training)
    name = problem.study_name()
    study = Study(problem.space.distributions, seed, storage, name)
    # It has a few kilobytes, without any rows.
    names = {track.name for track in training}
    pickled = pickle.dumps((files, names, dataclasses.replace(problem, tracks=()), name))

    @functools.lru_cache(maxsize=1)
    def chosen(known: int) -> Candidate | None:
        with study.errors_in_one_line():  # Its trials may be damaged.
            return choose(problem, study.trials)

    def show(count: int) -> None:
        progress(count, chosen(len(study.trials)))

    show(study.follow())
    results = calls and functools.partial(calls, functools.partial(candidates_at, pickled))
    search(problem, study, trials, stop, show, results)
    if stop():
        if not study.trials:
            raise KeyboardInterrupt('stopped before anything was found')
        notes.append('Stopped early.')
    step('comparing on what was held out')
    rest_s = sum((one.kinds < SLIP).sum() / one.sample_rate_hz for one in held)
    if rest_s < LEAST_REST_S:
        notes.append(f'Only {rest_s:.3g} s of rest are held out: false alarms hardly show in it')
    best, others = chosen(len(study.trials)), cheapest(problem, study.trials, JUDGED)
    verdict = judge(problem, held, best, others)
    if best and best.cost_ms > others[0].cost_ms:
        notes.append(
            f'The cheapest chain costs {others[0].cost_ms:.1f} ms, maybe by chance, so the one '
            f'nearest to the given parameters was judged, at {best.cost_ms:.1f} ms'
        )
    if best and not verdict.kept and verdict.chain != best.chain:
        notes.append(
            f'Of {1 + len(others)} chains that were judged the one was taken that costs least on '
            f'what was held out, and is worse in {"one figure" if verdict.traded else "nothing"}'
        )
    if verdict.traded:
        notes.append(f'Worse on what was held out, as trade allows: {verdict.traded}')
    return TuningResult(problem, held, study, verdict, notes)


def worse_than(figures: Figures, other: Figures, trade: bool = False) -> list[str]:
    """Return a text for each figure that is worse, or not defined where the other's is.

    Only the area under the ROC curve is compared where the other's figures are no better than
    chance. The latency of the slips found is not, as it falls where late slips are missed. What is
    ON for much of the rest has few alarms, and is ON in slips by chance: alarms are not compared
    where the time ON is less, and coverage may fall by as much as it.

    Parameters
    ----------
    figures, other
        See :data:`.problem.Figures`.
    trade
        Only figures that are worse by more than ``trade`` allows.

    Examples
    --------
    >>> given = dict.fromkeys(COMPARED, 1.0)
    >>> worse_than({**given, 'sooner_than_chance': 0.9}, given)
    ['sooner than chance 0.9 against 1']
    """
    texts = []
    on_percent, its_on_percent = (one['false_time_percent'] or 0.0 for one in (figures, other))
    less_percent = max(its_on_percent - on_percent, 0.0)
    for name, (words, unit, more_is_better, step, most) in COMPARED.items():
        figure, its = figures[name], other[name]
        if its is None or (name != 'auc' and not better_than_chance(other)):
            continue
        if figure is None:
            texts.append(f'no {words} defined against {its:.4g}{unit}')
            continue
        if name.startswith('latency'):  # That an alarm is before its slip brings nothing.
            figure, its = max(figure, 0.0), max(its, 0.0)
        worse_by = its - figure if more_is_better else figure - its
        if name == 'coverage':
            worse_by -= less_percent / 100.0
        elif name == 'false_alarms_per_minute' and less_percent > ON_STEP:
            continue
        if worse_by > (most if trade else step):
            texts.append(f'{words} {figure:.4g} against {its:.4g}{unit}')
    return texts


def cheapest(problem: Problem, trials: Sequence[Any], most: int = 1) -> list[Candidate]:
    """Return the cheapest chains of finished trials, each of another trial."""
    found = [trial.user_attrs['found'][0] for trial in trials]
    found.sort(key=lambda entry: entry['cost_ms'])
    return [problem.candidate(entry) for entry in found[:most]]


def choose(problem: Problem, trials: Sequence[Any]) -> Candidate | None:
    """Return the result of a search; None where no trial found a chain.

    Of all chains whose cost is at most that of the best one plus its error, it is the nearest to
    the given chain. So with few slips, which cannot distinguish a good chain from a lucky one, the
    result stays close to the given chain. None is worse than the given one where the best is not:
    neither in more figures, nor in the area under the ROC curve, which must not be below those of
    both: as the area is of many rows, few slips do not explain a lower one.
    """
    if not trials:
        return None
    (best,), limits = cheapest(problem, trials), problem.figures or {}
    given, vote = problem.space.point(problem.given), problem.given.vote

    def worse(found: Candidate) -> bool:
        many, of_best = (len(worse_than(one.figures, limits)) for one in (found, best))
        area, *others = (one['auc'] or 0.0 for one in (found.figures, best.figures, limits))
        return many > of_best or area < min(others) - AUC_STEP

    as_good = [
        (math.hypot(problem.space.distance(trial.params, given), found.chain.vote != vote), found)
        for trial in trials
        for entry in trial.user_attrs['found']
        if entry['cost_ms'] <= best.cost_ms + best.error_ms
        and not worse(found := problem.candidate(entry))
    ]
    return min(as_good, key=lambda one: one[0])[1]


def judge(
    problem: Problem, held: Sequence[Track], best: Candidate | None, more: Sequence[Candidate] = ()
) -> Verdict:
    """Choose between the running chain and those found, by the held-out recordings.

    A chain holds there if it costs less, is better than chance and in at least one of
    :data:`COMPARED`, and is worse in none, or where ``trade`` is set in one, by no more than is
    allowed. If the best one does not, or labels by hand leave little to tell chains by, the others
    are judged too, and the one is taken that holds and costs least.

    Parameters
    ----------
    problem
        The problem of the search.
    held
        The held-out recordings.
    best
        The best chain found; None where none was found.
    more
        Other chains.

    Examples
    --------
    >>> judge(Problem([]), [], best=None).kept
    'no trial found a chain that detects slip'
    """
    running = problem.running or problem.given
    if best is None:
        return Verdict(running, 'no trial found a chain that detects slip')
    on_held = dataclasses.replace(problem, tracks=held, figures=None)
    before, judged = on_held.as_it_is(running), [on_held.as_it_is(best.chain)]
    why = _why_not(on_held, judged[0], before)
    if why or any(track.samples.accuracy_s for track in held):
        judged += [on_held.as_it_is(one.chain) for one in more]
    holding = [one for one in judged if not _why_not(on_held, one, before)]
    if not holding:
        return Verdict(running, f'on the held-out recordings the best found is {why}', best.chain)
    taken = min(holding, key=lambda one: one.cost_ms)
    traded = ', '.join(worse_than(taken.figures, before.figures))
    return Verdict(taken.chain, '', taken.chain, traded)


def _why_not(on_held: Problem, after: Candidate, before: Candidate) -> str:
    """Return why a chain is not taken in place of the running one; empty where it is."""
    slips = sum(len(track.slips) for track in on_held.tracks)
    if any(one.figures['matched'] + one.figures['missed'] < slips for one in (before, after)):
        # A slip that begins while one of them settles is counted for neither.
        rows = max(settling_rows(one.chain) for one in (before, after))
        on_held = dataclasses.replace(on_held, settling_rows=rows)
        before, after = (on_held.as_it_is(one.chain) for one in (before, after))
    worse = worse_than(after.figures, before.figures)
    if on_held.config.trade and len(worse) == 1:
        worse = worse_than(after.figures, before.figures, trade=True)
    missed, found = after.figures['missed'], after.figures['matched']
    if missed > before.figures['missed'] and better_than_chance(before.figures):
        worse.insert(0, f'misses {missed} of {missed + found} slips')
    if after.cost_ms > before.cost_ms:
        worse.append(f'a cost of {after.cost_ms:.4g} against {before.cost_ms:.4g} ms')
    if worse:
        return f'worse: {", ".join(worse)}'
    if not found:
        return f'no better: it detects none of {missed} slips'
    if not better_than_chance(after.figures):
        return 'no better than chance'
    better = after.cost_ms < before.cost_ms and worse_than(before.figures, after.figures)
    return '' if better else 'no better'
