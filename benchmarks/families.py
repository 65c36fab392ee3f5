"""What tuning brings: on families of simulated scenes, and on real recordings.

What is reported is parted from what is tuned on before a search begins.

:func:`families` gives, by the name of the family, ``given`` and ``tuned``, each with
``slips``, ``recall``, ``false_alarms_per_minute``, ``latency_median_ms`` of the slips detected and
``latency_median_all_ms`` of all, a missed one later than any, on seeds that the search has not
seen; ``kept``: why the given parameters were kept, else empty; ``better``: whether the latency of
all and the false alarms are both better; and ``parameters``: what was searched, as tuned.

:func:`real` leaves each recording out of one search and scores it with the chain found there. It
gives the area under the ROC curve of slip against motion over all recordings: ``given``, without
tuning; by the seed of the searches ``auc_moving`` and ``auc_moving_by_threshold``; and
``least_auc_moving``, of the seeds. Scores of different chains are made comparable by what the
recordings tuned on say: by median and quartiles of their rows of motion, or by the threshold,
which few slips set.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.commands.tune import Settings, load, settings_of
from slip_detector.evaluation.replay import LabelledRows, Replay
from slip_detector.evaluation.scores import MOTION, ScoreTally
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.sets import read_yaml
from slip_detector.scenes import Scene, find_scene
from slip_detector.tuning.objective import Candidate, Objective
from slip_detector.tuning.problem import SEARCHED, Problem
from slip_detector.tuning.search import search
from slip_detector.tuning.sweep import Statistics
from slip_detector.tuning.tracks import Track, held_out, track_of
from slip_detector.tuning.verdict import Verdict, judge, pooled_figures

#: The paper's plates; a family plays each with each of its seeds.
PLATES = ('plate_400um', 'plate_440um', 'plate_480um')

TUNED_ON = range(900, 906)
REPORTED_ON = range(1000, 1010)

#: Of what is tuned on, so much is held out once more to judge what is handed back.
SHARE = 1 / 3

TRIALS = 200

#: Of each search on real recordings, one for each recording and seed.
REAL_TRIALS = 100

#: When something knocks and when the contact rolls: while the plate is held, before and after the
#: slide.
TAPS_S = (2.0, 2.6, 7.3, 8.0)
ROLLING_S = 6.6

FIGURES = (
    'slips',
    'recall',
    'false_alarms_per_minute',
    'latency_median_ms',
    'latency_median_all_ms',
)


def scenes() -> dict[str, list[dict[str, Any]]]:
    """Return the descriptions of the scenes of each family."""
    parts = {
        name: read_yaml(find_scene(name)) for name in (*PLATES, 'tremor_hum', 'taps', 'rolling')
    }
    plates = [parts[name] for name in PLATES]
    trembling = {name: parts['tremor_hum'][name] for name in ('tremor', 'hum')}
    knocking = {
        'taps': {**parts['taps']['taps'], 'times_s': list(TAPS_S)},
        'rolling': {**parts['rolling']['rolling'], 'start_s': ROLLING_S},
    }
    return {
        'plates': plates,
        'plates, tremor and hum': [{**plate, **trembling} for plate in plates],
        'taps and rolling between slips': [{**plate, **knocking} for plate in plates],
    }


def play(descriptions: Sequence[Mapping[str, Any]], seeds: Sequence[int]) -> list[Track]:
    """Play each scene once with each seed."""
    tracks = []
    for i, description in enumerate(descriptions):
        for seed in seeds:
            scene = Scene(description, np.random.default_rng(seed))
            samples = scene.read(round(60.0 * scene.sample_rate_hz))
            assert samples.truth is not None
            rows = LabelledRows(samples.volts, samples.truth)
            tracks.append(track_of(f'{PLATES[i]}, seed {seed}', [rows], scene.sample_rate_hz))
    return tracks


def searched(
    tracks: Sequence[Track], settings: Settings, trials: int, seed: int
) -> Candidate | None:
    """Search on all tracks, and return what would be handed back."""
    before = Objective(tracks, settings.evaluation, settings.tune).as_it_is(settings.chain)
    problem = Problem(
        list(tracks), settings.chain, before.figures, settings.evaluation, settings.tune
    )
    study = problem.study(None, 'in memory', seed)
    search(problem, study, trials, lambda: False, lambda count: None)
    return problem.choice(study)


def tuned(tracks: Sequence[Track], settings: Settings, trials: int, seed: int) -> Verdict:
    """Tune the whole way of ``slip_tune``, but for its files.

    A part is held out once more, and the given parameters are kept where the best is worse there.
    """
    training, held = held_out(tracks, SHARE)
    choice = searched(training, settings, trials, seed)
    problem = Problem(training, settings.chain, None, settings.evaluation, settings.tune)
    return judge(problem, held, choice)


def families(
    trials: int = TRIALS,
    tuned_on: Sequence[int] = TUNED_ON,
    reported_on: Sequence[int] = REPORTED_ON,
) -> dict[str, Any]:
    """Tune on each family of scenes and report on other seeds."""
    result = {}
    settings = Settings()
    for name, descriptions in scenes().items():
        verdict = tuned(play(descriptions, tuned_on), settings, trials, seed=0)
        tracks = play(descriptions, reported_on)
        both = {}
        for which, chain in (('given', settings.chain), ('tuned', verdict.chain)):
            replay = Replay(chain, settings.evaluation, scores=False, stages=False)
            whole = pooled_figures(
                [replay.run(track.rows(), track.sample_rate_hz) for track in tracks]
            )
            both[which] = {figure: whole[figure] for figure in FIGURES}
        parameters = verdict.chain.to_parameters()
        result[name] = {
            **both,
            'kept': verdict.kept,
            'better': all(
                _less(both['tuned'][figure], both['given'][figure])
                for figure in ('latency_median_all_ms', 'false_alarms_per_minute')
            ),
            'parameters': {parameter: parameters[parameter] for parameter in SEARCHED},
        }
    return result


def _less(a: float | None, b: float | None) -> bool:
    return a is not None and (b is None or a < b)


def real(
    folder: Path, config: Path, seeds: Sequence[int], trials: int = REAL_TRIALS
) -> dict[str, Any]:
    """Leave each recording of a folder out once, tune on the others, and score it.

    Raises
    ------
    ValueError
        When the recordings or the parameters cannot be read; names them.
    """
    settings = settings_of(str(config))
    tracks = load([str(folder)], settings).tracks
    by_seed = {}
    for seed in seeds:
        chains = []
        for track in tracks:
            others = [other for other in tracks if other is not track]
            choice = searched(others, settings, trials, seed)
            chains.append(settings.chain if choice is None else choice.chain)
        by_seed[str(seed)] = _pooled_auc(tracks, chains)
    given = _pooled_auc(tracks, [settings.chain] * len(tracks))
    return {
        'recordings': len(tracks),
        'trials': trials,
        'given': given,
        'seeds': by_seed,
        'least_auc_moving': min(one['auc_moving'] for one in by_seed.values()),
    }


def _pooled_auc(tracks: Sequence[Track], chains: Sequence[ChainConfig]) -> dict[str, float]:
    """Return the area of slip against motion of tracks, each with its chain."""
    by_motion, by_threshold = ScoreTally(), ScoreTally()
    for track, chain in zip(tracks, chains, strict=True):
        one_pass = Statistics(chain, [chain.vote])
        amplitudes = [one_pass.of(other)[chain.vote] ** (1.0 / chain.exponent) for other in tracks]
        moving = np.concatenate(
            [
                amplitude[other.kind == MOTION]
                for amplitude, other in zip(amplitudes, tracks, strict=True)
                if other is not track
            ]
        )
        own = next(a for a, other in zip(amplitudes, tracks, strict=True) if other is track)
        low, middle, high = np.quantile(moving, [0.25, 0.5, 0.75])
        by_motion.add((own / middle) ** (1.0 / np.log(high / low)), track.kind)
        by_threshold.add(own / chain.threshold ** (1.0 / chain.exponent), track.kind)
    return {
        'auc_moving': by_motion.take().auc([MOTION]) or 0.0,
        'auc_moving_by_threshold': by_threshold.take().auc([MOTION]) or 0.0,
    }
