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

from collections.abc import Mapping
from typing import Any, NamedTuple

from benchmarks.scenes.integrators import INTEGRATORS
from slip_detector.scenes.free_object import FINGERS, STANDARD_GRAVITY_M_S2

#: The plain slide: touch, hold, slide, hold, let go.
STEPS = [
    {'duration_s': 0.05},
    {'duration_s': 0.05, 'force_n': 0.4},
    {'duration_s': 0.1},
    {'duration_s': 0.2, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.1},
    {'duration_s': 0.05, 'force_n': 0.0},
    {'duration_s': 0.05},
]

CYCLE = [
    {'duration_s': 0.5, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.5, 'velocity_m_s': 0.0},
    {'duration_s': 0.5, 'velocity_m_s': -6.7e-3},
    {'duration_s': 0.5, 'velocity_m_s': 0.0},
]
CYCLE_S = 2.0


class Case(NamedTuple):
    """A scene that differs from the plain slide.

    Attributes
    ----------
    case, setting : str
        What is extreme, and its value.
    more : mapping
        Parts of the scene that differ; a part that is None is left out.
    method : str
        ``live`` for the live stepper, or the integrator that is to refuse the scene.
    of_quick : bool
        Whether ``--quick`` runs it too.
    """

    case: str
    setting: str
    more: Mapping[str, Any]
    method: str = 'live'
    of_quick: bool = True


def moving(*velocities_m_s: float, seconds: float = 0.1) -> list[dict[str, float]]:
    """Return steps that slide with these velocities under a constant load."""
    push = [{'duration_s': seconds, 'velocity_m_s': v} for v in velocities_m_s]
    return [*STEPS[:3], *push, *STEPS[4:]]


def held_object(mass_kg: float) -> dict[str, Any]:
    """Return a scene in which an object is gripped, lifted, held and let slip."""
    grip_n = 1.5 * mass_kg * STANDARD_GRAVITY_M_S2 / (FINGERS * 0.6)
    return {
        'steps': [
            {'duration_s': 0.1, 'force_n': grip_n},
            {'duration_s': 0.2},
            {'duration_s': 0.1, 'carried': 1.0},
            {'duration_s': 0.2},
            {'duration_s': 0.1, 'force_n': grip_n / 2},
            {'duration_s': 0.1},
            {'duration_s': 0.1, 'force_n': 0.0},
        ],
        'object': {'mass_kg': mass_kg},
        # With a radius of at least 4 mm the contact reaches the taxels even with a light grip.
        'contact': {'radius_at_1n_m': max(5.4e-3, 4e-3 / grip_n ** (1 / 3))},
        'skin': {'damping_n_s_m': 1.0},
        'texture': None,
    }


#: Friction without the Stribeck effect, which needs damping.
EVEN = {'kinetic_coefficient': 0.6, 'static_coefficient': 0.6}
BARE = {'skin': {'mass_kg': 0.0, 'damping_n_s_m': 0.0}}
SMOOTH = {'electronics': {'bandwidth_hz': 150.0}}
LIFT_OFF = [
    *STEPS[:3],
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.05, 'velocity_m_s': 6.7e-3, 'force_n': 0.0},
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.05, 'velocity_m_s': 6.7e-3, 'force_n': 0.4},
    {'duration_s': 0.1, 'velocity_m_s': 6.7e-3},
    *STEPS[4:],
]


def cases() -> list[Case]:
    """Return all cases except the hour-long run."""
    rows = [
        Case('bristles', f'sigma0 {s:.0e} N/m', {'friction': {'bristle_stiffness_n_m': s}})
        for s in (1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9)
    ]
    rows += [
        Case('bristles', 'sigma0 1e+09 N/m', {'friction': {'bristle_stiffness_n_m': 1e9}}, method)
        for method in ('RK45', 'DOP853')
    ]
    rows += [
        Case('lift-off', 'while it slides', {'steps': LIFT_OFF}),
        Case(
            'lift-off', 'bouncing', {'steps': LIFT_OFF, 'motion': {'ringing_damping': 0.03}}
        ),
        Case(
            'lift-off', 'relieved by taps',
            {'taps': {'times_s': [0.25, 0.3, 0.35], 'peak_force_n': -1.0}},
        ),
        Case(
            'reversal', '20 mm/s, 2 m/s2',
            {
                'steps': moving(20e-3, -20e-3, 20e-3, -20e-3),
                'motion': {'acceleration_m_s2': 2.0}, **SMOOTH,
            },
        ),
        Case(
            'reversal', '20 mm/s, 1000 m/s2',
            {
                'steps': moving(20e-3, -20e-3, 20e-3, -20e-3),
                'motion': {'acceleration_m_s2': 1000.0}, **SMOOTH,
            },
        ),
        Case(
            'no mass, no damping', 'no Stribeck effect',
            {**BARE, 'friction': {**EVEN, 'bristle_damping_n_s_m': 0.0}},
        ),
        *(
            Case(
                'no mass, no damping',
                'no Stribeck effect',
                {**BARE, 'friction': {**EVEN, 'bristle_damping_n_s_m': 0.0}},
                method,
            )
            for method in ('LSODA', 'BDF', 'Radau')
        ),
        Case(
            'no mass, no damping', 'damped bristles',
            {**BARE, 'friction': EVEN},
        ),
        Case('no mass, no damping', 'Stribeck effect', {'skin': {'damping_n_s_m': 0.0}}),
        Case(
            'no mass', 'no bristle damping', {'friction': {'bristle_damping_n_s_m': 0.0}}
        ),
        Case(
            'no damping', 'mass 1e-5 kg',
            {'skin': {'mass_kg': 1e-5, 'damping_n_s_m': 0.0}, 'friction': EVEN}, of_quick=False,
        ),
        Case('mass', '1e-5 kg', {'skin': {'mass_kg': 1e-5}}),
        Case('mass', '1e-8 kg', {'skin': {'mass_kg': 1e-8}}, of_quick=False),
    ]  # fmt: skip
    rows += [
        Case('sample rate', f'{rate:g} Hz', {'sample_rate_hz': rate})
        for rate in (500.0, 5000.0, 50_000.0)
    ]
    low_pass = {'electronics': {'bandwidth_hz': 20.0}}
    rows.append(Case('sample rate', '50 Hz, 20 Hz low-pass', {'sample_rate_hz': 50.0, **low_pass}))
    rows += [
        Case(
            'spatial period', f'{period * 1e6:g} um, 150 Hz',
            {'texture': {'spatial_period_m': period}, **SMOOTH}, of_quick=period > 1e-5,
        )
        for period in (1e-4, 1e-5, 1e-6)
    ]  # fmt: skip
    fast = {'steps': moving(80e-3, seconds=0.2), 'motion': {'acceleration_m_s2': 2.0}}
    rows += [
        Case('spatial period', '1 um, no low-pass', {'texture': {'spatial_period_m': 1e-6}}),
        Case('velocity', '80 mm/s, 150 Hz', {**fast, **SMOOTH}),
        Case('velocity', '80 mm/s, no low-pass', fast),
    ]
    rows += [
        Case('object', f'{mass * 1e3:g} g', held_object(mass), of_quick=mass == 0.2)
        for mass in (1e-3, 1e-2, 0.2, 1.0, 10.0)
    ]
    rows.append(Case('coulomb', 'texture', {'friction': 'coulomb'}))
    rows += [Case('coulomb', 'texture', {'friction': 'coulomb'}, method) for method in INTEGRATORS]
    return rows


def description_of(case: Case) -> dict[str, Any]:
    """Return the description of a case's scene.

    Examples
    --------
    >>> case = Case('mass', '1e-5 kg', {'skin': {'mass_kg': 1e-5}, 'texture': None})
    >>> sorted(description_of(case))
    ['friction', 'skin', 'steps']
    """
    whole = {'steps': STEPS, 'friction': {}, 'texture': {}} | dict(case.more)
    return {name: part for name, part in whole.items() if part is not None}


def sliding_cycles(cycles: int) -> list[dict[str, float]]:
    """Return steps that hold for the time of one cycle, then slide forth and back."""
    begin = [{'duration_s': 0.5, 'force_n': 0.4}, {'duration_s': CYCLE_S - 0.5}]
    return [*begin, *(CYCLE * cycles)]
