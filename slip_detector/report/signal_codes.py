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

"""Encodes the signals that a report draws besides volts, with a byte for each sample."""

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.slip_chain import SlipResult
from slip_detector.chain.stages import LEAST_EXCESS_DB
from slip_detector.parameters.detector import ChainConfig

Codes = NDArray[np.uint8]

#: Steps of a level's code for a factor of two.
CODES_PER_OCTAVE = 16

#: Code of a level that equals the threshold: above it the channel is ON.
THRESHOLD_CODE = 128

#: The signals in dB that the decision ``evidence`` has besides its level.
DECIBELS = ('excess', 'floor')

#: A narrower range of decibels is widened to this, as it may be 0.
LEAST_RANGE_DB = 1e-3


def level_codes(result: SlipResult, threshold: float) -> Codes:
    """Return level / threshold on a logarithmic scale, a byte for each sample.

    Parameters
    ----------
    result
        The result of n rows, with the level.
    threshold
        The threshold of the chain.

    Returns
    -------
    ndarray of uint8, shape (n, c)
        0 where the channel is not valid, else 1 to 255, with :data:`CODES_PER_OCTAVE` steps for a
        factor of two. A code is above :data:`THRESHOLD_CODE` exactly where the channel is ON.

    Examples
    --------
    >>> from slip_detector.chain.slip_chain import SlipChain
    >>> result = SlipChain(ChainConfig()).update(np.full((1, 16), 4.3))
    >>> int(level_codes(result, threshold=0.5)[0, 0])  # at rest: the lowest code of a level
    1
    """
    with np.errstate(divide='ignore'):  # The logarithm of 0 is -inf, the lowest code.
        octaves = np.log2(result.level / threshold)
    most = 255 - THRESHOLD_CODE
    steps = np.clip(np.ceil(CODES_PER_OCTAVE * octaves), -most, most)
    # A quotient may round to 1 where the level is just above the threshold.
    steps = np.where(result.channels, np.maximum(steps, 1), np.minimum(steps, 0))
    return np.where(result.valid, steps + THRESHOLD_CODE, 0).astype(np.uint8)


def signals_of(config: ChainConfig) -> tuple[str, ...]:
    """Return the signals of which an overview has codes: the level, with evidence two more.

    Examples
    --------
    >>> signals_of(ChainConfig())
    ('level',)
    """
    return ('level', *DECIBELS) if config.decision == 'evidence' else ('level',)


def ranges_db(config: ChainConfig) -> dict[str, tuple[float, float]]:
    """Return the decibels of the codes 1 and 255 of excess and floor.

    Examples
    --------
    >>> config = ChainConfig(decision='evidence', noise_floor=1e-3, evidence_cap_db=12.0)
    >>> ranges_db(config)
    {'excess': (-8.7, 12.0), 'floor': (-60.0, 0.0)}
    """
    floors = [20.0 * float(np.log10(floor)) for floor in config.noise_floor]
    return {
        'excess': (LEAST_EXCESS_DB, config.evidence_cap_db),
        'floor': (min(floors), max(floors) + config.noise_floor_range_db),
    }


def signal_codes(result: SlipResult, config: ChainConfig) -> Codes:
    """Return all signals of an overview side by side, a byte for each sample.

    Parameters
    ----------
    result
        The result of n rows, with the level, and with evidence also floor and excess.
    config
        The parameters of the chain.

    Returns
    -------
    ndarray of uint8, shape (n, s c)
        The codes of the levels, then those of each other signal: 0 where the channel is not
        valid, else from 1 to 255 over its range in :func:`ranges_db`.

    Examples
    --------
    >>> from slip_detector import SlipChain
    >>> config = ChainConfig()
    >>> signal_codes(SlipChain(config).update(np.full((380, 16), 4.3)), config).dtype.name
    'uint8'
    """
    codes = [level_codes(result, config.threshold)]
    if config.decision == 'evidence':
        for name, (low, high) in ranges_db(config).items():
            share = (getattr(result, name) - low) / max(high - low, LEAST_RANGE_DB)
            steps = 1.0 + np.rint(254.0 * np.clip(share, 0.0, 1.0))
            codes.append(np.where(result.valid, steps, 0).astype(np.uint8))
    return np.hstack(codes)
