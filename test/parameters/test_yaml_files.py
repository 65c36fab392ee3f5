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

"""YAML files: what is not as it looks is refused, and what is too large before it takes memory."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.parameters import yaml_files
from slip_detector.parameters.conversion import LONGEST_SHOWN
from slip_detector.parameters.yaml_files import (
    MOST_BYTES,
    MOST_DEPTH,
    MOST_VALUES,
    compose_yaml,
    read_yaml,
)
from support.little_memory import little_memory

#: Each line stands for twice what the line before stands for.
DOUBLING = 'a0: &a0 [1, 1]\n' + ''.join(f'a{k + 1}: &a{k + 1} [*a{k}, *a{k}]\n' for k in range(40))


def said(tmp_path, text):
    path = tmp_path / 'a.yaml'
    path.write_text(text, encoding='utf-8')
    with pytest.raises(ValueError, match=r'.') as caught:
        read_yaml(path)
    assert str(caught.value).startswith(f'{path}:')
    assert '\n' not in str(caught.value)
    return str(caught.value).removeprefix(f'{path}:')


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        ('a: 1\nb: 2\na: 3\n', ' line 3: has a again, as in line 1, allowed: once'),
        ('a:\n  b: 1\n  c: {d: 1, d: 1}\n', ' line 3: has d again, as in line 3, allowed: once'),
        ("1: a\n'1': b\n", ' line 2: has 1 again'),
        ('a: [{b: 1, b: 2}]\n', ' line 1: has b again'),
    ],
)
def test_a_name_stands_once(tmp_path, text, line):
    assert said(tmp_path, text).startswith(line)


@pytest.mark.parametrize(
    'number', ['1:30', '1:30.5', '020', '-017', '1_000', '1_0.5', '0b11', '00', '08.5_1']
)
def test_a_number_is_decimal_as_it_looks(tmp_path, number):
    line = f' line 2: {number} is not a number as it looks, allowed: a decimal number'
    assert said(tmp_path, f'a: 1\nb: [{number}]\n').startswith(line)


@given(number=st.integers() | st.floats(allow_nan=False))
def test_numbers_are_read_as_they_are_written(tmp_path_factory, number):
    path = tmp_path_factory.mktemp('number') / 'a.yaml'
    path.write_text(yaml.safe_dump({'a': number}))
    assert read_yaml(path) == {'a': number}


@pytest.mark.parametrize('value', ['!!bool x', '!!timestamp x', '!!int x', '!!binary "a"'])
def test_a_value_that_is_not_what_its_tag_says_is_refused(tmp_path, value):
    said(tmp_path, f'a: {value}')


@pytest.mark.parametrize(
    'text',
    ['!' * 10_000, 'a: ' + '9' * 5_000, 'a: 0' + '7' * 5_000, 'a: 1\n' + f'{"b" * 900}: 1\n' * 2],
)
def test_a_message_can_be_read_however_long_the_line_is(tmp_path, text):
    assert len(said(tmp_path, text)) < 2 * LONGEST_SHOWN


def test_what_looks_like_no_number_is_text(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('a: ["1:30", "020", 1e9, 1.2.3, 0x10, .inf, 0, -0]\n')
    wanted = ['1:30', '020', '1e9', '1.2.3', 16, float('inf'), 0, 0]
    assert read_yaml(path) == {'a': wanted}


@pytest.mark.parametrize(
    ('text', 'line'),
    [
        (DOUBLING, f' line 15 exceeds the limit, allowed: {MOST_VALUES} values'),
        ('a: ' + '[' * 20_000, f' line 1 is nested too deeply, allowed: {MOST_DEPTH} deep'),
        ('{a: ' * 20_000, f' line 1 is nested too deeply, allowed: {MOST_DEPTH} deep'),
        ('a: &a [*a]\n', ' line 1 holds itself'),
        ('a: &a\n  b: {c: *a}\n', ' line 2 holds itself'),
        ('a' * (MOST_BYTES + 1), f' has more than {MOST_BYTES} bytes, allowed: fewer'),
    ],
)
def test_what_is_too_large_is_refused_before_it_takes_memory(tmp_path, text, line):
    with little_memory(100 * MOST_BYTES):
        assert said(tmp_path, text).startswith(line)


def test_a_long_list_is_read_up_to_the_most_values(tmp_path, monkeypatch):
    monkeypatch.setattr(yaml_files, 'MOST_VALUES', 1000)
    path = tmp_path / 'a.yaml'
    path.write_text(f'a: [{"1, " * 997}]\n')  # with its name and the mapping
    assert len(read_yaml(path)['a']) == 997
    assert said(tmp_path, f'a: [{"1, " * 998}]\n').startswith(' line 1 exceeds the limit')


def test_a_device_without_end_is_refused():
    with pytest.raises(ValueError, match=rf'^/dev/zero: has more than {MOST_BYTES} bytes'):
        compose_yaml('/dev/zero')


def test_aliases_within_reason_are_read(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('a: &a {b: 1}\nc: [*a, *a]\nd: {<<: *a, b: 2}\n')
    assert read_yaml(path) == {'a': {'b': 1}, 'c': [{'b': 1}, {'b': 1}], 'd': {'b': 2}}


def test_a_list_of_a_launch_file_is_a_list(tmp_path):
    # launch_ros writes the parameters of a launch file so.
    file = tmp_path / 'launch_params'
    given = {'/**': {'ros__parameters': {'command_joints': ('left', 'right'), 'gain': 2.0}}}
    file.write_text(yaml.dump(given))
    assert 'python/tuple' in file.read_text()
    assert read_yaml(file)['/**']['ros__parameters']['command_joints'] == ['left', 'right']
