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

"""What a scene and its parts cost."""

import pytest

from benchmarks.scenes.costs import read_pace, scene_costs
from slip_detector.scenes import find_scene
from support.benchmark_scenes import SHORT_OBJECT, SHORT_PLATE, SIZES, written


def test_costs_name_the_parts_and_what_is_needed(tmp_path):
    entry = scene_costs(written(tmp_path / 'object.yaml', SHORT_OBJECT), SIZES)
    assert entry['parts'] == ['friction', 'object']
    assert entry['speed'] == pytest.approx(1.0 / entry['run_time_per_s'])
    friction = entry['without']['friction']
    assert friction['share'] is None
    assert friction['said'].startswith('object: falls without friction')


def test_a_part_left_out_is_not_computed(tmp_path):
    entry = scene_costs(written(tmp_path / 'plate.yaml', SHORT_PLATE), SIZES)
    assert set(entry['without']) == {'friction', 'texture'}
    assert all(part['share'] > 0.0 for part in entry['without'].values())


def test_the_pace_is_of_every_read():
    figures = read_pace(find_scene('plate_400um'), SIZES)
    assert figures['rows'] == 32
    assert 0.0 < figures['mean_share'] <= figures['slowest_share']
