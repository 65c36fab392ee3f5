"""Decompression of bags, one part after another."""

import importlib
import sys
from typing import Any


def zstd() -> Any:
    """Return the module that reads zstd: Python's own from 3.14 on, else its backport."""
    return importlib.import_module(
        'compression.zstd' if sys.version_info >= (3, 14) else 'backports.zstd'
    )


def decompressor(compression: str) -> Any:
    """Return a function that decompresses a stream; it takes one part after another.

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
    >>> packed, decompress = lz4.frame.compress(b'volts'), decompressor('lz4')
    >>> decompress(packed[:10]) + decompress(packed[10:])
    b'volts'
    """
    if compression == 'zstd':
        return zstd().ZstdDecompressor().decompress
    if compression == 'lz4':
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor().decompress
    raise ValueError(f'unknown compression {compression!r}')
