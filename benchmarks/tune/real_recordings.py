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

"""What tuning brings on real recordings, each of which is left out of one search in turn.

:func:`measure_real_recordings` scores each recording with the chain that a search on the others
has found. It gives ``recordings``, their number; ``trials`` of a search; the area under the ROC
curve of slip against motion over all recordings, as ``auc_moving`` and
``auc_moving_by_threshold``: in ``given`` without tuning, and in ``seeds`` by the seed of the
searches; and ``least_auc_moving`` of all seeds. The recordings tuned on make the scores of
different chains comparable: ``auc_moving`` scales them by the median and the quartiles of the rows
of motion, ``auc_moving_by_threshold`` by the threshold, which depends on a few slips. Evidence is
0 in most rows of motion; if a quartile is 0, both scale by the threshold. If the given
parameters decide by evidence, ``choice`` has the figures of
:mod:`benchmarks.tune.left_out_choice`, otherwise it is None.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tune.families import search_candidate
from benchmarks.tune.left_out_choice import measure_left_out_choice
from slip_detector.evaluation.scores import MOTION, ScoreTally
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.search import tuning_parameters_of
from slip_detector.tuning.sweep import VoteStatistics, threshold_scale
from slip_detector.tuning.tracks import Track, load_tracks

#: Trials of each search; there is a search for each recording and seed.
TRIALS = 100


def measure_real_recordings(
    folder: Path, config: Path, seeds: Sequence[int], trials: int = TRIALS
) -> dict[str, Any]:
    """Leave each recording out once, tune on the others, and score it.

    Parameters
    ----------
    folder
        Folder of labelled recordings.
    config
        File of the parameters that are tuned.
    seeds
        Seeds of the searches.
    trials
        Number of trials of each search.

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
    evidence = parameters.chain.decision == 'evidence'
    return {
        'recordings': len(tracks),
        'trials': trials,
        'given': given,
        'seeds': by_seed,
        'least_auc_moving': min(one['auc_moving'] for one in by_seed.values()),
        'choice': measure_left_out_choice(tracks, parameters) if evidence else None,
    }


def _pooled_auc(tracks: Sequence[Track], chains: Sequence[ChainConfig]) -> dict[str, float]:
    """Return the areas under the ROC curve of slip against motion over all tracks."""
    by_motion, by_threshold = ScoreTally(), ScoreTally()
    for track, chain in zip(tracks, chains, strict=True):
        one_pass = VoteStatistics(chain, [chain.vote])
        exponent, _ = threshold_scale(chain)
        amplitudes = [one_pass.of(other)[0] ** (1.0 / exponent) for other in tracks]
        moving = np.concatenate(
            [
                amplitude[other.kinds == MOTION]
                for amplitude, other in zip(amplitudes, tracks, strict=True)
                if other is not track
            ]
        )
        own = next(a for a, other in zip(amplitudes, tracks, strict=True) if other is track)
        low, middle, high = np.quantile(moving, [0.25, 0.5, 0.75])
        at_threshold = own / chain.threshold ** (1.0 / exponent)
        scaled = at_threshold
        if 0.0 < low < high:
            scaled = (own / middle) ** (1.0 / np.log(high / low))
        by_motion.add(scaled, track.kinds)
        by_threshold.add(at_threshold, track.kinds)
    return {
        'auc_moving': by_motion.take().auc([MOTION]) or 0.0,
        'auc_moving_by_threshold': by_threshold.take().auc([MOTION]) or 0.0,
    }
