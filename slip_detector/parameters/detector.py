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

"""The parameters of the slip chain and of the detector node that runs it."""

import dataclasses

from slip_detector.parameters import chain_checks
from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

#: Tolerance of a whole number of mains periods, in periods. It leaves -44 dB of the hum; the
#: mains frequency itself deviates by as much.
WHOLE_PERIODS = 1e-3

#: Allowed values of the parameter ``common_mode``.
COMMON_MODES = ('none', 'median', 'mean')

#: Number of channels of the paper's fingertip.
PAPER_CHANNELS = 16

#: The paper's Table 1. The paper does not explain the letters; our reading: T are units that sense
#: shear across the finger, of the proximal (P) or the distal (D) sensors; L are units that sense
#: shear along the finger, of the radial (R) or the ulnar (U) sensors.
PAPER_GROUPS: dict[str, tuple[int, ...]] = {
    'TP': (14, 16, 11, 9),
    'TD': (1, 3, 8, 6),
    'LR': (5, 7, 12, 10),
    'LU': (2, 4, 15, 13),
}


def default_channel_names(channels: int) -> tuple[str, ...]:
    """Return the names of the channels where none are configured.

    Examples
    --------
    >>> default_channel_names(3)
    ('ch1', 'ch2', 'ch3')
    """
    return tuple(f'ch{channel}' for channel in range(1, channels + 1))


@dataclasses.dataclass(frozen=True)
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
        380.0,
        'Rate at which samples are taken.',
        unit='Hz',
        low=1.0,
        high=1e6,
        heading='Samples',
    )
    channels: int = parameter(
        16, 'Number of channels in a sample.', low=1, high=1_000_000, affects=('outputs',)
    )
    channel_names: tuple[str, ...] = parameter(
        (),
        'Names of the channels in the input; empty: ch1, ch2, ..., and the input may have any.',
        allows='letters, digits, _',
        affects=('decision', 'outputs'),
    )
    disabled_channels: tuple[int, ...] = parameter(
        (),
        'Channels (counted from 1) that are not computed and do not vote.',
        allows='1 to the number of channels',
        affects=('outputs',),
    )
    valid_range_v: tuple[float, float] = parameter(
        (-1e9, 1e9),
        'Lowest and highest value a working channel can give; beyond it a sample is bad.',
        unit='V',
        low=-1e12,
        high=1e12,
        affects=('decision',),
    )
    flat_after_s: float = parameter(
        1.0,
        'A channel that repeats one value for this long leaves the vote; 0: no such check.',
        unit='s',
        low=0.0,
        high=3600.0,
        affects=('decision',),
    )
    max_gap_s: float = parameter(
        0.1,
        'A shorter gap in the input is bridged with the last row, a longer one resets the chain.',
        unit='s',
        low=0.0,
        high=60.0,
        affects=('decision',),
    )
    common_mode: str = parameter(
        'none',
        'What is subtracted from each row as common to all channels: none, median or mean.',
        choices=COMMON_MODES,
        heading='Interference',
    )
    mains_hz: float = parameter(
        0.0,
        'Mains frequency whose hum is removed: from each row the row a whole number of periods '
        'earlier is subtracted; 0: none.',
        unit='Hz',
        low=0.0,
        high=1000.0,
        allows='0, or up to 1000 with whole periods in at most 0.25 s of rows',
    )
    passband_hz: tuple[float, float] = parameter(
        (7.0, 50.0),
        'Edges of the band-pass; a high edge of 0 makes it a high-pass.',
        unit='Hz',
        allows='1e-5 of the sample rate to below half of it',
        heading='Filters',
    )
    passband_degree: int = parameter(
        4,
        'Degree of the band-pass polynomials (Eq. 1).',
        low=1,
        high=20,
        allows='even, 2 to 20; 1 to 20 for a high-pass',
    )
    gain: float = parameter(100.0, 'Factor on the filtered signal.', low=1e-6, high=1e6)
    stopbands_hz: tuple[tuple[float, float], ...] = parameter(
        ((0.5, 7.0), (50.0, 180.0)),
        'Low and high edge of each stop-band (Eq. 4), where the ripple ends; [] for none.',
        unit='Hz',
        allows='as passband_hz; at most 32 pairs',
    )
    stopband_degree: int = parameter(
        4, 'Degree of the stop-band polynomials.', low=2, high=20, allows='even, 2 to 20'
    )
    stopband_ripple_db: float = parameter(
        0.01, 'Ripple outside the stop-bands.', unit='dB', low=1e-4, high=3.0
    )
    stopband_attenuation_db: float = parameter(
        40.0, 'Attenuation in the middle of the stop-bands.', unit='dB', low=6.0, high=120.0
    )
    rectify: str = parameter(
        'full',
        'Rectifier: full wave or half wave (Eq. 3).',
        choices=('full', 'half'),
        heading='Envelope',
    )
    exponent: int = parameter(3, 'Power of the rectified signal (Eq. 3-5).', low=1, high=6)
    envelope_window_s: float = parameter(
        0.04,
        'Window of the RMS envelope (Eq. 6-8).',
        unit='s',
        low=0.0,
        high=60.0,
        allows='one sample to 60 s',
    )
    decision_window_s: float = parameter(
        0.04,
        'Window of the mean that is compared with the threshold.',
        unit='s',
        low=0.0,
        high=60.0,
        allows='one sample to 60 s',
    )
    decision: str = parameter(
        'mean',
        'What is compared with the threshold: the mean envelope, or the evidence for slip '
        '(docs/method.md). The parameters up to impact_hold_s are for evidence.',
        choices=('mean', 'evidence'),
        heading='Decision',
    )
    noise_floor: tuple[float, ...] = parameter(
        (),
        'Smallest envelope of the noise: one number, or one per channel; evidence needs it.',
        low=1e-30,
        high=1e30,
        allows='1e-30 to 1e+30; one number, or one for each channel',
        affects=('decision',),
    )
    noise_floor_learnt: bool = parameter(
        False,
        'Whether the floor begins at noise_floor; else it begins at the first envelope, but not '
        'below noise_floor.',
        affects=('decision',),
    )
    noise_floor_range_db: float = parameter(
        60.0,
        'How far above noise_floor the floor may rise; 15 dB suits a learnt noise_floor.',
        unit='dB',
        low=0.0,
        high=300.0,
        affects=('decision',),
    )
    noise_floor_rate_db_s: float = parameter(
        0.43,
        'How fast the floor rises while the envelope is above it; it falls nine times as fast '
        'while the envelope is below.',
        unit='dB/s',
        low=0.0,
        high=1000.0,
        affects=('decision',),
    )
    evidence_cap_db: float = parameter(
        13.0,
        'Largest excess of the envelope over the floor that counts.',
        unit='dB',
        low=0.0,
        high=300.0,
        allows='above evidence_offset_db, to 300',
        affects=('decision',),
    )
    evidence_offset_db: float = parameter(
        3.5,
        'Evidence grows while the envelope is more than this above the floor, else it falls.',
        unit='dB',
        low=0.0,
        high=100.0,
        affects=('decision',),
    )
    evidence_limit_db_s: float = parameter(
        1.3,
        'Upper limit of the evidence: it bounds how long slip stays ON after its end.',
        unit='dB s',
        low=1e-6,
        high=1e6,
        affects=('decision',),
    )
    impact_v: float = parameter(
        0.0,
        'A step of more than this from one sample to the next, on impact_channels at once, is an '
        'impact; 0: no impacts.',
        unit='V',
        low=0.0,
        high=1e12,
        heading='Impacts',
        affects=('decision',),
    )
    impact_channels: int = parameter(
        2,
        'Number of channels that must step at once.',
        low=1,
        high=1_000_000,
        allows='1 to the number of enabled channels',
        affects=('decision',),
    )
    impact_hold_s: float = parameter(
        0.3,
        'For this time after an impact no channel counts as above its floor.',
        unit='s',
        low=0.0,
        high=60.0,
        affects=('decision',),
    )
    threshold: float = parameter(
        0.5,
        'Level above which a channel is ON; with evidence it is in dB s, and a channel goes '
        'OFF at half of it.',
        low=1e-30,
        high=1e30,
        heading='Threshold and vote',
        affects=('decision',),
    )
    vote: str | int = parameter(
        'all',
        'When a group is ON: all its channels, a whole number k of them, or mean '
        '(the geometric mean of level / threshold exceeds 1).',
        allows='all, mean, or 1 to the size of the smallest group',
        affects=('decision',),
    )
    groups: dict[str, tuple[int, ...]] = parameter(
        {},
        'Channels (counted from 1) of each group; none given: Table 1 for 16 channels, '
        'else one group named all.',
        allows='each enabled channel in one group',
        affects=('decision', 'outputs'),
    )

    def __post_init__(self) -> None:
        """Check the fields against each other and fill in the groups."""
        super().__post_init__()
        chain_checks.check_channels(self)
        if not self.groups:
            object.__setattr__(self, 'groups', self._default_groups())
        chain_checks.check_groups(self)
        chain_checks.check_filters(self)
        chain_checks.check_windows(self)
        chain_checks.check_evidence(self)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels: those configured, else ch1, ch2, ..."""
        return self.channel_names or default_channel_names(self.channels)

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
        for periods in range(1, int(chain_checks.LONGEST_COMB_S * self.mains_hz) + 1):
            rows = max(1, round(periods * self.sample_rate_hz / self.mains_hz))
            if rows > chain_checks.LONGEST_COMB_S * self.sample_rate_hz * (1 + 1e-9):
                break
            if abs(rows * self.mains_hz / self.sample_rate_hz - periods) <= WHOLE_PERIODS:
                return rows
        return 0

    @property
    def noise_floors(self) -> tuple[float, ...]:
        """Lower limit of each channel's noise floor."""
        floors = self.noise_floor
        return floors * self.channels if len(floors) == 1 else floors

    def _default_groups(self) -> dict[str, tuple[int, ...]]:
        disabled = set(self.disabled_channels)
        groups = {'all': tuple(range(1, self.channels + 1))}
        if self.channels == PAPER_CHANNELS:
            groups = dict(PAPER_GROUPS)
        left = {n: tuple(c for c in members if c not in disabled) for n, members in groups.items()}
        return {name: members for name, members in left.items() if members}


@dataclasses.dataclass(frozen=True)
class DetectorConfig(ChainConfig):
    """Parameters of the detector node: those of the chain, and those of its input and topics.

    Examples
    --------
    >>> config = DetectorConfig(input_type='std_msgs/msg/Float32MultiArray', input_field='data')
    >>> config.heartbeat_hz, config.threshold
    (10.0, 0.5)
    """

    NODE = 'slip_detector'

    input_type: str = parameter(
        'sensor_msgs/msg/JointState',
        'Message type of the topic voltages.',
        allows='any installed type, as package/msg/Type',
        heading='Input and topics',
    )
    input_field: str = parameter(
        'position',
        'Field of the message that has the channels.',
        allows='a field, or a path such as wrench.force.x, pillars[].fz or tactiles[0].pressure',
    )
    input_timeout_s: float = parameter(
        0.5,
        'slip_valid becomes false within this time after the last sample.',
        unit='s',
        low=0.01,
        high=3600.0,
    )
    heartbeat_hz: float = parameter(
        10.0,
        'Rate at which slip and slip_valid repeat.',
        unit='Hz',
        low=0.1,
        high=1000.0,
        affects=('outputs',),
    )
    publish_groups: bool = parameter(
        True, 'Whether slip/group/... is published.', affects=('outputs',)
    )
    publish_channels: bool = parameter(
        True, 'Whether slip/channel/... is published.', affects=('outputs',)
    )
    autostart: bool = parameter(
        True, 'Whether the node configures and activates itself; else a lifecycle manager does.'
    )
    taxel_positions_m: tuple[float, ...] = parameter(
        (),
        'Where the channels are drawn: x, y, z of each, channel 1 first, in the frame of the '
        'samples; empty: in a grid.',
        unit='m',
        low=-10.0,
        high=10.0,
        allows='three numbers a channel, -10 to 10',
        heading='Fingertip',
    )

    def __post_init__(self) -> None:
        """Check the chain, and that all channels have a position or none has."""
        super().__post_init__()
        numbers = len(self.taxel_positions_m)
        if numbers not in (0, 3 * self.channels):
            raise ValueError(
                f'parameter taxel_positions_m has {numbers} numbers, allowed: '
                f'{3 * self.channels}, three for each channel, or none'
            )
