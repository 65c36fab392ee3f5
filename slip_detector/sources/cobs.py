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

"""Consistent overhead byte stuffing (Cheshire and Baker 1997): bytes without a zero."""


def cobs_encode(data: bytes) -> bytes:
    """Stuff bytes so that none of them is zero.

    Each zero is replaced by a code, the distance to the next zero; a code is inserted after each
    254 bytes without a zero.

    Examples
    --------
    >>> cobs_encode(bytes([0x11, 0x22, 0x00, 0x33])).hex(' ')
    '03 11 22 02 33'
    """
    out = bytearray()
    *runs, last = data.split(b'\0')
    for run in runs:
        _stuff(out, run)
        out += bytes([len(run) % 254 + 1]) + run[len(run) // 254 * 254 :]
    _stuff(out, last)
    if len(last) % 254 or not last:
        out += bytes([len(last) % 254 + 1]) + last[len(last) // 254 * 254 :]
    return bytes(out)


def _stuff(out: bytearray, run: bytes) -> None:
    for i in range(0, len(run) - 253, 254):
        out += b'\xff' + run[i : i + 254]


def cobs_decode(stuffed: bytes) -> bytes | None:
    r"""Undo :func:`cobs_encode`.

    Returns
    -------
    bytes or None
        None where the bytes are not COBS: a code points past the end or is zero.

    Examples
    --------
    >>> cobs_decode(bytes([0x03, 0x11, 0x22, 0x02, 0x33])).hex(' ')
    '11 22 00 33'
    >>> cobs_decode(b'\x05\x11') is None
    True
    """
    out = bytearray()
    at, end = 0, len(stuffed)
    while at < end:
        code = stuffed[at]
        following = at + code
        if following > end or not code:
            return None
        out += stuffed[at + 1 : following]
        at = following
        if code < 255 and at < end:
            out.append(0)
    return bytes(out)
