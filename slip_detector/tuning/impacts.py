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

"""Finds from which size on a step from one sample to the next is a knock and not a slip."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.evaluation.labelled_rows import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.tracks import Track

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


def common_steps_v(chain: ChainConfig, track: Track) -> Floats:
    """Return for each row the largest step that ``impact_channels`` channels reach at once.

    Parameters
    ----------
    chain
        Its ``impact_channels``, ``disabled_channels`` and ``valid_range_v`` are used.
    track
        A recording of n rows.

    Returns
    -------
    ndarray, shape (n,)
        0 in the first row of each stretch. A bad sample causes no step, as the last good one is
        held in its place.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = np.array([[0.0, 0.0, 0.0], [3.0, -2.0, 1.0], [3.0, -2.0, 2.0]])
    >>> track = track_of('a', [LabelledRows(volts, np.zeros(3, bool))], 380.0)
    >>> common_steps_v(ChainConfig(channels=3, impact_channels=2), track)
    array([0., 2., 0.])
    """
    steps = _steps_v(chain, track)
    return steps[:, min(chain.impact_channels, steps.shape[1]) - 1]


def _steps_v(chain: ChainConfig, track: Track) -> Floats:
    """Return the steps of the enabled channels in each row, the largest first."""
    low, high = chain.valid_range_v
    disabled = set(chain.disabled_channels)
    enabled = [c for c in range(track.volts.shape[1]) if c + 1 not in disabled]
    found = np.zeros((len(track.volts), len(enabled)))
    for rows in track.rows_of_stretches:
        volts = track.volts[rows, enabled]
        good = (volts >= low) & (volts <= high)
        # The place of the last good sample up to each row; -1 before the first good one.
        places = np.where(good, np.arange(len(volts))[:, np.newaxis], -1)
        places = np.maximum.accumulate(places, axis=0)
        held = np.where(places < 0, np.nan, np.take_along_axis(volts, places, axis=0))
        steps = np.nan_to_num(np.abs(np.diff(held, axis=0)))
        found[rows][1:] = np.sort(steps, axis=1)[:, ::-1]
    return found


def largest_slip_steps_v(chain: ChainConfig, tracks: Sequence[Track]) -> Floats:
    """Return the largest step that 1, 2, ... channels reach at once in rows with slip.

    Returns
    -------
    ndarray
        One step for each number of channels up to all enabled ones; 0 where there is no slip.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = np.full((4, 3), 4.3)
    >>> volts[2:, :2] += 0.5, 0.2
    >>> track = track_of('trial', [LabelledRows(volts, np.arange(4) > 0)], 380.0)
    >>> chain = ChainConfig(channels=3, groups={'tip': (1, 2, 3)})
    >>> largest_slip_steps_v(chain, [track]).round(3).tolist()
    [0.5, 0.2, 0.0]
    """
    steps = [
        _steps_v(chain, track)[track.kinds == SLIP].max(axis=0, initial=0.0) for track in tracks
    ]
    return np.asarray(np.max(steps, axis=0))


def knocks_v(chain: ChainConfig, track: Track) -> Floats:
    """Return the largest of :func:`common_steps_v` in each knock of a recording.

    A knock begins with a step above :data:`KNOCK` times the noise. Further such steps that follow
    within :data:`KNOCK_S` of each other belong to it.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = 4.3 + 1e-3 * np.random.default_rng(0).standard_normal((760, 2))
    >>> volts[380] += 1.0
    >>> track = track_of('knocks', [LabelledRows(volts, np.zeros(760, bool))], 380.0)
    >>> len(knocks_v(ChainConfig(channels=2, groups={'tip': (1, 2)}, impact_channels=2), track))
    1
    """
    steps = common_steps_v(chain, track)
    if not steps.any():
        return np.zeros(0)
    # Where the samples seldom change, the noise is the smallest step of the converter.
    noise_v = max(np.quantile(steps, NOISE_SHARE), steps[steps > 0.0].min())
    loud = np.flatnonzero(steps > KNOCK * noise_v)
    if not loud.size:
        return np.zeros(0)
    breaks = np.flatnonzero(np.diff(loud) > KNOCK_S * track.sample_rate_hz) + 1
    return np.array([steps[knock].max() for knock in np.split(loud, breaks)])


class ImpactStep(NamedTuple):
    """A value of ``impact_v``, with the steps between which it lies.

    Attributes
    ----------
    impact_v : float
    slip_v : float
        The largest step of all slips.
    knock_v : float
        The step that :data:`KNOCK_SHARE` of the knocks exceed.
    knocks : int

    Examples
    --------
    >>> print(ImpactStep(0.02, slip_v=0.005, knock_v=0.08, knocks=40))
    impact_v 0.02 V: no slip has a step above 0.005 V, 90 % of 40 knocks one above 0.08 V
    """

    impact_v: float
    slip_v: float
    knock_v: float
    knocks: int

    def __str__(self) -> str:
        return (
            f'impact_v {self.impact_v:g} V: no slip has a step above {self.slip_v:.4g} V, '
            f'{KNOCK_SHARE * 100:.0f} % of {self.knocks} knocks one above {self.knock_v:.4g} V'
        )


def impact_step(chain: ChainConfig, knocks: Track, tracks: Sequence[Track]) -> ImpactStep:
    """Return an ``impact_v`` between the steps of slips and those of knocks.

    It is the geometric mean of the largest step of the slips and the step that :data:`KNOCK_SHARE`
    of the knocks exceed.

    Parameters
    ----------
    chain
        See :func:`common_steps_v`.
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
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> noise = np.random.default_rng(0).normal(0.0, 0.01, (2000, 2))
    >>> slips = track_of('slips', [LabelledRows(noise, np.ones(2000, bool))], 380.0)
    >>> noise[300::500] += 1.0
    >>> knocks = track_of('knocks', [LabelledRows(noise, np.zeros(2000, bool))], 380.0)
    >>> found = impact_step(ChainConfig(channels=2), knocks, [slips])
    >>> found.knocks, found.slip_v < found.impact_v < found.knock_v
    (4, True)
    """
    steps_v, slip_steps_v = knocks_v(chain, knocks), largest_slip_steps_v(chain, tracks)
    slip_v = float(slip_steps_v[min(chain.impact_channels, slip_steps_v.size) - 1])
    if not steps_v.size:
        raise ValueError(
            f'{knocks.name}: has no step of {KNOCK:g} times its noise on {chain.impact_channels} '
            'channels at once, allowed: a recording of knocks'
        )
    if not slip_v:
        names = ', '.join(track.name for track in tracks)
        raise ValueError(f'{names}: has no step with slip, allowed: labelled recordings of slips')
    knock_v = float(np.quantile(steps_v, 1.0 - KNOCK_SHARE))
    if knock_v < LEAST_RATIO * slip_v:
        raise ValueError(
            f'{knocks.name}: its knocks cannot be told from slips: {KNOCK_SHARE * 100:.0f} % of '
            f'{steps_v.size} knocks have a step above {knock_v:.4g} V, slips of up to '
            f'{slip_v:.4g} V, allowed: {LEAST_RATIO:g} times as much'
        )
    impact_v = float(f'{math.sqrt(slip_v * knock_v):.4g}')
    return ImpactStep(impact_v, slip_v, knock_v, steps_v.size)
