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

"""The rivals of the precision."""

import numpy as np
import pytest

from benchmarks.chain.errors import tones_v
from benchmarks.chain.rivals import METHODS, WITH_RUNNING_SUMS, is_stable, run
from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.detector import ChainConfig


@pytest.mark.parametrize('name', WITH_RUNNING_SUMS)
@pytest.mark.parametrize('values', [{}, {'exponent': 2, 'rectify': 'half'}])
def test_every_rival_does_what_the_chain_does(name, values):
    config = ChainConfig(channels=3, **values)
    samples = tones_v(config, 600, 3)
    wanted = SlipChain(config).update(samples)
    whole = run(WITH_RUNNING_SUMS[name](config), samples, config)
    tolerance = {'sections float32': 1e-3, 'polynomials float32': 0.2}.get(name, 1e-8)
    for found, of_chain in zip(whole, (wanted.envelope, wanted.level), strict=True):
        assert np.allclose(found, of_chain, rtol=0, atol=tolerance * of_chain.max())
    method = WITH_RUNNING_SUMS[name](config)
    pieces = [run(method, piece, config)[1] for piece in np.split(samples, [15, 300])]
    assert np.allclose(np.concatenate(pieces), whole[1], rtol=0, atol=tolerance * whole[1].max())


@pytest.mark.parametrize('name', METHODS)
def test_rivals_compute_in_their_type(name):
    config = ChainConfig(channels=1)
    level = run(METHODS[name](config), tones_v(config, 60), config)[1]
    assert level.dtype == (np.float32 if name.endswith('32') else np.float64)


@pytest.mark.parametrize(
    ('roots', 'stable'),
    [
        ([0.5, -0.9], True),
        ([1.0, 0.3], False),
        ([0.9 + 0.5j, 0.9 - 0.5j], False),
        ([0.6 + 0.7j, 0.6 - 0.7j, -0.99], True),
        ([0.2, 0.3, -1.001], False),
        ([0.0, 0.0, 0.5], True),
    ],
)
def test_stability_is_told_by_where_the_poles_are(roots, stable):
    assert is_stable(np.real(np.poly(roots))) is stable


def test_poles_that_lie_together_next_to_the_circle_are_told_apart():
    polynomial = np.poly([1 - 2.0**-13] * 4)  # of 52 bits: exact
    assert is_stable(polynomial)
    assert not is_stable(np.array([1.0, -4.0, 6.0, -4.0, 1.0]))
