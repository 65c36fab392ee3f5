"""How the normal force spreads over the taxels."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.config import ParameterSet, parameter

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Contact(ParameterSet):
    """Hertz contact of a round fingertip with a plate."""

    radius_at_1n_m: float = parameter(
        5.4e-3,
        'Contact radius at 1 N; grows with the cube root of the force.',
        unit='m',
        low=1e-5,
        high=1.0,
    )
    centre_m: tuple[float, float] = parameter(
        (0.0, 0.0), 'Where the fingertip touches: x, y.', unit='m', low=-1.0, high=1.0
    )
    taxel_area_m2: float = parameter(
        1.39e-6, 'Area whose pressure a taxel feels.', unit='m2', low=1e-12, high=1.0
    )

    def loads_n(self, force_n: Floats, positions_m: Floats) -> Floats:
        """Return the normal load of each taxel under each normal force.

        Hertz: p(r) = 3 F / (2 pi a^2) sqrt(1 - r^2 / a^2), a^3 proportional to F.

        Parameters
        ----------
        force_n : ndarray, shape (n,)
            Not negative.
        positions_m : ndarray, shape (c, 2)
            Where the taxels are.

        Returns
        -------
        ndarray, shape (n, c)
            Newtons; zero outside the contact.
        """
        distance = np.hypot(*(positions_m - np.array(self.centre_m)).T)
        squared = np.square(self.radius_at_1n_m) * np.maximum(force_n, 1e-12) ** (2 / 3)
        inside = np.maximum(1.0 - np.square(distance) / squared[:, np.newaxis], 0.0)
        peak = 1.5 * force_n / (np.pi * squared)
        return np.asarray(peak[:, np.newaxis] * np.sqrt(inside) * self.taxel_area_m2)
