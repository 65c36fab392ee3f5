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

"""The way of a newcomer, on short recordings."""

import subprocess

from benchmarks.tune import new_sensor
from slip_detector.commands.tune import main


def test_three_commands_make_a_configuration_of_recordings(monkeypatch):
    """They run in this process here, which saves their starts."""
    ran = []

    def in_this_process(command, cwd, **_):
        monkeypatch.chdir(cwd)
        ran.append(command[3:])
        return subprocess.CompletedProcess(command, main(command[3:]), '', '')

    monkeypatch.setattr(new_sensor.subprocess, 'run', in_this_process)
    monkeypatch.setattr(new_sensor, 'JOBS', 1)
    figures = new_sensor.measure_new_sensor(2, range(1), rest_s=15.0, knocks_s=9.0)
    assert [('--quiet' in words, '--taps' in words) for words in ran] == [
        (True, False), (False, True), (False, False),
    ]  # fmt: skip
    assert figures['recording_s'] > 3 * 9.0 + 24.0
    times_s = [figures[f'{name}_s'] for name in ('quiet', 'taps', 'search')]
    assert figures['total_s'] == sum(times_s)
    assert figures['taps_told']
    assert figures['given']['slips'] == figures['tuned']['slips'] == 9
