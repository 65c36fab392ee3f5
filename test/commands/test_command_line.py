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

"""The commands as processes: what a user sees before anything is computed."""

import argparse
import os
import subprocess
import sys
from pathlib import Path

import pytest

from slip_detector.commands.command_line import whole_number
from support.python_runs import run_python

INTERRUPTED = """
import sys

class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == 'numpy':
            raise KeyboardInterrupt

sys.meta_path.insert(0, Interrupt())
from slip_detector.commands import command_line

sys.exit(command_line.{command}())
"""


@pytest.mark.parametrize('command', ['evaluate', 'tune'])
def test_an_interrupt_while_a_command_loads_is_one_line(command):
    done = run_python('-c', INTERRUPTED.format(command=command))
    assert done.returncode == 130
    assert done.stderr == f'slip_{command}: ended before it was done\n'


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='no /dev/full')
def test_a_reader_that_leaves_early_is_no_error_and_a_full_disk_is_one():
    code = 'import sys; from slip_detector.commands.command_line import run; '
    code += 'sys.exit(run("slip_tune", lambda: "text"))'
    # Without buffers there is nothing left over that could fail once more at the end.
    environment = {**os.environ, 'PYTHONUNBUFFERED': ''}
    reader, writer = os.pipe()
    os.close(reader)
    full = os.open('/dev/full', os.O_WRONLY)
    said = 'slip_tune: the output cannot be written (No space left on device)\n'
    for output, wanted in ((writer, (0, '')), (full, (1, said))):
        done = subprocess.run(
            [sys.executable, '-c', code], stdout=output, stderr=subprocess.PIPE, text=True,
            env=environment, check=False, timeout=60,
        )  # fmt: skip
        os.close(output)
        assert (done.returncode, done.stderr) == wanted


@pytest.mark.parametrize('text', ['٣', '³', '1_0', '+3', '-1', '', '9' * 5000])
def test_a_whole_number_is_written_in_the_digits_that_all_read(text):
    with pytest.raises(argparse.ArgumentTypeError, match='allowed: a whole number, 1 to '):
        whole_number(1)(text)
    assert whole_number(1, 20)('12') == 12
