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

"""The sample rate of a recording: from its stamps, compared with that of a chain, and changed."""

import fractions

import numpy as np

from slip_detector.chain.samples import Bools, Floats, Samples, Stamps
from slip_detector.chain.stamp_rules import BUNCHED, GAP_PERIODS
from slip_detector.parameters import ChainConfig, allowed

#: Number of rows of the lower rate on either side of a row that the low-pass uses.
HALF_ROWS = 20

#: Edge of the low-pass as a share of half the lower rate. Above half the lower rate the gain is
#: below -70 dB.
EDGE = 0.8

#: Largest factor between the two rates, and largest denominator of the fraction that stands for
#: it: the length of the filter grows with it.
MOST_FACTOR = 1000

#: To measure the rate, largest number of rows in a step, and smallest number of such steps.
MOST_AT_ONCE, FEWEST_STEPS = 16, 32

#: Largest difference of alike steps from the usual step, as a share of the usual step.
ALIKE = 0.25


def require_rate(rate_hz: float) -> float:
    """Return the rate of a recording; raise a ValueError if no chain can have it."""
    field = ChainConfig.__dataclass_fields__['sample_rate_hz']
    if not field.metadata['low'] <= rate_hz <= field.metadata['high']:
        raise ValueError(f'has {rate_hz:g} Hz, allowed: {allowed(field)}')
    return rate_hz


def measure_rate(stamps_ns: Stamps, what: str) -> float:
    """Return the rate at which rows were taken, in Hz.

    The rate is the inverse of the mean step between rows, which averages jitter. Gaps and steps
    backwards are left out. With a coarse clock, where many stamps are the same, the rows are
    counted. Where most steps differ, steps over several rows are measured: a message without a
    header has its time of receipt, and a late one makes its step longer and the next step shorter,
    which cancels over several rows.

    Parameters
    ----------
    stamps_ns : ndarray of int, shape (n,)
        When the rows were taken.
    what
        What has the stamps, for the error.

    Raises
    ------
    ValueError
        When there are fewer than two rows or the stamps do not rise.

    Examples
    --------
    >>> stamps_ns = np.array([0, 10, 20, 520, 530]) * 1_000_000  # half a second is missing
    >>> round(measure_rate(stamps_ns, 'the column time_s'), 6)
    100.0
    """
    steps_ns = np.diff(stamps_ns)
    if steps_ns.sum() > 0 and np.mean(steps_ns == 0) > BUNCHED:  # a coarse clock
        return 1e9 / float(np.mean(steps_ns))
    rows = max(1, min(MOST_AT_ONCE, len(steps_ns) // FEWEST_STEPS))
    if rows > 1:
        usual_ns = np.median(steps_ns)
        # Steps that are alike are measured singly, as a lost row would spoil a step over several.
        alike = np.abs(steps_ns - usual_ns) < ALIKE * usual_ns
        rows = 1 if np.mean(alike) > 0.75 else rows
    spans_ns = np.diff(stamps_ns[::rows])
    spans_ns = np.sort(spans_ns[spans_ns > 0])
    if not spans_ns.size:
        raise ValueError(f'{what} do not rise, allowed: two or more rows, each with its time')
    middle_ns = spans_ns[(len(spans_ns) - 1) // 2]
    off_ns = (GAP_PERIODS - 1) * middle_ns / rows
    return 1e9 * rows / float(np.mean(spans_ns[np.abs(spans_ns - middle_ns) <= off_ns]))


def resample(stretch: Samples, from_hz: float, to_hz: float) -> Samples:
    """Resample rows that are evenly spaced, with a low-pass for the lower of the two rates.

    The rows are taken to be constant before the first and after the last one. A constant channel
    keeps its value to the bit. A bad value (NaN, infinity) is replaced by the last good value of
    its channel, and the output rows nearest to it become bad.

    Parameters
    ----------
    stretch
        The rows, at least one.
    from_hz, to_hz
        Rates of the input and of the output.

    Examples
    --------
    >>> rows = Samples(np.full((100, 2), 4.3), np.arange(100) * 5_000_000)  # 0.5 s at 200 Hz
    >>> resample(rows, 200.0, 380.0).volts.shape
    (189, 2)
    """
    import scipy.signal  # takes a while, and few recordings need it

    # The fraction is accurate to some millionths for both directions.
    share = fractions.Fraction(min(from_hz, to_hz) / max(from_hz, to_hz))
    few, many = share.limit_denominator(MOST_FACTOR).as_integer_ratio()
    up, down = (many, few) if to_hz > from_hz else (few, many)
    low_pass = scipy.signal.firwin(2 * HALF_ROWS * many + 1, EDGE / many, window='blackman')
    bad = ~np.isfinite(stretch.volts)
    good = fill_forward(stretch.volts, bad)
    # The filter starts with zeros, so it gets the differences from the first row.
    held = np.repeat(good[-1:], HALF_ROWS * many // up + 1, axis=0)
    change = np.concatenate([good, held]) - good[0]
    n = (len(good) - 1) * up // down + 1
    volts = good[0] + scipy.signal.resample_poly(change, up, down, window=low_pass)[:n]
    places = np.arange(n) * down / up
    volts[bad[np.minimum(np.floor(places + 0.5).astype(np.intp), len(bad) - 1)]] = np.nan
    before = np.floor(places).astype(np.intp)
    after_ns = np.rint((places - before) * 1e9 / from_hz).astype(np.int64)
    rows = stretch.take(before)
    return rows._replace(volts=volts, stamps_ns=rows.stamps_ns + after_ns)


def fill_forward(volts: Floats, bad: Bools) -> Floats:
    """Return the volts with each bad value replaced by the last good value of its channel.

    Before the first good value it is replaced by that value, or by 0 if there is none.
    """
    if not bad.any():
        return volts
    rows = np.maximum.accumulate(np.where(bad, 0, np.arange(len(volts))[:, np.newaxis]), axis=0)
    rows = np.maximum(rows, np.argmin(bad, axis=0))
    return np.where(bad.all(axis=0), 0.0, np.take_along_axis(volts, rows, axis=0))
