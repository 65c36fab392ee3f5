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

"""Labels by late hands are moved before a search, and what is not found is not called exact."""

import numpy as np
import pytest

from slip_detector.chain.samples import Samples
from slip_detector.recordings.labels import label_at
from slip_detector.tuning.hand_labels import snap_labels
from slip_detector.tuning.tracks import track_of

RATE_HZ = 380.0


def slid(name, late_s, accuracy_s=0.35, changes=True):
    """Return a recording that slides from 2 s to 4 s, labelled late."""
    volts = np.random.default_rng(len(name)).normal(size=(round(6 * RATE_HZ), 4))
    at_ns = Samples.evenly(volts, RATE_HZ, volts[:, 0]).stamps_ns
    volts[(at_ns >= 2_000_000_000) & (at_ns < 4_000_000_000)] *= 6.0 if changes else 1.0
    edges_ns = np.rint(1e9 * (np.array([2.0, 4.0]) + late_s)).astype(np.int64)
    label = label_at(at_ns, edges_ns, accuracy_s)
    return track_of(name, [Samples(volts, at_ns, **label, accuracy_s=accuracy_s)], RATE_HZ)


def test_each_label_is_where_the_power_changes_and_as_exact_as_what_was_found():
    late, unknown, exact = slid('late', 0.3), slid('none', 0.2, changes=False), slid('x', 0.2, 0.1)
    tracks, sentences = snap_labels([late, unknown, exact])
    assert tracks[0].slips[0] == pytest.approx((760, 1520), abs=4)
    certain = np.flatnonzero(~tracks[0].samples.certain) / RATE_HZ
    assert np.abs(certain - np.where(certain < 3.0, 2.0, 4.0)).max() < 0.12
    assert [track.samples.accuracy_s for track in tracks] == [0.1, 0.35, 0.1]
    assert tracks[1].slips == unknown.slips
    np.testing.assert_array_equal(tracks[1].samples.certain, unknown.samples.certain)
    assert tracks[2] is exact
    assert sentences[0].startswith('late: start 2.30 -> 2.0')
    assert sentences[1:] == ['none: none of 2 ends is known; ± 0.35 s']


def test_hands_later_than_was_said_are_told_the_accuracy_that_fits():
    *_, said = snap_labels([slid('a', 0.52), slid('b', 0.3), slid('c', 0.2)])[1]
    assert said.startswith('1 of 3 labels by hand were off by up to 0.5')
    assert said.endswith(' s: accuracy_s: 0.6 fits')
    assert len(snap_labels([slid('a', 0.3), slid('b', 0.3)])[1]) == 2
