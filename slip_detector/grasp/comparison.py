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
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.evaluation.figures import Bound
from slip_detector.grasp.loop import GraspTrial
from slip_detector.parameters import ChainConfig, GraspConfig

#: The conditions: no controller, a grip that is always at the limit, the controller, and the
#: controller with the paper's parameters for the detector.
UNCONTROLLED, AT_LIMIT = 'no controller', 'always at the limit'
CONTROLLER, PAPER = 'controller', "controller, paper's detector"

#: Conditions that are harder for the controller, as factors of :func:`.object_scene`.
HARDER: dict[str, dict[str, float]] = {
    'gripper with 60 ms of lag': {'lag_factor': 2.0},
    'ridges half as high': {'ridge_factor': 0.5},
    'ridges a quarter as high': {'ridge_factor': 0.25},
}

#: Bounds of the controller's figures, in the ordinary condition and in harder ones.
WANTED: dict[str, dict[str, Bound]] = {
    CONTROLLER: {
        'dropped': Bound(high=0.0),
        'mean_slide_mm': Bound(high=0.2),
        'worst_slide_mm': Bound(high=0.6),
        'force_percent': Bound(high=43.0),
    },
    'gripper with 60 ms of lag': {
        'mean_slide_mm': Bound(high=0.5, strict=True),
        'worst_slide_mm': Bound(high=3.5, strict=True),
    },
    'ridges half as high': {'worst_slide_mm': Bound(high=1.0, strict=True)},
    'ridges a quarter as high': {'worst_slide_mm': Bound(high=2.1, strict=True)},
}

#: Longest time, in seconds, from an onset to a raise of the grip that counts as the answer to it.
ANSWER_S = 0.05


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


class LiveGraspTrial(NamedTuple):
    """The messages received in one grasp; times are stamps, relative to the first sample.

    ``position`` has times and the distance that the object has slid in metres, shape (n, 2);
    ``command`` times and the commanded grip forces in newtons, shape (m, 2); ``onset_s`` are the
    times of the samples on which slip came on.
    """

    position: Floats
    command: Floats
    onset_s: Floats

    def command_n(self, time_s: Floats) -> Floats:
        """Return the latest commanded grip force at each time."""
        last = np.searchsorted(self.command[:, 0], time_s, side='right') - 1
        return np.asarray(self.command[np.maximum(last, 0), 1])

    def latencies_s(self) -> list[float]:
        """Return the time from the sample of each onset to the command that answered it.

        An onset during which the last raise still takes effect has no answer and is left out.
        """
        raised_s = self.command[1:, 0][np.diff(self.command[:, 1]) > 0.0]
        answers = [raised_s[raised_s > onset_s][:1] - onset_s for onset_s in self.onset_s]
        return [float(answer[0]) for answer in answers if answer.size and answer[0] < ANSWER_S]


def live_figures(
    heard: Mapping[int, LiveGraspTrial], trials: Sequence[GraspTrial], limit_n: float
) -> dict[str, Any]:
    """Return ``nodes`` and ``latency_ms``; ``trials`` are the same seeds in simulated time."""

    def figures(trial: GraspTrial) -> dict[str, Any]:
        command_percent = 100.0 * trial.mean_n(trial.command_n) / limit_n
        return {'slide_mm': trial.slide_mm, 'command_percent': command_percent}

    nodes = {}
    for (seed, live), trial in zip(heard.items(), trials, strict=True):
        command_n = live.command_n(trial.time_s)
        played = trial._replace(position_m=live.position[:, 1], command_n=command_n)
        nodes[str(seed)] = {**figures(played), 'simulated': figures(trial)}
    all_ms = [1e3 * latency_s for live in heard.values() for latency_s in live.latencies_s()]
    latency_ms = {'median': float(np.median(all_ms)), 'most': max(all_ms)} if all_ms else None
    return {'nodes': nodes, 'latency_ms': latency_ms}
