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

"""Files that appear whole or not at all, also on a disk that is full."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from slip_detector.parameters.files import (
    UNFINISHED,
    check_apart,
    check_writable,
    whole_file,
    writable_folder,
)
from slip_detector.parameters.writing import write_file
from support.full_disk import full_disk

#: Writes half a file, says so, and waits to be killed.
HALF = """
import sys, time
from slip_detector.parameters.files import whole_file
with whole_file(sys.argv[1]) as new:
    new.write_text('half')
    print('half', flush=True)
    time.sleep(600)
"""


def test_a_full_disk_leaves_the_old_file_as_it_was(tmp_path):
    path = tmp_path / 'report.html'
    path.write_text('old')
    said = r'report\.html: cannot be written \(File too large\)'
    with pytest.raises(ValueError, match=said), full_disk(1000), whole_file(path) as new:
        new.write_text('x' * 5000)
    assert path.read_text() == 'old'
    assert list(tmp_path.iterdir()) == [path]


def test_an_error_in_the_block_leaves_nothing_and_is_not_changed(tmp_path):
    def fail(new):
        new.write_text('half')
        raise RuntimeError('the source failed')

    with pytest.raises(RuntimeError, match='the source failed'), whole_file(tmp_path / 'a') as new:
        fail(new)
    assert not list(tmp_path.iterdir())


def test_a_process_that_is_killed_leaves_the_old_file_as_it_was(tmp_path):
    path = tmp_path / 'report.html'
    path.write_text('old')
    command = [sys.executable, '-c', HALF, str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == 'half\n'
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert path.read_text() == 'old'
    (left,) = set(tmp_path.iterdir()) - {path}
    assert left.name.startswith(UNFINISHED)


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
    assert synced == ['rows', 'bag', tmp_path.name]


def test_a_file_that_cannot_be_written_is_named_and_nothing_is_left(tmp_path):
    for path in (tmp_path / 'no' / 'a.yaml', tmp_path):
        for write in (check_writable, lambda path: write_file(path, {}, [])):
            with pytest.raises(ValueError, match='cannot be written') as caught:
                write(path)
            assert str(caught.value).startswith(f'{path}: ')
    assert list(tmp_path.iterdir()) == []


def test_checking_changes_nothing(tmp_path):
    old, new = tmp_path / 'old', tmp_path / 'new'
    old.write_text('old')
    check_writable(old)
    check_writable(new)
    assert [path.name for path in tmp_path.iterdir()] == ['old']
    assert old.read_text() == 'old'


@pytest.mark.parametrize('exists', [True, False])
def test_of_a_symbolic_link_the_file_is_written_and_the_link_stays(tmp_path, exists):
    (tmp_path / 'source').mkdir()
    file, link = tmp_path / 'source' / 'a.yaml', tmp_path / 'installed.yaml'
    link.symlink_to(file)
    if exists:
        file.write_text('old')
    check_writable(link)
    assert file.exists() == exists
    with whole_file(link) as new:
        new.write_text('new')
    assert link.is_symlink()
    assert file.read_text() == 'new'
    assert [path.name for path in file.parent.iterdir()] == ['a.yaml']


def test_a_folder_is_made_unless_a_file_stands_there(tmp_path):
    assert writable_folder(tmp_path / 'a' / 'b').is_dir()
    (tmp_path / 'file').write_text('')
    with pytest.raises(ValueError, match='file: cannot be made'):
        writable_folder(tmp_path / 'file')


def test_a_file_is_not_written_twice_nor_over_what_is_read(tmp_path):
    out, link = tmp_path / 'a.yaml', tmp_path / 'link.yaml'
    link.symlink_to(out)
    check_apart({'--out': out, '--report': None}, [tmp_path / 'b.npz'])
    with pytest.raises(ValueError, match=r'--report .*link\.yaml: is written by --out too'):
        check_apart({'--out': out, '--report': link})
    with pytest.raises(ValueError, match=r'--out .*a\.yaml: is read too, allowed: a file of its'):
        check_apart({'--out': out}, [str(link)])
