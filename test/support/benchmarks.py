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

"""The benchmarks as a process of its own, and what their tests share."""

import os
import subprocess
import sys

import mpmath
from mpmath import mpf

from benchmarks.chain.reference import DIGITS
from benchmarks.processes import CHECKOUT

# No figure is judged by its size: machines are noisy. This only ends a run that hangs.
PATIENCE_S = 240.0


def start(*words):
    return subprocess.Popen(
        [sys.executable, '-m', 'benchmarks', *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=CHECKOUT,
        env=os.environ | {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'},
    )  # fmt: skip


def run(*words):
    process = start(*words)
    try:
        output, errors = process.communicate(timeout=PATIENCE_S)
    finally:
        process.kill()
        process.wait()
    return process.returncode, output, errors


def gains(sections, shares):
    """Return the network's complex gains in 50 digits at shares of the sample rate."""
    found = []
    with mpmath.workdps(DIGITS):
        for share in shares:
            z = mpmath.expjpi(2 * mpf(share))
            gain = mpf(1)
            for b0, b1, b2, a1, a2 in sections:
                gain *= (z * (z * b0 + b1) + b2) / (z * (z + a1) + a2)
            found.append(gain)
    return found


def keys_of(part):
    """Return the keys of an object, and of all objects in it."""
    if isinstance(part, dict):
        return set(part).union(*map(keys_of, part.values()))
    return set().union(*map(keys_of, part)) if isinstance(part, list) else set()


def runs_of(entry, method):
    """Return the runs of a method in the precision of a scene."""
    return [run for run in entry['runs'] if run['method'] == method]
