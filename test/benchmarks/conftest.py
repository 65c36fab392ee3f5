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

"""Measurements that several tests look at: they take seconds."""

import pytest

from benchmarks.chain.precision import measure_chain_precision
from benchmarks.chain.speed import measure_chain_speed
from benchmarks.measurement import machine
from benchmarks.scenes import precision as scenes_precision
from benchmarks.scenes.build import build_scene
from benchmarks.scenes.costs import scene_costs
from benchmarks.scenes.ode import Ode
from benchmarks.scenes.precision import scene_precision
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.scenes import find_scene
from support.benchmark_scenes import SHORT_OBJECT, SHORT_PLATE, SIZES, written


@pytest.fixture(scope='session')
def chain_speed():
    return {'machine': machine(), 'quick': True} | measure_chain_speed(quick=True)


@pytest.fixture(scope='session')
def chain_precision():
    return measure_chain_precision(quick=True)


@pytest.fixture(scope='session')
def plate(tmp_path_factory):
    return written(tmp_path_factory.mktemp('scenes') / 'plate.yaml', SHORT_PLATE)


@pytest.fixture(scope='session')
def plate_references(plate):
    """Return the two reference solutions of the plate: to find them takes a second."""
    return scenes_precision._references(Ode(build_scene(read_yaml(plate))))


@pytest.fixture(scope='session')
def plate_precision(plate, plate_references):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenes_precision, '_references', lambda ode: plate_references)
        return scene_precision(plate, SIZES)


@pytest.fixture(scope='session')
def object_precision(tmp_path_factory):
    path = written(tmp_path_factory.mktemp('scenes') / 'object.yaml', SHORT_OBJECT)
    return scene_precision(path, SIZES)


@pytest.fixture(scope='session')
def scenes_figures(plate_precision, object_precision):
    taps = find_scene('taps')
    return {
        'precision': [plate_precision, object_precision, scene_precision(taps, SIZES)],
        'costs': [scene_costs(taps, SIZES)],
        'pace': {'rows': 32, 'slowest_share': 0.1, 'mean_share': 0.05},
        'wanted': {'front.ratio': {'value': 0.5, 'bound': '<= 1', 'met': True}},
    }
