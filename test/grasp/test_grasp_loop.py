"""The closed loop without ROS: objects that slip are caught."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.grasp.comparison import (
    AT_LIMIT,
    CONTROLLER,
    PAPER,
    UNCONTROLLED,
    conditions,
    grasp_figures,
)
from slip_detector.grasp.law import GraspLaw
from slip_detector.grasp.loop import GraspTrial, play_trial, play_trials
from slip_detector.grasp.objects import RANGES, object_scene
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.grasp import GraspConfig

FILE = Path(__file__).resolve().parents[2] / 'config' / 'grasp.yaml'
CHAIN, GRASP = ChainConfig.from_yaml(FILE), GraspConfig.from_yaml(FILE)

#: Those that the README reports on, others than those the parameters were chosen on.
REPORTED = range(30)

#: Others than either.
SEEDS = range(5000, 5003)


@pytest.fixture(scope='module')
def played():
    """Return the trials of each condition."""
    return {name: play_trials(*both, SEEDS) for name, both in conditions(CHAIN, GRASP).items()}


def test_an_object_that_gets_heavier_is_never_dropped_and_hardly_slides(played):
    found = grasp_figures(played[CONTROLLER], GRASP.limit_n)
    assert found['dropped'] == 0
    assert found['worst_slide_mm'] < 5.0
    assert found['mean_slide_mm'] < 2.0
    limit = grasp_figures(played[AT_LIMIT], GRASP.limit_n)
    assert found['needed_percent'] < found['force_percent'] < 0.8 * limit['force_percent']
    for trial in played[CONTROLLER]:
        # It did slip, slip said so, the grip rose, and at the end the object is at rest.
        assert trial.sliding.any()
        assert len(trial.onsets_s)
        assert trial.command_n[-1] > GRASP.grip_n
        assert not trial.sliding[-100:].any()
        assert np.ptp(trial.position_m[-100:]) < 1e-5


def test_the_figures_of_the_readme_are_as_good_as_is_wanted():
    found = grasp_figures(play_trials(CHAIN, GRASP, REPORTED), GRASP.limit_n)
    assert found['trials'] == 30
    assert found['dropped'] == 0
    assert found['worst_slide_mm'] < 5.0
    assert found['mean_slide_mm'] < 2.0
    assert found['force_percent'] < 60.0


def test_without_a_controller_it_is_dropped(played):
    found = grasp_figures(played[UNCONTROLLED], GRASP.limit_n)
    assert found['dropped'] == len(SEEDS)
    assert found['slide_mm'] == [None] * len(SEEDS)
    assert found['mean_slide_mm'] is None
    assert found['worst_slide_mm'] is None


def test_a_grip_at_the_limit_holds_and_spends_more(played):
    found = grasp_figures(played[AT_LIMIT], GRASP.limit_n)
    assert found['dropped'] == 0
    assert found['worst_slide_mm'] < 0.1
    assert found['force_percent'] > 90.0


def test_the_papers_defaults_slide_further_and_squeeze_harder(played):
    ours = grasp_figures(played[CONTROLLER], GRASP.limit_n)
    theirs = grasp_figures(played[PAPER], GRASP.limit_n)
    assert theirs['dropped'] or theirs['mean_slide_mm'] > ours['mean_slide_mm']
    assert theirs['force_percent'] > ours['force_percent']


def test_each_seed_is_another_object_within_the_ranges_and_always_the_same_one():
    scenes = [object_scene(seed) for seed in range(200)]
    assert scenes[7] == object_scene(7)
    masses = np.array([scene['object']['mass_kg'] for scene in scenes])
    assert len(set(masses)) == len(masses)
    low, high = RANGES['mass_kg']
    assert low <= masses.min() < masses.max() <= high
    assert np.ptp(masses) > 0.9 * (high - low)
    for scene in scenes:
        friction = scene['friction']
        assert friction['kinetic_coefficient'] < friction['static_coefficient']
    assert len({scene['electronics']['fingertip_seed'] for scene in scenes}) == len(scenes)


def test_a_trial_is_the_same_each_time_and_what_was_before_a_command_does_not_depend_on_it():
    once, again = (play_trials(CHAIN, GRASP, [5000])[0] for _ in range(2))
    for one, other in zip(once, again, strict=True):
        np.testing.assert_array_equal(one, other)
    weaker = dataclasses.replace(GRASP, step_factor=1.1)
    (other,) = play_trials(CHAIN, weaker, [5000])
    same = np.flatnonzero(once.command_n != other.command_n)[0]
    np.testing.assert_array_equal(once.position_m[:same], other.position_m[:same])
    assert not np.array_equal(once.position_m, other.position_m)


def test_the_longer_a_command_takes_the_further_the_object_slides():
    slides_m = [
        play_trials(CHAIN, GRASP, [5000], transport_s=transport_s)[0].position_m[-1]
        for transport_s in (0.0, 0.02, 0.06)
    ]
    assert slides_m == sorted(slides_m)
    assert slides_m[-1] > 1.1 * slides_m[0]


def test_the_grip_follows_the_command_with_the_lag_of_the_gripper():
    (trial,) = play_trials(CHAIN, GRASP, [5000])
    jump = int(np.argmax(np.diff(trial.command_n))) + 1
    before_n, after_n = trial.command_n[jump - 1], trial.command_n[jump]
    at_half = jump + int(np.argmax(trial.force_n[jump:] > 0.5 * (before_n + after_n)))
    # Half of it: later than the transport and well before three times the 30 ms of lag.
    assert 10e-3 < trial.time_s[at_half] - trial.time_s[jump] < 90e-3


def test_a_slide_of_a_lost_object_is_not_defined():
    rows = np.zeros(3)
    lost = GraspTrial(
        rows, rows, rows, rows > 0, rows > 0, np.array([0.0, 0.05, 0.1]), np.ones(3), length_m=0.1
    )
    assert lost.dropped
    assert lost.slide_m is None
    held = lost._replace(length_m=0.2)
    assert not held.dropped
    assert held.slide_m == 0.1
    found = grasp_figures([held, lost], 1.0)
    assert found['slide_mm'] == [pytest.approx(100.0), None]
    assert found['dropped'] == 1
    assert found['mean_slide_mm'] is None


def test_a_scene_that_holds_nothing_or_has_another_rate_is_refused_in_one_line():
    with pytest.raises(ValueError, match='has no object that gets heavier') as caught:
        object_scene(0, 'plate_400um')
    assert 'plate_400um.yaml' in str(caught.value)
    assert '\n' not in str(caught.value)
    with pytest.raises(ValueError, match='the scene holds nothing, allowed: '):
        play_trial({'steps': [{'duration_s': 1.0}]}, 0, SlipChain(CHAIN), GraspLaw(GRASP))
    faster = SlipChain(dataclasses.replace(CHAIN, sample_rate_hz=500.0))
    with pytest.raises(ValueError, match='has 380 Hz, allowed: 500 Hz'):
        play_trial(object_scene(0), 0, faster, GraspLaw(GRASP))
