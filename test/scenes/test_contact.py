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

"""Contact: the normal force spreads over the taxels as Hertz says."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slip_detector.scenes.electronics import taxel_positions
from slip_detector.scenes.surface import Contact, spread_load

FORCES_N = st.floats(1e-9, 100.0)
RADII_M = st.floats(1e-4, 2e-2)
CENTRES_M = st.tuples(st.floats(-5e-3, 5e-3), st.floats(-5e-3, 5e-3))


def loads_n(force_n, positions_m, centre_m=(0.0, 0.0), *, rest_patches=None, **contact):
    """Return the loads of taxels, and after them that of a patch between them if asked for."""
    positions_m = np.ascontiguousarray(positions_m, dtype=float)
    out = np.full(len(positions_m) + (rest_patches is not None), np.nan)
    numbers = Contact(**contact).numbers()
    spread_load(force_n, *centre_m, positions_m, numbers, rest_patches or 1.0, out)
    return out


@settings(max_examples=25)
@given(FORCES_N, RADII_M, CENTRES_M)
def test_the_pressure_integrates_to_the_normal_force(force_n, radius_m, centre_m):
    reach_m = 1.1 * radius_m * force_n ** (1 / 3)
    axis, step = np.linspace(-reach_m, reach_m, 201, retstep=True)
    grid_m = np.stack(np.meshgrid(axis, axis), axis=-1).reshape(-1, 2) + centre_m
    area_m2 = 1e-6
    loads = loads_n(force_n, grid_m, centre_m, radius_at_1n_m=radius_m, taxel_area_m2=area_m2)
    assert loads.sum() / area_m2 * step**2 == pytest.approx(force_n, rel=0.01)


@given(FORCES_N, RADII_M, CENTRES_M)
def test_no_taxel_has_more_than_the_largest_load(force_n, radius_m, centre_m):
    largest_n = Contact(radius_at_1n_m=radius_m).largest_load_n(force_n)
    places_m = [*taxel_positions(), centre_m]
    loads = loads_n(force_n, places_m, centre_m, radius_at_1n_m=radius_m)
    assert loads[-1] == pytest.approx(largest_n)
    assert loads.max() <= largest_n * (1.0 + 1e-12)


@given(FORCES_N, CENTRES_M, st.floats(1.0, 1e4))
def test_with_the_patches_between_the_taxels_the_loads_add_up_to_the_force(
    force_n, centre_m, rest_patches
):
    *taxels, rest = loads_n(
        force_n, taxel_positions(), centre_m,
        rest_patches=rest_patches, radius_at_1n_m=5e-3, taxel_area_m2=1e-6,
    )  # fmt: skip
    assert rest >= 0.0
    # Taxels that together are larger than the contact carry more than there is; none is left.
    carried = sum(taxels)
    if carried <= force_n:
        assert carried + rest_patches * rest == pytest.approx(force_n)
    else:
        assert rest == 0.0


@pytest.mark.parametrize('force_n', [0.0, -0.0, -1e-9, -5.0])
def test_without_a_force_there_is_no_load(force_n):
    loads = loads_n(force_n, taxel_positions(), rest_patches=50.0)
    np.testing.assert_array_equal(loads, 0.0)
