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

"""What ``slip_tune`` refuses, in one line."""

from pathlib import Path

import pytest

from slip_detector.commands.tune import main
from support.tuning_cases import PARAMETERS, run, write

ERRORS = {
    'no recording': (['--out', 'o.yaml'], 'are required: RECORDING', 2),
    'no such recording': (['nix.npz', '--out', 'o.yaml'], 'nix.npz: ', 1),
    'no label': (['bare.npz', '--out', 'o.yaml'], 'bare.npz: has no label', 1),
    'no slip': (['still.npz', '--out', 'o.yaml'], 'still.npz: has no slip', 1),
    'no slip held out': (
        ['a.npz', '--held-out', 'still.npz', '--out', 'o.yaml'],
        'still.npz: has no slip, allowed: some with slips held out', 1,
    ),
    'all held out by name': (
        ['a.npz', '--held-out', 'a.npz', '--out', 'o.yaml'],
        'no recording is left, allowed: some with slips to tune on', 1,
    ),
    'a device': (['a.npz', '--out', '/dev/null'], '/dev/null: cannot be written (is no file)', 1),
    'one slip': (['short.npz', '--out', 'o.yaml'], 'short.npz: has one slip', 1),
    'no folder': (['a.npz', '--out', 'nix/o.yaml'], 'nix/o.yaml: cannot be written', 1),
    'no folder of the report': (
        ['a.npz', '--out', 'o.yaml', '--report', 'nix/r.html'],
        'nix/r.html: cannot be written', 1,
    ),
    'unknown storage': (
        ['a.npz', '--out', 'o.yaml', '--storage', 'study.txt'],
        'storage study.txt: is not known', 1,
    ),
    'nothing to learn': (
        ['--quiet', 'still.npz', '--out', 'o.yaml'],
        'parameter decision is mean, allowed: evidence, whose noise floors --quiet learns, or '
        '--false-alarms-per-hour, which sets the threshold', 1,
    ),
    'a rate of nothing': (
        ['a.npz', '--false-alarms-per-hour', '1', '--out', 'o.yaml'], 'goes with --quiet', 2,
    ),
    'quiet and taps': (
        ['--quiet', 'still.npz', '--taps', 'still.npz', '--out', 'o.yaml'],
        '--quiet searches nothing, allowed: no --taps with it', 2,
    ),
    'taps without slips': (['--taps', 'still.npz', '--out', 'o.yaml'], 'are required', 2),
    'taps and more': (
        ['a.npz', '--taps', 'still.npz', '--report', 'r.html', '--out', 'o.yaml'],
        '--taps searches nothing, allowed: no --report with it', 2,
    ),
    'taps for a mean': (
        ['a.npz', '--taps', 'still.npz', '--out', 'o.yaml'],
        'parameter decision is mean, allowed: evidence, which impact_v is for', 1,
    ),
    'quiet and more': (
        ['a.npz', '--quiet', 'still.npz', '--false-alarms-per-hour', '1', '--out', 'o.yaml'],
        'allowed: no RECORDING with it', 2,
    ),
    'no rate': (
        ['--quiet', 'still.npz', '--false-alarms-per-hour', '0', '--out', 'o.yaml'],
        'allowed: a number above 0', 2,
    ),
    'all held out': (['a.npz', '--hold-out', '1', '--out', 'o.yaml'], 'between 0 and 1', 2),
    'no trials': (['a.npz', '--trials', '0', '--out', 'o.yaml'], 'whole number from 1', 2),
}  # fmt: skip


@pytest.mark.parametrize('what', ERRORS)
def test_what_is_wrong_is_said_in_one_line(what, tmp_path, monkeypatch, capsys):
    words, line, code = ERRORS[what]
    monkeypatch.chdir(tmp_path)
    Path('given.yaml').write_text(PARAMETERS)
    write('a.npz', 1)
    write('bare.npz', 1, label=False)
    write('still.npz', 1, slips=False)
    write('short.npz', 1, duration_s=3.0)
    if code == 2:
        with pytest.raises(SystemExit) as left:
            main([*words, '--config', 'given.yaml'])
        assert left.value.code == code
    else:
        run(*words, '--config', 'given.yaml', code=code)
    error = capsys.readouterr().err
    assert error.startswith('slip_tune: ')
    assert line in error
    assert error.count('\n') == 1
    assert not Path('o.yaml').exists()
