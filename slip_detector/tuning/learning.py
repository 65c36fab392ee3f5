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

"""What is learnt without a search: noise floors, mains, a threshold, steps of slips."""

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Floats
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.scores import REST, SLIP
from slip_detector.parameters import ChainConfig, EvaluationConfig
from slip_detector.parameters.fields import refuse
from slip_detector.recordings.rates import forward_filled
from slip_detector.tuning.sweep import sweep_thresholds, thresholds, vote_statistics
from slip_detector.tuning.tracks import (
    Track,
    at_rest,
    edges_of,
    enabled,
    envelopes,
    faults_of,
    load_tracks,
)

#: Confidence of the bounds of a rate.
CONFIDENCE = 0.95

#: Alarms come in clusters, as one disturbance causes several. So time is divided into blocks.
#: Those with an alarm are taken to be independent (Poisson), and to have as many alarms as the
#: observed ones.
BLOCK_S = 1.0

#: A learnt floor is the level that this share of rest stays below. For noise that is about the
#: mean power, whatever the window, so that noise alone gives no evidence. Above the level that a
#: tenth stays below, where a floor that follows the envelope settles, noise lies by 12 dB on
#: average if the envelope has a window of one sample.
BELOW_FLOOR = 2 / 3

#: How far a learnt floor may rise.
LEARNT_RANGE_DB = 15.0

#: Floors are learnt from the first rows of each recording: ``MOST_ROWS`` in all, but at least
#: ``LEAST_S`` of each; a single recording has to last that long. More rows would hardly improve
#: the floors, and would lengthen each trial of a search.
MOST_ROWS, LEAST_S = 60_000, 5.0

#: Mains frequencies of the world, and how many of their multiples are examined.
MAINS_HZ = (50.0, 60.0)
HARMONICS = 8

#: A line stands at least this far above the noise beside it, on every channel.
LEAST_LINE_DB = 12.0

#: Window of the spectra, which makes a line some 0.5 Hz wide.
SPECTRUM_S = 4.0

#: Distances from its nominal frequency within which a line is, as the mains frequency varies, and
#: those within which the noise beside it is measured.
LINE_HZ, BESIDE_HZ = (0.0, 0.5), (1.0, 6.0)

#: Below this frequency a line cannot be distinguished from drift.
LOWEST_LINE_HZ = 2.0

#: Share of the slips that shows how large their steps are, and that where labels are by hand.
SHARE_OF_SLIPS, SHARE_BY_HAND = 0.9, 0.8


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
        learnt['threshold'], line = quiet_threshold(track, chain, per_hour)
        lines.append(f'On {track.name}, without slip: {line}')
    return learnt, lines


def learn_noise(
    chain: ChainConfig, tracks: Sequence[Track], longest: Track
) -> tuple[dict[str, Any], list[str]]:
    """Learn mains of one recording and, where evidence decides, noise floors of some at rest."""
    mains_hz, line = find_mains(chain, longest)
    learnt: dict[str, Any] = {}
    lines = [f'On {longest.name}: {line}']
    if chain.decision == 'evidence':
        lasts_s = sum(track.duration_s for track in at_rest(tracks))
        if lasts_s < LEAST_S:
            refuse(f'{longest.name}: lasts {lasts_s:.3g} s', f'at least {LEAST_S:g} s at rest')
        if mains_hz and not chain.mains_hz:
            try:
                chain = dataclasses.replace(chain, mains_hz=mains_hz)
                learnt['mains_hz'] = mains_hz
            except ValueError as error:
                lines.append(f'mains_hz cannot remove it: {error}')
        floors = learnt_floors(chain, tracks)
        learnt |= {'noise_floor': list(floors), 'noise_floor_learnt': True}
        learnt['noise_floor_range_db'] = LEARNT_RANGE_DB
        lines.append(f'Noise floors of {min(floors):.4g} to {max(floors):.4g}')
    return learnt, lines


def quiet_threshold(track: Track, chain: ChainConfig, per_hour: float) -> tuple[float, str]:
    """Return the lowest threshold from which on the upper bound of the rate is low enough.

    With it comes a line with the rate and its bounds, at :data:`CONFIDENCE`. Where evidence is 0
    throughout, any threshold serves, and the given one is returned.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> noise = 0.01 * np.random.default_rng(0).standard_normal((380 * 60, 16))
    >>> rows = Samples.evenly(noise, 380.0, np.zeros(380 * 60, bool))
    >>> track = track_of('rest', [rows], sample_rate_hz=380.0)
    >>> quiet_threshold(track, ChainConfig(), per_hour=600.0)[1]
    'threshold 0.62, 4 false alarms in 0.0167 h: 82 to 549 an hour at 95% confidence'
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

    parts = vote_statistics(chain, [chain.vote], [track])[chain.vote]
    limits, statistic = thresholds(chain, parts), parts[0][0]
    if chain.decision == 'evidence' and not statistic.any():
        limits = np.array([chain.threshold])
    # Each rise counts as an alarm, from the first row on, as it does in the detector's output.
    config = EvaluationConfig(off_before_s=0.0)
    alarms = sweep_thresholds(parts, limits, config, settling_rows=0)[0].rest[2]
    blocks = range(0, statistic.size, round(max(BLOCK_S * track.sample_rate_hz, 1.0)))
    peaks = np.maximum.reduceat(statistic, blocks)
    loud = np.array([np.count_nonzero(peaks > limit) for limit in limits])
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


def learnt_floors(chain: ChainConfig, tracks: Sequence[Track]) -> tuple[float, ...]:
    """Return the noise floor of each channel, below which two thirds of its envelopes at rest are.

    Rows with slip, and rows in which the chain settles or a channel is not valid, are not used;
    rows of motion are used only if there is no rest. A channel without noise gets the median of
    the other floors.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> noise = np.random.default_rng(0).standard_normal((3000, 2)) * [0.01, 0.04]
    >>> track = track_of('rest', [Samples.evenly(noise, 380.0, np.zeros(3000, bool))], 380.0)
    >>> floors = learnt_floors(ChainConfig(channels=2, exponent=1, gain=1.0), [track])
    >>> 3.5 < floors[1] / floors[0] < 4.5
    True
    """
    plain, tracks = dataclasses.replace(chain, decision='mean'), at_rest(tracks)
    kinds = [REST] if any((track.kinds == REST).any() for track in tracks) else range(SLIP)
    every = []
    for track in tracks:
        most = max(MOST_ROWS // len(tracks), round(LEAST_S * track.sample_rate_hz))
        its = envelopes(plain, track, settling_rows(plain) + most)
        every.append(its[np.isin(track.kinds[: len(its)], kinds)])
    columns = [column[np.isfinite(column)] for column in np.concatenate(every).T]
    found = np.array([np.quantile(one, BELOW_FLOOR) if one.size else 0.0 for one in columns])
    if not found.any():
        names = ', '.join(track.name for track in tracks)
        text = 'a recording at rest that is longer than the chain settles'
        refuse(f'{names}: no channel has any noise', text)
    found[found == 0.0] = np.median(found[found > 0.0])
    return tuple(float(f'{floor:.4g}') for floor in found)


def find_mains(chain: ChainConfig, track: Track) -> tuple[float, str]:
    """Return the mains frequency whose multiples stand out from the noise on all channels.

    With it comes a line with these multiples; without any the frequency is 0. The common mode is
    subtracted first if the chain subtracts it. A multiple above half the sample rate is sought at
    its alias. Of two mains frequencies the one with more lines is returned; with equally many, the
    one with the lower multiple, as multiples of both may have the same alias.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> time_s = np.arange(6000)[:, np.newaxis] / 320.0
    >>> volts = np.random.default_rng(0).standard_normal((6000, 2))
    >>> volts += np.sin(2 * np.pi * 60.0 * time_s) + np.sin(2 * np.pi * 180.0 * time_s)
    >>> track = track_of('rest', [Samples.evenly(volts, 320.0, np.zeros(6000, bool))], 320.0)
    >>> find_mains(ChainConfig(channels=2), track)[1]
    'mains of 60 Hz: lines of 60 Hz (23 dB), 180 Hz (24 dB, seen at 140 Hz) on all channels'
    """
    rate_hz, rows = track.sample_rate_hz, round(SPECTRUM_S * track.sample_rate_hz)
    begin, end = max(track.stretches, key=lambda one: one.end - one.start)
    volts = enabled(track.volts, chain)[begin:end]
    volts = forward_filled(volts, ~np.isfinite(volts))
    volts = volts[:, np.ptp(volts, axis=0) > 0.0]
    if chain.common_mode != 'none' and volts.size:
        volts = volts - volts[0]
        common = np.median if chain.common_mode == 'median' else np.mean
        volts -= common(volts, axis=1, keepdims=True)
    if len(volts) < 2 * rows:
        return 0.0, f'too short to seek lines of the mains, which takes {2 * SPECTRUM_S:g} s'
    lines = {}
    if volts.any():
        from scipy import signal

        spectra = signal.welch(volts, rate_hz, nperseg=rows, axis=0)
        lines = {mains_hz: _lines(mains_hz, rate_hz, *spectra) for mains_hz in MAINS_HZ}
    if not any(lines.values()):
        return 0.0, f'no line of the mains is {LEAST_LINE_DB:g} dB above the noise on all channels'
    best = max(lines, key=lambda one: (len(lines[one]), -min(lines[one], default=0)))
    heights = ', '.join(lines[best].values())
    return best, f'mains of {best:g} Hz: lines of {heights} on all channels'


def _lines(mains_hz: float, rate_hz: float, hz: Floats, power: Floats) -> dict[int, str]:
    """Return the multiples with a line as texts, by their number, each place in the spectrum once.

    The height of a line is that on the channel where it is lowest.
    """
    lines: dict[int, str] = {}
    seen: list[float] = []
    for harmonic in range(1, HARMONICS + 1):
        hum_hz = harmonic * mains_hz
        seen_hz = abs(hum_hz - rate_hz * round(hum_hz / rate_hz))
        away = np.abs(hz - seen_hz)
        line, noise = (power[(away >= low) & (away <= high)] for low, high in (LINE_HZ, BESIDE_HZ))
        taken = any(abs(other_hz - seen_hz) < 2 * LINE_HZ[1] for other_hz in seen)
        if taken or seen_hz < LOWEST_LINE_HZ or not line.size or not noise.size:
            continue
        ratios = line.max(axis=0) / np.median(noise, axis=0)
        least_db = 10.0 * float(np.log10(ratios.min()))
        if least_db >= LEAST_LINE_DB:
            seen.append(seen_hz)
            place = '' if seen_hz == hum_hz else f', seen at {seen_hz:g} Hz'
            lines[harmonic] = f'{hum_hz:g} Hz ({least_db:.0f} dB{place})'
    return lines


def steps_v(chain: ChainConfig, track: Track, rows: int = 1) -> Floats:
    """Return the largest steps over some rows that 1, 2, ... channels reach at once, in each row.

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
    volts = enabled(track.volts, chain)
    found = np.zeros(volts.shape)
    for begin, end in track.stretches:
        part = volts[begin:end]
        filled = forward_filled(part, ~((part >= low) & (part <= high)))
        steps = np.abs(filled[rows:] - filled[:-rows])
        found[begin + rows : end] = np.sort(steps, axis=1)[:, ::-1]
    return found


def slip_steps_v(chain: ChainConfig, tracks: Sequence[Track], rows: int = 1) -> Floats:
    """Return the largest of :func:`steps_v` that nine in ten slips stay below; shape (channels,).

    Of labels by hand it is eight in ten: a hand may have pressed the key as something knocked.
    """
    found = []
    for track in tracks:
        # Also where the label is not certain, as the first rows of a slip may be its largest.
        steps = steps_v(chain, track, rows)
        found += [steps[start:end].max(axis=0) for start, end in edges_of(track.samples)]
    by_hand = any(track.samples.accuracy_s for track in tracks)
    share = SHARE_BY_HAND if by_hand else SHARE_OF_SLIPS
    return np.asarray(np.quantile(found, share, axis=0, method='higher'))
