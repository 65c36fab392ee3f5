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

"""The control law of a grip, whatever the detector says and whenever it says it."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.grasp.law import GraspLaw
from slip_detector.parameters.grasp import GraspConfig

TICK_S = 0.01

configs = st.builds(
    lambda grip_n, more_n, **rest: GraspConfig(grip_n=grip_n, limit_n=grip_n + more_n, **rest),
    grip_n=st.floats(0.1, 5.0),
    more_n=st.floats(0.0, 20.0),
    step_factor=st.floats(1.01, 3.0),
    step_n=st.floats(0.0, 2.0),
    repeat_s=st.floats(0.0, 0.5),
    relax_after_s=st.floats(0.0, 2.0),
    relax_n_s=st.floats(0.0, 5.0),
    closing_n_s=st.floats(0.1, 50.0),
    settle_s=st.floats(0.0, 0.5),
    on_invalid=st.sampled_from(['hold', 'open']),
)

#: What is heard one after the other: time since the last, slip, valid.
heard = st.lists(
    st.tuples(st.floats(0.0, 2.0), st.booleans(), st.sampled_from([True, True, True, False])),
    max_size=60,
)


def forces(law, entries):
    """Return the force before the first and after each of the entries."""
    return [law.force_n, *(law.update(*entry) for entry in entries)]


def closed(config):
    """Return a law whose grip has closed and settled without slip."""
    law = GraspLaw(config)
    while law.force_n < config.grip_n:
        law.update(TICK_S, False, True)
    law.update(config.settle_s, False, True)
    return law


@given(configs, heard)
def test_the_force_is_within_its_limits_and_never_sinks_while_it_slips(config, entries):
    found = forces(GraspLaw(config), entries)
    assert min(found) == 0.0
    assert max(found) <= config.limit_n
    for (_, slip, valid), before, after in zip(entries, found[:-1], found[1:], strict=True):
        assert not (slip and valid) or after >= before


@given(configs, heard)
def test_a_grip_that_has_closed_is_never_below_its_least_while_slip_is_valid(config, entries):
    law = closed(config)
    for elapsed_s, slip, _ in entries:
        assert config.grip_n <= law.update(elapsed_s, slip, True) <= config.limit_n


@given(configs, heard, heard)
def test_an_invalid_slip_is_held_or_the_grip_opens_and_stays_open(config, before, after):
    law = GraspLaw(config)
    held_n = forces(law, before)[-1]
    while_invalid = [law.update(elapsed_s, slip, False) for elapsed_s, slip, _ in after]
    if config.on_invalid == 'hold':
        assert all(force_n == held_n for force_n in while_invalid)
        return
    assert while_invalid == sorted(while_invalid, reverse=True)
    assert law.update(held_n / config.closing_n_s + 1.0, True, False) == 0.0
    if held_n > 0.0:
        assert all(law.update(elapsed_s, slip, True) == 0.0 for elapsed_s, slip, _ in after)


def test_it_closes_at_its_rate_and_slip_of_the_contact_does_not_count():
    config = GraspConfig(grip_n=2.0, closing_n_s=4.0, settle_s=0.3)
    law = GraspLaw(config)
    heard = [(0.0, False, True), (0.25, True, True), (0.25, True, True), (0.29, True, True)]
    assert forces(law, heard)[1:] == pytest.approx([0.0, 1.0, 2.0, 2.0])
    assert law.update(0.02, True, True) == 2.0 * config.step_factor


def test_slip_raises_the_force_at_once_and_again_while_it_lasts():
    config = GraspConfig(
        grip_n=1.0, limit_n=5.0, step_factor=2.0, step_n=0.5, repeat_s=0.1, relax_n_s=0.0
    )
    lasting = [(0.01, True, True), (0.09, True, True), (0.02, True, True), (0.18, True, True)]
    assert forces(closed(config), lasting) == [1.0, 2.5, 2.5, 5.0, 5.0]
    # An onset that comes before the gripper has followed waits, one that comes later does not.
    law = closed(config)
    for slip in (True, False, True, False):
        assert law.update(0.01, slip, True) == 2.5
    assert law.update(0.08, True, True) == 5.0


def test_the_second_of_raises_that_follow_each_other_counts_double():
    law = closed(GraspConfig(grip_n=1.0, limit_n=900.0, step_factor=2.0, repeat_s=0.1))
    assert [law.update(0.12, True, True) for _ in range(4)] == [2.0, 8.0, 16.0, 32.0]
    # Slip that comes again later begins anew.
    assert law.update(0.04, False, True) == 32.0
    assert [law.update(0.12, True, True) for _ in range(2)] == [64.0, 256.0]


def test_it_relaxes_slowly_when_it_has_not_slipped_for_a_while():
    config = GraspConfig(
        grip_n=1.0, limit_n=9.0, step_factor=4.0, relax_after_s=1.0, relax_n_s=0.5
    )
    law = closed(config)
    law.update(0.0, True, True)
    assert law.update(0.9, False, True) == 4.0
    assert law.update(0.6, False, True) == pytest.approx(4.0 - 0.5 * 0.6)
    assert law.update(60.0, False, True) == 1.0


def test_a_grip_that_had_begun_to_open_closes_again_when_slip_is_valid():
    law = closed(GraspConfig(grip_n=2.0, closing_n_s=1.0, on_invalid='open'))
    assert law.update(0.5, False, False) == pytest.approx(1.5)
    assert law.update(0.2, False, True) == pytest.approx(1.7)
    assert law.update(4.3, False, True) == 2.0
