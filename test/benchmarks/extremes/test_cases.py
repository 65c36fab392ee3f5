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

"""The extreme scenes."""

from collections import Counter

import numpy as np
import pytest

from benchmarks.extremes.cases import (
    CYCLE_S,
    Case,
    cases,
    description_of,
    held_object,
    sliding_cycles,
)
from benchmarks.scenes.build import build_scene


def test_no_two_cases_are_the_same():
    names = Counter((case.case, case.setting, case.method) for case in cases())
    assert max(names.values()) == 1


def test_quick_leaves_some_out_but_no_kind_of_case_run_live():
    live = [case for case in cases() if case.method == 'live']
    of_quick = [case for case in live if case.of_quick]
    assert len(of_quick) < len(live)
    kinds = {case.case for case in live} - {'no damping'}  # its reference is slow
    assert {case.case for case in of_quick} == kinds


def test_a_part_that_is_none_is_left_out_and_others_take_the_place_of_the_base():
    description = description_of(Case('', '', {'texture': None, 'skin': {'mass_kg': 1e-5}}))
    assert set(description) == {'steps', 'friction', 'skin'}


@pytest.mark.parametrize('mass_kg', [1e-3, 0.2, 10.0])
def test_a_held_object_stays_until_the_grip_is_halved(mass_kg):
    scene = build_scene(description_of(Case('object', '', held_object(mass_kg))))
    time_s, _, position_m, _ = scene.clean(10**9)
    moved_m = np.abs(position_m - position_m[0])
    assert moved_m[time_s < 0.65].max() < 2e-3
    assert moved_m[-1] > 5e-3


def test_cycles_slide_forth_and_back_to_where_they_began():
    scene = build_scene({'steps': sliding_cycles(3), 'friction': {}})
    assert scene.duration_s == pytest.approx(4 * CYCLE_S)
    _, _, position_m, _ = scene.clean(10**9)
    assert position_m[-1] == pytest.approx(position_m[0], abs=1e-9)
    assert np.ptp(position_m) > 1e-3
