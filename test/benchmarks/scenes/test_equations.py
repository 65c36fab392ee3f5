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

"""The equations of the mechanics: the Jacobian is that of the rates, rest is rest."""

import numpy as np
import pytest

from benchmarks.scenes.build import build_scene
from benchmarks.scenes.equations import DIFFERENCE
from benchmarks.scenes.integrators import solve
from benchmarks.scenes.ode import Ode
from support.benchmark_scenes import PLATE, SCENES


@pytest.mark.parametrize('name', SCENES)
def test_the_jacobian_is_that_of_the_rates(name):
    ode = Ode(build_scene(SCENES[name]))
    solution = solve(ode, 'LSODA', 1e-6)
    t = 0.25
    y = solution.states[round(t * 380)]
    ode.side_s = t
    jacobian = ode.jacobian(t, y)
    base = ode.rates(t, y)
    for j in range(ode.size):
        changed = y.copy()
        changed[j] += DIFFERENCE * ode.scales[j]
        column = (ode.rates(t, changed) - base) / (DIFFERENCE * ode.scales[j])
        scale = np.abs(column).max() + 1e-12 * np.abs(jacobian).max()
        np.testing.assert_allclose(jacobian[:, j] / scale, column / scale, atol=1e-3)
    if not ode.with_object:
        bands = ode.bands()
        rows, columns = np.nonzero(jacobian)
        assert np.max(rows - columns) <= bands['lband']
        assert np.max(columns - rows) <= bands['uband']


def test_what_is_not_touched_stays_at_rest():
    ode = Ode(build_scene(PLATE))
    assert not ode.rates(0.0, ode.start()).any()


def test_stiffer_bristles_settle_faster():
    means = []
    for stiffness in (1e4, 1e6):
        ode = Ode(build_scene(PLATE, friction={'bristle_stiffness_n_m': stiffness}))
        mean, most = ode.stiffness_1_s((0.0, 0.4))
        assert 0.0 < mean <= most
        means.append(mean)
    assert means[1] > 10.0 * means[0]
