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

"""Scenes: what is named is built, what is not is not, and what a trial is."""

import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.scenes import Scene, find_scene, load_scene
from slip_detector.scenes.motion import ORDERS

ALL = 10**9

#: A plate that is touched at 0.1 s, pushed at 0.5 s, let go at 0.9 s.
SHORT = [
    {'duration_s': 0.1},
    {'duration_s': 0.1, 'force_n': 0.4},
    {'duration_s': 0.3},
    {'duration_s': 0.4, 'velocity_m_s': 6.7e-3},
    {'duration_s': 0.1, 'force_n': 0.0},
    {'duration_s': 0.2},
]


def built(**description):
    return Scene({'steps': SHORT, **description}, np.random.default_rng(0))


def loaded(name):
    return load_scene(find_scene(name), np.random.default_rng(0))


def test_truth_is_the_motion_of_the_platform():
    samples = loaded('plate_400um').read(ALL)
    moved = np.diff(samples.position_m) != 0.0
    before, after, truth = moved[:-1], moved[1:], samples.truth[1:-1]
    assert np.all(truth[before & after])
    assert not np.any(truth[~before & ~after])
    assert np.count_nonzero(truth) == pytest.approx(2.5 * 380, abs=20)


#: One of each part that draws from the trial's generator, and one that does not.
OPTIONAL = {
    'texture': {'ridge_height_m': 2e-5, 'harmonics': [], 'indentation_m': 1e-4},
    'tremor': {},
    'taps': {'times_s': [0.3]},
}


@pytest.mark.parametrize('left_out', OPTIONAL)
def test_leaving_one_part_out_leaves_the_noise_of_the_others(left_out):
    # No sensitivities: what is left of the volts is electronics and what disturbs them.
    neutral = {'normal_v_n': 0.0, 'shear_v_n': 0.0, 'noise_v': 1e-3, 'drift_v': 1e-3}
    others = {name: of for name, of in OPTIONAL.items() if name != left_out}
    whole, less = (built(electronics=neutral, **parts).read(ALL) for parts in (OPTIONAL, others))
    assert less.volts.tobytes() == whole.volts.tobytes()


def test_a_fingertip_that_obeys_rests_slips_and_is_tapped_and_pressed_from_the_next_sample_on():
    scene = loaded('obedient')

    scene.read(760)
    for what in ('rest', 'slip', 'rest', 'taps', 'press', 'slip', 'taps', 'rest'):
        scene.order(what)
        samples = scene.read(1520)
        # The plate is set in motion after the first sample, and comes to rest within some.
        assert samples.truth[20:].all() == samples.truth[20:].any() == (what == 'slip')
        force_n = scene.force_n(samples.stamps_ns[380:] * 1e-9)
        assert (np.ptp(force_n) > 0.3) == (what in ('taps', 'press'))
        assert (force_n.max() > 2.0) == (what == 'press')
    with pytest.raises(ValueError, match='allowed: rest, slip, taps, press'):
        scene.order('dance')
    with pytest.raises(ValueError, match="order is 'slip', allowed: with that part"):
        loaded('plate_400um').order('slip')


@pytest.fixture(scope='module')
def in_contact():
    """A fingertip that obeys, on its plate since some time."""
    (scene := loaded('obedient')).read(500)
    return scene


@given(cuts=st.lists(st.integers(1, 300), min_size=1, max_size=4), what=st.sampled_from(ORDERS))
def test_any_cut_between_two_orders_gives_the_same_bits(in_contact, cuts, what):
    def played(cuts):
        scene = copy.deepcopy(in_contact)
        scene.order(what)
        return np.concatenate([scene.read(n).volts for n in cuts])

    np.testing.assert_array_equal(played(cuts), played([sum(cuts)]))


def test_ordered_forces_and_velocities_are_checked_as_those_of_steps():
    for orders, why in (
        ({'pressed_n': [500.0]}, r'^friction: .* chatter'),
        ({'force_n': 500.0}, 'chatter'),
        ({'velocity_m_s': -0.5}, r'^texture: ridges pass'),
    ):
        with pytest.raises(ValueError, match=why):
            built(friction={}, texture={}, orders=orders)
