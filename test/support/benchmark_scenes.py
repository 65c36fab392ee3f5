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

"""Scenes on which the tests of the benchmarks solve the mechanics."""

from benchmarks.scenes.sizes import QUICK

STEPS = [
    {'duration_s': 0.03},
    {'duration_s': 0.05, 'force_n': 0.4},
    {'duration_s': 0.1},
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.05},
    {'duration_s': 0.04, 'force_n': 0.0},
    {'duration_s': 0.03},
]
START_S = 0.18
PLATE = {'steps': STEPS, 'friction': {}, 'texture': {}}
FILTERED = {**PLATE, 'electronics': {'bandwidth_hz': 150.0}}
HEAVY = {**PLATE, 'skin': {'mass_kg': 1e-5}}
OBJECT = {
    'steps': [
        {'duration_s': 0.05, 'force_n': 2.5},
        {'duration_s': 0.1},
        {'duration_s': 0.05, 'carried': 1.0},
        {'duration_s': 0.1, 'force_n': 1.0},
        {'duration_s': 0.2, 'force_n': 0.3},
    ],
    'friction': {},
    'texture': {},
    'object': {'mass_kg': 0.2, 'length_m': 0.02},
    'electronics': {'bandwidth_hz': 150.0},
}
DISTURBED = {
    **PLATE,
    'tremor': {'force_rms_n': 0.02, 'motion_rms_m': 5e-5},
    'taps': {'times_s': [0.1, 0.2, 0.35]},
    'rolling': {'start_s': 0.15, 'duration_s': 0.03, 'hold_s': 0.02, 'repeats': 2},
}
SHAKEN = {**OBJECT, 'tremor': {'motion_rms_m': 5e-5}}
SCENES = {
    'plate': PLATE, 'filtered': FILTERED, 'heavy': HEAVY, 'object': OBJECT,
    'disturbed': DISTURBED, 'shaken': SHAKEN,
}  # fmt: skip

# The same as files, and shorter.

SHORT_PLATE = """
steps:
  - {duration_s: 0.05}
  - {duration_s: 0.05, force_n: 0.4}
  - {duration_s: 0.1}
  - {duration_s: 0.1, velocity_m_s: 6.7e-3}
  - {duration_s: 0.05, force_n: 0.0}
friction: {model: lugre}
texture: {spatial_period_m: 400.0e-6}
"""

SHORT_OBJECT = """
steps:
  - {duration_s: 0.05, force_n: 2.5}
  - {duration_s: 0.1}
  - {duration_s: 0.05, carried: 1.0}
  - {duration_s: 0.1, force_n: 0.3}
friction: {model: lugre}
object: {mass_kg: 0.2, length_m: 0.02}
"""

#: Enough to see errors fall.
SIZES = QUICK._replace(
    explicit_tolerances=(), steps_per_sample=(2, 8), budget_s=0.5, stretch_budget_s=5.0
)


def written(path, text):
    path.write_text(text)
    return path
