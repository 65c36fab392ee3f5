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

"""Files of new bags, as rosbags writes them; imported only where a bag is written."""

import os
import struct
import zlib
from typing import Any

from rosbags import interfaces
from rosbags.rosbag2.storage_mcap import McapWriter

#: The next message after so long begins a new chunk.
CHUNK_NS = 1_000_000_000

#: Where a chunk has its checksum: behind the head of the record, two times and a length.
CHECKSUM_AT = 9 + 3 * 8

_FOR_EVER = interfaces.QosTime(9223372036, 854775807)

#: The quality of service that ``ros2 bag play`` offers, also to a late subscriber.
QUALITY = interfaces.Qos(
    history=interfaces.QosHistory.KEEP_LAST,
    depth=100,
    reliability=interfaces.QosReliability.RELIABLE,
    durability=interfaces.QosDurability.TRANSIENT_LOCAL,
    deadline=_FOR_EVER,
    lifespan=_FOR_EVER,
    liveliness=interfaces.QosLiveliness.AUTOMATIC,
    liveliness_lease_duration=_FOR_EVER,
    avoid_ros_namespace_conventions=False,
)


class CheckedMcap(McapWriter):
    """An MCAP with a chunk for each second or flush, which a reader can check."""

    def write(self, connection: Any, timestamp: int, data: bytes | memoryview) -> None:
        """Write a message."""
        if self.chunk.msgs and abs(timestamp - self.chunk.message_start_time) >= CHUNK_NS:
            self.close_chunk()
        super().write(connection, timestamp, data)

    def close_chunk(self) -> None:
        """Write the chunk, and its checksum, which rosbags leaves out."""
        begin, checksum = self.bio.tell(), zlib.crc32(self.chunk.bio.getvalue())
        super().close_chunk()
        self.bio.seek(begin + CHECKSUM_AT)
        self.bio.write(struct.pack('<I', checksum))
        self.bio.seek(0, os.SEEK_END)

    def flush(self) -> None:
        """Pass all messages so far to the operating system."""
        if self.chunk.msgs:
            self.close_chunk()
        self.bio.flush()
