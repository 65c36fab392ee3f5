"""What tuning brings on real recordings, each left out of its own search.

:func:`measure_real_recordings` leaves each recording out of one search and scores it with the
chain found there. It gives ``recordings``, how many; ``trials`` of a search; the area under the
ROC curve of slip against motion over all recordings: ``given``, without tuning, and by the seed
of the searches in ``seeds``, each ``auc_moving`` and ``auc_moving_by_threshold``; and
``least_auc_moving``, of the seeds. Scores of different chains are made comparable by the
recordings tuned on: by median and quartiles of their rows of motion, or by the threshold, which
few slips set.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tune.families import search_candidate
from slip_detector.commands.tune import tuning_parameters_of
from slip_detector.evaluation.labelled_rows import MOTION
from slip_detector.evaluation.scores import ScoreTally
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.loading import load_tracks
from slip_detector.tuning.sweep import VoteStatistics
from slip_detector.tuning.tracks import Track

#: Of each search; there is one for each recording and seed.
TRIALS = 100


def measure_real_recordings(
    folder: Path, config: Path, seeds: Sequence[int], trials: int = TRIALS
) -> dict[str, Any]:
    """Leave each recording out once, tune on the others, and score it.

    Parameters
    ----------
    folder
        Labelled recordings.
    config
        A file of the parameters to begin with.
    seeds
        Of the searches.
    trials
        Of each search.

    Returns
    -------
    dict
        The keys are in the module's docstring.

    Raises
    ------
    ValueError
        When the recordings or the parameters cannot be read; names them.
    """
    parameters = tuning_parameters_of(str(config))
    tracks = load_tracks([str(folder)], parameters.loader)[0]
    by_seed = {}
    for seed in seeds:
        chains = []
        for track in tracks:
            others = [other for other in tracks if other is not track]
            choice = search_candidate(others, parameters, trials, seed)
            chains.append(parameters.chain if choice is None else choice.chain)
        by_seed[str(seed)] = _pooled_auc(tracks, chains)
    given = _pooled_auc(tracks, [parameters.chain] * len(tracks))
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
        one_pass = VoteStatistics(chain, [chain.vote])
        amplitudes = [one_pass.of(other)[0] ** (1.0 / chain.exponent) for other in tracks]
        moving = np.concatenate(
            [
                amplitude[other.kinds == MOTION]
                for amplitude, other in zip(amplitudes, tracks, strict=True)
                if other is not track
            ]
        )
        own = next(a for a, other in zip(amplitudes, tracks, strict=True) if other is track)
        low, middle, high = np.quantile(moving, [0.25, 0.5, 0.75])
        by_motion.add((own / middle) ** (1.0 / np.log(high / low)), track.kinds)
        by_threshold.add(own / chain.threshold ** (1.0 / chain.exponent), track.kinds)
    return {
        'auc_moving': by_motion.take().auc([MOTION]) or 0.0,
        'auc_moving_by_threshold': by_threshold.take().auc([MOTION]) or 0.0,
    }
