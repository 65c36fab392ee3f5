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

"""What wraps the methods of a managed node."""

import threading
from types import SimpleNamespace

import pytest

pytest.importorskip('rclpy', reason='needs rclpy')

from rclpy.lifecycle import TransitionCallbackReturn

from slip_detector.nodes.decorators import exclusive, explained


class Counted:
    def __init__(self):
        self._lock = threading.RLock()
        self.n = 0

    @exclusive
    def add(self, more, *, times):
        for _ in range(times):
            before = self.n
            if more:
                self.add(0, times=0)  # The thread that has the lock may enter again.
            self.n = before + more
        return self.n


def test_one_thread_at_a_time_runs_exclusive_methods():
    counted = Counted()
    threads = [threading.Thread(target=counted.add, args=(1,), kwargs={'times': 20_000})]
    threads += [threading.Thread(target=counted.add, args=(2,), kwargs={'times': 20_000})]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert counted.add(0, times=1) == 60_000


@pytest.mark.parametrize('autostart', [True, False])
def test_why_a_transition_failed_is_kept_and_logged_where_nobody_else_reports_it(autostart):
    logged = []

    @explained
    def on_configure(node, state):
        if state:
            raise ValueError('no\n  room')
        return TransitionCallbackReturn.SUCCESS

    node = SimpleNamespace(
        config=SimpleNamespace(autostart=autostart),
        get_logger=lambda: SimpleNamespace(error=logged.append),
    )
    assert on_configure(node, None) is TransitionCallbackReturn.SUCCESS
    assert on_configure(node, 'any') is TransitionCallbackReturn.ERROR
    assert node._failed == 'no room'
    assert logged == ([] if autostart else ['no room'])
