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

"""``slip_evaluate --protocol paper``: its options, figures, table and pictures."""

import functools
import json

import numpy as np
import pytest
from matplotlib import image

from slip_detector.commands.evaluate import main
from slip_detector.evaluation import protocol
from slip_detector.evaluation.protocol import SCENES, evaluate_plates, simulate_trials
from slip_detector.parameters.detector import ChainConfig
from support.evaluation_cases import complaint

KEYS = {
    'mean_delay_ms', 'sd_delay_ms', 'success_percent', 'trial_delays_ms', 'detected', 'trials',
    'false_positive_percent', 'channels_without_on',
}  # fmt: skip


@pytest.fixture(autouse=True)
def _simulated_once(monkeypatch):
    """Simulate the trials of a plate and of seeds once for all tests."""
    monkeypatch.setattr(
        protocol, 'simulate_trials', lambda scene, seeds: simulated(scene, tuple(seeds))
    )


@functools.cache
def simulated(scene, seeds):
    return simulate_trials(scene, seeds)


def run(capsys, *arguments):
    assert main(['--protocol', 'paper', *map(str, arguments)]) == 0
    captured = capsys.readouterr()
    assert captured.err == ''
    return captured.out


def test_json_has_the_documented_figures(capsys):
    result = json.loads(run(capsys, '--json', '--trials', 2, '--seed', 7))
    assert list(result) == [
        'seeds', 'scenes', 'paper', 'plates', 'all', 'windows', 'bands', 'wanted', 'plots',
    ]  # fmt: skip
    assert all(f'``{key}``' in protocol.__doc__ for key in [*result, *KEYS])
    assert (result['seeds'], result['plots']) == ([7, 8], [])
    assert list(result['plates']) == ['400', '440', '480']
    for figures_ in [*result['plates'].values(), result['all']]:
        assert set(figures_) == KEYS
    assert [len(part['trial_delays_ms']) for part in result['plates'].values()] == [2, 2, 2]
    for variants in (result['windows'], result['bands']):
        assert all(list(part) == ['plates', 'all'] for part in variants.values())
    assert all(set(entry) == {'value', 'bound', 'met'} for entry in result['wanted'].values())
    assert result['paper']['plates']['480'] == {'mean_delay_ms': 48.9, 'sd_delay_ms': 9.91}
    assert result['paper']['false_positive_percent'] == 1.01
    # The same as from Python.
    trials = {'440': simulate_trials(SCENES['440'], [7, 8])}
    assert result['plates']['440'] == evaluate_plates(trials, ChainConfig())['plates']['440']


def test_the_pictures_are_written_and_show_something(capsys, tmp_path):
    folder = tmp_path / 'new' / 'out'
    result = json.loads(run(capsys, '--json', '--trials', 2, '--plot', folder))
    names = [f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)]
    assert result['plots'] == [str(folder / name) for name in names]
    assert sorted(path.name for path in folder.iterdir()) == names
    for name in names:
        picture = image.imread(folder / name)[..., :3]
        assert min(picture.shape[:2]) > 300
        # Something in the outermost tenths, too: labels and axes are not cut away.
        assert all((part < 0.5).any() for part in np.array_split(picture, 10, axis=0)[::9])


@pytest.mark.parametrize(
    ('words', 'code', 'said'),
    [
        ('--protocol paper a.npz', 2, 'required: either RECORDINGs or --protocol'),
        ('--trials 3 a.npz', 2, '--trials is for simulated trials, allowed: with --protocol'),
        ('--plot out a.npz', 2, '--plot is for simulated trials, allowed: with --protocol'),
        ('--protocol paper --jobs 2', 2, '--jobs is for recordings, allowed: without --protocol'),
        ('--protocol mine', 2, "argument --protocol: invalid choice: 'mine' (choose from "),
        ('--protocol paper --seed -1', 2, "argument --seed: is '-1', allowed: a whole number, 0"),
        ('--protocol paper --config no.yaml', 1, "config is 'no.yaml', allowed: the path of"),
    ],
)
def test_wrong_arguments_are_refused_in_one_line(capsys, words, code, said):
    assert complaint(capsys, *words.split(), code=code).startswith(said)
