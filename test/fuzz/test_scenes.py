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

"""Descriptions of scenes, of all parts with all that a parameter can be."""

import numpy as np
from fuzz.fuzzing import STRANGE, fuzz, some_values
from hypothesis import strategies as st

from slip_detector.scenes import Scene
from slip_detector.scenes.motion import Step
from slip_detector.scenes.parts import PARTS, Sampling

#: Longest scene whose beginning is played, and the most patches of its contact.
MOST_S, MOST_ROWS = 100.0, 20


@st.composite
def scenes(draw):
    parts = draw(st.lists(st.sampled_from(list(PARTS)), max_size=4, unique=True))
    scene = {name: draw(some_values(PARTS[name], 3)) for name in parts}
    scene['steps'] = draw(st.lists(some_values(Step, 3), min_size=1, max_size=3))
    if draw(st.integers(0, 4)) == 0:
        scene.update(draw(some_values(Sampling, 1)))
    if draw(st.integers(0, 19)) == 0:
        scene[draw(st.text(max_size=6))] = draw(STRANGE)
    return scene


def check(description):
    """What is taken plays: rows of its channels, in rising times, as often as it is asked."""
    scene = Scene(description, np.random.default_rng(0))
    if scene.duration_s > MOST_S:
        return
    before_ns = -1
    for n in (0, 1, MOST_ROWS):
        samples = scene.read(n)
        assert samples.volts.shape == (len(samples.stamps_ns), len(scene.channel_names))
        assert len(samples.volts) <= n
        assert (np.diff(samples.stamps_ns, prepend=before_ns) > 0).all()
        before_ns = max([before_ns, *samples.stamps_ns])


CORPUS = [
    {'steps': []},
    {'steps': [{1: 2}]},
    {'steps': [{}], 'friction': {1.5: 2}},
    {'steps': None},
    {'steps': [None]},
    {'steps': [{'duration_s': 1e300}]},
    {'steps': [{'force_n': 0.4}], 'sample_rate_hz': 1e300},
    {'steps': [{'force_n': 0.4}], 'step_s': 1e-300},
    {'steps': [{'force_n': 0.4}], 'object': None},
    {'steps': [{'force_n': 0.4}], 'hum': {'frequency_hz': 0}},
    {'steps': [{'force_n': 0.4}], '': {}},
    {'steps': [{'force_n': 0.4}], '\r': {}},
    {'steps': [{'force_n': 0.4}], 'a' * 100_000: {}},
    {'steps': 'a' * 100_000},
]


def test_any_scene_plays_or_is_refused_in_one_line():
    fuzz(scenes(), check, corpus=CORPUS, few=40)
