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

"""Sets a threshold from a recording without slip, with confidence bounds of the false alarms.

Alarms are counted, not rows. Alarms come in clusters, as one disturbance causes several. Therefore
time is divided into blocks that are longer than the windows. Blocks with an alarm are taken to be
independent of each other (Poisson), and each to have as many alarms as the observed ones.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from slip_detector.chain.settling import evidence_falls_s
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.sweep import VoteStatistics, sweep_thresholds
from slip_detector.tuning.thresholds import threshold_scale, thresholds
from slip_detector.tuning.tracks import Track

Floats = NDArray[np.float64]

#: Confidence of the bounds.
CONFIDENCE = 0.95

#: Length of a block as a multiple of both windows together (with evidence: of the envelope's
#: window and the time in which evidence falls to 0), and its least length.
WINDOWS_PER_BLOCK = 5.0
SHORTEST_BLOCK_S = 1.0

#: The tail is fitted to the highest of the blocks' peaks: this share of all, at least this many.
TAIL_SHARE = 0.1
LEAST_PEAKS = 30

#: The lowest rate to extrapolate to is one alarm in this many lengths of the recording.
FURTHEST = 20.0

#: Number of resampled sets of blocks from which the bounds of an extrapolated rate come.
RESAMPLES = 200


class QuietThreshold(NamedTuple):
    """A threshold with the rate of its false alarms.

    Attributes
    ----------
    chain : ChainConfig
        The given chain with this threshold.
    hours : float
        Length of the recording.
    alarms : int
        Number of alarms in the recording at this threshold.
    per_hour : tuple of float
        Bounds of the rate of false alarms, at ``CONFIDENCE``.
    extrapolated : bool
        Whether the rate is too low to be shown by counting in this recording.

    Examples
    --------
    >>> print(QuietThreshold(ChainConfig(threshold=0.4), 2.0, 3, (0.4, 3.9), extrapolated=False))
    threshold 0.4, 3 false alarms in 2 h: 0.4 to 3.9 an hour at 95% confidence
    """

    chain: ChainConfig
    hours: float
    alarms: int
    per_hour: tuple[float, float]
    extrapolated: bool

    def __str__(self) -> str:
        low, high = self.per_hour
        how = (
            f'extrapolated: {self.hours:.3g} h without an alarm can only show fewer than '
            f'{-np.log(1 - CONFIDENCE) / self.hours:.3g} an hour; the tail of its peaks says'
            if self.extrapolated
            else f'{self.alarms} false alarms in {self.hours:.3g} h:'
        )
        return (
            f'threshold {self.chain.threshold:g}, {how} {low:.3g} to {high:.3g} an hour at '
            f'{CONFIDENCE:.0%} confidence'
        )


def quiet_threshold(
    track: Track, chain: ChainConfig, per_hour: float, random: np.random.Generator
) -> QuietThreshold:
    """Return the lowest threshold whose rate of false alarms is low enough.

    Where counting can show the rate, it is the lowest threshold from which on the upper bound of
    the rate is at most the allowed rate. For a lower rate a generalised Pareto distribution is
    fitted to the highest peaks of the blocks, in amplitude; the bounds come from resampled blocks.
    Where evidence is 0 throughout, any threshold serves, and the given one is returned.

    Parameters
    ----------
    track
        A recording without slip.
    chain
        The chain.
    per_hour
        Allowed rate of false alarms.
    random
        Generator for the resampling.

    Raises
    ------
    ValueError
        When the recording has slip or is too short for the rate, or the sensor does not run; names
        the recording.

    Examples
    --------
    >>> from slip_detector.evaluation.labelled_rows import LabelledRows
    >>> from slip_detector.tuning.tracks import track_of
    >>> random = np.random.default_rng(0)
    >>> noise = 0.01 * random.standard_normal((380 * 60, 16))
    >>> rows = LabelledRows(noise, truth=np.zeros(380 * 60, bool))
    >>> track = track_of('rest', [rows], sample_rate_hz=380.0)
    >>> found = quiet_threshold(track, ChainConfig(), per_hour=600.0, random=random)
    >>> found.per_hour[1] <= 600.0, found.extrapolated
    (True, False)
    """
    if track.slips:
        start_s = track.slips[0].start / track.sample_rate_hz
        raise ValueError(
            f'{track.name}: has slip at {start_s:.3f} s, allowed: a recording without slip'
        )
    hours = track.duration_s / 3600.0
    shortest = 1.0 / (FURTHEST * per_hour)
    if hours < shortest:
        raise ValueError(
            f'{track.name}: lasts {hours:.3g} h, allowed: at least {shortest:.3g} h for a rate of '
            f'{per_hour:g} an hour (one that is {FURTHEST:g} times lower than 1 in this time is a '
            'guess)'
        )
    statistic = VoteStatistics(chain, [chain.vote]).of(track)[0]
    exponent, limit = threshold_scale(chain)
    limits = thresholds(chain, [statistic], [track])
    if not limits.size:
        if statistic.max() >= limit:
            raise _limit_reached(track, limit)
        if chain.decision == 'mean':
            raise ValueError(
                f'{track.name}: the chain gives 0 throughout, allowed: a sensor that runs'
            )
        limits = np.array([chain.threshold])
    # Each rise counts as an alarm, from the first row on, as it does in the detector's output.
    config = EvaluationConfig(off_before_s=0.0)
    sweep = sweep_thresholds([statistic], [track], limits, config, settling_rows=0)
    peaks = _peaks(statistic, track, chain)
    # The size of a cluster: alarms per block that has an alarm.
    loud = np.array([np.count_nonzero(peaks > limit) for limit in limits])
    cluster = np.where(loud > 0, sweep.false_alarms / np.maximum(loud, 1), 1.0)
    cluster = np.maximum(cluster, 1.0)
    upper = stats.chi2.ppf(CONFIDENCE, 2 * (loud + 1)) / 2 / hours * cluster
    # The first threshold after the last at which the bound fails: it may hold at very low ones
    # too, where the decision is always ON and so has few alarms.
    fails = np.flatnonzero(upper > per_hour)
    first = int(fails[-1]) + 1 if fails.size else 0
    if first < limits.size:
        low = stats.chi2.ppf(1 - CONFIDENCE, 2 * loud[first]) / 2 / hours if loud[first] else 0.0
        threshold, alarms = float(limits[first]), int(sweep.false_alarms[first])
        bounds = (float(low * cluster[first]), float(upper[first]))
        return _quiet(chain, threshold, hours, alarms, bounds, extrapolated=False)
    if peaks.max() >= limit:
        raise _limit_reached(track, limit)
    amplitude = peaks ** (1.0 / exponent)
    peaked = np.count_nonzero(amplitude)
    if peaked * TAIL_SHARE < LEAST_PEAKS:
        raise ValueError(
            f'{track.name}: has {peaked} blocks of {_block_s(chain):g} s with a peak, allowed: '
            f'{LEAST_PEAKS / TAIL_SHARE:.0f}, to extrapolate to {per_hour:g} an hour, or '
            f'a rate that counting can show, from {-np.log(1 - CONFIDENCE) / hours:.3g} an hour'
        )
    blocks_per_hour = peaks.size / hours
    found = _limit(amplitude, per_hour / blocks_per_hour)
    shares = [_share(random.choice(amplitude, amplitude.size), found) for _ in range(RESAMPLES)]
    tails = np.quantile(shares, [1 - CONFIDENCE, CONFIDENCE]) * blocks_per_hour
    bounds = (float(tails[0]), float(tails[1]))
    alarms = int(np.count_nonzero(amplitude > found))
    return _quiet(chain, found**exponent, hours, alarms, bounds, extrapolated=True)


def _limit_reached(track: Track, limit_db_s: float) -> ValueError:
    return ValueError(
        f'{track.name}: the evidence reaches its limit of {limit_db_s:g} dB s, allowed: a '
        'recording at rest, and a noise_floor and an offset with which it stays below'
    )


def _quiet(
    chain: ChainConfig,
    threshold: float,
    hours: float,
    alarms: int,
    bounds: tuple[float, float],
    extrapolated: bool,
) -> QuietThreshold:
    return QuietThreshold(
        dataclasses.replace(chain, threshold=float(f'{threshold:.6g}')),
        hours,
        alarms,
        bounds,
        extrapolated,
    )


def _block_s(chain: ChainConfig) -> float:
    decision_s = chain.decision_window_s
    if chain.decision == 'evidence':
        decision_s = evidence_falls_s(chain)
    windows_s = chain.envelope_window_s + decision_s
    return max(SHORTEST_BLOCK_S, WINDOWS_PER_BLOCK * windows_s)


def _peaks(statistic: Floats, track: Track, chain: ChainConfig) -> Floats:
    """Return the largest statistic of each block of time; shape (blocks,)."""
    rows = max(round(_block_s(chain) * track.sample_rate_hz), 1)
    return np.array([statistic[k : k + rows].max() for k in range(0, statistic.size, rows)])


def _tail(amplitude: Floats) -> tuple[float, float, float, float]:
    """Fit the tail of the peaks; return its start, the share above it, shape and scale."""
    start = float(np.quantile(amplitude, 1.0 - TAIL_SHARE))
    above = amplitude[amplitude > start] - start
    shape, _, scale = stats.genpareto.fit(above, floc=0.0)
    return start, above.size / amplitude.size, float(shape), float(scale)


def _limit(amplitude: Floats, share: float) -> float:
    """Return the amplitude that a share of the blocks exceeds."""
    start, of_all, shape, scale = _tail(amplitude)
    return start + float(stats.genpareto.isf(min(share / of_all, 1.0), shape, scale=scale))


def _share(amplitude: Floats, limit: float) -> float:
    """Return the share of the blocks that exceeds an amplitude."""
    start, of_all, shape, scale = _tail(amplitude)
    return of_all * float(stats.genpareto.sf(limit - start, shape, scale=scale))
