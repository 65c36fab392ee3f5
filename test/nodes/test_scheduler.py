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

"""One thread for several players, and the ends of all."""

import threading
import time

import pytest

from slip_detector.nodes.scheduler import Scheduler

DEADLINE_S = 60.0


def ended(scheduler):
    """Look until all have ended, with a deadline; raises what one has failed with."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not scheduler.ended:
        assert time.monotonic() < deadline_s
        time.sleep(1e-3)


@pytest.mark.parametrize('late_s', [0.0, 0.04])
def test_each_has_its_turn_when_it_is_due_and_all_in_one_thread(late_s):
    taken, threads = [], set()
    start_s = time.monotonic()

    def player(name, offsets_s):
        for offset_s in offsets_s:
            yield start_s + offset_s
            assert time.monotonic() >= start_s + offset_s
            taken.append((offset_s, name))
            threads.add(threading.get_ident())

    scheduler = Scheduler()
    scheduler.add_task(player('a', [0.00, 0.02, 0.04, 0.06]))
    scheduler.add_task(player('b', [0.01, 0.03]))
    scheduler.add_task(player('c', [0.01, 0.05]))
    assert not taken
    # On a busy machine the thread may begin this late: the order is that of the times.
    time.sleep(late_s)
    scheduler.start()
    ended(scheduler)
    assert [name for _, name in taken] == ['a', 'b', 'c', 'a', 'b', 'a', 'c', 'a']
    assert len(threads) == 1


def test_one_that_lags_behind_is_brought_forward_before_the_others():
    taken = []

    def player(name, moments_s):
        for moment_s in moments_s:
            yield moment_s
            taken.append(name)

    now_s = time.monotonic()
    scheduler = Scheduler()
    scheduler.add_task(player('late', [now_s - 3, now_s - 2, now_s - 1]))
    scheduler.add_task(player('later', [now_s - 0.5, now_s]))
    scheduler.start()
    ended(scheduler)
    assert taken == ['late'] * 3 + ['later'] * 2


def test_to_stop_ends_all_who_wait():
    def player():
        yield time.monotonic() + 10 * DEADLINE_S
        pytest.fail('its turn had not come')

    waiting = threading.Event()

    def listen(stop):
        waiting.set()
        stop.wait()

    scheduler = Scheduler()
    scheduler.add_task(player())
    scheduler.add_thread(listen)
    scheduler.start()
    assert waiting.wait(DEADLINE_S)
    assert not scheduler.ended
    scheduler.stop()
    assert scheduler.ended
    scheduler.stop()


def test_to_stop_what_was_never_started_is_nothing():
    scheduler = Scheduler()
    scheduler.add_task(iter([0.0]))
    scheduler.add_thread(lambda stop: None)
    scheduler.stop()


@pytest.mark.parametrize('waiting', [False, True])
def test_what_one_has_failed_with_is_raised_where_the_end_is_looked_for(waiting):
    def fail(*_):
        raise OSError('the disk is gone')

    scheduler = Scheduler()
    if waiting:
        scheduler.add_thread(fail)
    else:
        scheduler.add_task(map(fail, [0.0]))
    scheduler.start()
    with pytest.raises(OSError, match='the disk is gone'):
        ended(scheduler)
