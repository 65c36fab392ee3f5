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

"""The parameters of the driver node."""

import dataclasses

from slip_detector.parameters.fields import parameter
from slip_detector.parameters.recording import RecordingConfig


@dataclasses.dataclass(frozen=True)
class DriverConfig(RecordingConfig):
    """Parameters of the driver node: where its samples come from and how it publishes them.

    Examples
    --------
    >>> config = DriverConfig(source='udp', channels=8)
    >>> config.udp_port
    47380
    """

    NODE = 'slip_driver'

    source: str = parameter(
        '',
        'Where the samples come from. There is no default: a simulation must not replace a sensor '
        'unnoticed.',
        choices=('', 'scene', 'recording', 'serial', 'udp'),
        allows='scene, recording, serial or udp',
    )
    scene: str = parameter('plate_400um', 'A scene that comes with the package, or a path.')
    seed: int = parameter(
        0, 'Seed of the noise; each seed is another trial.', low=0, high=2**31 - 1
    )
    recording: str = parameter(
        '', 'Path of the recording to play: npz, csv, mcap, db3, or the folder of a bag.'
    )
    rate: float = parameter(
        1.0, 'Playing speed as a multiple of real time.', low=0.001, high=1000.0
    )
    loop: bool = parameter(False, 'Whether to start again at the end; else the driver ends.')
    wait_for_subscribers: int = parameter(
        0, 'Number of subscribers to voltages that the first sample waits for.', low=0, high=1000
    )
    wait_for_grip: bool = parameter(
        False, 'Whether a scene with an object starts only with the first grip_force.'
    )
    frame_id: str = parameter('fingertip', 'frame_id of the samples.')
    samples_per_message: int = parameter(
        1,
        'More than one: samples are published in batches, as a std_msgs/Float32MultiArray with '
        'the layout sample, channel.',
        low=1,
        high=10_000,
    )
    channels: int = parameter(16, 'Channels that the sensor sends (serial, udp).', low=1, high=255)
    packet_values: str = parameter(
        'int16',
        'Type of the values in a packet (docs/packets.md).',
        choices=('int16', 'int24', 'int32', 'uint16', 'uint24', 'uint32'),
    )
    packet_scale_v: float = parameter(
        1e-3, 'Volts for each unit of a value in a packet.', unit='V', low=-1e9, high=1e9
    )
    packet_offset_v: float = parameter(
        0.0, 'Volts of the value 0 in a packet.', unit='V', low=-1e9, high=1e9
    )
    serial_port: str = parameter(
        '', 'Serial port; best its name in /dev/serial/by-id, which does not change.'
    )
    serial_baud: int = parameter(
        115200,
        'Rate of the serial port; no effect on USB.',
        unit='baud',
        low=50,
        high=20_000_000,
    )
    serial_format: str = parameter(
        'packet',
        'What the sensor sends: binary packets, or lines of text, which have no checksum.',
        choices=('packet', 'text'),
    )
    text_rate_hz: float = parameter(
        0.0,
        'Rate at which a sensor that sends text takes samples; 0: unknown, each line is stamped '
        'when it arrives.',
        unit='Hz',
        low=0.0,
        high=1e6,
    )
    udp_bind_address: str = parameter(
        '127.0.0.1',
        'Own address to listen on; 0.0.0.0: all, so that other machines can reach it.',
    )
    udp_port: int = parameter(47380, 'UDP port to listen on.', low=1, high=65535)
    udp_senders: tuple[str, ...] = parameter(
        ('127.0.0.1',), 'Addresses that may send; packets from others are dropped.'
    )
