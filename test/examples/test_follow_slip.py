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

"""examples/follow_slip.py, with a detector that is fed and stopped."""

import signal

import numpy as np
import pytest

from support.harness import PERIOD_NS, START_NS, Detected
from support.pages import ROOT

pytestmark = pytest.mark.nodes

SLIP = 'raise the grip: slip'
NO_SLIP = 'keep or relax the grip: no slip'
UNKNOWN = 'hold the grip: slip is not known'

#: Samples of rest and of slip.
REST = np.full((20, 16), 4.3)
VIBRATION = 4.3 + 0.1 * np.sin(2 * np.pi * 25 / 380 * np.arange(60))[:, None] * np.ones(16)


def said(process):
    """Return what it has said to do, the last one last."""
    lines = process.log().splitlines()
    return [text for line in lines for text in (SLIP, NO_SLIP, UNKNOWN) if line.endswith(text)]


def test_it_follows_slip_and_holds_on_when_the_detector_hangs(bench):
    follower = bench.start_python(ROOT / 'examples' / 'follow_slip.py')
    # A timeout longer than any pause of a busy machine: only the end of the detector is noticed.
    detected = Detected(bench, parameters={'input_timeout_s': 60.0})
    at_ns = detected.settle(REST[0], START_NS, PERIOD_NS)
    at_ns = detected.send_all(REST, at_ns, PERIOD_NS)
    bench.wait_for(lambda: said(follower)[-1:] == [NO_SLIP], NO_SLIP)
    detected.send_all(VIBRATION, at_ns, PERIOD_NS)
    bench.wait_for(lambda: said(follower)[-1:] == [SLIP], SLIP)
    detected.process.signal(signal.SIGSTOP)
    bench.wait_for(lambda: said(follower)[-1:] == [UNKNOWN], UNKNOWN)
    follower.end_quietly()
