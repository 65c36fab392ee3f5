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
import os
import signal
import threading
from pathlib import Path

import pytest

from slip_detector.commands import evaluate, tune
from support.evaluation_cases import write
from support.interrupts import check_interrupted_search, wait_for
from support.tuning_cases import journal, trials_of

distributed = pytest.importorskip('distributed', reason='needs distributed')


@pytest.fixture(scope='module')
def client(tmp_path_factory):
    """Return a client of a scheduler whose two workers run in a folder of their own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp('cluster'))
        cluster = distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, dashboard_address=None
        )
    with cluster, cluster.get_client() as client:
        yield client


@contextlib.contextmanager
def dying_worker(client):
    """Kill a worker once it has calls to make."""
    address, process = next(iter(client.run(os.getpid).items()))
    os.kill(process, signal.SIGSTOP)  # so that none of them has ended before

    def kill():
        wait_for(lambda: client.processing()[address])
        os.kill(process, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    killer.start()
    yield
    killer.join()


def test_a_cluster_finds_the_same_to_the_bit_though_a_worker_dies(
    client, case, capsys, monkeypatch
):
    folder, words = case
    monkeypatch.chdir(folder)  # the workers are elsewhere
    recordings = [str(write(Path('set') / f'{name}.npz', k)) for k, name in enumerate('abcde')]
    there = ['--cluster', client.scheduler.address]

    def evaluated(*more):
        assert evaluate.main([*recordings, '--json', *more]) == 0
        return capsys.readouterr().out

    def tuned(out, *more):
        names = [Path(word).name for word in words]
        options = ['--config', 'given.yaml', '--out', out, '--trials', '12']
        assert tune.main([*names[:3], *options, *more]) == 0
        found = trials_of(journal(f'{out}.study.journal'))
        return [(trial.params, trial.values, trial.user_attrs['found']) for trial in found]

    with dying_worker(client):
        figures = evaluated(*there)
    assert figures == evaluated()
    trials = tuned('there.yaml', *there)
    assert len(trials) == 12
    assert trials == tuned('here.yaml')


def test_an_interrupt_leaves_what_a_cluster_found_and_the_cluster_as_it_was(client, case):
    client.wait_for_workers(2)
    before = client.run(os.getpid)
    check_interrupted_search(case, '--cluster', client.scheduler.address)
    assert client.run(os.getpid) == before
    wait_for(lambda: not any(client.processing().values()))
