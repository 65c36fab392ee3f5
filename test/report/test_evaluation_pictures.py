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

"""The picture of an evaluation."""

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.evaluation import EvaluationConfig
from slip_detector.report import evaluation_pictures
from slip_detector.report.evaluation_pictures import draw_evaluation
from support import report_scenes as scenes


@pytest.mark.parametrize('rows', [0, 380 * 20])
def test_latencies_their_parts_and_the_roc_are_those_of_the_outcome(tmp_path, monkeypatch, rows):
    drawn = []
    monkeypatch.setattr(
        evaluation_pictures, 'save_picture', lambda figure, path: drawn.append(figure)
    )
    volts, truth = scenes.volts_and_truth(rows)
    outcome = Replay(scenes.GIVEN).run([Samples.evenly(volts, 380.0, truth)])
    draw_evaluation(tmp_path / 'a.png', [outcome])
    latencies, parts, roc = drawn[0].axes
    found = sum(slip.latency_s is not None for slip in outcome.slips)
    assert (found > 0) == (rows > 0)
    assert latencies.get_title() == f'{found} detected, {len(outcome.slips) - found} missed'
    counted = sum(bar.get_height() for bar in latencies.patches)
    assert counted == found
    lengths_ms = [bar.get_width() for bar in parts.patches if bar.get_y() < 0.5]
    if found:
        mean_ms = 1e3 * np.mean([slip.latency_s for slip in outcome.slips if slip.latency_s])
        assert sum(lengths_ms) == pytest.approx(mean_ms)
    assert (len(roc.lines) > 1) == (rows > 0)


def test_slips_whose_latency_has_no_parts_are_drawn_without_a_warning(tmp_path):
    volts, truth = scenes.volts_and_truth(380 * 20)
    # Labels that come late: the alarm rises before them, and no stage took time.
    replay = Replay(scenes.GIVEN, EvaluationConfig(early_s=0.1))
    outcome = replay.run([Samples.evenly(volts, 380.0, np.roll(truth, 30))])
    found = [slip for slip in outcome.slips if slip.latency_s is not None]
    assert found
    assert not any(slip.stages_s for slip in found)
    draw_evaluation(tmp_path / 'a.png', [outcome])
    assert (tmp_path / 'a.png').is_file()
