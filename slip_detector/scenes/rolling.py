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

"""Rolling: the contact moves over the fingertip, and nothing slides."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.compiled import compiled
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

Floats = NDArray[np.float64]


class RollingNumbers(NamedTuple):
    """The numbers of :class:`Rolling` for compiled code."""

    start_s: float
    duration_s: float
    hold_s: float
    lasts_s: float
    x_m: float
    y_m: float


@dataclasses.dataclass(frozen=True)
class Rolling(ParameterSet):
    """The object rolls over the fingertip and back: the contact moves, and nothing slides."""

    start_s: float = parameter(1.0, 'When rolling begins.', (0.0, 1e6, 's'))
    duration_s: float = parameter(0.5, 'Time to roll one way.', (1e-3, 3600.0, 's'))
    hold_s: float = parameter(0.0, 'Rest at either end.', (0.0, 3600.0, 's'))
    distance_m: tuple[float, float] = parameter(
        (1.5e-3, 0.0), 'How far the centre of contact moves: x, y.', (-0.1, 0.1, 'm')
    )
    repeats: int = parameter(1, 'Number of times it rolls there and back.', (1, 10**6))

    @property
    def cycle_s(self) -> float:
        """Time to roll there, to rest, to roll back and to rest again."""
        return 2.0 * (self.duration_s + self.hold_s)

    def numbers(self) -> RollingNumbers:
        """Return the numbers for compiled code."""
        return RollingNumbers(
            self.start_s, self.duration_s, self.hold_s, self.repeats * self.cycle_s,
            *self.distance_m,
        )  # fmt: skip

    def corners_s(self, until_s: float) -> Floats:
        """Return when the motion begins and ends, in all cycles that begin before ``until_s``.

        Examples
        --------
        >>> from slip_detector.scenes.rolling import Rolling
        >>> Rolling(start_s=1.0, duration_s=0.5, hold_s=0.25).corners_s(until_s=10.0)
        array([1.  , 1.5 , 1.75, 2.25])
        """
        cycles = min(self.repeats, max(math.ceil((until_s - self.start_s) / self.cycle_s), 0))
        back_s = 0.5 * self.cycle_s
        within_s = [0.0, self.duration_s, back_s, back_s + self.duration_s]
        begins_s = self.start_s + self.cycle_s * np.arange(cycles)
        return np.asarray(np.add.outer(begins_s, within_s).ravel())


@compiled
def _smooth_step(u):
    """Return ``3 u^2 - 2 u^3`` of ``u`` limited to 0 to 1; its slope is zero at both ends."""
    u = np.minimum(np.maximum(u, 0.0), 1.0)
    return u * u * (3.0 - 2.0 * u)


@compiled
def rolled_at(t, numbers):
    """Return the displacement of the centre of contact from its place at rest.

    The centre moves along a smooth step, with a continuous velocity that is zero at both ends. The
    displacement is exactly zero before the start and after the last way back.

    Parameters
    ----------
    t : float or ndarray, shape (n,)
        The instants in seconds.
    numbers : RollingNumbers or ndarray, shape (6,)
        An array has the fields of :class:`RollingNumbers` in their order.

    Returns
    -------
    x_m, y_m
        Floats or arrays, as ``t``.
    """
    start_s, duration_s, hold_s, lasts_s = numbers[0], numbers[1], numbers[2], numbers[3]
    one_way = duration_s + hold_s
    since = np.minimum(np.maximum(t - start_s, 0.0), lasts_s)
    within = since - 2.0 * one_way * np.floor(since / (2.0 * one_way))
    share = _smooth_step(within / duration_s) - _smooth_step((within - one_way) / duration_s)
    return share * numbers[4], share * numbers[5]
