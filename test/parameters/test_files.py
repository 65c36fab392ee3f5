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

"""Files that are written whole or not at all, and YAML files that are read as they look."""

import os
from pathlib import Path

import pytest
import yaml

from slip_detector.parameters import files
from slip_detector.parameters.fields import LONGEST_SHOWN
from slip_detector.parameters.files import (
    find_parameter_file,
    shared_folder,
    whole_file,
    writable_folder,
)
from slip_detector.parameters.yaml_files import MOST_BYTES, read_yaml, write_yaml
from support.config_cases import message_of
from support.limits import full_disk


def test_a_full_disk_leaves_the_old_file_as_it_was(tmp_path):
    path = tmp_path / 'report.html'
    path.write_text('old')
    said = r'report\.html: cannot be written \(File too large\)'
    with pytest.raises(ValueError, match=said), full_disk(1000), whole_file(path) as new:
        new.write_text('x' * 5000)
    assert path.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_appears_whole_too_and_all_in_it_is_brought_to_the_disk(tmp_path, monkeypatch):
    synced = []
    fsync = os.fsync

    def note(descriptor):
        synced.append(Path(os.readlink(f'/proc/self/fd/{descriptor}')).name)
        fsync(descriptor)

    monkeypatch.setattr(os, 'fsync', note)
    with whole_file(tmp_path / 'bag') as new:
        new.mkdir()
        (new / 'rows').write_text('rows')
        assert not (tmp_path / 'bag').exists()
    assert (tmp_path / 'bag' / 'rows').read_text() == 'rows'
    assert synced == ['rows']


def test_a_file_that_cannot_be_written_is_named_and_nothing_is_left(tmp_path):
    for path in (tmp_path / 'no' / 'a.yaml', tmp_path):
        assert message_of(write_yaml, path, {}).startswith(f'{path}: cannot be written (')
    assert list(tmp_path.iterdir()) == []
    (tmp_path / 'file').touch()
    with pytest.raises(ValueError, match='file: cannot be written'):
        writable_folder(tmp_path / 'file')


@pytest.mark.parametrize('exists', [True, False])
def test_of_a_symbolic_link_the_file_is_written_and_the_link_stays(tmp_path, exists):
    (tmp_path / 'source').mkdir()
    file, link = tmp_path / 'source' / 'a', tmp_path / 'installed.yaml'
    link.symlink_to(file)
    if exists:
        file.write_text('old')
    with whole_file(link) as new:
        assert new.suffix == '.yaml'  # What is written may depend on it.
        new.write_text('new')
    assert link.is_symlink()
    assert file.read_text() == 'new'
    assert [path.name for path in file.parent.iterdir()] == ['a']


def test_a_package_without_its_folder_says_so(monkeypatch, tmp_path):
    monkeypatch.setattr(files, '__file__', str(tmp_path / 'files.py'))
    assert 'without its config folder' in message_of(shared_folder)


# --- YAML --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('a: 1\nb: 2\na: 3\n', ' line 3: has a again, allowed: once'),
        ('a: [{b: 1,\n  b: 2}]\n', ' line 2: has b again, allowed: once'),
        ("1: a\n'1': b\n", ' line 2: has 1 again'),
        *(
            (f'a: 1\nb: [{number}]\n', f' line 2: {number} is not what it looks like, allowed:')
            for number in (
                *('1:30', '1:30.5', '020', '-017', '08', '1_000', '1_0.5', '0b11', '00', '0x10'),
                *('-0X1f', '0x1.8p1', '9223372036854775808'),
                *('y', 'N', 'inf', 'nan', '-Infinity'),
            )
        ),
        ('a: &a [1]\nb: *a\n', ' line 2: has an alias, allowed: the value itself'),
        ('a: &a [*a]\n', ' line 1: has an alias'),
        ('a: [1, 2\n', " line 2: expected ',' or ']'"),
        ('a: 1\n\tb: 2\n', ' line 2: found character'),
        ('a: 1\n---\nb: 2\n', ' line 2: but found another document'),
        *(
            (f'a: {value}\n', ' line 1: has the tag ')
            for value in ('!!python/object:os.system {}', '!!bool x', '!!float 1', '!x [1]', '! 1')
        ),
        *((f'a: {{{name}: 1}}\n', ' line 1: has a name that is no') for name in ('""', '[1]')),
        ('a: "b\\0"\n', ' line 1: b\0 is not what it looks like, allowed:'),
        ('a: \x01\n', ' is not YAML ('),
        ('a: ' + '[' * 20_000, ' is nested too deeply, allowed: 200 levels'),
        ('', ' is not a YAML file of names and values'),
        ('- 1\n- 2\n', ' is not a YAML file of names and values'),
        ('a' * (MOST_BYTES + 1), f' has more than {MOST_BYTES} bytes, allowed: fewer'),
        (b'\xff\xfe\0slip', ' is not YAML (it is not text'),
        (f'{"b" * 900}: 1\n' * 2, ' line 2: has bbb'),
        ('a: 0' + '7' * 5_000, ' line 1: 0777'),
        ('!' * 10_000, ' line 1: '),
    ],
)
def test_yaml_that_is_not_what_it_looks_like_is_refused_with_its_line(tmp_path, text, said):
    path = tmp_path / 'a.yaml'
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    message = message_of(read_yaml, path)
    assert message.startswith(f'{path}:{said}')
    assert len(message) < 2 * LONGEST_SHOWN + len(str(path))


def test_a_file_that_cannot_be_read_or_never_ends_is_refused(tmp_path):
    for path in (tmp_path / 'missing.yaml', tmp_path):
        assert message_of(read_yaml, path).startswith(f'{path}: cannot be read (')
    device = find_parameter_file('/dev/zero')
    assert message_of(read_yaml, device) == '/dev/zero: is no file, allowed: a file'


def test_other_values_are_read_as_they_look(tmp_path):
    path = tmp_path / 'a.yaml'
    path.write_text('a: ["1:30", "0x1", "1e9", 1e9, -.5, 1.2.3, .inf, 0, 0e9, 08.5, yes]\n')
    values = ['1:30', '0x1', '1e9', 1e9, -0.5, '1.2.3', float('inf'), 0, 0.0, 8.5, True]
    assert read_yaml(path) == {'a': values}
    path.write_text('{on: 2026-11-28, <<: {1: "~"}, null: ~}\n')
    assert read_yaml(path) == {'on': '2026-11-28', '<<': {'1': '~'}, 'null': None}
    path.write_text('a: ' + '[' * 199 + ']' * 199)  # as many levels as are allowed
    assert read_yaml(path)
    # launch_ros writes the list of a launch file as a tuple.
    path.write_text(yaml.dump({'a': ('left', 'right')}))
    assert read_yaml(path) == {'a': ['left', 'right']}
