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

"""The parameters of the driver node, and those of them that describe a recording."""

from slip_detector.parameters.fields import parameter, read_paths
from slip_detector.parameters.sets import ParameterSet


class RecordingConfig(ParameterSet):
    """Where in a recording the samples and the labels are, and how they are read.

    The driver, the evaluation and the tuner read these parameters from the section ``slip_driver``
    of a parameter file.

    Examples
    --------
    >>> RecordingConfig(recording_topic='/left/voltages').recording_volts_key
    'volts'
    """

    NODE = 'slip_driver'

    recording_topic: str = parameter('', 'Topic of a bag with the samples; empty: any voltages.')
    recording_field: str = parameter(
        '', 'Field with the channels, as input_field; empty: position or data.', read=read_paths
    )
    recording_labels: str = parameter(
        '', 'File of labels, or a folder of such; empty: <name>.labels.yaml beside the recording.'
    )
    recording_truth_topic: str = parameter('slip_truth', 'Topic of true slip (Bool, on change).')
    recording_position_topic: str = parameter(
        'platform_position', 'Second choice: topic of a position that changes in slip (Eq. 9).'
    )
    recording_still_m: float = parameter(
        0.0, 'Largest change of the position from message to message at rest.', (0.0, 1.0, 'm')
    )
    recording_resample: bool = parameter(False, 'Resample other rates (slip_evaluate, slip_tune).')
    recording_limit_mb: float = parameter(
        1024.0, 'Largest piece in memory; reading takes up to four times that.', (1.0, 1e6, 'MB')
    )
    recording_volts_key: str = parameter('volts', 'Name of the array of rows in an npz recording.')
    recording_rate_key: str = parameter('sample_rate_hz', 'Name of the sample rate in an npz.')
    recording_truth_key: str = parameter(
        'slip', 'Name of the column or array of true slip; absent: no truth is published.'
    )


class DriverConfig(RecordingConfig):
    """Parameters of the driver node: where its samples come from and how it publishes them.

    Examples
    --------
    >>> config = DriverConfig(source='udp', channels=8)
    >>> config.udp_port
    47380
    """

    source: str = parameter(
        '',
        'Where the samples come from; no default: a simulation must not pass for a sensor.',
        choices=('', 'scene', 'recording', 'serial', 'udp'),
        allows='scene, recording, serial or udp',
    )
    scene: str = parameter('plate_400um', 'A scene that comes with the package, or a path.')
    seed: int = parameter(0, 'Seed of the noise; each seed is another trial.', (0, 2**31 - 1))
    recording: str = parameter('', 'Recording to play: npz, csv, mcap, db3 or folder of a bag.')
    rate: float = parameter(1.0, 'Playing speed as a multiple of real time.', (0.001, 1000.0))
    loop: bool = parameter(False, 'Whether the driver starts again at the end; else it ends.')
    wait_for_subscribers: int = parameter(
        0, 'Number of subscribers to voltages that the first sample waits for.', (0, 1000)
    )
    wait_for_grip: bool = parameter(False, 'Whether a scene with an object waits for grip_force.')
    frame_id: str = parameter('fingertip', 'frame_id of the samples.')
    samples_per_message: int = parameter(
        1, 'Above 1: batches of samples, as std_msgs/Float32MultiArray.', (1, 10_000)
    )
    channels: int = parameter(16, 'Channels that the sensor sends (serial, udp).', (1, 255))
    packet_values: str = parameter(
        'int16',
        'Type of the values in a packet (docs/packets.md).',
        choices=('int16', 'int24', 'int32', 'uint16', 'uint24', 'uint32'),
    )
    packet_scale_v: float = parameter(1e-3, 'Volts of one unit in a packet.', (-1e9, 1e9, 'V'))
    packet_offset_v: float = parameter(0.0, 'Volts of the value 0 in a packet.', (-1e9, 1e9, 'V'))
    serial_port: str = parameter('', 'Serial port; its name in /dev/serial/by-id does not change.')
    serial_baud: int = parameter(115200, 'Baud rate; no effect on USB.', (50, 20_000_000, 'baud'))
    serial_format: str = parameter(
        'packet', 'Binary packets, or lines of text without checksum.', choices=('packet', 'text')
    )
    text_rate_hz: float = parameter(
        0.0, 'Rate of the lines of text; 0: each is stamped as it arrives.', (0.0, 1e6, 'Hz')
    )
    udp_bind_address: str = parameter(
        '127.0.0.1', 'Own address to listen on; 0.0.0.0: all, also for other machines.'
    )
    udp_port: int = parameter(47380, 'UDP port to listen on.', (1, 65535))
    udp_senders: tuple[str, ...] = parameter(
        ('127.0.0.1',), 'Addresses that may send; packets from others are dropped.'
    )
