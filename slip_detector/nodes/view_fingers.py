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
from array import array
from collections.abc import Collection, Mapping
from typing import Any, NamedTuple

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.serialization import serialize_message

from slip_detector.nodes.finger_topics import FingerTopics, PolledTopics, Topics
from slip_detector.nodes.inputs import publishing_nodes
from slip_detector.nodes.messages import event_qos
from slip_detector.nodes.rclpy_internals import send_request, take_answer
from slip_detector.view.detectors import Detectors, Diagnosis, Finger, Reading

#: Period, in seconds, at which detectors are looked for.
SEARCH_S = 1.0

#: Time, in seconds, for which a message on ``/diagnostics`` is shown; it comes once a second.
DIAGNOSIS_S = 3.5

#: Longest time for an answer, in seconds; a detector needs only the time to check parameters.
ANSWER_S = 5.0

#: Time, in seconds, after which an unanswered request is sent again: an answer is lost if the
#: service has not discovered the client yet.
ASK_AGAIN_S = 0.5

#: A parameter that was set is reported by an event: longest time to wait for it, in seconds.
EVENT_S = 1.0

#: Period, in seconds, at which answers and events are looked for.
POLL_S = 0.01

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

SERVICES = {
    'list_parameters': ListParameters,
    'describe_parameters': DescribeParameters,
    'get_parameters': GetParameters,
    'set_parameters_atomically': SetParametersAtomically,
}


class ParameterClient:
    """Calls the parameter services of one node without blocking the event loop.

    No node has to be spun: each call takes its answers itself.
    """

    def __init__(self, node: Node, of_node: str) -> None:
        self._node, self._of_node = node, of_node
        self._clients = {
            name: node.create_client(kind, f'{of_node}/{name}') for name, kind in SERVICES.items()
        }
        self._destroyed = False
        # One request at a time, so that an answer to an earlier one can be dropped.
        self._asking = asyncio.Lock()

    def destroy(self) -> None:
        """Destroy the clients; requests under way end with an error."""
        self._destroyed = True
        for client in self._clients.values():
            self._node.destroy_client(client)

    async def read(self) -> Reading:
        """Return all parameters of the node; raise a ValueError if it does not answer."""
        names = (await self._ask('list_parameters')).result.names
        described = (await self._ask('describe_parameters', names=names)).descriptors
        values = (await self._ask('get_parameters', names=names)).values
        return Reading(
            {name: as_python(value) for name, value in zip(names, values, strict=True)},
            frozenset(each.name for each in described if each.read_only),
            {each.name: each.description for each in described},
        )

    async def set(self, values: Mapping[str, Any]) -> str:
        """Set parameters, all or none; None deletes one. Return why not, or ''.

        Why not is the message of the node, or that it does not answer.
        """
        try:
            parameters = [Parameter(*_typed(n, v)).to_parameter_msg() for n, v in values.items()]
            for each in parameters:
                serialize_message(each)
        except (AssertionError, TypeError, ValueError, OverflowError) as error:
            return f'this cannot be sent to the detector: {error}'
        try:
            # An empty set changes nothing, so it may be sent repeatedly until it is answered. Then
            # the node has discovered this client, and no answer is lost.
            await self._ask('set_parameters_atomically')
        except ValueError as error:
            return f'nothing was changed: {error}'
        try:
            answer = await self._ask('set_parameters_atomically', once=True, parameters=parameters)
        except ValueError as error:
            return f'it is not known whether this was set: {error}'
        return '' if answer.result.successful else answer.result.reason or 'refused'

    async def _ask(self, service: str, *, once: bool = False, **request: Any) -> Any:
        """Return the answer of a service; raise a ValueError if none comes."""
        client, kind = self._clients[service], SERVICES[service]
        numbers: set[int] = set()
        async with self._asking:
            begun_s = asked_s = time.monotonic()
            while time.monotonic() < begun_s + ANSWER_S:
                if self._destroyed or not client.service_is_ready():
                    if self._destroyed or numbers:
                        raise ValueError(f'{self._of_node} ended before it answered')
                elif not numbers or (not once and time.monotonic() > asked_s + ASK_AGAIN_S):
                    numbers.add(send_request(client, kind.Request(**request)))
                    asked_s = time.monotonic()
                while answer := take_answer(client):
                    if answer[0] in numbers:
                        return answer[1]
                await asyncio.sleep(POLL_S)
        what = 'has not answered' if numbers else 'cannot be reached'
        raise ValueError(f'{self._of_node} {what} for {ANSWER_S:g} s')


def as_python(value: Any) -> Any:
    """Return a value of a message as a Python value; None if it is not set."""
    found = parameter_value_to_python(value)
    return list(found) if isinstance(found, (array, tuple, np.ndarray)) else found


def _typed(name: str, value: Any) -> tuple[str, Parameter.Type, Any]:
    """Return name, type and value of a parameter; numbers in a list get one type."""
    if type(value) is int and not -(2**63) <= value < 2**63:
        value = float(value)
    if isinstance(value, list) and (kinds := {*map(type, value)}) and len(kinds) > 1:
        value = [float(item) if kinds == {int, float} else str(item) for item in value]
    return name, Parameter.Type.from_parameter_value(value), value


def changes_in(event: ParameterEvent) -> dict[str, Any]:
    """Return the changes in a parameter event: values by name, None for a deleted parameter."""
    given = [*event.changed_parameters, *event.new_parameters]
    deleted = dict.fromkeys(each.name for each in event.deleted_parameters)
    return {each.name: as_python(each.value) for each in given} | deleted


class ReadTask(NamedTuple):
    """A task that reads parameters, and whether it was begun because a detector was started."""

    task: asyncio.Task[None]
    started: bool


class RosDetectors(Detectors):
    """The fingers of all detectors that can be reached.

    A node that publishes a topic ``slip_onset`` and has the parameters of a detector is one. Only
    the topics of watched fingers are subscribed to.

    The node is not spun: :meth:`poll` takes its messages.
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
        self._heard: dict[tuple[str, str], tuple[float, Diagnosis]] = {}
        self._searched_s = float('-inf')

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
            qos = event_qos(depth=1000)
            self._shared.add(DiagnosticArray, '/diagnostics', qos, self._on_diagnostics)
            self._shared.add(ParameterEvent, '/parameter_events', qos, self._on_event)
        elif self._shared and not self._watched:
            self._shared.close()

    def poll(self) -> None:
        """Process received messages; once a second, look for detectors."""
        now_s = time.monotonic()
        if now_s - self._searched_s >= SEARCH_S:
            self._searched_s = now_s
            self._search()
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
            await asyncio.sleep(POLL_S)
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

    def _search(self) -> None:
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
        task = asyncio.get_running_loop().create_task(self._read_parameters(name, started))
        self._readings[name] = ReadTask(task, started)

    async def _read_parameters(self, name: str, started: bool) -> None:
        try:
            reading = await self._client(name).read()
        except ValueError:
            # The detector hangs, starts or ends: ask again.
            await asyncio.sleep(SEARCH_S)
            self._read(name, started=started)
            return
        # The detector may have been replaced by another one meanwhile.
        self._search()
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
            self._use_config(name, started)
        except ValueError as error:
            self._node.get_logger().warning(
                f'{name} has parameters that this version of slip_view does not know: {error}'
            )

    def _use_config(self, name: str, started: bool) -> None:
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
            self._use_config(name, started=False)
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
                    self._heard[finger, label] = now_s, diagnosis
        self._show_diagnostics()

    def _forget_diagnostics(self, now_s: float) -> None:
        old = [key for key, (at_s, _) in self._heard.items() if now_s - at_s > DIAGNOSIS_S]
        for key in old:
            del self._heard[key]
        if old:
            self._show_diagnostics()

    def _show_diagnostics(self) -> None:
        for name, finger in self.fingers.items():
            finger.diagnostics = tuple(
                diagnosis for (of, _), (_, diagnosis) in self._heard.items() if of == name
            )


def _long(message_type: str) -> str:
    """Return the name of a message type in the form that the ROS graph uses."""
    package, _, name = message_type.partition('/')
    return f'{package}/msg/{name.removeprefix("msg/")}'
