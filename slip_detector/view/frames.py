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

"""Binary frames: a header in JSON, and arrays that a browser reads without a copy.

A frame is the length of the header (4 bytes, little-endian), the header, padded with spaces to a
multiple of 4 bytes, and the arrays, each padded to a multiple of 4 bytes. ``arrays`` in the header
lists the name, the type (``float32`` or ``uint8``) and the shape of each array.
"""

import json
import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

LENGTH = struct.Struct('<I')

#: Types of the arrays in a frame.
TYPES: dict[str, np.dtype[Any]] = {'float32': np.dtype('<f4'), 'uint8': np.dtype('u1')}


def packed(header: Mapping[str, Any], arrays: Mapping[str, ArrayLike]) -> bytes:
    """Return a frame; booleans become ``uint8``, all other numbers ``float32``.

    Examples
    --------
    >>> frame = packed({'frame': 7}, {'level': [0.5, 2.0], 'on': [False, True]})
    >>> header, arrays = unpacked(frame)
    >>> header['frame'], arrays['level'].tolist(), arrays['on'].tolist()
    (7, [0.5, 2.0], [0, 1])
    """
    described, parts = [], []
    for name, values in arrays.items():
        array = np.asarray(values)
        kind = 'uint8' if array.dtype in (np.bool_, np.uint8) else 'float32'
        described.append([name, kind, list(array.shape)])
        content = array.astype(TYPES[kind], copy=False).tobytes()
        parts += [content, bytes(-len(content) % 4)]
    text = json.dumps({**header, 'arrays': described}, allow_nan=False).encode()
    text += b' ' * (-len(text) % 4)
    return b''.join([LENGTH.pack(len(text)), text, *parts])


def unpacked(frame: bytes) -> tuple[dict[str, Any], dict[str, NDArray[np.generic]]]:
    """Return the header and the arrays of a frame, as the page reads them.

    Examples
    --------
    >>> unpacked(packed({'frame': 7}, {}))[0]['frame']
    7
    """
    (length,) = LENGTH.unpack_from(frame)
    place = LENGTH.size + length
    header = json.loads(frame[LENGTH.size : place])
    arrays = {}
    for name, kind, shape in header['arrays']:
        count = int(np.prod(shape))
        arrays[name] = np.frombuffer(frame, TYPES[kind], count, place).reshape(shape)
        size = count * TYPES[kind].itemsize
        place += size + -size % 4
    return header, arrays
