"""The parameters of the slip chain and of the detector node that runs it."""

import dataclasses

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.sets import ParameterSet

#: Lowest band edge as a share of the sample rate: a filter with a lower one is lost to round-off.
LOWEST_EDGE = 1e-5

#: The values of the parameter ``common_mode``.
COMMON_MODES = ('none', 'median', 'mean')

#: Channels of the paper's fingertip.
PAPER_CHANNELS = 16

#: The paper's Table 1. We read its letters as follows. T: units that feel shear across the finger,
#: of the proximal (P) or the distal (D) sensors. L: units that feel shear along the finger, of the
#: radial (R) or the ulnar (U) sensors.
PAPER_GROUPS: dict[str, tuple[int, ...]] = {
    'TP': (14, 16, 11, 9),
    'TD': (1, 3, 8, 6),
    'LR': (5, 7, 12, 10),
    'LU': (2, 4, 15, 13),
}


def default_channel_names(channels: int) -> tuple[str, ...]:
    """Return the names of channels that have none of their own.

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
        380.0, 'Rate at which samples are taken.', unit='Hz', low=1.0, high=1e6
    )
    channels: int = parameter(16, 'Number of channels in a sample.', low=1, high=1_000_000)
    channel_names: tuple[str, ...] = parameter(
        (),
        'Names the input must carry; empty: ch1, ch2, ... and any names are taken.',
        allows='letters, digits, _',
    )
    disabled_channels: tuple[int, ...] = parameter(
        (),
        'Channels (counted from 1) that are neither computed nor asked to vote.',
        allows='1 to the number of channels',
    )
    valid_range_v: tuple[float, float] = parameter(
        (-1e9, 1e9),
        'Lowest and highest value a working channel can give; beyond it a sample is bad.',
        unit='V',
        low=-1e12,
        high=1e12,
    )
    flat_after_s: float = parameter(
        1.0,
        'A channel that repeats one value this long leaves the vote; 0: no such check.',
        unit='s',
        low=0.0,
        high=3600.0,
    )
    max_gap_s: float = parameter(
        0.1,
        'A shorter gap in the input is bridged with the last row, a longer one resets the chain.',
        unit='s',
        low=0.0,
        high=60.0,
    )
    common_mode: str = parameter(
        'none',
        'What all channels share and is taken off each row: none, median or mean.',
        choices=COMMON_MODES,
    )
    passband_hz: tuple[float, float] = parameter(
        (7.0, 50.0),
        'Edges of the band-pass; a high edge of 0 makes it a high-pass.',
        unit='Hz',
        allows='1e-5 of the sample rate to below half of it',
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
        'Edges low, high of each stop-band (Eq. 4), where the ripple ends; [] for none.',
        unit='Hz',
        allows='as passband_hz',
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
        'full', 'Rectifier: full wave or half wave (Eq. 3).', choices=('full', 'half')
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
    threshold: float = parameter(0.5, 'Level above which a channel is ON.', low=1e-30, high=1e30)
    vote: str | int = parameter(
        'all',
        'When a group is ON: all its channels, a whole number k of them, or mean '
        '(the geometric mean of level / threshold exceeds 1).',
        allows='all, mean, or 1 to the size of the smallest group',
    )
    groups: dict[str, tuple[int, ...]] = parameter(
        {},
        'Channels (counted from 1) of each group; none given: Table 1 for 16 channels, '
        'else one group named all.',
        allows='each enabled channel in one group',
    )

    def __post_init__(self) -> None:
        """Check the fields against each other and fill in the groups."""
        super().__post_init__()
        self._check_channels()
        if not self.groups:
            object.__setattr__(self, 'groups', self._default_groups())
        self._check_groups()
        self._check_filters()
        for name in ('envelope_window_s', 'decision_window_s'):
            seconds = getattr(self, name)
            if seconds * self.sample_rate_hz < 1 - 1e-6:
                raise ValueError(
                    f'parameter {name} is {seconds:g} s, allowed: at least one sample '
                    f'({1 / self.sample_rate_hz:.6g} s at {self.sample_rate_hz:g} Hz)'
                )
        low, high = self.valid_range_v
        if low >= high:
            raise ValueError(
                f'parameter valid_range_v is [{low:g}, {high:g}] V, allowed: low below high'
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels: those configured, else ch1, ch2, ..."""
        return self.channel_names or default_channel_names(self.channels)

    def samples(self, seconds: float) -> int:
        """Return the number of samples in a time, at least one."""
        return max(1, round(seconds * self.sample_rate_hz))

    def _default_groups(self) -> dict[str, tuple[int, ...]]:
        disabled = set(self.disabled_channels)
        groups = {'all': tuple(range(1, self.channels + 1))}
        if self.channels == PAPER_CHANNELS:
            groups = dict(PAPER_GROUPS)
        left = {n: tuple(c for c in members if c not in disabled) for n, members in groups.items()}
        return {name: members for name, members in left.items() if members}

    def _check_channels(self) -> None:
        if self.channel_names and len(self.channel_names) != self.channels:
            raise ValueError(
                f'parameter channel_names has {len(self.channel_names)} names, '
                f'allowed: {self.channels}, the number of channels'
            )
        for channel in self.disabled_channels:
            if not 1 <= channel <= self.channels:
                raise ValueError(
                    f'parameter disabled_channels has {channel}, allowed: 1 to {self.channels}'
                )
        if len(set(self.disabled_channels)) == self.channels:
            raise ValueError(
                'parameter disabled_channels names every channel, allowed: all but one'
            )

    def _check_groups(self) -> None:
        group_of: dict[int, str] = {}
        disabled = set(self.disabled_channels)
        for name, members in self.groups.items():
            where = f'parameter groups.{name}'
            if not members:
                raise ValueError(f'{where} is empty, allowed: at least one channel')
            for channel in members:
                if not 1 <= channel <= self.channels:
                    raise ValueError(
                        f'{where} has channel {channel}, allowed: 1 to {self.channels}'
                    )
                if channel in group_of:
                    raise ValueError(
                        f'{where} has channel {channel}, which is in {group_of[channel]} already, '
                        'allowed: one group for a channel'
                    )
                group_of[channel] = name
            able = len(set(members) - disabled)
            if isinstance(self.vote, int) and 0 < able < self.vote:
                raise ValueError(
                    f'parameter vote is {self.vote}, allowed: at most {able}, the enabled '
                    f'channels of group {name}'
                )
        for channel in range(1, self.channels + 1):
            if channel not in group_of and channel not in disabled:
                raise ValueError(
                    f'parameter groups leaves out channel {channel}, allowed: every channel in '
                    'one group or in disabled_channels'
                )

    def _check_filters(self) -> None:
        low, high = self.passband_hz
        self._check_edge('passband_hz', low)
        if high != 0.0:
            self._check_edge('passband_hz', high)
            self._check_order('passband_hz', low, high)
            if self.passband_degree % 2:
                raise ValueError(
                    f'parameter passband_degree is {self.passband_degree}, allowed: an even '
                    'number (a band-pass has two edges of equal degree)'
                )
        for pair in self.stopbands_hz:
            for edge in pair:
                self._check_edge('stopbands_hz', edge)
            self._check_order('stopbands_hz', *pair)
        if self.stopband_degree % 2:
            raise ValueError(
                f'parameter stopband_degree is {self.stopband_degree}, allowed: an even number'
            )

    def _check_edge(self, name: str, edge_hz: float) -> None:
        # 1e-5 of a rate is often a last digit above what a person writes for it.
        lowest = LOWEST_EDGE * self.sample_rate_hz * (1 - 1e-12)
        nyquist = self.sample_rate_hz / 2
        if not lowest <= edge_hz < nyquist:
            raise ValueError(
                f'parameter {name} has the edge {edge_hz:g} Hz, allowed: {lowest:g} Hz to below '
                f'{nyquist:g} Hz (half the sample rate)'
            )

    @staticmethod
    def _check_order(name: str, low_hz: float, high_hz: float) -> None:
        if low_hz >= high_hz:
            raise ValueError(
                f'parameter {name} has the edges {low_hz:g} and {high_hz:g} Hz, allowed: the '
                'low edge first'
            )


@dataclasses.dataclass(frozen=True)
class DetectorConfig(ChainConfig):
    """Parameters of the detector node: the chain's and those of its input and topics.

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
        allows='any that is installed, as package/msg/Type',
    )
    input_field: str = parameter(
        'position',
        'Where in it the channels are.',
        allows='a field, or a path as wrench.force.x, pillars[].fz or tactiles[0].pressure',
    )
    input_timeout_s: float = parameter(
        0.5,
        'slip_valid falls within this time of the last sample.',
        unit='s',
        low=0.01,
        high=3600.0,
    )
    heartbeat_hz: float = parameter(
        10.0, 'Rate at which slip and slip_valid repeat.', unit='Hz', low=0.1, high=1000.0
    )
    publish_groups: bool = parameter(True, 'Whether slip/group/... is published.')
    publish_channels: bool = parameter(True, 'Whether slip/channel/... is published.')
    autostart: bool = parameter(
        True, 'Whether the node configures and activates itself; else a lifecycle manager does.'
    )
