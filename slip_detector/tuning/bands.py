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

"""The bands in which slides stand out from rest."""

from collections.abc import Sequence

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters.detector import ChainConfig
from slip_detector.recordings.rates import forward_filled
from slip_detector.tuning.tracks import Track, at_rest, enabled

#: Spectra are of so many rows at most, and of so many at least.
MOST_ROWS, LEAST_ROWS = 256, 32

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
    if rows < LEAST_ROWS:
        return [], 'slides are too short to measure where they stand out'
    rows = min(rows, MOST_ROWS)
    count = int(np.log(HIGHEST * rows) / np.log(RATIO))
    edges_hz: Floats = HIGHEST * rate_hz / RATIO ** np.arange(count, -1.0, -1.0)
    used = {*at_rest(tracks), *(track for track in tracks if track.slips)}
    levels = [_levels_db(track, chain, rows, edges_hz) for track in tracks if track in used]
    slides, rest = map(np.concatenate, zip(*levels, strict=True))
    if not len(slides) or not len(rest):
        return [], 'there is too little rest to measure where slides stand out'
    areas = np.array([_area(slides[:, b], rest[:, b]) for b in range(count)])
    best = int(np.argmax(areas))
    error = np.sqrt((len(slides) + len(rest) + 1) / (12 * len(slides) * len(rest)))
    if areas[best] < max(LEAST_AREA, min(0.5 + LEAST_ERRORS * error, 1.0)):
        return [], 'slides stand out from rest in no band'
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
    return bands, f'slides stand out from rest at {where}'


def _levels_db(
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
        volts = enabled(track.volts[begin:end], chain)
        volts = forward_filled(volts, ~np.isfinite(volts))
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


def _area(slides: Floats, rest: Floats) -> float:
    """Return the area under the ROC curve: how often a slide is above rest."""
    below = np.searchsorted(np.sort(rest), slides, side='left')
    upto = np.searchsorted(np.sort(rest), slides, side='right')
    return float((below + upto).mean() / (2 * rest.size))
