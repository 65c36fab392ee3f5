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

"""Where samples come from: scenes, recordings, serial ports and UDP, behind one interface."""

import time
from collections.abc import Callable

from slip_detector.parameters import DriverConfig
from slip_detector.sources.source import Source

__all__ = ['Source', 'open_source']


def open_source(
    config: DriverConfig, repetition: int = 0, now_ns: Callable[[], int] = time.time_ns
) -> Source:
    """Open the source that the driver's parameters name.

    Parameters
    ----------
    config
        The driver's parameters.
    repetition
        How many times the source was played before; a scene has different noise each time.
    now_ns
        The clock for the stamps of a live source, in nanoseconds.

    Raises
    ------
    ValueError
        When a parameter is missing or wrong, or a scene or recording cannot be opened; names it.

    Examples
    --------
    >>> from slip_detector.parameters import DriverConfig
    >>> source = open_source(DriverConfig(source='scene', scene='flat_plate', seed=1))
    >>> source.is_live, source.has_object, source.sample_rate_hz
    (False, False, 380.0)
    >>> source.read(5).volts.shape
    (5, 16)
    """
    # Each source is imported only where it is used: the simulation and pyserial take time to load.
    if config.source in ('serial', 'udp'):
        from slip_detector.sources import live

        source = live.SerialSource if config.source == 'serial' else live.UdpSource
        return source(config, now_ns)
    from slip_detector.sources import played

    if config.source == 'recording':
        return played.RecordingSource(config)
    if config.source == 'scene':
        return played.SceneSource(config, repetition)
    raise ValueError('parameter source is not given, allowed: scene, recording, serial or udp')
