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

import bisect
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Floats, Samples, Stamps
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.parameters import ChainConfig, DetectorConfig, DriverConfig
from slip_detector.parameters.fields import quote
from slip_detector.recordings import labels
from slip_detector.view.hand_labels import HandLabels, accuracy_of, pairs_of
from slip_detector.view.recordings import trace_of
from slip_detector.view.server import Server
from slip_detector.view.view_request import Message, number

#: Allowed speeds, as multiples of real time.
SPEEDS = 0.1, 10.0

#: After so many seconds without a call of :meth:`PlayedBag.due` it has stood still.
STILL_S = 0.5

#: Time, in seconds, by which the stamps jump at least where it goes on after it stood still, or at
#: another place. To the detector this is a long gap: it begins anew.
JUMP_S = 1.0

#: Bins of the trace: at most so many, and more than half of them, unless it is short. In half an
#: hour one is shorter than an end that is set by eye may be off.
BINS = 32_000


class PlayedBag:
    """A recording that pages play, stop and move, and whose labels they change.

    :meth:`read` reads it; meanwhile what is read can be seen and played. An end of a label that is
    given by a key is as exact as hands are at the speed that was played; one that is set on the
    trace to 0.1 s, or a pixel if that is longer.

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
        # What is read: the rows in pieces, the number of the first row of each, and when each row
        # comes after the first one. Whether that is all, and how long it is or may be.
        self._pieces, self._firsts = list[Samples](), list[int]()
        self._after_ns: Stamps = np.array([], np.int64)
        self._whole, self.read_s, self.duration_s = False, 0.0, 0.0
        self.channel_names: tuple[str, ...] = ()
        # The labels, once all is read; the number of changes of them, detector and what is read.
        self._labels = HandLabels(self.file, [], 0.0, self._all_rows)
        self._changes, self._seen = 0, tuple[Any, ...]()
        self.speed, self.playing = 1.0, True
        # The place, the next row, what its stamp has more, and the time of the last call.
        self._at_s, self._next, self._later_ns, self._now_s = 0.0, 0, 0, -math.inf
        # From which stamp on which place was played; None: none. In seconds.
        self._places: list[tuple[float, float | None]] = []
        server.each_tick.append(self.tick)
        server.on_request('bag_trace', self._trace, latest_only=True)
        server.on_request('bag_snap', self._snap, changes=True, latest_only=True)
        server.on_request('bag_play', self._play, changes=True)
        server.on_request('bag_label', self._label, changes=True)
        server.on_request('bag_undo_label', self._undo, changes=True)

    def read(self) -> None:
        """Read the recording, beside the server's loop.

        Raises
        ------
        ValueError
            When it cannot be read, does not suit the detector or is too large; names it.
        """
        opened = self._loader.open(self.path, require_truth=False)
        recording, n_bytes = opened.recording, 0
        self.channel_names = self._loader.chain_config.channel_names or recording.channel_names
        self._rate_hz = opened.sample_rate_hz
        self.duration_s = (recording.n_rows or 0) / recording.sample_rate_hz
        for piece in opened.rows:
            n_bytes += piece.volts.nbytes
            recording.check_size(n_bytes, 'what is played')
            self._pieces.append(piece)
            after_ns = piece.stamps_ns - self._pieces[0].stamps_ns[0]
            if (np.diff(after_ns, prepend=self._after_ns[-1:]) < 0).any():
                raise ValueError(f'{self.path}: its clock was set back, allowed: stamps that rise')
            self._firsts.append(len(self._after_ns))
            self._after_ns = np.append(self._after_ns, after_ns)
            self.read_s = float(after_ns[-1] * 1e-9)
            self.duration_s = max(self.duration_s, self.read_s)
        self.duration_s = self.read_s
        if self.file.exists():
            ends_s = labels.read_labels(self.file).edges_s
        else:
            truth = np.concatenate([piece.truth for piece in self._pieces])
            changes = np.flatnonzero(np.diff(truth, prepend=False, append=False))
            ends_s = np.append(self._after_ns * 1e-9, self.duration_s)[changes].round(4)
        ends = [(end_s, recording.accuracy_s) for end_s in ends_s.ravel().tolist()]
        how = self.duration_s, self._all_rows, recording.kind
        self._labels = HandLabels(self.file, ends, *how)
        self._whole = True

    def tick(self) -> None:
        """Report to all pages what is played, and where it is."""
        finger = self._server.detectors.fingers.get(self._finger)
        if finger is not None:
            # Nothing is due before the first rows are read, or at the end of those that are.
            finger.paused = not self.playing or self._next == len(self._after_ns)
        # While it is read, the trace is computed anew when four times as much is there.
        amount = len(self._after_ns).bit_length() // 2
        seen = finger and finger.config, amount, self._whole, *self._labels.ends
        if seen != self._seen:
            self._seen = seen
            self._changes += 1
        far = f'reading {self.read_s / 60:.0f} of {self.duration_s / 60:.0f} min'
        reading = '' if self._whole else far if self._pieces else 'opening'
        state: dict[str, Any] = {'name': self.path.name, 'labels': str(self.file)}
        state |= {'at_s': round(self._at_s, 3), 'speed': self.speed, 'playing': self.playing}
        state |= {'reading': reading, 'duration_s': self.duration_s}
        state |= {'changes': self._changes, 'slip_s': pairs_of(self._labels.ends)}
        self._server.broadcast('bag_places', {'places': self._places})
        self._server.broadcast('bag', state)

    def due(self, now_s: float) -> Iterator[tuple[int, Floats, bool]]:
        """Return the samples that are due: stamp as if live, volts, and the label.

        Parameters
        ----------
        now_s
            The time of :func:`time.monotonic`.
        """
        if not (self.playing and len(self._after_ns)):
            return iter(())
        if now_s - self._now_s > STILL_S:
            self.move(self._at_s)
        passed_s, self._now_s = max(0.0, now_s - self._now_s), now_s
        self._at_s = min(self._at_s + passed_s * self.speed, self.read_s)
        begin, self._next = self._next, self._row_at(self._at_s, 'right')
        self.playing = not self._whole or self._next < len(self._after_ns)
        due = self._rows(begin, self._next)
        stamps_ns = self._after_ns[begin : self._next] + self._later_ns
        return zip(stamps_ns.tolist(), due.volts, self._label_of(due)['truth'], strict=True)

    def move(self, to_s: float) -> None:
        """Go on at another place that is read, in seconds from the first sample."""
        last_ns = int(self._after_ns[max(self._next - 1, 0)]) + self._later_ns
        self._at_s = min(to_s, self.read_s)
        self._next = self._row_at(self._at_s, 'left')
        to_ns = int(self._after_ns[self._next])
        # Whole seconds stay whole ones.
        least_s = math.ceil((last_ns - to_ns) * 1e-9 + JUMP_S)
        self._later_ns = max(least_s, (time.time_ns() - to_ns) // 10**9) * 10**9
        self._now_s = math.inf  # Until the next call nothing is due.
        begins = (to_ns + self._later_ns) * 1e-9, to_ns * 1e-9
        self._places = [*self._places[-14:], (last_ns * 1e-9, None), begins]  # The last ones do.

    def trace(self, config: ChainConfig) -> dict[str, Any]:
        """Return what a chain makes of the recording, see :func:`.trace_of`, and the labels."""
        # Meanwhile more may be read.
        rows = [piece._replace(**self._label_of(piece)) for piece in self._pieces]
        traced = trace_of(config, rows, self._rate_hz, BINS)
        read_s = traced['duration_s']
        times = {'read_s': read_s, 'duration_s': max(read_s, self.duration_s)}
        return {**traced, **times, 'slip_s': pairs_of(self._labels.ends)}

    def _rows(self, begin: int, stop: int) -> Samples:
        """Return some rows of what is read."""
        first = max(bisect.bisect_right(self._firsts, begin) - 1, 0)
        pieces = self._pieces[first : max(bisect.bisect_left(self._firsts, stop), first + 1)]
        offset = self._firsts[first]
        return pieces[0].then(*pieces[1:]).take(slice(begin - offset, stop - offset))

    def _all_rows(self) -> tuple[Samples, float]:
        return self._rows(0, len(self._after_ns)), self._rate_hz

    def _row_at(self, at_s: float, side: Any) -> int:
        return int(np.searchsorted(self._after_ns, round(at_s * 1e9), side))

    def _label_of(self, rows: Samples) -> dict[str, Any]:
        """Return the present labels of rows, see :func:`.label_times`."""
        ends_ns = np.rint(1e9 * np.ravel(pairs_of(self._labels.ends))).astype(np.int64)
        after_ns = rows.stamps_ns - self._pieces[0].stamps_ns[0]
        return labels.label_times(after_ns, ends_ns, accuracy_of(self._labels.ends))

    def _known_labels(self) -> HandLabels:
        if not self._whole:  # Those in the recording itself are not known yet.
            raise ValueError(f'{self.path.name} is being read, allowed: labels when all is read')
        return self._labels

    # What pages request.

    async def _play(self, message: Message) -> None:
        speed, to_s = number('speed', message, *SPEEDS), number('to_s', message, 0.0, math.inf)
        playing = message.get('playing', self.playing)
        if not isinstance(playing, bool):
            raise ValueError(f'playing is {quote(playing)}, allowed: true, false')
        if to_s is None and playing and not self.playing:
            to_s = 0.0 if self._whole and self._next == len(self._after_ns) else self._at_s
        self.speed, self.playing = speed or self.speed, playing
        if to_s is not None and len(self._after_ns):
            self.move(to_s)

    async def _trace(self, message: Message) -> dict[str, Any]:
        finger = self._server.detectors.fingers.get(self._finger)
        config = finger.config if finger else self._loader.chain_config
        if not self._pieces:
            raise ValueError('nothing of it is read yet, allowed: in a moment')
        return await self._server.work(self.trace, config)

    async def _label(self, message: Message) -> None:
        """Take all labels as a page has them; ``pixel_s`` is there if by eye, else by a key."""
        pixel_s = number('pixel_s', message, 0.0, 1e9)
        late_s = labels.BY_HAND_S * self.speed if pixel_s is None else pixel_s
        self._known_labels().change(message.get('slip_s'), late_s)

    async def _snap(self, message: Message) -> dict[str, Any]:
        """Move the ends to where the power of the signal changes, if that is found."""
        return await self._server.work(self._known_labels().snap)

    async def _undo(self, message: Message) -> None:
        self._known_labels().undo()
