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

"""The parameter file of each sensor, on what its driver sends: a slide in that is found.

The definitions are those of the drivers' .msg files, with their names, types and order; each
parameter file says where its driver is.
"""

import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('rosbags', reason='needs rosbags')

from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import RecordingConfig
from slip_detector.recordings import open_recording
from support.bags import START_NS, Bag, gathered
from support.evaluation_cases import report_of
from support.interfaces import PILLAR, PILLARS

FILES = Path(__file__).parents[2] / 'config' / 'sensors'


def of_ros1(definition):
    """Return a definition of Contactile as in ROS 1: with capitals, and a header."""
    upper = re.sub(r'[xyz]\n', lambda match: match[0].upper(), definition)
    return f'Header header\n{upper}'


def of_pillars(package, definition_of):
    """Return the definitions of Contactile's sensor."""
    parts = {'PillarState': PILLAR, 'SensorState': PILLARS}
    return {f'{package}/msg/{name}': definition_of(part) for name, part in parts.items()}


#: Lengths of lists whose length a definition leaves open.
SIZES = {'sensors': 2, 'taxels': 16, 'pillars': 9}

#: Of each sensor the type of its numbers and the definitions, the last of which is its topic's.
SENSORS = {
    'xela_uskin': (
        np.uint16,
        {
            'xela_server_ros2/msg/Taxel': 'uint16 x\nuint16 y\nuint16 z\n',
            'xela_server_ros2/msg/Forces': 'float32 x\nfloat32 y\nfloat32 z\n',
            'xela_server_ros2/msg/SensorFull': 'uint32 message\nfloat64 time\nstring model\n'
            'uint8 sensor_pos\nTaxel[] taxels\nForces[] forces\n',
            'xela_server_ros2/msg/SensStream': 'SensorFull[] sensors\n',
        },
    ),
    'papillarray': (np.float32, of_pillars('sensor_interfaces', str)),
    'papillarray of ROS 1': (np.float32, of_pillars('papillarray_ros_v2', of_ros1)),
    'anyskin': (np.float32, {'std_msgs/msg/Float32MultiArray': ''}),
    'biotac of ROS 1': (
        np.int16,
        {
            'sr_robot_msgs/msg/Biotac': 'int16 pac0\nint16 pac1\nint16[] pac\nint16 pdc\n\n'
            'int16 tac\nint16 tdc\n\nint16[] electrodes\n',
            'sr_robot_msgs/msg/BiotacAll': 'Header header\nBiotac[5] tactiles\n',
        },
    ),
    'robotiq_tsf85': (
        np.int16,
        {'robotiq_tsf/msg/Data1': 'int16 value\n', 'robotiq_tsf/msg/Dynamic': 'Data1[2] data\n'},
    ),
    'wuji_hand': (
        np.float32,
        {
            'wujihand_tactile_msgs/msg/TactileFrame': 'std_msgs/Header header\nuint8 hand\n'
            'uint16 sequence\nuint32 device_timestamp_ms\nfloat32[768] pressure\n'
        },
    ),
    'pr2_fingertip of ROS 1': (
        np.int16,
        {
            'pr2_msgs/msg/PressureState': 'Header header\n'
            'int16[] l_finger_tip\nint16[] r_finger_tip\n'
        },
    ),
    'wrench': (
        np.float64,
        {f'geometry_msgs/msg/{name}': '' for name in ('Vector3', 'Wrench', 'WrenchStamped')},
    ),
    'imu of ROS 1': (np.float64, {'geometry_msgs/msg/Vector3': '', 'sensor_msgs/msg/Imu': ''}),
}

#: Time from a sample to its receipt, where messages have a header.
LATE_NS = 3_000_000

#: Begin and end of the slides, and of the recording.
SLIDES_S = [[3.0, 3.6], [5.5, 6.1]]
END_S = 6.5


def blank(bag, kind, of, size):
    """Return zeros for a field, as rosbags describes it."""
    if kind.name == 'BASE':
        return '' if of[0] == 'string' else 0
    if kind.name == 'NAME':
        return made(bag, of)
    (inner, what), most = of
    number = most if kind.name == 'ARRAY' else size
    if inner.name == 'BASE':
        return np.zeros(number, what[0])
    return [blank(bag, inner, what, 0) for _ in range(number)]


def made(bag, msgtype):
    """Return a message of zeros."""
    fields = bag.store.fielddefs[msgtype][1]
    zeros = {name: blank(bag, *kind, SIZES.get(name, 0)) for name, kind in fields}
    return bag.make(msgtype, **zeros)


def fill(message, paths, columns):
    """Put columns of numbers into the fields of a message that these paths lead to, in order."""
    for path, part in zip(paths, np.array_split(columns, len(paths)), strict=True):
        *names, last = path.removesuffix('[:]').split('.')
        parents = [message]
        for name in names:
            inner = [getattr(parent, name.removesuffix('[]')) for parent in parents]
            parents = [each for one in inner for each in one] if name[-1] == ']' else inner
        for parent, own in zip(parents, np.array_split(part, len(parents)), strict=True):
            # In ROS 1 the same fields may have capitals.
            (name,) = (each for each in vars(parent) if each.lower() == last.lower())
            is_array = isinstance(getattr(parent, name), np.ndarray)
            setattr(parent, name, own.ravel() if is_array else own.item())


def volts(config, dtype):
    """Return noise of some times the least floor, and slides in the middle of the band."""
    rate_hz, (low_hz, high_hz) = config.sample_rate_hz, config.passband_hz
    times_s = np.arange(round(END_S * rate_hz)) / rate_hz
    middle_hz = (low_hz + (high_hz or 2 * low_hz)) / 2
    slides = sum((times_s >= begin) & (times_s < end) for begin, end in SLIDES_S)
    rows = np.random.default_rng(0).standard_normal((len(times_s), config.channels))
    rows += (20 * slides * np.sin(2 * np.pi * middle_hz * times_s))[:, np.newaxis]
    rows = 1000 + 3 * rows
    if np.issubdtype(dtype, np.integer):
        return np.rint(rows).astype(dtype)
    return (np.array(config.noise_floor) * rows).astype(dtype)


@pytest.mark.parametrize('sensor', SENSORS)
def test_a_slide_in_what_the_driver_sends_is_found(tmp_path, capsys, sensor):
    name, _, is_ros1 = sensor.partition(' of ')
    dtype, definitions = SENSORS[sensor]
    config = DetectorConfig.from_yaml(FILES / f'{name}.yaml')
    where = RecordingConfig.from_yaml(FILES / f'{name}.yaml')
    rows = volts(config, dtype)
    if name == 'wuji_hand':
        rows[:, ::3] = np.nan
    *_, msgtype = definitions
    assert config.input_type.rpartition('/')[2] == msgtype.rpartition('/')[2]
    period_ns = 1e9 / config.sample_rate_hz
    per_message = 20 if '[:]' in config.input_field else 1
    path = tmp_path / ('bag.bag' if is_ros1 else 'bag')
    with Bag(path, definitions=[pair for pair in definitions.items() if pair[1]]) as bag:
        message = made(bag, msgtype)
        for last in range(per_message - 1, len(rows), per_message):
            columns = rows[last - per_message + 1 : last + 1].T
            fill(message, config.input_field.split(', '), columns)
            stamp_ns = START_NS + round(last * period_ns)
            if hasattr(message, 'header'):
                message.header = bag.header(stamp_ns)
                stamp_ns += LATE_NS
            bag.write(f'/{where.recording_topic.strip("/")}', message, stamp_ns)
    (tmp_path / 'bag.labels.yaml').write_text(f'slip_s: {SLIDES_S}')
    recording = open_recording(path, where)
    read = gathered(recording)
    np.testing.assert_array_equal(read.volts, rows)
    wanted_ns = START_NS + np.arange(len(rows)) * period_ns
    assert np.abs(read.stamps_ns - wanted_ns).max() < 1000
    assert recording.counts.dropped == 0
    (report,) = report_of(capsys, path, '--config', f'sensors/{name}.yaml').values()
    assert (report['matched'], report['slips'], report['false_alarms']) == (2, 2, 0)
    assert report['coverage'] > 0.6
