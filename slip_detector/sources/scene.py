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

from slip_detector.chain.samples import Samples
from slip_detector.parameters.driver import DriverConfig
from slip_detector.scenes import find_scene, load_scene
from slip_detector.sources.source import Source


class SceneSource(Source):
    """A scene; each sample has the time at which the scene's clock takes it.

    Parameters
    ----------
    config
        The driver's parameters, which name the scene and the seed of its noise.
    repetition
        How many times the scene was played before; this number is added to the seed.

    Attributes
    ----------
    duration_s : float
        How long the scene lasts.

    Raises
    ------
    ValueError
        When there is no such scene, its file is wrong, or it has no object although
        ``wait_for_grip`` needs one; names it.

    Examples
    --------
    >>> from slip_detector.parameters.driver import DriverConfig
    >>> source = SceneSource(DriverConfig(scene='grasp'))
    >>> source.name, source.has_object
    ('scene grasp', True)
    >>> source.hold_force(3.0)
    >>> source.read(2).stamps_ns.tolist()
    [0, 2631579]
    """

    def __init__(self, config: DriverConfig, repetition: int = 0) -> None:
        trial = np.random.default_rng(config.seed + repetition)
        self._scene = scene = load_scene(find_scene(config.scene), trial)
        super().__init__(f'scene {config.scene}', scene.channel_names, scene.sample_rate_hz)
        self.has_object = 'object' in scene.parts
        if config.wait_for_grip and not self.has_object:
            raise ValueError(
                f'parameter scene is {config.scene!r}, allowed with wait_for_grip: a scene with '
                'an object'
            )
        self.duration_s = scene.duration_s

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples, fewer where some are lost, none only after the end."""
        samples = self._scene.read(n)
        stamps_ns = np.rint(samples.time_s * 1e9).astype(np.int64)
        return Samples(samples.volts, stamps_ns, samples.truth, samples.position_m)

    def hold_force(self, force_n: float) -> None:
        """Hold the object with another grip force from the next sample on."""
        if not self.has_object:
            super().hold_force(force_n)
        self._scene.hold_force(force_n)
