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

"""The interface of all sources."""

from collections import Counter

from slip_detector.chain.samples import Samples

#: Longest time that reading a live source waits for samples.
WAIT_S = 0.1


class Source:
    """A source of samples; the base class of scenes, recordings and sensors.

    A scene or a recording returns as many samples as it is asked for, with stamps from 0 on, and
    has an end. A live source returns the samples that its sensor sends, stamped by the receiver's
    clock; ``connected``, ``state`` and ``counts`` describe the connection.

    Attributes
    ----------
    name : str
        A name for messages.
    channel_names : tuple of str
    sample_rate_hz : float
        0 where it is not known.
    is_live : bool
        Whether the samples come from a sensor, at its own pace.
    has_object : bool
        Whether the fingertip holds an object with the force of the last order.
    takes_orders : bool
        Whether the source obeys orders to rest, to slip, to be tapped or to be pressed.
    connected : bool
        Whether there is a connection to the sensor.
    state : str
        What the source listens to, or why it cannot.
    counts : Counter of str
        What was received and dropped, as the decoders count it.

    Examples
    --------
    >>> from slip_detector.parameters import DriverConfig
    >>> from slip_detector.sources import open_source
    >>> source = open_source(DriverConfig(source='scene'))
    >>> isinstance(source, Source), source.is_live
    (True, False)
    """

    is_live = False

    def __init__(self, name: str, channel_names: tuple[str, ...], sample_rate_hz: float) -> None:
        self.name, self.channel_names, self.sample_rate_hz = name, channel_names, sample_rate_hz
        self.has_object = self.takes_orders = False
        self.connected = not self.is_live
        self.state = ''
        self.counts: Counter[str] = Counter()

    @property
    def damage(self) -> str:
        """One line on what could not be read or checked so far; empty if all could."""
        return ''

    def start(self) -> None:
        """Begin to listen, if the source is live; earlier samples are not returned.

        Raises
        ------
        ValueError
            When a parameter has a value with which it cannot listen. A missing serial port is not
            an error: the source waits for it.
        """

    def read(self, n: int) -> Samples:
        """Return the next samples.

        Parameters
        ----------
        n
            Number of samples; a live source ignores it.

        Returns
        -------
        Samples
            At most ``n`` samples; none only after the end. A live source returns the new samples
            after at most ``WAIT_S``; there may be none.

        Raises
        ------
        ValueError
            When a recording is broken; names it.
        """
        raise NotImplementedError

    def obey(self, command: float | str) -> None:
        """Do as commanded from the next sample on: hold the object with a force, or an order.

        Raises
        ------
        ValueError
            When the force is out of range, or there is no such order.
        """

    def close(self) -> None:
        """Close the file or the connection."""
