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

"""Compiles the chain, or loads it from the cache, before the first sample comes."""

import numpy as np

from slip_detector.chain.settling import settling_rows
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.stamps import StampGrid


def compile_chain() -> None:
    """Run each compiled function of the chain and of the stamps once.

    Without a cache this takes seconds. The compiled functions serve any configuration, and all
    later processes of the same user.

    Examples
    --------
    >>> compile_chain()
    """
    chain = SlipChain()
    settling_rows(chain.config)
    grid = StampGrid(period_s=1.0, max_gap_s=1.0)
    stamps_ns = np.arange(3) * 1_000_000_000
    grid.arrive_all(stamps_ns[:2])
    grid.arrive(int(stamps_ns[2]))
