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

"""examples/chain_on_an_array.py."""

import re
import runpy
import subprocess
import sys

import numpy as np

from slip_detector import ChainConfig
from slip_detector.scenes import find_scene, load_scene
from support.pages import ROOT

EXAMPLE = ROOT / 'examples' / 'chain_on_an_array.py'


def test_it_prints_the_slips_of_the_plate(tmp_path):
    done = subprocess.run(
        [sys.executable, EXAMPLE], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    printed = re.findall(r'^slip from ([\d.]+) s to ([\d.]+) s$', done.stdout, re.M)
    assert len(printed) == len(done.stdout.splitlines())
    scene = load_scene(find_scene('plate_400um'), np.random.default_rng(0))
    truth = scene.read(10_000).truth
    slips_s = np.flatnonzero(np.diff(truth.astype(int)) == 1) / scene.sample_rate_hz
    assert slips_s.size
    begins_s = [float(begin_s) for begin_s, _ in printed]
    for slip_s in slips_s:
        assert any(0 < begin_s - slip_s < 0.1 for begin_s in begins_s)


def test_a_slip_at_either_end_of_the_array_has_its_times():
    slips_in = runpy.run_path(str(EXAMPLE))['slips_in']
    config = ChainConfig(channels=1, groups={'all': (1,)})
    time_s = np.arange(1000) / config.sample_rate_hz
    rest = np.full((1000, 1), 4.3)
    vibration = 4.3 + 0.1 * np.sin(2 * np.pi * 25 * time_s)[:, None]
    assert slips_in(rest, config).shape == (0, 2)
    ((begin_s, end_s),) = slips_in(vibration, config)
    assert 0 < begin_s < 0.1
    assert end_s == time_s[-1]
