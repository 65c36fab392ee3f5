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

"""A search as a process that is interrupted during its work."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

from slip_detector.parameters.detector import DetectorConfig
from support.tuning_cases import SLIP_TUNE, journal, trials_of

ROOT = Path(__file__).parents[2]
DEADLINE_S = 120.0


def wait_for(condition, *processes):
    """Poll until a condition holds, with a deadline: a storage has no notification of changes."""
    deadline_s = time.monotonic() + DEADLINE_S
    while not condition():
        assert time.monotonic() < deadline_s
        for process in processes:
            assert process.poll() is None, process.communicate()
        time.sleep(0.1)


def check_interrupted_search(case, *words, number=signal.SIGINT):
    """See that a search leaves what it found; return its words but the trials, and its study."""
    folder, of_case = case
    out = folder / 'out.yaml'
    store = Path(f'{out}.study.journal')
    mine = [*of_case, '--out', out]
    process = subprocess.Popen(
        [sys.executable, '-c', SLIP_TUNE, *map(str, [*mine, '--trials', 100_000, *words])],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, 'PYTHONWARNINGS': 'ignore', 'PYTHONPATH': str(ROOT)},
        start_new_session=True,
    )  # fmt: skip
    wait_for(lambda: store.exists() and store.read_bytes().count(b'"op_code":4') >= 4, process)
    os.killpg(process.pid, number)
    _, err = process.communicate(timeout=DEADLINE_S)
    assert process.returncode == 0, err
    assert 'Traceback' not in err, err
    assert 'Stopped early.\nOnly 9.21 s of rest are held out: false alarms hardly show' in err
    assert DetectorConfig.from_yaml(out).channels == 4
    assert len(trials_of(journal(store))) >= 3
    return mine, store
