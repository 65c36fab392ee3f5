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
spaces to a multiple of 4 bytes, and the arrays, each padded to a multiple of 4 bytes, so that a
browser reads them without a copy. ``arrays`` in the header lists the name, the type (``float32``
or ``uint8``) and the shape of each array.
"""

import json
import math
import struct
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from slip_detector.view.detectors import Detectors, Finger
from slip_detector.view.track import LiveTrack, spectrum

#: Allowed lengths of the traces, in seconds, and allowed widths, in pixels.
WINDOW_S, PIXELS = (0.02, 60.0), (10, 4000)

#: Shortest time between two spectra, in seconds.
SPECTRUM_S = 0.2

#: Allowed stamps: they and their sums fit 64 bits.
STAMPS_NS = (-(2.0**62), 2.0**62)

#: Most fingers that a page may show at once, most channels with traces, and highest channel.
MOST_FINGERS, MOST_CHANNELS = 256, 64
HIGHEST_CHANNEL = 1_000_000

LENGTH = struct.Struct('<I')

#: Types of the arrays in a frame.
TYPES: dict[str, np.dtype[Any]] = {'float32': np.dtype('<f4'), 'uint8': np.dtype('u1')}


class ViewRequest:
    """The fingers, the channels and the stretch of time that a page shows.

    Each frame has only the columns of the traces that were completed since the frame before; the
    first frame has those of the whole window.

    Parameters
    ----------
    message
        The message of the page, ``{"type": "look", ...}``, which is not trusted.

    Attributes
    ----------
    fingers : tuple of str
        The fingers that are shown.
    finger : str
        The finger whose traces are shown, or ''.

    Raises
    ------
    ValueError
        When the message has a value that is not allowed.

    Examples
    --------
    >>> view = ViewRequest({'fingers': ['/thumb/slip_detector'], 'window_s': 5.0})
    >>> view.names
    {'/thumb/slip_detector'}
    """

    def __init__(self, message: Mapping[str, Any]) -> None:
        self.fingers = tuple(dict.fromkeys(_texts('fingers', message.get('fingers', []))))
        if len(self.fingers) > MOST_FINGERS:
            raise ValueError(f'fingers has {len(self.fingers)}, allowed: at most {MOST_FINGERS}')
        self.finger = str(message.get('finger') or '')
        channels = message.get('channels', [])
        if not isinstance(channels, list) or not all(
            type(channel) is int and 0 < channel <= HIGHEST_CHANNEL for channel in channels
        ):
            raise ValueError(f'channels is no list of numbers from 1 to {HIGHEST_CHANNEL}')
        if len(channels) > MOST_CHANNELS:
            raise ValueError(f'channels has {len(channels)}, allowed: at most {MOST_CHANNELS}')
        self._channels = np.array(sorted(set(channels)), np.intp) - 1
        window_s = _number('window_s', message.get('window_s', 10.0), *WINDOW_S)
        self._columns = int(_number('pixels', message.get('pixels', 900), *PIXELS))
        self._width_ns = round(window_s * 1e9 / self._columns)
        self._spectrum, self._spectrum_s = _whole_or_none('spectrum', message, 1, 1e6), -math.inf
        #: The stamp at which the traces end; None: at the newest sample.
        self.until_ns = _whole_or_none('until_ns', message, *STAMPS_NS)
        # By finger, how many rows of levels were shown; by stream of the traces, the next column;
        # and which start of the detector and beginning of the track these columns belong to.
        self._shown: dict[str, int] = {}
        self._next: dict[str, int] = {}
        self._beginning: tuple[int, int] | None = None

    @property
    def names(self) -> set[str]:
        """Names of all fingers whose data is needed."""
        return {*self.fingers, *filter(None, [self.finger])}

    def frame(self, detectors: Detectors, number: int, past: LiveTrack | None = None) -> bytes:
        """Return the next frame.

        Parameters
        ----------
        detectors
            Those of the fingers.
        number
            The number of the frame.
        past
            The track to draw instead of the finger's own.
        """
        arrays: dict[str, Any] = {}
        now_s = time.monotonic()
        shown = [detectors.fingers[name] for name in self.fingers if name in detectors.fingers]
        header: dict[str, Any] = {
            'frame': number,
            'fingers': [self._state(i, finger, now_s, arrays) for i, finger in enumerate(shown)],
        }
        if self.finger in detectors.fingers:
            finger = detectors.fingers[self.finger]
            header['traces'] = self._traces(finger, past or finger.track, arrays)
            if self._spectrum is not None and now_s - self._spectrum_s >= SPECTRUM_S:
                self._spectrum_s = now_s
                header['spectrum'] = self._add_spectrum(finger, self._spectrum, arrays)
        return packed(header, arrays)

    def _state(
        self, i: int, finger: Finger, now_s: float, arrays: dict[str, Any]
    ) -> dict[str, Any]:
        """Return a finger's state, and add each channel's highest level since the last frame."""
        levels, config = finger.track.levels, finger.config
        # Without a new row, the last one once more.
        since = min(self._shown.get(finger.name, levels.appended), levels.appended - 1)
        self._shown[finger.name] = levels.appended
        level, on = levels.field('level', since), levels.field('on', since)
        if len(level):
            shown = np.fmax.reduce(level, axis=0) / config.threshold
            # A channel is shown as valid if it is so in the newest row.
            shown = np.where(np.isnan(level[-1]), np.nan, shown)
            arrays[f'level/{i}'], arrays[f'on/{i}'] = shown, on.any(axis=0)
        else:
            arrays[f'level/{i}'] = np.full(config.channels, np.nan)
            arrays[f'on/{i}'] = np.zeros(config.channels, np.bool_)
        arrays[f'groups/{i}'] = finger.groups
        silent = finger.silence()
        return {
            'name': finger.name,
            # The last state of a silent detector may no longer be true.
            'slip': finger.slip and not silent,
            'valid': finger.valid and not silent,
            'onset_age_s': _age_s(now_s, finger.onset_s),
            'sample_age_s': _age_s(now_s, finger.sample_s),
            'silent': silent,
        }

    def _traces(self, finger: Finger, track: LiveTrack, arrays: dict[str, Any]) -> dict[str, Any]:
        """Add the columns of volts, levels, slip and truth completed since the last frame."""
        channels = self._channels[self._channels < track.channels]
        beginning = finger.starts, track.beginnings
        if beginning != self._beginning:
            self._next, self._beginning = {}, beginning
        header: dict[str, Any] = {
            'name': finger.name,
            'beginning': list(beginning),
            'width_ns': self._width_ns,
            'until_ns': self.until_ns,
            'channels': (channels + 1).tolist(),
        }
        only = np.zeros(1, np.intp)
        for stream, rows, values, state in (
            ('samples', track.samples, 'volts', 'truth'),
            ('levels', track.levels, 'level', 'slip'),
        ):
            stamps_ns = rows.stamps_ns()
            if not len(stamps_ns):
                header[stream] = {'first': 0, 'count': 0, 'last_ns': 0}
                continue
            stop = int(stamps_ns[-1]) // self._width_ns
            if self.until_ns is not None:
                stop = min(stop, self.until_ns // self._width_ns + 1)
            oldest = max(int(stamps_ns[0]) // self._width_ns, stop - self._columns)
            first = min(max(self._next.get(stream, oldest), oldest), stop)
            self._next[stream] = stop
            header[stream] = {'first': first, 'count': stop - first, 'last_ns': int(stamps_ns[-1])}
            columns = first, stop - first, self._width_ns
            arrays[f'{values}/low'], arrays[f'{values}/high'] = rows.columns(
                values, *columns, channels
            )
            arrays[state] = rows.columns(state, *columns, only)[1][0] > 0.0
        return header

    def _add_spectrum(
        self, finger: Finger, channel: int, arrays: dict[str, Any]
    ) -> dict[str, Any]:
        """Add the spectrum of a channel, and its spectrum at rest if one is kept."""
        header: dict[str, Any] = {'name': finger.name, 'channel': channel}
        if channel > finger.track.channels:
            return header
        volts = finger.track.samples.field('volts')[:, channel - 1 : channel]
        now = spectrum(volts, finger.config.sample_rate_hz)
        if now is not None:
            header['step_hz'], arrays['spectrum'] = now.step_hz, now.density_db[0]
        rest = finger.rest
        if rest is not None and channel <= len(rest.density_db):
            header['rest_step_hz'], arrays['rest'] = rest.step_hz, rest.density_db[channel - 1]
        return header


def _age_s(now_s: float, at_s: float | None) -> float | None:
    return None if at_s is None or math.isinf(at_s) else round(now_s - at_s, 3)


def _texts(name: str, values: object) -> list[str]:
    if not isinstance(values, list) or not all(isinstance(value, str) for value in values):
        raise ValueError(f'{name} is no list of names')
    return values


def _number(name: str, value: object, low: float, high: float) -> float:
    if not isinstance(value, int | float) or not low <= value <= high:
        raise ValueError(f'{name} is {str(value)[:40]}, allowed: {low:g} to {high:g}')
    return value


def _whole_or_none(name: str, message: Mapping[str, Any], low: float, high: float) -> int | None:
    value = message.get(name)
    return None if value is None else int(_number(name, value, low, high))


def packed(header: Mapping[str, Any], arrays: Mapping[str, ArrayLike]) -> bytes:
    """Return a frame; booleans become ``uint8``, all other numbers ``float32``.

    Examples
    --------
    >>> frame = packed({'frame': 7}, {'level': [0.5, 2.0], 'on': [False, True]})
    >>> header, arrays = unpacked(frame)
    >>> header['frame'], arrays['level'].tolist(), arrays['on'].tolist()
    (7, [0.5, 2.0], [0, 1])
    """
    described, parts = [], []
    for name, values in arrays.items():
        array = np.asarray(values)
        kind = 'uint8' if array.dtype in (np.bool_, np.uint8) else 'float32'
        described.append([name, kind, list(array.shape)])
        content = array.astype(TYPES[kind], copy=False).tobytes()
        parts += [content, bytes(-len(content) % 4)]
    text = json.dumps({**header, 'arrays': described}, allow_nan=False).encode()
    text += b' ' * (-len(text) % 4)
    return b''.join([LENGTH.pack(len(text)), text, *parts])


def unpacked(frame: bytes) -> tuple[dict[str, Any], dict[str, NDArray[np.generic]]]:
    """Return the header and the arrays of a frame, as the page reads them.

    Examples
    --------
    >>> unpacked(packed({'frame': 7}, {}))[0]['frame']
    7
    """
    (length,) = LENGTH.unpack_from(frame)
    place = LENGTH.size + length
    header = json.loads(frame[LENGTH.size : place])
    arrays = {}
    for name, kind, shape in header['arrays']:
        count = int(np.prod(shape))
        arrays[name] = np.frombuffer(frame, TYPES[kind], count, place).reshape(shape)
        size = count * TYPES[kind].itemsize
        place += size + -size % 4
    return header, arrays
