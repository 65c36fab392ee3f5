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
