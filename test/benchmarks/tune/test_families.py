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

"""Families of scenes on which the tuner is measured."""

import numpy as np

from benchmarks.tune import families
from slip_detector.evaluation.labelled_rows import SLIP


def test_the_families_are_what_their_names_say():
    by_name = families.families()
    assert list(by_name) == [
        'plates', 'plates, tremor and hum', 'taps and rolling between slips',
        'tremor, hum, taps and drift',
    ]  # fmt: skip
    periods = [
        [scene['texture']['spatial_period_m'] for scene in family] for family in by_name.values()
    ]
    assert periods == [[400e-6, 440e-6, 480e-6]] * 4
    assert all('tremor' in scene and 'hum' in scene for scene in list(by_name.values())[1])
    for scene in by_name['tremor, hum, taps and drift']:
        assert {'tremor', 'hum', 'taps'} <= set(scene)
        assert scene['electronics']['drift_v'] == families.DRIFT_V
    (track,) = families.play_scenes(list(by_name.values())[2][:1], [0])
    between = np.flatnonzero(track.kinds == SLIP)
    for tap_s in (*families.TAPS_S, families.ROLLING_S):
        assert not between[0] <= tap_s * 380.0 <= between[-1]


def test_what_is_reported_is_not_what_is_tuned_on():
    assert not set(families.TUNED_ON) & set(families.REPORTED_ON)
