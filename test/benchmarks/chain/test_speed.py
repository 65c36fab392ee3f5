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

"""The speed of the chain against its rivals: what is measured and what is judged."""

import json

import pytest

from benchmarks import __main__ as command_line
from benchmarks.chain import speed
from benchmarks.chain.speed import WANTED
from benchmarks.measurement import machine
from slip_detector.chain.compiled import COMPILED

COUNTS = ['16', '64', '1024', '10000']


def test_every_section_has_its_figures(chain_speed):
    assert set(chain_speed) == {
        'machine', 'quick', 'blocks', 'one_row', 'channels', 'wanted',
    }  # fmt: skip
    assert set(chain_speed['machine']) == {
        'cores', 'system', 'processor', 'python', 'numpy', 'scipy', 'numba', 'compiled',
    }  # fmt: skip
    assert set(chain_speed['blocks']) == {
        'rows', 'rows_per_call', 'channels', 'rounds', 'agreement', 'slip_share', 'ns_per_row',
        'speedup', 'in_place_speedup', 'cpp_ratio', 'cpp_left_out', 'cpp_command', 'kept_ratio',
        'whole_kept_ratio', 'median_ratio', 'evidence_ratio',
    }  # fmt: skip
    assert set(chain_speed['one_row']) == {
        'channels', 'calls', 'rounds', 'chain_us_per_call', 'sosfilt_us_per_call', 'speedup',
        'kept_bytes_per_call', 'peak_bytes_per_call', 'temporary_bytes_per_channel',
    }  # fmt: skip
    assert set(chain_speed['channels']) == {
        'channel_samples', 'rounds', 'ns_per_channel_sample', 'ratio', 'worst_ratio',
        'last_ratio',
    }  # fmt: skip
    assert chain_speed['quick'] is True
    assert chain_speed['machine']['compiled'] is COMPILED
    assert (chain_speed['machine']['numba'] is None) is not COMPILED


def test_every_key_is_documented(chain_speed):
    names = {
        key for section in chain_speed.values() if isinstance(section, dict) for key in section
    } | set(chain_speed['blocks']['ns_per_row'])
    for name in (names | set(chain_speed)) - set(WANTED):
        assert f'``{name}``' in machine.__doc__ + command_line.__doc__ + speed.__doc__


def test_the_figures_agree_with_each_other(chain_speed):
    row, channels = chain_speed['one_row'], chain_speed['channels']
    assert row['chain_us_per_call'] > 0
    assert row['speedup'] == pytest.approx(row['sosfilt_us_per_call'] / row['chain_us_per_call'])
    assert row['kept_bytes_per_call'] < 1
    assert row['temporary_bytes_per_channel'] < 1
    assert all(0 < peak < 10_000 for peak in row['peak_bytes_per_call'].values())
    per_sample = channels['ns_per_channel_sample']
    assert list(per_sample) == list(channels['ratio']) == COUNTS
    assert all(ns > 0 for ns in per_sample.values())
    for n in COUNTS:
        assert channels['ratio'][n] == pytest.approx(per_sample[n] / per_sample['16'])
    assert channels['worst_ratio'] == max(channels['ratio'].values())
    assert channels['last_ratio'] == channels['ratio']['10000']


def test_each_claim_stands_beside_what_is_wanted(chain_speed):
    assert set(chain_speed['wanted']) == set(WANTED)
    for name, entry in chain_speed['wanted'].items():
        section, figure = name.split('.')
        assert entry['value'] == chain_speed[section][figure]
        assert entry['met'] is None  # what is measured in short is not judged
        assert entry['bound'] == str(WANTED[name])


def test_as_a_process_it_prints_one_object(monkeypatch, capsys):
    monkeypatch.setattr(speed, 'measure_chain_speed', lambda quick: [quick])
    assert speed.main(['--quick']) == 0
    assert json.loads(capsys.readouterr().out) == [True]
