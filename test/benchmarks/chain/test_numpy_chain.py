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

"""The rival in NumPy."""

import numpy as np
import pytest

from benchmarks.chain.numpy_chain import NumpyChain
from benchmarks.noise import swelling_noise_v
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig


@pytest.mark.parametrize('in_place', [False, True])
def test_the_numpy_rival_carries_its_state_from_block_to_block(in_place):
    rows = swelling_noise_v(600, 16)
    whole = NumpyChain(ChainConfig(), rows[0], in_place).update(rows)
    rival = NumpyChain(ChainConfig(), rows[0], in_place)
    parts = [rival.update(piece) for piece in np.split(rows, [1, 3, 10, 200])]
    wanted = SlipChain(ChainConfig()).update(rows)
    for i, name in enumerate(('slip', 'groups', 'channels')):
        assert np.array_equal(np.concatenate([part[i] for part in parts]), whole[i])
        assert np.array_equal(whole[i], getattr(wanted, name))
