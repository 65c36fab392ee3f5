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

"""The layout of the chain's state and of the flags of a row."""

import itertools
from typing import NamedTuple

from slip_detector.parameters import ChainConfig
from slip_detector.vectors import LANES

# The first slots of a tile's state. Three of them have one number for all channels, in lane 0 of
# the first tile: the common mode of the last row, and the remaining rows of the hold times of an
# impact and of contact. The other parts begin behind these slots.
LAST, REPEATS, FIRST, HELD, COMMON_V, HOLD_ROWS, CONTACT_ROWS = range(7)
AGE, FLOOR, EVIDENCE, HELD_EVIDENCE, FIRST_SLOTS = range(7, 12)


#: The slots in which the parts of a tile's state begin whose lengths depend on the chain, and the
#: number of all slots. The parts are the delays of the filters, two for each section; the rows of
#: a mains period; the windows of the envelope and of its mean, with position, head and tails;
#: the delays of the filters of the low level and its window; and samples of earlier rows, for the
#: steps of impacts. A part that no stage needs is empty. The first slot of a period, of a window
#: and of steps has the position, in lane 0.
SLOTS = (
    'delay_slot', 'comb_slot', 'envelope_slot', 'level_slot', 'low_slot', 'steps_slot', 'slots',
)  # fmt: skip


def state_layout(config: ChainConfig, sections: int, low_sections: int) -> dict[str, int]:
    """Return the layout of a tile's state for filters of so many sections, by :data:`SLOTS`."""
    window = config.samples(config.envelope_window_s) + 3
    mean_window = config.samples(config.decision_window_s) + 3 if config.decision == 'mean' else 0
    low = 2 * low_sections + window if low_sections else 0
    steps = config.impact_rows + 1 if config.impact_rows else 0
    lengths = 2 * sections, config.mains_rows + 1, window, mean_window, low, steps
    return dict(zip(SLOTS, itertools.accumulate(lengths, initial=FIRST_SLOTS), strict=True))


class FlagLayout(NamedTuple):
    """The columns of flags: slip in column 0, and where groups and channels begin."""

    groups_at: int
    can_vote_at: int
    channels_at: int
    valid_at: int
    flags: int


def flag_layout(config: ChainConfig) -> FlagLayout:
    """Return the layout of a row of flags."""
    groups, channels = len(config.groups), config.channels
    lengths = groups, groups, channels, channels
    return FlagLayout(*itertools.accumulate(lengths, initial=1))


def flag_names(config: ChainConfig) -> list[tuple[str, str]]:
    """Return for each column of flags what it says, and of which group or channel.

    Examples
    --------
    >>> flag_names(ChainConfig(channels=1, groups={'tip': [1]}))
    [('slip', ''), ('group', 'tip'), ('can_vote', 'tip'), ('channel', 'ch1'), ('valid', 'ch1')]
    """
    groups = [(flag, name) for flag in ('group', 'can_vote') for name in config.groups]
    channels = [(flag, name) for flag in ('channel', 'valid') for name in config.names]
    return [('slip', ''), *groups, *channels]


def tiles_of(channels: int) -> int:
    """Return the number of tiles of sixteen columns for so many channels."""
    return -(-channels // LANES)
