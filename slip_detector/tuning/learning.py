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

"""What is learnt from a recording at rest or of knocks, without a search.

A threshold is set by counting alarms, not rows. Alarms come in clusters, as one disturbance causes
several. Therefore time is divided into blocks that are longer than the windows. Blocks with an
alarm are taken to be independent of each other (Poisson), and each to have as many alarms as the
observed ones.
"""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.settling import evidence_falls_s
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.tuning.sensor import (
    LEARNT_RANGE_DB,
    LEAST_S,
    Mains,
    find_mains,
    impact_step,
    learnt_floors,
)
from slip_detector.tuning.sweep import (
    VoteStatistics,
    sweep_thresholds,
    threshold_scale,
    thresholds,
)
from slip_detector.tuning.tracks import Track, load_tracks

Floats = NDArray[np.float64]

#: Confidence of the bounds.
CONFIDENCE = 0.95

#: Length of a block as a multiple of both windows together (with evidence: of the envelope's
#: window and the time in which evidence falls to 0), and its least length.
WINDOWS_PER_BLOCK = 5.0
SHORTEST_BLOCK_S = 1.0


class LearntParameters(NamedTuple):
    """The parameters that are learnt from a recording at rest or of knocks.

    Attributes
    ----------
    parameters : dict
        Parameters of the chain by name, as ROS has them.
    lines : list of str
        What there is to say about them.

    Examples
    --------
    >>> LearntParameters({'threshold': 2.2}, ['On rest.npz: threshold 2.2']).parameters
    {'threshold': 2.2}
    """

    parameters: dict[str, Any]
    lines: list[str]


def learn_from_quiet(
    path: str, chain: ChainConfig, loader: RecordingLoader, per_hour: float | None = None
) -> LearntParameters:
    """Learn noise floors, mains and threshold from a recording without slip.

    Noise floors and mains are set where evidence decides; the threshold is set where a rate of
    false alarms is given.

    Parameters
    ----------
    path
        The recording.
    chain
        The given chain.
    loader
        Opens recordings for this chain.
    per_hour
        Allowed rate of false alarms.

    Raises
    ------
    ValueError
        When the recording cannot be read or is too short, or there is nothing to learn from it;
        names it.
    """
    by_evidence = chain.decision == 'evidence'
    if per_hour is None and not by_evidence:
        raise ValueError(
            'parameter decision is mean, allowed: evidence, whose noise floors --quiet learns, '
            'or --false-alarms-per-hour, which sets the threshold'
        )
    track, lines = _only(path, loader)
    if by_evidence and track.duration_s < LEAST_S:
        raise ValueError(
            f'{track.name}: lasts {track.duration_s:.3g} s, allowed: at least {LEAST_S:g} s at '
            'rest'
        )
    names = []
    mains = find_mains(chain, track)
    lines.append(f'On {track.name}: {mains}')
    if mains.lines and not chain.mains_hz:
        without_hum = _with_mains(chain, mains)
        if without_hum is None:
            lines.append(
                f'mains_hz cannot remove it: it has no whole periods in rows of '
                f'{chain.sample_rate_hz:g} Hz; a stop-band can'
            )
        elif by_evidence:
            chain = without_hum
            names.append('mains_hz')
        else:
            lines.append(f'mains_hz: {mains.mains_hz:g} would remove it')
    if by_evidence:
        floors = learnt_floors(chain, [track])
        learnt: dict[str, Any] = {
            'noise_floor': floors,
            'noise_floor_learnt': True,
            'noise_floor_range_db': LEARNT_RANGE_DB,
        }
        chain = dataclasses.replace(chain, **learnt)
        names += learnt
        lines.append(f'Noise floors of {min(floors):.4g} to {max(floors):.4g}')
    if per_hour is not None:
        found = quiet_threshold(track, chain, per_hour)
        chain = found.chain
        names.append('threshold')
        lines.append(f'On {track.name}, without slip: {found}')
    parameters = chain.to_parameters()
    return LearntParameters({name: parameters[name] for name in names}, lines)


def learn_from_taps(
    path: str, slips: Sequence[str], chain: ChainConfig, loader: RecordingLoader
) -> LearntParameters:
    """Set the step that is an impact from a recording of knocks and labelled slips.

    Parameters
    ----------
    path
        The recording of knocks.
    slips
        Labelled recordings of slips, and folders of them.
    chain, loader
        As in :func:`learn_from_quiet`.

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
    knocks, lines = _only(path, loader)
    tracks, more_lines = load_tracks(slips, loader)
    found = impact_step(chain, knocks, tracks)
    return LearntParameters(
        {'impact_v': found.impact_v}, [*lines, *more_lines, f'{knocks.name}: {found}']
    )


def _only(path: str, loader: RecordingLoader) -> tuple[Track, list[str]]:
    """Read the one recording of a path, and the line of its faults."""
    tracks, notes = load_tracks([path], loader, labelled=False)
    if len(tracks) != 1:
        raise ValueError(f'{path}: has {len(tracks)} recordings, allowed: one')
    return tracks[0], notes


def _with_mains(chain: ChainConfig, mains: Mains) -> ChainConfig | None:
    """Return the chain that removes the mains; None where its sample rate does not allow it."""
    try:
        return dataclasses.replace(chain, mains_hz=mains.mains_hz)
    except ValueError:
        return None


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

    Examples
    --------
    >>> print(QuietThreshold(ChainConfig(threshold=0.4), hours=2.0, alarms=3, per_hour=(0.4, 3.9)))
    threshold 0.4, 3 false alarms in 2 h: 0.4 to 3.9 an hour at 95% confidence
    """

    chain: ChainConfig
    hours: float
    alarms: int
    per_hour: tuple[float, float]

    def __str__(self) -> str:
        low, high = self.per_hour
        return (
            f'threshold {self.chain.threshold:g}, {self.alarms} false alarms in {self.hours:.3g} '
            f'h: {low:.3g} to {high:.3g} an hour at {CONFIDENCE:.0%} confidence'
        )


def quiet_threshold(track: Track, chain: ChainConfig, per_hour: float) -> QuietThreshold:
    """Return the lowest threshold from which on the rate of false alarms is low enough.

    The upper bound of the rate is at most the allowed rate. Where evidence is 0 throughout, any
    threshold serves, and the given one is returned.

    Parameters
    ----------
    track
        A recording without slip.
    chain
        The chain.
    per_hour
        Allowed rate of false alarms.

    Raises
    ------
    ValueError
        When the recording has slip, is too short to show the rate or is too noisy, or the sensor
        does not run; names the recording.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal((380 * 60, 16))
    >>> rows = Samples.evenly(noise, 380.0, np.zeros(380 * 60, bool))
    >>> track = track_of('rest', [rows], sample_rate_hz=380.0)
    >>> quiet_threshold(track, ChainConfig(), per_hour=600.0).per_hour[1] <= 600.0
    True
    """
    if track.slips:
        start_s = track.slips[0].start / track.sample_rate_hz
        raise ValueError(
            f'{track.name}: has slip at {start_s:.3f} s, allowed: a recording without slip'
        )
    hours = track.duration_s / 3600.0
    # Without any alarm the bound of the rate is this number of alarms in the recording.
    shortest = -math.log(1.0 - CONFIDENCE) / per_hour
    if hours < shortest:
        raise ValueError(
            f'{track.name}: lasts {hours:.3g} h, allowed: at least {shortest:.3g} h to show a '
            f'rate of {per_hour:g} an hour'
        )
    # Only a threshold needs it, and it takes longer to load than all else.
    from scipy import special

    statistic = VoteStatistics(chain, [chain.vote]).of(track)[0]
    limits = thresholds(chain, [statistic], [track])
    if not statistic.any():
        if chain.decision == 'mean':
            raise ValueError(
                f'{track.name}: the chain gives 0 throughout, allowed: a sensor that runs'
            )
        limits = np.array([chain.threshold])
    # Each rise counts as an alarm, from the first row on, as it does in the detector's output.
    config = EvaluationConfig(off_before_s=0.0)
    alarms = sweep_thresholds([statistic], [track], limits, config, settling_rows=0).false_alarms
    peaks = _peaks(statistic, track, chain)
    loud = np.array([np.count_nonzero(peaks > limit) for limit in limits])
    # The size of a cluster: alarms per block that has an alarm.
    cluster = np.maximum(np.where(loud > 0, alarms / np.maximum(loud, 1), 1.0), 1.0)
    # The first threshold after the last at which the bound fails: it may hold at very low ones
    # too, where the decision is always ON and so has few alarms.
    upper = special.gammaincinv(loud + 1, CONFIDENCE)
    fails = np.flatnonzero(upper / hours * cluster > per_hour)
    first = int(fails[-1]) + 1 if fails.size else 0
    if first == limits.size:
        raise ValueError(
            f'{track.name}: the evidence reaches its limit of {threshold_scale(chain)[1]:g} dB s, '
            'allowed: a recording at rest, and a noise_floor and an offset with which it stays '
            'below'
        )
    events = int(loud[first])
    low = special.gammaincinv(events, 1.0 - CONFIDENCE) if events else 0.0
    bounds = [float(bound / hours * cluster[first]) for bound in (low, upper[first])]
    found = dataclasses.replace(chain, threshold=float(f'{limits[first]:.6g}'))
    return QuietThreshold(found, hours, int(alarms[first]), (bounds[0], bounds[1]))


def _peaks(statistic: Floats, track: Track, chain: ChainConfig) -> Floats:
    """Return the largest statistic of each block of time; shape (blocks,)."""
    decision_s = chain.decision_window_s
    if chain.decision == 'evidence':
        decision_s = evidence_falls_s(chain)
    windows_s = chain.envelope_window_s + decision_s
    block_s = max(SHORTEST_BLOCK_S, WINDOWS_PER_BLOCK * windows_s)
    rows = max(round(block_s * track.sample_rate_hz), 1)
    return np.maximum.reduceat(statistic, range(0, statistic.size, rows))
