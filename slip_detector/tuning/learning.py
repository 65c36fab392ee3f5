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

"""What is learnt of a sensor from recordings at rest or of knocks, without a search.

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

from slip_detector.chain.filters import evidence_falls_s, settling_rows
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.scores import REST, SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.evaluation import EvaluationConfig
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

#: Largest distance of a line from its nominal frequency, as the mains frequency varies.
STRAYS_HZ = 0.5

#: Distances from a line between which the noise beside it is measured.
NOISE_FROM_LINE_HZ = (1.0, 6.0)

#: Below this frequency a line cannot be distinguished from drift.
LOWEST_LINE_HZ = 2.0

#: A knock has a step above ``KNOCK`` times the noise: the step that ``NOISE_SHARE`` of all steps
#: stays below.
KNOCK = 4.0
NOISE_SHARE = 0.9

#: This share of the knocks must have steps at least this many times as large as those of slips.
KNOCK_SHARE = 0.9
LEAST_RATIO = 1.5

#: Longest pause between two large steps of one knock.
KNOCK_S = 0.5


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
    learnt: dict[str, Any] = {}
    mains = find_mains(chain, track)
    lines.append(f'On {track.name}: {mains}')
    if mains.lines and not chain.mains_hz:
        try:
            dataclasses.replace(chain, mains_hz=mains.mains_hz)
        except ValueError:  # its periods are not whole rows
            lines.append(
                f'mains_hz cannot remove it: it has no whole periods in rows of '
                f'{chain.sample_rate_hz:g} Hz; a stop-band can'
            )
        else:
            if by_evidence:
                learnt['mains_hz'] = mains.mains_hz
            else:
                lines.append(f'mains_hz: {mains.mains_hz:g} would remove it')
    if by_evidence:
        floors = learnt_floors(dataclasses.replace(chain, **learnt), [track])
        learnt['noise_floor'] = floors
        learnt['noise_floor_learnt'] = True
        learnt['noise_floor_range_db'] = LEARNT_RANGE_DB
        lines.append(f'Noise floors of {min(floors):.4g} to {max(floors):.4g}')
    if per_hour is not None:
        given = dataclasses.replace(chain, **learnt)
        learnt['threshold'], line = quiet_threshold(track, given, per_hour)
        lines.append(f'On {track.name}, without slip: {line}')
    parameters = dataclasses.replace(chain, **learnt).to_parameters()
    return LearntParameters({name: parameters[name] for name in learnt}, lines)


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
    impact_v, line = impact_step(chain, knocks, tracks)
    return LearntParameters(
        {'impact_v': impact_v}, [*lines, *more_lines, f'{knocks.name}: {line}']
    )


def _only(path: str, loader: RecordingLoader) -> tuple[Track, list[str]]:
    """Read the one recording of a path, and the line of its faults."""
    tracks, notes = load_tracks([path], loader, labelled=False)
    if len(tracks) != 1:
        raise ValueError(f'{path}: has {len(tracks)} recordings, allowed: one')
    return tracks[0], notes


def quiet_threshold(track: Track, chain: ChainConfig, per_hour: float) -> tuple[float, str]:
    """Return the lowest threshold from which on the rate of false alarms is low enough.

    With it comes a line with the rate and its bounds, at :data:`CONFIDENCE`.

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
    >>> quiet_threshold(track, ChainConfig(), per_hour=600.0)[1]
    'threshold 0.62, 4 false alarms in 0.0167 h: 82 to 549 an hour at 95% confidence'
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
    bounds = [bound / hours * cluster[first] for bound in (low, upper[first])]
    threshold = float(f'{limits[first]:.6g}')
    return threshold, (
        f'threshold {threshold:g}, {alarms[first]} false alarms in {hours:.3g} h: '
        f'{bounds[0]:.3g} to {bounds[1]:.3g} an hour at {CONFIDENCE:.0%} confidence'
    )


def _peaks(statistic: Floats, track: Track, chain: ChainConfig) -> Floats:
    """Return the largest statistic of each block of time; shape (blocks,)."""
    decision_s = chain.decision_window_s
    if chain.decision == 'evidence':
        decision_s = evidence_falls_s(chain)
    windows_s = chain.envelope_window_s + decision_s
    block_s = max(SHORTEST_BLOCK_S, WINDOWS_PER_BLOCK * windows_s)
    rows = max(round(block_s * track.sample_rate_hz), 1)
    return np.maximum.reduceat(statistic, range(0, statistic.size, rows))


def learnt_floors(chain: ChainConfig, tracks: Sequence[Track]) -> tuple[float, ...]:
    """Return the noise floor of each channel, below which two thirds of its envelopes at rest are.

    Rows with slip, and rows in which the chain settles or a channel is not valid, are not used;
    rows of motion are used only if there is no rest. A channel without noise gets the median of
    the other floors.

    Parameters
    ----------
    chain
        The chain that computes the envelope; its decision does not matter.
    tracks
        The recordings.

    Returns
    -------
    tuple of float
        In the unit of the envelope, four significant digits.

    Raises
    ------
    ValueError
        When no channel has any noise; names the recordings.

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
    plain = dataclasses.replace(chain, decision='mean')
    settling = settling_rows(plain)
    runner, envelopes = SlipChain(plain), []
    quiet = [REST] if any((track.kinds == REST).any() for track in tracks) else None
    for track in tracks:
        least = round(LEAST_S * track.sample_rate_hz)
        left = settling + max(MOST_ROWS // len(tracks), least)
        for begin, end, _ in track.stretches:
            runner.reset()
            rows = slice(begin, min(end, begin + left))
            result = runner.update(track.volts[rows], envelope=True, level=False)
            kinds = track.kinds[rows]
            counts = np.isin(kinds, quiet) if quiet else kinds != SLIP
            counts[:settling] = False
            envelopes.append(np.where(result.valid, result.envelope, np.nan)[counts])
            left -= counts.size
            if not left:
                break
    found = np.full(chain.channels, np.nan)
    for channel, column in enumerate(np.concatenate(envelopes).T):
        numbers = column[np.isfinite(column)]
        if numbers.size:
            found[channel] = np.quantile(numbers, BELOW_FLOOR)
    noisy = found[found > 0.0]
    if not noisy.size:
        raise ValueError(
            f'{", ".join(track.name for track in tracks)}: no channel has any noise, allowed: a '
            'recording at rest that is longer than the chain settles'
        )
    found[~(found > 0.0)] = np.median(noisy)
    return tuple(float(f'{floor:.4g}') for floor in found)


class MainsLine(NamedTuple):
    """A line in the spectrum of all channels.

    Attributes
    ----------
    hum_hz : float
        The multiple of the mains frequency that causes it.
    seen_hz : float
        Its frequency in the samples: an alias if ``hum_hz`` is above half the sample rate.
    least_db : float
        Its height above the noise on the channel where it is lowest.

    Examples
    --------
    >>> MainsLine(hum_hz=250.0, seen_hz=130.0, least_db=12.0).seen_hz  # folded, at 380 Hz
    130.0
    """

    hum_hz: float
    seen_hz: float
    least_db: float


class Mains(NamedTuple):
    """The mains frequency that causes lines in a recording.

    Attributes
    ----------
    mains_hz : float
        0 where there are none.
    lines : tuple of MainsLine

    Examples
    --------
    >>> print(Mains(50.0, (MainsLine(50.0, 50.0, 24.6), MainsLine(200.0, 112.5, 20.1))))
    mains of 50 Hz: lines of 50 Hz (25 dB), 200 Hz (20 dB, seen at 112.5 Hz) on all channels
    """

    mains_hz: float
    lines: tuple[MainsLine, ...]

    def __str__(self) -> str:
        if not self.lines:
            return f'no line of the mains is {LEAST_LINE_DB:g} dB above the noise on all channels'
        texts = []
        for line in self.lines:
            seen = '' if line.seen_hz == line.hum_hz else f', seen at {line.seen_hz:g} Hz'
            texts.append(f'{line.hum_hz:g} Hz ({line.least_db:.0f} dB{seen})')
        return f'mains of {self.mains_hz:g} Hz: lines of {", ".join(texts)} on all channels'


def find_mains(chain: ChainConfig, track: Track) -> Mains:
    """Return the mains frequency whose multiples stand out from the noise on all channels.

    The common mode is subtracted first if the chain subtracts it. A multiple above half the sample
    rate is sought at its alias. Of two mains frequencies the one with more lines is returned; with
    equally many, the one with the lower multiple, as multiples of both may have the same alias.

    Parameters
    ----------
    chain
        Its ``common_mode`` and ``disabled_channels`` are used.
    track
        A recording; the channels that are not flat in its longest stretch are examined.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> time_s = np.arange(6000)[:, np.newaxis] / 320.0
    >>> volts = np.random.default_rng(0).standard_normal((6000, 2))
    >>> volts += np.sin(2 * np.pi * 60.0 * time_s) + np.sin(2 * np.pi * 180.0 * time_s)
    >>> track = track_of('rest', [Samples.evenly(volts, 320.0, np.zeros(6000, bool))], 320.0)
    >>> [(line.hum_hz, line.seen_hz) for line in find_mains(ChainConfig(channels=2), track).lines]
    [(60.0, 60.0), (180.0, 140.0)]
    """
    rate_hz = track.sample_rate_hz
    disabled = [channel - 1 for channel in chain.disabled_channels]
    volts = _not_flat(np.delete(_longest_stretch(track), disabled, axis=1))
    if chain.common_mode != 'none' and volts.size:
        deviations = volts - volts[0]
        common = np.median if chain.common_mode == 'median' else np.mean
        volts = _not_flat(deviations - common(deviations, axis=1, keepdims=True))
    rows = round(SPECTRUM_S * rate_hz)
    if len(volts) < 2 * rows or not volts.shape[1]:
        return Mains(0.0, ())
    from scipy import signal

    hz, power = signal.welch(volts, rate_hz, nperseg=rows, axis=0)
    found = [Mains(mains_hz, tuple(_lines(mains_hz, hz, power, rate_hz))) for mains_hz in MAINS_HZ]
    best = max(found, key=_certainty)
    return best if best.lines else Mains(0.0, ())


def _certainty(mains: Mains) -> tuple[int, float, float]:
    """Return a sort key that is larger where this mains is more likely the cause of its lines."""
    lowest = min((line.hum_hz / mains.mains_hz for line in mains.lines), default=0.0)
    return len(mains.lines), -lowest, sum(line.least_db for line in mains.lines)


def _lines(mains_hz: float, hz: Floats, power: Floats, rate_hz: float) -> list[MainsLine]:
    """Return the lines at multiples of a mains frequency, each place in the spectrum once."""
    lines: list[MainsLine] = []
    for harmonic in range(1, HARMONICS + 1):
        hum_hz = harmonic * mains_hz
        seen_hz = abs(hum_hz - rate_hz * round(hum_hz / rate_hz))
        away = np.abs(hz - seen_hz)
        near = away <= STRAYS_HZ
        noise = (away >= NOISE_FROM_LINE_HZ[0]) & (away <= NOISE_FROM_LINE_HZ[1])
        taken = any(abs(line.seen_hz - seen_hz) < 2 * STRAYS_HZ for line in lines)
        if taken or seen_hz < LOWEST_LINE_HZ or not near.any() or not noise.any():
            continue
        ratios = power[near].max(axis=0) / np.median(power[noise], axis=0)
        least_db = 10.0 * float(np.log10(ratios.min()))
        if least_db >= LEAST_LINE_DB:
            lines.append(MainsLine(hum_hz, round(seen_hz, 6), least_db))
    return lines


def _not_flat(volts: Floats) -> Floats:
    return volts[:, np.ptp(volts, axis=0) > 0.0]


def _longest_stretch(track: Track) -> Floats:
    """Return the rows of the longest stretch; the median replaces values that are not numbers."""
    begin, end, _ = max(track.stretches, key=lambda one: one.end - one.begin)
    volts = track.volts[begin:end]
    good = np.isfinite(volts)
    columns = zip(volts.T, good.T, strict=True)
    medians = [np.median(column[ok]) if ok.any() else 0.0 for column, ok in columns]
    return np.where(good, volts, medians)


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
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = np.array([[0.0, 0.0, 0.0], [3.0, -2.0, 1.0], [3.0, -2.0, 2.0]])
    >>> track = track_of('a', [Samples.evenly(volts, 380.0, np.zeros(3, bool))], 380.0)
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
    for begin, end, _ in track.stretches:
        volts = track.volts[begin:end, enabled]
        good = (volts >= low) & (volts <= high)
        # The place of the last good sample up to each row; -1 before the first good one.
        places = np.where(good, np.arange(len(volts))[:, np.newaxis], -1)
        places = np.maximum.accumulate(places, axis=0)
        filled = np.where(places < 0, np.nan, np.take_along_axis(volts, places, axis=0))
        steps = np.nan_to_num(np.abs(np.diff(filled, axis=0)))
        found[begin + 1 : end] = np.sort(steps, axis=1)[:, ::-1]
    return found


def largest_slip_steps_v(chain: ChainConfig, tracks: Sequence[Track]) -> Floats:
    """Return the largest step that 1, 2, ... channels reach at once in rows with slip.

    Returns
    -------
    ndarray
        One step for each number of channels up to all enabled ones; 0 where there is no slip.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = np.full((4, 3), 4.3)
    >>> volts[2:, :2] += 0.5, 0.2
    >>> track = track_of('trial', [Samples.evenly(volts, 380.0, np.arange(4) > 0)], 380.0)
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
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = 4.3 + 1e-3 * np.random.default_rng(0).standard_normal((760, 2))
    >>> volts[380] += 1.0
    >>> track = track_of('knocks', [Samples.evenly(volts, 380.0, np.zeros(760, bool))], 380.0)
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


def impact_step(chain: ChainConfig, knocks: Track, tracks: Sequence[Track]) -> tuple[float, str]:
    """Return an ``impact_v`` between the steps of slips and those of knocks, and a line about it.

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
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> noise = np.random.default_rng(0).normal(0.0, 0.01, (2000, 2))
    >>> slips = track_of('slips', [Samples.evenly(noise, 380.0, np.ones(2000, bool))], 380.0)
    >>> noise[300::500] += 1.0
    >>> knocks = track_of('knocks', [Samples.evenly(noise, 380.0, np.zeros(2000, bool))], 380.0)
    >>> impact_v, line = impact_step(ChainConfig(channels=2), knocks, [slips])
    >>> 0.05 < impact_v < 1.0, '90 % of 4 knocks one above' in line
    (True, True)
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
    return impact_v, (
        f'impact_v {impact_v:g} V: no slip has a step above {slip_v:.4g} V, '
        f'{KNOCK_SHARE * 100:.0f} % of {steps_v.size} knocks one above {knock_v:.4g} V'
    )
