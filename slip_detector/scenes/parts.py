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

"""The parts that a scene file can have, by their names."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from slip_detector.parameters.conversion import shown, shown_name
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet
from slip_detector.scenes.contact import Contact
from slip_detector.scenes.electronics import Electronics
from slip_detector.scenes.faults import Clock, Drops, Faults
from slip_detector.scenes.free_object import FreeObject
from slip_detector.scenes.friction import Friction, Skin
from slip_detector.scenes.hum import Hum
from slip_detector.scenes.motion import Motion
from slip_detector.scenes.rolling import Rolling
from slip_detector.scenes.taps import Taps
from slip_detector.scenes.texture import Roughness, Texture
from slip_detector.scenes.tremor import Tremor

#: The class of each part. The order must not change: each part draws from the generator that is
#: spawned for its position.
PARTS: dict[str, type[ParameterSet]] = {
    'motion': Motion,
    'contact': Contact,
    'skin': Skin,
    'friction': Friction,
    'texture': Texture,
    'roughness': Roughness,
    'object': FreeObject,
    'electronics': Electronics,
    'hum': Hum,
    'tremor': Tremor,
    'taps': Taps,
    'rolling': Rolling,
    'faults': Faults,
    'drops': Drops,
    'clock': Clock,
}


@dataclasses.dataclass(frozen=True)
class Sampling(ParameterSet):
    """The parameters of a scene file beside its steps and parts.

    Examples
    --------
    >>> Sampling(sample_rate_hz=1000).step_s
    0.00035
    """

    sample_rate_hz: float = parameter(380.0, 'Rate of the samples.', unit='Hz', low=1.0, high=1e6)
    step_s: float = parameter(
        3.5e-4,
        'Longest step of the integrator; each sample period has a whole number of equal steps.',
        unit='s',
        low=1e-7,
        high=1.0,
    )


#: Names in a scene file that are not parts.
NOT_PARTS = ('steps', *(field.name for field in dataclasses.fields(Sampling)))


def read_sampling(description: Mapping[str, Any]) -> Sampling:
    """Read the sampling of a scene.

    Raises
    ------
    ValueError
        For a value that is not allowed; names the parameter.

    Examples
    --------
    >>> read_sampling({'steps': [{}], 'sample_rate_hz': 1000}).sample_rate_hz
    1000.0
    """
    names = [field.name for field in dataclasses.fields(Sampling)]
    return Sampling.from_parameters({key: description[key] for key in names if key in description})


def read_parts(description: Mapping[str, Any]) -> dict[str, Any]:
    """Read the parts of a scene.

    ``friction: none`` means no friction, ``friction: coulomb`` that model with its defaults.

    Parameters
    ----------
    description
        The content of a scene file.

    Returns
    -------
    dict
        The parts by their names, each an object of its class in :data:`PARTS`.

    Raises
    ------
    ValueError
        For an unknown part or a value that is not allowed; names the part and the parameter.

    Examples
    --------
    >>> from slip_detector.scenes.parts import read_parts
    >>> read_parts({'steps': [{}], 'friction': 'none', 'clock': {'rate_ratio': 0.99}})
    {'clock': Clock(rate_ratio=0.99)}
    """
    parts: dict[str, Any] = {}
    for name, content in description.items():
        if name in NOT_PARTS:
            continue
        if name not in PARTS:
            known = ', '.join((*NOT_PARTS, *PARTS))
            raise ValueError(f'unknown part {shown_name(name)}, allowed: {known}')
        if name == 'friction' and content == 'none':
            continue
        values = {'model': content} if name == 'friction' and isinstance(content, str) else content
        if not isinstance(values, Mapping | None):
            raise ValueError(f'{name} is {shown(values)}, allowed: names and values')
        parts[name] = PARTS[name].from_parameters(values or {}, name)
    return parts
