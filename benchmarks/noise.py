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

"""Noise of varying strength, so that the decision of a chain changes."""

import numpy as np
from numpy.typing import NDArray

BASELINE_V, NOISE_V = 4.3, 0.02


def swelling_noise_v(
    rows: int, n_channels: int, seed: int = 0, period_rows: float = 760.0
) -> NDArray[np.float64]:
    """Make noise around a baseline, shape (rows, n_channels), that swells and fades.

    Parameters
    ----------
    rows, n_channels
        Shape of the result.
    seed
        Seed of the noise.
    period_rows
        Rows from one swell to the next; 760 are 2 s at 380 Hz.
    """
    random = np.random.default_rng(seed)
    swell_v = NOISE_V * (1 + np.sin(2 * np.pi * np.arange(rows) / period_rows))
    return np.asarray(BASELINE_V + swell_v[:, None] * random.standard_normal((rows, n_channels)))
