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

"""What is searched: chains of both decisions."""

import dataclasses
from pathlib import Path

import numpy as np
import optuna
import pytest

from slip_detector.parameters.detector import ChainConfig
from slip_detector.tuning.measuring import contact_level_v, learn_floors, slip_steps_v
from slip_detector.tuning.space import SearchSpace, presets
from support.tuning_cases import CHAIN, EVIDENCE, track, track_with

XELA = ChainConfig.from_yaml(Path(__file__).resolve().parents[2] / 'config' / 'xela_uskin.yaml')


FLOORS = {'noise_floor': (0.01, 0.02, 0.03, 0.04), 'evidence_limit_db_s': 0.9}
GIVEN = dataclasses.replace(EVIDENCE, **FLOORS, threshold=0.4, mains_hz=50.0)


#: Its offset is below that with which a search begins.
LOW = dataclasses.replace(GIVEN, evidence_offset_db=1.0)


@pytest.mark.parametrize('chain', [CHAIN, XELA, ChainConfig(), GIVEN, LOW])
def test_the_given_chain_is_a_point_of_its_space(chain):
    space = SearchSpace(chain)
    assert space.chain(space.point(chain)) == chain
    assert space.starts()[0] == space.point(chain)
    assert set(space.distributions) == set(space.point(chain)) == set(space.starts()[1])
    assert space.distributions['mains_hz'].choices == (0.0, 50.0, 60.0)


@pytest.mark.parametrize('rate_hz', [30.0, 60.0, 380.0, 2000.0])
def test_every_point_of_the_space_is_a_chain(rate_hz):
    volts = np.random.default_rng(0).standard_normal((9000, 4)) * [0.01, 0.02, 0.03, 0.04]
    tracks = [track_with(volts, np.arange(9000) > 8500, rate_hz=rate_hz)]
    band = {'passband_hz': (rate_hz / 10, 0.0), 'stopbands_hz': ()}
    space = SearchSpace(ChainConfig(sample_rate_hz=rate_hz, channels=4, **band), tracks)
    study = optuna.create_study(sampler=optuna.samplers.RandomSampler(seed=0))
    for _ in range(25):
        point = study.ask(space.distributions).params
        if point['decision'] == 'evidence':
            # Filters with lower edges settle for longer than the noise that floors come from.
            point['passband_low_hz'] = max(point['passband_low_hz'], rate_hz / 20)
            point['passband_octaves'] = max(point['passband_octaves'], 1.0)
        chain = space.chain(point)
        assert (chain.exponent, chain.decision) == (point['exponent'], point['decision'])
        assert chain.threshold < chain.evidence_limit_db_s or chain.decision == 'mean'


def test_what_only_the_other_decision_has_is_no_distance():
    space = SearchSpace(CHAIN)
    point = space.point(CHAIN)
    assert space.distance(point, point) == 0.0
    assert space.distance({**point, 'common_mode': 'median'}, point) == 1.0
    assert space.distance({**point, 'evidence_offset_db': 9.0, 'impact': 'given'}, point) == 0.0
    assert space.distance({**point, 'decision_window_s': 0.05}, point) > 0.0
    other = {**point, 'decision': 'evidence'}
    assert space.distance({**other, 'decision_window_s': 0.05}, other) == 0.0
    assert space.distance({**other, 'evidence_offset_db': 9.0}, other) > 0.0


@pytest.mark.parametrize('which', ['learnt', 'followed'])
def test_floors_are_those_of_the_chain_s_own_band_on_what_is_tuned_on(which):
    tracks = [track(1)]
    space = SearchSpace(CHAIN, tracks)
    point = space.point(CHAIN) | {'decision': 'evidence', 'floors': which, 'passband_low_hz': 70.0}
    chain, scaled = space.chain(point), space.chain({**point, 'floor_scale': 2.0})
    assert chain.noise_floor == learn_floors(chain, tracks)
    assert chain.noise_floor_learnt == (which == 'learnt')
    ratios = np.array(scaled.noise_floor) / chain.noise_floor
    np.testing.assert_allclose(ratios, 2.0**CHAIN.exponent, rtol=2e-3)


def test_an_impact_is_a_step_beside_those_of_the_slips():
    tracks = [track(1), track(2, 'taps')]
    space = SearchSpace(CHAIN, tracks)
    point = space.point(CHAIN) | {'decision': 'evidence', 'impact': 'learnt', 'impact_s': 0.01}
    for channels, scale in ((1, 1.5), (2, 1.5), (4, 0.75)):
        found = space.chain(point | {'impact_channels': channels, 'impact_scale': scale})
        assert (found.impact_channels, found.impact_rows) == (channels, 4)
        step_v = slip_steps_v(found, tracks, found.impact_rows)[channels - 1]
        few = 1.0 + 2 / len(tracks[0].slips)
        assert found.impact_v == pytest.approx(scale * few * step_v, rel=1e-3)
    assert space.chain(point | {'impact': 'none'}).impact_v == 0.0


def test_a_search_begins_at_each_preset_with_the_floors_of_its_own_sensor():
    tracks = [track(1)]
    space = SearchSpace(CHAIN, tracks)
    for preset in presets():
        assert space.point(preset) in space.starts()
        chain = space.chain(space.point(preset))
        assert (chain.decision, chain.groups) == (preset.decision, CHAIN.groups)
        if preset.decision == 'evidence':
            assert chain.noise_floor == learn_floors(chain, tracks)
            assert chain.noise_floor_range_db == preset.noise_floor_range_db


def test_what_no_recording_shows_is_not_searched_and_stays_as_given():
    given = dataclasses.replace(GIVEN, impact_v=1.0, impact_s=0.02, contact_level_v=0.3)
    space = SearchSpace(given, [track(1), track(2, 'rest')])
    names = {'impact_s', 'contact', 'activity', 'common_rank'}
    assert not names & {*space.distributions, *(k for s in space.stages() for c in s for k in c)}
    assert space.chain(space.starts()[0]) == given


TRACKS = [track(1), track(2, 'press', noise_v=1.0), track(3, 'idle', noise_v=0.005)]


def test_contact_is_learnt_and_activity_searched_in_the_low_band_of_the_chain():
    space = SearchSpace(GIVEN, TRACKS)
    point = space.point(GIVEN) | {'contact': 'learnt', 'contact_channels': 2}
    found = space.chain({**point, 'activity': 'searched', 'activity_range_db': 12.0})
    assert found.contact_level_v == contact_level_v(found, TRACKS) > 0.0
    assert (found.contact_channels, found.activity_range_db) == (2, 12.0)
    assert found.activity_cap_db == 8.7
    # A band below that of the chain: evidence of what is learnt differs from none.
    low = space.chain({**point, 'activity': 'searched', 'passband_low_hz': 10.0})
    assert low.activity_band_hz == (4.0, 10.0)
    # From there a search goes on with what was learnt.
    again = SearchSpace(found, TRACKS)
    assert again.chain(again.point(found)) == found


def test_each_stage_is_tried_off_and_on_and_all_together_in_each_band_that_was_measured():
    tracks = [track(1, slip_hz=60.0), *TRACKS[1:]]
    space = SearchSpace(GIVEN, tracks)
    given, (bands, *stages) = space.point(GIVEN), space.stages()
    assert all(30.0 < change['passband_low_hz'] < 60.0 for change in bands)
    together = {'contact': 'learnt', 'activity': 'searched', 'impact': 'learnt', 'common_rank': 1}
    assert any(together.items() <= change.items() for change in bands)
    assert {(change['floors'], change['noise_floor_rate_db_s']) for change in stages[0]} == {
        ('learnt', 0.43), ('followed', 0.43), ('followed', 1.0), ('followed', 3.0)
    }  # fmt: skip
    onoff = {'impact': 'learnt', 'contact': 'learnt', 'activity': 'searched', 'mains_hz': 50.0}
    for name, value in onoff.items():
        (stage,) = [one for one in stages if name in one[0]]
        assert {change[name] for change in stage} >= {value, 0.0 if name == 'mains_hz' else 'none'}
    for change in [*bands, *(change for stage in stages for change in stage)]:
        assert space.chain({**given, **change, 'decision': 'evidence'}).decision == 'evidence'
