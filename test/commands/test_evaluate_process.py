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

"""``slip_evaluate`` as a process: what it prints, and how it ends."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.evaluation_cases import SLIP_EVALUATE, write

ROOT = Path(__file__).parents[2]


def command(*arguments):
    return [sys.executable, '-c', SLIP_EVALUATE, *map(str, arguments)]


def run(*arguments, **more):
    environment = {**os.environ, 'PYTHONPATH': str(ROOT)}
    # Without buffers there is nothing left over that could fail once more at the end.
    environment.pop('PYTHONUNBUFFERED', None)
    more = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, **more}
    return subprocess.run(
        command(*arguments), text=True, check=False, timeout=120, env=environment, **more
    )


def test_as_a_process_it_prints_and_ends_with_its_exit_code(tmp_path):
    path = write(tmp_path / 'a.npz')
    good = run(path)
    assert (good.returncode, good.stderr) == (0, '')
    assert good.stdout.splitlines()[2].startswith('all rows')
    bad = run(tmp_path / 'no.npz')
    assert (bad.returncode, bad.stdout) == (1, '')
    assert bad.stderr == (
        f'slip_evaluate: {tmp_path / "no.npz"}: cannot be read (No such file or directory)\n'
    )


def test_a_reader_that_leaves_early_is_no_error(tmp_path):
    path = write(tmp_path / 'a.npz')
    reader, writer = os.pipe()
    os.close(reader)
    try:
        ended = run(path, stdout=writer)
    finally:
        os.close(writer)
    assert (ended.returncode, ended.stderr) == (0, '')


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='no /dev/full')
def test_a_full_disk_is_said(tmp_path):
    path = write(tmp_path / 'a.npz')
    with open('/dev/full', 'w', encoding='utf-8') as full:
        ended = run(path, stdout=full)
    assert ended.returncode == 1
    assert ended.stderr == (
        'slip_evaluate: the output cannot be written (No space left on device)\n'
    )
