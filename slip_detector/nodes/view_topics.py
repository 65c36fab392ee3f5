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

"""What a live page publishes: taxels as markers for 3-D views, and a recording that it plays."""

import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
from geometry_msgs.msg import Point
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from slip_detector.nodes.messages import event_qos, sensor_qos, state_qos
from slip_detector.parameters import DetectorConfig, DriverConfig
from slip_detector.recordings.messages import JointStateWriter
from slip_detector.view.bag import PlayedBag
from slip_detector.view.detectors import Finger, drawn_positions, least_distance_m
from slip_detector.view.server import Server

#: Frame of the markers if the samples name none.
NO_FRAME = 'fingertip'

#: Time, in seconds, after which the markers of a finger that has gone disappear.
LIFETIME_S = 2

#: A cube rises over so many octaves of the level below the threshold, as bars do on the page, and
#: above the threshold by at most this share more.
OCTAVES, OVERSHOOT = 5.0, 0.5

#: Size of the cubes and of the text, in units of the least distance of two channels. A cube at the
#: threshold has risen by one.
CUBE_SIZE, TEXT_SIZE = 0.6, 1.2

#: Texts of a silent finger, and beginning of the text of a finger that slips.
SILENT, NO_INPUT, SLIP = 'detector silent', 'no input', 'SLIP'

#: Colours (red, green, blue, opacity) of a cube at rest and at the threshold, and of the other
#: states. Report and page use the same colours, which differ in lightness, too.
QUIET, AT_THRESHOLD = np.array((0.925, 0.937, 0.945, 1.0)), np.array((0.435, 0.490, 0.529, 1.0))
ON, NOT_VALID = (0.835, 0.369, 0.0, 1.0), (0.612, 0.176, 0.471, 1.0)
DISABLED = (0.6, 0.6, 0.6, 0.4)


def finger_markers(finger: Finger) -> list[Marker]:
    """Return the markers of one finger: a text with its state, and a cube for each channel.

    A cube at rest is at the taxel's position: the higher the level, the higher it rises, and the
    darker it is. A channel that is ON, not valid or disabled has a colour of its own.

    Examples
    --------
    >>> from slip_detector.parameters import DetectorConfig
    >>> text, cubes = finger_markers(Finger('/index/slip_detector', DetectorConfig(channels=2)))
    >>> text.text, len(cubes.points)
    ('index: no input', 2)
    """
    config, levels = finger.config, finger.track.levels
    positions = drawn_positions(config)
    unit_m = least_distance_m(positions)
    words = _state(finger)
    # 0 at rest, 1 at the threshold.
    heights, colors = np.zeros(config.channels), np.tile(NOT_VALID, (config.channels, 1))
    if len(levels) and words not in (SILENT, NO_INPUT):
        last = levels.appended - 1
        with np.errstate(divide='ignore'):
            octaves = np.log2(levels.field('level', last)[-1] / config.threshold)
        valid, on = ~np.isnan(octaves), levels.field('on', last)[-1]
        heights[valid] = np.clip(1.0 + octaves[valid] / OCTAVES, 0.0, 1.0 + OVERSHOOT)
        shares = np.minimum(heights[valid], 1.0)[:, np.newaxis]
        colors[valid] = QUIET + shares * (AT_THRESHOLD - QUIET)
        colors[on] = ON
    disabled = np.array(config.disabled_channels, np.int64) - 1
    heights[disabled], colors[disabled] = 0.0, DISABLED
    cubes = Marker(type=Marker.CUBE_LIST, id=1)
    cubes.scale.x = cubes.scale.y = cubes.scale.z = CUBE_SIZE * unit_m
    places = positions + np.outer(heights * unit_m, (0.0, 0.0, 1.0))
    cubes.points = [Point(x=x, y=y, z=z) for x, y, z in places.tolist()]
    cubes.colors = [_color(color) for color in colors]
    text = Marker(type=Marker.TEXT_VIEW_FACING, text=f'{finger.label}: {words}')
    text.scale.z = TEXT_SIZE * unit_m
    text.color = _color(ON if words.startswith(SLIP) else QUIET)
    # Above the uppermost channels.
    low, high = positions.min(axis=0), positions.max(axis=0)
    text.pose.position.x = float(low[0] + high[0]) / 2
    text.pose.position.y = float(high[1]) + 2 * TEXT_SIZE * unit_m
    text.pose.position.z = float(high[2])
    for marker in (text, cubes):
        marker.ns, marker.header.frame_id = finger.label, finger.frame_id or NO_FRAME
        marker.frame_locked, marker.lifetime.sec = True, LIFETIME_S
    return [text, cubes]


def _color(color: Iterable[float]) -> ColorRGBA:
    return ColorRGBA(**dict(zip('rgba', map(float, color), strict=True)))


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


def publish_markers(node: Node, server: Server) -> None:
    """Publish the markers of all fingers on ``~/taxels`` while it has subscribers.

    They are published at the ticks of the server, at most 30 a second; meanwhile it watches all
    fingers.
    """
    publisher = node.create_publisher(MarkerArray, '~/taxels', event_qos(depth=1))

    def publish() -> None:
        if not publisher.get_subscription_count():
            server.wanted.pop('markers', None)
            return
        fingers = server.detectors.fingers
        server.wanted['markers'] = set(fingers)
        markers = [marker for finger in fingers.values() for marker in finger_markers(finger)]
        publisher.publish(MarkerArray(markers=markers))

    server.each_tick.append(publish)


def publish_bag(node: Node, server: Server, path: Path, config: Path, finger: str) -> None:
    """Publish the samples of a recording when they are due, while a page or a program listens.

    ``config`` is the parameter file of the detector in the namespace ``finger``. May raise a
    ValueError, see :class:`.PlayedBag`; what :meth:`.PlayedBag.read` raises ends the server.
    """
    detector, driver = DetectorConfig.from_yaml(config), DriverConfig.from_yaml(config)
    bag = PlayedBag(server, path, detector, driver, f'{finger}/slip_detector')
    voltages = node.create_publisher(JointState, f'{finger}/voltages', sensor_qos())
    slip_truth = node.create_publisher(Bool, f'{finger}/slip_truth', state_qos())
    # The page answers meanwhile; reading does not hold up the end of this process.
    reading = ThreadPoolExecutor(1, 'reading').submit(bag.read)
    truth = False

    def publish() -> None:
        nonlocal truth
        if reading.done():
            reading.result()
        if voltages.get_subscription_count() <= 1:  # That of the detector.
            return
        writer = JointStateWriter(driver.frame_id, bag.channel_names)
        for stamp_ns, volts, slips in bag.due(time.monotonic()):
            if slips != truth:
                slip_truth.publish(Bool(data=bool(slips)))
            voltages.publish(writer.serialize(stamp_ns, volts))
            truth = slips

    server.each_tick.append(publish)
