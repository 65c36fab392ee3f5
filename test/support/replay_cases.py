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

"""Ridges for a quick chain of four channels, and how two outcomes are compared."""

import dataclasses

import numpy as np

from slip_detector.parameters.detector import ChainConfig

RATE_HZ = 400.0
CONFIG = ChainConfig(
    sample_rate_hz=RATE_HZ,
    channels=4,
    groups={'a': (1, 2), 'b': (3, 4)},
    passband_hz=(20.0, 100.0),
    stopbands_hz=(),
    gain=1.0,
    envelope_window_s=0.02,
    decision_window_s=0.02,
    threshold=0.3,
)


def plain(outcome):
    """Return an outcome as something that can be compared."""
    scores, events = outcome.scores, outcome.events
    rest = dataclasses.replace(outcome, scores=None, events=None)
    return rest, scores.bins.tolist(), scores.counts.tolist(), events.at()


def ridges(*bursts):
    """Return 2000 rows with ridges from row to row, and their label."""
    volts = 1e-3 * np.random.default_rng(0).normal(size=(2000, 4))
    truth = np.zeros(2000, bool)
    time_s = np.arange(2000) / RATE_HZ
    for start, end in bursts:
        volts[start:end] += 2.0 * np.sin(2 * np.pi * 50.0 * time_s[start:end, np.newaxis])
        truth[start:end] = True
    return volts, truth
