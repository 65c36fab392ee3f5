"""Compressed streams: undone part by part, however they are cut."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

pytest.importorskip('rosbags', reason='needs rosbags')

import lz4.frame

from slip_detector.recordings.compression import decompressor, zstd

CONTENT = np.random.default_rng(0).integers(0, 20, 5000, dtype=np.uint8).tobytes()
PACKED = {'lz4': lz4.frame.compress(CONTENT), 'zstd': zstd().compress(CONTENT)}


@given(st.sampled_from(list(PACKED)), st.lists(st.integers(0, 5000), max_size=8))
def test_any_cut_of_a_stream_gives_its_content(compression, cuts):
    packed, decompress = PACKED[compression], decompressor(compression)
    edges = sorted({0, len(packed), *(cut for cut in cuts if cut < len(packed))})
    parts = [packed[a:b] for a, b in itertools.pairwise(edges)]
    assert b''.join(decompress(part) for part in parts) == CONTENT


def test_another_compression_is_refused():
    with pytest.raises(ValueError, match="unknown compression 'xz'"):
        decompressor('xz')
