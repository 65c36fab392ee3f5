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

"""Bags that tests cut off or damage."""

from rosbags.rosbag2 import CompressionFormat, CompressionMode

from slip_detector.recordings import open_recording
from support.bags import Bag, check_same, gathered, rows

MESSAGES = 4000


def write_bag(path, plugin, mode=CompressionMode.NONE, n=MESSAGES):
    written = rows(n, channels=3)
    bag = Bag(path, plugin)
    bag.writer.set_compression(mode, CompressionFormat.ZSTD)
    with bag:
        for k, (stamp_ns, row) in enumerate(zip(written.stamps_ns, written.volts, strict=True)):
            if k == 0 or written.truth[k] != written.truth[k - 1]:
                slip = bag.make('std_msgs/msg/Bool', data=bool(written.truth[k]))
                bag.write('/slip_truth', slip, stamp_ns)
            bag.write('/voltages', bag.joints(stamp_ns, row), stamp_ns)
    (file,) = [file for file in path.iterdir() if file.name != 'metadata.yaml']
    return written, file


def read_of(path):
    """Return the readable rows, and the one-line message about the rest."""
    recording = open_recording(path)
    read = gathered(recording)
    assert '\n' not in recording.counts.damage
    return read, recording.counts.damage


def check_is_beginning(read, written):
    check_same(read, written.take(slice(len(read.volts))))
