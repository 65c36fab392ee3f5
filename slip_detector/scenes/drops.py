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

"""Samples that are lost on the way from the sensor."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet


@dataclasses.dataclass(frozen=True)
class Drops(ParameterSet):
    """Samples that are lost on the way, one at a time or several in a row.

    Examples
    --------
    >>> Drops(share=0.01, burst_samples=3).burst_samples
    3.0
    >>> Drops(share=0.6)
    Traceback (most recent call last):
    ValueError: parameter share is 0.6, allowed: at most 0.5 with a burst_samples of 1, ...
    """

    share: float = parameter(0.01, 'Share of the samples that are lost.', low=0.0, high=0.99)
    burst_samples: float = parameter(
        1.0, 'Mean number of consecutive lost samples; 1: never two.', low=1.0, high=1e6
    )

    def __post_init__(self) -> None:
        """Check that bursts of this length can make up the share."""
        super().__post_init__()
        most = self.burst_samples / (self.burst_samples + 1)
        if self.share > most:
            raise ValueError(
                f'parameter share is {self.share:g}, allowed: at most {most:g} with a '
                f'burst_samples of {self.burst_samples:g}, as a sample arrives between two bursts'
            )


class LossyLink:
    """The losses of one trial: a Markov chain of two states (Gilbert's model).

    Parameters
    ----------
    drops
        Share and length of the losses.
    trial
        Generator of the trial; one number is drawn for each sample.

    Examples
    --------
    >>> import numpy as np
    >>> from slip_detector.scenes.drops import Drops, LossyLink
    >>> link = LossyLink(Drops(share=0.25), np.random.default_rng(0))
    >>> float(link.kept(100_000).mean().round(2))
    0.75
    """

    def __init__(self, drops: Drops, trial: np.random.Generator) -> None:
        self._trial = trial
        self._goes_on = 1.0 - 1.0 / drops.burst_samples
        # With this probability the stationary share of the Markov chain is the wanted share.
        self._begins = drops.share / ((1.0 - drops.share) * drops.burst_samples)
        self._lost = False

    def kept(self, n: int) -> NDArray[np.bool_]:
        """Return whether each of the next ``n`` samples arrives, shape (n,)."""
        kept = np.ones(n, dtype=np.bool_)
        if self._begins:
            for i, draw in enumerate(self._trial.random(n).tolist()):
                self._lost = draw < (self._goes_on if self._lost else self._begins)
                kept[i] = not self._lost
        return kept
