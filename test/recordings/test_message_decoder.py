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

"""Decoding messages all at once gives the bits that decoding them one by one gives."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.recordings import message_decoder
from slip_detector.recordings.field_paths import FieldReader
from slip_detector.recordings.message_decoder import MessageDecoder
from slip_detector.recordings.message_encoder import JointStateEncoder
from slip_detector.recordings.message_layout import read_layout

typesys = pytest.importorskip('rosbags.typesys', reason='needs rosbags')

STORE = typesys.get_typestore(typesys.Stores.ROS2_JAZZY)
NESTED = """
std_msgs/Header header
uint8 id
bool active
string<=12 label
test_msgs/Cell[] cells
test_msgs/Cell[2] pair
float32[3] fixed
int16[] counts
wrong_or_not state
"""
STORE.register(
    {
        **typesys.get_types_from_msg('int8 a\nfloat64 v\nuint16 b\n', 'test_msgs/msg/Cell'),
        **typesys.get_types_from_msg('', 'test_msgs/msg/Nothing'),
        **typesys.get_types_from_msg(
            NESTED.replace('wrong_or_not', 'test_msgs/Nothing'), 'test_msgs/msg/Nested'
        ),
    }
)
FLOATS = st.floats(allow_nan=False, allow_infinity=False, width=32)


@st.composite
def cells(draw):
    make = STORE.types['test_msgs/msg/Cell']
    return make(draw(st.integers(-128, 127)), draw(FLOATS), draw(st.integers(0, 65535)))


@st.composite
def nested(draw, n_cells, label):
    types = STORE.types
    stamp = types['builtin_interfaces/msg/Time'](
        draw(st.integers(-(2**31), 2**31 - 1)), draw(st.integers(0, 999_999_999))
    )
    return types['test_msgs/msg/Nested'](
        header=types['std_msgs/msg/Header'](stamp, label),
        id=draw(st.integers(0, 255)),
        active=draw(st.booleans()),
        label=label,
        cells=[draw(cells()) for _ in range(n_cells)],
        pair=[draw(cells()), draw(cells())],
        fixed=np.array([draw(FLOATS) for _ in range(3)], dtype=np.float32),
        counts=np.array(draw(st.lists(st.integers(-9, 9), min_size=2, max_size=2)), np.int16),
        state=types['test_msgs/msg/Nothing'](),
    )


PATHS = ['id', 'active', 'cells[].v', 'cells[0].a', 'cells[].b', 'pair[].v', 'pair[1].b', 'fixed',
         'fixed[2]', 'counts', 'header.stamp.nanosec']  # fmt: skip


@given(
    path=st.sampled_from(PATHS),
    little=st.booleans(),
    labels=st.lists(st.sampled_from(['', 'tip', 'thumb', 'a']), min_size=1, max_size=6),
    n_cells=st.integers(1, 3),
    few=st.booleans(),
    data=st.data(),
)
def test_all_at_once_is_as_one_by_one(path, little, labels, n_cells, few, data):
    msgtype = 'test_msgs/msg/Nested'
    messages = [data.draw(nested(n_cells, label)) for label in labels]
    raws = [bytes(STORE.serialize_cdr(one, msgtype, little_endian=little)) for one in messages]
    with pytest.MonkeyPatch.context() as patch:
        if few:
            patch.setattr(message_decoder, 'MOST_LAYOUTS', 1)
        decoded = MessageDecoder(STORE, msgtype, path).many(raws, range(len(raws)))
    one_by_one = MessageDecoder(STORE, msgtype, path)
    rows, stamps_ns, _ = zip(*map(one_by_one.one, raws), strict=True)
    assert decoded.volts.tobytes() == np.concatenate(rows).tobytes()
    # An empty stamp is the time of receipt.
    wanted = [own or received for own, received in zip(stamps_ns, range(len(raws)), strict=True)]
    assert decoded.stamps_ns.tolist() == wanted
    assert decoded.which.tolist() == list(range(len(raws)))
    # They have a layout, so they were not decoded one by one.
    assert few or read_layout(raws[0], STORE, msgtype, FieldReader(path)).places.size


@given(st.data())
def test_a_damaged_message_is_left_out_and_never_a_crash(data):
    msgtype = 'sensor_msgs/msg/JointState'
    volts = np.arange(12.0).reshape(4, 3)
    raws = JointStateEncoder(STORE, 'tip', ['a', 'b', 'c']).many(volts, np.arange(4))
    damaged = bytearray(raws[2])
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    raws[2] = bytes(damaged[: data.draw(st.integers(0, len(damaged)))])
    decoder = MessageDecoder(STORE, msgtype, 'position')
    decoder.many(raws[:1], [0])
    decoded = decoder.many(raws, range(4))
    assert {0, 1, 3} <= set(decoded.which.tolist())
    kept = np.repeat(decoded.which, decoded.samples) != 2
    np.testing.assert_array_equal(decoded.volts[kept], volts[[0, 1, 3]])


def test_a_time_of_receipt_beyond_64_bits_is_refused():
    raws = JointStateEncoder(STORE, 'tip', ['a']).many(
        np.ones((1, 1)), np.zeros(1, dtype=np.int64)
    )
    with pytest.raises(ValueError, match='received beyond the year 2262'):
        MessageDecoder(STORE, 'sensor_msgs/msg/JointState', 'position').many(raws, [2**64 - 1])
