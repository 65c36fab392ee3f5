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
from collections.abc import Sequence

import numpy as np
from rclpy.node import Node
from visualization_msgs.msg import Marker, MarkerArray

from slip_detector.chain.samples import Floats
from slip_detector.nodes.messages import event_qos
from slip_detector.view.detectors import Finger, drawn_positions, least_distance_m
from slip_detector.view.server import Server

#: Frame of the markers if the samples name none.
NO_FRAME = 'fingertip'

#: Lifetime of markers, in seconds: so long after their finger has gone they disappear.
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

#: Texts of a finger from which nothing comes, and beginning of the text of one that slips.
SILENT, NO_INPUT, SLIP = 'detector silent', 'no input', 'SLIP'

#: Colours (red, green, blue, opacity) of a bar at rest and at the threshold, and of the other
#: states. They are those of report and page, and differ in lightness, too.
QUIET, NEAR = np.array((0.925, 0.937, 0.945, 1.0)), np.array((0.435, 0.490, 0.529, 1.0))
ON, NOT_VALID, DISABLED = (
    (0.835, 0.369, 0.0, 1.0),
    (0.612, 0.176, 0.471, 1.0),
    (0.6, 0.6, 0.6, 0.4),
)

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
    config, levels = finger.config, finger.track.levels
    positions, disabled = drawn_positions(config), set(config.disabled_channels)
    unit_m = least_distance_m(positions)
    level, on = np.full(config.channels, np.nan), np.zeros(config.channels, np.bool_)
    words = _state(finger)
    if len(levels) and words not in (SILENT, NO_INPUT):
        last = levels.appended - 1
        level = levels.field('level', last)[-1].astype(np.float64) / config.threshold
        on = levels.field('on', last)[-1]
    # Above the uppermost channels.
    low, high = positions.min(axis=0), positions.max(axis=0)
    place = np.array([(low[0] + high[0]) / 2, high[1] + 2 * TEXT * unit_m, high[2]])
    color = ON if words.startswith(SLIP) else QUIET
    text = _marker(finger, 0, Marker.TEXT_VIEW_FACING, place, (0.0, 0.0, TEXT * unit_m), color)
    text.text = f'{finger.label}: {words}'
    markers = [text]
    with np.errstate(divide='ignore'):
        # 0 at rest, 1 at the threshold.
        shares = np.clip(1.0 + np.log2(level) / OCTAVES, 0.0, 1.0 + ABOVE)
    for i, (position, share) in enumerate(zip(positions, shares, strict=True)):
        kind, width, height = Marker.CYLINDER, WIDTH, FLAT + (TALL - FLAT) * share
        color = QUIET + min(share, 1.0) * (NEAR - QUIET)
        if i + 1 in disabled:
            height, color = FLAT, DISABLED
        elif math.isnan(share):
            kind, height, color = Marker.CUBE, WIDTH, NOT_VALID
        elif on[i]:
            width, color = ON_WIDTH, ON
        scale = unit_m * np.array([width, width, height])
        # It stands on its position.
        center = position + np.array([0.0, 0.0, height * unit_m / 2])
        markers.append(_marker(finger, i + 1, kind, center, scale, color))
    return markers


def _state(finger: Finger) -> str:
    """Return the state of a finger, in the words of the page."""
    config = finger.config
    if finger.silence():
        return SILENT
    if time.monotonic() - finger.sample_s > config.input_timeout_s:
        return NO_INPUT
    if not (finger.valid and finger.slip):
        return 'rest' if finger.valid else 'not valid'
    groups = [name for name, on in zip(config.groups, finger.groups, strict=True) if on]
    return f'{SLIP} {", ".join(groups)}'.rstrip()  # Without publish_groups no names.


def _marker(
    finger: Finger, number: int, kind: int, place: Floats, scale: Sequence[float] | Floats,
    color: Sequence[float] | Floats,
) -> Marker:  # fmt: skip
    """Return a marker at a position, which follows the transform of its frame."""
    marker = Marker(ns=finger.label, id=number, type=kind, action=Marker.ADD, frame_locked=True)
    marker.header.frame_id = finger.frame_id or NO_FRAME
    at, size, rgb = marker.pose.position, marker.scale, marker.color
    at.x, at.y, at.z = map(float, place)
    size.x, size.y, size.z = map(float, scale)
    rgb.r, rgb.g, rgb.b, rgb.a = map(float, color)
    marker.lifetime.sec = LIFETIME_S
    return marker


def publish_markers(node: Node, server: Server) -> None:
    """Publish the markers of all fingers on ``~/taxels`` while it has subscribers.

    They are published at the ticks of the server, at most 30 a second; meanwhile it watches all
    fingers.
    """
    publisher = node.create_publisher(MarkerArray, '~/taxels', event_qos(depth=1))
    due_s = float('-inf')

    def publish() -> None:
        nonlocal due_s
        if not publisher.get_subscription_count():
            server.wanted.pop('markers', None)
            return
        fingers, begin_s = server.detectors.fingers, time.monotonic()
        server.wanted['markers'] = set(fingers)
        if fingers and begin_s >= due_s:
            markers = [marker for finger in fingers.values() for marker in finger_markers(finger)]
            publisher.publish(MarkerArray(markers=markers))
            due_s = begin_s + (time.monotonic() - begin_s) / SHARE

    server.each_tick.append(publish)
