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

"""COBS: no zero is left, and the bytes come back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slip_detector.sources.cobs import cobs_decode, cobs_encode


@pytest.mark.parametrize(
    ('plain', 'stuffed'),
    [
        (b'', b'\x01'),
        (b'\0', b'\x01\x01'),
        (b'\0\0', b'\x01\x01\x01'),
        (b'\0\x11\0', b'\x01\x02\x11\x01'),
        (b'\x11\x22\0\x33', b'\x03\x11\x22\x02\x33'),
        (b'\x11\x22\x33\x44', b'\x05\x11\x22\x33\x44'),
        (b'\x11\0\0\0', b'\x02\x11\x01\x01\x01'),
        (bytes(range(1, 255)), b'\xff' + bytes(range(1, 255))),
        (bytes(range(255)), b'\x01\xff' + bytes(range(1, 255))),
        (bytes(range(1, 256)), b'\xff' + bytes(range(1, 255)) + b'\x02\xff'),
        (bytes(range(2, 256)) + b'\0', b'\xff' + bytes(range(2, 256)) + b'\x01\x01'),
        (bytes(range(3, 256)) + b'\0\x01', b'\xfe' + bytes(range(3, 256)) + b'\x02\x01'),
    ],
)
def test_bytes_are_stuffed_as_published(plain, stuffed):
    assert cobs_encode(plain) == stuffed
    assert cobs_decode(stuffed) == plain


@given(st.lists(st.tuples(st.binary(max_size=3), st.integers(0, 600))))
def test_stuffed_bytes_have_no_zero_and_come_back(parts):
    plain = b''.join(some + b'\x07' * more for some, more in parts)
    stuffed = cobs_encode(plain)
    assert 0 not in stuffed
    assert len(stuffed) <= len(plain) + len(plain) // 254 + 1
    assert cobs_decode(stuffed) == plain


def test_codes_past_the_end_are_no_cobs():
    assert cobs_decode(b'\x05\x11\x22') is None
    assert cobs_decode(b'\x00') is None
