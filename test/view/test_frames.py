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

"""Binary frames: what is packed is unpacked, and each array stands where a browser can read it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from slip_detector.view.view_request import LENGTH, TYPES, packed, unpacked

TEXTS = st.text(max_size=20)
SHAPES = arrays.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=7)
KINDS = st.sampled_from([np.float32, np.uint8, np.bool_])


@given(
    header=st.dictionaries(TEXTS, TEXTS | st.integers() | st.booleans(), max_size=4),
    content=st.dictionaries(TEXTS, KINDS.flatmap(lambda k: arrays.arrays(k, SHAPES)), max_size=5),
)
def test_what_was_packed_is_unpacked_and_begins_at_multiples_of_four(header, content):
    header.pop('arrays', None)
    frame = packed(header, content)
    found, read = unpacked(frame)
    described = found.pop('arrays')
    assert found == header
    assert list(read) == list(content)
    for name, array in content.items():
        assert read[name].dtype in TYPES.values()
        assert np.array_equal(read[name], array, equal_nan=array.dtype == np.float32)
    place = LENGTH.size + LENGTH.unpack_from(frame)[0]
    for _, kind, shape in described:
        assert place % 4 == 0
        size = int(np.prod(shape)) * TYPES[kind].itemsize
        place += size + -size % 4
    assert place == len(frame)


def test_a_header_with_a_number_that_json_lacks_is_refused():
    with pytest.raises(ValueError, match='JSON'):
        packed({'age': float('nan')}, {})
