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

"""Decompression of parts of bags, up to an allowed length."""

import importlib
import sys
from typing import Any


def zstd() -> Any:
    """Return the module that reads zstd: Python's own from 3.14 on, else its backport.

    Examples
    --------
    >>> module = zstd()
    >>> bytes(module.decompress(module.compress(b'volts')))
    b'volts'
    """
    return importlib.import_module(
        'compression.zstd' if sys.version_info >= (3, 14) else 'backports.zstd'
    )


def decompressor(compression: str) -> Any:
    """Return an object that decompresses a stream part by part.

    Its ``decompress(data, max_length)`` returns at most ``max_length`` bytes; the next call
    continues.

    Parameters
    ----------
    compression
        ``zstd`` or ``lz4``.

    Raises
    ------
    ValueError
        When the compression is not known.

    Examples
    --------
    >>> import lz4.frame
    >>> from slip_detector.recordings.compression import decompressor
    >>> packed, stream = lz4.frame.compress(b'volts'), decompressor('lz4')
    >>> stream.decompress(packed[:10], 100) + stream.decompress(packed[10:], 100)
    b'volts'
    """
    if compression == 'zstd':
        return zstd().ZstdDecompressor()
    if compression == 'lz4':
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor()
    raise ValueError(f'unknown compression {compression!r}')


def decompressed(data: bytes, compression: str, most_bytes: int) -> bytes:
    """Decompress data, up to a number of bytes.

    Raises
    ------
    ValueError
        When the result has more bytes, or the data is truncated or damaged.

    Examples
    --------
    >>> import lz4.frame
    >>> decompressed(lz4.frame.compress(b'volts'), 'lz4', 5)
    b'volts'
    >>> decompressed(lz4.frame.compress(bytes(10**6)), 'lz4', 5)
    Traceback (most recent call last):
    ValueError: has more than 5 bytes
    """
    parts: list[bytes] = []
    left = most_bytes
    while data:
        stream = decompressor(compression)
        try:
            part = stream.decompress(data, left + 1)
        except Exception as error:  # each library has its own exceptions
            raise ValueError(f'is damaged ({error})') from None
        left -= len(part)
        if left < 0:
            raise ValueError(f'has more than {most_bytes} bytes')
        if not stream.eof:
            raise ValueError('is cut off')
        parts.append(part)
        data = stream.unused_data or b''
    return b''.join(parts)
