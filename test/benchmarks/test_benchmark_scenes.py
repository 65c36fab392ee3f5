"""The benchmark of the scenes: what it gives, and how it judges."""

import json
import math

import numpy as np
import pytest

from benchmarks import scenes
from benchmarks.scenes import QUICK, costs, front, measure, pace, precision, table
from slip_detector.scenes import Scene

PLATE = """
steps:
  - {duration_s: 0.05}
  - {duration_s: 0.05, force_n: 0.4}
  - {duration_s: 0.1}
  - {duration_s: 0.1, velocity_m_s: 6.7e-3}
  - {duration_s: 0.05, force_n: 0.0}
friction: {model: lugre}
texture: {spatial_period_m: 400.0e-6}
"""
OBJECT = """
steps:
  - {duration_s: 0.05, force_n: 2.5}
  - {duration_s: 0.1}
  - {duration_s: 0.05, carried: 1.0}
  - {duration_s: 0.1, force_n: 0.3}
friction: {model: lugre}
object: {mass_kg: 0.2, length_m: 0.02}
"""
SIZES = QUICK._replace(
    explicit_tolerances=(), steps_per_sample=(2, 8), budget_s=0.5, stretch_budget_s=5.0
)


def written(path, text):
    path.write_text(text)
    return path


@pytest.fixture(scope='module')
def plate(tmp_path_factory):
    return precision(written(tmp_path_factory.mktemp('scenes') / 'plate.yaml', PLATE), SIZES)


@pytest.fixture(scope='module')
def thing(tmp_path_factory):
    return precision(written(tmp_path_factory.mktemp('scenes') / 'thing.yaml', OBJECT), SIZES)


def runs_of(entry, method):
    return [run for run in entry['runs'] if run['method'] == method]


def test_the_reference_is_checked_by_a_second_method(plate, thing):
    for entry in (plate, thing):
        reference = entry['reference']
        assert reference['method'] != reference['check']
        assert reference['voltage_error'] < 1e-6
        assert reference['onset_error_s'] < 1e-7
    assert plate['reference']['position_error_m'] is None
    assert thing['reference']['position_error_m'] < 1e-8


def test_every_method_has_its_errors_and_its_time(plate, thing):
    for entry in (plate, thing):
        for method in ('live', 'LSODA', 'BDF', 'Radau'):
            runs = [run for run in runs_of(entry, method) if not run['said']]
            assert runs, method
            for run in runs:
                assert run['run_time_per_s'] > 0.0
                assert run['steps'] > 0
                assert math.isfinite(run['voltage_error'])
                assert run['over'][0] < run['over'][1]


def test_errors_fall_with_the_step_and_with_the_tolerance(plate, thing):
    for entry in (plate, thing):
        for method in ('live', 'LSODA', 'BDF'):
            errors = [run['voltage_error'] for run in runs_of(entry, method)]
            assert errors[-1] < errors[0] / 3.0, method
    live = runs_of(plate, 'live')
    assert live[-1]['onset_error_s'] < live[0]['onset_error_s']
    assert live[-1]['onset_error_s'] < 1e-5
    assert runs_of(thing, 'live')[-1]['position_error_m'] < 1e-5


def test_the_shipped_step_is_measured_too(plate):
    assert plate['shipped_live']['setting'] == '8 steps a sample'
    assert plate['shipped_live']['voltage_error'] == runs_of(plate, 'live')[-1]['voltage_error']


def test_an_explicit_method_does_a_stretch_from_the_reference_s_state(tmp_path):
    sizes = QUICK._replace(
        tolerances=(), explicit_tolerances=(1e-5,), steps_per_sample=(8,), stretch_budget_s=60.0
    )
    soft = PLATE.replace('lugre}', 'lugre, bristle_stiffness_n_m: 3.0e+3}')
    entry = precision(written(tmp_path / 'plate.yaml', soft), sizes)
    for method in ('RK45', 'DOP853'):
        (run,) = runs_of(entry, method)
        assert run['over'][0] == pytest.approx(0.2 - 0.02, abs=2 / 380)
        assert run['voltage_error'] < 5e-3


def test_what_gives_up_says_so_and_has_no_figures(tmp_path):
    sizes = QUICK._replace(tolerances=(), steps_per_sample=(8,), stretch_budget_s=0.01)
    entry = precision(written(tmp_path / 'plate.yaml', PLATE), sizes)
    (run,) = runs_of(entry, 'RK45')
    assert run['said'] == 'RK45: given up after 0.01 s'
    assert run['voltage_error'] is run['run_time_per_s'] is None
    assert entry['front'] == {'ratio': None, 'against': ''}


def test_a_scene_without_states_has_nothing_to_compare():
    entry = precision(scenes.find_scene('taps'), SIZES)
    assert entry['runs'] == []
    assert 'closed form' in entry['note']


def test_where_the_references_differ_by_more_than_is_compared_nothing_is_judged(
    tmp_path, monkeypatch
):
    honest = scenes._references

    def apart(ode):
        first, (method, rtol, solution) = honest(ode)
        return [first, (method, rtol, solution._replace(clean_v=solution.clean_v + 0.05))]

    monkeypatch.setattr(scenes, '_references', apart)
    sizes = QUICK._replace(tolerances=(), explicit_tolerances=(), steps_per_sample=(8,))
    entry = precision(written(tmp_path / 'plate.yaml', PLATE), sizes)
    assert entry['runs']
    assert entry['front'] is None
    assert 'differ by more' in entry['note']


def test_an_unknown_scene_is_named():
    with pytest.raises(ValueError, match="no scene 'moon', allowed: "):
        measure(quick=True, names=('moon',))


# The front.


def run_at(method, error, run_time, said=''):
    return {
        'method': method, 'voltage_error': error, 'run_time_per_s': run_time, 'said': said,
    }  # fmt: skip


LIVE = [run_at('live', 1e-2, 1.0), run_at('live', 1e-4, 10.0)]


def test_ahead_of_all_is_below_one():
    verdict = front([*LIVE, run_at('BDF', 1e-2, 2.0), run_at('BDF', 1e-4, 20.0)])
    assert verdict['ratio'] == pytest.approx(0.5)


def test_one_faster_rival_is_found():
    verdict = front([*LIVE, run_at('BDF', 1e-2, 2.0), run_at('LSODA', 1e-3, 1.0)])
    assert verdict['ratio'] == pytest.approx(math.sqrt(10.0))
    assert verdict['against'] == 'LSODA at 1.0e-03'


def test_a_rival_s_line_counts_where_it_crosses_the_bound():
    verdict = front([*LIVE, run_at('BDF', 1e-2, 5.0), run_at('BDF', 1e-6, 5.5)])
    assert verdict['against'] == 'BDF at 1.0e-03'


def test_rivals_below_the_bound_and_those_that_gave_up_do_not_count():
    rivals = [run_at('BDF', 1e-6, 100.0), run_at('RK45', None, None, 'RK45: given up')]
    assert front([*LIVE, *rivals])['ratio'] < 0.1


def test_a_rival_that_the_live_stepper_cannot_match_is_infinitely_ahead():
    assert front([run_at('live', 1e-1, 1.0), run_at('BDF', 1e-3, 9.0)])['ratio'] == math.inf


# Costs and pace.


def test_costs_name_the_parts_and_what_is_needed(tmp_path):
    entry = costs(written(tmp_path / 'thing.yaml', OBJECT), SIZES)
    assert entry['parts'] == ['friction', 'object']
    assert entry['speed'] == pytest.approx(1.0 / entry['run_time_per_s'])
    friction = entry['without']['friction']
    assert friction['share'] is None
    assert friction['said'].startswith('object: falls without friction')


def test_a_part_left_out_is_not_computed(tmp_path):
    entry = costs(written(tmp_path / 'plate.yaml', PLATE), SIZES)
    assert set(entry['without']) == {'friction', 'texture'}
    assert all(part['share'] > 0.0 for part in entry['without'].values())


def test_the_pace_is_of_every_read():
    figures = pace(scenes.find_scene('plate_400um'), SIZES)
    assert figures['rows'] == 32
    assert 0.0 < figures['mean_share'] <= figures['slowest_share']


# What is shown.


@pytest.fixture(scope='module')
def result(plate, thing):
    description = scenes.read_yaml(scenes.find_scene('taps'))
    assert Scene(description, np.random.default_rng(0)).length
    entries = [plate, thing, precision(scenes.find_scene('taps'), SIZES)]
    return {
        'precision': entries,
        'costs': [costs(scenes.find_scene('taps'), SIZES)],
        'pace': {'rows': 32, 'slowest_share': 0.1, 'mean_share': 0.05},
        'wanted': {'front.ratio': {'value': 0.5, 'bound': '<= 1', 'met': True}},
    }


def test_the_table_has_all_and_fits(result):
    text = table(result)
    assert max(map(len, text.splitlines())) <= 99
    for word in ('plate: ', 'thing: ', 'closed form', 'LSODA', 'Radau', 'front.ratio', 'met'):
        assert word in text


def test_the_result_is_json(result):
    assert json.loads(json.dumps(result, allow_nan=False))['precision'][0]['runs']


def test_the_picture_is_drawn(result, tmp_path):
    pytest.importorskip('matplotlib')
    from slip_detector.report.plots import draw_scenes_precision

    draw_scenes_precision(tmp_path / 'picture.png', result)
    assert (tmp_path / 'picture.png').stat().st_size > 10_000
