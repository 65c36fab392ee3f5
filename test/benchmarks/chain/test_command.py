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

"""The subcommand ``chain``."""

import json

from benchmarks.__main__ import main
from benchmarks.chain.cpp_chain import NUMBA_WITHOUT_AVX512
from benchmarks.chain.precision_table import chain_precision_table
from benchmarks.chain.speed_table import chain_speed_table


def test_the_command_prints_and_draws_the_precision_alone(
    chain_precision, monkeypatch, tmp_path, capsys
):
    monkeypatch.setattr(
        'benchmarks.chain.command.measure_chain_precision', lambda quick: chain_precision
    )
    picture = tmp_path / 'new' / 'picture.png'
    words = ['chain', '--quick', '--part', 'precision']
    assert main([*words, '--json', '--plot', str(picture)]) == 0
    parsed = json.loads(capsys.readouterr().out)
    assert set(parsed) == {'machine', 'quick', 'precision'}
    assert parsed['precision'] == json.loads(json.dumps(chain_precision))
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert main(words) == 0
    assert chain_precision_table(chain_precision) in capsys.readouterr().out


def test_a_picture_of_what_is_not_measured_is_an_error(capsys):
    assert main(['chain', '--part', 'speed', '--plot']) == 1
    error = capsys.readouterr().err
    assert error.startswith('benchmarks: --plot')
    assert error.count('\n') == 1


def test_without_avx512_the_speed_is_measured_by_a_process_that_has_none(
    chain_speed, monkeypatch, capsys
):
    asked = []

    def figures_of_process(module, words, timeout_s, environment):
        asked.append((module, words, environment))
        return json.loads(json.dumps(chain_speed))

    monkeypatch.setattr('benchmarks.chain.command.figures_of_process', figures_of_process)
    words = ['chain', '--quick', '--part', 'speed', '--without-avx512']
    assert main(words) == 0
    assert asked == [
        (
            'benchmarks.chain.speed',
            ['--quick'],
            {'NUMBA_CPU_FEATURES': NUMBA_WITHOUT_AVX512},
        )
    ]
    assert chain_speed_table(chain_speed) in capsys.readouterr().out
