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

"""Labels held against the signal: moved to where it changes, and doubted where it does not."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from slip_detector.chain.samples import Floats
from slip_detector.evaluation.scores import SLIP
from slip_detector.parameters import ChainConfig
from slip_detector.recordings.labels import BY_EYE_S, label_times, snap
from slip_detector.tuning.measuring import plain_chain
from slip_detector.tuning.tracks import Track, at_rest, drop_disabled, edges_of, envelopes

#: Length of the blocks in which a recording is compared with its kind.
BLOCK_S = 0.2

#: The level of a block is the one that a quarter of the channels exceed.
CHANNELS_BELOW = 0.75

#: The level of a slip is that of its fourth loudest block, as two knocks last for less; the level
#: of a slip of less than seven blocks is that of the middle one.
LOUD_BLOCKS = 4

#: Least difference of slips and rest, in dB, with which they can be distinguished.
LEAST_DB = 6.0

#: The sentence on slips in which nothing changes.
NOTHING_CHANGES = 'nothing changes at its slips'

#: Nothing changes in a slip in which the level rises by less than this share of the usual rise in
#: other slips, and by less than this number of dB.
NO_CHANGE, NO_CHANGE_DB = 0.25, 3.0

#: The least power, which a channel without signal has.
LEAST_POWER = 1e-60

#: A recording in which nothing slides is doubted if more than the first share of it is as loud as
#: slips: above rest by the second share of the dB that all slips but the third share reach.
CONTRADICTED, AS_LOUD, QUIET_SLIPS = 0.2, 0.75, 0.25


def snap_labels(tracks: list[Track]) -> tuple[list[Track], list[str]]:
    """Move labels by hand to where the power of the signal changes; see :func:`.snap`.

    Then a recording in which all ends of slips are found is exact to :data:`.BY_EYE_S`, any other
    as exact as before. Labels that are so exact already stay as they are.

    Returns
    -------
    tracks : list of Track
        All of them, in their order.
    sentences : list of str
        One on each recording whose labels are by hand, and which ``accuracy_s`` fits hands that
        are later than theirs.
    """
    snapped_tracks, sentences, late_s = [*tracks], list[str](), list[float]()
    for k, track in enumerate(tracks):
        rows, by_s = track.samples, track.samples.accuracy_s
        if by_s <= BY_EYE_S or not track.slips or (np.diff(rows.stamps_ns) < 0).any():
            continue
        after_ns = np.append(rows.stamps_ns, rows.stamps_ns[-1] + 1) - rows.stamps_ns[0]
        edges_s = after_ns[edges_of(rows)] * 1e-9
        moved_s, known, words = snap(rows, edges_s, track.sample_rate_hz, by_s)
        now_s = BY_EYE_S if known.all() else by_s
        label = label_times(after_ns[:-1], np.rint(1e9 * moved_s.ravel()).astype(np.int64), now_s)
        rows = rows._replace(accuracy_s=now_s, **label)
        snapped_tracks[k] = dataclasses.replace(track, samples=rows)
        sentences.append(f'{track.name}: {words}; ± {now_s:g} s')
        if (off_s := np.abs(moved_s - edges_s).max()) > by_s:
            late_s.append(off_s)
    if 10 * len(late_s) > len(sentences):  # One of ten may be off by chance.
        off = f'by up to {max(late_s):.2f} s: accuracy_s: {np.ceil(10 * max(late_s)) / 10:g} fits'
        sentences.append(f'{len(late_s)} of {len(sentences)} labels by hand were off {off}')
    return snapped_tracks, sentences


def contradictions(chain: ChainConfig, tracks: Sequence[Track]) -> tuple[list[str], list[Track]]:
    """Return which recordings contradict their kind, by the power in the chain's pass-band.

    The power, in blocks of :data:`BLOCK_S`, is compared with that of rest and of slips in the
    other recordings. Nothing is said where slips and rest hardly differ, nor of recordings in
    which something else than a slide may be as loud.

    Returns
    -------
    sentences : list of str
        One on each contradiction.
    mistakes : list of Track
        The recordings in which none of the slips is one.
    """
    levels, resting = [_Levels(chain, track) for track in tracks], at_rest(tracks)
    sentences, mistakes = [], []
    for track, own in zip(tracks, levels, strict=True):
        others = [each for each in levels if each is not own]
        known = [each.rest_db for each in others if each.track in resting and len(each.rest_db)]
        if not known:
            continue
        floors_db = np.median(np.concatenate(known), axis=0)
        slides_db = [db for each in others for _, db, _ in each.slips(floors_db)]
        usual_db = float(np.median(slides_db)) if slides_db else 0.0
        if usual_db < LEAST_DB:
            continue
        loud = _level_db(own.rest_db, floors_db) > AS_LOUD * np.quantile(slides_db, QUIET_SLIPS)
        if track.kind in ('rest', 'idle') and loud.sum() > CONTRADICTED * loud.size:
            sentences.append(
                f'{track.name} is labelled {track.kind}, but the level is as in a slide for '
                f'{100 * loud.mean():.0f} % of it'
            )
        slips = own.slips(floors_db)
        most_db = min(NO_CHANGE * usual_db, NO_CHANGE_DB)
        still = [f'{at_s:.1f}' for at_s, _, rises_db in slips if rises_db < most_db]
        if still:
            at = ', '.join(still)
            sentences.append(f'{track.name}: {NOTHING_CHANGES}, at {at} s: was a key mistaken?')
            mistakes += [track] if len(still) == len(slips) else []
    return sentences, mistakes


def _level_db(db: Floats, floors_db: Floats) -> Floats:
    """Return the level of each block above rest; shape (blocks,)."""
    return np.asarray(np.quantile(db - floors_db, CHANNELS_BELOW, axis=1))


class _Levels:
    """The power of a recording in the pass-band, in dB by block and channel.

    Attributes
    ----------
    rest_db : ndarray, shape (blocks, channels)
        Of blocks that certainly have no slip.
    """

    def __init__(self, chain: ChainConfig, track: Track) -> None:
        self.track = track
        self._rows = rows = max(round(BLOCK_S * track.sample_rate_hz), 1)
        whole = slice(len(track.volts) // rows * rows)
        levels = np.nan_to_num(drop_disabled(envelopes(plain_chain(chain), track), chain))
        squares = levels[whole].reshape(-1, rows, levels.shape[1]) ** 2
        self._known = np.all(squares.any(axis=2), axis=1)
        self._db = 10.0 * np.log10(np.maximum(squares.mean(axis=1), LEAST_POWER))
        no_slip = (track.row_classes[whole].reshape(-1, rows) < SLIP).all(axis=1)
        self.rest_db = self._db[self._known & no_slip]

    def slips(self, floors_db: Floats) -> list[tuple[float, float, float]]:
        """Return when each slip begins, its level, and by how much that is above its own rest."""
        slips, rate_hz, rows = [], self.track.sample_rate_hz, self._rows
        levels_db, rests_db = (_level_db(db, floors_db) for db in (self._db, self.rest_db))
        rest_db = float(np.median(rests_db)) if rests_db.size else 0.0
        inexact = round(self.track.samples.accuracy_s * rate_hz)
        for start, end in edges_of(self.track.samples):
            blocks = slice(max(start - inexact, 0) // rows, (end + inexact) // rows + 1)
            known_db = np.sort(levels_db[blocks][self._known[blocks]])
            if known_db.size:
                level_db = float(known_db[-min(LOUD_BLOCKS, (known_db.size + 1) // 2)])
                slips.append((start / rate_hz, level_db, level_db - rest_db))
        return slips
