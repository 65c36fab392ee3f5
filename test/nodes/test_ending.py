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

"""How signals end a process."""

import pytest

from support.python_runs import run_python

SIGNALLED = """
import signal, time
from slip_detector.nodes.ending import END_SIGNAL, end_on_signals, init_ros

end_on_signals()
{begin}
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGINT):
    signal.raise_signal(number)
END_SIGNAL.wait()
print('is to end', flush=True)
time.sleep(3600)
"""


@pytest.mark.parametrize(('begin', 'said'), [('', ''), ('init_ros()', 'is to end\n')])
def test_a_process_ends_at_once_or_is_asked_to_and_ends_soon_whatever_it_does(begin, said):
    done = run_python('-c', SIGNALLED.format(begin=begin), timeout=60.0)
    assert (done.returncode, done.stdout, done.stderr) == (0, said, '')
