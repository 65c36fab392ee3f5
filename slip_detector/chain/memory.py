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

"""Memory of a chain: computed and checked before any is allocated."""

import contextlib
import os
from pathlib import Path

from slip_detector.chain.filters import design
from slip_detector.chain.lanes import LANES
from slip_detector.chain.stages import FIXED_SLOTS
from slip_detector.chain.tiles import tile_bases_of
from slip_detector.parameters.detector import ChainConfig

#: Share of the memory that a chain may take; while parameters change there are two chains.
SHARE = 0.25

#: Files with the memory limit of a container in Linux, of cgroup versions 2 and 1.
CONTAINER_LIMITS = (
    '/sys/fs/cgroup/memory.max',
    '/sys/fs/cgroup/memory/memory.limit_in_bytes',
)

#: Bytes of a float64.
VALUE = 8


def machine_bytes() -> int:
    """Return the bytes of memory of the machine, or of the container if it allows fewer.

    Examples
    --------
    >>> machine_bytes() > 100e6
    True
    """
    limits = [os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES')]
    for path in CONTAINER_LIMITS:
        with contextlib.suppress(OSError, ValueError):  # not in a container, or "max"
            limits.append(int(Path(path).read_text(encoding='ascii')))
    return min(limits)


def state_shape(config: ChainConfig) -> tuple[int, int, int]:
    """Return the shape of a chain's state: tiles, slots of each channel, and lanes.

    Examples
    --------
    >>> state_shape(ChainConfig())[::2]
    (1, 16)
    """
    slots = FIXED_SLOTS + 2 * len(design(config)) + config.mains_rows
    slots += config.samples(config.envelope_window_s) + 1
    if config.decision == 'mean':
        slots += config.samples(config.decision_window_s) + 1
    return len(tile_bases_of(config)), slots, LANES


def check_memory(config: ChainConfig, kept_s: float = 0.0) -> None:
    """Check that a chain, and the rows that are kept for the next chain, fit into memory.

    Parameters
    ----------
    config
        Configuration of the chain.
    kept_s
        Time for which rows are kept.

    Raises
    ------
    ValueError
        When they need more than :data:`SHARE` of the memory; names the parameters that need it.

    Examples
    --------
    >>> check_memory(ChainConfig(), kept_s=5.0)
    """
    tiles, slots, lanes = state_shape(config)
    kept = config.samples(kept_s) if kept_s else 0
    needed = VALUE * (tiles * slots * lanes + config.channels * kept)
    allowed = SHARE * machine_bytes()
    if needed > allowed:
        windows = [config.envelope_window_s]
        if config.decision == 'mean':
            windows.append(config.decision_window_s)
        times = ' and '.join(f'{window_s:g} s' for window_s in windows)
        raise ValueError(
            f'parameter channels is {config.channels}: with windows of {times} at '
            f'{config.sample_rate_hz:g} Hz they take {needed / 1e9:.3g} GB of memory, allowed: '
            f'{allowed / 1e9:.3g} GB'
        )
