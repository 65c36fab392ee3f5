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

"""Fingers that are in one state each: at rest, slipping, with a dead channel, without input."""

import numpy as np

from slip_detector.view import server
from support.simulated_detectors import SimulatedDetectors

RATE_HZ = 380.0


def rest_rows(rows=380, seed=0):
    return 4.3 + 1e-4 * np.random.default_rng(seed).normal(size=(rows, 16))


def slip_rows(rows=380):
    seconds = np.arange(rows) / RATE_HZ
    return rest_rows(rows) + 0.2 * np.sin(2 * np.pi * 20.0 * seconds)[:, np.newaxis]


class QuietDetectors(SimulatedDetectors):
    """Nothing comes but what a test plays; ``heard`` False: no detector is heard."""

    heard = True

    def __init__(self, labels=('index',), **how):
        super().__init__(labels, real_time=False, **how)

    def poll(self):
        if self.heard:
            super().poll()

    def play(self, label, rows):
        """Send rows to a finger, unless it is gone."""
        simulated = self.simulated.get(f'/{label}/slip_detector')
        if simulated is not None:
            simulated.send(rows, np.zeros(len(rows), bool))


class Player:
    """Plays the same rows to a finger again and again, with each tick of the server."""

    def __init__(self, detectors, label, rows):
        self.detectors, self.label, self.rows, self.at = detectors, label, rows, 0

    def __call__(self):
        n = round(RATE_HZ * server.FRAME_S)
        self.detectors.play(self.label, self.rows[self.at : self.at + n])
        self.at = (self.at + n) % (len(self.rows) - n)


def dead_rows():
    rows = rest_rows()
    rows[:, 6] = np.nan
    return rows


#: By state the rows that bring a finger into it; None: no row comes.
STATES = {
    'rest': rest_rows(), 'slip': slip_rows(), 'dead': dead_rows(), 'none': None,
    'invalid': np.full((380, 16), np.nan),
}  # fmt: skip
