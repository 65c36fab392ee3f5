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

"""What is measured of a finger at rest and in slips: bands, floors, mains, steps, contact."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Floats
from slip_detector.evaluation.scores import REST, SLIP
from slip_detector.parameters import ChainConfig, refuse
from slip_detector.recordings.rates import fill_forward
from slip_detector.tuning.tracks import Track, at_rest, drop_disabled, edges_of, envelopes

#: Spectra are of so many rows at most, and of so many at least.
LONGEST_ROWS, SHORTEST_ROWS = 256, 32

#: This share of the rows of a spectrum has to slip, for it to be one of a slide.
SLIDING = 0.9

#: Narrow bands have this ratio of their edges; the highest edge is this share of the sample rate.
#: The lowest is above the lines of the spectrum that a trend would be in.
RATIO, HIGHEST = 2**0.5, 0.48

#: A band goes on as long as slides stand out by this share of where they stand out most.
SHARES = (0.5, 0.7, 0.85)

#: Below this area slides do not stand out, nor within so many standard errors of chance: of few
#: spectra the best of many bands has a large area by chance.
LEAST_AREA, LEAST_ERRORS = 0.6, 3.0

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

#: Share of the slips whose largest steps are below the returned one, and that share where labels
#: are by hand.
SHARE_OF_SLIPS, SHARE_BY_HAND = 0.9, 0.8

#: A finger that touches nothing stays below the level of contact for all but this share of time;
#: one that slides is above it for all but the second share.
IDLE_SHARE, SLIDE_SHARE = 0.05, 0.1

#: The level of a finger that slides is at least so many times that of one that touches nothing.
LEAST_CONTACT_RATIO = 1.2

#: The level of contact is at most this many times that of a finger that touches nothing, so that
#: contact is noticed as soon as a slide begins.
MOST_RATIO = 2.0


def slip_bands(
    chain: ChainConfig, tracks: Sequence[Track]
) -> tuple[list[tuple[float, float]], str]:
    """Return the bands in which slides stand out from rest, the widest first, and a line on them.

    How far they stand out in a narrow band is the area under the ROC curve of the level there, in
    dB and averaged over the channels, of spectra of slides against spectra of rest. A band that
    ends at the highest edge has 0 as its upper edge, as a high-pass has. There is no band where
    slides are too short, or nowhere louder than rest.
    """
    rate_hz = chain.sample_rate_hz
    lengths = [
        end - start - 2 * track.samples.accuracy_s * rate_hz
        for track in tracks
        for start, end in track.slips
    ]
    rows = 2 ** int(np.log2(max(np.median(lengths), 1))) if lengths else 0
    if rows < SHORTEST_ROWS:
        return [], 'Slides are too short to measure where they stand out'
    rows = min(rows, LONGEST_ROWS)
    count = int(np.log(HIGHEST * rows) / np.log(RATIO))
    edges_hz: Floats = HIGHEST * rate_hz / RATIO ** np.arange(count, -1.0, -1.0)
    used = {*at_rest(tracks), *(track for track in tracks if track.slips)}
    levels = [_band_levels_db(track, chain, rows, edges_hz) for track in tracks if track in used]
    slides, rest = map(np.concatenate, zip(*levels, strict=True))
    if not len(slides) or not len(rest):
        return [], 'There is too little rest to measure where slides stand out'
    areas = np.array([_roc_area(slides[:, b], rest[:, b]) for b in range(count)])
    best = int(np.argmax(areas))
    error = np.sqrt((len(slides) + len(rest) + 1) / (12 * len(slides) * len(rest)))
    if areas[best] < max(LEAST_AREA, min(0.5 + LEAST_ERRORS * error, 1.0)):
        return [], 'In no band do slides stand out from rest clearly'
    bands = []
    for share in SHARES:
        quiet = np.flatnonzero(areas - 0.5 < share * (areas[best] - 0.5))
        first = max(quiet[quiet < best], default=-1) + 1
        last = min(quiet[quiet > best], default=count)
        high_hz = 0.0 if last == count else float(edges_hz[last])
        band = float(f'{edges_hz[first]:.3g}'), float(f'{high_hz:.3g}')
        bands += [] if band in bands else [band]
    low_hz, high_hz = bands[-1]
    where = f'{low_hz:g} to {high_hz:g} Hz' if high_hz else f'{low_hz:g} Hz and more'
    return bands, f'Slides stand out from rest at {where}'


def _band_levels_db(
    track: Track, chain: ChainConfig, rows: int, edges_hz: Floats
) -> tuple[Floats, Floats]:
    """Return the levels of slides and of rest, mean over the channels, shapes (spectra, bands)."""
    from scipy import signal

    hz = np.fft.rfftfreq(rows, 1.0 / track.sample_rate_hz)
    # A band that is narrower than the lines of the spectrum has the nearest line.
    firsts = np.minimum(np.searchsorted(hz, edges_hz[:-1]), hz.size - 1)
    lasts = np.maximum(np.searchsorted(hz, edges_hz[1:]), firsts + 1)
    slides_db, rest_db = list[Floats](), list[Floats]()
    truth, slipping = np.asarray(track.samples.truth), track.row_classes == SLIP
    for begin, end in track.stretches:
        volts = drop_disabled(track.volts[begin:end], chain)
        volts = fill_forward(volts, ~np.isfinite(volts))
        for start in range(0, end - begin - rows + 1, rows // 2):
            labels = slice(begin + start, begin + start + rows)
            slides = slipping[labels].mean() >= SLIDING
            if slides or not truth[labels].any():
                part = signal.detrend(volts[start : start + rows], axis=0)
                power = np.abs(np.fft.rfft(part * np.hanning(rows)[:, np.newaxis], axis=0)) ** 2
                sums = np.cumsum(np.vstack([np.zeros(power.shape[1]), power]), axis=0)
                levels = np.log10(np.maximum(sums[lasts] - sums[firsts], 1e-60)).mean(axis=1)
                (slides_db if slides else rest_db).append(10.0 * levels)
    bands = edges_hz.size - 1
    return np.reshape(slides_db, (-1, bands)), np.reshape(rest_db, (-1, bands))


def _roc_area(slides: Floats, rest: Floats) -> float:
    """Return the area under the ROC curve: how often a slide is above rest."""
    below = np.searchsorted(np.sort(rest), slides, side='left')
    upto = np.searchsorted(np.sort(rest), slides, side='right')
    return float((below + upto).mean() / (2 * rest.size))


def learn_noise(
    chain: ChainConfig, tracks: Sequence[Track], shows_mains: Track
) -> tuple[dict[str, Any], list[str]]:
    """Learn mains of one recording and, where evidence decides, noise floors of some at rest.

    Return parameters by name, as ROS has them, and lines about them.
    """
    mains_hz, line = find_mains(chain, shows_mains)
    learnt, lines = dict[str, Any](), [f'On {shows_mains.name}: {line}']
    if chain.decision != 'evidence':
        return learnt, lines
    lasts_s = sum(track.duration_s for track in at_rest(tracks))
    if lasts_s < LEAST_S:
        refuse(f'{shows_mains.name}: lasts {lasts_s:.3g} s', f'at least {LEAST_S:g} s at rest')
    if mains_hz and not chain.mains_hz:
        try:
            chain = dataclasses.replace(chain, mains_hz=mains_hz)
            learnt['mains_hz'] = mains_hz
        except ValueError as error:
            lines.append(f'mains_hz cannot remove it: {error}')
    floors = learn_floors(chain, tracks)
    learnt |= {'noise_floor': list(floors), 'noise_floor_learnt': True}
    learnt['noise_floor_range_db'] = LEARNT_RANGE_DB
    return learnt, [*lines, f'Noise floors of {min(floors):.4g} to {max(floors):.4g}']


def learn_floors(chain: ChainConfig, tracks: Sequence[Track]) -> tuple[float, ...]:
    """Return the noise floor of each channel, below which two thirds of its envelopes at rest are.

    Rows with slip, and rows in which the chain settles or a channel is not valid, are not used;
    rows of motion are used only if there is no rest. A channel without noise gets the median of
    the other floors.
    """
    plain, tracks = dataclasses.replace(chain, decision='mean'), at_rest(tracks)
    classes = [REST] if any((track.row_classes == REST).any() for track in tracks) else range(SLIP)
    levels = []
    for track in tracks:
        most = max(MOST_ROWS // len(tracks), round(LEAST_S * track.sample_rate_hz))
        rows = envelopes(plain, track, settling_rows(plain) + most)
        levels.append(rows[np.isin(track.row_classes[: len(rows)], classes)])
    columns = [column[np.isfinite(column)] for column in np.concatenate(levels).T]
    floors = np.array(
        [np.quantile(column, BELOW_FLOOR) if column.size else 0.0 for column in columns]
    )
    if not floors.any():
        names = ', '.join(track.name for track in tracks)
        text = 'a recording at rest that is longer than the chain settles'
        refuse(f'{names}: no channel has any noise', text)
    floors[floors == 0.0] = np.median(floors[floors > 0.0])
    return tuple(float(f'{floor:.4g}') for floor in floors)


def find_mains(chain: ChainConfig, track: Track) -> tuple[float, str]:
    """Return the mains frequency whose multiples stand out from the noise on all channels.

    With it comes a line with these multiples; without any the frequency is 0. The common mode is
    subtracted first if the chain subtracts it. A multiple above half the sample rate is sought at
    its alias. Of two mains frequencies the one with more lines is returned; with equally many, the
    one with the lower multiple, as multiples of both may have the same alias.
    """
    rate_hz, rows = track.sample_rate_hz, round(SPECTRUM_S * track.sample_rate_hz)
    longest = max(track.stretches, key=lambda stretch: stretch.end - stretch.start)
    volts = drop_disabled(track.volts, chain)[slice(*longest)]
    volts = fill_forward(volts, ~np.isfinite(volts))
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
    best = max(lines, key=lambda hz: (len(lines[hz]), -min(lines[hz], default=0)))
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


def slip_steps_v(chain: ChainConfig, tracks: Sequence[Track], rows: int = 1) -> Floats:
    """Return the steps over some rows that 1, 2, ... channels reach at once in slips; shape (c,).

    Nine in ten slips stay below them. Of labels by hand it is eight in ten: a hand may have
    pressed the key as something knocked.
    """
    low_v, high_v = chain.valid_range_v
    largest = []
    for track in tracks:
        volts = drop_disabled(track.volts, chain)
        steps = np.zeros(volts.shape)
        for begin, end in track.stretches:
            part = volts[begin:end]
            filled = fill_forward(part, ~((part >= low_v) & (part <= high_v)))
            each = np.abs(filled[rows:] - filled[:-rows])
            steps[begin + rows : end] = np.sort(each, axis=1)[:, ::-1]
        # Also where the label is not certain, as the first rows of a slip may be its largest.
        largest += [steps[start:end].max(axis=0) for start, end in edges_of(track.samples)]
    by_hand = any(track.samples.accuracy_s for track in tracks)
    share = SHARE_BY_HAND if by_hand else SHARE_OF_SLIPS
    return np.asarray(np.quantile(largest, share, axis=0, method='higher'))


def plain_chain(chain: ChainConfig) -> ChainConfig:
    """Return a chain whose envelope is the level in the pass-band."""
    return dataclasses.replace(chain, decision='mean', gain=1.0, exponent=1)


def contact_level_v(chain: ChainConfig, tracks: Sequence[Track]) -> float:
    """Return a ``contact_level_v`` between a finger that touches nothing and one that slides.

    What counts is the loudest row within ``contact_hold_s``, as contact lasts so long. A finger
    touches nothing in recordings of the kind ``idle``.

    Raises
    ------
    ValueError
        When no recording shows that, or touch makes no difference.
    """
    band: dict[str, Any] = {'passband_hz': chain.activity_band_hz, 'passband_degree': 4}
    band |= {'stopbands_hz': (), 'mains_hz': 0.0, 'rectify': 'full'}
    low = dataclasses.replace(plain_chain(chain), **band)
    held = chain.samples(chain.contact_hold_s)
    idle, slides = [np.zeros(0)], [np.zeros(0)]
    for track in tracks:
        levels = np.nan_to_num(envelopes(low, track))
        settled, touching = levels.any(axis=1), np.sort(levels, axis=1)[:, -chain.contact_channels]
        slides.append(_loudest(touching[settled & (track.row_classes == SLIP)], held))
        if track.kind == 'idle':
            idle.append(_loudest(touching[settled], held))
    of_each = (np.concatenate(idle), 1.0 - IDLE_SHARE), (np.concatenate(slides), SLIDE_SHARE)
    idle_v, slide_v = (float(np.quantile(v, share)) if v.size else 0.0 for v, share in of_each)
    if not idle_v or slide_v < LEAST_CONTACT_RATIO * idle_v:
        what = f'a finger that touches nothing has a level of {idle_v:.4g}, one that slides of '
        refuse(f'{what}{slide_v:.4g}', f'{LEAST_CONTACT_RATIO:g} times as much')
    return float(f'{min(MOST_RATIO * idle_v, np.sqrt(idle_v * slide_v)):.4g}')


def _loudest(levels: Floats, rows: int) -> Floats:
    """Return the largest of each so many levels."""
    return np.maximum.reduceat(levels, range(0, levels.size, rows)) if levels.size else levels
