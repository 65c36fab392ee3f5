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

"""The range in which a figure is wanted."""

from typing import NamedTuple

import numpy as np


class Bound(NamedTuple):
    """The range in which a figure is wanted, from ``low`` to ``high``.

    Attributes
    ----------
    low, high : float
        In the unit of the figure.
    strict : bool
        Whether a figure equal to ``low`` or ``high`` is outside the range.

    Examples
    --------
    >>> Bound(high=4.0).met(4.0), Bound(high=4.0, strict=True).met(4.0), Bound(low=1.0).met(None)
    (True, False, False)
    >>> print(Bound(low=0.0, strict=True), Bound(high=4.0), Bound(32.0, 40.0), sep=', ')
    > 0, <= 4, 32.00 to 40.00
    """

    low: float = -np.inf
    high: float = np.inf
    strict: bool = False

    def met(self, figure: float | None) -> bool:
        """Return whether a figure is in the range; None, a figure that is not defined, is not."""
        if figure is None:
            return False
        if self.strict:
            return self.low < figure < self.high
        return self.low <= figure <= self.high

    def __str__(self) -> str:
        equal = '' if self.strict else '='
        if self.high == np.inf:
            return f'>{equal} {self.low:g}'
        if self.low == -np.inf:
            return f'<{equal} {self.high:g}'
        return f'{self.low:.2f} to {self.high:.2f}'
