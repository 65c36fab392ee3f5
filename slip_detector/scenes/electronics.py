"""From loads to volts: baselines, sensitivities, noise and rails of the 16 channels."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.config import ParameterSet, parameter
from slip_detector.fingertip import GROUPS, N_CHANNELS

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Electronics(ParameterSet):
    """One fingertip; its channels differ as those of a real one, drawn from its own seed."""

    fingertip_seed: int = parameter(
        1, 'Seed of the differences between channels: one seed is one fingertip.', low=0
    )
    baseline_v: tuple[float, float] = parameter(
        (4.3, 4.35), 'Range of the voltages without contact.', unit='V', low=-100.0, high=100.0
    )
    normal_v_n: float = parameter(
        -10.0, 'Sensitivity to normal load.', unit='V/N', low=-1e6, high=1e6
    )
    shear_v_n: float = parameter(
        3.0,
        'Sensitivity to shear load of the units across the finger (groups T).',
        unit='V/N',
        low=-1e6,
        high=1e6,
    )
    shear_along_share: float = parameter(
        0.5, 'Share of it that the units along the finger (groups L) feel.', low=0.0, high=1.0
    )
    spread: float = parameter(
        0.1, 'Standard deviation of the sensitivities, as a share of them.', low=0.0, high=1.0
    )
    noise_v: float = parameter(
        0.5e-3, 'Standard deviation of the noise of a sample.', unit='V', low=0.0, high=100.0
    )
    rails_v: tuple[float, float] = parameter(
        (0.0, 5.0), 'Lowest and highest voltage there is.', unit='V', low=-1000.0, high=1000.0
    )

    def __post_init__(self) -> None:
        """Check that ranges are the right way round."""
        super().__post_init__()
        for name in ('baseline_v', 'rails_v'):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(
                    f'parameter {name} is [{low:g}, {high:g}] V, allowed: low below high'
                )


class Frontend:
    """The electronics of one fingertip.

    Parameters
    ----------
    electronics
        Its properties.
    noise
        Generator of the samples' noise.
    """

    def __init__(self, electronics: Electronics, noise: np.random.Generator) -> None:
        self._electronics, self._noise = electronics, noise
        of_fingertip = np.random.default_rng(electronics.fingertip_seed)
        self._baseline_v = of_fingertip.uniform(*electronics.baseline_v, N_CHANNELS)
        varied = 1 + electronics.spread * of_fingertip.standard_normal((2, N_CHANNELS))
        across = np.full(N_CHANNELS, electronics.shear_along_share)
        across[[channel - 1 for channel in GROUPS['TP'] + GROUPS['TD']]] = 1.0
        self._normal_v_n = electronics.normal_v_n * varied[0]
        self._shear_v_n = electronics.shear_v_n * across * varied[1]

    def volts(self, loads_n: Floats, shear_n: Floats | None) -> Floats:
        """Return a row of volts for each row of loads.

        Parameters
        ----------
        loads_n : ndarray, shape (n, 16)
            Normal load of each taxel.
        shear_n : ndarray, shape (n, 16), or None
            Shear load of each taxel, if the scene has any.
        """
        volts = self._baseline_v + self._normal_v_n * loads_n
        if shear_n is not None:
            volts += self._shear_v_n * shear_n
        if self._electronics.noise_v:
            volts += self._electronics.noise_v * self._noise.standard_normal(volts.shape)
        return np.asarray(np.clip(volts, *self._electronics.rails_v), dtype=np.float64)
