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

"""Samples on their way from a source, live or recorded, to the chain."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Samples(NamedTuple):
    """Consecutive samples, oldest first.

    Attributes
    ----------
    volts : ndarray, shape (n, c)
    stamps_ns : ndarray of int, shape (n,)
        Time at which each sample was taken.
    truth : ndarray of bool, shape (n,), or None
        Whether there is slip, if that is known.
    position_m : ndarray, shape (n,), or None
        Position of the platform or the object, if known. It is written to recordings; a reader can
        derive the truth from it.

    Examples
    --------
    >>> import numpy as np
    >>> samples = Samples(np.zeros((3, 16)), np.array([0, 10, 20]))
    >>> samples.take(slice(1, None)).stamps_ns.tolist()
    [10, 20]
    >>> samples.take(slice(2)).then(samples.take(slice(2, None))).stamps_ns.tolist()
    [0, 10, 20]
    """

    volts: NDArray[np.float64]
    stamps_ns: NDArray[np.int64]
    truth: NDArray[np.bool_] | None = None
    position_m: NDArray[np.float64] | None = None

    def take(self, which: 'NDArray[np.intp] | slice') -> 'Samples':
        """Return the samples at the given indices."""
        return Samples(
            self.volts[which],
            self.stamps_ns[which],
            None if self.truth is None else self.truth[which],
            None if self.position_m is None else self.position_m[which],
        )

    def then(self, more: 'Samples') -> 'Samples':
        """Return these samples followed by those of ``more``.

        Truth and position are kept only if both parts have them.
        """
        truth, position_m = None, None
        if self.truth is not None and more.truth is not None:
            truth = np.concatenate([self.truth, more.truth])
        if self.position_m is not None and more.position_m is not None:
            position_m = np.concatenate([self.position_m, more.position_m])
        return Samples(
            np.concatenate([self.volts, more.volts]),
            np.concatenate([self.stamps_ns, more.stamps_ns]),
            truth,
            position_m,
        )
