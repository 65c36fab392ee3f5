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

"""The memory limit for reading a recording: a small file can decompress to a large content."""

from pathlib import Path

#: Number of rows that are read at a time: enough to be fast, and only some MB for 100 channels.
PIECE_ROWS = 8192

#: Share of the limit for one message: as float64 its numbers take up to eight times its bytes.
MESSAGE_SHARE = 1 / 16


class ReadingLimit:
    """Refuses any part of a recording that is larger than ``recording_limit_mb``.

    Reading needs at most four times as much memory, whatever the file contains.

    Parameters
    ----------
    path
        The recording, for messages.
    most_mb
        The limit.

    Attributes
    ----------
    most_bytes : int
        The limit in bytes.
    message_bytes : int
        The limit for one message.
    channels : int
        Largest number of channels with which a piece of rows is within the limit.

    Examples
    --------
    >>> limit = ReadingLimit(Path('trial.npz'), most_mb=1024.0)
    >>> limit.channels
    15625
    >>> limit.check(3_000_000_000, 'volts')
    Traceback (most recent call last):
    ValueError: trial.npz: volts takes 3000 MB, allowed: 1024 MB (recording_limit_mb)
    """

    def __init__(self, path: Path, most_mb: float) -> None:
        self._path, self._most_mb = path, most_mb
        self.most_bytes = int(most_mb * 1e6)
        self.message_bytes = int(self.most_bytes * MESSAGE_SHARE)
        self.channels = self.most_bytes // (PIECE_ROWS * 8)

    def check(self, n_bytes: int, what: str, share: float = 1.0) -> None:
        """Check a size against the limit, or against a share of it.

        Raises
        ------
        ValueError
            When the size is larger; names the recording and ``what``.
        """
        if n_bytes > share * self.most_bytes:
            of_limit = f'1/{1 / share:.0f} of ' if share < 1.0 else ''
            raise ValueError(
                f'{self._path}: {what} takes {n_bytes / 1e6:.0f} MB, allowed: '
                f'{share * self._most_mb:g} MB ({of_limit}recording_limit_mb)'
            )

    def check_channels(self, channels: int) -> None:
        """Check a number of channels.

        Raises
        ------
        ValueError
            When there are more than the limit allows; names the recording.
        """
        if channels > self.channels:
            raise ValueError(
                f'{self._path}: has {channels} channels, allowed: {self.channels} with '
                f'{self._most_mb:g} MB (recording_limit_mb)'
            )
