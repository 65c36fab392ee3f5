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

"""The subcommand ``tune``."""

from pathlib import Path

import pytest

from benchmarks.__main__ import main
from benchmarks.measurement import Measurement
from benchmarks.tune import command


def test_parts_and_files_are_handed_on(monkeypatch):
    asked = {}

    def measured(quick, parts, recordings, config):
        asked.update(quick=quick, parts=parts, recordings=recordings, config=config)
        return {'wanted': {}}

    monkeypatch.setattr(command, 'measure_tuning', measured)
    words = ['--quick', '--part', 'read', '--part', 'real', '--recordings', 'a', '--config', 'b']
    measurement = command.run(command.options().parse_args(words))
    assert isinstance(measurement, Measurement)
    assert asked == {
        'quick': True, 'parts': ['read', 'real'], 'recordings': Path('a'), 'config': Path('b'),
    }  # fmt: skip


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (
            ['--part', 'nix'],
            "--part is 'nix', allowed: evaluate, read, jobs, search, report, families, sensor, "
            'onset, real',
        ),
        (['--part', 'real'], 'real recordings need --recordings and --config'),
        (['--recordings', 'a'], 'real recordings need --recordings and --config'),
    ],
)
def test_unknown_parts_and_real_without_recordings_are_refused(words, said, capsys):
    assert main(['tune', *words]) == 1
    assert capsys.readouterr().err == f'benchmarks: {said}\n'
