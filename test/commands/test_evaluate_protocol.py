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
from slip_detector.evaluation.protocol import SCENES, WANTED, evaluate_plates, simulate_trials
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.protocol import MEANINGS

KEYS = {
    'mean_delay_ms',
    'sd_delay_ms',
    'success_percent',
    'trial_delays_ms',
    'detected',
    'trials',
    'false_positive_percent',
    'channels_without_on',
}


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


def complaint(capsys, *arguments, code):
    """Run what must fail; returns the one line that it says."""
    try:
        status = main([*map(str, arguments)])
    except SystemExit as leave:
        status = leave.code
    captured = capsys.readouterr()
    assert (status, captured.out, captured.err.count('\n')) == (code, '', 1)
    return captured.err.removeprefix('slip_evaluate: ').rstrip('\n')


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
    assert set(result['wanted']) == set(WANTED)
    assert all(set(entry) == {'value', 'bound', 'met'} for entry in result['wanted'].values())
    assert result['paper']['plates']['480'] == {'mean_delay_ms': 48.9, 'sd_delay_ms': 9.91}
    assert result['paper']['false_positive_percent'] == 1.01
    # The same as from Python.
    trials = {'440': simulate_trials(SCENES['440'], [7, 8])}
    assert result['plates']['440'] == evaluate_plates(trials, ChainConfig())['plates']['440']


def test_the_table_has_the_paper_beside_ours_and_what_is_wanted(capsys):
    lines = run(capsys, '--trials', 1).splitlines()

    def words(head):
        (line,) = [line for line in lines if line.strip().startswith(head)]
        return line.strip().removeprefix(head).split()

    assert words('mean, paper') == ['36.02', '41.78', '48.90']
    assert words('sd, paper') == ['3.91', '10.78', '9.91']
    assert words('false positives, paper [%]') == ['1.01']
    assert len(words('seed 0')) == 3
    assert words('sd  ')[:3] == ['-', '-', '-']  # of one trial
    for meaning in MEANINGS.values():
        assert words(meaning)[-1] == 'met'
    assert max(map(len, lines)) < 130


def test_the_configuration_is_that_of_the_file(capsys, tmp_path):
    path = tmp_path / 'deaf.yaml'
    path.write_text('/**/slip_detector: {ros__parameters: {threshold: 1.0e+30}}')
    result = json.loads(run(capsys, '--json', '--trials', 1, '--config', path))
    assert result['plates']['400']['trial_delays_ms'] == [None]
    assert result['plates']['400']['mean_delay_ms'] is None
    assert result['plates']['400']['channels_without_on'] == 16
    assert result['all']['detected'] == 0
    assert result['wanted']['mean_delay_ms.400'] == {
        'value': None, 'bound': '32.11 to 39.93', 'met': False,
    }  # fmt: skip
    text = run(capsys, '--trials', 1, '--config', path, '--plot', tmp_path / 'deaf')
    assert 'nan' not in text.lower()


def test_the_pictures_are_written_and_show_something(capsys, tmp_path):
    folder = tmp_path / 'new' / 'out'
    result = json.loads(run(capsys, '--json', '--trials', 2, '--plot', folder))
    names = [f'paper_fig{number}.png' for number in (2, 4, 5, 6, 7)]
    assert result['plots'] == [str(folder / name) for name in names]
    assert sorted(path.name for path in folder.iterdir()) == names
    for name in names:
        picture = image.imread(folder / name)[..., :3]
        assert min(picture.shape[:2]) > 300
        # A number a colour, as rows take seconds to sort.
        colours = np.unique((picture * 255).astype(int) @ [1 << 16, 1 << 8, 1])
        assert len(colours) > 20
        # Something in the outermost tenths, too: labels and axes are not cut away.
        assert all((part < 0.5).any() for part in np.array_split(picture, 10, axis=0)[::9])


@pytest.mark.parametrize(
    ('arguments', 'code', 'said'),
    [
        (['--protocol', 'paper', 'a.npz'], 2, '--protocol simulates its trials, allowed: no REC'),
        (['--trials', '3', 'a.npz'], 2, '--trials is for simulated trials, allowed: with --prot'),
        (['--seed', '3', 'a.npz'], 2, '--seed is for simulated trials, allowed: with --protocol'),
        (
            ['--protocol', 'paper', '--report', 'a.html'],
            2,
            '--report is for recordings, allowed: without --protocol',
        ),
        (
            ['--protocol', 'paper', '--topic', 'a'],
            2,
            '--topic is for recordings, allowed: without --protocol',
        ),
        (['--protocol', 'mine'], 2, "argument --protocol: invalid choice: 'mine' (choose from "),
        (
            ['--protocol', 'paper', '--trials', '0'],
            2,
            "argument --trials: is '0', allowed: a whole number, 1 to 1000",
        ),
        (
            ['--protocol', 'paper', '--seed', '-1'],
            2,
            "argument --seed: is '-1', allowed: a whole number, 0 to 2147483647",
        ),
        (['--protocol', 'paper', '--config', 'no.yaml'], 1, 'no.yaml: cannot be read (No such fi'),
    ],
)
def test_wrong_arguments_are_said_in_one_line(capsys, arguments, code, said):
    assert complaint(capsys, *arguments, code=code).startswith(said)


def test_a_folder_that_cannot_be_made_or_written_to_is_named(capsys, tmp_path):
    (tmp_path / 'file').touch()
    arguments = ['--protocol', 'paper', '--trials', '1', '--plot']
    line = complaint(capsys, *arguments, tmp_path / 'file', code=1)
    assert line == f'{tmp_path / "file"}: cannot be made (File exists)'
    (tmp_path / 'full' / 'paper_fig4.png').mkdir(parents=True)
    line = complaint(capsys, *arguments, tmp_path / 'full', code=1)
    picture = tmp_path / 'full' / 'paper_fig4.png'
    assert line == f'{picture}: cannot be written (Is a directory)'
