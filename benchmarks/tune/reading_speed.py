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

"""How much faster than real time recordings are read; bags have a message for each sample."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slip_detector.chain.samples import Samples
from slip_detector.recordings import PIECE_ROWS, open_recording, write_recording

CHANNELS = 16
RATE_HZ = 380.0


def write_labelled_noise(path: 'str | Path', seconds: float = 3600.0) -> None:
    """Write noise of 16 channels at 380 Hz, with labels; an hour as .mcap takes some 500 MB.

    Parameters
    ----------
    path
        The new file; its ending determines the format.
    seconds
        Length of the recording.
    """
    names = [f'ch{i + 1}' for i in range(CHANNELS)]
    write_recording(path, _pieces(round(seconds * RATE_HZ)), RATE_HZ, names)


def _pieces(n: int) -> Iterator[Samples]:
    random = np.random.default_rng(0)
    for first in range(0, n, PIECE_ROWS):
        k = np.arange(first, min(first + PIECE_ROWS, n))
        volts = 4.3 + 1e-3 * random.standard_normal((len(k), CHANNELS))
        slip = k // round(10 * RATE_HZ) % 2 == 1
        yield Samples(volts, np.rint(k * 1e9 / RATE_HZ).astype(np.int64), slip)


def measure_reading(path: 'str | Path') -> dict[str, Any]:
    """Read a recording once, as the evaluation does.

    Returns
    -------
    dict
        ``recorded_s``, ``read_s``, and their ratio ``times_real_time``.
    """
    start_s = time.perf_counter()
    recording = open_recording(path)
    rows = sum(len(piece.volts) for piece in recording.pieces(RATE_HZ))
    read_s = time.perf_counter() - start_s
    recorded_s = rows / RATE_HZ
    return {'recorded_s': recorded_s, 'read_s': read_s, 'times_real_time': recorded_s / read_s}
