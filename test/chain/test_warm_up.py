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

"""What is compiled before the first sample: all that the chain needs later."""

import os
import subprocess
import sys

import pytest

from slip_detector.chain.compiled import COMPILED

SCRIPT = """
import numpy as np

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.chain.stamps import StampGrid
from slip_detector.chain.warm_up import compile_chain
from slip_detector.parameters.detector import ChainConfig
from support.compiled_signatures import compiled_signatures

compile_chain()
before = compiled_signatures()
assert before
for changes in ({}, {'channels': 3, 'vote': 'mean', 'common_mode': 'median'}, {'channels': 40}):
    config = ChainConfig(**changes)
    SlipChain(config).update(np.zeros((100, config.channels)), votes=['all', 2])
grid = StampGrid(period_s=0.01, max_gap_s=0.1)
grid.mend(np.array([0, 10, 40, 1000, 900]) * 1_000_000)
grid.arrive(1_100_000_000, 10)
assert grid.arrive_all(np.array([1_110_000_000]))
assert compiled_signatures() == before
"""


@pytest.mark.skipif(not COMPILED, reason='without Numba nothing is compiled')
def test_nothing_is_left_to_be_compiled_when_samples_come():
    done = subprocess.run(
        [sys.executable, '-c', SCRIPT],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        capture_output=True, text=True, check=False, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
