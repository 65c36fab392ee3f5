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

"""Decisions that know nothing of slip."""

import numpy as np


def guessed(random, rows, mean_on_rows, mean_off_rows, regular=False):
    """Return decisions that are ON and OFF in turn for random times of these mean lengths.

    They begin at a random place. With ``regular`` all times have their mean length.
    """
    pairs = int(2.0 * rows / (mean_on_rows + mean_off_rows)) + 20
    turns = np.empty(2 * pairs, np.int64)
    for k, mean in enumerate((mean_on_rows, mean_off_rows)):
        turns[k::2] = round(mean) if regular else random.geometric(1.0 / mean, pairs)
    on = np.repeat(np.arange(turns.size) % 2 == 0, turns)
    return np.resize(on[random.integers(0, on.size // 4) :], rows)
