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

"""The journal of a study: a file that Optuna appends a line of JSON to for each trial."""

import json
import os
from pathlib import Path

from optuna.storages.journal import JournalFileSymlinkLock

#: The key that each entry has.
KEY = 'op_code'


def mend_journal(path: Path) -> str:
    r"""Check the lines of a journal, and cut off an incomplete last line.

    A full disk or a killed process leaves half a line. Optuna would append the next entry to it,
    and could then not read the file any more.

    Parameters
    ----------
    path
        The journal; it need not exist.

    Returns
    -------
    str
        One line on what was cut off; empty where nothing was.

    Raises
    ------
    ValueError
        When a line is no entry of a journal; names the line.
    OSError
        When the file cannot be read or cut.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     journal = Path(folder) / 'study.journal'
    ...     _ = journal.write_text('{"op_code": 0}' + chr(10) + '{"op_co')
    ...     print(mend_journal(journal).partition(': ')[2])
    ...     journal.read_text()
    line 2 was cut off after 7 bytes and is left out
    '{"op_code": 0}\n'
    """
    if not path.exists():
        return ''
    if not path.is_file():
        raise ValueError('is no file, allowed: a file that slip_tune has written')
    # Optuna takes this lock to append: a line that is being written is not cut.
    lock = JournalFileSymlinkLock(str(path))
    lock.acquire()
    try:
        return _mended(path)
    finally:
        lock.release()


def _mended(path: Path) -> str:
    end = 0
    with open(path, 'rb') as lines:
        for number, line in enumerate(lines, start=1):
            if not line.endswith(b'\n'):
                os.truncate(path, end)
                return f'{path}: line {number} was cut off after {len(line)} bytes and is left out'
            end += len(line)
            try:
                entry = json.loads(line)
            except (ValueError, RecursionError):
                entry = None
            if not isinstance(entry, dict) or not isinstance(entry.get(KEY), int):
                shown = line[:40].decode(errors='replace').strip()
                raise ValueError(f'line {number} is {shown!r}, allowed: a JSON object with {KEY}')
    return ''
