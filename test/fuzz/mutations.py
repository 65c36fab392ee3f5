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

"""Values of parameters about what is allowed, and valid bytes and texts with random damage."""

import dataclasses
import math

from hypothesis import strategies as st

#: Values that hardly any parameter takes.
STRANGE = st.one_of(
    *(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5)),
    st.sampled_from(['٣', '1e400', 10**400, -(10**400), math.nan, math.inf, -0.0, 5e-324]),
    st.lists(st.one_of(st.integers(-2, 20), st.floats(), st.text(max_size=2)), max_size=4),
    st.dictionaries(st.text(max_size=2), st.integers(), max_size=2),
)


def near(field):
    """Draw values about which a parameter is taken or refused."""
    default = field.metadata['default']
    low, high = field.metadata['low'], field.metadata['high']
    bounds = [bound for bound in (low, high) if bound is not None]
    values = [default, *bounds, *(bound + 1 for bound in bounds), *(-bound for bound in bounds)]
    if isinstance(default, (int, float)) and not isinstance(default, bool):
        values += [0, 1, 2, default * 2, default / 3]
    return st.sampled_from([*values, *field.metadata['choices']])


@st.composite
def some_values(draw, parameters, most):
    """Draw values of some parameters of a set: mostly some that are taken, at times any."""
    fields = st.sampled_from(dataclasses.fields(parameters))
    chosen = draw(st.lists(fields, max_size=most, unique_by=id))
    strange = st.integers(0, 9)
    return {field.name: draw(near(field) if draw(strange) else STRANGE) for field in chosen}


@st.composite
def mutated_bytes(draw, originals, most=4):
    """Draw one of some bytes with a number of pieces changed, cut, doubled or inserted."""
    data = bytearray(draw(st.sampled_from(originals)))
    for _ in range(draw(st.integers(0, most))):
        begin = draw(st.integers(0, len(data)))
        end = begin + draw(st.sampled_from([0, 1, 2, 4, 8, 64, 1024, len(data)]))
        piece = bytes(data[begin:end])
        put = [b'', 2 * piece, *(bytes([value]) * len(piece) for value in (0, 1, 127, 128, 255))]
        put += [bytes([piece[0] ^ 1 << bit]) + piece[1:] for bit in range(8) if piece]
        data[begin:end] = draw(st.one_of(st.sampled_from(put), st.binary(max_size=16)))
    return bytes(data)


@st.composite
def mutated_text(draw, originals, pieces):
    """Draw one of some texts with up to four pieces removed, doubled or inserted."""
    text = draw(st.sampled_from(originals))
    for _ in range(draw(st.integers(0, 4))):
        begin = draw(st.integers(0, len(text)))
        end = min(len(text), begin + draw(st.sampled_from([0, 1, 3, 20])))
        put = draw(st.one_of(st.sampled_from(pieces), st.text(max_size=4)))
        text = text[:begin] + put + draw(st.sampled_from([text[begin:], text[end:]]))
    return text
