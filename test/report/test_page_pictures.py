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

"""Figures of a report, for the page and as pictures."""

import numpy as np
import pytest

from slip_detector.report import page as report
from slip_detector.report.page_data import Variant
from slip_detector.report.page_pictures import (
    PICTURE_BINS,
    filters_figure,
    front_figure,
    svg,
    timeline_figure,
)
from support import report_scenes as scenes


@pytest.mark.parametrize('name', ['$a_$ $', '\u6ed1\u308a.npz', 'a\x1fb', 'a/b'])
def test_pictures_take_any_name(tmp_path, name):
    seen = scenes.overview(name, scenes.GIVEN, *scenes.volts_and_truth(500))
    paths = report.write_pictures(tmp_path, [Variant(name, scenes.GIVEN, [seen], {name: {}})])
    assert all(path.parent == tmp_path and path.is_file() for path in paths)


def test_the_response_is_flat_in_the_passband_and_falls_beside_it():
    gain, delay = filters_figure([Variant('given', scenes.GIVEN, [], {})]).axes
    frequency_hz, gain_db = gain.lines[0].get_data()
    low_hz, high_hz = scenes.GIVEN.passband_hz
    inside = (frequency_hz > 1.5 * low_hz) & (frequency_hz < high_hz / 1.5)
    assert gain_db[inside].min() > -3.0
    assert gain_db[frequency_hz < low_hz / 3].max() < -20.0
    assert np.all(delay.lines[0].get_ydata()[inside] > 0.0)


def test_the_same_figure_is_the_same_svg():
    figures = [front_figure(scenes.trials()) for _ in range(2)]
    assert svg(figures[0]) == svg(figures[1])


def test_what_is_marked_is_named_with_its_figures():
    told = [text.get_text() for text in front_figure(scenes.trials()).axes[0].get_legend().texts]
    assert told == [
        'trial',
        'on the front',
        'given: 50 ms, 4 a minute, sooner than chance 0.80',
        'tuned: 20 ms, 1 a minute, sooner than chance 0.90',
    ]


def test_a_timeline_has_a_lane_for_each_decision_and_each_channel():
    seen = scenes.overview('a', scenes.GIVEN, *scenes.volts_and_truth(4000))
    figure = timeline_figure(['given', 'tuned'], [seen, seen])
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert names[:4] == ['events', 'label', 'slip given', 'slip tuned']
    assert set(scenes.GIVEN.groups) < set(names)
    assert len(names) == 4 + 4 + 16
    assert seen.rows > PICTURE_BINS
