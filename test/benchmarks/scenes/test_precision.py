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

"""Errors and run times of one scene."""

import math

import pytest

from benchmarks.scenes import precision as scenes_precision
from benchmarks.scenes.precision import scene_precision
from benchmarks.scenes.sizes import QUICK
from slip_detector.scenes import find_scene
from support.benchmark_scenes import SHORT_PLATE, SIZES, written
from support.benchmarks import runs_of


def test_the_reference_is_checked_by_a_second_method(plate_precision, object_precision):
    for entry in (plate_precision, object_precision):
        reference = entry['reference']
        assert reference['method'] != reference['check']
        assert reference['voltage_error'] < 1e-6
        assert reference['onset_error_s'] < 1e-7
    assert plate_precision['reference']['position_error_m'] is None
    assert object_precision['reference']['position_error_m'] < 1e-8


def test_every_method_has_its_errors_and_its_time(plate_precision, object_precision):
    for entry in (plate_precision, object_precision):
        for method in ('live', 'LSODA', 'BDF', 'Radau'):
            runs = [run for run in runs_of(entry, method) if not run['said']]
            assert runs, method
            for run in runs:
                assert run['run_time_per_s'] > 0.0
                assert run['steps'] > 0
                assert math.isfinite(run['voltage_error'])
                assert run['over'][0] < run['over'][1]


def test_errors_fall_with_the_step_and_with_the_tolerance(plate_precision, object_precision):
    for entry in (plate_precision, object_precision):
        for method in ('live', 'LSODA', 'BDF'):
            errors = [run['voltage_error'] for run in runs_of(entry, method)]
            assert errors[-1] < errors[0] / 3.0, method
    live = runs_of(plate_precision, 'live')
    assert live[-1]['onset_error_s'] < live[0]['onset_error_s']
    assert live[-1]['onset_error_s'] < 1e-5
    assert runs_of(object_precision, 'live')[-1]['position_error_m'] < 1e-5


def test_the_shipped_step_is_measured_too(plate_precision):
    assert plate_precision['shipped_live']['setting'] == '8 steps a sample'
    assert (
        plate_precision['shipped_live']['voltage_error']
        == runs_of(plate_precision, 'live')[-1]['voltage_error']
    )


def test_an_explicit_method_does_a_stretch_from_the_reference_s_state(tmp_path):
    sizes = QUICK._replace(
        tolerances=(), explicit_tolerances=(1e-5,), steps_per_sample=(8,), stretch_budget_s=60.0
    )
    soft = SHORT_PLATE.replace('lugre}', 'lugre, bristle_stiffness_n_m: 3.0e+3}')
    entry = scene_precision(written(tmp_path / 'plate.yaml', soft), sizes)
    for method in ('RK45', 'DOP853'):
        (run,) = runs_of(entry, method)
        assert run['over'][0] == pytest.approx(0.2 - 0.02, abs=2 / 380)
        assert run['voltage_error'] < 5e-3


def test_what_gives_up_says_so_and_has_no_figures(plate, plate_references, monkeypatch):
    monkeypatch.setattr(scenes_precision, '_references', lambda ode: plate_references)
    sizes = QUICK._replace(tolerances=(), steps_per_sample=(8,), stretch_budget_s=0.01)
    entry = scene_precision(plate, sizes)
    (run,) = runs_of(entry, 'RK45')
    assert run['said'] == 'RK45: given up after 0.01 s'
    assert run['voltage_error'] is run['run_time_per_s'] is None
    assert entry['front'] == {'ratio': None, 'against': ''}


def test_a_scene_without_states_has_nothing_to_compare():
    entry = scene_precision(find_scene('taps'), SIZES)
    assert entry['runs'] == []
    assert 'closed form' in entry['note']


def test_where_the_references_differ_by_more_than_is_compared_nothing_is_judged(
    plate, plate_references, monkeypatch
):
    first, (method, rtol, solution) = plate_references
    apart = [first, (method, rtol, solution._replace(clean_v=solution.clean_v + 0.05))]
    monkeypatch.setattr(scenes_precision, '_references', lambda ode: apart)
    sizes = QUICK._replace(tolerances=(), explicit_tolerances=(), steps_per_sample=(8,))
    entry = scene_precision(plate, sizes)
    assert entry['runs']
    assert entry['front'] is None
    assert 'differ by more' in entry['note']
