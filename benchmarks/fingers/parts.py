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

"""The recordings of a finger, and the parts that they are divided into.

Recordings with slips, and those of each kind, are dealt out in their order, one to each part in
turn. There are two parts; where four recordings or fewer have slips, each of these is in a part of
its own. The only recording of a kind is cut.
"""

import itertools
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.parameters import RecordingConfig, write_yaml
from slip_detector.recordings import group_recordings
from slip_detector.recordings.array_recordings import STAMPS_KEY
from slip_detector.recordings.labels import ACCURACY, KEY, KIND, labels_name
from slip_detector.tuning.tracks import Track, edges_of

#: With so many recordings with slips, or fewer, each is left out once.
FEW = 4

Tracks = Mapping[Path, Track]


def recordings_in(folder: Path) -> list[Path]:
    """Return the recordings in a folder, and those in the folders in it."""
    return [*itertools.chain(*group_recordings([str(folder)]).values())]


def divide(tracks: Tracks, config: RecordingConfig, folder: Path) -> list[list[Path]]:
    """Return the recordings of each part.

    Parameters
    ----------
    tracks
        The recordings by their paths; some have slips.
    config
        How arrays are named in recordings, and in those that are cut.
    folder
        A new folder for recordings that are cut.
    """
    groups: dict[str, list[Path]] = {}
    for path, track in tracks.items():
        groups.setdefault(KEY if track.slips else track.kind, []).append(path)
    many = len(groups[KEY]) if 1 < len(groups[KEY]) <= FEW else 2
    parts: list[list[Path]] = [[] for _ in range(many)]
    for name, paths in groups.items():
        one, its = len(paths) == 1, folder / (name or 'other')
        several = cut(tracks[paths[0]], many, config, its) if one else paths
        for k, path in enumerate(several):
            parts[k % many].append(path)
    return parts


def cut(track: Track, many: int, config: RecordingConfig, folder: Path) -> list[Path]:
    """Write a recording to a new folder as so many equal parts, cut where nothing slides."""
    folder.mkdir()
    edges, n = edges_of(track.samples), len(track.volts)
    free = (edges[:-1, 1] + edges[1:, 0]) // 2 if edges.size else np.arange(n)
    wanted = np.arange(1, many) * n // many
    places = {int(free[np.abs(free - place).argmin()]) for place in wanted if free.size}
    written: list[Path] = []
    for begin, end in itertools.pairwise([0, *sorted(places), n]):
        its = track.samples.take(slice(begin, end))
        arrays: dict[str, Any] = {STAMPS_KEY: its.stamps_ns}
        arrays[config.recording_volts_key] = its.volts
        arrays[config.recording_rate_key] = track.sample_rate_hz
        path = folder / f'{len(written)}.npz'
        np.savez(path, **arrays)
        times_s = (its.stamps_ns - its.stamps_ns[0]) * 1e-9
        # Half a row earlier, so that rounding moves no row to the other side.
        slips_s = np.interp(edges_of(its) - 0.5, np.arange(end - begin), times_s).tolist()
        about = {KIND: track.kind} if track.kind else {KEY: slips_s, ACCURACY: its.accuracy_s}
        write_yaml(folder / labels_name(path), about)
        written.append(path)
    return written
