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

"""Whole recordings, and small ones, for tests that look at all rows at once."""

import numpy as np

from slip_detector.recordings import open_recording
from support.config_cases import message_of


def read_recording(path, config=None):
    """Return a recording, and all its rows as they were recorded."""
    recording = open_recording(path, config)
    first, *others = recording.rows()
    return recording, first.then(*others)


#: Of the rows that :func:`save_rows` writes.
RATE_HZ = 100.0

VOLTS = np.array([[4.3, 4.31], [4.25, 4.3], [4.2, 4.29]])


def save_npz(path, **arrays):
    """Write three rows; an array that is None is left out."""
    parts = {'volts': VOLTS, 'sample_rate_hz': 380.0, 'slip': [0, 1, 1], **arrays}
    np.savez(path, **{name: value for name, value in parts.items() if value is not None})
    return path


def save_text(path, text):
    path.write_text(text, encoding='utf-8', errors='surrogateescape')
    return path


def complaint(path, config=None):
    """Return the message about a recording that cannot be read, after its path."""
    message = message_of(read_recording, path, config)
    assert message.startswith(str(path))
    return message.removeprefix(str(path))


def save_rows(path, volts, stamps_ns=None, rate_hz=RATE_HZ, **arrays):
    rows = {'volts': volts, 'stamps_ns': stamps_ns, 'sample_rate_hz': rate_hz, 'slip': None}
    return save_npz(path, **rows | arrays)


def stretches_of(pieces):
    """Join the pieces between two gaps."""
    stretches = []
    for piece in pieces:
        if piece.new_stretch or not stretches:
            stretches.append([])
        stretches[-1].append(piece)
    return [first.then(*others) for first, *others in stretches]
