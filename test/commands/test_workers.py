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

"""Calls side by side: in this process, in others, and what becomes of one that dies."""

import os
import signal
import subprocess
import sys

import pytest

from slip_detector.commands.workers import MOST_DEATHS, Workers
from support.worker_calls import die, die_once, garbage_left, process_of, refuse


def test_one_job_is_this_process_in_the_order_of_the_arguments():
    with Workers() as workers:
        results = list(workers.results(process_of, [5, 3]))
    assert results == [(0, (5, os.getpid())), (1, (3, os.getpid()))]


def test_several_jobs_are_processes_that_end_with_the_context():
    with Workers(jobs=2) as workers:
        results = dict(workers.results(process_of, range(20)))
        assert {place: number for place, (number, _) in results.items()} == {
            k: k for k in range(20)
        }
        pids = {pid for _, pid in results.values()}
        assert os.getpid() not in pids
        assert dict(workers.results(process_of, [])) == {}
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def test_what_a_process_that_dies_had_not_finished_is_called_again(tmp_path):
    with Workers(jobs=2) as workers:
        results = dict(workers.results(die_once, [str(tmp_path)] * 6))
    assert (tmp_path / 'died').exists()
    assert sorted(results) == list(range(6))


def test_processes_that_keep_dying_are_an_error():
    with (
        Workers(jobs=2) as workers,
        pytest.raises(ValueError, match=f'^worker processes died {MOST_DEATHS} times before any'),
    ):
        list(workers.results(die, [1]))


def test_garbage_of_the_first_call_of_a_process_is_collected():
    with Workers(jobs=2) as workers:
        left = [count for _, count in workers.results(garbage_left, range(6))]
    assert left == [0] * 6


def test_what_a_call_refuses_is_said_here():
    with Workers(jobs=2) as workers, pytest.raises(ValueError, match=r'^7 is refused$'):
        list(workers.results(refuse, [7]))


def test_a_process_ends_with_the_one_that_started_it():
    code = (
        'import os, signal\n'
        'from slip_detector.commands.workers import Workers\n'
        'from support.worker_calls import process_of\n'
        'with Workers(jobs=2) as workers:\n'
        '    print(next(workers.results(process_of, [1])), flush=True)\n'
        '    os.kill(os.getpid(), signal.SIGKILL)\n'
    )
    # It does not return before the last process that has the pipe has ended.
    done = subprocess.run(
        [sys.executable, '-c', code],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == -signal.SIGKILL
    assert done.stdout.startswith('(0, (1, ')


def test_who_leaves_while_a_result_is_being_written_can_end():
    code = (
        'from slip_detector.commands.workers import Workers\n'
        'from support.worker_calls import zeros\n'
        'with Workers(jobs=2) as workers:\n'
        '    for _ in workers.results(zeros, [1, 300_000_000]):\n'
        '        pipe = workers._executor._result_queue._reader\n'
        '        while not pipe.poll():  # the large one comes in many parts\n'
        '            pass\n'
        '        break\n'
    )
    subprocess.run(
        [sys.executable, '-c', code],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        timeout=60,
        check=True,
    )


def test_a_cluster_that_is_not_there_is_named():
    pytest.importorskip('distributed', reason='needs distributed')
    with (
        pytest.raises(ValueError, match=r'^cluster no address: cannot be reached'),
        Workers(cluster='no address'),
    ):
        pass


def test_without_distributed_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, 'distributed', None)
    with (
        pytest.raises(ValueError, match=r'^--cluster needs distributed.*slip_detector\[cluster\]'),
        Workers(cluster='tcp://127.0.0.1:8786'),
    ):
        pass
