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

"""The pages of the documentation, and the blocks of code in them."""

import re
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]

README = ROOT / 'README.md'
DOCS = ROOT / 'docs'
PAGES = [README, ROOT / 'CONTRIBUTING.md', *sorted(DOCS.rglob('*.md'))]


class Block(NamedTuple):
    """A fenced block: what follows the fence, the lines in it, and where they begin."""

    language: str
    text: str
    line: int


def blocks(path):
    """Return the fenced blocks of a page, from its top to its bottom."""
    text = path.read_text(encoding='utf-8')
    found = re.finditer(r'^```(.*)\n((?s:.*?))^```$', text, re.M)
    return [Block(m[1], m[2], text.count('\n', 0, m.start()) + 2) for m in found]


def file_name(block):
    """Return the name of the file that a block shows: its first line is ``# NAME.yaml``."""
    named = re.match(r'# ([\w.]+\.yaml)\b', block.text)
    return named[1] if named else None


def file_shown(path, name):
    """Return the text of a file that a page shows."""
    (text,) = (block.text for block in blocks(path) if file_name(block) == name)
    return text


def identifier(path):
    """Name a page in the name of a test."""
    return str(path.relative_to(ROOT))
