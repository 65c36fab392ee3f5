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

"""Reports for the tests: a recording with a slip that is found, one missed, late ones, alarms."""

import numpy as np

from slip_detector.chain.slip_chain import SlipChain
from slip_detector.evaluation.evaluator import recording_figures
from slip_detector.evaluation.replay import Replay
from slip_detector.parameters.detector import ChainConfig
from slip_detector.report.overview import Event, Overview
from slip_detector.report.page import Variant

GIVEN = ChainConfig()
TUNED = ChainConfig(passband_hz=(10.0, 60.0), stopbands_hz=(), threshold=1.0, vote='mean')

#: Seconds of true slip in each recording.
SLIPS_S = ((4.0, 5.0), (9.0, 10.0), (15.0, 16.0))

EVENTS = {
    'given': [
        Event('false alarm', 2.0, 2.2),
        Event('detected', 4.0, 5.0, 0.04, {'filter': 0.012, 'vote': 0.028}),
        Event('missed', 9.0, 10.0, note='lost at: vote'),
        Event('late', 15.0, 16.0, 0.4, {'filter': 0.012, 'vote': 0.388}),
    ],
    'tuned': [Event('detected', *slip_s, 0.02) for slip_s in SLIPS_S],
}


#: The outcome of a recording without rows.
NOTHING = Replay(GIVEN).run([])


def volts_and_truth(rows=380 * 20, channels=16, seed=0):
    """Return noise with a 25 Hz burst in each slip and a short one at 2 s."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(rows) / 380.0
    truth = np.zeros(rows, bool)
    for start, stop in SLIPS_S:
        truth |= (time_s >= start) & (time_s < stop)
    loud = truth | ((time_s >= 2.0) & (time_s < 2.1))
    burst = 0.02 * np.sin(2 * np.pi * 25.0 * time_s) * loud
    noise = 2e-4 * rng.standard_normal((rows, channels))
    return 4.0 + 0.01 * np.arange(channels) + burst[:, None] + noise, truth


def overview(name, config, volts, truth, events=()):
    made = Overview(name, config)
    made.add(volts, SlipChain(config).update(volts), truth)
    made.finish(NOTHING)
    made.events = events
    return made


def variants(names=('a.npz', 'b.npz')):
    """Return the two variants of a report of some recordings, the given and the tuned."""
    found = []
    for name, config, missed, median_ms in (
        ('given', GIVEN, 1, 34.5678),
        ('tuned', TUNED, 0, None),
    ):
        seen = [
            overview(file, config, *volts_and_truth(seed=i), EVENTS[name])
            for i, file in enumerate(names)
        ]
        # As many figures as there may be.
        figures = dict.fromkeys(recording_figures([]), 12.5) | {'latency_accuracy_ms': 0.0}
        figures |= {'slips': 3, 'missed': missed, 'latency_median_ms': median_ms}
        rows = dict.fromkeys(('all recordings', *names), figures)
        found.append(Variant(name, seen, rows))
    return found
