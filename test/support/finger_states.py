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

"""Fingers that are in one state each: at rest, slipping, with a dead channel, without input."""

import numpy as np

RATE_HZ = 380.0


def rest_rows(rows=380, seed=0):
    return 4.3 + 1e-4 * np.random.default_rng(seed).normal(size=(rows, 16))


def slip_rows():
    seconds = np.arange(380) / RATE_HZ
    return rest_rows() + 0.2 * np.sin(2 * np.pi * 20.0 * seconds)[:, np.newaxis]


def without_channel_7(rows):
    rows[:, 6] = np.nan
    return rows


#: By state the rows that bring a finger into it.
STATES = {
    'rest': rest_rows(), 'slip': slip_rows(), 'dead': without_channel_7(rest_rows()),
    'none': np.empty((0, 16)), 'invalid': np.full((380, 16), np.nan),
}  # fmt: skip
