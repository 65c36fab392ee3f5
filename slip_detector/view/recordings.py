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


"""The recordings made on the live page: a folder for each finger, and the one that is written.

Each recording is a bag. Its name is its kind and a number.
"""

import asyncio
import contextlib
import math
import re
import shutil
import time
from collections.abc import Awaitable, Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from slip_detector.chain.filters import settling_rows
from slip_detector.chain.samples import Bools, Floats, Samples
from slip_detector.chain.slip_chain import SlipResult
from slip_detector.evaluation.evaluator import RecordingLoader
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.matching import OnIntervals
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters import (
    ChainConfig,
    DetectorConfig,
    file_errors_of,
    quote,
    rates_differ,
    refuse,
)
from slip_detector.recordings import Recording, labels, open_recording
from slip_detector.recordings.writing import BagWriter
from slip_detector.report.overview import MOST_CELLS, THRESHOLD_CODE, Overview
from slip_detector.tuning.labels import NOTHING_CHANGES
from slip_detector.tuning.tracks import Track, hold_out, track_of
from slip_detector.view.detectors import Finger
from slip_detector.view.hand_labels import HandLabels, pairs_of

#: Kinds of recordings.
KINDS = ('rest', 'slip', 'taps', 'press')
_NAME = re.compile(rf'({"|".join(KINDS)})_([1-9][0-9]{{0,8}})')

#: Note on a recording of kind ``slip`` that contains none.
NO_SLIP = 'has no slip'

#: Most bins of a recording's trace, which has more than half of them unless it is short; and the
#: share of the bins whose signal is below the level of rest.
TRACE_BINS, REST_SHARE = 600, 0.05

#: The median channel is averaged over so many seconds.
SMOOTHED_S = 0.2


class RecordingSummary(NamedTuple):
    """A recording made on the live page.

    Examples
    --------
    >>> recorded = RecordingSummary('slip_1', duration_s=20.0, slips=0)
    >>> recorded.kind, recorded.usable
    ('slip', False)
    """

    name: str
    #: Time of its rows, without gaps.
    duration_s: float
    slips: int
    #: What is wrong with it; empty if nothing is.
    note: str = ''
    #: Whether a person has marked its labels as a mistake.
    mistaken: bool = False
    #: Its rate by its stamps, if that is known.
    rate_hz: float | None = None

    @property
    def kind(self) -> str:
        """One of :data:`KINDS`."""
        return self.name.partition('_')[0]

    @property
    def usable(self) -> bool:
        """Whether a search can use it: one of kind ``slip`` must contain a slip."""
        counts = self.duration_s > 0.0 and not self.mistaken
        return counts and (self.kind != 'slip' or self.slips > 0)


class RecordedFolder:
    """The recordings of one finger, in a folder of their own, which need not exist.

    Examples
    --------
    >>> RecordedFolder(Path('recordings/index')).path_of('../../etc')
    Traceback (most recent call last):
    ValueError: there is no recording '../../etc', allowed: those listed
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        #: The recordings by their names, within a kind in the order of recording.
        self.recordings: dict[str, RecordingSummary] = {}
        #: Whether a search on them ended without a result before the page's server began.
        self.interrupted = False
        #: Name of the recording that is being made, which is not listed yet; '': none.
        self.writing = ''
        # The labels of those that pages have changed.
        self._labels: dict[str, HandLabels] = {}
        #: Rate of the detector, if it is known.
        self.sample_rate_hz = math.nan

    async def refresh(self, work: Callable[..., Awaitable[Any]] = asyncio.to_thread) -> None:
        """Update the list from the folder; ``work`` reads what is new or could not be used."""
        for name in self._bags() - {self.writing}:
            if name not in self.recordings or not self.recordings[name].usable:
                self.add(await work(self._summary, name))
        for name in self.recordings.keys() - self._bags():
            del self.recordings[name]

    def new_path(self, kind: str) -> Path:
        """Return an unused path for a recording of this kind."""
        paths = self.folder.glob(f'{kind}_*')
        numbers = [_order(path.name)[1] for path in paths if _NAME.fullmatch(path.name)]
        return self.folder / f'{kind}_{max(numbers, default=0) + 1}'

    def add(self, made: RecordingSummary) -> None:
        """Add a recording that was made; of its rows only the rate is read."""
        if made.rate_hz is None:
            with contextlib.suppress(ValueError):  # It cannot be read, which its note says.
                rate_hz = open_recording(self.folder / made.name).sample_rate_hz
                made = made._replace(rate_hz=rate_hz)
        every = {**self.recordings, made.name: made}
        self.recordings = {name: every[name] for name in sorted(every, key=_order)}

    def path_of(self, name: str) -> Path:
        """Return the folder of a recording, by the name that a page has sent.

        Raises
        ------
        ValueError
            When no recording has this name.
        """
        if name not in self.recordings:
            refuse(f'there is no recording {quote(name)}', 'those listed')
        return self.folder / name

    def delete(self, name: str) -> None:
        """Delete the folder of a recording, and its labels.

        Raises
        ------
        ValueError
            When no recording has this name, or it cannot be deleted.
        """
        path = self.path_of(name)
        with file_errors_of(path, 'deleted'):
            shutil.rmtree(path)
            (path.parent / labels.labels_name(path)).unlink(missing_ok=True)
        del self.recordings[path.name]
        self._labels.pop(path.name, None)

    def mark(self, name: str, mistaken: bool) -> None:
        """Mark a recording's labels as a mistake, or take that back.

        Raises
        ------
        ValueError
            When no recording has this name, or its file of labels cannot be changed.
        """
        path = self.path_of(name)
        labels.mark_mistaken(path, mistaken)
        self._labels.pop(name, None)  # The file has others now.
        self.recordings[name] = self._summary(name)

    def note_doubts(self, lines: Iterable[str]) -> None:
        """Note at recordings that a search has found nothing to change at their labels."""
        for name, _, doubt in (line.partition(': ') for line in lines):
            if name in self.recordings and doubt.startswith(NOTHING_CHANGES):
                self.recordings[name] = self.recordings[name]._replace(note=doubt)

    def trace(self, name: str, config: DetectorConfig) -> dict[str, Any]:
        """Return what a chain makes of a recording, see :func:`trace_of`, and its labels.

        Raises
        ------
        ValueError
            When no recording has this name, it cannot be read or is of other channels.
        """
        rows, rate_hz, _ = RecordingLoader(config).open(self.path_of(name), require_truth=False)
        return {**trace_of(config, rows, rate_hz), 'slip_s': pairs_of(self._labels_of(name).ends)}

    def change_labels(self, name: str, change: Callable[..., Any], *arguments: Any) -> Any:
        """Return the result of a method of :class:`.HandLabels` for those of a recording."""
        result = change(self._labels_of(name), *arguments)
        self.recordings[name] = self._summary(name)
        return result

    def _labels_of(self, name: str) -> HandLabels:
        path = self.path_of(name)
        if name not in self._labels:
            file, exact_s = path.parent / labels.labels_name(path), open_recording(path).accuracy_s
            self._labels[name] = HandLabels(file, exact_s, lambda: _read(path)[1])
        return self._labels[name]

    def off_rate(self, name: str) -> str:
        """Return why a recording's rate is not that of the detector; empty if it is."""
        rate_hz = self.recordings[name].rate_hz
        if rate_hz is None or not rates_differ(rate_hz, self.sample_rate_hz):
            return ''
        return f'has {rate_hz:.4g} Hz by its stamps, the detector {self.sample_rate_hz:g} Hz'

    def describe(self) -> dict[str, Any]:
        """Return what a page shows of the recordings; one of another rate cannot be used."""
        listed: list[dict[str, Any]] = []
        for name, summary in self.recordings.items():
            off_rate = self.off_rate(name)
            note = '; '.join(filter(None, (summary.note, off_rate)))
            state = {'note': note, 'usable': summary.usable and not off_rate}
            listed.append({**summary._asdict(), 'kind': summary.kind, 'held_out': False, **state})
        for kind in KINDS:
            usable = [each for each in listed if each['kind'] == kind and each['usable']]
            for each in hold_out(usable)[1]:
                each['held_out'] = True
        return {'recordings': listed, 'folder': str(self.folder), 'interrupted': self.interrupted}

    def _bags(self) -> set[str]:
        paths = self.folder.glob('*/*.mcap')
        return {p.stem for p in paths if p.stem == p.parent.name and _NAME.fullmatch(p.stem)}

    def _summary(self, name: str) -> RecordingSummary:
        """Read how long a recording is, and how many slips it has."""
        try:
            recording, track = _read(self.folder / name)
        except ValueError as error:
            return RecordingSummary(name, 0.0, 0, str(error))
        slips = len(track.slips) if recording.is_labelled else 0
        note = NO_SLIP if name.startswith('slip_') and not (slips or recording.mistaken) else ''
        if recording.counts.damage:
            note = f'was not ended: {recording.counts.damage}'
        how = note, recording.mistaken, recording.sample_rate_hz
        return RecordingSummary(name, track.duration_s, slips, *how)


def _read(path: Path) -> tuple[Recording, Track]:
    recording = open_recording(path)
    return recording, track_of(path.name, recording.rows(), recording.sample_rate_hz)


def trace_of(
    config: ChainConfig, rows: Iterable[Samples], rate_hz: float, bins: int = TRACE_BINS
) -> dict[str, Any]:
    """Return what a chain makes of rows, for a picture of them.

    Returns
    -------
    dict
        For each bin ``loudest`` and ``median`` of all channels, the envelope in dB, 0 at 1 V, None
        where no channel is valid, and ``level`` from 0 to 2, 1 at the threshold, the mean of all
        channels; ``rest_db``, of which the median is rarely below; ``slip_s`` and ``on_s``, the
        intervals of label and decision; and figures.
    """
    signal = _Signal('', config, (), bins * config.channels / MOST_CELLS, rate_hz)
    figures = figures_of_merit([Replay(config).run(rows, rate_hz, signal)])
    loudest_db, median_db = signal.curves_db()
    known_db = median_db[np.isfinite(median_db)]
    return {
        'duration_s': signal.rows / rate_hz,
        'bin_s': signal.bin_rows / rate_hz,
        'loudest': _as_json(loudest_db),
        'median': _as_json(median_db),
        'rest_db': round(np.quantile(known_db, REST_SHARE), 1) if known_db.size else None,
        'level': (signal.codes.mean(axis=1) / THRESHOLD_CODE).round(2).tolist(),
        'slip_s': _seconds(signal.truth, rate_hz),
        'on_s': _seconds(signal.slip, rate_hz),
        **{key: figures[key] for key in ('coverage', 'false_time_percent')},
    }


class _Signal(Overview):
    """An overview with the envelope in the place of the volts, once the chain has settled."""

    def add(self, volts: Floats, result: SlipResult, truth: Bools) -> None:
        super().add(np.where(result.valid, result.envelope, np.nan), result, truth)

    def curves_db(self) -> tuple[Floats, Floats]:
        """Return the loudest and the median channel of each bin in dB; NaN without a signal.

        The median is smoothed: of a slide that is hardly louder than rest, it is above all else.
        """
        with np.errstate(divide='ignore'):
            # The envelope is a power of the volts times the gain.
            each_db = 20.0 / self.config.exponent * np.log10(self.high.astype(np.float64))
        each_db -= 20.0 * np.log10(self.config.gain)
        # At the beginning and after each gap the filters settle.
        settling = np.ones(1 + -(-settling_rows(self.config) // self.bin_rows))
        absent = np.append(True, np.isnan(self.high).all(axis=1))
        each_db[np.convolve(absent, settling)[1 : len(absent)] > 0] = np.nan
        # Values that are no numbers come last.
        ordered = np.sort(np.where(np.isfinite(each_db), each_db, np.nan), axis=1)
        n, every = np.isfinite(ordered).sum(axis=1), np.arange(len(ordered))
        median_db, known = ordered[every, (n - 1) // 2], n > 0
        window = np.ones(min(1 + round(SMOOTHED_S * self.sample_rate_hz / self.bin_rows), len(n)))
        sums_db = np.convolve(np.where(known, median_db, 0.0), window, 'same')
        smooth_db = sums_db / np.maximum(np.convolve(known, window, 'same'), 1.0)
        return ordered[every, n - 1], np.where(known, smooth_db, np.nan)


def _as_json(values: Floats) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.round(1).tolist()]


def _seconds(intervals: OnIntervals, rate_hz: float) -> Any:
    return (np.reshape(intervals.edges, (-1, 2)) / rate_hz).round(4).tolist()


def _order(name: str) -> tuple[int, int]:
    kind, _, number = name.partition('_')
    return KINDS.index(kind), int(number)


class Recorder:
    """A recording that grows with the track of a finger.

    Each call of :meth:`write` writes all rows that have arrived, with the present label: whatever
    happens to this process, the recording is complete up to the last call. What cannot be written
    is noted in ``failure``; what was written before is kept.

    Parameters
    ----------
    path
        The folder of the new bag.
    finger
        Whose samples are recorded.
    since
        Number of the first row to record, counted over all rows that the track ever had.

    Raises
    ------
    ValueError
        When the bag cannot be created; names it.
    """

    def __init__(self, path: Path, finger: Finger, since: int) -> None:
        self.path, self.finger, self.kind = path, finger, path.name.partition('_')[0]
        self._beginnings, self._next_row = finger.track.beginnings, since
        #: Whether the rows from now on are labelled as slip.
        self.slipping = False
        #: When it was begun, and when a page has last said that the key is held.
        self.begun_s = self.held_s = time.monotonic()
        #: The stamp at which it ends: of a slip after it was released, else none.
        self.ends_ns = math.inf
        self._rate_hz = finger.config.sample_rate_hz
        #: Rows in the recording.
        self.rows = 0
        #: Whether some rows are labelled: a recording has one slip at most.
        self.has_slip = False
        #: Why no more can be written; empty if it can.
        self.failure = ''
        with file_errors_of(path):
            path.parent.mkdir(parents=True, exist_ok=True)
            frame = finger.frame_id or 'fingertip'
            slips = self.kind == 'slip'
            about: Any = {'accuracy_s': labels.BY_HAND_S} if slips else {'kind': self.kind}
            self._bag = BagWriter(path, finger.config.names, frame, **about)

    @property
    def duration_s(self) -> float:
        """Length of the recording so far, without gaps."""
        return self.rows / self._rate_hz

    @property
    def interrupted(self) -> bool:
        """Whether the track was begun again, so that new rows do not belong to this recording."""
        return self.finger.track.beginnings != self._beginnings

    @property
    def note(self) -> str:
        """What is wrong with the recording; empty if nothing is."""
        if self.failure:
            return f'was cut off: {self.failure}'
        missed = self.kind == 'slip' and not self.has_slip
        return f'{NO_SLIP}: no sample came while the key was held' if missed else ''

    def write(self) -> None:
        """Write the rows that have arrived, with the present label."""
        rows = self.finger.track.samples
        volts, stamps_ns = rows.field('volts', self._next_row), rows.stamps_ns(self._next_row)
        n = len(volts)
        if self.interrupted or self.failure or not n:
            return
        with self._noting_failure():
            self._bag.write(Samples(volts, stamps_ns, np.full(n, self.slipping)))
            self._bag.flush()
            self._bag.path.stat()  # Another program may have removed it.
            self._next_row = rows.appended
            self.rows += n
            self.has_slip |= self.slipping

    @contextlib.contextmanager
    def _noting_failure(self) -> Iterator[None]:
        try:
            with file_errors_of(self.path):
                yield
        except ValueError as error:
            self.failure = str(error)

    def label(self, slipping: bool) -> None:
        """Set whether the rows from now on are labelled as slip."""
        self.write()
        self.slipping = slipping

    def close(self) -> None:
        """End the recording; one without rows is removed."""
        self.write()
        if self.rows and not self.failure:
            with self._noting_failure():
                self._bag.close()
        self._bag.abort()  # Closes what is still open.
        if not self.rows:
            shutil.rmtree(self.path, ignore_errors=True)
