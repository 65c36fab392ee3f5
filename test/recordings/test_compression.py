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

"""Compressed streams: undone part by part, however they are cut."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='needs rosbags')

import lz4.frame

from slip_detector.recordings.compression import decompressed, decompressor, zstd
from support.little_memory import little_memory

CONTENT = np.random.default_rng(0).integers(0, 20, 5000, dtype=np.uint8).tobytes()
PACKED = {'lz4': lz4.frame.compress(CONTENT), 'zstd': zstd().compress(CONTENT)}


@given(st.sampled_from(list(PACKED)), st.lists(st.integers(0, 5000), max_size=8))
def test_any_cut_of_a_stream_gives_its_content(compression, cuts):
    packed, stream = PACKED[compression], decompressor(compression)
    edges = sorted({0, len(packed), *(cut for cut in cuts if cut < len(packed))})
    parts = [packed[a:b] for a, b in itertools.pairwise(edges)]
    assert b''.join(stream.decompress(part, len(CONTENT)) for part in parts) == CONTENT


def test_another_compression_is_refused():
    with pytest.raises(ValueError, match="unknown compression 'xz'"):
        decompressor('xz')


@pytest.mark.parametrize('compression', PACKED)
def test_what_is_longer_than_allowed_cut_or_damaged_is_refused(compression):
    packed = PACKED[compression]
    assert decompressed(packed, compression, len(CONTENT)) == CONTENT
    assert decompressed(packed + packed, compression, 2 * len(CONTENT)) == 2 * CONTENT
    for data, most, said in (
        (packed, len(CONTENT) - 1, f'has more than {len(CONTENT) - 1} bytes'),
        (packed + packed, len(CONTENT), f'has more than {len(CONTENT)} bytes'),
        (packed[:-1], len(CONTENT), 'is cut off'),
        (b'no frame', len(CONTENT), 'is damaged'),
    ):
        with pytest.raises(ValueError, match=said):
            decompressed(data, compression, most)


@pytest.mark.parametrize('pack', [lz4.frame.compress, zstd().compress])
def test_what_stands_for_much_more_takes_no_memory(pack):
    data, compression = pack(bytes(2 * 10**8)), 'lz4' if pack is lz4.frame.compress else 'zstd'
    with (
        little_memory(50_000_000),
        pytest.raises(ValueError, match='has more than 1000000 bytes'),
    ):
        decompressed(data, compression, 1_000_000)
