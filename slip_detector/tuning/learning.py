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

"""What is learnt of a finger without a search: where one begins, noise, and a threshold."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters import ChainConfig, EvaluationConfig, refuse
from slip_detector.tuning.measuring import find_mains, learn_noise, slip_bands
from slip_detector.tuning.sweep import vote_statistics
from slip_detector.tuning.tracks import Track, at_rest, faults_of, load_tracks

#: Where the search for an unknown sensor begins, and its pass-band: from a frequency, or from a
#: share of the sample rate if that is lower.
NEW_SENSOR: dict[str, Any] = {
    'decision': 'evidence',
    'threshold': 0.5,
    'noise_floor': (1e-9,),
    'noise_floor_learnt': ChainConfig.noise_floor_learnt,
    'passband_degree': 2,
    'stopbands_hz': (),
    'gain': 1.0,
    'exponent': 1,
}
LOW_HZ, LOW_SHARE = 20.0, 0.2

#: Confidence of the bounds of a rate.
CONFIDENCE = 0.95

#: Alarms come in clusters, as one disturbance causes several. So time is divided into blocks.
#: Blocks with an alarm are taken to be independent (Poisson), and each to have as many alarms as
#: the observed blocks with an alarm have on average.
BLOCK_S = 1.0


def starting_chain(chain: ChainConfig) -> ChainConfig:
    """Return where learning begins: the given chain, or, without evidence, that of a new sensor.

    Examples
    --------
    >>> starting_chain(ChainConfig()).passband_hz
    (20.0, 0.0)
    """
    if chain.decision == 'evidence':
        return chain
    low_hz = min(LOW_HZ, LOW_SHARE * chain.sample_rate_hz)
    vote = min(2, *map(len, chain.groups.values()))
    return dataclasses.replace(chain, **NEW_SENSOR, passband_hz=(low_hz, 0.0), vote=vote)


def learn(
    chain: ChainConfig, tracks: Sequence[Track], observe: Callable[..., None]
) -> tuple[ChainConfig, list[str]]:
    """Learn bands, mains and noise of a finger; return where a search begins, and lines on it."""
    chain = starting_chain(chain)
    observe(step='measuring where slides stand out')
    bands, line = slip_bands(chain, tracks)
    lines, (low_hz, _) = [line], chain.passband_hz
    if bands and 0.0 < bands[0][1] <= low_hz:
        lines.append(f'The given pass-band begins above them, at {low_hz:g} Hz')
    quiet = [track for track in tracks if not track.slips]
    if not quiet:
        return chain, [*lines, 'No noise learnt: there is no recording without slips']
    # Rest shows the mains best, but is often too short.
    resting = at_rest(quiet)
    ordered = sorted(quiet, key=lambda track: (track in resting, track.duration_s), reverse=True)
    with_mains = (track for track in ordered if find_mains(chain, track)[0])
    shows_mains = next(with_mains, ordered[0])
    observe(step=f'learning the noise of {shows_mains.name}')
    try:
        parameters, more = learn_noise(chain, tracks, shows_mains)
    except ValueError as error:
        return chain, [*lines, str(error)]
    return dataclasses.replace(chain, **parameters), lines + more


def learn_from_quiet(
    path: str, chain: ChainConfig, loader: RecordingLoader, per_hour: float | None = None
) -> tuple[dict[str, Any], list[str]]:
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

    Returns
    -------
    parameters : dict
        The parameters that are learnt, by name, as ROS has them.
    lines : list of str
        What there is to say about them.

    Raises
    ------
    ValueError
        When the recording cannot be read or is too short, or there is nothing to learn from it;
        names it.
    """
    if per_hour is None and chain.decision != 'evidence':
        text = 'evidence, whose noise floors --quiet learns, or --false-alarms-per-hour, which '
        refuse('parameter decision is mean', f'{text}sets the threshold')
    tracks = load_tracks([path], loader, labelled=False)
    if len(tracks) != 1:
        refuse(f'{path}: has {len(tracks)} recordings', 'one')
    (track,) = tracks
    learnt, lines = learn_noise(chain, [track], track)
    lines = [*faults_of([track]), *lines]
    if per_hour is not None:
        chain = dataclasses.replace(chain, **learnt)
        learnt['threshold'], line = learn_threshold(track, chain, per_hour)
        lines.append(f'On {track.name}, without slip: {line}')
    return learnt, lines


def learn_threshold(track: Track, chain: ChainConfig, per_hour: float) -> tuple[float, str]:
    """Return the lowest threshold from which on the upper bound of the rate is low enough.

    With it comes a line with the rate and its bounds, at :data:`CONFIDENCE`. Where evidence is 0
    throughout, any threshold serves, and the given one is returned.
    """
    hours = track.duration_s / 3600.0
    # Without any alarm the bound of the rate is this number of alarms in the recording.
    shortest = -math.log(1.0 - CONFIDENCE) / per_hour
    if track.slips or hours < shortest:
        what = 'has slip' if track.slips else f'lasts {hours:.3g} h'
        text = f'no slip, and at least {shortest:.3g} h to show a rate of {per_hour:g} an hour'
        refuse(f'{track.name}: {what}', text)
    # Only a threshold needs it, and it takes longer to load than all else.
    from scipy import special

    # Each rise counts as an alarm, from the first row on, as it does in the detector's output.
    config = EvaluationConfig(off_before_s=0.0)
    (statistics,) = vote_statistics(chain, [chain.vote], [track], config)
    limits, statistic = statistics.thresholds(), statistics.parts[0][0]
    if chain.decision == 'evidence' and not statistic.any():
        limits = np.array([chain.threshold])
    alarms = statistics.events(limits)[0].rest[2]
    blocks = range(0, statistic.size, round(max(BLOCK_S * track.sample_rate_hz, 1.0)))
    peaks = np.sort(np.maximum.reduceat(statistic, blocks))
    loud = peaks.size - np.searchsorted(peaks, limits, 'right')
    cluster = np.maximum(alarms / np.maximum(loud, 1), 1.0)  # alarms in a block that has any
    upper = special.gammaincinv(loud + 1, CONFIDENCE) / hours * cluster
    # The first threshold after the last at which the bound fails: it may hold at very low ones
    # too, where the decision is always ON and so has few alarms.
    first = int(np.flatnonzero([True, *(upper > per_hour)])[-1])
    if first == limits.size:
        raise ValueError(
            f'{track.name}: no threshold has that rate, allowed: a sensor that runs, at rest, and '
            'a noise_floor and an offset with which evidence stays below its limit'
        )
    low = special.gammaincinv(loud[first], 1.0 - CONFIDENCE) if loud[first] else 0.0
    threshold = float(f'{limits[first]:.6g}')
    return threshold, (
        f'threshold {threshold:g}, {alarms[first]:.0f} false alarms in {hours:.3g} h: '
        f'{low / hours * cluster[first]:.3g} to {upper[first]:.3g} an hour at '
        f'{CONFIDENCE:.0%} confidence'
    )
