"""The objects of the grasp."""

import numpy as np
import pytest

from slip_detector.grasp.objects import RANGES, object_scene


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
