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

"""The parts of a scene: their names, how they are read, and which of them go together."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from slip_detector.parameters import ParameterSet, parameter, quote, quote_name, refuse
from slip_detector.scenes.disturbances import TREMOR_PEAK, Hum, Rolling, Taps, Tremor
from slip_detector.scenes.electronics import ContactNoise, Electronics, Faults
from slip_detector.scenes.friction import Friction, Skin
from slip_detector.scenes.motion import Motion, Orders, Step
from slip_detector.scenes.surface import Contact, FreeObject, Roughness, Texture

#: The class of each part. Their order determines what each draws: see :func:`spawn_parts`.
PARTS: dict[str, type[ParameterSet]] = {
    'motion': Motion,
    'contact': Contact,
    'skin': Skin,
    'friction': Friction,
    'texture': Texture,
    'roughness': Roughness,
    'object': FreeObject,
    'electronics': Electronics,
    'hum': Hum,
    'tremor': Tremor,
    'taps': Taps,
    'rolling': Rolling,
    'faults': Faults,
    'contact_noise': ContactNoise,
    'orders': Orders,
}

#: First and number of the spawned generators from which no part draws any more.
UNUSED_FROM, UNUSED = 13, 2

#: Parts that every scene has, with default values if the file does not name them.
ALWAYS = ('motion', 'contact', 'skin', 'electronics')


class Sampling(ParameterSet):
    """The parameters of a scene file that belong to no part."""

    sample_rate_hz: float = parameter(380.0, 'Rate of the samples.', (1.0, 1e6, 'Hz'))
    step_s: float = parameter(
        3.5e-4,
        'Longest step of the integrator; each sample period has a whole number of equal steps.',
        (1e-6, 1.0, 's'),
    )


#: Names in a scene file that are not parts.
NOT_PARTS = ('steps', *Sampling.__dataclass_fields__)


def spawn_parts(trial: np.random.Generator) -> dict[str, np.random.Generator]:
    """Return the generator of each part, which depends on the part's place among all parts."""
    children = trial.spawn(len(PARTS) + UNUSED)
    del children[UNUSED_FROM : UNUSED_FROM + UNUSED]
    return dict(zip(PARTS, children, strict=True))


def read_parts(description: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts in the content of a scene file, and those that every scene has."""
    parts: dict[str, Any] = {name: PARTS[name]() for name in ALWAYS}
    for name, content in description.items():
        if name in NOT_PARTS:
            continue
        if name not in PARTS:
            refuse(f'unknown part {quote_name(name)}', ', '.join((*NOT_PARTS, *PARTS)))
        if not isinstance(content, Mapping | None):
            refuse(f'{name} is {quote(content)}', 'names and values')
        parts[name] = PARTS[name].from_parameters(content or {}, name)
    return parts


def check_parts(parts: Mapping[str, Any], steps: Sequence[Step], sample_rate_hz: float) -> None:
    """Raise an error for parts of a scene that contradict each other or the steps."""
    aliases = 'texture' in parts and not parts['electronics'].bandwidth_hz
    orders = [parts['orders']] if 'orders' in parts else []
    fastest_m_s = max(abs(part.velocity_m_s) for part in [*steps, *orders])
    if orders and 'object' in parts:
        refuse('orders: the object moves by itself', 'without the part object')
    if 'object' in parts:
        if 'friction' not in parts:
            refuse('object: falls without friction', 'with the part friction')
        if fastest_m_s:
            refuse('steps: velocity_m_s is not 0', '0 with an object, which moves by itself')
        if aliases:
            refuse('electronics: bandwidth_hz is 0', 'above 0 with an object and texture')
    elif any(step.carried >= 0.0 or step.pull_n for step in steps):
        refuse('steps: carried and pull_n are for an object', 'with that part')
    elif aliases:
        texture: Texture = parts['texture']
        highest_hz = fastest_m_s / texture.spatial_period_m * (1 + len(texture.harmonics))
        if highest_hz > sample_rate_hz / 2:
            refuse(
                f'texture: ridges pass at up to {highest_hz:.4g} Hz, which aliases',
                f'below {sample_rate_hz / 2:g} Hz, or with bandwidth_hz of the part electronics',
            )
    if 'contact_noise' in parts:
        highest_hz = parts['contact_noise'].band_hz[1]
        what = f'contact_noise: parameter band_hz ends at {highest_hz:g} Hz'
        if highest_hz >= sample_rate_hz / 2:
            refuse(what, f'below {sample_rate_hz / 2:g} Hz, half the sample rate')
    if 'friction' in parts:
        check_grip(parts, _largest_force_n(parts, steps))


def check_grip(parts: Mapping[str, Any], force_n: float, where: str = 'friction') -> None:
    """Raise an error for a normal force under which the motion of the skin is not determined.

    Friction must not fall with velocity faster than the skin's damping rises: each patch would
    stick and slip by itself, too fast for any step. With damped bristles the skin must be damped,
    too, or nothing determines its velocity when it begins to slip.
    """
    friction, skin = parts['friction'], parts['skin']
    load_n = parts['contact'].largest_load_n(force_n)
    fall = friction.steepest_fall_n_s_m(load_n)
    damping = skin.damping_n_s_m
    if fall > damping:
        refuse(
            f'{where}: the skin would chatter, as friction falls with velocity by up to '
            f'{fall:.3g} N s/m under {load_n:.3g} N, and its damping_n_s_m is {damping:.3g} N s/m',
            'more damping, a higher stribeck_velocity_m_s or less static_coefficient',
        )
    bristle_damping = friction.bristle_damping_n_s_m
    if damping == 0.0 and bristle_damping > 0.0:
        what = f'{where}: bristle_damping_n_s_m is {bristle_damping:g} N s/m, and skin without'
        refuse(f'{what} damping leaves its velocity open', '0, or damping_n_s_m above 0')


def _largest_force_n(parts: Mapping[str, Any], steps: Sequence[Step]) -> float:
    """Return the largest normal force that steps, orders and disturbances can cause."""
    ratio = parts['motion'].ringing_damping
    overshoot = math.exp(-math.pi * ratio / math.sqrt(1 - ratio**2)) if ratio < 1.0 else 0.0
    forces_n = [step.force_n for step in steps]
    if 'orders' in parts:
        forces_n += [parts['orders'].force_n, *parts['orders'].pressed_n]
    most_n = (1.0 + overshoot) * max(forces_n)
    if 'taps' in parts:
        most_n += max(parts['taps'].peak_force_n, 0.0)
    if 'tremor' in parts:
        most_n += TREMOR_PEAK * float(parts['tremor'].force_rms_n)
    return max(most_n, 0.0)
