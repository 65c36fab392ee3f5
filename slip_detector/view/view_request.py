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


"""The view that one page asks for, and the binary frames that it gets.

A frame is the length of the header (4 bytes, little-endian), the header in JSON, padded with
spaces to a multiple of 4 bytes, and the arrays, so that a browser reads them without a copy.
``arrays`` in the header lists the name and the shape of each array; all are float32.
"""

import json
import math
import struct
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from slip_detector.view.detectors import Detectors, Finger
from slip_detector.view.messages import STAMPS_NS, Message, check
from slip_detector.view.track import LiveTrack, spectrum

#: Shortest time between two spectra, in seconds.
SPECTRUM_S = 0.2

#: How many columns of pixels are joined to one column: at first, and at most.
FIRST_JOIN, MOST_JOINED = 8, 32

#: A frame that takes longer than ``SLOW_S`` seconds is slow: more columns are joined. Fewer are
#: joined after a frame with the whole window that took less than ``QUICK_S``, and after any frame
#: that took less than ``PROMPT_S`` if for ``RETRY_S`` nothing was changed.
SLOW_S, QUICK_S, PROMPT_S, RETRY_S = 1.0, 0.4, 0.1, 30.0

#: Time, in seconds, for which the page says that samples come that do not fit.
UNFIT_SHOWN_S = 1.0

#: By name, what a frame has beside its header.
Arrays = dict[str, Any]

LENGTH = struct.Struct('<I')


class Pace:
    """How much a page is sent, by how long it takes to get frames and to draw them.

    Examples
    --------
    >>> pace = Pace()
    >>> pace.drawn(took_s=3.0, is_whole=True)
    >>> pace.join
    32
    """

    def __init__(self) -> None:
        #: How many columns of pixels are joined to one column.
        self.join = FIRST_JOIN
        self._waited_s = 0.0

    def drawn(self, took_s: float, is_whole: bool) -> None:
        """Note how long a frame took, and whether it had the whole window."""
        before, self._waited_s = self.join, self._waited_s + took_s
        if took_s > SLOW_S:
            self.join = min(before << math.ceil(math.log2(took_s / SLOW_S)), MOST_JOINED)
        elif took_s < (QUICK_S if is_whole else PROMPT_S if self._waited_s > RETRY_S else 0.0):
            self.join = max(1, before // 2)
        if self.join != before:
            self._waited_s = 0.0


class ViewRequest:
    """The fingers, the channels and the stretch of time that a page shows.

    Each frame has only the columns of the traces that were completed since the frame before; the
    first frame, and the one after another ``join``, has those of the whole window.

    Parameters
    ----------
    message
        The message of the page, ``{"type": "view", ...}``.

    Raises
    ------
    ValueError
        When the message has a value that is not allowed.

    Examples
    --------
    >>> view = ViewRequest({'fingers': ['/thumb/slip_detector'], 'window_s': 5.0})
    >>> view.fingers
    ('/thumb/slip_detector',)
    """

    def __init__(self, message: Message) -> None:
        check(message)
        #: The fingers that are shown, and the one of them whose traces are shown, or ''.
        self.fingers = tuple(dict.fromkeys(message.get('fingers') or ()))
        self.finger: str = message.get('finger') or ''
        #: The channels of the traces, counted from 0.
        self.channels = np.array(sorted(set(message.get('channels') or ())), np.intp) - 1
        self._columns = int(message.get('pixels') or 900)
        self._width_ns = round((message.get('window_s') or 10.0) * 1e9 / self._columns)
        #: The channel whose spectrum is shown, counted from 1, if any, and when it was sent last.
        self._spectrum, self._spectrum_s = message.get('spectrum'), -math.inf
        until_ns = message.get('until_ns')
        #: The stamp at which the traces end; None: at the newest sample.
        self.until_ns = None if until_ns is None else int(until_ns)
        # By finger, how many rows of levels were shown; by stream of the traces and beginning of
        # the track, the next column.
        self._shown: dict[str, int] = {}
        self._next: dict[tuple[str, int], int] = {}
        self._join = 1
        #: Whether the last frame had the columns of the whole window.
        self.is_whole = False

    def frame(self, detectors: Detectors, past: LiveTrack | None = None, join: int = 1) -> bytes:
        """Return the next frame.

        ``past`` is drawn in place of the finger's track. ``join`` columns are joined to one, for
        a page to which little can be sent.
        """
        if join != self._join:
            self._join = join
            self._next.clear()
        arrays: Arrays = {}
        now_s = time.monotonic()
        present = [detectors.fingers[name] for name in self.fingers if name in detectors.fingers]
        states = [self._state(i, finger, now_s, arrays) for i, finger in enumerate(present)]
        header: dict[str, Any] = {'fingers': states}
        if finger := detectors.fingers.get(self.finger):
            header['traces'] = self._traces(finger, past or finger.track, arrays)
            if self._spectrum is not None and now_s - self._spectrum_s >= SPECTRUM_S:
                self._spectrum_s = now_s
                header['spectrum'] = self._add_spectrum(finger, self._spectrum, arrays)
        return pack_frame(header, arrays)

    def _state(self, i: int, finger: Finger, now_s: float, arrays: Arrays) -> dict[str, Any]:
        """Return a finger's state, and add each channel's highest level since the last frame."""
        levels, n = finger.track.levels, finger.config.channels
        # Without a new row, the last one once more.
        since = min(self._shown.get(finger.name, levels.appended), levels.appended - 1)
        self._shown[finger.name] = levels.appended
        level, on = levels.field('level', since), levels.field('on', since)
        # A channel is shown as valid if it is so in the newest row.
        newest = level[-1] if len(level) else np.full(n, np.nan)
        highest = np.fmax.reduce(level, axis=0, initial=-np.inf) / finger.config.threshold
        arrays[f'level/{i}'] = np.where(np.isnan(newest), np.nan, highest)
        arrays[f'on/{i}'] = on.any(axis=0)
        arrays[f'groups/{i}'] = finger.groups
        silent = finger.silence()
        return {
            'name': finger.name,
            # The last state of a silent detector may no longer be true.
            'slip': finger.slip and not silent,
            'valid': finger.valid and not silent,
            'onset_age_s': _age_s(now_s, finger.onset_s),
            'sample_age_s': _age_s(now_s, finger.sample_s),
            'unfit': finger.unfit[1] if now_s - finger.unfit[0] < UNFIT_SHOWN_S else '',
            'silent': silent,
            'paused': finger.paused,
        }

    def _traces(self, finger: Finger, track: LiveTrack, arrays: Arrays) -> dict[str, Any]:
        """Add the columns of volts, levels, slip and truth completed since the last frame."""
        channels = self.channels[self.channels < track.channels]
        width_ns = self._width_ns * self._join
        self.is_whole = not self._next
        header: dict[str, Any] = {
            'name': finger.name,
            'beginning': track.beginnings,
            'width_ns': width_ns,
            'until_ns': self.until_ns,
            'channels': (channels + 1).tolist(),
        }
        only = np.zeros(1, np.intp)
        until_ns = self.until_ns if self.until_ns is not None else int(STAMPS_NS[1])
        # Samples may come in batches: then what is overdue is a message, and each has one level.
        overdue_ns = max(rows.overdue_ns() for rows in (track.samples, track.levels))
        for stream, rows, values, state in (
            ('samples', track.samples, 'volts', 'truth'),
            ('levels', track.levels, 'level', 'slip'),
        ):
            stamps_ns = rows.stamps_ns()
            if not len(stamps_ns):
                header[stream] = {'first': 0, 'count': 0}
                continue
            stop = min(int(stamps_ns[-1]) // width_ns, until_ns // width_ns + 1)
            oldest = max(int(stamps_ns[0]) // width_ns, stop - max(1, self._columns // self._join))
            part = stream, track.beginnings
            first = min(max(self._next.get(part, oldest), oldest), stop)
            self._next[part] = stop
            header[stream] = {'first': first, 'count': stop - first}
            edges_ns = np.arange(first, stop + 1) * width_ns
            low, high = rows.columns(values, edges_ns, channels, overdue_ns)
            arrays |= {'low': low, 'high': high} if values == 'volts' else {'level': high}
            arrays[state] = rows.columns(state, edges_ns, only, overdue_ns)[1][0] > 0.0
        return header

    def _add_spectrum(self, finger: Finger, channel: int, arrays: Arrays) -> dict[str, Any]:
        """Add the spectrum of a channel, and its spectrum at rest if one is kept."""
        header: dict[str, Any] = {'name': finger.name, 'channel': channel}
        if channel > finger.track.channels:
            return header
        volts = finger.track.samples.field('volts')[:, channel - 1 : channel]
        now, rest = spectrum(volts, finger.config.sample_rate_hz), finger.rest
        if now is not None:
            header['step_hz'], arrays['spectrum'] = now.step_hz, now.density_db[0]
        if rest is not None and channel <= len(rest.density_db):
            header['rest_step_hz'], arrays['rest'] = rest.step_hz, rest.density_db[channel - 1]
        return header


def _age_s(now_s: float, at_s: float | None) -> float | None:
    return None if at_s is None or math.isinf(at_s) else round(now_s - at_s, 3)


def pack_frame(header: Mapping[str, Any], arrays: Mapping[str, Any]) -> bytes:
    r"""Return a frame.

    Examples
    --------
    >>> pack_frame({}, {'on': [False, True]})
    b'\x1c\x00\x00\x00{"arrays": [["on", [2]]]}   \x00\x00\x00\x00\x00\x00\x80?'
    """
    floats = {name: np.asarray(values, '<f4') for name, values in arrays.items()}
    described = [[name, array.shape] for name, array in floats.items()]
    text = json.dumps({**header, 'arrays': described}, allow_nan=False).encode()
    text += b' ' * (-len(text) % 4)
    return b''.join([LENGTH.pack(len(text)), text, *(each.tobytes() for each in floats.values())])
