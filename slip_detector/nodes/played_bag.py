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


"""Publishes the samples of a recording that pages play."""

import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool

from slip_detector.nodes.messages import sensor_qos, state_qos
from slip_detector.parameters.detector import DetectorConfig
from slip_detector.parameters.driver import DriverConfig
from slip_detector.recordings.messages import JointStateWriter
from slip_detector.view.bag import PlayedBag
from slip_detector.view.server import Server


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
