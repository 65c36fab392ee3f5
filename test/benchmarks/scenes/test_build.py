"""Scenes that are built again and again."""

import numpy as np

from benchmarks.scenes.build import build_scene
from support.benchmark_scenes import PLATE


def test_a_scene_that_is_built_again_gives_the_same_volts():
    noisy = PLATE | {'electronics': {'noise_v': 1e-3}}
    first, second = (build_scene(noisy).read(50).volts for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert np.ptp(first) > 0.0


def test_what_is_given_beside_takes_the_place_of_what_the_description_says():
    assert build_scene(PLATE, sample_rate_hz=1000.0).sample_rate_hz == 1000.0
    assert 'texture' in build_scene(PLATE).parts
