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

"""The paper's figures of merit: delays, success rate and false positives (Section 3, Eq. 10)."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from slip_detector.evaluation.events import TrueSlip


def first_on_delay_s(on: ArrayLike, time_s: ArrayLike, start_s: float) -> float | None:
    """Return the time from the start of slip to the first ON at or after it.

    Parameters
    ----------
    on : array_like of bool, shape (n,)
        Decisions of a channel or group, or the global ones.
    time_s : array_like, shape (n,)
        Time of each row, rising.
    start_s : float
        When slip begins.

    Returns
    -------
    float or None
        Seconds; None where there is no such ON.

    Examples
    --------
    >>> first_on_delay_s([True, False, True], time_s=[0.0, 1.0, 2.0], start_s=0.5)
    1.5
    """
    times = np.asarray(time_s, dtype=np.float64)
    after = np.flatnonzero(np.asarray(on, dtype=bool) & (times >= start_s))
    return float(times[after[0]]) - start_s if after.size else None


def mean_and_sd(delays: Iterable[float | None]) -> tuple[float | None, float | None]:
    """Return mean and standard deviation of delays; Eq. 10 is the mean over channels.

    Parameters
    ----------
    delays
        In any unit; None for a channel or trial without a delay.

    Returns
    -------
    mean, sd : float or None
        Mean and standard deviation (n - 1) of the known delays. None for the mean of no delay and
        for the standard deviation of fewer than two.

    Examples
    --------
    >>> mean_and_sd([1.0, None, 3.0])
    (2.0, 1.4142135623730951)
    """
    known = [delay for delay in delays if delay is not None]
    mean = float(np.mean(known)) if known else None
    return mean, float(np.std(known, ddof=1)) if len(known) > 1 else None


def percent(part: int, whole: int) -> float | None:
    """Return a share in percent; None where the whole is 0.

    Examples
    --------
    >>> percent(1, 4), percent(0, 0)
    (25.0, None)
    """
    return 100.0 * part / whole if whole else None


def paper_figures(slips: Sequence[TrueSlip], on_rows: int, rest_rows: int) -> dict[str, Any]:
    """Return the figures that the paper reports; each slip counts as one of its trials.

    Parameters
    ----------
    slips
        The slips of one recording or of several; :func:`trial_delays_ms` has their delays.
    on_rows
        Number of rows without slip in which the global decision is ON.
    rest_rows
        Number of rows without slip.

    Returns
    -------
    dict
        ``mean_delay_ms`` and ``sd_delay_ms`` (n - 1) of the slips; ``success_percent``: the share
        of the slips during which the global decision is ON; ``false_positive_percent``: the share
        of the rows without slip in which it is ON. None where one is not defined.

    Examples
    --------
    >>> paper_figures([], on_rows=19, rest_rows=1900)['false_positive_percent']
    1.0
    """
    mean_ms, sd_ms = mean_and_sd(trial_delays_ms(slips))
    return {
        'mean_delay_ms': mean_ms,
        'sd_delay_ms': sd_ms,
        'success_percent': percent(sum(slip.on_while for slip in slips), len(slips)),
        'false_positive_percent': percent(on_rows, rest_rows),
    }


def trial_delays_ms(slips: Sequence[TrueSlip]) -> list[float | None]:
    """Return the mean delay of the channels in each slip (Eq. 10); None where none is ON.

    Examples
    --------
    >>> trial_delays_ms([])
    []
    """
    return [None if slip.delay_s is None else slip.delay_s * 1e3 for slip in slips]
