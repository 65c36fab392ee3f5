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

"""Small labelled recordings, and ``slip_evaluate`` run on them."""

import json

import numpy as np

from slip_detector.commands.evaluate import main

RATE_HZ = 380.0

HALF_OF_IT = np.arange(600) >= 450


def write(path, seed=0, channels=16, rate_hz=RATE_HZ, slip=HALF_OF_IT, **more):
    """Write a recording: noise, and in its second half ridges of which half is called slip."""
    rng = np.random.default_rng(seed)
    t = np.arange(600) / rate_hz
    volts = 4.3 + 0.01 * rng.normal(size=(600, channels))
    volts += 0.02 * (np.sin(2 * np.pi * 25.0 * t) * (t > t[300]))[:, np.newaxis]
    arrays = {'volts': volts, 'sample_rate_hz': rate_hz, **more}
    if slip is not None:
        arrays['slip'] = slip
    path.parent.mkdir(exist_ok=True)
    np.savez(path, **arrays)
    return path


def report_of(capsys, *arguments):
    assert main([*map(str, arguments), '--json']) == 0
    captured = capsys.readouterr()
    assert captured.err == ''
    return json.loads(captured.out)['sets']


def complaint(capsys, *arguments, code=1, command=main):
    """Run a command that must fail; return its one-line message."""
    try:
        status = command([*map(str, arguments)])
    except SystemExit as leave:
        status = leave.code
    captured = capsys.readouterr()
    assert status == code
    assert captured.out == ''
    assert captured.err.count('\n') == 1
    assert captured.err.endswith('\n')
    name, _, line = captured.err.rstrip('\n').partition(': ')
    assert name == f'slip_{command.__module__.rpartition(".")[2]}'
    return line
