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

"""A simulated scene as a source."""

import numpy as np
import pytest

from slip_detector.parameters.driver import DriverConfig
from slip_detector.parameters.shared_folder import shared_folder
from slip_detector.scenes import find_scene, load_scene
from slip_detector.sources import open_source
from slip_detector.sources.scene import SceneSource


def test_a_source_gives_what_its_scene_gives_stamped_by_the_scenes_clock():
    mine = SceneSource(DriverConfig(scene='plate_480um', seed=3)).read(600)
    wanted = load_scene(find_scene('plate_480um'), np.random.default_rng(3)).read(600)
    np.testing.assert_array_equal(mine.volts, wanted.volts)
    np.testing.assert_array_equal(mine.truth, wanted.truth)
    np.testing.assert_array_equal(mine.position_m, wanted.position_m)
    np.testing.assert_array_equal(mine.stamps_ns, np.rint(wanted.time_s * 1e9))


def test_an_object_is_held_with_the_force_that_was_set():
    firm, loose = (
        SceneSource(DriverConfig(scene='grasp')),
        SceneSource(DriverConfig(scene='grasp')),
    )
    assert firm.has_object
    firm.hold_force(5.0)
    loose.hold_force(0.5)
    moved_m = [source.read(10_000).position_m for source in (firm, loose)]
    assert np.ptp(moved_m[0]) < np.ptp(moved_m[1])
    with pytest.raises(ValueError, match='allowed: 0 to 1000 N'):
        firm.hold_force(-1.0)


def test_a_scene_without_an_object_does_not_wait_for_a_grip():
    words = "scene is 'plate_400um', allowed with wait_for_grip: a scene with an object"
    with pytest.raises(ValueError, match=words):
        SceneSource(DriverConfig(scene='plate_400um', wait_for_grip=True))
    assert SceneSource(DriverConfig(scene='grasp', wait_for_grip=True)).has_object


def test_a_scene_is_one_trial_per_seed_and_another_with_each_repetition():
    def volts(seed, repetition):
        return (
            open_source(DriverConfig(source='scene', seed=seed), repetition)
            .read(50)
            .volts.tobytes()
        )

    assert volts(3, 0) == volts(3, 0)
    assert volts(3, 0) != volts(3, 1)
    assert volts(3, 0) != volts(4, 0)


def test_a_scene_with_losses_says_when_the_samples_that_are_left_were_taken(tmp_path):
    path = tmp_path / 'lossy.yaml'
    path.write_text(
        'steps: [{duration_s: 2.0}]\ndrops: {share: 0.1}\nclock: {rate_ratio: 0.5}\n'
        'sample_rate_hz: 100.0\n'
    )

    def stamps_ns(repetition):
        source = open_source(DriverConfig(source='scene', scene=str(path)), repetition)
        assert source.sample_rate_hz == 100.0  # So it says; its clock runs at half of it.
        return source.read(1000).stamps_ns

    taken_ns = stamps_ns(0)
    assert 70 < len(taken_ns) < 100
    assert np.all(np.isin(taken_ns, np.arange(100) * 20_000_000))
    assert np.all(np.diff(taken_ns) > 0)
    assert taken_ns.tobytes() == stamps_ns(0).tobytes()
    assert taken_ns.tobytes() != stamps_ns(1).tobytes()


def test_every_scene_of_the_package_opens_and_gives_samples():
    scenes = sorted((shared_folder() / 'config' / 'scenes').glob('*.yaml'))
    assert scenes
    for scene in scenes:
        source = open_source(DriverConfig(source='scene', scene=scene.stem))
        assert source.read(10).volts.shape == (10, len(source.channel_names))
