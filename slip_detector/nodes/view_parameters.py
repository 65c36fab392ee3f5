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

"""Reads and sets the parameters of detectors through the services that every node has."""

import asyncio
import time
from array import array
from collections.abc import Mapping
from typing import Any

import numpy as np
from rcl_interfaces.msg import ParameterEvent
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParametersAtomically,
)
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.serialization import serialize_message

from slip_detector.nodes.rclpy_internals import send_request, take_answer
from slip_detector.view.parameter_panel import Reading

#: Longest time for an answer, in seconds; a detector needs only the time to check parameters.
ANSWER_S = 5.0

#: Time, in seconds, after which an unanswered request is sent again: an answer is lost if the
#: service has not discovered the client yet.
ASK_AGAIN_S = 0.5

#: Period, in seconds, at which answers are looked for.
LOOK_S = 0.01

SERVICES = {
    'list_parameters': ListParameters,
    'describe_parameters': DescribeParameters,
    'get_parameters': GetParameters,
    'set_parameters_atomically': SetParametersAtomically,
}


class ParameterClient:
    """Calls the parameter services of one node without blocking the event loop.

    No node has to be spun: each call takes its answers itself.

    Parameters
    ----------
    node
        The node that sends the requests.
    of_node
        Full name of the node whose parameters are read and set.
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
        """Return all parameters of the node.

        Raises
        ------
        ValueError
            When it does not answer.
        """
        names = (await self._ask('list_parameters')).result.names
        described = (await self._ask('describe_parameters', names=names)).descriptors
        return Reading(
            await self._values(names),
            frozenset(each.name for each in described if each.read_only),
            {each.name: each.description for each in described},
        )

    async def set(self, values: Mapping[str, Any]) -> str:
        """Set parameters, all or none.

        Parameters
        ----------
        values
            By name; None deletes the parameter.

        Returns
        -------
        str
            Why not: the message of the node, or that it does not answer; empty if they are set.
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

    async def _values(self, names: list[str]) -> dict[str, Any]:
        values = (await self._ask('get_parameters', names=names)).values
        return {name: as_python(value) for name, value in zip(names, values, strict=True)}

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
                while taken := take_answer(client):
                    if taken[0] in numbers:
                        return taken[1]
                await asyncio.sleep(LOOK_S)
        what = 'has not answered' if numbers else 'cannot be reached'
        raise ValueError(f'{self._of_node} {what} for {ANSWER_S:g} s')


def as_python(value: Any) -> Any:
    """Return a value of a message as a Python value; None if it is not set.

    Examples
    --------
    >>> from rcl_interfaces.msg import ParameterType, ParameterValue
    >>> kind = ParameterType.PARAMETER_DOUBLE_ARRAY
    >>> as_python(ParameterValue(type=kind, double_array_value=[7.0, 50.0]))
    [7.0, 50.0]
    """
    found = parameter_value_to_python(value)
    return list(found) if isinstance(found, (array, tuple, np.ndarray)) else found


def _typed(name: str, value: Any) -> tuple[str, Parameter.Type | None, Any]:
    """Return name, type and value of a parameter; numbers in a list get one type."""
    if value is None:
        return name, Parameter.Type.NOT_SET, None
    whole = isinstance(value, int) and not isinstance(value, bool)
    if whole and not -(2**63) <= value < 2**63:
        value = float(value)
    if isinstance(value, list) and value:
        kinds = {type(item) for item in value}
        if kinds == {int, float}:
            value = [float(item) for item in value]
        elif len(kinds) > 1:
            value = [str(item) for item in value]
    return name, Parameter.Type.from_parameter_value(value), value


def changes_in(event: ParameterEvent) -> dict[str, Any]:
    """Return the changes in a parameter event: values by name, None for a deleted parameter.

    Examples
    --------
    >>> from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
    >>> threshold = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=0.7)
    >>> changed = [Parameter(name='threshold', value=threshold)]
    >>> changes_in(ParameterEvent(changed_parameters=changed))
    {'threshold': 0.7}
    """
    changed = {each.name: as_python(each.value) for each in event.changed_parameters}
    new = {each.name: as_python(each.value) for each in event.new_parameters}
    return {**changed, **new, **dict.fromkeys(each.name for each in event.deleted_parameters)}
