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

"""Steps: read as they are written, or refused with the number of the step."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes.motion import Step, read_steps

STEPS = st.builds(
    Step,
    duration_s=st.floats(1e-3, 36000.0),
    force_n=st.floats(-1.0, 1000.0),
    velocity_m_s=st.floats(-10.0, 10.0),
    carried=st.floats(-1.0, 1.0),
    pull_n=st.floats(-1e3, 1e3),
)


@given(st.lists(STEPS, min_size=1, max_size=4))
def test_steps_are_read_as_they_are_written(steps):
    assert read_steps([step.to_parameters() for step in steps]) == steps


@pytest.mark.parametrize(
    ('entries', 'said'),
    [
        (None, 'steps is None, allowed: a list of at least one step'),
        ([], 'steps is [], allowed: a list of at least one step'),
        ([3], 'steps: step 1 is 3, allowed: names and values'),
        ([{}, {'duration_s': 0}], 'steps: step 2: parameter duration_s is 0 s, allowed: 0.001 to'),
        ([{'duration': 1}], 'steps: step 1: unknown parameter duration = 1; did you mean durat'),
    ],
)
def test_a_wrong_step_is_named(entries, said):
    with pytest.raises(ValueError, match=re.escape(said)):
        read_steps(entries)
