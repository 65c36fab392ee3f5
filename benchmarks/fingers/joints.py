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

"""Joints of a rest with a slide, or with another rest, that are themselves no sign of sliding.

How late a detector is shows only where it is known when a slide begins. Where a recording is cut
and joined it is, but a careless joint is detected itself: phases of the mains and slow parts that
do not meet are a step. So the rows after a joint are shifted until their hum fits the end of the
rest, moved until the slow parts meet, and faded in. Beside joints with a slide stand those with
another rest of the same recording: what is "detected" there is the joint.
"""

import numpy as np
from scipy import signal

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Floats
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters import ChainConfig
from slip_detector.tuning.tracks import Track

#: What is slower than this meets at a joint; the rest is hum and noise.
SLOW_HZ = 5.0

#: Left out at each end of what is joined, where the slow part is not known and a slide may not be
#: over, or have begun.
GUARD_S = 0.16

#: A detection that is later belongs to what follows.
WITHIN_S = 0.3


def join(before: Floats, after: Floats, rate_hz: float, fade_rows: int) -> tuple[Floats, int]:
    """Join the end of some rows with others; return the rows and the first of the cross-fade.

    Parameters
    ----------
    before, after : ndarray, shapes (n, c) and (m, c)
        Each longer than the shift, the cross-fade and what is not known of the slow part.
    rate_hz
        Their rate.
    fade_rows
        Length of the cross-fade, whole periods of the mains. The rows after are shifted by up to
        twice as much.

    Examples
    --------
    >>> hum = np.sin(2 * np.pi * 50.0 * np.arange(2000) / 500.0)[:, np.newaxis]
    >>> joined, first = join(hum[:1000], 3.0 + hum[1007:], rate_hz=500.0, fade_rows=10)
    >>> first, bool(np.abs(joined - hum[: len(joined)]).max() < 0.1)
    (910, True)
    """
    low = signal.butter(2, min(SLOW_HZ, rate_hz / 4.0), fs=rate_hz, output='sos')
    slow, slow_after = (signal.sosfiltfilt(low, rows, axis=0) for rows in (before, after))
    guard = round(GUARD_S * rate_hz)
    end = slice(len(before) - guard - fade_rows, len(before) - guard)
    hum, hum_after = (before - slow)[end], after - slow_after
    misfits = [
        np.sum((hum - hum_after[at : at + fade_rows]) ** 2)
        for at in range(guard, guard + 2 * fade_rows)
    ]
    begin = guard + int(np.argmin(misfits))
    offset = slow[end].mean(axis=0) - slow_after[begin : begin + fade_rows].mean(axis=0)
    after, share = after[begin:] + offset, np.linspace(0.0, 1.0, fade_rows)[:, np.newaxis]
    faded = before[end] * (1.0 - share) + after[:fade_rows] * share
    return np.concatenate([before[: end.start], faded, after[fade_rows:]]), end.start


def joint_latencies_s(
    chain: ChainConfig, track: Track, with_slide: bool, fade_rows: int
) -> Floats:
    """Return when ``slip`` turns ON at the joints of a recording.

    Parameters
    ----------
    chain
        It runs from the beginning of the stretch through the rest and what is joined.
    track
        The recording.
    with_slide
        Whether each rest is joined with the next slide, or with the next rest.
    fade_rows
        As in :func:`join`.

    Returns
    -------
    ndarray
        Seconds from the middle of each joint before which ``slip`` is OFF; infinite where it does
        not turn ON within :data:`WITHIN_S`.
    """
    rate_hz, found = track.sample_rate_hz, []
    least = 3 * fade_rows + round((GUARD_S + WITHIN_S) * rate_hz)
    rests, slides = (
        [
            run
            for run in np.flatnonzero(np.diff(rows, prepend=0, append=0)).reshape(-1, 2).tolist()
            if run[1] - run[0] >= least
        ]
        for rows in (track.row_classes < SLIP, track.row_classes == SLIP)
    )
    for begin, end in rests:
        start = max(one.start for one in track.stretches if one.start <= begin)
        later = [run for run in (slides if with_slide else rests) if run[0] >= end]
        if not later or end - start < settling_rows(chain):
            continue
        parts = track.volts[begin:end], track.volts[slice(*later[0])]
        joined, first = join(*parts, rate_hz, fade_rows)
        volts, first = np.concatenate([track.volts[start:begin], joined]), first + begin - start
        middle = first + fade_rows // 2
        slip = SlipChain(chain).update(volts[: middle + round(WITHIN_S * rate_hz)]).slip
        on = np.flatnonzero(slip[first:])
        if not slip[first - 1]:
            found.append((first + on[0] - middle) / rate_hz if on.size else np.inf)
    return np.array(found)
