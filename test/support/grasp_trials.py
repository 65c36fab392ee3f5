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

"""Trials of a grasp made by hand: what happened in them is known."""

import numpy as np

from slip_detector.grasp.loop import AT_LIMIT, CONTROLLER, PAPER, UNCONTROLLED, GraspTrial

LENGTH_M = 0.1


def trial(slide_m=0.001, force_n=4.0, onset_row=50):
    """Return 100 samples at 10 Hz: held from 2 s on, slipping from one row for five."""
    rows = np.arange(100)
    slip = (rows >= onset_row) & (rows < onset_row + 5)
    return GraspTrial(
        time_s=rows / 10.0,
        command_n=np.full(100, force_n),
        force_n=np.full(100, force_n),
        slip=slip,
        sliding=slip,
        position_m=np.clip((rows - onset_row) / 5.0, 0.0, 1.0) * slide_m,
        needed_n=np.where(rows >= 20, 3.0, 0.0),
        length_m=LENGTH_M,
    )


def by_condition():
    """Return one trial of each condition; without a controller the object is dropped."""
    return {
        UNCONTROLLED: [trial(LENGTH_M, 1.8)],
        AT_LIMIT: [trial(1e-5, 10.0)],
        CONTROLLER: [trial(5e-4, 4.0)],
        PAPER: [trial(3e-3, 8.0)],
    }
