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

"""Recordings through one chain, and the figures of several."""

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.evaluation.evaluator import (
    RecordingLoader,
    evaluate_recording,
    recording_figures,
)
from slip_detector.evaluation.figures import figures_of_merit
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig

CHAIN = ChainConfig(channels=2, stopbands_hz=(), gain=1.0, threshold=0.1)


LOADER = RecordingLoader(CHAIN)


def arrays(seed):
    random = np.random.default_rng(seed)
    slip = np.arange(800) % 400 >= 300
    volts = random.normal(size=(800, 2)) * np.where(slip, 1.0, 0.05)[:, np.newaxis]
    return volts, slip


def write(path, seed, **changes):
    volts, slip = arrays(seed)
    np.savez(path, **{'volts': volts, 'slip': slip, 'sample_rate_hz': 380.0, **changes})
    return path


def test_an_evaluation_is_the_replay_of_the_rows_of_the_file(tmp_path):
    evaluated = evaluate_recording(LOADER, write(tmp_path / 'a.npz', 0))
    outcome = Replay(CHAIN).run([Samples.evenly(arrays(0)[0], 380.0, arrays(0)[1])], 380.0)
    assert figures_of_merit([evaluated.outcome]) == figures_of_merit([outcome])
    assert evaluated.outcome.slips == outcome.slips
    assert evaluated.observer is None


def test_one_recording_leaves_nothing_behind_for_the_next(tmp_path):
    paths = [write(tmp_path / f'{seed}.npz', seed) for seed in range(2)]

    def slips(paths):
        return [evaluate_recording(LOADER, path).outcome.slips for path in paths]

    assert slips(reversed(paths)) == slips(paths)[::-1]


class Rows:
    def __init__(self, labelled):
        self.sample_rate_hz, self.volts = labelled.sample_rate_hz, []

    def add(self, volts, result, truth):
        self.volts.append(volts)


def test_an_observer_is_made_of_the_opened_recording_and_shown_its_rows(tmp_path):
    observer = evaluate_recording(LOADER, write(tmp_path / 'a.npz', 0), Rows).observer
    assert observer.sample_rate_hz == 380.0
    np.testing.assert_array_equal(np.concatenate(observer.volts), arrays(0)[0])


def test_figures_of_several_recordings_count_all_that_was_met_in_them(tmp_path):
    volts, _ = arrays(1)
    volts[5:8, 1] = np.nan
    paths = [write(tmp_path / 'a.npz', 0), write(tmp_path / 'b.npz', 1, volts=volts)]
    several = [evaluate_recording(LOADER, path) for path in paths]
    figures = recording_figures(several)
    assert (figures['rows'], figures['slips'], figures['bad_samples']) == (1600, 4, 3)
    others = ('gaps', 'bridged_rows', 'long_gaps', 'dropped')
    assert {figures[name] for name in others} == {0}
