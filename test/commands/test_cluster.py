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

"""``slip_evaluate`` and ``slip_tune`` on a Dask cluster: workers die, and Ctrl-C is pressed."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from slip_detector.commands import evaluate, tune
from support.evaluation_cases import write
from support.interrupts import DEADLINE_S, check_interrupted_search, wait_for
from support.tuning_cases import journal, trials_of

distributed = pytest.importorskip('distributed', reason='needs distributed')

ROOT = Path(__file__).parents[2]


class Cluster:
    """A scheduler, and workers that can be killed at work."""

    def __init__(self, folder):
        self._folder, self.processes = folder, []
        told = folder / 'scheduler.json'
        self._start('scheduler', '--host', '127.0.0.1', '--port', 0, '--no-dashboard',
                    '--scheduler-file', told)  # fmt: skip
        wait_for(lambda: told.exists() and told.read_text())
        self.address = json.loads(told.read_text())['address']

    def worker(self):
        """Return a worker that runs; it is started where there is none."""
        running = [process for process in self.processes[1:] if process.poll() is None]
        return running[-1] if running else self.start_worker()

    def start_worker(self):
        return self._start('worker', self.address, '--nthreads', 1, '--no-nanny', '--no-dashboard')

    @contextlib.contextmanager
    def dying(self, worker):
        """Kill a worker once it has calls to make; see that it did."""
        with distributed.Client(self.address) as client:
            client.wait_for_workers(2, timeout=DEADLINE_S)
            its = client.run(os.getpid)
            (address,) = (where for where, pid in its.items() if pid == worker.pid)
            worker.send_signal(signal.SIGSTOP)  # so that none of them has ended before

            def kill():
                wait_for(lambda: client.processing()[address])
                worker.kill()

            killer = threading.Thread(target=kill)
            killer.start()
            try:
                yield
            finally:
                killer.join()
            assert worker.wait() == -signal.SIGKILL

    def _start(self, *words):
        log = self._folder / f'{len(self.processes)}.log'
        with open(log, 'w', encoding='utf-8') as output:
            process = subprocess.Popen(
                [sys.executable, '-m', 'dask', *map(str, words)],
                stdout=output, stderr=output, cwd=self._folder,
                env={**os.environ, 'PYTHONPATH': str(ROOT)},
            )  # fmt: skip
        self.processes.append(process)
        return process


@pytest.fixture(scope='module')
def cluster(tmp_path_factory):
    running = Cluster(tmp_path_factory.mktemp('cluster'))
    yield running
    for process in running.processes[::-1]:
        process.kill()
        process.wait()


def test_a_cluster_finds_the_same_to_the_bit_though_a_worker_dies(
    cluster, case, capsys, monkeypatch
):
    folder, words = case
    monkeypatch.chdir(folder)  # the workers are elsewhere
    recordings = [str(write(Path('set') / f'{name}.npz', k)) for k, name in enumerate('abcde')]

    def evaluated(*more):
        assert evaluate.main([*recordings, '--json', *more]) == 0
        return capsys.readouterr().out

    def tuned(out, *more):
        names = [Path(word).name for word in words]
        options = ['--config', 'given.yaml', '--out', out, '--trials', '12']
        assert tune.main([*names[:3], *options, *more]) == 0
        found = trials_of(journal(f'{out}.study.journal'))
        return [(trial.params, trial.values, trial.user_attrs['found']) for trial in found]

    first, _ = cluster.worker(), cluster.start_worker()
    with cluster.dying(first):
        figures = evaluated('--cluster', cluster.address)
    assert figures == evaluated()
    trials = tuned('there.yaml', '--cluster', cluster.address)
    assert len(trials) == 12
    assert trials == tuned('here.yaml')


def test_an_interrupt_leaves_what_a_cluster_found_and_the_cluster_as_it_was(cluster, case):
    worker = cluster.worker()
    check_interrupted_search(case, '--cluster', cluster.address)
    assert worker.poll() is None
    with distributed.Client(cluster.address) as client:
        wait_for(lambda: not any(client.processing().values()))
