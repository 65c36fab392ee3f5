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

"""Scenes and recordings as sources: samples that are played."""

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.parameters import DriverConfig, refuse
from slip_detector.recordings import open_recording
from slip_detector.scenes import find_scene, load_scene
from slip_detector.sources.source import Source


class RecordingSource(Source):
    """A recording, with its samples as they were recorded; it is read in pieces."""

    def __init__(self, config: DriverConfig) -> None:
        if not config.recording:
            raise ValueError("parameter recording is '', allowed: a path, as source is recording")
        recording = open_recording(config.recording, config)
        super().__init__(config.recording, recording.channel_names, recording.sample_rate_hz)
        self._recording, self._pieces = recording, recording.rows()
        self._next = next(self._pieces)
        self._first_ns = int(self._next.stamps_ns[0])

    @property
    def damage(self) -> str:
        """One line on what could not be read so far; empty if all could."""
        return self._recording.counts.damage

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples; fewer only at the end."""
        samples = self._next
        while len(samples.volts) < n and (piece := next(self._pieces, None)) is not None:
            samples = samples.then(piece)
        self._next = samples.take(slice(n, None))
        now = samples.take(slice(n))
        return now._replace(stamps_ns=now.stamps_ns - self._first_ns)

    def close(self) -> None:
        """Close the file."""
        self._pieces.close()


class SceneSource(Source):
    """A scene; each sample has its time in it.

    Parameters
    ----------
    config
        The driver's parameters, which name the scene and the seed of its noise.
    repetition
        How many times the scene was played before; this number is added to the seed.
    """

    def __init__(self, config: DriverConfig, repetition: int = 0) -> None:
        trial = np.random.default_rng(config.seed + repetition)
        self._scene = scene = load_scene(find_scene(config.scene), trial)
        super().__init__(f'scene {config.scene}', scene.channel_names, scene.sample_rate_hz)
        self.has_object = 'object' in scene.parts
        self.takes_orders = 'orders' in scene.parts
        if config.wait_for_grip and not self.has_object:
            what = f'parameter scene is {config.scene!r}'
            refuse(what, 'a scene with an object, as wait_for_grip is true')
        self.duration_s = scene.duration_s

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples; fewer only at the end."""
        return self._scene.read(n)

    def obey(self, command: float | str) -> None:
        """Hold the object with another grip force, or do something else, from the next sample on.

        See :meth:`.Scene.hold_force` and :meth:`.Scene.order`.
        """
        if isinstance(command, str):
            self._scene.order(command)
        else:
            self._scene.hold_force(command)
