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

"""Scenes that the tests share."""

import numpy as np

from slip_detector.scenes import Scene, find_scene, load_scene

ALL = 10**9

# Whatever the defaults are: these are the numbers that the tests count on.
COMMON = {
    'motion': {'acceleration_m_s2': 0.5, 'ringing_hz': 20.0, 'ringing_damping': 0.7},
    'contact': {'radius_at_1n_m': 6e-3, 'centre_m': [0.0, 0.0], 'taxel_area_m2': 1e-6},
}

RIDGES = {'ridge_height_m': 2e-5, 'harmonics': [0.0, 0.0], 'indentation_m': 1e-4}


def built(description, seed=0):
    return Scene({**COMMON, **description}, np.random.default_rng(seed))


def shipped(name, seed=0):
    return load_scene(find_scene(name), np.random.default_rng(seed)).read(ALL)


def times_s(samples):
    return np.arange(len(samples.volts)) / 380.0
