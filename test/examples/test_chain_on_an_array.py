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

import numpy as np

from slip_detector.scenes import find_scene, load_scene
from support.pages import ROOT
from support.python_runs import run_python

EXAMPLE = ROOT / 'examples' / 'chain_on_an_array.py'


def test_it_prints_the_slips_of_the_plate(tmp_path):
    done = run_python(EXAMPLE, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    printed = re.findall(r'^slip from ([\d.]+) s to ([\d.]+) s$', done.stdout, re.M)
    assert len(printed) == len(done.stdout.splitlines())
    scene = load_scene(find_scene('plate_400um'), np.random.default_rng(0))
    truth = scene.read(10_000).truth
    slips_s = np.flatnonzero(np.diff(truth.astype(int)) == 1) / scene.sample_rate_hz
    assert slips_s.size
    begins_s = [float(begin_s) for begin_s, _ in printed]
    for slip_s in slips_s:
        assert any(0 < begin_s - slip_s < 0.1 for begin_s in begins_s)
