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

"""Pictures of one trial."""

import numpy as np
import pytest

from slip_detector.parameters.detector import ChainConfig
from slip_detector.report import trial_pictures
from slip_detector.report.trial_pictures import draw_stages, draw_trial

TIME_S = np.arange(400) / 100.0
ON = (TIME_S >= 1.0) & (TIME_S < 2.0)
CONFIG = ChainConfig(channels=3, groups={'a': (1, 2), 'b': (3,)})


@pytest.fixture
def figures(monkeypatch):
    """Return the figures that are drawn, in place of files."""
    drawn = []
    monkeypatch.setattr(trial_pictures, 'save_picture', lambda figure, path: drawn.append(figure))
    return drawn


@pytest.mark.parametrize('motion_s', [(1.0, 2.0), None])
def test_each_group_shows_its_channels_and_its_decision(figures, tmp_path, motion_s):
    volts = np.column_stack([np.sin(TIME_S), np.cos(TIME_S), TIME_S])
    groups = {'a': ON, 'b': ~ON}
    draw_trial(tmp_path / 'a.png', TIME_S, volts, CONFIG, groups, ON, motion_s, 'A title')
    (figure,) = figures
    raw_a, decided_a, raw_b, decided_b, slip = figure.axes
    marks = 1 if motion_s else 0
    assert [len(axis.lines) for axis in (raw_a, raw_b)] == [2 + marks, 1 + marks]
    np.testing.assert_array_equal(raw_b.lines[0].get_ydata(), volts[:, 2])
    labels = [axis.get_ylabel() for axis in (decided_a, decided_b, slip)]
    assert labels == ['a', 'b', 'slip']
    assert figure.get_suptitle() == 'A title'


def test_each_stage_is_shown_whole_and_about_the_start_of_the_motion(figures, tmp_path):
    stages = {'raw [V]': TIME_S, 'level [V]': 2 * TIME_S}
    draw_stages(tmp_path / 'a.png', TIME_S, stages, ON, 0.5, (1.0, 2.0), 'A title')
    whole, enlarged = figures[0].axes[0], figures[0].axes[1]
    np.testing.assert_array_equal(whole.lines[0].get_ydata(), TIME_S)
    around_ms = enlarged.lines[0].get_xdata()
    assert around_ms.min() == pytest.approx(-40.0)
    assert around_ms.max() == pytest.approx(160.0)
