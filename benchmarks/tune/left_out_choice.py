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

"""How much a configuration owes to having been chosen on the recordings that it is scored on.

:func:`measure_left_out_choice` tries settings near the given ones. For each recording it takes
the setting that is best on the others, with the threshold that costs least there, and scores the
recording with it. It gives ``settings``, their number, and the median over them of
``auc_moving`` (area under the ROC curve of slip against motion, all recordings together); and, of
the recordings scored in this way, ``auc_moving`` and the figures of events in ``FIGURES``.
``given`` has the same figures of the given parameters.
"""

import dataclasses
import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from slip_detector.evaluation.figures import ReplayOutcome, figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.evaluation.scores import MOTION, ScoreCounts
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.objective import Objective
from slip_detector.tuning.search import TuningParameters
from slip_detector.tuning.tracks import Track

#: Factors of the given values; all combinations are tried.
FACTORS = {
    'noise_floor': (5 / 6, 1.0, 7 / 6, 4 / 3, 5 / 3),
    'envelope_window_s': (1.0, 1.4, 2.0),
    'evidence_offset_db': (1.0, 10 / 7),
    'evidence_limit_db_s': (1.0, 22 / 13),
    'vote': (0.75, 1.0, 1.25),
}

FIGURES = (
    'slips',
    'settling_slips',
    'matched',
    'false_alarms',
    'false_time_percent',
    'recall',
    'recall_by_chance',
    'sooner_than_chance',
    'latency_median_all_ms',
)


def settings_beside(chain: ChainConfig) -> list[ChainConfig]:
    """Return the chains whose values are the given ones times :data:`FACTORS`.

    Examples
    --------
    >>> chain = ChainConfig(decision='evidence', noise_floor=(1e-3,), vote='all')
    >>> settings = settings_beside(chain)  # five floors, three windows, two offsets, two limits
    >>> len(settings), chain in settings
    (60, True)
    """
    disabled = set(chain.disabled_channels)
    able = min(len(set(members) - disabled) for members in chain.groups.values())

    def times(name: str, factor: float) -> Any:
        value = getattr(chain, name)
        if name == 'noise_floor':
            return tuple(factor * floor for floor in value)
        if name == 'vote':
            return min(round(factor * value), able) if isinstance(value, int) else value
        return factor * value

    values = [
        dict.fromkeys(times(name, factor) for factor in factors)
        for name, factors in FACTORS.items()
    ]
    return [
        dataclasses.replace(chain, **dict(zip(FACTORS, setting, strict=True)))
        for setting in itertools.product(*values)
    ]


def measure_left_out_choice(
    tracks: Sequence[Track], parameters: TuningParameters
) -> dict[str, Any]:
    """Choose the setting for each recording on the others.

    Parameters
    ----------
    tracks
        Labelled recordings with motion; at least two with slip.
    parameters
        The given parameters, which decide by evidence.

    Returns
    -------
    dict
        The keys are in the module's docstring.
    """
    settings = settings_beside(parameters.chain)
    # All settings have the given threshold, so that their scores have the same unit.
    scores = [
        [_replayed(chain, track, parameters).scores for track in tracks] for chain in settings
    ]
    of_chosen, outcomes = [], []
    for out, track in enumerate(tracks):
        others = [k for k in range(len(tracks)) if k != out]
        areas = [_auc_moving(of_tracks[k] for k in others) for of_tracks in scores]
        best = int(np.argmax(areas))
        of_chosen.append(scores[best][out])
        objective = Objective([tracks[k] for k in others], parameters.evaluation, parameters.tune)
        chosen = settings[best]
        candidates = {one.chain.vote: one.chain for one in objective.best(chosen)}
        outcomes.append(_replayed(candidates.get(chosen.vote, chosen), track, parameters))
    as_given = [_replayed(parameters.chain, track, parameters) for track in tracks]
    return {
        'settings': len(settings),
        'median_auc_moving': float(np.median([_auc_moving(one) for one in scores])),
        'auc_moving': _auc_moving(of_chosen),
        **_of_events(outcomes),
        'given': {
            'auc_moving': _auc_moving(one.scores for one in as_given),
            **_of_events(as_given),
        },
    }


def _replayed(chain: ChainConfig, track: Track, parameters: TuningParameters) -> ReplayOutcome:
    replay = Replay(chain, parameters.evaluation, stages=False)
    return replay.run(track.rows(), track.sample_rate_hz)


def _auc_moving(parts: Iterable[ScoreCounts | None]) -> float:
    pooled = ScoreCounts.pooled(part for part in parts if part is not None)
    return pooled.auc([MOTION]) or 0.0


def _of_events(outcomes: Sequence[ReplayOutcome]) -> dict[str, Any]:
    figures = figures_of_merit(outcomes)
    return {name: figures[name] for name in FIGURES}
