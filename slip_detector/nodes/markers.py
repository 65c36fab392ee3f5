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

"""The taxels of fingers as markers, for RViz and other 3-D views."""

import math
import time
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from slip_detector.nodes.messages import event_qos
from slip_detector.parameters.fields import listed
from slip_detector.view.detectors import Finger, drawn_positions, least_distance_m
from slip_detector.view.server import Server

#: Frame of the markers if the samples name none.
NO_FRAME = 'fingertip'

#: Lifetime of markers, in seconds: RViz drops them if slip_view no longer repeats them.
LIFETIME_S = 2

#: A bar grows over this many octaves of the level below the threshold, as on the page, and above
#: the threshold by at most this share more.
OCTAVES, ABOVE = 5.0, 0.5

#: In units of the least distance of two channels: width of a bar, and of one that is ON; height of
#: a bar without level, and at the threshold.
WIDTH, ON_WIDTH = 0.6, 0.95
FLAT, TALL = 0.15, 1.15

#: Height of the text with the state of a finger, in the same unit.
TEXT = 1.2

#: Beginning of the text of a finger that slips.
SLIP = 'SLIP'

#: Most channels that are named as not valid, and most groups that are named as ON.
MOST_NAMED = 4

#: Colours (red, green, blue) of a bar at rest and at the threshold, and of the other states. They
#: are those of report and page, and differ in lightness, too.
QUIET, NEAR = (0.925, 0.937, 0.945), (0.435, 0.490, 0.529)
ON, NOT_VALID, DISABLED = (0.835, 0.369, 0.0), (0.612, 0.176, 0.471), (0.6, 0.6, 0.6)

DISABLED_OPACITY = 0.4

#: Largest share of the time that is spent on markers, so that the pages are not held up.
SHARE = 0.2


def finger_markers(finger: Finger) -> list[Marker]:
    """Return the markers of one finger: a bar for each channel, and a text with its state.

    A bar stands at the taxel's position: the higher the level, the higher the bar; one that is ON
    is wider. A channel that is not valid is a cube, a disabled one a flat and half transparent
    disc. The text has the id 0, a channel its number.

    Examples
    --------
    >>> from slip_detector.parameters.detector import DetectorConfig
    >>> finger = Finger('/index/slip_detector', DetectorConfig(channels=2))
    >>> [(marker.ns, marker.id) for marker in finger_markers(finger)]
    [('index', 0), ('index', 1), ('index', 2)]
    """
    config, positions = finger.config, drawn_positions(finger.config)
    unit_m = least_distance_m(positions)
    level, on = _latest(finger)
    words = _silence(finger)
    if words:
        level[:] = np.nan
    words = words or _state_words(finger, level)
    markers = [_text(finger, positions, unit_m, words)]
    disabled = set(config.disabled_channels)
    for i, (position, share) in enumerate(zip(positions, _shares(level), strict=True)):
        marker = _marker(finger, i + 1, position)
        if i + 1 in disabled:
            _shape(marker, Marker.CYLINDER, WIDTH * unit_m, FLAT * unit_m)
            marker.color = _color(DISABLED, DISABLED_OPACITY)
        elif math.isnan(share):
            _shape(marker, Marker.CUBE, WIDTH * unit_m, WIDTH * unit_m)
            marker.color = _color(NOT_VALID)
        else:
            height_m = (FLAT + (TALL - FLAT) * share) * unit_m
            _shape(marker, Marker.CYLINDER, (ON_WIDTH if on[i] else WIDTH) * unit_m, height_m)
            marker.color = _color(ON if on[i] else _between(QUIET, NEAR, min(share, 1.0)))
        markers.append(marker)
    return markers


class MarkersShown:
    """Turns fingers into messages, and deletes markers of fingers that have gone.

    Examples
    --------
    >>> from slip_detector.parameters.detector import DetectorConfig
    >>> shown = MarkersShown()
    >>> finger = Finger('/index/slip_detector', DetectorConfig(channels=1))
    >>> [each.action for each in shown.message([finger]).markers]
    [0, 0]
    >>> [each.action == Marker.DELETE for each in shown.message([]).markers]
    [True, True]
    """

    def __init__(self) -> None:
        self._frames: dict[tuple[str, int], str] = {}

    def message(self, fingers: Iterable[Finger]) -> MarkerArray:
        """Return the markers of all fingers, and deletions of those that are not among them."""
        markers = [marker for finger in fingers for marker in finger_markers(finger)]
        frames = {(marker.ns, marker.id): marker.header.frame_id for marker in markers}
        for (namespace, number), frame in self._frames.items():
            if (namespace, number) not in frames:
                gone = Marker(ns=namespace, id=number, action=Marker.DELETE)
                gone.header.frame_id = frame
                markers.append(gone)
        self._frames = frames
        return MarkerArray(markers=markers)


class MarkerTopic:
    """Publishes the markers of all fingers on ``~/taxels`` while it has subscribers.

    Parameters
    ----------
    node
        The node that publishes.
    server
        The markers are published at its ticks, at most 30 a second; meanwhile it watches all
        fingers.
    """

    def __init__(self, node: Node, server: Server) -> None:
        self._server = server
        self._publisher = node.create_publisher(MarkerArray, '~/taxels', event_qos(depth=1))
        self._shown = MarkersShown()
        self._due_s = float('-inf')
        server.each_tick.append(self._publish)

    def _publish(self) -> None:
        fingers = self._server.detectors.fingers
        if not self._publisher.get_subscription_count():
            self._server.wanted.pop('markers', None)
            self._shown = MarkersShown()
            return
        self._server.wanted['markers'] = set(fingers)
        begin_s = time.monotonic()
        if begin_s < self._due_s:
            return
        message = self._shown.message(fingers.values())
        if message.markers:
            self._publisher.publish(message)
        self._due_s = begin_s + (time.monotonic() - begin_s) / SHARE


def _silence(finger: Finger) -> str:
    """Return what has stopped arriving, in the words of the page; empty if nothing has."""
    if finger.silence():
        return 'detector silent'
    silent_s = time.monotonic() - finger.sample_s
    if silent_s <= finger.config.input_timeout_s:
        return ''
    return 'no input' + ('' if math.isinf(silent_s) else f' for {silent_s:.0f} s')


def _latest(finger: Finger) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the level of each channel over the threshold, and which are ON.

    The level of a channel that is not valid is NaN.
    """
    levels = finger.track.levels
    if not len(levels):
        channels = finger.config.channels
        return np.full(channels, np.nan), np.zeros(channels, np.bool_)
    last = levels.appended - 1
    level = levels.field('level', last)[-1].astype(np.float64)
    return level / finger.config.threshold, levels.field('on', last)[-1]


def _shares(level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the heights of the bars: 0 at rest, 1 at the threshold."""
    with np.errstate(divide='ignore'):
        return np.clip(1.0 + np.log2(level) / OCTAVES, 0.0, 1.0 + ABOVE)


def _state_words(finger: Finger, level: NDArray[np.float64]) -> str:
    """Return the state of a finger that is not silent, in the words of the page."""
    config = finger.config
    words = 'rest'
    if not finger.valid:
        words = 'not valid'
    elif finger.slip:
        groups = [name for name, on in zip(config.groups, finger.groups, strict=True) if on]
        words = f'{SLIP} {listed(groups, MOST_NAMED)}'.rstrip()  # Without publish_groups no names.
    disabled = set(config.disabled_channels)
    names = [
        name
        for i, name in enumerate(config.names)
        if i + 1 not in disabled and math.isnan(level[i])
    ]
    return f'{words}\n{listed(names, MOST_NAMED)} not valid' if names else words


def _marker(finger: Finger, number: int, position: NDArray[np.float64]) -> Marker:
    """Return a marker at a position, which follows the transform of its frame."""
    marker = Marker(ns=finger.label, id=number, action=Marker.ADD, frame_locked=True)
    marker.header.frame_id = finger.frame_id or NO_FRAME
    marker.pose.orientation.w = 1.0
    place = marker.pose.position
    place.x, place.y, place.z = position.tolist()
    marker.lifetime.sec = LIFETIME_S
    return marker


def _text(finger: Finger, positions: NDArray[np.float64], unit_m: float, words: str) -> Marker:
    """Return the state of a finger as a text above its uppermost channels."""
    low, high = positions.min(axis=0), positions.max(axis=0)
    place = np.array([(low[0] + high[0]) / 2, high[1] + 2 * TEXT * unit_m, high[2]])
    marker = _marker(finger, 0, place)
    marker.type = Marker.TEXT_VIEW_FACING
    marker.text = f'{finger.label}: {words}'
    marker.scale.z = TEXT * unit_m
    marker.color = _color(ON if words.startswith(SLIP) else QUIET)
    return marker


def _shape(marker: Marker, kind: int, width_m: float, height_m: float) -> None:
    """Make a marker a solid that stands on its position."""
    marker.type = kind
    marker.scale.x = marker.scale.y = width_m
    marker.scale.z = height_m
    marker.pose.position.z += height_m / 2


def _between(
    low: tuple[float, float, float], high: tuple[float, float, float], share: float
) -> tuple[float, float, float]:
    red, green, blue = (a + share * (b - a) for a, b in zip(low, high, strict=True))
    return red, green, blue


def _color(rgb: tuple[float, float, float], opacity: float = 1.0) -> ColorRGBA:
    red, green, blue = rgb
    return ColorRGBA(r=red, g=green, b=blue, a=opacity)
