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

"""Finds running detectors by their topics, and shows them as fingers of the live page."""

import asyncio
import contextlib
import time
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node, NodeNameNonExistentError

from slip_detector.nodes.finger_topics import FingerTopics, Topics
from slip_detector.nodes.messages import event_qos
from slip_detector.nodes.polled_topics import PolledTopics
from slip_detector.nodes.senders import publishing_nodes
from slip_detector.nodes.view_parameters import ParameterClient, changes_in
from slip_detector.view.detectors import Detectors, Diagnosis, Finger

#: Period, in seconds, at which detectors are looked for.
LOOK_S = 1.0

#: Time, in seconds, for which a message on ``/diagnostics`` is shown; it comes once a second.
DIAGNOSIS_S = 3.5

#: A parameter that was set is reported by an event: longest time to wait for it, and period at
#: which it is looked for, in seconds.
EVENT_S, EVENT_LOOK_S = 1.0, 0.01

#: Most fingers that have gone whose data is kept.
MOST_GONE = 20

HEADER = 'std_msgs/msg/Header'

#: A node that publishes ``slip_onset`` and has these parameters is a detector.
OF_A_DETECTOR = {'sample_rate_hz', 'channels', 'threshold', 'heartbeat_hz'}

#: The middleware's name for a node that it does not know yet.
UNKNOWN = '_NODE_NAME_UNKNOWN_'

#: Time, in seconds, after which a node that publishes ``slip_onset`` and is still not known by
#: name is reported.
NAMELESS_S = 15.0


class ReadTask(NamedTuple):
    """A task that reads parameters, and whether it was begun because a detector was started."""

    task: asyncio.Task[None]
    started: bool


class RosDetectors(Detectors):
    """The fingers of all detectors that can be reached.

    A node that publishes a topic ``slip_onset`` and has the parameters of a detector is one. Only
    the topics of watched fingers are subscribed to.

    Parameters
    ----------
    node
        The node that subscribes. It is not spun: :meth:`poll` takes its messages.
    """

    def __init__(self, node: Node) -> None:
        super().__init__()
        self._node = node
        self._clients: dict[str, ParameterClient] = {}
        # By detector, its publishers: a new one tells that it was started again.
        self._publishers: dict[str, set[bytes]] = {}
        # By publisher of a node that is not known by name, when it was first seen.
        self._nameless: dict[bytes, float] = {}
        # Fingers that have gone, the latest last: if one comes back, its changes are reported.
        self._past: dict[str, Finger] = {}
        self._readings: dict[str, ReadTask] = {}
        self._watched: dict[str, FingerTopics] = {}
        # By watched finger, the nodes that publish its samples: their diagnostics are shown, too.
        self._senders: dict[str, list[str]] = {}
        self._shared = PolledTopics(node)
        self._said: dict[tuple[str, str], tuple[float, Diagnosis]] = {}
        self._looked_s = float('-inf')

    def watch(self, names: Collection[str]) -> None:
        """Receive the data of these fingers, and of no others."""
        wanted = {name for name in names if name in self.fingers}
        for name in set(self._watched) - wanted:
            self._watched.pop(name).close()
        for name in wanted - set(self._watched):
            topics = self._topics_of(name)
            self._watched[name] = FingerTopics(self._node, self.fingers[name], topics)
            # Its parameters may have changed while it was not watched.
            self._read(name)
        if self._watched and not self._shared:
            self._shared.add(
                DiagnosticArray, '/diagnostics', event_qos(depth=1000), self._on_diagnostics
            )
            self._shared.add(
                ParameterEvent, '/parameter_events', event_qos(depth=1000), self._on_event
            )
        elif self._shared and not self._watched:
            self._shared.close()

    def poll(self) -> None:
        """Process received messages; once a second, look for detectors."""
        now_s = time.monotonic()
        if now_s - self._looked_s >= LOOK_S:
            self._looked_s = now_s
            self._look_around()
            self._forget_diagnostics(now_s)
        self._shared.poll()
        for topics in self._watched.values():
            topics.poll()

    async def set_parameters(self, name: str, values: Mapping[str, Any]) -> str:
        """Set parameters of a finger's detector, all or none; return the refusal, or ''.

        It waits until the panel of a watched finger has the new values, so that a request to save
        that follows saves them.
        """
        refusal = await self._client(name).set(values)
        panel, until_s = self.panel(name), time.monotonic() + EVENT_S
        while not refusal and time.monotonic() < until_s:
            if all(panel.values.get(each) == value for each, value in values.items()):
                break
            await asyncio.sleep(EVENT_LOOK_S)
        return refusal

    def close(self) -> None:
        """Release all resources."""
        self.watch(())
        for reading in self._readings.values():
            reading.task.cancel()
        for client in self._clients.values():
            client.destroy()
        self._clients.clear()

    # Detectors that come and go.

    def _look_around(self) -> None:
        """Notice detectors that have come, were started again, or have gone."""
        found: dict[str, set[bytes]] = {}
        nameless: dict[bytes, str] = {}
        for topic, types in self._node.get_topic_names_and_types():
            # Unlike those of slip and slip_valid, this publisher stays if heartbeat_hz changes.
            if types == [HEADER] and topic.rpartition('/')[2] == 'slip_onset':
                for each in self._node.get_publishers_info_by_topic(topic):
                    publisher = bytes(each.endpoint_gid)
                    if each.node_name == UNKNOWN:
                        nameless[publisher] = topic
                        continue
                    name = f'{each.node_namespace.rstrip("/")}/{each.node_name}'
                    found.setdefault(name, set()).add(publisher)
        self._report_nameless(nameless)
        for name in set(self._publishers) - set(found):
            self._forget(name)
        for name, publishers in found.items():
            if publishers - self._publishers.get(name, set()):
                self._read(name, started=True)
            self._publishers[name] = publishers
        for name, topics in self._watched.items():
            names = self._topics_of(name)
            if names != topics.names:
                topics.subscribe(names)
        self._senders = {
            name: publishing_nodes(self._node, topics.names.voltages)
            for name, topics in self._watched.items()
            if topics.names.voltages
        }

    def _report_nameless(self, nameless: Mapping[bytes, str]) -> None:
        """Report, once each, publishers of a topic whose node does not become known by name."""
        now_s = time.monotonic()
        self._nameless = {each: self._nameless.get(each, now_s) for each in nameless}
        for publisher, since_s in self._nameless.items():
            if now_s - since_s >= NAMELESS_S:
                self._nameless[publisher] = float('inf')
                self._node.get_logger().warning(
                    f'a node that publishes {nameless[publisher]} has not been known by name for '
                    f'{NAMELESS_S:g} s, so it cannot be shown: end it, and start it again after '
                    '20 s'
                )

    def _forget(self, name: str) -> None:
        del self._publishers[name]
        if name in self._readings:
            self._readings.pop(name).task.cancel()
        if name in self._watched:
            self._watched.pop(name).close()
        if name in self._clients:
            self._clients.pop(name).destroy()
        if name in self.fingers:
            finger = self._past[name] = self.fingers.pop(name)
            self.gone[name] = finger.label
            for oldest in [*self._past][:-MOST_GONE]:
                del self._past[oldest], self.gone[oldest], self.panels[oldest]

    def _topics_of(self, name: str) -> Topics:
        """Return the topics of a detector from the ROS graph, as they may be remapped."""
        namespace, _, node = name.rpartition('/')
        config = self.fingers[name].config
        subscribed = []
        with contextlib.suppress(NodeNameNonExistentError):  # It has just ended.
            subscribed = self._node.get_subscriber_names_and_types_by_node(node, namespace or '/')
        inputs = [
            topic
            for topic, types in subscribed
            if _long(config.input_type) in types
            and topic not in (f'{namespace}/slip_valid', '/clock', '/parameter_events')
        ]
        voltages = inputs[0] if inputs else ''
        return Topics(
            namespace, voltages, f'{voltages.rpartition("/")[0]}/slip_truth', f'{name}/envelope'
        )

    # Their parameters.

    def _client(self, name: str) -> ParameterClient:
        if name not in self._publishers:
            raise ValueError(f'{name} is gone')
        if name not in self._clients:
            self._clients[name] = ParameterClient(self._node, name)
        return self._clients[name]

    def _read(self, name: str, *, started: bool = False) -> None:
        """Read the parameters of a detector; a task that is under way is replaced."""
        before = self._readings.pop(name, None)
        if before is not None:
            before.task.cancel()
            started |= before.started
        task = asyncio.get_running_loop().create_task(self._take_parameters(name, started))
        self._readings[name] = ReadTask(task, started)

    async def _take_parameters(self, name: str, started: bool) -> None:
        try:
            reading = await self._client(name).read()
        except ValueError:
            # The detector hangs, starts or ends: ask again.
            await asyncio.sleep(LOOK_S)
            self._read(name, started=started)
            return
        # The detector may have been replaced by another one meanwhile.
        self._look_around()
        under_way = self._readings.get(name)
        if under_way is None or under_way.task is not asyncio.current_task():
            return
        del self._readings[name]
        if not reading.values.keys() >= OF_A_DETECTOR:
            return
        panel = self.panel(name)
        if started or not panel.values:
            panel.read(reading)
        else:
            gone = dict.fromkeys(panel.values.keys() - reading.values.keys())
            panel.update({**gone, **reading.values})
        try:
            self._take_config(name, started)
        except ValueError as error:
            self._node.get_logger().warning(
                f'{name} has parameters that this version of slip_view does not know: {error}'
            )

    def _take_config(self, name: str, started: bool) -> None:
        config = self.panel(name).config
        if name not in self.fingers:
            self.gone.pop(name, None)
            before = self._past.pop(name, None)
            self.fingers[name] = before or Finger(name, config)
            started = before is not None
        finger = self.fingers[name]
        if started:
            finger.started_again(config)
        elif finger.config != config:
            finger.update_config(config)

    def _on_event(self, event: ParameterEvent) -> None:
        name = event.node
        if name not in self.fingers:
            return
        panel = self.panel(name)
        if any(each.name in panel.values for each in event.new_parameters):
            return  # The detector is restarting: its parameters are read when it publishes.
        if name in self._readings:
            self._read(name)
            return
        panel.update(changes_in(event))
        try:
            self._take_config(name, started=False)
        except ValueError:  # Some of several events are missing, lost or still to come.
            self._read(name)

    # Their diagnostics.

    def _on_diagnostics(self, array: DiagnosticArray) -> None:
        """Take the diagnostics of detectors, and of the nodes that publish their samples."""
        now_s = time.monotonic()
        for status in array.status:
            node, _, part = status.name.partition(': ')
            name = f'/{node.lstrip("/")}'
            for finger in self._watched:
                if name == finger or name in self._senders.get(finger, ()):
                    label = part if name == finger else f'{name.rpartition("/")[2]}: {part}'
                    diagnosis = Diagnosis(status.level[0], label, status.message)
                    self._said[finger, label] = now_s, diagnosis
        self._tell_diagnostics()

    def _forget_diagnostics(self, now_s: float) -> None:
        old = [key for key, (at_s, _) in self._said.items() if now_s - at_s > DIAGNOSIS_S]
        for key in old:
            del self._said[key]
        if old:
            self._tell_diagnostics()

    def _tell_diagnostics(self) -> None:
        for name, finger in self.fingers.items():
            finger.diagnostics = tuple(
                diagnosis for (of, _), (_, diagnosis) in self._said.items() if of == name
            )


def _long(message_type: str) -> str:
    """Return the name of a message type in the form that the ROS graph uses."""
    package, _, name = message_type.partition('/')
    return f'{package}/msg/{name.removeprefix("msg/")}'
