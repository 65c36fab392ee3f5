"""Skin that shears elastically and slides under Coulomb friction, taxel by taxel."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.config import ParameterSet, parameter

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Friction(ParameterSet):
    """Coulomb friction under an elastic skin."""

    coefficient: float = parameter(0.6, 'Coefficient of friction.', low=0.0, high=10.0)
    shear_stiffness_n_m: float = parameter(
        170.0, 'Shear stiffness of the skin over one taxel.', unit='N/m', low=1e-3, high=1e9
    )

    def shear_n(self, shear_n: Floats, moved_m: Floats, loads_n: Floats) -> Floats:
        """Follow the shear load of each taxel from row to row.

        Each taxel is a spring in series with a slider (the stop operator): what the plate moves
        is added to the spring until its force reaches friction times load, then it slides. The
        taxels at the edge carry the least load and slide first.

        Parameters
        ----------
        shear_n : ndarray, shape (c,)
            Shear loads before the first row; overwritten with those after the last.
        moved_m : ndarray, shape (n,)
            How far the plate has moved since the row before.
        loads_n : ndarray, shape (n, c)
            Normal loads.

        Returns
        -------
        ndarray, shape (n, c)
            Shear loads in newtons.
        """
        limits = self.coefficient * loads_n
        steps = self.shear_stiffness_n_m * moved_m
        result = np.empty_like(limits)
        for step, limit, row in zip(steps, limits, result, strict=True):
            np.add(shear_n, step, out=shear_n)
            np.clip(shear_n, -limit, limit, out=shear_n)
            row[:] = shear_n
        return result
