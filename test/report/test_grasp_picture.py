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

"""The picture of the grasp."""

import numpy as np
import pytest

from slip_detector.grasp.comparison import grasp_figures
from slip_detector.report.grasp_picture import draw_grasp
from support import grasp_trials


@pytest.mark.parametrize('live', [True, False])
def test_a_picture_is_drawn_with_and_without_what_came_through_the_nodes(tmp_path, live):
    path = tmp_path / 'grasp.png'
    trials = grasp_trials.by_condition()
    rows = np.column_stack([np.linspace(0.0, 8.0, 50), np.linspace(0.0, 1e-3, 50)])
    draw_grasp(
        path,
        {name: mine[0] for name, mine in trials.items()},
        {name: grasp_figures(mine, 10.0) for name, mine in trials.items()},
        10.0,
        {'position': rows, 'command': rows} if live else {},
        5.0,
    )
    assert path.read_bytes().startswith(b'\x89PNG')
