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

"""What is learnt of knocks, without a search: the step that is an impact."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.recordings.rates import forward_filled
from slip_detector.tuning.tracks import Track, load_track, load_tracks

Floats = NDArray[np.float64]

#: A knock has a step above ``KNOCK`` times the noise: the step that ``NOISE_SHARE`` of all steps
#: stays below.
KNOCK = 4.0
NOISE_SHARE = 0.9

#: This share of the knocks must have steps at least this many times as large as those of slips.
KNOCK_SHARE = 0.9
LEAST_RATIO = 1.5

#: Longest pause between two large steps of one knock.
KNOCK_S = 0.5


def learn_from_taps(
    path: str, slips: Sequence[str], chain: ChainConfig, loader: RecordingLoader
) -> tuple[dict[str, Any], list[str]]:
    """Set the step that is an impact from a recording of knocks and labelled slips.

    Parameters
    ----------
    path
        The recording of knocks.
    slips
        Labelled recordings of slips, and folders of them.
    chain, loader
        As in :func:`.noise.learn_from_quiet`, and so is what is returned.

    Raises
    ------
    ValueError
        When a recording cannot be read, evidence does not decide, or the steps of knocks and slips
        are too similar.
    """
    if chain.decision != 'evidence':
        raise ValueError(
            f'parameter decision is {chain.decision}, allowed: evidence, which impact_v is for'
        )
    knocks, lines = load_track(path, loader)
    tracks, more_lines = load_tracks(slips, loader)
    impact_v, line = impact_step(chain, knocks, tracks)
    return {'impact_v': impact_v}, [*lines, *more_lines, f'{knocks.name}: {line}']


def steps_v(chain: ChainConfig, track: Track) -> Floats:
    """Return for each row the largest steps that 1, 2, ... channels reach at once.

    Parameters
    ----------
    chain
        Its ``disabled_channels`` and ``valid_range_v`` are used.
    track
        A recording of n rows.

    Returns
    -------
    ndarray, shape (n, enabled channels)
        0 in the first row of each stretch. A bad sample causes no step, as the last good one is
        held in its place.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = np.array([[0.0, 0.0, 0.0], [3.0, -2.0, 1.0], [3.0, -2.0, 3.0]])
    >>> track = track_of('a', [Samples.evenly(volts, 380.0, np.zeros(3, bool))], 380.0)
    >>> steps_v(ChainConfig(channels=3), track).tolist()
    [[0.0, 0.0, 0.0], [3.0, 2.0, 1.0], [2.0, 0.0, 0.0]]
    """
    low, high = chain.valid_range_v
    disabled = [channel - 1 for channel in chain.disabled_channels]
    volts = np.delete(track.volts, disabled, axis=1)
    found = np.zeros(volts.shape)
    for begin, end, _ in track.stretches:
        part = volts[begin:end]
        good = (part >= low) & (part <= high) & np.isfinite(part)
        steps = np.abs(np.diff(forward_filled(part, ~good), axis=0))
        found[begin + 1 : end] = np.sort(steps, axis=1)[:, ::-1]
    return found


def largest_slip_steps_v(chain: ChainConfig, tracks: Sequence[Track]) -> Floats:
    """Return the largest of :func:`steps_v` in rows with slip; shape (enabled channels,)."""
    steps = [
        steps_v(chain, track)[track.kinds == SLIP].max(axis=0, initial=0.0) for track in tracks
    ]
    return np.asarray(np.max(steps, axis=0))


def knocks_v(chain: ChainConfig, track: Track) -> Floats:
    """Return the largest step of each knock that ``impact_channels`` channels reach at once.

    A knock begins with a step above :data:`KNOCK` times the noise. Further such steps that follow
    within :data:`KNOCK_S` of each other belong to it.
    """
    every = steps_v(chain, track)
    steps = every[:, min(chain.impact_channels, every.shape[1]) - 1]
    # Where the samples seldom change, the noise is the smallest step of the converter.
    least_v = steps[steps > 0.0].min(initial=np.inf)
    loud = np.flatnonzero(steps > KNOCK * max(np.quantile(steps, NOISE_SHARE), least_v))
    breaks = np.flatnonzero(np.diff(loud) > KNOCK_S * track.sample_rate_hz) + 1
    return np.array([steps[knock].max() for knock in np.split(loud, breaks) if knock.size])


def impact_step(chain: ChainConfig, knocks: Track, tracks: Sequence[Track]) -> tuple[float, str]:
    """Return an ``impact_v`` between the steps of slips and those of knocks, and a line about it.

    It is the geometric mean of the largest step of the slips and the step that :data:`KNOCK_SHARE`
    of the knocks exceed.

    Parameters
    ----------
    chain
        See :func:`knocks_v`.
    knocks
        A recording of knocks.
    tracks
        Labelled recordings of slips.

    Raises
    ------
    ValueError
        When there are no knocks or no slips, or their steps are too similar; gives the numbers.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> noise = np.random.default_rng(0).normal(0.0, 0.01, (2000, 2))
    >>> slips = track_of('slips', [Samples.evenly(noise, 380.0, np.ones(2000, bool))], 380.0)
    >>> noise[300::500] += 1.0
    >>> knocks = track_of('knocks', [Samples.evenly(noise, 380.0, np.zeros(2000, bool))], 380.0)
    >>> impact_v, line = impact_step(ChainConfig(channels=2), knocks, [slips])
    >>> 0.05 < impact_v < 1.0, '90 % of 4 knocks have a step above 0.9' in line
    (True, True)
    """
    of_knocks, of_slips = knocks_v(chain, knocks), largest_slip_steps_v(chain, tracks)
    slip_v = float(of_slips[min(chain.impact_channels, of_slips.size) - 1])
    knock_v = float(np.quantile(of_knocks, 1.0 - KNOCK_SHARE)) if of_knocks.size else 0.0
    numbers = (
        f'{KNOCK_SHARE * 100:.0f} % of {of_knocks.size} knocks have a step above {knock_v:.4g} V, '
        f'slips of up to {slip_v:.4g} V'
    )
    if not slip_v or knock_v < LEAST_RATIO * slip_v:
        raise ValueError(
            f'{knocks.name}: its knocks cannot be told from slips: {numbers}, allowed: '
            f'{LEAST_RATIO:g} times as much, and steps of both'
        )
    impact_v = float(f'{math.sqrt(slip_v * knock_v):.4g}')
    return impact_v, f'impact_v {impact_v:g} V: {numbers}'
