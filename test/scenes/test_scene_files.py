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

import re

import numpy as np
import pytest
import yaml

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.parameters.files import shared_folder
from slip_detector.scenes import find_scene, load_scene
from slip_detector.scenes.parts import PARTS
from support.scene_cases import ALL, shipped, times_s

SHIPPED = sorted(path.stem for path in (shared_folder() / 'config' / 'scenes').glob('*.yaml'))


# What is wrong with a scene file is said in one line.


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('sample_rate_hz: 380.0', 'steps is None, allowed: a list of at least one step'),
        ('steps: [3]', 'steps: step 1 is 3, allowed: names and values'),
        (
            'steps: [{duration_s: 1}, {duration_s: 0}]',
            'steps: step 2: parameter duration_s is 0 s, allowed: 0.001 to 36000 s',
        ),
        (
            'motion: {acceleration_m_s2: 0.5}\nsteps: [{duration_s: 0.01, velocity_m_s: 1}]',
            'duration_s 0.01 s is too short to reach 1 m/s, allowed: at least 2 s at 0.5 m/s2',
        ),
        (
            'steps: [{duration_s: 0.001}]',
            'steps: all take 0.001 s, allowed: at least one sample at 380 Hz',
        ),
        (
            'steps: [{}]\ntexture: {spatial_period_m: 0}',
            'texture: parameter spatial_period_m is 0 m, allowed: 1e-06 to 1 m',
        ),
        (
            'steps: [{}]\ntexture: {depth: 0.1}',
            'texture: unknown parameter depth = 0.1; allowed: harmonics, indentation_m',
        ),
        (
            'steps: [{}]\nfriction: {kinetic_coefficient: 0.7, static_coefficient: 0.6}',
            'friction: parameter kinetic_coefficient is 0.7, allowed: above 0 and at most',
        ),
        (
            'steps: [{}]\nfriction: dahl',
            "friction: parameter model is 'dahl', allowed: lugre, coulomb",
        ),
        (
            'steps: [{}]\nskin: {mass_kg: -1}',
            'skin: parameter mass_kg is -1 kg, allowed: 0 to 1 kg',
        ),
        (
            'steps: [{}]\nroughness: {correlation_m: 0}',
            'roughness: parameter correlation_m is 0 m, allowed: 1e-09 to 1 m',
        ),
        (
            'steps: [{}]\nelectronics: {rails_v: [5, 0]}',
            'electronics: parameter rails_v is [5, 0] V, allowed: low below high',
        ),
        (
            'steps: [{}]\ncontact: {centre_m: [0]}',
            'contact: parameter centre_m has 1 numbers, allowed: 2',
        ),
        (
            'steps: [{}]\nhumm: {}',
            'unknown part humm, allowed: steps, sample_rate_hz, step_s, motion, contact, skin, '
            'friction, texture, roughness, object, electronics, hum, tremor, taps, rolling, '
            'faults, drops, clock',
        ),
        ('steps: [{}]\ntexture: [1]', 'texture is [1], allowed: names and values'),
        ('steps: [{}]\ntexture: coulomb', "texture is 'coulomb', allowed: names and values"),
        (
            'steps: [{}]\nsample_rate_hz: 0',
            'parameter sample_rate_hz is 0 Hz, allowed: 1 to 1e+06',
        ),
        ('steps: [{}]\nstep_s: 0', 'parameter step_s is 0 s, allowed: 1e-07 to 1 s'),
        (
            'steps: [{}]\nstep_s: 1.0e-7\nfriction: {}',
            'steps for a second, allowed: 2e+06',
        ),
        ('steps: [{}]\nobject: {}', 'object: falls without friction, allowed: with the part'),
        (
            'steps: [{velocity_m_s: 0.001}]\nobject: {}\nfriction: {}',
            'steps: velocity_m_s is not 0, allowed: 0 with an object',
        ),
        (
            'steps: [{}]\nobject: {}\nfriction: {}\ntexture: {}',
            'electronics: bandwidth_hz is 0, allowed: above 0 with an object and texture',
        ),
        (
            'steps: [{}]\nobject: {mass_kg: 20}\nfriction: {}',
            'object: parameter mass_kg is 20 kg, allowed: 0.001 to 10 kg',
        ),
        (
            'steps: [{carried: 1.0}]',
            'steps: carried and pull_n are for an object, allowed: with that part',
        ),
        (
            'steps: [{pull_n: 1.0}]',
            'steps: carried and pull_n are for an object, allowed: with that part',
        ),
        (
            'steps: [{duration_s: 1, velocity_m_s: 0.08}]\n'
            'texture: {spatial_period_m: 4.0e-4, harmonics: [0, 0]}',
            'which aliases at a sample rate of 380 Hz; allowed: with bandwidth_hz',
        ),
        (
            'steps: [{force_n: 1}]\nfriction: {kinetic_coefficient: 0.1, static_coefficient: 1, '
            'stribeck_velocity_m_s: 1.0e-6}',
            'friction: falls with velocity by up to',
        ),
        (
            'steps: [{}]\nskin: {damping_n_s_m: 0, mass_kg: 0}\nfriction: {viscous_n_s_m: 0, '
            'kinetic_coefficient: 0.5, static_coefficient: 0.5, bristle_damping_n_s_m: 1}',
            'friction: bristle_damping_n_s_m is 1 N s/m on skin without mass and damping',
        ),
        ('- 1', 'is not a YAML file of names and values'),
        ('steps: [', ' line 1 is not YAML'),
    ],
)
def test_a_wrong_scene_file_is_named_with_part_parameter_and_what_is_allowed(tmp_path, text, said):
    path = tmp_path / 'wrong.yaml'
    path.write_text(text)
    with pytest.raises(ValueError, match=re.escape(said)) as caught:
        load_scene(path, np.random.default_rng(0))
    assert str(caught.value).startswith(f'{path}:')
    assert '\n' not in str(caught.value)


def test_a_missing_scene_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=re.escape(f'{tmp_path / "no.yaml"}: cannot be read')):
        load_scene(tmp_path / 'no.yaml', np.random.default_rng(0))


# The scenes that come with the package.


def test_the_scenes_that_are_wanted_are_there():
    wanted = {
        'plate_400um', 'plate_440um', 'plate_480um', 'flat_plate', 'fast_40mm_s', 'fast_80mm_s',
        'taps', 'rolling', 'tremor_hum', 'dead_channel', 'object',
    }  # fmt: skip
    assert wanted <= set(SHIPPED)


@pytest.mark.parametrize('name', SHIPPED)
def test_a_scene_of_the_package_plays_within_its_rails_and_says_what_slips(name):
    scene = load_scene(find_scene(name), np.random.default_rng(0))
    samples = scene.read(ALL)
    assert len(samples.volts) == scene.length
    low_v, high_v = 0.0, 5.0
    assert np.isfinite(samples.volts).all()
    assert samples.volts.min() >= low_v
    assert samples.volts.max() <= high_v
    sound = samples.volts[:, np.arange(16) != 4] if name == 'dead_channel' else samples.volts
    assert np.ptp(sound, axis=0).min() > 0.05  # The contact is felt everywhere.
    assert samples.truth.any() == (name not in ('taps', 'rolling', 'tremor_hum'))


@pytest.mark.parametrize('name', SHIPPED)
def test_a_scene_of_the_package_names_parts_only(name):
    named = set(yaml.safe_load(find_scene(name).read_text()))
    assert named <= {'steps', 'sample_rate_hz', 'step_s', *PARTS}


def test_the_object_of_the_package_is_held_slips_is_caught_and_falls():
    samples = shipped('object')
    t, truth = samples.time_s, samples.truth
    assert not truth[(t > 2.0) & (t < 3.0)].any()
    assert truth[(t > 3.0) & (t < 3.15)].any()
    assert not truth[(t > 3.5) & (t < 4.0)].any()
    assert truth[t > 4.1].any()
    slid_m = np.interp([2.5, 3.9, 5.0], t, samples.position_m)
    assert 1e-4 < slid_m[1] - slid_m[0] < 0.05
    assert slid_m[2] >= 0.1  # Through the fingers and lost.


@pytest.mark.parametrize('seed', range(3))
def test_the_default_chain_finds_the_slip_of_the_default_plate(seed):
    samples = shipped('plate_400um', seed)
    result = SlipChain().update(samples.volts)
    t = times_s(samples)
    slip_s = t[samples.truth]
    assert result.channels[samples.truth].any(axis=0).all()
    assert result.slip[samples.truth].mean() > 0.9
    delay_s = t[np.argmax(result.slip & (t >= slip_s[0]))] - slip_s[0]
    assert 0.0 < delay_s < 0.08
    assert not result.slip[(t < 1.0) | (t > slip_s[-1] + 0.2) & (t < 6.6)].any()


def test_a_scene_is_found_by_name_or_taken_by_path():
    assert find_scene('plate_400um') == shared_folder() / 'config' / 'scenes' / 'plate_400um.yaml'
    assert find_scene('plate_400um').is_file()
    assert str(find_scene('elsewhere/my.yaml')) == 'elsewhere/my.yaml'


def test_an_unknown_scene_lists_those_there_are():
    with pytest.raises(ValueError, match=r"no scene 'plate'.*plate_400um.*path to a \.yaml"):
        find_scene('plate')
