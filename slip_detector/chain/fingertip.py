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

"""The 16-channel piezoresistive fingertip of the paper: positions of its taxels.

The fingertip carries a 2 x 2 array of MEMS sensors, each with four piezoresistive units at the
ends of a cross. Channels are numbered from 1. The publications give these numbers, the groups of
Table 1 and the density of the units. We infer from them which sensor a channel belongs to, which
way its unit points and how far it is from the sensor's centre (see :func:`taxel_positions`).
"""

import numpy as np
from numpy.typing import NDArray

from slip_detector.parameters.detector import PAPER_CHANNELS, PAPER_GROUPS

#: Distance between the centres of two neighbouring sensors: 16 units on 22.3 mm2 (the density
#: published for this fingertip) are four sensors in cells of 2.36 mm x 2.36 mm.
SENSOR_PITCH_M = 2.36e-3

#: Distance of a unit from the centre of its sensor: half of the 1.4 mm die, less its frame.
UNIT_RADIUS_M = 0.5e-3


def taxel_positions() -> NDArray[np.float64]:
    """Return the positions of the 16 taxels on the fingertip's surface.

    Channels 1-4 belong to the distal ulnar sensor, 5-8 to the distal radial, 9-12 to the proximal
    radial and 13-16 to the proximal ulnar one; with no other assignment does every group of
    Table 1 have units of two neighbouring sensors. In each sensor the units at the two ends of one
    arm of the cross have odd numbers, those of the other arm have even numbers.

    Returns
    -------
    ndarray, shape (16, 2)
        Metres from the fingertip's centre: x across the finger, towards the radial side, and y
        along it, towards the tip. The platform moves along x.

    Examples
    --------
    >>> taxel_positions().shape
    (16, 2)
    """
    half = SENSOR_PITCH_M / 2
    centres = [(-half, half), (half, half), (half, -half), (-half, -half)]
    across, along = (
        PAPER_GROUPS['TP'] + PAPER_GROUPS['TD'],
        PAPER_GROUPS['LR'] + PAPER_GROUPS['LU'],
    )
    positions = np.empty((PAPER_CHANNELS, 2))
    for sensor, centre in enumerate(centres):
        channels = range(4 * sensor + 1, 4 * sensor + 5)
        for channel in channels:
            pair = [c for c in channels if c in (across if channel in across else along)]
            sign = -1.0 if channel == pair[0] else 1.0
            offset = (sign, 0.0) if channel in across else (0.0, sign)
            positions[channel - 1] = np.add(centre, np.multiply(UNIT_RADIUS_M, offset))
    return positions
