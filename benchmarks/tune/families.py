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

"""What tuning brings on families of simulated scenes.

:func:`measure_families` gives, ``by_name`` of the family, ``given`` and ``tuned``, the
figures of both chains on scenes with seeds that the search has not seen (:data:`FIGURES`, see
:meth:`.Events.at`; in ``latency_median_all_ms`` a missed slip counts as later than any other);
``kept``: why the given parameters were kept, else empty; ``better``: whether
``latency_median_all_ms``, ``false_time_percent`` and ``recall`` are all three better, or as good
as they can be; and ``parameters``: the tuned values of the parameters that are searched. Beside
``by_name`` is how many families are ``better``.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import ChainConfig, read_yaml
from slip_detector.scenes import Scene, find_scene
from slip_detector.tuning.problem import searched_parameters
from slip_detector.tuning.search import Study, search
from slip_detector.tuning.tracks import Track, hold_out_tracks, track_of
from slip_detector.tuning.verdict import TuningParameters, choose, judge

#: The paper's plates; each is a scene of a family, with each seed.
PLATES = ('plate_400um', 'plate_440um', 'plate_480um')

TUNED_ON, REPORTED_ON = range(6800, 6806), range(6900, 6910)

#: Times of taps and rolling: while the plate is held, before and after the slide.
TAPS_S = (2.0, 2.6, 7.3, 8.0)
ROLLING_S = 6.6

#: Drift of a baseline in a second, in addition to 0.5 mV of noise.
DRIFT_V = 0.01

#: Steps of a plate that slide, and the hold after; the step of ``press`` that first lifts off.
SLIDE, LIFT_OFF = slice(3, 6), 7

FIGURES = (
    'slips', 'recall', 'sooner_than_chance', 'false_alarms_per_minute', 'false_time_percent',
    'latency_median_ms', 'latency_median_all_ms',
)  # fmt: skip


def disturbances() -> dict[str, dict[str, Any]]:
    """Return the parts that each family adds to a plate, by its name."""
    tremor_hum, taps, rolling, press = (
        read_yaml(find_scene(name)) for name in ('tremor_hum', 'taps', 'rolling', 'press')
    )
    trembling = {name: tremor_hum[name] for name in ('tremor', 'hum')}
    tapping = {'taps': {**taps['taps'], 'times_s': list(TAPS_S)}}
    knocking = {**tapping, 'rolling': {**rolling['rolling'], 'start_s': ROLLING_S}}
    drifting = {'electronics': {'drift_v': DRIFT_V}}
    return {
        'plates': {},
        'plates, tremor and hum': trembling,
        'taps and rolling between slips': knocking,
        'tremor, hum, taps and drift': {**trembling, **tapping, **drifting},
        'presses': {name: press[name] for name in ('tremor', 'contact_noise')},
    }


def families() -> dict[str, list[dict[str, Any]]]:
    """Return the descriptions of the scenes of each family, by its name.

    One in which nothing slides has its ``kind``, which is none of a scene's parts.
    """
    plates = [read_yaml(find_scene(name)) for name in PLATES]
    added = disturbances().items()
    scenes = {name: [{**plate, **parts} for plate in plates] for name, parts in added}
    # A finger is pressed and squeezed, slides while it is still pressed, is lifted off, and so on.
    press, slide = read_yaml(find_scene('press')), plates[0]['steps'][SLIDE]
    for plate in scenes['presses']:
        plate['steps'] = [*press['steps'][:LIFT_OFF], *slide, *press['steps'][LIFT_OFF:]]
        plate['taps'] = {}
    scenes['presses'].append({**press, 'kind': 'press'})
    return scenes


def play_scenes(descriptions: Sequence[Mapping[str, Any]], seeds: Sequence[int]) -> list[Track]:
    """Play each scene once with each seed."""
    tracks = []
    for i, description in enumerate(descriptions):
        for seed in seeds:
            parts = {name: part for name, part in description.items() if name != 'kind'}
            scene = Scene(parts, np.random.default_rng(seed))
            rows = scene.read(scene.length)._replace(kind=description.get('kind', ''))
            tracks.append(track_of(f'scene {i}, seed {seed}', [rows], scene.sample_rate_hz))
    return tracks


def figures_on(tracks: Sequence[Track], chain: ChainConfig) -> dict[str, Any]:
    """Return the :data:`FIGURES` of a chain on tracks."""
    replay = Replay(chain)
    whole = figures_of_merit([replay.run(track.rows(), track.sample_rate_hz) for track in tracks])
    return {figure: whole[figure] for figure in FIGURES}


def measure_families(
    trials: int = 200,
    tuned_on: Sequence[int] = TUNED_ON,
    reported_on: Sequence[int] = REPORTED_ON,
    seed: int = 0,
) -> dict[str, Any]:
    """Tune on each family of scenes; the keys are in the module's docstring.

    Parameters
    ----------
    trials
        Number of trials of each search.
    tuned_on, reported_on
        Seeds of the scenes for the search and for the figures.
    seed
        Seed of the searches.
    """
    result = {}
    parameters = TuningParameters()
    for name, descriptions in families().items():
        # As slip_tune does: the search has a part of the tracks, the rest judges.
        training, held = hold_out_tracks(play_scenes(descriptions, tuned_on))
        problem = parameters.problem(training)
        study = Study(problem, seed=seed)
        search(study, trials)
        verdict = judge(problem, parameters.chain, held, choose(study))
        tracks = play_scenes(descriptions, reported_on)
        given, tuned = (figures_on(tracks, one) for one in (parameters.chain, verdict.chain))
        result[name] = {
            'given': given,
            'tuned': tuned,
            'kept': verdict.kept,
            'better': is_better(tuned, given),
            'parameters': searched_parameters(verdict.chain),
        }
    return {'by_name': result, 'better': sum(one['better'] for one in result.values())}


def is_better(tuned: Mapping[str, Any], given: Mapping[str, Any]) -> bool:
    """Return whether latency of all slips, time ON without slip and recall are all better.

    A recall of 1 and a time of 0 cannot be better.

    Examples
    --------
    >>> given = {'latency_median_all_ms': 37.0, 'false_time_percent': 0.0, 'recall': 0.9}
    >>> is_better({**given, 'latency_median_all_ms': 20.0, 'recall': 1.0}, given)
    True
    >>> is_better({**given, 'latency_median_all_ms': 20.0}, given)
    False
    """
    # None, which is not defined, becomes NaN: the chain misses most slips.
    latencies_ms = [figures['latency_median_all_ms'] for figures in (given, tuned)]
    late, soon = np.nan_to_num(np.array(latencies_ms, np.float64), nan=np.inf)
    less_on = tuned['false_time_percent'] < given['false_time_percent']
    more_found = tuned['recall'] > given['recall']
    quiet = less_on or tuned['false_time_percent'] == 0.0
    return bool(soon < late and quiet and (more_found or tuned['recall'] == 1.0))
