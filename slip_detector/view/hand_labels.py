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

"""The labels of a recording that pages change by hand."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Stamps
from slip_detector.parameters import file_errors_of, write_yaml
from slip_detector.recordings import labels
from slip_detector.tuning.tracks import Track, edges_of

#: Ends of slips, in order of time: seconds from the first sample, and how exact each is.
Ends = list[tuple[float, float]]


def pairs_of(ends: Ends) -> Any:
    """Return labels as a list of [start, end]."""
    return np.reshape([end_s for end_s, _ in ends], (-1, 2)).tolist()


def accuracy_of(ends: Ends) -> float:
    """Return how exact the least exact end is."""
    return max((by_s for _, by_s in ends), default=0.0)


class HandLabels:
    """Labels of which each change is written at once to the file beside the recording.

    The recording itself stays as it is. Each end has an accuracy of its own; the file has that of
    the least exact one.

    Parameters
    ----------
    file
        The file; where there is none, the labels are those of the recording itself.
    accuracy_s
        How exact they are at first.
    read
        Returns the recording.
    """

    def __init__(self, file: Path, accuracy_s: float, read: Callable[[], Track]) -> None:
        self.file, self._read = file, read
        samples, is_new = read().samples, not file.exists()
        after_s = (samples.stamps_ns - samples.stamps_ns[0]) * 1e-9
        self._last_s, self._kind = float(after_s[-1]), samples.kind
        stops_s = np.append(after_s, self._last_s)  # A slip may end with the recording.
        own_s = stops_s[edges_of(samples)].round(4) if samples.truth is not None else stops_s[:0]
        ends_s = own_s if is_new else labels.read_labels(file).edges_s
        self.ends: Ends = [(end_s, accuracy_s) for end_s in ends_s.ravel().tolist()]
        self._before: list[Ends] = []
        # The labels that the recording itself has: without a file they hold.
        self._own = self.ends if is_new else None

    def at(self, after_ns: Stamps) -> dict[str, Any]:
        """Return the labels at times after the first sample, see :func:`.label_times`."""
        ends_ns = np.rint(1e9 * np.ravel(pairs_of(self.ends))).astype(np.int64)
        return labels.label_times(after_ns, ends_ns, accuracy_of(self.ends))

    def change(self, slip_s: object, by_s: float) -> None:
        """Take all labels as a page has them; new ends are exact to ``by_s``."""
        wanted = labels.parse_labels(self.file, {labels.KEY: slip_s})
        # A label that ended later would be refused where the recording is read.
        last_s = math.floor(1e4 * self._last_s) / 1e4
        ends_s = np.minimum(wanted.edges_s.round(4), last_s).ravel().tolist()
        known, by_s = dict(self.ends), min(max(labels.BY_EYE_S, by_s), labels.MOST_S)
        self._keep([(end_s, known.get(end_s, by_s)) for end_s in ends_s])

    def snap(self) -> dict[str, str]:
        """Move the ends to where the power of the signal changes; return what was found."""
        before, track = self.ends, self._read()
        by_hand = np.array(pairs_of(before)), track.sample_rate_hz, labels.BY_HAND_S
        moved_s, found, said = labels.snap(track.samples, *by_hand)
        moved = zip(before, moved_s.ravel().round(4).tolist(), found.flat, strict=True)
        ends = [(s, labels.BY_EYE_S) if known else old for old, s, known in moved]
        if before is not self.ends:  # A page has changed them meanwhile.
            return {}
        self._keep(ends)
        return {'said': said}

    def undo(self) -> None:
        """Take back the last change, if any."""
        if self._before:
            self._write(self._before[-1])
            self.ends = self._before.pop()

    def _keep(self, ends: Ends) -> None:
        """Take other labels, if they can be written."""
        if ends != self.ends:
            self._write(ends)
            self._before.append(self.ends)
            self.ends = ends

    def _write(self, ends: Ends) -> None:
        document: dict[str, Any] = {labels.KEY: pairs_of(ends), labels.ACCURACY: accuracy_of(ends)}
        if self._kind and not ends:
            document = {labels.KIND: self._kind}
        labels.parse_labels(self.file, dict(document))
        if ends is self._own:
            with file_errors_of(self.file, 'deleted'):
                self.file.unlink(missing_ok=True)
        else:
            write_yaml(self.file, document, ['Labelled by hand on the page of slip_view.'])
