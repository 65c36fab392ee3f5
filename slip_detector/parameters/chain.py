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

"""The parameters of the slip chain."""

import contextlib
import functools
from collections import Counter
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from slip_detector.parameters import fields
from slip_detector.parameters.fields import parameter, quote
from slip_detector.parameters.sets import ParameterSet

if TYPE_CHECKING:
    from typing_extensions import Self

#: Lowest band edge, as a fraction of the sample rate; below it, round-off ruins the filter.
LOWEST_EDGE = 1e-5

#: Most stop-bands: each one adds a filter to the computation of every row.
MOST_STOPBANDS = 32

#: Longest delay of the mains comb; it must be whole in both rows and mains periods.
LONGEST_COMB_S = 0.25

#: Tolerance of a whole number of mains periods, in periods. It leaves -44 dB of the hum; the
#: mains frequency itself deviates by as much.
WHOLE_PERIODS = 1e-3

#: Allowed values of the parameters ``common_mode`` and ``decision``.
COMMON_MODES = ('none', 'median', 'mean')
DECISIONS = ('mean', 'evidence')

#: Lists of channels, or of what each channel has.
BY_CHANNEL = ('channel_names', 'disabled_channels', 'taxel_positions_m')

#: Number of channels of the paper's fingertip.
PAPER_CHANNELS = 16

#: The groups of the paper's Table 1. Units T sense shear across the finger, units L along it. The
#: paper does not explain P, D, R and U: probably the proximal, distal, radial and ulnar sensors.
PAPER_GROUPS: dict[str, tuple[int, ...]] = {
    'TP': (14, 16, 11, 9),
    'TD': (1, 3, 8, 6),
    'LR': (5, 7, 12, 10),
    'LU': (2, 4, 15, 13),
}

# Parameters by what they affect, and by the decisions with which the tuner searches them.
searched = functools.partial(parameter, searched_with=DECISIONS)
decision_parameter = functools.partial(parameter, affects='decision')
searched_decision = functools.partial(parameter, affects='decision', searched_with=DECISIONS)
of_evidence = functools.partial(parameter, affects='decision', searched_with=('evidence',))
window = functools.partial(parameter, within=(0.0, 60.0, 's'), allows='one sample to 60 s')
channels_at_once = functools.partial(
    of_evidence, within=(1, 1_000_000), allows='1 to the number of enabled channels'
)


def default_channel_names(channels: int) -> tuple[str, ...]:
    """Return the names of the channels where none are configured: ch1, ch2, ..."""
    return tuple(f'ch{channel}' for channel in range(1, channels + 1))


class ChainConfig(ParameterSet):
    """Parameters of the slip chain; the defaults are the paper's.

    Examples
    --------
    >>> config = ChainConfig(sample_rate_hz=1000.0, vote=2)
    >>> config.samples(config.envelope_window_s), list(config.groups)
    (40, ['TP', 'TD', 'LR', 'LU'])
    >>> ChainConfig(threshold=-1)
    Traceback (most recent call last):
    ValueError: parameter threshold is -1, allowed: 1e-30 to 1e+30
    """

    NODE = 'slip_detector'

    sample_rate_hz: float = parameter(
        380.0, 'Rate of the samples.', (1.0, 1e6, 'Hz'), heading='Samples', affects='input'
    )
    channels: int = parameter(16, 'Channels in a sample.', (1, 1_000_000), affects='input display')
    channel_names: tuple[str, ...] = parameter(
        (),
        'Names of the channels in the input; empty: ch1, ch2, ..., and the input may have any.',
        allows='letters, digits, _',
        read=fields.read_names,
        affects='decision',
    )
    disabled_channels: tuple[int, ...] = parameter(
        (), 'Channels (counted from 1) to leave out.', allows='1 to the number of channels'
    )
    valid_range_v: tuple[float, float] = decision_parameter(
        (-1e9, 1e9), 'A sample outside of this range is bad.', (-1e12, 1e12, 'V'), rising=True
    )
    flat_after_s: float = decision_parameter(
        1.0, 'A channel with one value for this long cannot vote; 0: no check.', (0.0, 3600.0, 's')
    )
    max_gap_s: float = decision_parameter(
        0.1, 'A longer gap in the input resets the chain, a shorter is bridged.', (0.0, 60.0, 's')
    )
    common_mode: str = searched(
        'none', 'What is subtracted from each row.', choices=COMMON_MODES, heading='Interference'
    )
    mains_hz: float = searched(
        0.0,
        'Mains hum to remove, by subtracting the row whole periods earlier: at 380 Hz, 38 rows, '
        'which removes a steady slide at 10, 20, 30 Hz too; 0: none.',
        (0.0, 1000.0, 'Hz'),
        allows='0, or up to 1000 with whole periods in at most 0.25 s of rows',
    )
    passband_hz: tuple[float, float] = searched(
        (7.0, 50.0),
        'Edges of the band-pass; a high edge of 0 makes it a high-pass.',
        (None, None, 'Hz'),
        allows='1e-5 of the sample rate to below half of it',
        heading='Filters',
    )
    passband_degree: int = searched(
        4, 'Band-pass degree (Eq. 1).', (1, 20), allows='even, 2 to 20; 1 to 20 for a high-pass'
    )
    gain: float = parameter(100.0, 'Factor on the filtered signal.', (1e-6, 1e6))
    stopbands_hz: tuple[tuple[float, float], ...] = searched(
        ((0.5, 7.0), (50.0, 180.0)),
        'Low and high edge of each stop-band (Eq. 4), where the ripple ends; [] for none.',
        (None, None, 'Hz'),
        allows='as passband_hz; at most 32 pairs',
    )
    stopband_degree: int = parameter(4, 'Degree of a stop-band.', (2, 20), allows='even, 2 to 20')
    stopband_ripple_db: float = parameter(0.01, 'Ripple outside stop-bands.', (1e-4, 3.0, 'dB'))
    stopband_attenuation_db: float = parameter(
        40.0, 'Attenuation in the middle of the stop-bands.', (6.0, 120.0, 'dB')
    )
    rectify: str = parameter(
        'full', 'Full or half wave (Eq. 3).', choices=('full', 'half'), heading='Envelope'
    )
    exponent: int = searched(3, 'Power of the rectified signal (Eq. 3-5).', (1, 6))
    envelope_window_s: float = window(0.04, 'RMS window (Eq. 6-8).', searched_with=DECISIONS)
    decision_window_s: float = window(
        0.04, 'Window of the mean that is compared with the threshold.', searched_with=('mean',)
    )
    decision: str = searched(
        'mean',
        'What is compared with the threshold: the mean envelope, or evidence (docs/method.md).',
        choices=DECISIONS,
        heading='Decision',
    )
    noise_floor: tuple[float, ...] = of_evidence(
        (),
        'Least envelope of the noise: one for all, or one per channel; empty: unknown.',
        (1e-30, 1e30),
        allows='1e-30 to 1e+30; none, one, or one for each channel',
    )
    noise_floor_learnt: bool = of_evidence(
        False, 'Whether the floor begins at noise_floor; else at the first envelope above it.'
    )
    noise_floor_range_db: float = of_evidence(
        60.0, 'Highest floor above noise_floor; 15 dB suit a learnt floor.', (0.0, 300.0, 'dB')
    )
    noise_floor_rate_db_s: float = of_evidence(
        0.43, 'How fast the floor rises; it falls nine times as fast.', (0.0, 1000.0, 'dB/s')
    )
    evidence_cap_db: float = of_evidence(
        13.0,
        'Largest excess of the envelope over the floor that counts.',
        (0.0, 300.0, 'dB'),
        allows='above evidence_offset_db, to 300',
    )
    evidence_offset_db: float = of_evidence(
        3.5, 'Evidence grows while the envelope is this far above the floor.', (0.0, 100.0, 'dB')
    )
    evidence_limit_db_s: float = of_evidence(
        1.3, 'Upper limit of the evidence; it bounds how late slip goes OFF.', (1e-6, 1e6, 'dB s')
    )
    impact_v: float = of_evidence(
        0.0,
        'A larger step between two samples, on impact_channels at once, is an impact; 0: none.',
        (0.0, 1e12, 'V'),
        heading='Impacts',
    )
    impact_s: float = of_evidence(
        0.0, 'An impact is a step over this time; 0: from one sample to the next.', (0.0, 1.0, 's')
    )
    impact_channels: int = channels_at_once(2, 'Number of channels that must step at once.')
    impact_hold_s: float = of_evidence(
        0.3, 'For this time after an impact no channel is above its floor.', (0.0, 60.0, 's')
    )
    contact_level_v: float = of_evidence(
        0.0,
        'A larger RMS in activity_band_hz is a touch; no contact, no slip; 0: no check.',
        (0.0, 1e12, 'V'),
        heading='Contact and activity',
    )
    contact_channels: int = channels_at_once(4, 'Number of channels that must touch.')
    contact_hold_s: float = of_evidence(
        1.0, 'Contact goes on for this time after the last touch.', (0.0, 60.0, 's')
    )
    activity_band_hz: tuple[float, float] = of_evidence(
        (8.0, 20.0),
        'Band of low activity, below passband_hz, for contact and activity.',
        (None, None, 'Hz'),
        allows='two edges, as passband_hz',
    )
    activity_range_db: float = of_evidence(
        15.0, 'How far below the activity the floor is that follows it.', (-100.0, 100.0, 'dB')
    )
    activity_cap_db: float = of_evidence(
        0.0, 'How far activity may lift the floor; 0: not at all.', (0.0, 300.0, 'dB')
    )
    common_rank: int = of_evidence(
        0, 'Rank, quietest first, of the channel whose excess all channels lose; 0: none.', (0, 64)
    )
    threshold: float = searched_decision(
        0.5,
        'Level above which a channel is ON; with evidence in dB s, and OFF at half of it.',
        (1e-30, 1e30),
        heading='Threshold and vote',
    )
    vote: str | int = searched_decision(
        'all',
        'When a group is ON: all channels, k of them, or mean (geometric, of level / threshold).',
        allows='all, mean, or 1 to the size of the smallest group',
    )
    groups: dict[str, tuple[int, ...]] = parameter(
        {},
        'Channels (from 1) of each group; empty: Table 1 for 16 channels, else all in one.',
        allows='each enabled channel in one group',
        affects='decision display',
    )

    def __post_init__(self) -> None:
        """Check the fields, each and against each other, and fill in the groups."""
        super().__post_init__()
        if not self.groups:
            object.__setattr__(self, 'groups', self._default_groups())
        self._check_channels()
        self._check_filters()
        self._check_decision()

    def with_values(self, values: Mapping[str, Any]) -> 'Self':
        """Return a copy with other values, by flat names; None deletes a group.

        Channels and groups replace what was set for single channels and does not fit beside them:
        the groups, then the lists, then the vote. Of another number of channels no list is kept.

        Examples
        --------
        >>> config = ChainConfig(channels=3, groups={'a': [1, 2], 'b': [3]})
        >>> config.with_values({'groups.c': [1, 2, 3]}).groups
        {'c': (1, 2, 3)}
        >>> config.with_values({'channels': 2}).groups
        {'all': (1, 2)}
        """
        replaced: dict[str, Any] = {}
        if {name.partition('.')[0] for name in values} & {'channels', 'groups'}:
            groups: dict[str, Any] = {f'groups.{name}': None for name in self.groups}
            lists: dict[str, Any] = {
                name: [] for name in BY_CHANNEL if name in self.__dataclass_fields__
            }
            others = [groups] if values.get('channels', self.channels) == self.channels else []
            for each in [{}, *others, groups | lists]:
                with contextlib.suppress(ValueError):
                    return super().with_values({**each, **values})
            replaced = groups | lists | {'vote': 'all'}
        return super().with_values({**replaced, **values})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels: those configured, else ch1, ch2, ..."""
        return self.channel_names or default_channel_names(self.channels)

    @property
    def floors(self) -> tuple[float, ...]:
        """The least noise floors: one for each channel, one for all, or none."""
        fits = len(self.noise_floor) == self.channels
        return self.noise_floor if fits else self.noise_floor[:1]

    def remarks(self) -> list[str]:
        """Return what a user should know of a configuration that is allowed.

        Examples
        --------
        >>> ChainConfig(channels=4, decision='evidence', noise_floor=[1.0, 2.0]).remarks()
        ['noise_floor has 2 numbers for 4 channels: the first is used for all']
        """
        if self.decision != 'evidence':
            return []
        if not self.noise_floor:
            words = 'no noise_floor: each channel begins at its first envelope, and a slip then'
            return [f'{words} hides later ones; learn it with slip_tune --quiet REST']
        given = len(self.noise_floor)
        words = f'noise_floor has {given} numbers for {self.channels} channels'
        return [f'{words}: the first is used for all'] if given not in (1, self.channels) else []

    def samples(self, seconds: float) -> int:
        """Return the number of samples in a time, at least one."""
        return max(1, round(seconds * self.sample_rate_hz))

    @property
    def mains_rows(self) -> int:
        """The fewest rows that hold whole mains periods; 0 if ``mains_hz`` is 0 or none do.

        Examples
        --------
        >>> ChainConfig(mains_hz=50).mains_rows, ChainConfig(mains_hz=60).mains_rows
        (38, 19)
        """
        for periods in range(1, int(LONGEST_COMB_S * self.mains_hz) + 1):
            rows = max(1, round(periods * self.sample_rate_hz / self.mains_hz))
            if rows > LONGEST_COMB_S * self.sample_rate_hz * (1 + 1e-9):
                break
            if abs(rows * self.mains_hz / self.sample_rate_hz - periods) <= WHOLE_PERIODS:
                return rows
        return 0

    @property
    def low_band_hz(self) -> tuple[float, ...]:
        """The band whose level contact or activity need; empty if neither is configured.

        Examples
        --------
        >>> ChainConfig(decision='evidence', noise_floor=1e-3, contact_level_v=0.01).low_band_hz
        (8.0, 20.0)
        >>> ChainConfig().low_band_hz
        ()
        """
        needed = self.decision == 'evidence' and (self.contact_level_v or self.activity_cap_db)
        return self.activity_band_hz if needed else ()

    @property
    def impact_rows(self) -> int:
        """The rows over which a step is an impact, if more than one; else 0."""
        looked_for = self.decision == 'evidence' and self.impact_v
        rows = self.samples(self.impact_s) if looked_for else 0
        return rows if rows > 1 else 0

    def _default_groups(self) -> dict[str, tuple[int, ...]]:
        disabled = set(self.disabled_channels)
        one_group = {'all': tuple(range(1, self.channels + 1))}
        groups = PAPER_GROUPS if self.channels == PAPER_CHANNELS else one_group
        left = {n: tuple(c for c in members if c not in disabled) for n, members in groups.items()}
        return {name: members for name, members in left.items() if members}

    def _check_channels(self) -> None:
        channels, names, disabled = self.channels, self.channel_names, set(self.disabled_channels)
        text = f'{channels}, the number of channels'
        self.require(len(names) in (0, channels), 'channel_names', text, f'has {len(names)} names')
        known = set(range(1, channels + 1))
        self.require(disabled < known, 'disabled_channels', f'some of 1 to {channels}, not all')
        times = Counter(channel for group in self.groups.values() for channel in group)
        odd = [c for c in (known - disabled) | times.keys() if times[c] != 1 or c not in known]
        text = f'each of 1 to {channels} in one group, or in disabled_channels; set channels first'
        self.require(not odd, 'groups', text, f'is wrong about channels {quote(sorted(odd))}')
        self.require(all(self.groups.values()), 'groups', 'no empty group')
        most = min(filter(None, (len({*group} - disabled) for group in self.groups.values())))
        text = f'at most {most}, the enabled channels of the smallest group'
        self.require(isinstance(self.vote, str) or self.vote <= most, 'vote', text)

    def _check_filters(self) -> None:
        low, high = self.passband_hz
        # Rounding can put 1e-5 times the rate one last digit above the number that a user writes.
        lowest_hz = LOWEST_EDGE * self.sample_rate_hz * (1 - 1e-12)
        nyquist_hz = self.sample_rate_hz / 2
        text = f'rising, {lowest_hz:g} Hz to below {nyquist_hz:g} Hz (half the sample rate)'
        # A high edge of 0 makes a high-pass.
        bands: list[tuple[str, tuple[float, ...]]]
        bands = [('passband_hz', (low, high) if high else (low,))]
        bands += [('activity_band_hz', self.low_band_hz)] if self.low_band_hz else []
        for name, edges in bands + [('stopbands_hz', pair) for pair in self.stopbands_hz]:
            rising = lowest_hz <= edges[0] and [*edges] == sorted({*edges})
            said = f'has {" and ".join(f"{edge:g}" for edge in edges)} Hz'
            self.require(rising and edges[-1] < nyquist_hz, name, text, said)
        if high:
            text = 'an even number (a band-pass has two edges of equal degree)'
            self.require(self.passband_degree % 2 == 0, 'passband_degree', text)
        self.require(self.stopband_degree % 2 == 0, 'stopband_degree')
        pairs, most = len(self.stopbands_hz), MOST_STOPBANDS
        self.require(pairs <= most, 'stopbands_hz', f'at most {most}', f'has {pairs} pairs')
        self.require(not self.mains_hz or self.mains_rows > 0, 'mains_hz')
        text = f'at least one sample ({1 / self.sample_rate_hz:.6g} s)'
        for name in ('envelope_window_s', 'decision_window_s'):
            self.require(getattr(self, name) * self.sample_rate_hz >= 1 - 1e-6, name, text)

    def _check_decision(self) -> None:
        """Check the parameters of the evidence, if it decides."""
        if self.decision != 'evidence':
            return
        offset_db, limit_db_s = self.evidence_offset_db, self.evidence_limit_db_s
        text = f'above evidence_offset_db ({offset_db:g} dB)'
        self.require(self.evidence_cap_db > offset_db, 'evidence_cap_db', text)
        text = f'above 0, below evidence_limit_db_s ({limit_db_s:g} dB s)'
        self.require(self.threshold < limit_db_s, 'threshold', text)
        enabled = self.channels - len(set(self.disabled_channels))
        text = f'at most {enabled}, the number of enabled channels'
        self.require(not self.impact_v or self.impact_channels <= enabled, 'impact_channels', text)
        touching = self.contact_channels if self.contact_level_v else 0
        self.require(touching <= enabled, 'contact_channels', text)
        low_hz, high_hz = self.passband_hz[0], self.activity_band_hz[1]
        text = f'up to {low_hz:g} Hz, the low edge of passband_hz, with activity_cap_db'
        self.require(not self.activity_cap_db or high_hz <= low_hz, 'activity_band_hz', text)
