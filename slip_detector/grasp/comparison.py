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

"""The conditions under which grasps are compared, their figures of merit, and the wanted ones."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slip_detector.evaluation.figures import Bound
from slip_detector.grasp.loop import GraspTrial
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig

#: The conditions: no controller, a grip that is always at the limit, the controller, and the
#: controller with the paper's parameters for the detector.
UNCONTROLLED, AT_LIMIT, CONTROLLER, PAPER = (
    'no controller',
    'always at the limit',
    'controller',
    "controller, paper's detector",
)

#: Conditions that are harder for the controller, as factors of :func:`.object_scene`.
SLOW_GRIPPER, HALF_RIDGES, QUARTER_RIDGES = (
    'gripper with 60 ms of lag',
    'ridges half as high',
    'ridges a quarter as high',
)
HARDER: dict[str, dict[str, float]] = {
    SLOW_GRIPPER: {'lag_factor': 2.0},
    HALF_RIDGES: {'ridge_factor': 0.5},
    QUARTER_RIDGES: {'ridge_factor': 0.25},
}

#: Bounds of the controller's figures, in the ordinary condition and in harder ones.
WANTED: dict[str, dict[str, Bound]] = {
    CONTROLLER: {
        'dropped': Bound(high=0.0),
        'mean_slide_mm': Bound(high=0.2),
        'worst_slide_mm': Bound(high=0.6),
        'force_percent': Bound(high=43.0),
    },
    SLOW_GRIPPER: {
        'mean_slide_mm': Bound(high=0.5, strict=True),
        'worst_slide_mm': Bound(high=3.5, strict=True),
    },
    HALF_RIDGES: {'worst_slide_mm': Bound(high=1.0, strict=True)},
    QUARTER_RIDGES: {'worst_slide_mm': Bound(high=2.1, strict=True)},
}


def conditions(
    chain: ChainConfig, grasp: GraspConfig
) -> dict[str, tuple[ChainConfig, GraspConfig]]:
    """Return the parameters of detector and controller under each condition, by its name.

    Examples
    --------
    >>> list(conditions(ChainConfig(), GraspConfig()))  # doctest: +NORMALIZE_WHITESPACE
    ['no controller', 'always at the limit', 'controller', "controller, paper's detector"]
    """
    paper = ChainConfig(sample_rate_hz=chain.sample_rate_hz)
    return {
        UNCONTROLLED: (chain, dataclasses.replace(grasp, limit_n=grasp.grip_n)),
        AT_LIMIT: (chain, dataclasses.replace(grasp, grip_n=grasp.limit_n)),
        CONTROLLER: (chain, grasp),
        PAPER: (paper, grasp),
    }


def grasp_figures(trials: Sequence[GraspTrial], limit_n: float) -> dict[str, Any]:
    """Return the figures of merit of some trials.

    Parameters
    ----------
    trials
        At least one.
    limit_n
        Grip that the forces are compared with.

    Returns
    -------
    dict
        The number of ``trials`` and of ``dropped`` objects; ``slide_mm`` of each trial,
        ``mean_slide_mm`` and ``worst_slide_mm``, None where an object was dropped;
        ``force_percent``, the mean grip as a share of the limit while the object has to be held,
        and ``most_force_percent``, the largest of any trial; ``needed_percent``, the same mean of
        the smallest grip that would hold the object; ``onsets``, the mean number of onsets while
        the object has to be held.

    Examples
    --------
    >>> time_s, none = np.arange(4) / 380.0, np.zeros(4, bool)
    >>> force_n, slid_m = np.full(4, 5.0), np.array([0.0, 0.0, 1e-3, 1e-3])
    >>> trial = GraspTrial(time_s, force_n, force_n, none, none, slid_m, 0.8 * force_n, 0.1)
    >>> figures = grasp_figures([trial], limit_n=10.0)
    >>> figures['worst_slide_mm'], figures['force_percent'], figures['needed_percent']
    (1.0, 50.0, 40.0)
    """
    slides_mm = [trial.slide_mm for trial in trials]
    known = [slide_mm for slide_mm in slides_mm if slide_mm is not None]
    all_known = len(known) == len(trials)
    shares = [100.0 * trial.mean_n(trial.force_n) / limit_n for trial in trials]
    needed = [100.0 * trial.mean_n(trial.needed_n) / limit_n for trial in trials]
    return {
        'trials': len(trials),
        'dropped': sum(trial.dropped for trial in trials),
        'slide_mm': slides_mm,
        'mean_slide_mm': float(np.mean(known)) if all_known else None,
        'worst_slide_mm': max(known) if all_known else None,
        'force_percent': float(np.mean(shares)),
        'most_force_percent': max(shares),
        'needed_percent': float(np.mean(needed)),
        'onsets': float(np.mean([len(trial.onsets_s) for trial in trials])),
    }


def check_wanted(parts: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Compare the controller's figures with their bounds in :data:`WANTED`.

    Parameters
    ----------
    parts
        The figures of :func:`grasp_figures` under each condition in :data:`WANTED`.

    Returns
    -------
    dict
        For each condition, and each of its figures in :data:`WANTED`: the ``value``, the ``bound``
        as text and whether it is ``met``; a value that is not defined does not meet it.

    Examples
    --------
    >>> found = {'dropped': 0, 'mean_slide_mm': 0.1, 'worst_slide_mm': 0.9, 'force_percent': 42.0}
    >>> wanted = check_wanted(dict.fromkeys(WANTED, found))
    >>> [name for name, entry in wanted[CONTROLLER].items() if not entry['met']]
    ['worst_slide_mm']
    """
    return {
        condition: {name: bound.verdict(parts[condition][name]) for name, bound in bounds.items()}
        for condition, bounds in WANTED.items()
    }
