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

"""Encoding messages all at once gives the bytes that rosbags gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings.message_encoder import JointStateEncoder

typesys = pytest.importorskip('rosbags.typesys', reason='needs rosbags')

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)


@given(
    n=st.integers(1, 20),
    channels=st.integers(1, 5),
    frame_id=st.text(max_size=5),
    data=st.data(),
)
def test_what_is_encoded_all_at_once_is_what_rosbags_encodes(n, channels, frame_id, data):
    volts = np.array(
        [[data.draw(st.floats(allow_nan=False)) for _ in range(channels)] for _ in range(n)]
    )
    stamps_ns = np.array(data.draw(st.lists(st.integers(0, 2**60), min_size=n, max_size=n)))
    names = [f'ch{i}' for i in range(channels)]
    raws = JointStateEncoder(STORE, frame_id, names).many(volts, stamps_ns)
    types, nothing = STORE.types, np.empty(0)
    for raw, row, stamp_ns in zip(raws, volts, stamps_ns.tolist(), strict=True):
        stamp = types['builtin_interfaces/msg/Time'](*divmod(stamp_ns, 1_000_000_000))
        header = types['std_msgs/msg/Header'](stamp, frame_id)
        message = types['sensor_msgs/msg/JointState'](header, names, row, nothing, nothing)
        assert raw == bytes(STORE.serialize_cdr(message, 'sensor_msgs/msg/JointState'))
