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

"""Delay and false time of ``config/onset.yaml``, beside ``config/sure.yaml`` and the paper's.

All scenes are simulated with seeds that the configurations were not chosen on.
:func:`measure_onset` gives the figures of ``config/onset.yaml``, and under ``sure`` and ``paper``
the same figures of ``config/sure.yaml`` and of the paper's parameters:

``mean_delay_ms``, ``worst_delay_ms``
    Delay of ``slip`` on the paper's plates, the mean of all slides and the largest: from the first
    row of the slip to the alarm that begins in it. A slip before which ``slip`` was ON has none.
``detected_percent``
    Share of the slides over the plates that have such an alarm.
``false_time_percent``
    Share of the time in which a plate does not slide, nor has slid just before (``tail_s`` of
    ``slip_evaluate``), in which ``slip`` is ON.
``taps_percent``, ``rolling_percent``, ``tremor_hum_percent``
    ``false_time_percent`` of the scenes of these names, in which nothing slides.
``fast_detected_percent``
    ``detected_percent`` of the slides at 40 and 80 mm/s.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from benchmarks.paper.protocol import SCENES
from benchmarks.tune.families import play_scenes
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import ChainConfig, read_yaml, shared_folder
from slip_detector.scenes import find_scene
from slip_detector.tuning.tracks import Track

#: Seeds other than those that the configuration was chosen on.
SEEDS = range(5000, 5030)

FAST = ('fast_40mm_s', 'fast_80mm_s')
WITHOUT_SLIP = ('taps', 'rolling', 'tremor_hum')


def simulate(seeds: Sequence[int]) -> dict[str, list[Track]]:
    """Play each of the scenes once with each seed; return them by name of the scene."""
    names = (*SCENES.values(), *FAST, *WITHOUT_SLIP)
    return {name: play_scenes([read_yaml(find_scene(name))], seeds) for name in names}


def onset_figures(tracks: dict[str, list[Track]], chain: ChainConfig) -> dict[str, Any]:
    """Return the figures of one chain; the keys are in the module's docstring.

    Parameters
    ----------
    tracks
        Result of :func:`simulate`.
    chain
        The parameters of the chain.
    """
    replay = Replay(chain)
    outcomes = {
        name: [replay.run(track.rows(), track.sample_rate_hz) for track in several]
        for name, several in tracks.items()
    }
    plates, fast = (
        [one for name in names for one in outcomes[name]] for names in (SCENES.values(), FAST)
    )
    slides = figures_of_merit(plates)
    found = [slip.latency_s for one in plates for slip in one.slips if slip.latency_s is not None]
    return {
        # Rounded: the mean of whole rows is off by the last bit.
        'mean_delay_ms': round(float(np.mean(found)) * 1e3, 9) if found else None,
        'worst_delay_ms': slides['latency_worst_ms'],
        'detected_percent': 100 * slides['recall'],
        'false_time_percent': slides['false_time_percent'],
        **{
            f'{name}_percent': figures_of_merit(outcomes[name])['false_time_percent']
            for name in WITHOUT_SLIP
        },
        'fast_detected_percent': 100 * figures_of_merit(fast)['recall'],
    }


def measure_onset(seeds: Sequence[int] = SEEDS) -> dict[str, Any]:
    """Measure the two configurations and the paper's parameters on the same scenes.

    Parameters
    ----------
    seeds
        Seeds of the scenes; each scene is played with each.

    Returns
    -------
    dict
        The keys are in the module's docstring.
    """
    tracks = simulate(seeds)
    folder = shared_folder() / 'config'
    onset, sure = (ChainConfig.from_yaml(folder / f'{name}.yaml') for name in ('onset', 'sure'))
    return {
        **onset_figures(tracks, onset),
        'sure': onset_figures(tracks, sure),
        'paper': onset_figures(tracks, ChainConfig()),
    }
