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

"""Configurations and recordings that the tests of the chain share."""

import contextlib
import dataclasses

import numpy as np

from slip_detector.parameters.detector import ChainConfig


def bits(*results):
    """Return the bits of all that consecutive results have, by name."""
    found = {'flags': np.concatenate([result.flags for result in results]).tobytes()}
    for name in ('envelope', 'level', 'floor', 'excess', 'vote_statistic'):
        with contextlib.suppress(ValueError):  # was not kept
            found[name] = np.concatenate([getattr(result, name) for result in results]).tobytes()
    return found


def noise(seed, *shape):
    return np.random.default_rng(seed).normal(size=shape)


#: A quick chain whose envelope is 1 for a sine of 1 V within its band, after a few rows.
QUICK_EVIDENCE = ChainConfig(
    sample_rate_hz=400.0,
    channels=4,
    passband_hz=(20.0, 100.0),
    stopbands_hz=(),
    gain=1.0,
    exponent=1,
    flat_after_s=0.0,
    envelope_window_s=0.02,
    decision_window_s=0.04,
    decision='evidence',
    noise_floor=0.01,
    threshold=0.1,
)


def quick_evidence(**values):
    return dataclasses.replace(QUICK_EVIDENCE, **values)
