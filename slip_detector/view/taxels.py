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

"""Where the page and RViz draw the channels of a finger."""

import functools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from slip_detector.parameters.detector import DetectorConfig

#: Pitch of the grid for a finger without taxel positions; the taxels of tactile fingertips are one
#: to seven millimetres apart.
GRID_PITCH_M = 2.5e-3

#: Channels at one position, such as the axes of one taxel, are drawn on a circle around it. Its
#: radius is this share of the least distance between two positions.
CIRCLE_SHARE = 0.25


def drawn_positions(config: DetectorConfig) -> NDArray[np.float64]:
    """Return where the channels of a finger are drawn, no two at the same position.

    If ``taxel_positions_m`` is empty, this is a grid about as wide as high, row by row from the
    upper left.

    Returns
    -------
    ndarray, shape (channels, 3)
        Metres in the frame of the samples: x to the right and y upwards on the page.

    Examples
    --------
    >>> drawn_positions(DetectorConfig(channels=4))[:, :2].tolist()
    [[-0.00125, 0.00125], [0.00125, 0.00125], [-0.00125, -0.00125], [0.00125, -0.00125]]
    """
    return np.array(_drawn(config.channels, config.taxel_positions_m))


# Called at each tick of the server, but the arguments rarely change.
@functools.lru_cache(maxsize=32)
def _drawn(channels: int, taxel_positions_m: tuple[float, ...]) -> NDArray[np.float64]:
    if not taxel_positions_m:
        return _grid(channels)
    return _apart(np.reshape(taxel_positions_m, (channels, 3)))


def least_distance_m(positions: NDArray[np.float64]) -> float:
    """Return the distance of the two closest positions; for a single one, the pitch of the grid.

    Parameters
    ----------
    positions : ndarray, shape (n, 3)
        All different.

    Examples
    --------
    >>> least_distance_m(np.array([[0.0, 0.0, 0.0], [0.003, 0.004, 0.0], [0.01, 0.0, 0.0]]))
    0.005
    """
    if len(positions) == 1:
        return GRID_PITCH_M
    distances, _ = KDTree(positions).query(positions, k=2)
    return float(distances[:, 1].min())


def _grid(channels: int) -> NDArray[np.float64]:
    """Return the positions of a grid around the origin of the frame."""
    columns = int(np.ceil(np.sqrt(channels)))
    rows, row_of = -(-channels // columns), np.arange(channels) // columns
    positions = np.zeros((channels, 3))
    positions[:, 0] = np.arange(channels) % columns - (columns - 1) / 2
    positions[:, 1] = (rows - 1) / 2 - row_of
    return positions * GRID_PITCH_M


def _apart(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the positions; those that coincide are moved onto a circle around them."""
    places, place_of = np.unique(positions, axis=0, return_inverse=True)
    place_of = place_of.ravel()  # NumPy 2.0 gives it another shape.
    sharing = np.bincount(place_of)[place_of]
    if sharing.max() == 1:
        return positions
    # The index of each channel among those at its position.
    order = np.argsort(place_of, kind='stable')
    number = np.empty(len(positions), np.int64)
    number[order] = np.arange(len(positions)) - np.searchsorted(place_of[order], place_of[order])
    radius = np.where(sharing > 1, CIRCLE_SHARE * least_distance_m(places), 0.0)
    # Clockwise from the left, so that the x, y and z of a taxel stand in reading order.
    angle = np.pi - 2 * np.pi * number / sharing
    circle = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(len(angle))])
    apart: NDArray[np.float64] = positions + radius[:, np.newaxis] * circle
    return apart
