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

"""Inputs on which the chain's precision is measured, and errors against the reference."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.chain import reference
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]
#: An array of float64 or float32.
Reals = NDArray[Any]

BASELINE_V = 4.25
#: Samples are multiples of this.
STEP_V = 2.0**-18
SWING_V = 0.02

#: NumPy is fastest with about this many rows in a call: the arrays of the call fit into the
#: second-level cache, and the call itself takes little of its time.
ROWS_PER_CALL = 4096


def tones_v(config: ChainConfig, rows: int, channels: int = 1, seed: int = 0) -> Floats:
    """Make tones inside the pass-band, with noise, that swell and fade; exact in float32.

    Returns
    -------
    ndarray, shape (rows, channels)
    """
    random = np.random.default_rng(seed)
    low, high = config.passband_hz
    time_s = np.arange(rows)[:, None] / config.sample_rate_hz
    tones = sum(
        np.sin(2 * np.pi * (time_s * tone_hz + random.random(channels)))
        for tone_hz in (1.2 * low, np.sqrt(low * high), 0.9 * high)
    )
    swell = 0.55 - 0.45 * np.cos(6 * np.pi * np.arange(rows) / rows)[:, None]
    noise = random.standard_normal((rows, channels))
    return BASELINE_V + quantised(SWING_V * swell * (tones / 3 + noise / 4))


def quantised(signals: Floats) -> Floats:
    """Round to multiples of ``STEP_V``.

    Examples
    --------
    >>> float(quantised(np.array(0.1)) / STEP_V)
    26214.0
    """
    return np.round(signals / STEP_V) * STEP_V


class ReferenceResult(NamedTuple):
    """The reference on one channel: each number is the sum of two float64, shapes (n,)."""

    envelope: tuple[Floats, Floats]
    level: tuple[Floats, Floats]


def run_reference(config: ChainConfig, samples: Floats, sections: Any = None) -> ReferenceResult:
    """Run the reference on one channel.

    Parameters
    ----------
    config
        Configuration of the chain.
    samples : ndarray, shape (n,)
        Volts.
    sections
        Sections from :func:`benchmarks.chain.reference.exactly`; those of the reference's own
        design if not given.
    """
    filtered = reference.run_filter(sections or reference.design(config), samples)
    envelope, level = reference.envelope_and_level(filtered, config)
    return ReferenceResult(reference.as_two(envelope), reference.as_two(level))


def worst_error(values: Reals, wanted: tuple[Floats, Floats]) -> float | None:
    """Return the worst difference as a share of the largest value; None if it is not finite.

    Examples
    --------
    >>> near, rest = np.array([1.0, 4.0]), np.zeros(2)
    >>> worst_error(np.array([1.0, 4.5]), (near, rest))
    0.125
    """
    near, rest = wanted
    differences = np.abs((values.astype(np.float64) - near) - rest)
    worst = float(differences.max() / near.max())
    return worst if np.isfinite(worst) else None
