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

"""How soon and how clean config/onset.yaml is."""

import numpy as np
import pytest

from benchmarks.tune import onset
from slip_detector.evaluation.labelled_rows import LabelledRows
from slip_detector.evaluation.protocol_trials import SCENES
from slip_detector.parameters.detector import ChainConfig

RATE_HZ, SLIP = 380.0, slice(380, 760)


@pytest.fixture(scope='module')
def rows():
    """Return noise with a tone in the middle, which is the slip, and noise without."""
    rng = np.random.default_rng(0)
    truth = np.zeros(1140, bool)
    truth[SLIP] = True
    tone_v = 0.02 * np.sin(2 * np.pi * 20.0 * np.arange(truth.size) / RATE_HZ) * truth
    noise_v = 1e-3 * rng.standard_normal((truth.size, 16))
    slides = [LabelledRows(4.0 + noise_v + tone_v[:, np.newaxis], truth)]
    still = [LabelledRows(4.0 + noise_v, np.zeros(truth.size, bool))]
    return {
        **dict.fromkeys((*SCENES.values(), *onset.FAST), slides),
        **dict.fromkeys(onset.WITHOUT_SLIP, still),
    }


def test_a_slip_that_is_told_has_a_delay_and_what_is_left_of_it_is_no_false_time(rows):
    figures = onset.onset_figures(rows, ChainConfig())
    assert 10.0 < figures['mean_delay_ms'] < 60.0
    assert 10.0 < figures['mean_channel_delay_ms'] < 60.0
    for plate in figures['plates'].values():
        assert plate['mean_delay_ms'] == plate['worst_delay_ms'] == figures['mean_delay_ms']
    assert figures['detected_percent'] == figures['fast_detected_percent'] == 100.0
    assert figures['false_time_percent'] == figures['taps_percent'] == 0.0
    assert figures['false_positive_percent'] > 0.0


@pytest.mark.parametrize(('threshold', 'on_percent'), [(1e-30, 100.0), (1e30, 0.0)])
def test_a_detector_that_is_always_on_or_never_on_detects_nothing(rows, threshold, on_percent):
    figures = onset.onset_figures(rows, ChainConfig(threshold=threshold))
    assert figures['mean_delay_ms'] is None
    assert figures['detected_percent'] == figures['fast_detected_percent'] == 0.0
    for name in ('false_time_percent', 'taps_percent', 'rolling_percent'):
        assert figures[name] == pytest.approx(on_percent, abs=0.2)


def test_the_presets_are_sooner_and_cleaner_than_the_papers_parameters():
    figures = onset.measure_onset([6000])
    sure, paper = figures['sure'], figures['paper']
    assert figures['seeds'] == [6000]
    assert figures['mean_delay_ms'] < 0.5 * min(sure['mean_delay_ms'], paper['mean_delay_ms'])
    assert figures['detected_percent'] == figures['fast_detected_percent'] == 100.0
    assert sure['detected_percent'] == sure['fast_detected_percent'] == 100.0
    for name in ('taps_percent', 'tremor_hum_percent'):
        assert sure[name] <= figures[name] < 0.1 * paper[name]
