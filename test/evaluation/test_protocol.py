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

"""The paper's protocol: the variants of the chain, and what is claimed of their figures."""

import pytest

from slip_detector.evaluation import protocol
from slip_detector.evaluation.protocol import WANTED, claims, evaluate_protocol
from slip_detector.evaluation.protocol_trials import (
    PAPER_DELAY_MS,
    SCENES,
    evaluate_plates,
    simulate_trials,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.protocol_table import MEANINGS


def test_each_variant_has_the_figures_of_the_same_trials_through_its_chain():
    plates = {plate: simulate_trials(scene, [0]) for plate, scene in SCENES.items()}
    config = ChainConfig()
    result = evaluate_protocol(plates, config)
    assert list(result['windows']) == ['20', '30', '40']
    assert list(result['bands']) == ['10-100', '10-150']
    # The paper's own windows are the default.
    assert result['windows']['40'] == {key: result[key] for key in ('plates', 'all')}
    short = ChainConfig(envelope_window_s=0.02, decision_window_s=0.02)
    wide = ChainConfig(passband_hz=(10.0, 150.0), stopbands_hz=((0.5, 7.0),))
    assert result['windows']['20'] == evaluate_plates(plates, short)
    assert result['bands']['10-150'] == evaluate_plates(plates, wide)
    assert result['all']['trials'] == 3


def part(delays_ms, false_percent, success_percent=100.0):
    """Make figures of three plates by their means, and of all by their false positives."""
    return {
        'plates': {
            plate: {'mean_delay_ms': delay, 'false_positive_percent': percent}
            for plate, delay, percent in zip(SCENES, delays_ms, (0.5, 1.5, 1.0), strict=True)
        },
        'all': {'success_percent': success_percent, 'false_positive_percent': false_percent},
    }


def hand_made(**changes):
    result = {
        **part([36.0, 42.0, 49.0], 1.0, success_percent=90.0),
        'windows': {
            '20': part([1.0, 1.0, 1.0], 3.0),
            '30': part([1.0, 1.0, 1.0], 1.5),
            '40': part([1.0, 1.0, 1.0], 1.0),
        },
        'bands': {
            '10-100': part([30.0, 40.0, 40.0], 1.0),
            '10-150': part([29.0, 43.0, 39.0], 1.0),
        },
    }
    return {**result, **changes}


def test_the_claims_by_hand():
    assert claims(hand_made()) == pytest.approx(
        {
            'detected_percent': 90.0,
            'mean_delay_ms.400': 36.0,
            'mean_delay_ms.440': 42.0,
            'mean_delay_ms.480': 49.0,
            'least_rise_ms': 6.0,
            'worst_false_positive_percent': 1.5,
            'windows.20.false_positive_percent_more': 2.0,
            'windows.30.false_positive_percent_more': 0.5,
            'windows.40.false_positive_percent_more': 0.0,
            'bands.10-100.least_shortening_ms': 2.0,
            'bands.10-150.least_shortening_ms': -1.0,
        }
    )
    undefined = claims(hand_made(plates=part([36.0, None, 49.0], 1.0)['plates']))
    assert undefined['least_rise_ms'] is None
    assert undefined['mean_delay_ms.440'] is None
    assert undefined['bands.10-100.least_shortening_ms'] is None


def test_what_is_wanted_is_what_the_paper_reports():
    assert set(WANTED) == set(MEANINGS) <= set(claims(hand_made()))
    assert PAPER_DELAY_MS == {'400': (36.02, 3.91), '440': (41.78, 10.78), '480': (48.90, 9.91)}
    for plate, (mean, sd) in PAPER_DELAY_MS.items():
        assert WANTED[f'mean_delay_ms.{plate}'] == (mean - sd, mean + sd, False)
    assert WANTED['worst_false_positive_percent'].high == 1.01
    assert WANTED['detected_percent'].low == 100.0


def test_the_papers_results_are_reproduced():
    trials = {
        plate: simulate_trials(scene, range(protocol.TRIALS)) for plate, scene in SCENES.items()
    }
    result = evaluate_protocol(trials, ChainConfig())
    assert (result['all']['detected'], result['all']['trials']) == (30, 30)
    missed = {name: entry for name, entry in result['wanted'].items() if not entry['met']}
    assert not missed
