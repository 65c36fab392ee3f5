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

"""Sums of sines, for hum and tremor."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled

Floats = NDArray[np.float64]


class Sines(NamedTuple):
    """A sum of ``k`` sines, each ``amplitude * sin(angular_rate_rad_s * t + phase_rad)``.

    Attributes
    ----------
    amplitude, angular_rate_rad_s, phase_rad : ndarray, shape (k,)
        The amplitudes have the unit of the sum.
    """

    amplitude: Floats
    angular_rate_rad_s: Floats
    phase_rad: Floats


NO_SINES = Sines(np.zeros(0), np.zeros(0), np.zeros(0))


@compiled
def sines_at(t, sines):
    """Return the sum of the sines at one instant or at many.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants in seconds.
    sines : Sines or ndarray, shape (3, k)
        The rows of an array are the fields of :class:`Sines` in their order; a call with one
        array is faster.

    Returns
    -------
    float or ndarray, as ``t``
        In the unit of the amplitudes.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.sines import Sines, sines_at
    >>> hum = Sines(np.array([2.0]), np.array([2 * np.pi * 50]), np.array([0.0]))
    >>> sines_at(np.array([0.0, 0.005, 0.015]), hum).round(9)
    array([ 0.,  2., -2.])
    """
    amplitude, rate_rad_s, phase_rad = sines[0], sines[1], sines[2]
    total = 0.0 * t
    for k in range(amplitude.size):
        total = total + amplitude[k] * np.sin(rate_rad_s[k] * t + phase_rad[k])
    return total


@compiled
def sines_rate_at(t, sines):
    """Return the exact derivative of :func:`sines_at`, per second."""
    amplitude, rate_rad_s, phase_rad = sines[0], sines[1], sines[2]
    total = 0.0 * t
    for k in range(amplitude.size):
        rate = rate_rad_s[k]
        total = total + amplitude[k] * rate * np.cos(rate * t + phase_rad[k])
    return total
