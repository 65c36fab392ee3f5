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

"""Publish the samples of your own sensor for the detector.

Replace ``OwnSensor`` by a class that reads your sensor. The detector needs a parameter file that
describes the sensor: ``sample_rate_hz``, ``channels`` and ``groups``.
"""

import contextlib
import math
import random
import signal
import time

import rclpy
from rclpy.qos import qos_profile_sensor_data
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from sensor_msgs.msg import JointState

SAMPLE_RATE_HZ = 250.0
CHANNEL_NAMES = ['ch1', 'ch2', 'ch3', 'ch4']


class OwnSensor:
    """Stands in for a sensor: every other second all channels vibrate at 25 Hz."""

    def __init__(self):
        self._begin_ns, self._n = time.time_ns(), 0

    def read(self):
        """Wait for the next sample.

        Returns
        -------
        int
            Time at which it was taken, in ns; not the time of publication, as the detector notices
            lost samples by these times. Their errors must be below half a sample period.
        list of float
            The voltage of each channel in V.
        """
        time_s = self._n / SAMPLE_RATE_HZ
        taken_ns = self._begin_ns + round(1e9 * time_s)
        self._n += 1
        time.sleep(max(0.0, 1e-9 * (taken_ns - time.time_ns())))
        vibration = 0.05 * math.sin(2 * math.pi * 25.0 * time_s) if time_s % 2 > 1 else 0.0
        return taken_ns, [4.3 + vibration + random.gauss(0.0, 1e-3) for _ in CHANNEL_NAMES]


def publish(node):
    """Publish each sample as it is taken."""
    publisher = node.create_publisher(JointState, 'voltages', qos_profile_sensor_data)
    sensor = OwnSensor()
    while True:
        taken_ns, volts = sensor.read()
        message = JointState(name=CHANNEL_NAMES, position=volts)
        message.header.stamp = Time(nanoseconds=taken_ns).to_msg()
        publisher.publish(message)


def main():
    """Publish until Ctrl-C or SIGTERM."""
    # rclpy's own handlers would end the communication while a message is being published.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    with contextlib.suppress(KeyboardInterrupt):
        publish(rclpy.create_node('own_sensor'))
    rclpy.try_shutdown()


if __name__ == '__main__':
    main()
