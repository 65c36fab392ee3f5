"""The parameters of the driver node."""

import dataclasses

from slip_detector.parameters.sets import ParameterSet, parameter


@dataclasses.dataclass(frozen=True)
class DriverConfig(ParameterSet):
    """Parameters of the driver node."""

    NODE = 'slip_driver'

    source: str = parameter(
        'scene',
        'Where the samples come from.',
        choices=('scene', 'recording', 'serial', 'udp'),
    )
    scene: str = parameter('plate_400um', 'A scene that comes with the package, or a path.')
    seed: int = parameter(0, 'Seed of the noise; one seed is one trial.', low=0, high=2**31 - 1)
    recording: str = parameter(
        '', 'Path of the recording to play: npz, csv, mcap, db3, or the folder of a bag.'
    )
    recording_topic: str = parameter(
        '', 'Topic of a bag that has the samples; empty: voltages, in whichever namespace it is.'
    )
    recording_field: str = parameter(
        '',
        'Field of its messages that has the channels, as pac or pillars[].fz; empty: position '
        'of a JointState, data of a MultiArray.',
    )
    recording_labels: str = parameter(
        '',
        'YAML file of the intervals with slip, or a folder of them; empty: <name>.labels.yaml '
        'beside the recording, if it is there.',
    )
    recording_truth_topic: str = parameter(
        'slip_truth', 'Topic of a bag (Bool, on change) that says whether there is slip.'
    )
    recording_position_topic: str = parameter(
        'platform_position',
        'Topic of a bag whose position changes while there is slip (Eq. 9), where no Bool says.',
    )
    recording_still_m: float = parameter(
        0.0,
        'A change of that position from message to message up to this is rest.',
        unit='m',
        low=0.0,
        high=1.0,
    )
    recording_resample: bool = parameter(
        False,
        'Whether slip_evaluate and slip_tune bring a recording to the rate of the chain; the '
        'driver plays it at its own.',
    )
    recording_volts_key: str = parameter('volts', 'Name of the array of rows in an npz recording.')
    recording_rate_key: str = parameter(
        'sample_rate_hz', 'Name of the number in an npz recording that is its rate.'
    )
    recording_truth_key: str = parameter(
        'slip', 'Name of the column or array of true slip; absent: no truth is published.'
    )
    rate: float = parameter(1.0, 'How many times real time to play.', low=0.001, high=1000.0)
    loop: bool = parameter(False, 'Whether to start again at the end; else the driver ends.')
    wait_for_subscribers: int = parameter(
        0, 'Begin when so many subscribe to voltages, lest they miss the first.', low=0, high=1000
    )
    wait_for_grip: bool = parameter(
        False, 'Whether a scene with an object begins when a first grip_force has come.'
    )
    frame_id: str = parameter('fingertip', 'frame_id of the samples.')
    samples_per_message: int = parameter(
        1,
        'More than one: samples come in batches, as a std_msgs/Float32MultiArray of the layout '
        'sample, channel.',
        low=1,
        high=10_000,
    )
    channels: int = parameter(16, 'Channels that the sensor sends (serial, udp).', low=1, high=255)
    frame_values: str = parameter(
        'int16',
        'How a frame carries a value (docs/frame.md).',
        choices=('int16', 'int24', 'int32', 'uint16', 'uint24', 'uint32'),
    )
    frame_scale_v: float = parameter(
        1e-3, 'Volts for each unit of a value in a frame.', unit='V', low=-1e9, high=1e9
    )
    frame_offset_v: float = parameter(
        0.0, 'Volts of the value 0 in a frame.', unit='V', low=-1e9, high=1e9
    )
    serial_port: str = parameter(
        '', 'The port, for source: serial; best a name of it that stays, in /dev/serial/by-id.'
    )
    serial_baud: int = parameter(
        115200, 'Rate of the port; without effect on USB.', unit='baud', low=50, high=20_000_000
    )
    serial_format: str = parameter(
        'frame',
        'What comes from the port: binary frames, or lines of text, which have no checksum.',
        choices=('frame', 'text'),
    )
    text_rate_hz: float = parameter(
        0.0,
        'Rate at which the sensor takes lines of text; 0: unknown, stamped when they arrive.',
        unit='Hz',
        low=0.0,
        high=1e6,
    )
    udp_bind_address: str = parameter(
        '127.0.0.1', 'Own address to listen on; 0.0.0.0: all, to be had from outside.'
    )
    udp_port: int = parameter(47380, 'Port to listen on.', low=1, high=65535)
    udp_senders: tuple[str, ...] = parameter(
        ('127.0.0.1',), 'Addresses that may send; those of others are dropped.'
    )
