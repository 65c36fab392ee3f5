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

"""Taps: short pulses of the normal force."""

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

Floats = NDArray[np.float64]


class TapNumbers(NamedTuple):
    """The numbers of :class:`Taps` for compiled code; ``begins_s`` is empty without taps."""

    begins_s: Floats
    peak_force_n: float
    duration_s: float


@dataclasses.dataclass(frozen=True)
class Taps(ParameterSet):
    """Taps: half sines on the normal force, each with the impulse 2 / pi x peak x duration.

    Examples
    --------
    >>> Taps(times_s=[1, 2.5], peak_force_n=0.3).times_s
    (1.0, 2.5)
    """

    times_s: tuple[float, ...] = parameter(
        (),
        'Times at which the taps begin.',
        unit='s',
        low=0.0,
        high=1e6,
        allows='at least one, rising, at least duration_s apart, 0 to 1e+06 s',
    )
    peak_force_n: float = parameter(
        0.5,
        'Peak force; a negative one relieves the contact.',
        unit='N',
        low=-1000.0,
        high=1000.0,
    )
    duration_s: float = parameter(0.01, 'Duration of a tap.', unit='s', low=1e-4, high=10.0)

    def __post_init__(self) -> None:
        """Check that there are taps, and that they do not overlap."""
        super().__post_init__()
        if not self.times_s:
            raise ValueError('parameter times_s is empty, allowed: at least one time')
        for before, after in zip(self.times_s[:-1], self.times_s[1:], strict=True):
            # Round-off may put a tap that begins at the end of another slightly before that end.
            if after - before < self.duration_s * (1 - 1e-9):
                raise ValueError(
                    f'parameter times_s has {after:g} s after {before:g} s, allowed: rising, at '
                    f'least duration_s, {self.duration_s:g} s, apart'
                )

    def numbers(self) -> TapNumbers:
        """Return the numbers for compiled code."""
        return TapNumbers(np.array(self.times_s), self.peak_force_n, self.duration_s)


@compiled
def tap_force_at(t, side, numbers):
    """Return the force of the taps, which is exactly zero between them.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants in seconds.
    side : as ``t``
        Selects the value at the beginning or the end of a tap: a time on the wanted side of it.
        Elsewhere the instant itself.
    numbers : TapNumbers
        The numbers of at least one tap.

    Returns
    -------
    float or ndarray, as ``t``
        In newtons.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.taps import Taps, tap_force_at
    >>> taps = Taps(times_s=(1.0,), peak_force_n=0.5, duration_s=0.5).numbers()
    >>> t = np.array([0.9, 1.25, 1.6])
    >>> tap_force_at(t, t, taps)
    array([0. , 0.5, 0. ])
    """
    # Before the first tap the index is -1, and the time since the last tap is negative.
    begin = numbers.begins_s[np.searchsorted(numbers.begins_s, side, side='right') - 1]
    during = (side >= begin) & (side - begin < numbers.duration_s)
    force = numbers.peak_force_n * np.sin(np.pi / numbers.duration_s * (t - begin))
    return np.where(during, force, 0.0)
