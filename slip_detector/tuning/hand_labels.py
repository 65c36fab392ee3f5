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

import numpy as np

from slip_detector.recordings.labels import BY_EYE_S, label_at, snapped
from slip_detector.tuning.tracks import Track, edges_of


def snap_labels(tracks: list[Track]) -> tuple[list[Track], list[str]]:
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
    ['slip_1: start 4.25 -> 4.00 s, end 6.20 -> 6.01 s; ± 0.1 s']
    """
    done, sentences, late_s = [*tracks], list[str](), list[float]()
    for k, track in enumerate(tracks):
        rows, by_s = track.samples, track.samples.accuracy_s
        if by_s <= BY_EYE_S or not track.slips or (np.diff(rows.stamps_ns) < 0).any():
            continue
        after_ns = np.append(rows.stamps_ns, rows.stamps_ns[-1] + 1) - rows.stamps_ns[0]
        edges_s = after_ns[edges_of(rows)] * 1e-9
        moved_s, found, said = snapped(rows, edges_s, track.sample_rate_hz, by_s)
        now_s = BY_EYE_S if found.all() else by_s
        label = label_at(after_ns[:-1], np.rint(1e9 * moved_s.ravel()).astype(np.int64), now_s)
        done[k] = dataclasses.replace(track, samples=rows._replace(accuracy_s=now_s, **label))
        sentences.append(f'{track.name}: {said}; ± {now_s:g} s')
        if (off_s := np.abs(moved_s - edges_s).max()) > by_s:
            late_s.append(off_s)
    if 10 * len(late_s) > len(sentences):  # One of ten may be off by chance.
        off = f'by up to {max(late_s):.2f} s: accuracy_s: {np.ceil(10 * max(late_s)) / 10:g} fits'
        sentences.append(f'{len(late_s)} of {len(sentences)} labels by hand were off {off}')
    return done, sentences
