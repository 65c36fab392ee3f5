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

"""Serialised messages as they come from the middleware."""

import numpy as np
import pytest
from hypothesis import strategies as st

pytest.importorskip('rclpy', reason='needs rclpy')

from fuzz.fuzzing import fuzz, mutated_bytes
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32MultiArray, MultiArrayDimension, MultiArrayLayout

from slip_detector.nodes.inputs import Input
from slip_detector.nodes.messages import stamp_ns
from slip_detector.parameters.detector import DetectorConfig

pytestmark = pytest.mark.nodes

INFO = {'source_timestamp': 7, 'publication_sequence_number': 3}


def joint_state(position=(1.0, 2.0), name=('a', 'bc'), frame_id='tip', sec=5):
    message = JointState(position=position, name=list(name))
    message.header.frame_id, message.header.stamp.sec = frame_id, sec
    return message


def batch(**sizes):
    dims = [MultiArrayDimension(label=label, size=size) for label, size in sizes.items()]
    return Float32MultiArray(data=[1.0, 2.0, 3.0, 4.0], layout=MultiArrayLayout(dim=dims))


#: By type the field that is read, and messages.
READ = {
    'sensor_msgs/msg/JointState': (
        'position',
        [joint_state(), joint_state(frame_id=''), joint_state([], [])],
    ),
    'std_msgs/msg/Float32MultiArray': (
        'data',
        [batch(), batch(sample=2, channel=2), batch(channel=2**31, sample=2**31)],
    ),
    'geometry_msgs/msg/WrenchStamped': ('wrench.force.z, wrench.torque.x', [WrenchStamped()]),
}
SOUND = {kind: [serialize_message(each) for each in some] for kind, (_, some) in READ.items()}


def check(case):
    """Read messages one after the other: each as rclpy reads it, whatever came before."""
    kind, messages = case
    source = Input(DetectorConfig(input_type=kind, input_field=READ[kind][0]))
    for raw in messages:
        if kind != 'sensor_msgs/msg/JointState':
            assert source.read(raw, INFO)[0].volts.ndim == 2
            continue
        try:
            message = deserialize_message(raw, JointState)
        except (RuntimeError, UnicodeDecodeError):
            message = None
        try:
            samples, _ = source.read(raw, INFO)
        except ValueError:
            # rclpy reads those of machines with another order of bytes, too.
            assert message is None or not len(message.position) or not raw.startswith(b'\0\1')
            raise
        if message is None:
            # One like it was sound up to its positions, and nothing behind them is used.
            assert samples.volts.shape[0] == 1
            continue
        np.testing.assert_array_equal(samples.volts, [message.position])
        assert (samples.names, samples.frame_id) == (tuple(message.name), message.header.frame_id)
        assert samples.stamps_ns == (stamp_ns(message.header.stamp) or INFO['source_timestamp'])


SIGNALLING_NAN = b'\x00\x00\x81\x7f'


@st.composite
def sequences(draw):
    kind = draw(st.sampled_from(list(SOUND)))
    return kind, draw(st.lists(mutated_bytes(SOUND[kind], most=2), min_size=1, max_size=3))


def test_any_messages_are_read_as_rclpy_reads_them_or_refused():
    kind, batches, _ = SOUND
    one = SOUND[kind][0]
    corpus = [
        (kind, [b'']),
        (kind, [one[:-1], one]),
        (batches, [SOUND[batches][0][:-4] + SIGNALLING_NAN]),
    ]
    fuzz(sequences(), check, corpus=corpus, few=100)
