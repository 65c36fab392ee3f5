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

"""Recordings: rows of volts with their stamps and labels, in bags, npz and csv files."""

from slip_detector.recordings.rates import RATE_TOLERANCE, rates_differ
from slip_detector.recordings.reading import (
    ENDINGS,
    is_recording,
    open_recording,
    recording_sets,
)
from slip_detector.recordings.recording import PIECE_ROWS, Recording, RecordingCounts
from slip_detector.recordings.writing import write_recording

__all__ = [
    'ENDINGS',
    'PIECE_ROWS',
    'RATE_TOLERANCE',
    'Recording',
    'RecordingCounts',
    'is_recording',
    'open_recording',
    'rates_differ',
    'recording_sets',
    'write_recording',
]
