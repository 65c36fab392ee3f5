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

"""Commands as processes that are interrupted during their work."""

import fcntl
import json
import os
import pty
import select
import signal
import struct
import subprocess
import sys
import termios
import time
from pathlib import Path

from slip_detector.parameters.detector import DetectorConfig
from support.evaluation_cases import SLIP_EVALUATE, write
from support.tuning_cases import SLIP_TUNE, journal, trials_of

ROOT = Path(__file__).parents[2]
DEADLINE_S = 120.0

#: Seconds after which a process that has ended, or was told to abort, has written all its output.
QUIET_S = 10.0


def wait_for(condition, *processes):
    """Poll until a condition holds, with a deadline: a storage has no notification of changes."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s
        for process in processes:
            assert process.poll() is None, process.communicate()
        time.sleep(0.1)


def start_tune(*words):
    """Start ``slip_tune``."""
    return subprocess.Popen(
        [sys.executable, '-c', SLIP_TUNE, *map(str, words)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONWARNINGS': 'ignore', 'PYTHONPATH': str(ROOT)},
    )  # fmt: skip


def check_interrupted_search(case, *words):
    """See that a search leaves what it found; return its words but the trials, and its study."""
    folder, of_case = case
    out = folder / 'out.yaml'
    store = Path(f'{out}.study.journal')
    mine = [*of_case, '--out', out]
    process = start_tune(*mine, '--trials', 100_000, *words)
    wait_for(lambda: store.exists() and store.read_bytes().count(b'"op_code":4') >= 4, process)
    process.send_signal(signal.SIGINT)
    shown, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, err
    assert 'Traceback' not in err, err
    assert 'Stopped early.' in shown
    assert DetectorConfig.from_yaml(out).channels == 4
    assert len(trials_of(journal(store))) >= 3
    return mine, store


def check_interrupted_evaluation(folder, *words):
    """See that an evaluation tells its progress and leaves what was evaluated."""
    paths = [write(folder / f'{name}.npz', seed) for seed, name in enumerate('ab')]
    # Opening it blocks until another process writes.
    endless = folder / 'endless.csv'
    os.mkfifo(endless)
    mine, its = pty.openpty()
    fcntl.ioctl(its, termios.TIOCSWINSZ, struct.pack('HHHH', 24, 80, 0, 0))
    process = subprocess.Popen(
        [sys.executable, '-c', SLIP_EVALUATE, *map(str, [*paths, endless, *words]), '--json'],
        stdout=subprocess.PIPE, stderr=its,
        env={**os.environ, 'PYTHONPATH': str(ROOT), 'PYTHONFAULTHANDLER': '1'},
    )  # fmt: skip
    os.close(its)
    try:
        shown = read_until(mine, '2/3')
        process.send_signal(signal.SIGINT)
        try:
            out, _ = process.communicate(timeout=DEADLINE_S)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGABRT)  # it tells where it hangs
            raise AssertionError(shown + read_until(mine)) from None
        shown += read_until(mine)
    finally:
        process.kill()
        os.close(mine)
    assert process.returncode == 130
    assert 'Traceback' not in shown
    report = json.loads(out)
    assert list(report['sets'][folder.name]['recordings']) == ['a.npz', 'b.npz']
    assert report['not_evaluated'] == [str(endless)]


def read_until(terminal, words=None):
    """Return what is written to a terminal until words come, or without any until it is closed."""
    shown = b''
    while words is None or words.encode() not in shown:
        ready, _, _ = select.select([terminal], [], [], DEADLINE_S if words else QUIET_S)
        if not ready:
            assert not words, f'no {words} in {shown.decode()}'
            break
        try:
            shown += os.read(terminal, 4096)
        except OSError:  # The other end is closed.
            assert not words, f'no {words} in {shown.decode()}'
            break
    return shown.decode()
