"""A scene as a differential equation."""

import re

import numpy as np
import pytest

from benchmarks.scenes.build import build_scene
from benchmarks.scenes.equations import DIFFERENCE
from benchmarks.scenes.integrators import METHODS, solve
from benchmarks.scenes.ode import Ode
from support.benchmark_scenes import PLATE, SCENES, STEPS


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


@pytest.mark.parametrize('method', METHODS)
@pytest.mark.parametrize(
    ('description', 'said'),
    [
        ({**PLATE, 'friction': 'coulomb'}, 'friction: model is coulomb'),
        (
            {
                **PLATE,
                'skin': {'damping_n_s_m': 0.0},
                'friction': {
                    'static_coefficient': 0.6, 'kinetic_coefficient': 0.6,
                    'bristle_damping_n_s_m': 0.0,
                },
            },
            'skin: mass_kg and damping_n_s_m are 0',
        ),
        ({'steps': STEPS}, 'no friction and no low-pass: its volts are a closed form'),
    ],
)  # fmt: skip
def test_what_no_equation_says_is_refused(method, description, said):
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        solve(Ode(build_scene(description)), method, 1e-3)
    assert 'allowed: ' in str(caught.value)
    assert '\n' not in str(caught.value)
