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

"""Builds the constants of a scene: the integrator's inputs that do not change while it runs."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from slip_detector.chain import fingertip
from slip_detector.parameters.detector import PAPER_CHANNELS
from slip_detector.scenes.contact import Contact
from slip_detector.scenes.electronics import Electronics, Frontend
from slip_detector.scenes.free_object import FreeObject, ObjectNumbers
from slip_detector.scenes.friction import Friction, FrictionNumbers, Skin, SkinNumbers
from slip_detector.scenes.mechanics import SceneConstants
from slip_detector.scenes.texture import RidgeNumbers, Roughness, RoughNumbers, Texture

#: Longest step of the integrator, as a phase angle of the skin's own oscillation.
RINGING_RAD = 0.4

#: Largest number of integrator steps per second of a scene; more would take too long.
MOST_STEPS_HZ = 2e6

NO_FRICTION = FrictionNumbers(0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0)
NO_RIDGES = RidgeNumbers(0.0, 0.0, np.zeros(0))
NO_ROUGHNESS = RoughNumbers(0.0, np.zeros(0), np.zeros(0))
NO_OBJECT = ObjectNumbers(0.0, 0.0, 1.0)


def scene_constants(
    parts: Mapping[str, Any],
    true_rate_hz: float,
    longest_step_s: float,
    frontend: Frontend,
    of_texture: np.random.Generator,
) -> SceneConstants:
    """Build the constants of a scene; an absent part has empty or neutral constants.

    Parameters
    ----------
    parts
        The parts of the scene by their names.
    true_rate_hz
        Rate at which the samples are taken.
    longest_step_s
        Longest step of the integrator.
    frontend
        The electronics, with the sensitivities of the channels.
    of_texture
        Generator of the random phase of the ridges: where on the plate the scene begins.

    Raises
    ------
    ValueError
        When the skin oscillates too fast for the integrator.
    """
    friction: Friction | None = parts.get('friction')
    texture: Texture | None = parts.get('texture')
    roughness: Roughness | None = parts.get('roughness')
    free_object: FreeObject | None = parts.get('object')
    contact: Contact = parts.get('contact', Contact())
    electronics: Electronics = parts.get('electronics', Electronics())
    skin: Skin = parts.get('skin', Skin())
    steps_per_sample = 1
    # Without friction and low-pass filter nothing changes between two samples.
    if friction or electronics.bandwidth_hz:
        step_s = min(longest_step_s, _ringing_step_s(skin) if friction else math.inf)
        steps_per_sample = math.ceil(1.0 / (true_rate_hz * step_s) - 1e-9)
    if steps_per_sample * true_rate_hz > MOST_STEPS_HZ:
        raise ValueError(
            f'the scene needs {steps_per_sample * true_rate_hz:.3g} steps for a second, allowed: '
            f'{MOST_STEPS_HZ:g}; a longer step_s, more damping_n_s_m or mass_kg 0 help'
        )
    step_s = 1.0 / (true_rate_hz * steps_per_sample)
    patches = np.ones(PAPER_CHANNELS if friction else 0)
    if free_object:
        patches = np.append(patches, free_object.rest_patches)
    cutoff_rad_s = 2.0 * np.pi * electronics.bandwidth_hz
    return SceneConstants(
        step_s=step_s,
        steps_per_sample=steps_per_sample,
        decay=math.exp(-cutoff_rad_s * step_s) if cutoff_rad_s else -1.0,
        positions_m=fingertip.taxel_positions(),
        patches=patches,
        normal_v_n=frontend.normal_v_n,
        shear_v_n=frontend.shear_v_n,
        hertz=contact.numbers(),
        skin=skin.numbers() if friction else SkinNumbers(0.0, 0.0, 0.0),
        friction=friction.numbers() if friction else NO_FRICTION,
        ridges=texture.numbers(of_texture) if texture else NO_RIDGES,
        rough=roughness.numbers() if roughness else NO_ROUGHNESS,
        body=free_object.numbers() if free_object else NO_OBJECT,
    )


def _ringing_step_s(skin: Skin) -> float:
    """Return the longest step that resolves the skin's own oscillation; infinite without one."""
    if skin.damping_n_s_m**2 >= 4.0 * skin.shear_stiffness_n_m * skin.mass_kg:
        return math.inf
    return RINGING_RAD * math.sqrt(skin.mass_kg / skin.shear_stiffness_n_m)
