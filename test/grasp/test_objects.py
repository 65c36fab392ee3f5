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

"""The objects of the grasp."""

import numpy as np
import pytest

from slip_detector.grasp.objects import RANGES, object_scene
from slip_detector.scenes import find_scene


def test_each_seed_is_another_object_within_the_ranges_and_always_the_same_one():
    scenes = [object_scene(seed) for seed in range(200)]
    assert scenes[7] == object_scene(7)
    masses = np.array([scene['object']['mass_kg'] for scene in scenes])
    assert len(set(masses)) == len(masses)
    low, high = RANGES['mass_kg']
    assert low <= masses.min() < masses.max() <= high
    assert np.ptp(masses) > 0.9 * (high - low)
    for scene in scenes:
        friction = scene['friction']
        assert friction['kinetic_coefficient'] < friction['static_coefficient']
    assert len({scene['electronics']['fingertip_seed'] for scene in scenes}) == len(scenes)


def test_a_scene_without_an_object_that_gets_heavier_is_refused_in_one_line():
    with pytest.raises(ValueError, match='has no object that gets heavier') as caught:
        object_scene(0, 'plate_400um')
    assert 'plate_400um.yaml' in str(caught.value)
    assert '\n' not in str(caught.value)


def test_lag_and_ridges_change_by_their_factors_and_nothing_else():
    usual, harder = object_scene(7), object_scene(7, lag_factor=2.0, ridge_factor=0.25)
    assert harder['motion']['ringing_hz'] == usual['motion']['ringing_hz'] / 2.0
    ridge_m = usual['texture']['ridge_height_m']
    assert harder['texture']['ridge_height_m'] == pytest.approx(ridge_m / 4.0)
    harder['motion']['ringing_hz'] = usual['motion']['ringing_hz']
    harder['texture']['ridge_height_m'] = ridge_m
    assert harder == usual


def test_a_lag_of_a_gripper_that_the_scene_does_not_describe_is_refused_in_one_line(tmp_path):
    scene = tmp_path / 'stiff.yaml'
    text = find_scene('grasp').read_text(encoding='utf-8')
    scene.write_text(text.replace('\nmotion:', '\n# motion:'), encoding='utf-8')
    assert object_scene(0, str(scene))['object']
    with pytest.raises(ValueError, match=r'stiff\.yaml: does not say how fast the gripper is'):
        object_scene(0, str(scene), lag_factor=2.0)
