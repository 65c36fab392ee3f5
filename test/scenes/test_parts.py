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

"""Parts: every set of parameters of the scenes is one, and what is named is read."""

import importlib
import pkgutil

import pytest

from slip_detector import scenes
from slip_detector.parameters.sets import ParameterSet
from slip_detector.scenes.friction import Friction
from slip_detector.scenes.motion import Step
from slip_detector.scenes.parts import NOT_PARTS, PARTS, Sampling, read_parts, read_sampling


def test_every_set_of_parameters_of_the_scenes_is_a_part():
    found = set()
    for module in pkgutil.iter_modules(scenes.__path__, 'slip_detector.scenes.'):
        found |= {
            content
            for content in vars(importlib.import_module(module.name)).values()
            if isinstance(content, type) and issubclass(content, ParameterSet)
        }
    assert found - {ParameterSet} == {*PARTS.values(), Sampling, Step}


def test_a_part_that_is_named_is_read_and_no_other():
    parts = read_parts(
        {'steps': [{}], 'step_s': 1e-4, 'hum': {'frequency_hz': 60.0}, 'clock': None}
    )
    assert parts == {'hum': PARTS['hum'](frequency_hz=60.0), 'clock': PARTS['clock']()}


def test_friction_by_its_model_alone_has_the_defaults_of_that_model():
    assert read_parts({'friction': 'coulomb'}) == {'friction': Friction(model='coulomb')}
    assert read_parts({'friction': 'none'}) == {}


def test_a_name_that_is_no_part_is_refused_with_all_that_are_allowed():
    allowed = ', '.join((*NOT_PARTS, *PARTS))
    with pytest.raises(ValueError, match=f'^unknown part humm, allowed: {allowed}$'):
        read_parts({'humm': {}})


def test_the_sampling_is_that_of_the_description_or_the_default():
    assert read_sampling({'steps': [{}], 'hum': {}}) == Sampling()
    described = {'sample_rate_hz': 1000.0, 'step_s': 1e-4, 'hum': {}}
    assert read_sampling(described) == Sampling(sample_rate_hz=1000.0, step_s=1e-4)
