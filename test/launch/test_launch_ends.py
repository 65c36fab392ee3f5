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

"""A launch file that is ended by a signal."""

import os
import signal
from pathlib import Path

import pytest
from std_msgs.msg import Bool

from slip_detector.nodes.messages import state_qos
from support.harness import DEADLINE_S
from support.launching import start_launch


def living(group):
    """Return the processes of a group that have not ended, whether or not somebody asked."""
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            _, _, rest = stat.read_text().rpartition(') ')
        except OSError:
            continue  # It has just gone.
        state, _, its_group, *_ = rest.split()
        if int(its_group) == group and state != 'Z':
            found.append(int(stat.parent.name))
    return found


@pytest.mark.parametrize(
    ('send', 'number', 'code'),
    [
        # As systemd does, supervisord with stopasgroup, and a terminal (SIGINT).
        (os.killpg, signal.SIGTERM, -signal.SIGTERM),
        (os.killpg, signal.SIGINT, 0),
        (os.kill, signal.SIGINT, 0),
    ],
    ids=['SIGTERM to the group', 'SIGINT to the group', 'SIGINT to ros2 launch'],
)
def test_a_signal_leaves_no_node_behind(bench, tmp_path, send, number, code):
    valid = bench.listen(Bool, 'slip_valid', state_qos())
    log = tmp_path / 'log'
    words = 'slip_detector', 'source:=scene'
    launched = start_launch(bench, log, *words, start_new_session=True)
    try:
        bench.wait_for(lambda: valid and valid[-1].data, 'slip_valid')
        assert len(living(launched.pid)) == 3
        send(launched.pid, number)
        assert launched.wait(timeout=DEADLINE_S) == code
        bench.wait_for(lambda: not living(launched.pid), 'all nodes to end')
        bench.wait_for(lambda: not valid[-1].data, 'slip_valid to be withdrawn')
    finally:
        for process in living(launched.pid):
            os.kill(process, signal.SIGKILL)
        launched.wait()
    assert 'Traceback' not in log.read_text()
