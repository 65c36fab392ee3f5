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

"""Trials of the paper's protocol: read, run through a chain and told in figures."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from slip_detector.evaluation import protocol_trials
from slip_detector.evaluation.protocol_trials import (
    SCENES,
    evaluate_plates,
    plate_figures,
    plate_trial,
    read_trial,
    replay_trial,
    simulate_trials,
    with_band,
    with_windows,
)
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.scenes import SceneSamples, find_scene

RATE_HZ = 100.0


class Deciding:
    """Stands in for a chain: says what it was told to say."""

    def __init__(self, channels, slip=None, disabled_channels=()):
        self.config = ChainConfig(
            sample_rate_hz=RATE_HZ,
            channels=channels.shape[1],
            disabled_channels=disabled_channels,
            passband_hz=(7.0, 40.0),
            stopbands_hz=(),
        )
        self._channels = channels
        self._slip = channels.any(axis=1) if slip is None else slip

    def reset(self):
        self._row = 0

    def update(self, volts, **_):
        rows = slice(self._row, self._row + len(volts))
        self._row = rows.stop
        return SimpleNamespace(channels=self._channels[rows], slip=self._slip[rows])


def decided(trial, *what, **more):
    """Return the outcome of a trial on which a chain says what it is told to say."""
    replay = Replay(ChainConfig(), scores=False, stages=False)
    replay.chain = Deciding(*what, **more)
    return replay_trial(trial, replay)


def delays_s(outcome):
    (slip,) = outcome.slips
    return slip.channel_delays_s


def moving_trial(rows=20, channels=2, start=5, end=12):
    """Make a trial whose plate moves from row ``start`` to row ``end``."""
    position_m = np.clip(np.arange(rows) - start, 0, end - start) * 1e-3
    return plate_trial(np.zeros((rows, channels)), position_m, RATE_HZ)


def on_from(rows, *firsts):
    """Make channels that go ON at a row and stay so; None: never."""
    return np.array([np.arange(rows) >= (rows if f is None else f) for f in firsts]).T


@pytest.fixture(scope='module')
def plates():
    """One simulated trial on each plate."""
    return {plate: simulate_trials(scene, [0]) for plate, scene in SCENES.items()}


# Trials.


def test_a_trial_runs_from_the_last_row_at_which_the_plate_stood_to_the_first_at_which_it_stands():
    trial = plate_trial(np.zeros((7, 1)), np.array([0, 0, 0, 1, 2, 2, 2.0]), RATE_HZ)
    assert (trial.start, trial.end) == (2, 4)
    assert trial.motion_s == (0.02, 0.04)
    assert trial.moving.tolist() == [False, False, True, True, True, False, False]
    # A pause between two motions is part of the slip, as the paper has one slip in a trial.
    positions_m = np.array([0, 1, 1, 1, 2, 2.0])
    again = plate_trial(np.zeros((6, 1)), positions_m, RATE_HZ)
    assert (again.start, again.end) == (0, 4)


def test_a_trial_without_motion_is_refused():
    with pytest.raises(ValueError, match='the platform does not move, allowed: a trial in which'):
        plate_trial(np.zeros((3, 2)), np.ones(3), RATE_HZ)


@pytest.mark.parametrize('rows', [9, 10, 11, 20])
def test_a_scene_is_played_to_its_end_whatever_its_length(monkeypatch, rows):
    monkeypatch.setattr(protocol_trials, 'ROWS_PER_READ', 10)

    class Counting:
        sample_rate_hz, channel_names, at = RATE_HZ, ('a',), 0

        def read(self, n):
            index = np.arange(self.at, min(self.at + n, rows), dtype=float)
            self.at += len(index)
            position_m = np.maximum(index - 3.0, 0.0)
            return SceneSamples(index[:, np.newaxis], index > 3.0, position_m, index / RATE_HZ)

    trial = read_trial(Counting())
    assert trial.volts.ravel().tolist() == list(range(rows))
    assert (trial.start, trial.end, trial.sample_rate_hz) == (3, rows - 1, RATE_HZ)


def test_a_seed_is_a_trial(plates):
    first, second, again = simulate_trials(SCENES['440'], [0, 1, 0])
    np.testing.assert_array_equal(first.volts, again.volts)
    np.testing.assert_array_equal(first.volts, plates['440'][0].volts)
    assert (first.volts != second.volts).any()


def test_a_scene_whose_plate_does_not_move_is_named(tmp_path):
    path = tmp_path / 'still.yaml'
    path.write_text('steps: [{duration_s: 1.0, force_n: 0.4}]')
    with pytest.raises(ValueError, match=f'^{path}: the platform does not move'):
        simulate_trials(str(path), [0])


def test_the_plates_differ_in_nothing_but_their_spatial_period():
    descriptions = {plate: read_yaml(find_scene(scene)) for plate, scene in SCENES.items()}
    for plate, description in descriptions.items():
        assert description['texture'].pop('spatial_period_m') == pytest.approx(int(plate) * 1e-6)
    assert descriptions['440'] == descriptions['400']
    assert descriptions['480'] == descriptions['400']


# Figures of merit.


def test_the_delay_of_a_channel_runs_from_the_start_to_its_first_on_while_the_plate_moves():
    channels = on_from(20, 8, 5, 12, 13, None, 0)
    channels[10:, 5] = False  # ON since before the start: there when the plate starts
    outcome = decided(moving_trial(channels=6), channels)
    assert delays_s(outcome) == pytest.approx([0.03, 0.0, 0.07, None, None, 0.0])


def test_a_disabled_channel_has_no_part_in_the_delay():
    trial = moving_trial(channels=3)
    outcome = decided(trial, on_from(20, None, 8, 9), disabled_channels=(1,))
    assert delays_s(outcome) == pytest.approx([0.03, 0.04])
    assert plate_figures([outcome])['channels_without_on'] == 0


@given(hnp.arrays(bool, (20, 3)), st.integers(0, 10), st.integers(1, 9))
def test_a_channel_has_a_delay_if_and_only_if_it_is_on_in_the_course_of_the_motion(
    channels, start, length
):
    trial = moving_trial(channels=3, start=start, end=start + length)
    for c, delay_s in enumerate(delays_s(decided(trial, channels))):
        rows = channels[start : start + length + 1, c]
        assert (delay_s is None) == (not rows.any())
        if delay_s is not None:
            assert delay_s == pytest.approx(int(rows.argmax()) / RATE_HZ)


def test_the_figures_of_a_plate_by_hand():
    trial = moving_trial()
    figures = plate_figures(
        [
            decided(trial, on_from(20, 7, 9)),
            decided(trial, on_from(20, 10, None), np.arange(20) < 6),
            decided(trial, on_from(20, 8, 10), np.zeros(20, bool)),
        ]
    )
    assert figures == {
        'trial_delays_ms': pytest.approx([30.0, 50.0, 40.0]),
        'mean_delay_ms': pytest.approx(40.0),
        'sd_delay_ms': pytest.approx(10.0),
        'detected': 2,
        'trials': 3,
        'success_percent': pytest.approx(200 / 3),
        # At rest are rows 0 to 4 and 13 to 19.
        'false_positive_percent': pytest.approx(100 * (7 + 5) / 36),
        'channels_without_on': 1,
    }


def test_a_delay_that_is_not_defined_is_none_and_never_zero():
    trial = moving_trial()
    figures = plate_figures([decided(trial, on_from(20, None, None))])
    assert figures['trial_delays_ms'] == [None]
    assert (figures['mean_delay_ms'], figures['sd_delay_ms']) == (None, None)
    assert (figures['detected'], figures['channels_without_on']) == (0, 2)
    always = moving_trial(rows=8, start=0, end=7)
    assert plate_figures([decided(always, on_from(8, 0, 0))])['false_positive_percent'] is None


def test_false_positives_are_pooled_over_the_time_of_all_trials():
    long = decided(moving_trial(rows=10, start=8, end=9), on_from(10, 6, 6))  # 2 of 8 rows
    short = decided(moving_trial(rows=4, start=2, end=3), on_from(4, 0, 0))  # 2 of 2
    assert plate_figures([long, short])['false_positive_percent'] == pytest.approx(40.0)


def test_an_on_outside_the_motion_is_no_detection():
    slip = np.zeros(20, bool)
    slip[[2, 4, 13, 19]] = True
    outcome = decided(moving_trial(channels=1, start=5, end=12), slip[:, np.newaxis], slip)
    figures = plate_figures([outcome])
    assert (figures['detected'], figures['success_percent']) == (0, 0.0)
    assert figures['false_positive_percent'] == pytest.approx(100 * 4 / 12)


def test_a_trial_that_does_not_suit_the_chain_is_refused_with_its_plate():
    trial = moving_trial(channels=4)
    config = {'passband_hz': (7.0, 40.0), 'stopbands_hz': (), 'sample_rate_hz': RATE_HZ}
    with pytest.raises(
        ValueError, match=r'^plate 400: the trial has 4 channels, allowed: 16, the parameter chann'
    ):
        evaluate_plates({'400': [trial]}, ChainConfig(**config))
    with pytest.raises(
        ValueError, match=r'^plate 400: the trial has 100 Hz where the parameter sample_rate_hz is'
    ):
        evaluate_plates({'400': [trial]}, ChainConfig(channels=4))


def test_each_trial_starts_with_a_chain_that_remembers_nothing(plates):
    (trial,) = plates['400']
    twice = evaluate_plates({'400': [trial, trial]}, ChainConfig())['plates']['400']
    once = evaluate_plates({'400': [trial]}, ChainConfig())['plates']['400']
    assert twice['trial_delays_ms'] == once['trial_delays_ms'] * 2
    assert twice['false_positive_percent'] == pytest.approx(once['false_positive_percent'])


# The variants of the chain.


def test_another_window_is_that_of_both_stages_and_nothing_else():
    config = ChainConfig(threshold=0.7)
    other = with_windows(config, 0.03)
    assert (other.envelope_window_s, other.decision_window_s) == (0.03, 0.03)
    assert with_windows(other, 0.04) == config


@pytest.mark.parametrize(
    ('passband_hz', 'stopbands_hz', 'kept'),
    [
        ((7.0, 50.0), ((0.5, 7.0), (50.0, 180.0)), ((0.5, 7.0),)),
        ((7.0, 50.0), ((45.0, 55.0), (60.0, 180.0)), ((45.0, 55.0),)),
        ((7.0, 0.0), ((0.5, 7.0), (45.0, 55.0)), ((0.5, 7.0), (45.0, 55.0))),
    ],
)
def test_another_band_goes_without_the_stop_bands_above_the_configured_one(
    passband_hz, stopbands_hz, kept
):
    config = ChainConfig(passband_hz=passband_hz, stopbands_hz=stopbands_hz, vote=2)
    other = with_band(config, (10.0, 150.0))
    assert (other.passband_hz, other.stopbands_hz, other.vote) == ((10.0, 150.0), kept, 2)
