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

"""Labels by late hands, moved to where the signal changes before anything is learnt from them."""

import dataclasses
import itertools
import math
from collections.abc import Sequence

import numpy as np

from slip_detector.chain.samples import Bools, Floats
from slip_detector.parameters.fields import name_list
from slip_detector.recordings.labels import BY_EYE_S, label_at, snapped
from slip_detector.tuning.tracks import Track, TrainingFiles, edges_of

#: Hands are later than was said if more than this share of the ends that were found is.
LATE_SHARE = 0.1

#: An accuracy that is proposed is a multiple of this.
STEP_S = 0.05


def snap_labels(tracks: Sequence[Track]) -> tuple[list[Track], list[str]]:
    """Move labels by hand to where the power of the signal changes; see :func:`.snapped`.

    A recording whose ends are all found is exact to :data:`.BY_EYE_S` then; else it is as exact as
    before. Labels that are as exact already stay as they are.

    Returns
    -------
    tracks : list of Track
        All of them, in their order.
    sentences : list of str
        One on each recording whose labels are by hand, and which ``accuracy_s`` fits hands that
        are later than theirs.

    Examples
    --------
    >>> from slip_detector.chain.samples import Samples
    >>> from slip_detector.tuning.tracks import track_of
    >>> volts = np.random.default_rng(1).normal(size=(1000, 4))
    >>> volts[400:600] *= 5.0
    >>> slip = (np.arange(1000) >= 425) & (np.arange(1000) < 620)
    >>> rows = Samples.evenly(volts, 100.0, slip, accuracy_s=0.35)
    >>> tracks, sentences = snap_labels([track_of('slip_1', [rows], 100.0)])
    >>> tracks[0].slips, tracks[0].samples.accuracy_s
    ((RowInterval(start=400, end=601),), 0.1)
    >>> sentences
    ['slip_1: start 4.25 -> 4.00 s, end 6.20 -> 6.01 s; exact to 0.1 s']
    """
    snapped_tracks, sentences = list(tracks), list[str]()
    offs_s, late_s = list[float](), list[float]()
    for k, track in enumerate(tracks):
        rows, by_s = track.samples, track.samples.accuracy_s
        set_back = (np.diff(rows.stamps_ns) < 0).any()
        if by_s <= BY_EYE_S or not track.slips or set_back:
            continue
        period_ns = round(1e9 / track.sample_rate_hz)
        after_ns = np.append(rows.stamps_ns, rows.stamps_ns[-1] + period_ns) - rows.stamps_ns[0]
        edges_s = after_ns[edges_of(rows)] * 1e-9
        moved_s, found = snapped(rows, edges_s, track.sample_rate_hz, by_s)
        now_s = BY_EYE_S if found.all() else by_s
        label = label_at(after_ns[:-1], np.rint(1e9 * moved_s.ravel()).astype(np.int64), now_s)
        samples = rows._replace(accuracy_s=now_s, **label)
        snapped_tracks[k] = dataclasses.replace(track, samples=samples)
        unknown = f'± {by_s:g} s: not known'
        sentences.append(f'{track.name}: {snapped_words(edges_s, moved_s, found, unknown)}')
        its_offs_s = np.abs(moved_s - edges_s)[found]
        offs_s += its_offs_s.tolist()
        late_s += its_offs_s[its_offs_s > by_s].tolist()
    if len(late_s) > LATE_SHARE * len(offs_s):
        fits_s = STEP_S * math.ceil((max(late_s) + STEP_S) / STEP_S)
        sentences.append(
            f'{len(late_s)} of {len(offs_s)} ends were off by more than accuracy_s, by up to '
            f'{max(late_s):.2f} s: accuracy_s: {fits_s:.2f} fits this hand'
        )
    return snapped_tracks, sentences


def snapped_words(
    edges_s: Floats, moved_s: Floats, found: Bools, unknown: str = 'as exact as before'
) -> str:
    """Return in words what :func:`.snapped` made of ends; ``unknown``: where one is not found.

    Examples
    --------
    >>> ends_s, moved_s = np.array([[1.92, 3.4]]), np.array([[1.61, 3.4]])
    >>> snapped_words(ends_s, moved_s, np.array([[True, False]]))
    'start 1.92 -> 1.61 s, end 3.40 s not found; as exact as before'
    """
    each = zip(itertools.cycle(('start', 'end')), edges_s.flat, moved_s.flat, found.flat)
    texts = [
        f'{what} {was_s:.2f} -> {now_s:.2f} s' if known else f'{what} {was_s:.2f} s not found'
        for what, was_s, now_s, known in each
    ]
    return f'{name_list(texts)}; {f"exact to {BY_EYE_S:g} s" if found.all() else unknown}'


def load_snapped(files: TrainingFiles) -> tuple[list[Track], list[Track], list[str]]:
    """Read files as :meth:`.TrainingFiles.load` does, and move labels by hand."""
    training, held, notes = files.load()
    tracks, sentences = snap_labels(training + held)
    return tracks[: len(training)], tracks[len(training) :], notes + sentences
