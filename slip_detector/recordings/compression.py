"""The compressions of bags, undone part by part."""

import importlib
import sys
from typing import Any


def zstd() -> Any:
    """Return the module that reads zstd, which came into Python with 3.14."""
    return importlib.import_module(
        'compression.zstd' if sys.version_info >= (3, 14) else 'backports.zstd'
    )


def decompressor(compression: str) -> Any:
    """Return what takes a compressed stream part by part."""
    if compression == 'zstd':
        return zstd().ZstdDecompressor().decompress
    if compression == 'lz4':
        from lz4.frame import LZ4FrameDecompressor

        return LZ4FrameDecompressor().decompress
    raise ValueError(f'unknown compression {compression!r}')
