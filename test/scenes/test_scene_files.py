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

"""Scene files: what is wrong is said in one line, and those of the package play."""

import dataclasses

import numpy as np
import pytest

from slip_detector import ChainConfig, SlipChain
from slip_detector.parameters.files import shared_folder
from slip_detector.scenes import find_scene, load_scene
from slip_detector.scenes.electronics import CONTACT_N
from support.config_cases import message_of

ALL = 10**9
SHIPPED = sorted(path.stem for path in (shared_folder() / 'config' / 'scenes').glob('*.yaml'))


# What is wrong with a scene file is said in one line.

#: Parts and values that are wrong in a scene whose steps are good, unless it has steps itself.
WRONG = {
    'steps: 3': 'steps is 3, allowed: a list of at least one step',
    'steps: [3]': 'steps is [3], allowed: a list of at least one step, each names and',
    'steps: [{}, {duration_s: 0}]': 'steps: step 2: parameter duration_s is 0 s, allowed: 0',
    'steps: [{duration_s: 0.1, velocity_m_s: 1}]': 'step 1: duration_s 0.1 s is too short to',
    'steps: [{duration_s: 0.001}]': 'steps: all take 0.001 s, allowed: at least one sample',
    'steps: [{carried: 1.0}]': 'steps: carried and pull_n are for an object, allowed: with',
    'steps: [': ' line 1: ',
    'texture: {depth: 0.1}': 'texture: unknown parameter depth = 0.1; allowed: ',
    'texture: [1]': 'texture is [1], allowed: names and values',
    'humm: {}': 'unknown part humm, allowed: steps, sample_rate_hz, step_s, mot',
    'friction: {model: coulomb}': "friction: parameter model is 'coulomb', allowed: lugre",
    'friction: {kinetic_coefficient: 0.7}': 'friction: parameter kinetic_coefficient is 0.7, all',
    'electronics: {rails_v: [5, 0]}': 'rails_v is (5.0, 0.0), allowed: each number above',
    'object: {}': 'object: falls without friction, allowed: with the part',
    'steps: [{velocity_m_s: 0.001}]\nobject: {}\nfriction: {}': (
        'steps: velocity_m_s is not 0, allowed: 0 with an object'
    ),
    'object: {}\nfriction: {}\ntexture: {}': (
        'electronics: bandwidth_hz is 0, allowed: above 0 with an object and texture'
    ),
    'steps: [{force_n: 1}]\nfriction: {kinetic_coefficient: 0.1, static_coefficient: 1, '
    'stribeck_velocity_m_s: 1.0e-6}': (
        'friction: the skin would chatter, as friction falls with velocity by up to'
    ),
    'skin: {damping_n_s_m: 0}\nfriction: {kinetic_coefficient: 0.61}': (
        'friction: bristle_damping_n_s_m is 0.1 N s/m, and skin without damping'
    ),
    'sample_rate_hz: 40\ncontact_noise:': (
        'contact_noise: parameter band_hz ends at 20 Hz, allowed: below 20 Hz, half the'
    ),
    'tremor: {low_hz: 30}': 'tremor: parameter high_hz is 20 Hz, allowed: above low_hz, 30 Hz',
    'texture: {indentation_m: 1.0e-4}': (
        'texture: parameter ridge_height_m is 0.0001 m, allowed: with its harmonics at most'
    ),
}


@pytest.mark.parametrize(('text', 'said'), WRONG.items())
def test_a_wrong_scene_file_is_named_with_part_parameter_and_what_is_allowed(tmp_path, text, said):
    path = tmp_path / 'wrong.yaml'
    path.write_text(text if 'steps' in text else f'steps: [{{}}]\n{text}')
    message = message_of(load_scene, path, np.random.default_rng(0))
    assert message.startswith(f'{path}:')
    assert said in message


# The scenes that come with the package.


@pytest.mark.parametrize('name', SHIPPED)
def test_a_scene_of_the_package_plays_within_its_rails_and_says_what_slips(name):
    scene = load_scene(find_scene(name), np.random.default_rng(0))
    samples = scene.read(ALL)
    assert len(samples.volts) == scene.length
    assert np.isfinite(samples.volts).all()
    assert samples.volts.min() >= 0.0
    assert samples.volts.max() <= 5.0
    sound = samples.volts[:, np.arange(16) != 4] if name == 'dead_channel' else samples.volts
    assert np.ptp(sound, axis=0).min() > 0.05  # The contact is felt everywhere.
    without = 'taps', 'rolling', 'tremor_hum', 'press', 'obedient'
    assert samples.truth.any() == (name not in without)


def test_of_a_name_that_no_scene_has_the_names_are_listed():
    with pytest.raises(ValueError, match=r"no scene 'plate'.*plate_400um.*path to a \.yaml"):
        find_scene('plate')


# What presses and grasps show of a detector.


def slip_and_times(scene_name, preset, **changes):
    """Return where a preset says slip in a scene, the times, and where the finger is touched."""
    scene = load_scene(find_scene(scene_name), np.random.default_rng(7))
    samples = scene.read(ALL)
    time_s = samples.stamps_ns * 1e-9
    config = ChainConfig.from_yaml(shared_folder() / 'config' / f'{preset}.yaml')
    slip = SlipChain(dataclasses.replace(config, **changes)).update(samples.volts).slip
    return slip, time_s, scene.force_n(time_s) > CONTACT_N


@pytest.mark.parametrize('preset', ['slip_detector', 'onset'])
def test_presses_are_taken_for_slip_as_on_a_real_finger_and_its_rest_is_not(preset):
    # On the real one 62 to 70 % of presses and of the time between them, and 0 to 23 % of idle.
    slip, time_s, touched = slip_and_times('press', preset)
    first_s, last_s = time_s[touched][[0, -1]]
    pressed = (time_s >= first_s) & (time_s <= last_s)
    assert 0.5 < slip[pressed].mean() < 0.8
    assert slip[~pressed].mean() < 0.05


@pytest.mark.parametrize('preset', ['onset', 'sure'])
def test_a_grasp_is_slip_for_a_preset_only_without_its_impacts(preset):
    for impact_v, low, high in ((0.0, 0.8, 1.0), (0.12, 0.0, 0.1)):
        slip, time_s, _ = slip_and_times('grasp_and_release', preset, impact_v=impact_v)
        grasped = (time_s >= 1.0) & (time_s < 1.4)
        slides = (time_s >= 2.66) & (time_s < 3.36)
        assert low <= slip[grasped].mean() <= high
        assert slip[slides].mean() > 0.9
