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
import math
import time
from collections.abc import Callable, Collection, Mapping
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node, NodeNameNonExistentError
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.task import Future
from std_msgs.msg import String

from slip_detector.nodes.finger_topics import FingerTopics
from slip_detector.nodes.inputs import find_publishing_nodes
from slip_detector.nodes.messages import event_qos, state_qos
from slip_detector.nodes.rclpy_internals import PolledTopics, take_answers
from slip_detector.parameters import DetectorConfig, quote
from slip_detector.view.detectors import OUTSIDE, RESTART, Detectors, Diagnosis, Finger

#: Period, in seconds, at which detectors are looked for.
SEARCH_S = 1.0

#: Time, in seconds, for which a message on ``/diagnostics`` is shown; it comes once a second.
DIAGNOSIS_S = 3.5

#: Longest time, in seconds, until an answer; a detector only has to check parameters.
ANSWER_S = 5.0

#: Time, in seconds, after which an unanswered question is asked again: an answer is lost if the
#: service has not discovered the client.
ASK_AGAIN_S = 0.5

#: Least time, in seconds, between two messages on the log.
LOG_S = 60.0

#: Period, in seconds, at which answers are looked for.
POLL_S = 0.01

#: A node that publishes ``slip_onset`` and has these parameters is a detector.
PARAMETERS_OF_A_DETECTOR = {'sample_rate_hz', 'channels', 'threshold', 'heartbeat_hz'}

#: The middleware's name for a node that it does not know yet.
UNKNOWN_NODE = '_NODE_NAME_UNKNOWN_'


class RemoteDetector:
    """The parameters of one node, asked for without blocking the event loop.

    The node of the page is not spun: a question takes its answers itself. Errors are ValueErrors.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._node, self.name = node, name
        others = set(node.clients)
        self._parameters = AsyncParameterClient(node, name)
        self._clients = set(node.clients) - others
        #: The publishers of the node; a new one shows that the node was started again.
        self.publishers: set[bytes] = set()
        #: Set when the parameters have to be read, and the task that reads them.
        self.outdated = asyncio.Event()
        self.reads: asyncio.Task[None] | None = None
        #: Held from a question until the answer is noted.
        self.asking = asyncio.Lock()

    def close(self) -> None:
        """Destroy the clients; requests under way end with an error."""
        if self.reads is not None:
            self.reads.cancel()
        for client in self._clients:
            self._node.destroy_client(client)

    async def read(self) -> dict[str, Any]:
        """Return all parameters of the node by name."""
        names = (await self._ask(self._parameters.list_parameters)).result.names
        messages = (await self._ask(self._parameters.get_parameters, names)).values
        return dict(zip(names, map(parameter_value_to_python, messages), strict=True))

    async def set(self, values: Mapping[str, Any]) -> None:
        """Set parameters, all or none; None deletes one."""
        try:
            parameters = [_message_of(*each) for each in values.items()]
        except (AssertionError, TypeError, ValueError, OverflowError) as error:
            raise ValueError(f'this cannot be sent to the detector: {error}') from None
        ask = self._parameters.set_parameters_atomically
        try:
            result = (await self._ask(ask, parameters, again_s=math.inf)).result
        except ValueError as error:
            raise ValueError(f'it is not known whether this was set: {error}') from None
        if not result.successful:
            raise ValueError(result.reason or 'refused')

    async def _ask(
        self, ask: Callable[..., Future], *arguments: Any, again_s: float = ASK_AGAIN_S
    ) -> Any:
        """Return the answer to a question, which is asked again until it is answered."""
        asked: list[Future] = []
        ask_s = time.monotonic()
        until_s = ask_s + ANSWER_S
        with contextlib.suppress(InvalidHandle):  # The node has ended.
            while (now_s := time.monotonic()) < until_s:
                if now_s >= ask_s and self._parameters.services_are_ready():
                    asked.append(ask(*arguments))
                    ask_s = now_s + again_s
                take_answers(self._clients)
                for answer in filter(Future.done, asked):
                    return answer.result()
                await asyncio.sleep(POLL_S)
            raise ValueError(f'{self.name} has not answered for {ANSWER_S:g} s')
        raise ValueError(f'{self.name} ended before it answered')


def _message_of(name: str, value: Any) -> Any:
    """Return the message that sets a parameter; numbers in a list get one type."""
    if isinstance(value, list) and float in map(type, value):
        value = [float(item) for item in value]
    for item in value if isinstance(value, list) else [value]:
        if isinstance(item, int) and not -(2**63) <= item < 2**63:
            raise ValueError(f'{name} is {quote(item)}, allowed: a number of 64 bits')
    return Parameter(name, value=value).to_parameter_msg()


class RosDetectors(Detectors):
    """The fingers of all detectors that can be reached.

    A node that publishes a topic ``slip_onset`` and has the parameters of a detector is one. Only
    the topics of watched fingers are subscribed to.

    The node is not spun: :meth:`poll` takes its messages.
    """

    def __init__(self, node: Node) -> None:
        super().__init__()
        self._node = node
        # By name, the nodes that publish slip_onset.
        self._remotes: dict[str, RemoteDetector] = {}
        self._watched: dict[str, FingerTopics] = {}
        self._shared = PolledTopics(node)
        self._searched_s = float('-inf')
        # By topic, where simulated fingers are told what to do.
        self._orders: dict[str, Any] = {}

    def watch(self, names: Collection[str]) -> None:
        """Receive the data of these fingers, and of no others."""
        wanted = {name for name in names if name in self.fingers}
        for name in set(self._watched) - wanted:
            self._watched.pop(name).close()
        for name in wanted - set(self._watched):
            finger = self.fingers[name]
            self._watched[name] = FingerTopics(self._node, finger, self._input_of(finger))
            # Its parameters may have changed while it was not watched.
            self._remotes[name].outdated.set()
        if self._watched and not self._shared:
            qos = event_qos(depth=1000)
            self._shared.add(DiagnosticArray, '/diagnostics', qos)
            self._shared.add(ParameterEvent, '/parameter_events', qos)
        elif self._shared and not self._watched:
            self._shared.close()

    def poll(self) -> None:
        """Process received messages; once a second, look for detectors."""
        now_s = time.monotonic()
        if now_s - self._searched_s >= SEARCH_S:
            self._searched_s = now_s
            self._search()
        for array, _ in self._shared.take('/diagnostics'):
            self._note_diagnostics(array)
        for event, _ in self._shared.take('/parameter_events'):
            self._note_event(event)
        for topics in self._watched.values():
            topics.poll()

    async def change(self, name: str, values: Mapping[str, Any], by: str) -> None:
        """Set parameters of a finger's detector, all or none; a ValueError says why not."""
        remote = self._remotes.get(name)
        if remote is None:
            raise ValueError(f'{name} is gone')
        async with remote.asking:
            await remote.set(values)
            self._note(name, await remote.read(), by)

    def order(self, name: str, what: str = '') -> bool:
        """Tell a simulated finger what to do; return whether a scene listens.

        A scene that is found later gets the last order then.
        """
        topic = f'{name.rpartition("/")[0]}/scene_order'
        listens: bool = self._node.count_subscribers(topic) > 0
        if (what or listens) and topic not in self._orders:
            self._orders[topic] = self._node.create_publisher(String, topic, state_qos())
        if what:
            self._orders[topic].publish(String(data=what))
        return listens

    def close(self) -> None:
        """Release all resources."""
        self.watch(())
        for name in [*self._remotes]:
            self._forget(name)

    # Detectors that come and go.

    def _search(self) -> None:
        """Notice detectors that have come, were started again, or have gone."""
        found: dict[str, set[bytes]] = {}
        for topic, types in self._node.get_topic_names_and_types():
            # Unlike those of slip and slip_valid, this publisher stays if heartbeat_hz changes.
            if types == ['std_msgs/msg/Header'] and topic.rpartition('/')[2] == 'slip_onset':
                for each in self._node.get_publishers_info_by_topic(topic):
                    name = f'{each.node_namespace.rstrip("/")}/{each.node_name}'
                    if each.node_name != UNKNOWN_NODE:
                        found.setdefault(name, set()).add(bytes(each.endpoint_gid))
        for name in self._remotes.keys() - found.keys():
            self._forget(name)
        for name, publishers in found.items():
            remote = self._remotes.get(name)
            if remote is None or publishers - remote.publishers:  # It was started.
                if remote is not None:
                    remote.close()
                remote = self._remotes[name] = RemoteDetector(self._node, name)
                remote.reads = asyncio.create_task(self._follow(remote))
            remote.publishers = publishers
        since_s = time.monotonic() - DIAGNOSIS_S
        for topics in self._watched.values():
            voltages = self._input_of(topics.finger)
            if voltages != topics.voltages:
                topics.subscribe(voltages)
            topics.senders = find_publishing_nodes(self._node, voltages) if voltages else []
            recent = tuple(each for at_s, each in topics.health.values() if at_s > since_s)
            topics.finger.diagnostics = recent

    def _forget(self, name: str) -> None:
        self._remotes.pop(name).close()
        if name in self.fingers:
            self.gone[name] = self.fingers.pop(name)

    def _input_of(self, finger: Finger) -> str:
        """Return the topic of a detector's input, which may be remapped; empty without one."""
        namespace, _, node = finger.name.rpartition('/')
        subscribed = []
        with contextlib.suppress(NodeNameNonExistentError):  # It has just ended.
            subscribed = self._node.get_subscriber_names_and_types_by_node(node, namespace or '/')
        wanted = finger.config.input_type.replace('/msg/', '/').replace('/', '/msg/')
        return next((topic for topic, types in subscribed if wanted in types), '')

    # Their parameters.

    async def _follow(self, remote: RemoteDetector) -> None:
        """Read the parameters of a node that was started, and whenever they may have changed."""
        by = RESTART
        while True:
            remote.outdated.clear()
            try:
                async with remote.asking:
                    self._note(remote.name, await remote.read(), by)
                by = OUTSIDE
                await remote.outdated.wait()
            except ValueError as error:
                # The detector hangs, starts or ends, or is of another version: ask again.
                words = f'{remote.name} cannot be shown: {error}'
                self._node.get_logger().warning(words, throttle_duration_sec=LOG_S)
                await asyncio.sleep(SEARCH_S)

    def _note(self, name: str, values: Mapping[str, Any], by: str) -> None:
        """Note the parameters of a node, and who changed them; show a detector as a finger."""
        if values.keys() >= PARAMETERS_OF_A_DETECTOR:
            fields = DetectorConfig.__dataclass_fields__
            known = {n: value for n, value in values.items() if n.partition('.')[0] in fields}
            self.note_config(name, DetectorConfig.from_parameters(known), by)

    def _note_event(self, event: ParameterEvent) -> None:
        """Read the parameters of a detector that reports a change."""
        # A node that declares known parameters is starting: it is read when it publishes.
        new = {each.name for each in event.new_parameters}
        finger = self.fingers.get(event.node)
        if finger is not None and not finger.config.to_parameters().keys() & new:
            self._remotes[event.node].outdated.set()

    # Their diagnostics.

    def _note_diagnostics(self, array: DiagnosticArray) -> None:
        """Take the diagnostics of detectors, and of the nodes that publish their samples."""
        now_s = time.monotonic()
        for status in array.status:
            node, _, part = status.name.partition(': ')
            name = f'/{node.lstrip("/")}'
            for finger, topics in self._watched.items():
                if name == finger or name in topics.senders:
                    label = part if name == finger else f'{name.rpartition("/")[2]}: {part}'
                    topics.health[label] = now_s, Diagnosis(status.level[0], label, status.message)
