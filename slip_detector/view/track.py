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


"""The last minute of one finger: volts, levels and decisions with their stamps; spectra."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from slip_detector.chain.samples import Bools, Floats, Samples, Stamps
from slip_detector.parameters import ChainConfig

#: Seconds of the past that are kept, unless they need more than this memory.
KEPT_S = 60.0
MOST_BYTES = 64 * 2**20

#: A stamp that is earlier than the last one by more than this means that the clock was set back;
#: by less, that a message is late.
SET_BACK_NS = 1_000_000_000

#: A row is overdue after so many periods. The period is the median of so many last steps.
OVERDUE_PERIODS, MOST_STEPS = 3, 100

#: Length of a short spectrum, in seconds, which resolves half a hertz.
SEGMENT_S = 2.0

#: Most rows of a short spectrum, and how many short spectra, which overlap by half, are averaged.
MOST_ROWS, SEGMENTS = 4096, 5

#: Fewest rows that make a spectrum.
FEWEST_ROWS = 32

#: Least density, in V^2/Hz: a channel that repeats one value has a density of zero.
LEAST_V2_HZ = 1e-30


class Rows:
    """The last rows of a stream, with increasing stamps.

    Examples
    --------
    >>> rows = Rows(2, level=(np.float32, 1))
    >>> for k in range(5):
    ...     rows.append(np.array([10 * k]), level=[[k]])
    >>> rows.appended, rows.stamps_ns()[-2:].tolist(), rows.field('level', since=4).tolist()
    (5, [30, 40], [[4.0]])
    """

    def __init__(self, kept: int, **fields: tuple[type, int]) -> None:
        """Keep at least the last ``kept`` rows; of each field its type and number of columns."""
        shapes = [(name, kind, (columns,)) for name, (kind, columns) in fields.items()]
        row = np.dtype([('stamp_ns', np.int64), *shapes], align=True)
        # Twice the length, so that rows have to be moved to the beginning only rarely.
        self._kept, self._rows, self._end = kept, np.zeros(2 * kept, row), 0
        #: Number of rows ever appended, including those that are no longer kept.
        self.appended = 0

    def append(self, stamps_ns: Stamps, **fields: object) -> None:
        """Append rows; a row whose stamp is not later than all before it is left out."""
        before = self._rows['stamp_ns'][self._end - 1] if self._end else np.iinfo(np.int64).min
        latest_ns = np.maximum.accumulate(np.append(before, stamps_ns))
        later = np.flatnonzero(stamps_ns > latest_ns[:-1])[-self._kept :]
        if self._end + len(later) > len(self._rows):
            n = min(self._kept, self._end)
            self._rows[:n] = self._rows[self._end - n : self._end].copy()
            self._end = n
        place = self._rows[self._end : self._end + len(later)]
        # A broken sensor may send values beyond float32, or signalling NaNs.
        with np.errstate(over='ignore', invalid='ignore'):
            for name, values in {'stamp_ns': stamps_ns, **fields}.items():
                place[name] = np.asarray(values)[later]
        self._end += len(later)
        self.appended += len(later)

    def __len__(self) -> int:
        return self._end

    def clear(self) -> None:
        """Forget all rows; the number of those appended stays."""
        self._end = 0

    def stamps_ns(self, since: int = 0) -> Stamps:
        """Return the stamps of the rows that are kept, from this number ever appended on."""
        return self.field('stamp_ns', since)

    def field(self, name: str, since: int = 0) -> NDArray[Any]:
        """Return a view of a field of these rows, shape (n, columns); later rows overwrite it."""
        begin = max(0, self._end - max(0, self.appended - since))
        return self._rows[name][begin : self._end]

    def overdue_ns(self) -> int:
        """Return the longest step between two rows that is no gap."""
        steps_ns = np.diff(self.stamps_ns()[-MOST_STEPS - 1 :])
        return int(OVERDUE_PERIODS * np.median(steps_ns)) if len(steps_ns) else 0

    def columns(
        self, name: str, edges_ns: Stamps, channels: NDArray[np.intp], overdue_ns: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return the lowest and the highest value of a field in each column of pixels.

        Parameters
        ----------
        name, channels
            The field, and which of its columns.
        edges_ns
            Column k has the stamps from ``edges_ns[k]`` up to, but not including,
            ``edges_ns[k + 1]``. Without a row it has the value before, ...
        overdue_ns
            ... unless the rows before and after it are farther apart than this.

        Returns
        -------
        low, high : ndarray of float32, shape (channels, len(edges_ns) - 1)
            NaN in a gap, and where all values are NaN.
        """
        low = np.full((len(channels), len(edges_ns) - 1), np.nan, np.float32)
        high = low.copy()
        stamps_ns, field = self.stamps_ns(), self.field(name)
        edges = np.searchsorted(stamps_ns, edges_ns)
        filled = np.flatnonzero(np.diff(edges))
        after = edges[:-1]
        between = np.flatnonzero((after == edges[1:]) & (after > 0) & (after < len(field)))
        steps_ns = stamps_ns[after[between]] - stamps_ns[after[between] - 1]
        held = between[steps_ns <= overdue_ns]
        with np.errstate(over='ignore', invalid='ignore'):  # as above
            low[:, held] = high[:, held] = field[after[held] - 1][:, channels].T
            values = field[edges[0] : edges[-1], channels].astype(np.float32)
        if len(filled) and len(channels):
            begins = edges[filled] - edges[0]
            # fmin and fmax ignore NaN unless there is nothing else.
            low[:, filled] = np.fmin.reduceat(values, begins, axis=0).T
            high[:, filled] = np.fmax.reduceat(values, begins, axis=0).T
        return low, high


class LiveTrack:
    """The data of one finger in the last minute.

    Samples and the detector's output arrive in separate messages, and are kept in separate rows.

    Examples
    --------
    >>> track = LiveTrack(ChainConfig(channels=2))
    >>> track.add_samples(Samples(np.full((2, 2), 4.3), np.array([5, 9]), np.array([0, 1]) > 0))
    >>> track.samples.field('truth', since=1).tolist()
    [[True]]
    """

    def __init__(self, config: ChainConfig, beginnings: int = 0) -> None:
        self.channels = n = config.channels
        # Bytes of a channel: 8 of volts, 4 of level, 1 of ON; there is room for twice the rows.
        kept = min(config.samples(KEPT_S), MOST_BYTES // (2 * 13 * n + 64))
        self.samples = Rows(kept, volts=(np.float64, n), truth=(np.bool_, 1))
        #: ``level`` is NaN where a channel is not valid.
        self.levels = Rows(kept, level=(np.float32, n), on=(np.bool_, n), slip=(np.bool_, 1))
        #: How often the track was begun again, as when the clock of the samples is set back.
        self.beginnings = beginnings
        #: Number of the row at which the last recorded slip ended: the rest before the next one
        #: cannot begin earlier.
        self.slip_ended = 0

    def add_samples(self, samples: Samples) -> None:
        """Append samples."""
        self._begin_again_if_set_back(self.samples, samples.stamps_ns)
        truth = np.zeros(len(samples.volts)) if samples.truth is None else samples.truth
        self.samples.append(samples.stamps_ns, volts=samples.volts, truth=truth[:, np.newaxis])

    def add_levels(self, stamps_ns: Stamps, level: Floats, on: Bools, slip: Bools) -> None:
        """Append the detector's output: level and on, shape (n, channels), slip, shape (n,)."""
        self._begin_again_if_set_back(self.levels, stamps_ns)
        self.levels.append(stamps_ns, level=level, on=on, slip=slip[:, np.newaxis])

    def _begin_again_if_set_back(self, rows: Rows, stamps_ns: Stamps) -> None:
        if (stamps_ns[:1] < rows.stamps_ns()[-1:] - SET_BACK_NS).any():
            self.samples.clear()
            self.levels.clear()
            self.beginnings += 1


class Spectrum(NamedTuple):
    """The amplitude density of channels, in dB relative to 1 V/sqrt(Hz).

    Its shape is (channels, frequencies). The first frequency is one step above 0.

    Examples
    --------
    >>> Spectrum(0.5, np.zeros((2, 381), np.float32)).density_db.shape
    (2, 381)
    """

    step_hz: float
    density_db: NDArray[np.float32]


def spectrum(volts: Floats, sample_rate_hz: float) -> Spectrum | None:
    """Return the spectrum of the last seconds, or None if there are too few rows.

    It is the mean of several short spectra (Welch, 1967). A value that is not finite is replaced
    by the mean of the finite ones.

    Examples
    --------
    A sine of 1 V at 40 Hz has a power of half a square volt.

    >>> seconds = np.arange(4000) / 400
    >>> found = spectrum(np.sin(2 * np.pi * 40 * seconds)[:, np.newaxis], 400.0)
    >>> round(float(found.step_hz * (1 + found.density_db[0].argmax())), 6)
    40.0
    >>> round(float(np.sum(10 ** (found.density_db[0] / 10)) * found.step_hz), 3)
    0.5
    """
    rows = min(round(SEGMENT_S * sample_rate_hz), MOST_ROWS)
    volts = np.asarray(volts, np.float64)[-rows * (SEGMENTS + 1) // 2 :]
    rows = min(rows, len(volts))
    if rows < FEWEST_ROWS:
        return None
    known = np.ma.masked_invalid(volts)
    filled = (known - known.mean(axis=0)).filled(0.0)
    # The squared values of a broken sensor may overflow.
    with np.errstate(over='ignore', invalid='ignore'):
        hz, power = signal.welch(filled, sample_rate_hz, nperseg=rows, axis=0, detrend='linear')
    density_db = 10.0 * np.log10(np.maximum(power[1:], LEAST_V2_HZ))
    return Spectrum(float(hz[1]), density_db.T.astype(np.float32))
