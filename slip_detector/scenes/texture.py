"""The ridges of the plate, felt as they pass under a sliding taxel."""

import dataclasses

import numpy as np
from numpy.typing import NDArray

from slip_detector.config import ParameterSet, parameter

Floats = NDArray[np.float64]


@dataclasses.dataclass(frozen=True)
class Texture(ParameterSet):
    """Ridges across the direction of motion."""

    spatial_period_m: float = parameter(
        400e-6, 'Distance from ridge to ridge.', unit='m', low=1e-6, high=1.0
    )
    depth: float = parameter(
        0.18,
        'Share of the load by which a ridge raises and a groove lowers it.',
        low=0.0,
        high=1.0,
    )

    def modulation(self, slid_m: Floats, positions_m: Floats) -> Floats:
        """Return the factor of the texture on the load of each taxel.

        Sliding at the velocity v it varies with v / spatial period; a taxel that sticks keeps
        its place on the ridges.

        Parameters
        ----------
        slid_m : ndarray, shape (n, c)
            How far the plate has slid over each taxel.
        positions_m : ndarray, shape (c, 2)
            Taxels further along x meet a ridge earlier.

        Returns
        -------
        ndarray, shape (n, c)
        """
        phase = 2 * np.pi * (slid_m + positions_m[:, 0]) / self.spatial_period_m
        return np.asarray(1.0 + self.depth * np.sin(phase))
