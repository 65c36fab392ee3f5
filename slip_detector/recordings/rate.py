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

"""The sample rate of a recording: from its stamps, and compared with that of a chain."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.stamps import GAP_PERIODS
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.fields import allowed

#: Largest difference between the rates of a recording and of the chain, as a share. With a larger
#: one, bands and windows would differ noticeably from the configured ones.
RATE_TOLERANCE = 0.02


def rates_differ(rate_hz: float, chain_rate_hz: float) -> bool:
    """Return whether a recording's rate is too far from the rate of the chain.

    Examples
    --------
    >>> rates_differ(375.0, 380.0), rates_differ(300.0, 380.0)
    (False, True)
    """
    return abs(rate_hz - chain_rate_hz) > RATE_TOLERANCE * chain_rate_hz


def checked_rate(rate_hz: float, path: Path) -> float:
    """Return the rate of a recording, if a chain can have it.

    Raises
    ------
    ValueError
        When a chain cannot; names the recording.

    Examples
    --------
    >>> checked_rate(1e-300, Path('trial.npz'))
    Traceback (most recent call last):
    ValueError: trial.npz: has 1e-300 Hz, allowed: 1 to 1e+06 Hz
    """
    field = ChainConfig.__dataclass_fields__['sample_rate_hz']
    if not field.metadata['low'] <= rate_hz <= field.metadata['high']:
        raise ValueError(f'{path}: has {rate_hz:g} Hz, allowed: {allowed(field)}')
    return rate_hz


def rate_of(times_s: NDArray[Any]) -> 'float | None':
    """Return the rate at which rows were taken.

    It is the inverse of the mean step between rows, which averages jitter; gaps and steps
    backwards are left out.

    Parameters
    ----------
    times_s : ndarray, shape (n,)
        Stamps in seconds.

    Returns
    -------
    float or None
        Rate in Hz; None if there are fewer than two rows or the stamps do not rise.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.recordings.rate import rate_of
    >>> round(rate_of(np.array([0.0, 0.01, 0.02, 0.52, 0.53])), 6)  # half a second is missing
    100.0
    """
    steps = np.diff(times_s)
    steps = steps[steps > 0.0]
    if not steps.size:
        return None
    usual = steps[steps < GAP_PERIODS * np.median(steps)]
    return 1.0 / float(np.mean(usual))
