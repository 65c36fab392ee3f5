"""A scene: the parts that a YAML file names, put together and played row by row."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector import fingertip
from slip_detector.config import ParameterSet, parameter, read_yaml
from slip_detector.scenes.contact import Contact
from slip_detector.scenes.electronics import Electronics, Frontend
from slip_detector.scenes.friction import Friction
from slip_detector.scenes.motion import Motion, Platform, steps_from
from slip_detector.scenes.texture import Texture
from slip_detector.sources import Samples

PARTS: dict[str, type[ParameterSet]] = {
    'motion': Motion,
    'contact': Contact,
    'friction': Friction,
    'texture': Texture,
    'electronics': Electronics,
}


@dataclasses.dataclass(frozen=True)
class Sampling(ParameterSet):
    """What a scene file says of itself."""

    sample_rate_hz: float = parameter(380.0, 'Rate of the samples.', unit='Hz', low=1.0, high=1e6)


class Scene:
    """A fingertip on a plate; a :class:`~slip_detector.sources.Source`.

    Parts that are not named are not computed: without ``friction`` there is no shear load, and
    without ``texture`` the plate is smooth.

    Parameters
    ----------
    description
        As the scene file has it: ``sample_rate_hz``, ``steps`` and the parts.
    noise
        Generator of the noise; one state of it is one trial.

    Raises
    ------
    ValueError
        For an unknown part or a value that is not allowed; names the part and the parameter.
    """

    def __init__(self, description: Mapping[str, Any], noise: np.random.Generator) -> None:
        parts: dict[str, Any] = {}
        for name, content in description.items():
            if name in ('steps', 'sample_rate_hz'):
                continue
            if name not in PARTS:
                raise ValueError(f'unknown part {name}, allowed: steps, {", ".join(PARTS)}')
            if not isinstance(content, Mapping | None):
                raise ValueError(f'{name} is {content!r}, allowed: names and values')
            parts[name] = PARTS[name].from_parameters(content or {}, name)
        rate = description.get('sample_rate_hz', 380.0)
        self.sample_rate_hz = Sampling(sample_rate_hz=rate).sample_rate_hz
        self.channel_names = tuple(f'ch{i + 1}' for i in range(fingertip.N_CHANNELS))
        steps = steps_from(description.get('steps'))
        self._platform = Platform(parts.get('motion', Motion()), steps, self.sample_rate_hz)
        self._contact = parts.get('contact', Contact())
        self._friction: Friction | None = parts.get('friction')
        self._texture: Texture | None = parts.get('texture')
        self._frontend = Frontend(parts.get('electronics', Electronics()), noise)
        self._positions_m = fingertip.taxel_positions()
        self._shear_n = np.zeros(fingertip.N_CHANNELS)
        self._plate_m = 0.0
        self._next = 0
        self.length = round(self._platform.duration_s * self.sample_rate_hz)
        if not self.length:
            raise ValueError(
                f'steps: all take {self._platform.duration_s:g} s, allowed: at least one sample '
                f'at {self.sample_rate_hz:g} Hz'
            )

    def read(self, n: int) -> Samples:
        """Return the next ``n`` samples, fewer at the end of the scene."""
        index = np.arange(self._next, min(self._next + n, self.length))
        self._next += len(index)
        time_s = index / self.sample_rate_hz
        force_n = self._platform.force_n(time_s)
        plate_m = self._platform.position_m(time_s)
        loads_n = self._contact.loads_n(force_n, self._positions_m)
        shear_n = None
        slid_m = plate_m[:, np.newaxis]
        if self._friction:
            moved_m = np.diff(plate_m, prepend=self._plate_m)
            shear_n = self._friction.shear_n(self._shear_n, moved_m, loads_n)
            slid_m = slid_m - shear_n / self._friction.shear_stiffness_n_m
        if len(index):
            self._plate_m = float(plate_m[-1])
        if self._texture:
            loads_n = loads_n * self._texture.modulation(slid_m, self._positions_m)
        # The paper's Eq. 9: slip is what the platform's position says.
        moving = self._platform.velocity_m_s(time_s) != 0.0
        return Samples(self._frontend.volts(loads_n, shear_n), moving & (force_n > 0.0), plate_m)


def load_scene(path: str | Path, noise: np.random.Generator) -> Scene:
    """Build the scene of a YAML file.

    Raises
    ------
    ValueError
        When the file cannot be read or describes no scene; names the file.
    """
    try:
        return Scene(read_yaml(path), noise)
    except ValueError as error:
        text = str(error)
        raise ValueError(text if text.startswith(str(path)) else f'{path}: {text}') from None
