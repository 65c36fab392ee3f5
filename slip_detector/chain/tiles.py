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

"""Tiles of sixteen channels: their columns, and arrays with a value for each lane."""

import contextlib
import mmap
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from slip_detector.chain.evidence import least_floor_db
from slip_detector.chain.lanes import LANES, LINE
from slip_detector.parameters.detector import ChainConfig

Floats = NDArray[np.float64]

#: Largest array whose freed memory the C library may use again.
REUSED_BYTES = 2**25

#: Size of a huge page on common processors.
HUGE_PAGE_BYTES = 2**21


def aligned(new: Callable[[int], Floats], shape: tuple[int, ...]) -> Floats:
    """Return an array that begins where a cache line does; a large one is in huge pages.

    Parameters
    ----------
    new
        Makes an array of a given number of values: ``numpy.zeros`` or ``numpy.empty``.
    shape
        Shape of the array.

    Examples
    --------
    >>> array = aligned(np.zeros, (3, 8))
    >>> array.shape, array.ctypes.data % 64
    ((3, 8), 0)
    """
    size = int(np.prod(shape))
    values = new(size + LINE) if 8 * size <= REUSED_BYTES else _in_huge_pages(size)
    skip = -(values.ctypes.data // values.itemsize) % LINE
    return values[skip : skip + size].reshape(shape)


def _in_huge_pages(size: int) -> Floats:
    """Return zeros in whole huge pages, if the system has them.

    The system clears a page when it is first used; 512 small pages take longer than a huge one.
    NumPy requests huge pages too, but its arrays begin and end in small ones.
    """
    pages = -(-8 * size // HUGE_PAGE_BYTES)
    memory = mmap.mmap(-1, pages * HUGE_PAGE_BYTES, flags=mmap.MAP_PRIVATE)
    with contextlib.suppress(AttributeError, OSError):  # no huge pages
        memory.madvise(mmap.MADV_HUGEPAGE)
    return np.frombuffer(memory, count=size)


def tile_bases_of(config: ChainConfig) -> list[int]:
    """Return the first columns of the tiles that hold all enabled channels.

    Tiles without an enabled channel are left out; the last tile may overlap the one before it.

    Examples
    --------
    >>> tile_bases_of(ChainConfig(channels=20))
    [0, 4]
    >>> tile_bases_of(ChainConfig(channels=40, disabled_channels=range(3, 37)))
    [0, 24]
    """
    disabled = set(config.disabled_channels)
    # Rows of fewer channels are padded to the columns of one tile.
    last = max(config.channels, LANES) - LANES
    bases: list[int] = []
    for channel in range(config.channels):
        if channel + 1 not in disabled and (not bases or channel >= bases[-1] + LANES):
            bases.append(min(channel, last))
    return bases


def least_floors_db(config: ChainConfig) -> Floats:
    """Return the least noise floors, in dB, by tile and lane; no rows without evidence.

    Returns
    -------
    ndarray, shape (t, 16) or (0, 16)

    Examples
    --------
    >>> config = ChainConfig(channels=2, decision='evidence', noise_floor=[0.1, 0.01])
    >>> least_floors_db(config)[0, :2]
    array([-20., -40.])
    """
    if config.decision != 'evidence':
        return np.zeros((0, LANES))
    bases = tile_bases_of(config)
    # Lanes beyond the last channel are never valid, so their floor has no effect.
    by_channel = np.zeros(max(config.channels, LANES))
    by_channel[: config.channels] = [least_floor_db(floor) for floor in config.noise_floors]
    return np.array([by_channel[base : base + LANES] for base in bases])
