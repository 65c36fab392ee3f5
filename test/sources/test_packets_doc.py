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

"""docs/packets.md: its tables against the code."""

import re
from pathlib import Path

from slip_detector.sources import packets, text_lines
from slip_detector.sources.packets import (
    CHECKSUM,
    HEADER,
    LONGEST_BYTES,
    PACKET_KINDS,
    encode,
)

TEXT = (Path(__file__).resolve().parents[2] / 'docs' / 'packets.md').read_text(encoding='utf-8')


def test_the_tables_say_what_the_code_does():
    kinds = re.findall(r'^\| (0x\w+) \| `(\w+)` \| (\d) \|', TEXT, re.M)
    assert {name: int(kind, 16) for kind, name, _ in kinds} == PACKET_KINDS
    for kind, name, value_bytes in kinds:
        assert len(encode([[1]], name, 0, 0)) == HEADER.size + int(value_bytes) + CHECKSUM.size
        assert encode([[1]], name, 0, 0)[0] == int(kind, 16)
    assert f'at most {LONGEST_BYTES} bytes' in TEXT
    fields = re.findall(r'^\| (\d+) \| (\d+) \| (\w+) \|', TEXT, re.M)
    offsets = [int(offset) for offset, _, _ in fields]
    lengths = [int(length) for _, length, _ in fields]
    assert offsets == [sum(lengths[:k]) for k in range(len(lengths))]
    assert sum(lengths) == HEADER.size


def test_every_count_is_explained():
    explained = set(re.findall(r'`(\w+)`', TEXT))
    for doc in (packets.PacketDecoder.__doc__, text_lines.LineDecoder.__doc__):
        assert set(re.findall(r'``(\w+)``', doc.partition('counts :')[2])) <= explained
