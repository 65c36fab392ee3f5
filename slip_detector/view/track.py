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

"""The last seconds of one finger: volts, levels and decisions with their stamps."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import ChainConfig

#: Seconds of the past that are kept, unless they need more than this memory.
KEPT_S = 60.0
MOST_BYTES = 64 * 2**20

#: A stamp that is earlier than the last one by more than this means that the clock was set back;
#: by less, that a message is late.
SET_BACK_NS = 1_000_000_000

Floats = NDArray[np.floating]
Stamps = NDArray[np.int64]


class Rows:
    """The last rows of a stream, with increasing stamps.

    Parameters
    ----------
    kept
        How many of the last rows are kept at least.
    fields
        For each field its type and its number of columns.

    Attributes
    ----------
    appended : int
        Number of rows ever appended, including those that are no longer kept.

    Examples
    --------
    >>> rows = Rows(2, {'level': (np.float32, 1)})
    >>> for k in range(5):
    ...     rows.append(np.array([10 * k]), level=[[k]])
    >>> rows.appended, rows.stamps_ns()[-2:].tolist(), rows.field('level')[-1].tolist()
    (5, [30, 40], [4.0])
    >>> rows.field('level', since=4).tolist()
    [[4.0]]
    """

    def __init__(self, kept: int, fields: Mapping[str, tuple[type, int]]) -> None:
        self._kept = kept
        # Twice the length, so that rows have to be moved to the beginning only rarely.
        self._stamps_ns = np.zeros(2 * kept, np.int64)
        self._fields: dict[str, NDArray[Any]] = {
            name: np.zeros((2 * kept, columns), kind) for name, (kind, columns) in fields.items()
        }
        self._end = 0
        self.appended = 0

    def __len__(self) -> int:
        return self._end

    def append(self, stamps_ns: Stamps, **fields: object) -> None:
        """Append rows; a row whose stamp is not later than all before it is left out."""
        stamps_ns = np.asarray(stamps_ns, np.int64)
        before = self._stamps_ns[self._end - 1] if self._end else np.iinfo(np.int64).min
        latest_ns = np.maximum.accumulate(np.append(before, stamps_ns))
        taken = np.flatnonzero(stamps_ns > latest_ns[:-1])[-self._kept :]
        if self._end + len(taken) > len(self._stamps_ns):
            self._move_to_the_beginning()
        place = slice(self._end, self._end + len(taken))
        self._stamps_ns[place] = stamps_ns[taken]
        # A broken sensor may send values beyond float32, or signalling NaNs.
        with np.errstate(over='ignore', invalid='ignore'):
            for name, values in fields.items():
                self._fields[name][place] = np.asarray(values)[taken]
        self._end += len(taken)
        self.appended += len(taken)

    def clear(self) -> None:
        """Forget all rows; the number of those appended stays."""
        self._end = 0

    def stamps_ns(self, since: int = 0) -> Stamps:
        """Return the stamps of the rows that are kept, shape (n,).

        Parameters
        ----------
        since
            Number of the first row to return, counted over all rows ever appended.
        """
        return self._stamps_ns[self._begin(since) : self._end]

    def field(self, name: str, since: int = 0) -> NDArray[Any]:
        """Return a view of a field of these rows, shape (n, columns); later rows overwrite it."""
        return self._fields[name][self._begin(since) : self._end]

    def columns(
        self, name: str, first: int, count: int, width_ns: int, channels: NDArray[np.intp]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and the highest value in each column of pixels.

        Column k has the stamps from ``k * width_ns`` up to, but not including,
        ``(k + 1) * width_ns``, so that its content does not change when the page scrolls.

        Parameters
        ----------
        name
            The field.
        first, count
            Number of the first column, and how many there are.
        width_ns
            Time of a column.
        channels
            Which columns of the field.

        Returns
        -------
        low, high : ndarray of float32, shape (channels, count)
            NaN where there is no row, or where all values are NaN.
        """
        low = np.full((len(channels), count), np.nan, np.float32)
        high = low.copy()
        edges_ns = (first + np.arange(count + 1, dtype=np.int64)) * width_ns
        edges = np.searchsorted(self._stamps_ns[: self._end], edges_ns)
        filled = np.flatnonzero(np.diff(edges))
        if len(filled) and len(channels):
            with np.errstate(over='ignore', invalid='ignore'):  # as above
                values = self._fields[name][edges[0] : edges[-1], channels].astype(np.float32)
            begins = edges[filled] - edges[0]
            # fmin and fmax ignore NaN unless there is nothing else.
            low[:, filled] = np.fmin.reduceat(values, begins, axis=0).T
            high[:, filled] = np.fmax.reduceat(values, begins, axis=0).T
        return low, high

    def _begin(self, since: int) -> int:
        return max(0, self._end - max(0, self.appended - since))

    def _move_to_the_beginning(self) -> None:
        kept = slice(max(0, self._end - self._kept), self._end)
        n = kept.stop - kept.start
        for values in (self._stamps_ns, *self._fields.values()):
            values[:n] = values[kept].copy()
        self._end = n


class LiveTrack:
    """The data of one finger in the last minute.

    Samples and the detector's output arrive in separate messages, and are kept in separate rows.

    Parameters
    ----------
    config
        The detector's parameters: the number of channels, and the rate.

    Attributes
    ----------
    channels : int
        Number of channels.
    samples : Rows
        ``volts`` of each channel, and ``truth``.
    levels : Rows
        ``level`` of each channel, NaN where it is not valid; ``on`` of each channel; ``slip``.
    beginnings : int
        How often the track was begun again, as when the clock of the samples is set back.

    Examples
    --------
    >>> track = LiveTrack(ChainConfig(channels=2))
    >>> track.take_samples(np.array([5, 9]), np.full((2, 2), 4.3), truth=np.array([0, 1]))
    >>> track.samples.field('truth')[:, 0].tolist()
    [False, True]
    """

    def __init__(self, config: ChainConfig) -> None:
        self.channels = channels = config.channels
        # Bytes of a channel: 8 of volts, 4 of level, 1 of ON; there is room for twice the rows.
        kept = min(config.samples(KEPT_S), MOST_BYTES // (2 * 13 * channels + 64))
        self.samples = Rows(kept, {'volts': (np.float64, channels), 'truth': (np.bool_, 1)})
        self.levels = Rows(
            kept,
            {'level': (np.float32, channels), 'on': (np.bool_, channels), 'slip': (np.bool_, 1)},
        )
        self.beginnings = 0

    def take_samples(self, stamps_ns: Stamps, volts: Floats, truth: NDArray[np.generic]) -> None:
        """Append samples: volts, shape (n, channels), and the true slip, shape (n,)."""
        self._begin_again_if_set_back(self.samples, stamps_ns)
        self.samples.append(stamps_ns, volts=volts, truth=np.reshape(truth, (-1, 1)))

    def take_levels(
        self,
        stamps_ns: Stamps,
        level: Floats,
        on: NDArray[np.generic],
        slip: NDArray[np.generic],
    ) -> None:
        """Append the detector's output: level and on, shape (n, channels), slip, shape (n,)."""
        self._begin_again_if_set_back(self.levels, stamps_ns)
        self.levels.append(stamps_ns, level=level, on=on, slip=np.reshape(slip, (-1, 1)))

    def _begin_again_if_set_back(self, rows: Rows, stamps_ns: Stamps) -> None:
        if len(rows) and len(stamps_ns) and stamps_ns[0] < rows.stamps_ns()[-1] - SET_BACK_NS:
            self.samples.clear()
            self.levels.clear()
            self.beginnings += 1
