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

"""Checks that all messages of an input name the same channels."""

from collections.abc import Sequence


class ChannelNames:
    """Refuses messages whose channel names differ from those of the first message.

    Parameters
    ----------
    channels
        Number of channels.
    names
        The names, if they are configured.

    Examples
    --------
    >>> names = ChannelNames(2)
    >>> names.refusal(['left', 'right']), names.refusal(['left', 'right'])
    ('', '')
    >>> names.refusal(['right', 'left'])
    'the channels of a message are right, left, allowed: left, right'
    """

    def __init__(self, channels: int, names: Sequence[str] = ()) -> None:
        self._channels = channels
        self._names = list(names) or None

    def refusal(self, names: list[str]) -> str:
        """Return why a message with these names is refused; empty if it is not."""
        if names == self._names:
            return ''
        if self._names is None and len(names) in (0, self._channels):
            self._names = list(names)
            return ''
        wanted = f'{self._channels} names' if self._names is None else _in_words(self._names)
        return f'the channels of a message are {_in_words(names)}, allowed: {wanted}'


def _in_words(names: list[str]) -> str:
    text = ', '.join(names[:4])
    return f'{text}, ... ({len(names)})' if len(names) > 4 else text or 'without names'
