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

"""The paper's protocol: its trials, figures, variants of the chain, claims, table and pictures."""

import json
import re

import pytest

from benchmarks.__main__ import main
from benchmarks.measurement import verdicts
from benchmarks.paper import command
from benchmarks.paper.command import TRIALS, as_table
from benchmarks.paper.protocol import (
    SCENES,
    WANTED,
    claims,
    run_protocol,
    simulate_trials,
    with_band,
)
from slip_detector.parameters.detector import ChainConfig
from slip_detector.parameters.yaml_files import read_yaml
from slip_detector.scenes import find_scene


def test_the_plates_differ_only_in_their_spatial_period():
    descriptions = {plate: read_yaml(find_scene(scene)) for plate, scene in SCENES.items()}
    for plate, description in descriptions.items():
        assert description['texture'].pop('spatial_period_m') == pytest.approx(int(plate) * 1e-6)
    assert descriptions['440'] == descriptions['400'] == descriptions['480']


def test_a_high_pass_keeps_all_stop_bands_and_a_band_pass_those_below_its_upper_edge():
    stopbands_hz = ((45.0, 55.0), (60.0, 180.0))
    for high_hz, kept in ((50.0, stopbands_hz[:1]), (0.0, stopbands_hz)):
        config = ChainConfig(passband_hz=(7.0, high_hz), stopbands_hz=stopbands_hz, vote=2)
        other = with_band(config, (10.0, 150.0))
        assert (other.passband_hz, other.stopbands_hz, other.vote) == ((10.0, 150.0), kept, 2)


def test_the_papers_results_are_reproduced_and_a_claim_without_figures_is_undefined():
    plates = {plate: simulate_trials(scene, range(TRIALS)) for plate, scene in SCENES.items()}
    result = run_protocol(plates, ChainConfig())
    assert (result['all']['detected'], result['all']['trials']) == (30, 30)
    wanted = verdicts(WANTED, result)
    assert [entry['met'] for entry in wanted.values()] == [True] * 10
    assert wanted['claims.mean_delay_ms_440']['bound'] == '31.00 to 52.56'
    result['plates']['440']['mean_delay_ms'] = None
    undefined = {name for name, figure in claims(result).items() if figure is None}
    assert {'mean_delay_ms_440', 'least_rise_ms', 'bands_10-100_least_shortening_ms'} <= undefined


def test_one_run_gives_all_that_is_documented_a_table_and_pictures(capsys, tmp_path):
    words = ['--json', '--quick', '--seed', '7', '--plot', str(tmp_path)]
    assert main(['paper', *words]) == 0
    result = json.loads(capsys.readouterr().out)
    documented = [*result, *result['plates']['440']]
    undocumented = {'machine', 'quick', 'wanted'}
    assert all(f'``{key}``' in command.__doc__ for key in documented if key not in undocumented)
    assert (result['trials']['seeds'], result['all']['trials']) == ([7, 8], 6)
    assert re.search(r'mean, paper +36\.02 ', as_table(result))
    names = [f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)]
    assert sorted(path.name for path in tmp_path.iterdir()) == names
