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

"""Settings chosen on all recordings but the one that is scored."""

import dataclasses

import numpy as np
import pytest

from benchmarks.tune import left_out_choice
from benchmarks.tune.left_out_choice import measure_left_out_choice, settings_beside
from slip_detector.commands.tune import TuningParameters, tuning_parameters_of
from slip_detector.tuning.tracks import Track
from support.tuning_cases import CHAIN, RATE_HZ, track

EVIDENCE = dataclasses.replace(
    CHAIN, decision='evidence', exponent=1, noise_floor=(0.12,), noise_floor_learnt=True, vote=1,
    threshold=0.3,
)  # fmt: skip


def moved(seed: int) -> Track:
    """Return a track with motion a second after each slip, which is a weaker tone."""
    one = track(seed, duration_s=9.0)
    moving = np.roll(one.kinds == 2, round(RATE_HZ))
    tone = np.sin(2 * np.pi * 18.0 * np.arange(len(one.volts)) / RATE_HZ)
    kinds = np.where(moving, 1, one.kinds).astype(np.int8)
    return one._replace(
        volts=one.volts + 0.2 * (moving * tone)[:, None], kinds=kinds, moving=kinds > 0
    )


@pytest.fixture(scope='module')
def tracks():
    return [moved(seed) for seed in range(4)]


@pytest.fixture
def parameters(tmp_path) -> TuningParameters:
    config = tmp_path / 'config.yaml'
    config.write_text('/**/slip_evaluate:\n  ros__parameters: {tail_s: 0.15}\n')
    return tuning_parameters_of(str(config))._replace(chain=EVIDENCE)


def test_settings_surround_the_given_ones():
    of_sixteen = dataclasses.replace(
        EVIDENCE, channels=16, groups={'tip': tuple(range(1, 17))}, vote=4
    )
    settings = settings_beside(of_sixteen)
    assert len(settings) == 180
    assert of_sixteen in settings
    assert {chain.vote for chain in settings} == {3, 4, 5}
    assert {chain.noise_floor[0] / 0.12 for chain in settings} == {5 / 6, 1.0, 7 / 6, 4 / 3, 5 / 3}
    assert all(chain.passband_hz == EVIDENCE.passband_hz for chain in settings)


def test_the_setting_that_is_better_on_the_others_is_taken(tracks, parameters, monkeypatch):
    deaf = dataclasses.replace(EVIDENCE, noise_floor=(1e3,))
    monkeypatch.setattr(left_out_choice, 'settings_beside', lambda given: [given, EVIDENCE])
    figures = measure_left_out_choice(tracks, parameters._replace(chain=deaf))
    assert figures['settings'] == 2
    assert figures['given']['auc_moving'] == 0.5
    assert figures['given']['matched'] == 0
    assert figures['auc_moving'] > 0.8
    assert figures['median_auc_moving'] == (0.5 + figures['auc_moving']) / 2
    assert figures['matched'] > figures['slips'] / 2


def test_the_recording_itself_has_no_say(tracks, parameters, monkeypatch):
    # The floors are such that the last recording alone is heard with the second setting only.
    loud = EVIDENCE
    quiet = dataclasses.replace(EVIDENCE, noise_floor=(1.2e-5,), valid_range_v=(-1e-2, 1e-2))
    weak = tracks[3]._replace(volts=(tracks[3].volts - 4.3) * 1e-4)
    monkeypatch.setattr(left_out_choice, 'settings_beside', lambda given: [loud, quiet])
    chosen = measure_left_out_choice([*tracks[:3], weak], parameters)
    own = measure_left_out_choice([weak, weak], parameters._replace(chain=quiet))
    assert own['auc_moving'] > 0.8
    assert chosen['auc_moving'] == chosen['given']['auc_moving']
