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

"""The extreme scenes: each is short and differs from a plain slide in a few numbers."""

from typing import Any

from slip_detector.scenes.surface import FINGERS, STANDARD_GRAVITY_M_S2

SLIDING = {'duration_s': 0.1, 'velocity_m_s': 6.7e-3}

#: Touch and hold; hold and let go.
BEFORE = [{'duration_s': 0.05}, {'duration_s': 0.05, 'force_n': 0.4}, {'duration_s': 0.1}]
AFTER = [{'duration_s': 0.1}, {'duration_s': 0.05, 'force_n': 0.0}, {'duration_s': 0.05}]

LIFT_OFF = [
    *(*BEFORE, SLIDING, {**SLIDING, 'duration_s': 0.05, 'force_n': 0.0}, SLIDING),
    *({**SLIDING, 'duration_s': 0.05, 'force_n': 0.4}, SLIDING, *AFTER),
]

CYCLE_S = 2.0


def moving(*velocities_m_s: float) -> list[dict[str, float]]:
    """Return steps that slide with these velocities under a constant load."""
    push = [{'duration_s': 0.1, 'velocity_m_s': v} for v in velocities_m_s]
    return [*BEFORE, *push, *AFTER]


def sliding_cycles(cycles: int) -> list[dict[str, float]]:
    """Return steps that hold for the time of one cycle, then slide forth and back."""
    cycle = [{'duration_s': 0.5, 'velocity_m_s': v} for v in (6.7e-3, 0.0, -6.7e-3, 0.0)]
    return [{'duration_s': 0.5, 'force_n': 0.4}, {'duration_s': CYCLE_S - 0.5}, *(cycle * cycles)]


def held_object(mass_kg: float) -> dict[str, Any]:
    """Return a scene in which an object is gripped, lifted, held and let slip."""
    grip_n = 1.5 * mass_kg * STANDARD_GRAVITY_M_S2 / (FINGERS * 0.6)
    steps = [{'force_n': grip_n}, {}, {'carried': 1.0}, {}, {'force_n': grip_n / 2}, {}]
    return {
        'steps': [{'duration_s': 0.1, **step} for step in [*steps, {'force_n': 0.0}]],
        'object': {'mass_kg': mass_kg},
        # With a radius of at least 4 mm the contact reaches the taxels even with a light grip.
        'contact': {'radius_at_1n_m': max(5.4e-3, 4e-3 / grip_n ** (1 / 3))},
        'skin': {'damping_n_s_m': 1.0},
        'texture': None,
    }


#: Friction without the Stribeck effect, which needs damping.
EVEN = {'kinetic_coefficient': 0.6, 'static_coefficient': 0.6}
BARE = {'skin': {'damping_n_s_m': 0.0}}
UNDAMPED_BRISTLES = {'bristle_damping_n_s_m': 0.0}
SMOOTH = {'electronics': {'bandwidth_hz': 150.0}}
RELIEF = {'times_s': [0.25, 0.3, 0.35], 'peak_force_n': -1.0}
REVERSALS = {**SMOOTH, 'steps': moving(20e-3, -20e-3, 20e-3, -20e-3)}
FINE = {'spatial_period_m': 1e-6}
FAST = {'steps': moving(80e-3, 80e-3), 'motion': {'acceleration_m_s2': 2.0}}

#: What is extreme, its value, and the parts that differ; a part that is None is left out.
CASES: list[tuple[str, str, dict[str, Any]]] = [
    *(
        ('bristles', f'sigma0 {sigma:.0e} N/m', {'friction': {'bristle_stiffness_n_m': sigma}})
        for sigma in (1e3, 1e5, 1e7, 1e9)
    ),
    ('lift-off', 'while it slides', {'steps': LIFT_OFF}),
    ('lift-off', 'bouncing', {'steps': LIFT_OFF, 'motion': {'ringing_damping': 0.03}}),
    ('lift-off', 'relieved by taps', {'taps': RELIEF}),
    ('reversal', '20 mm/s, 2 m/s2', {**REVERSALS, 'motion': {'acceleration_m_s2': 2.0}}),
    ('reversal', '20 mm/s, 1000 m/s2', {**REVERSALS, 'motion': {'acceleration_m_s2': 1000.0}}),
    ('bare skin', 'no Stribeck effect', {**BARE, 'friction': {**EVEN, **UNDAMPED_BRISTLES}}),
    ('bare skin', 'damped bristles', {**BARE, 'friction': EVEN}),
    ('bare skin', 'Stribeck effect', BARE),
    ('bristles', 'no damping', {'friction': UNDAMPED_BRISTLES}),
    ('spatial period', '1 um, 150 Hz', {'texture': FINE, **SMOOTH}),
    ('spatial period', '1 um, no low-pass', {'texture': FINE}),
    ('velocity', '80 mm/s, 150 Hz', {**FAST, **SMOOTH}),
    ('velocity', '80 mm/s, no low-pass', FAST),
    *(('object', f'{mass * 1e3:g} g', held_object(mass)) for mass in (1e-3, 0.2, 10.0)),
]


def description_of(more: dict[str, Any]) -> dict[str, Any]:
    """Return the description of a scene: the plain slide, but for some parts."""
    whole = {'steps': moving(6.7e-3, 6.7e-3), 'friction': {}, 'texture': {}, **more}
    return {name: part for name, part in whole.items() if part is not None}
