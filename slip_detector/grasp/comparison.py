"""What the controller is compared with, the figures of merit, and what they have to be."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slip_detector.grasp.loop import GraspTrial
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig

#: What is compared: no controller, a grip that is always at the limit, the controller, and the
#: controller with a detector that has the paper's parameters.
UNCONTROLLED, AT_LIMIT, CONTROLLER, PAPER = (
    'no controller',
    'always at the limit',
    'controller',
    "controller, paper's detector",
)

#: What the controller has to stay below, and what it is in words.
WANTED = {
    'dropped': (1, 'objects dropped'),
    'worst_slide_mm': (5.0, 'worst slide [mm]'),
    'mean_slide_mm': (2.0, 'mean slide [mm]'),
    'force_percent': (60.0, 'mean grip [% of the limit]'),
}


def conditions(
    chain: ChainConfig, grasp: GraspConfig
) -> dict[str, tuple[ChainConfig, GraspConfig]]:
    """Return what is compared, by its name: the detector's and the controller's parameters.

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
        ``trials``, ``dropped``; ``slide_mm`` of each, and their ``mean_slide_mm`` and
        ``worst_slide_mm``, None where an object was dropped; ``force_percent``, the mean grip
        while the object has to be held as a share of the limit, and ``most_force_percent``, that
        of the trial with the most; ``needed_percent``, the same of a grip that knows weight and
        friction and is always just enough; ``onsets``, the mean number of onsets from when the
        object has to be held.
    """
    slides_m = [trial.slide_m for trial in trials]
    slides_mm = [None if slide_m is None else slide_m * 1e3 for slide_m in slides_m]
    known = [slide_mm for slide_mm in slides_mm if slide_mm is not None]
    all_known = len(known) == len(trials)
    shares = [100.0 * trial.mean_n(trial.force_n) / limit_n for trial in trials]
    needed = [100.0 * trial.mean_n(trial.needed_n) / limit_n for trial in trials]
    lifted_s = [trial.time_s[np.argmax(trial.needed_n > 0.0)] for trial in trials]
    return {
        'trials': len(trials),
        'dropped': sum(trial.dropped for trial in trials),
        'slide_mm': slides_mm,
        'mean_slide_mm': float(np.mean(known)) if all_known else None,
        'worst_slide_mm': max(known) if all_known else None,
        'force_percent': float(np.mean(shares)),
        'most_force_percent': max(shares),
        'needed_percent': float(np.mean(needed)),
        'onsets': float(
            np.mean(
                [
                    np.count_nonzero(trial.onsets_s >= begin_s)
                    for trial, begin_s in zip(trials, lifted_s, strict=True)
                ]
            )
        ),
    }


def check_wanted(controller: Mapping[str, Any]) -> dict[str, Any]:
    """Hold the controller's figures against what is wanted; what is not defined is not met.

    Parameters
    ----------
    controller
        Of :func:`grasp_figures`.

    Returns
    -------
    dict
        By the names of :data:`WANTED`: the ``value``, what it has to stay ``below``, and whether
        that is ``met``.

    Examples
    --------
    >>> figures = {'dropped': 0, 'worst_slide_mm': 0.9, 'mean_slide_mm': 0.4, 'force_percent': 70}
    >>> [name for name, entry in check_wanted(figures).items() if not entry['met']]
    ['force_percent']
    """
    found = {}
    for name, (below, _) in WANTED.items():
        value = controller[name]
        found[name] = {'value': value, 'below': below, 'met': value is not None and value < below}
    return found
