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

"""The parameters of the detector node: those of its chain, and those of its input and topics."""

from slip_detector.parameters import fields
from slip_detector.parameters.chain import ChainConfig
from slip_detector.parameters.fields import parameter


class DetectorConfig(ChainConfig):
    """Parameters of the detector node: those of the chain, and those of its input and topics.

    Examples
    --------
    >>> config = DetectorConfig(input_type='std_msgs/msg/Float32MultiArray', input_field='data')
    >>> config.heartbeat_hz, config.threshold
    (10.0, 0.5)
    """

    input_type: str = parameter(
        'sensor_msgs/msg/JointState',
        'Message type of the topic voltages.',
        allows='any installed type, as package/msg/Type',
        heading='Input and topics',
        affects='input display',
    )
    input_field: str = parameter(
        'position',
        'Field of the message that has the channels, or a list of several, side by side.',
        allows='paths such as position, pillars[].fz, tactiles[0].pressure, tactiles[].pac[:]',
        read=fields.read_paths,
        affects='input display',
    )
    input_timeout_s: float = parameter(
        0.5, 'slip_valid becomes false within this time after a sample.', (0.01, 3600.0, 's')
    )
    max_age_s: float = parameter(
        0.0, 'Largest distance of valid stamps from the clock; 0: no check.', (0.0, 3600.0, 's')
    )
    heartbeat_hz: float = parameter(10.0, 'Least rate of slip, slip_valid.', (0.1, 1000.0, 'Hz'))
    publish_groups: bool = parameter(True, 'Publish slip/group/<name>.', affects='display')
    publish_channels: bool = parameter(True, 'Publish slip/channel/<name>.')
    autostart: bool = parameter(
        True, 'Whether it activates itself; else a lifecycle manager does.', affects='start'
    )
    taxel_positions_m: tuple[float, ...] = parameter(
        (),
        'x, y, z of each channel in the frame of the samples, for drawing; empty: in a grid.',
        (-10.0, 10.0, 'm'),
        allows='three numbers a channel, -10 to 10',
        heading='Fingertip',
    )

    def __post_init__(self) -> None:
        """Check the chain, and that all channels have a position or none has."""
        super().__post_init__()
        numbers, wanted = len(self.taxel_positions_m), 3 * self.channels
        text = f'{wanted}, three for each channel, or none'
        self.require(numbers in (0, wanted), 'taxel_positions_m', text, f'has {numbers} numbers')


#: Parameters of the detector that cannot change while the node runs.
FIXED_PARAMETERS = fields.names_that_affect(DetectorConfig, 'start')

#: Parameters that only the node has, and not its chain: its decisions do not depend on them.
NODE_PARAMETERS = DetectorConfig.__dataclass_fields__.keys() - ChainConfig.__dataclass_fields__
