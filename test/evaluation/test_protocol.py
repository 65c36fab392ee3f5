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

"""The paper's protocol: its trials, their figures, the variants of the chain and the claims."""

import dataclasses

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.evaluation import protocol
from slip_detector.evaluation.protocol import (
    SCENES,
    claims,
    evaluate_plates,
    run_protocol,
    simulate_trials,
    with_band,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.files import read_yaml
from slip_detector.scenes import find_scene

RATE_HZ = 100.0
CHAIN = ChainConfig(sample_rate_hz=RATE_HZ, channels=2, passband_hz=(7.0, 40.0), stopbands_hz=())


def test_the_plates_differ_only_in_their_spatial_period():
    descriptions = {plate: read_yaml(find_scene(scene)) for plate, scene in SCENES.items()}
    for plate, description in descriptions.items():
        assert description['texture'].pop('spatial_period_m') == pytest.approx(int(plate) * 1e-6)
    assert descriptions['440'] == descriptions['400'] == descriptions['480']


def test_a_trial_that_does_not_suit_the_chain_is_refused_with_its_plate():
    trial = Samples.evenly(np.zeros((3, 2)), RATE_HZ, [False, True, True])
    for changes in ({'channels': 1, 'groups': {'a': (1,)}}, {'sample_rate_hz': 200.0}):
        with pytest.raises(ValueError, match=r'^plate 400 has 2 channels at 100 Hz, '):
            evaluate_plates({'400': [trial]}, dataclasses.replace(CHAIN, **changes))


def test_a_high_pass_keeps_all_stop_bands_and_a_band_pass_those_below_its_upper_edge():
    stopbands_hz = ((45.0, 55.0), (60.0, 180.0))
    for high_hz, kept in ((50.0, stopbands_hz[:1]), (0.0, stopbands_hz)):
        config = ChainConfig(passband_hz=(7.0, high_hz), stopbands_hz=stopbands_hz, vote=2)
        other = with_band(config, (10.0, 150.0))
        assert (other.passband_hz, other.stopbands_hz, other.vote) == ((10.0, 150.0), kept, 2)


def test_the_papers_results_are_reproduced_and_each_variant_has_the_figures_of_its_chain():
    result = run_protocol(ChainConfig())
    assert (result['all']['detected'], result['all']['trials']) == (30, 30)
    assert len(result['wanted']) == 10
    assert not [name for name, entry in result['wanted'].items() if not entry['met']]
    assert result['wanted']['mean_delay_ms.440']['bound'] == '31.00 to 52.56'
    # The paper's own windows are the default.
    assert result['windows']['40'] == {key: result[key] for key in ('plates', 'all')}
    seeds = range(protocol.TRIALS)
    plates = {plate: simulate_trials(scene, seeds) for plate, scene in SCENES.items()}
    short = ChainConfig(envelope_window_s=0.02, decision_window_s=0.02)
    wide = ChainConfig(passband_hz=(10.0, 150.0), stopbands_hz=((0.5, 7.0),))
    assert result['windows']['20'] == evaluate_plates(plates, short)
    assert result['bands']['10-150'] == evaluate_plates(plates, wide)
    result['plates']['440']['mean_delay_ms'] = None
    undefined = {name for name, one in claims(result).items() if one['value'] is None}
    assert {'mean_delay_ms.440', 'least_rise_ms', 'bands.10-100.least_shortening_ms'} <= undefined


def test_where_nothing_moves_delays_are_undefined_and_the_rest_is_told():
    config, times_s = ChainConfig(), np.arange(3.0)
    topics = ['slip', *(f'slip/group/{name}' for name in config.groups)]
    topics += [f'slip/channel/{name}' for name in config.names]
    changes = dict.fromkeys(topics, (np.array([0.0, 1.0, 2.0]), np.array([False, True, False])))
    figures = protocol.demo_figures(
        protocol.Heard(
            times_s, np.zeros((3, 16)), times_s, np.zeros(3), np.full(3, 2e-3), changes
        ),
        config,
    )
    assert figures['motion'] is figures['mean_delay_ms'] is figures['global_delay_ms'] is None
    assert {*figures['channel_delay_ms'].values(), *figures['group_delay_ms'].values()} == {None}
    assert figures['false_positive_percent'] == pytest.approx(100 / 3)
    assert figures['latency_ms'] == {'median': 2.0, 'p99': 2.0}
