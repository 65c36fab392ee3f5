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

"""Who looks at the page, as the benchmark counts it."""

import threading
import time

import pytest

from benchmarks.view.onlookers import NoViewer, Onlooker, frames_a_second
from support.simulated_detectors import SimulatedDetectors, served_beside

#: Seconds, on however busy a machine.
PATIENCE_S = 60.0


def wait_for(onlooker, enough):
    """Return what was drawn until it is enough."""
    end_s, taken = time.monotonic() + PATIENCE_S, []
    while not enough(taken):
        assert time.monotonic() < end_s
        onlooker.is_drawing()
        taken += onlooker.drawn_ms()
        threading.Event().wait(0.01)
    return taken


def test_frames_are_counted_by_the_second():
    steady = [k * 1000 / 30 for k in range(91)]
    assert frames_a_second(steady) == (pytest.approx(30.0), 30.0)
    assert frames_a_second([*steady, 4000.0]) == (pytest.approx(91 / 4), 1.0)
    assert frames_a_second([]) == frames_a_second([1.0]) == (0.0, 0.0)


def test_an_onlooker_takes_frames_of_all_fingers_until_it_is_ended():
    with (
        served_beside(SimulatedDetectors(('index', 'thumb'))) as served,
        Onlooker(served.url, 2) as onlooker,
    ):
        drawn = wait_for(onlooker, lambda taken: len(taken) >= 3)
        assert drawn == sorted(drawn)
        assert served.detectors.watched == {'/index/slip_detector', '/thumb/slip_detector'}


def test_a_page_that_cannot_be_reached_is_told():
    with (
        Onlooker('http://127.0.0.1:9/', 1) as onlooker,
        pytest.raises(RuntimeError, match='the page cannot be looked at: '),
    ):
        wait_for(onlooker, lambda taken: False)


def test_fingers_that_are_not_part_of_the_measurement_are_told():
    with (
        served_beside(SimulatedDetectors(('index', 'thumb'))) as served,
        Onlooker(served.url, 1) as onlooker,
        pytest.raises(RuntimeError, match='/thumb/slip_detector are there, wanted 1'),
    ):
        wait_for(onlooker, lambda taken: False)


def test_nobody_draws_nothing():
    assert NoViewer().is_drawing()
    assert NoViewer().drawn_ms() == []
    assert NoViewer().heap_mib() is None
