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


"""A recording that is played on the live page as if it were live, and labelled by hand."""

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Floats, Samples
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters import ChainConfig, DetectorConfig, DriverConfig
from slip_detector.recordings import labels
from slip_detector.tuning.tracks import Track, track_of
from slip_detector.view.hand_labels import HandLabels, pairs_of
from slip_detector.view.recordings import trace_of
from slip_detector.view.server import Server

#: After so many seconds without a call of :meth:`PlayedBag.due` it has stood still.
STILL_S = 0.5

#: Least time, in seconds, by which the stamps jump where it goes on after it stood still, or at
#: another place. To the detector this is a long gap, after which it begins anew.
JUMP_S = 1.0

#: Most bins of the trace; it has more than half of them unless it is short. In half an hour a bin
#: is shorter than the error of an end that is set by eye.
BINS = 32_000


class PlayedBag:
    """A recording that pages play, stop and move, and whose labels they change.

    It can be seen and played once :meth:`read` has read it. An end of a label that is given by a
    key is as exact as hands are at the speed that was played; one that is set on the trace to
    0.1 s, or a pixel if that is longer.

    Parameters
    ----------
    server
        Gets the requests of its pages.
    path
        The recording.
    config, driver
        The parameters of the detector that it must suit, and where in it the samples are.
    finger
        Name of this detector.

    Raises
    ------
    ValueError
        When its labels cannot be read; names the file.
    """

    def __init__(
        self, server: Server, path: Path, config: DetectorConfig, driver: DriverConfig, finger: str
    ) -> None:
        self._server, self.path, self._finger = server, path, finger
        self._loader = RecordingLoader(config, driver)
        file = labels.find_labels(driver.recording_labels, path)
        self.file = file or path.parent / labels.labels_name(path)
        # How far it is read; then its rows, when each comes after the first one, and its labels.
        self._reading = 'opening'
        self._track: Track
        self._after_ns = np.array([], np.int64)
        self._labels: HandLabels | None = None
        self.duration_s, self.channel_names = 0.0, tuple[str, ...]()
        self.speed, self.playing = 1.0, True
        # The place, the next row, what is added to its stamp, and when :meth:`due` was called.
        self._at_s, self._next, self._later_ns, self._now_s = 0.0, 0, 0, -math.inf
        # Pairs in seconds: a stamp, and the place that was played from it on, None for none.
        self._places: list[tuple[float, float | None]] = []
        server.each_tick.append(self.tick)
        server.on_requests(self, 'bag_trace')
        changing = 'bag_play', 'bag_label', 'bag_snap', 'bag_undo_label'
        server.on_requests(self, *changing, changes=True)

    def read(self) -> None:
        """Read the recording, beside the server's loop.

        Raises
        ------
        ValueError
            When it cannot be read, does not suit the detector or is too large; names it.
        """
        opened = self._loader.open(self.path, require_truth=False)
        recording, pieces, n_bytes = opened.recording, list[Samples](), 0
        for piece in opened.rows:
            n_bytes += piece.volts.nbytes
            recording.check_size(n_bytes, 'what is played')
            pieces.append(piece)
            read_s = (piece.stamps_ns[-1] - pieces[0].stamps_ns[0]) * 1e-9
            self._reading = f'reading, {read_s / 60:.0f} min so far'
        self._track = track = track_of(str(self.path), pieces, opened.sample_rate_hz)
        after_ns = track.samples.stamps_ns - track.samples.stamps_ns[0]
        if (np.diff(after_ns) < 0).any():
            raise ValueError(f'{self.path}: its clock was set back, allowed: stamps that rise')
        self.channel_names = self._loader.chain_config.channel_names or recording.channel_names
        self._after_ns, self.duration_s = after_ns, float(after_ns[-1] * 1e-9)
        self._labels = HandLabels(self.file, recording.accuracy_s, lambda: track)

    def tick(self) -> None:
        """Report to all pages what is played, and where it is."""
        finger = self._server.detectors.fingers.get(self._finger)
        if finger is not None:
            # Nothing is due before it is read, or at its end.
            finger.paused = not self.playing or self._next == len(self._after_ns)
        ends = self._labels.ends if self._labels else []
        state: dict[str, Any] = {'name': self.path.name, 'labels': str(self.file)}
        state |= {'at_s': round(self._at_s, 3), 'speed': self.speed, 'playing': self.playing}
        state |= {'reading': '' if self._labels else self._reading, 'duration_s': self.duration_s}
        state |= {'changes': finger and finger.count, 'slip_s': pairs_of(ends)}
        self._server.broadcast('bag_places', {'places': self._places})
        self._server.broadcast('bag', state)

    def due(self, now_s: float) -> Iterator[tuple[int, Floats, bool]]:
        """Return the samples that are due: stamp as if live, volts, and the label.

        Parameters
        ----------
        now_s
            The time of :func:`time.monotonic`.
        """
        if not (self.playing and self._labels):
            return iter(())
        if now_s - self._now_s > STILL_S:
            self.move(self._at_s)
        passed_s, self._now_s = max(0.0, now_s - self._now_s), now_s
        self._at_s = min(self._at_s + passed_s * self.speed, self.duration_s)
        begin, self._next = self._next, self._row_at(self._at_s, 'right')
        self.playing = self._next < len(self._after_ns)
        due = self._track.samples.take(slice(begin, self._next))
        stamps_ns = self._after_ns[begin : self._next] + self._later_ns
        return zip(stamps_ns.tolist(), due.volts, self._label_of(due)['truth'], strict=True)

    def move(self, to_s: float) -> None:
        """Go on at another place, in seconds from the first sample."""
        last_ns = int(self._after_ns[max(self._next - 1, 0)]) + self._later_ns
        self._at_s = min(to_s, self.duration_s)
        self._next = self._row_at(self._at_s, 'left')
        to_ns = int(self._after_ns[self._next])
        # By whole seconds, so that a place and its stamp have the same decimals.
        least_s = math.ceil((last_ns - to_ns) * 1e-9 + JUMP_S)
        self._later_ns = max(least_s, (time.time_ns() - to_ns) // 10**9) * 10**9
        self._now_s = math.inf  # Until the next call nothing is due.
        begins = (to_ns + self._later_ns) * 1e-9, to_ns * 1e-9
        self._places = [*self._places[-14:], (last_ns * 1e-9, None), begins]  # A page shows few.

    def trace(self, config: ChainConfig) -> dict[str, Any]:
        """Return what a chain makes of the recording, see :func:`.trace_of`, and the labels."""
        ends = self.hand_labels.ends
        rows = [piece._replace(**self._label_of(piece)) for piece in self._track.rows()]
        traced = trace_of(config, rows, self._track.sample_rate_hz, BINS)
        return {**traced, 'duration_s': self.duration_s, 'slip_s': pairs_of(ends)}

    @property
    def hand_labels(self) -> HandLabels:
        """The labels; a ValueError while it is read."""
        if self._labels is None:
            raise ValueError(f'{self.path.name} is being read, allowed: when all is read')
        return self._labels

    def _row_at(self, at_s: float, side: Any) -> int:
        return int(np.searchsorted(self._after_ns, round(at_s * 1e9), side))

    def _label_of(self, rows: Samples) -> dict[str, Any]:
        """Return the present labels of rows."""
        return self.hand_labels.at(rows.stamps_ns - self._track.samples.stamps_ns[0])

    # What pages request.

    async def answer_bag_play(
        self, speed: float | None, to_s: float | None, playing: bool | None
    ) -> None:
        """Play, stop, or go on at another speed or place."""
        if to_s is None and playing and not self.playing:
            to_s = 0.0 if self._next == len(self._after_ns) else self._at_s
        self.speed = speed or self.speed
        self.playing = self.playing if playing is None else playing
        if to_s is not None and self._labels:
            self.move(to_s)

    async def answer_bag_trace(self) -> dict[str, Any]:
        """Return what the detector as it is would decide."""
        finger = self._server.detectors.fingers.get(self._finger)
        config = finger.config if finger else self._loader.chain_config
        return await self._server.work(self.trace, config)

    async def answer_bag_label(self, slip_s: Any, pixel_s: float | None) -> None:
        """Take all labels as a page has them; ``pixel_s`` is there if by eye, else by a key."""
        by_s = labels.BY_HAND_S * self.speed if pixel_s is None else pixel_s
        self.hand_labels.change(slip_s, by_s)

    async def answer_bag_snap(self) -> dict[str, str]:
        """Move the ends to where the power of the signal changes, if that is found."""
        return await self._server.work(self.hand_labels.snap)

    async def answer_bag_undo_label(self) -> None:
        """Take back the last change of the labels."""
        self.hand_labels.undo()
