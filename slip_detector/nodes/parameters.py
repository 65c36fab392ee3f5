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

"""Declares the fields of a configuration as ROS parameters, and applies their changes."""

import itertools
import sys
from collections.abc import Callable, Collection, Sequence
from typing import Any

from rcl_interfaces import msg
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter

from slip_detector.nodes.rclpy_internals import answer_with, read_given_parameters
from slip_detector.parameters import (
    FIXED_PARAMETERS,
    ConfigType,
    DetectorConfig,
    allowed,
    is_of_rclpy,
    name_list,
    parameters_for,
)


def declare(
    node: Node,
    config_class: type[ConfigType],
    fixed: Collection[str] | None = None,
    cli_args: Sequence[str] | None = None,
) -> ConfigType:
    """Declare all fields of a configuration on a node, with the values given by the user.

    Values are checked here and not by rclpy, which ignores unknown names, refuses ``100`` for a
    floating-point parameter and has no empty list. Unknown names that were given to all nodes
    (``/**``, or ``-p`` without a node) are left out, with a warning where one is nearly known.

    Parameters
    ----------
    node, config_class
        The node, and the class of its configuration.
    fixed
        Fields that cannot be changed while the node runs; None: all.
    cli_args
        ROS arguments for this node, in addition to those of the process.

    Raises
    ------
    ValueError
        For an unknown name given to this node, a value that is not allowed, or a parameter file
        for nodes with other names; names the file, where the fault is in one.
    """
    values: dict[str, Any] = {}
    files, full_name = (
        _options('--params-file', arguments=cli_args),
        node.get_fully_qualified_name(),
    )
    for path in files:
        values |= parameters_for(path, config_class.NODE, full_name).own
    # Of `-p slip_detector:threshold:=0.5`; without a node's name it is for all nodes.
    rules = [text.partition(':=')[0] for text in _options('-p', '--param', arguments=cli_args)]
    own = values.keys() | {rule.rpartition(':')[2] for rule in rules if ':' in rule}
    values |= {
        each.name: [] if each.type_ == Parameter.Type.NOT_SET else each.value
        for each in read_given_parameters(node)
        if not is_of_rclpy(each.name)
    }
    try:
        config = config_class.from_parameters(values, own=own, warn=node.get_logger().warning)
    except ValueError:
        for path in files:  # The message for a file that is wrong by itself names the file.
            config_class.from_yaml(path, full_name)
        raise
    for name, value in config.to_parameters().items():
        field = config_class.__dataclass_fields__[name.partition('.')[0]]
        unit = f' [{field.metadata["unit"]}]' if field.metadata['unit'] else ''
        descriptor = msg.ParameterDescriptor(
            name=name,
            description=f'{field.metadata["meaning"]}{unit}',
            additional_constraints=allowed(field),
            read_only=fixed is None or name in fixed,
            # An empty list has no type, and a vote is a number or a word.
            dynamic_typing=isinstance(value, list) or field.name == 'vote',
        )
        low, value_type = field.metadata['low'], type(field.metadata['default'])
        if low is not None and value_type in (int, float):
            ends = {'from_value': value_type(low), 'to_value': value_type(field.metadata['high'])}
            if value_type is float:
                descriptor.floating_point_range = [msg.FloatingPointRange(**ends)]
            else:
                descriptor.integer_range = [msg.IntegerRange(**ends)]
        node.declare_parameter(name, value, descriptor, ignore_override=True)
    return config


def _options(*names: str, arguments: Sequence[str] | None = None) -> list[str]:
    """Return the values of options of the command line, and of further arguments."""
    pairs = itertools.pairwise([*sys.argv, *(arguments or ())])
    return [value for option, value in pairs if option in names]


def tell_of_other_names(nodes: Sequence[Node], executable: str) -> None:
    """Warn of sections in parameter files for nodes like these that this process does not have."""
    names = [node.get_fully_qualified_name() for node in nodes]
    for path in _options('--params-file'):
        first, *rest = (parameters_for(path, executable, name).unmatched for name in names)
        if absent := [section for section in first if all(section in each for each in rest)]:
            words = f'{path}: no node of this process has the name of {", ".join(absent)}'
            nodes[0].get_logger().warning(words)


def follow_changes(
    node: Node,
    current: Callable[[], DetectorConfig],
    check: Callable[[DetectorConfig], None],
    apply: Callable[[DetectorConfig], None],
) -> None:
    """Let the parameter services change the configuration of a detector.

    All values of a request are taken or none. The ordinary service leaves out parameters of other
    nodes and those that cannot be changed, and answers each of these by itself.

    The node must allow undeclared parameters, so that groups can be added and deleted, and so that
    a wrong name reaches the check here, whose message is clearer than rclpy's.

    Parameters
    ----------
    node
        The node, with its parameters declared.
    current
        Returns the present configuration.
    check
        Raises a ValueError when a configuration, though valid, cannot be run.
    apply
        Gets the new configuration once the parameters have changed.
    """

    def set_all(requested: Sequence[Any]) -> msg.SetParametersResult:
        """Set parameters, given as messages, and what they replace: all or none.

        rclpy checks only afterwards: its messages on types and ranges do not tell what is allowed.
        """
        parameters = [Parameter.from_parameter_msg(each) for each in requested]
        of_rclpy = [each for each in parameters if is_of_rclpy(each.name)]
        values = {each.name: each.value for each in parameters if each not in of_rclpy}
        try:
            config = current().with_values(values)
            check(config)
        except ValueError as error:
            return msg.SetParametersResult(successful=False, reason=str(error))
        changes = current().changes_to(config)
        to_set = [Parameter(name, value=value) for name, value in changes.items()]
        result = node.set_parameters_atomically(to_set + of_rclpy)
        if result.successful:
            apply(config)
            if replaced := sorted(changes.keys() - values.keys()):
                node.get_logger().warning(f'changed as well: {name_list(replaced)}')
        return result

    def answer_whole(request: Any, response: Any) -> Any:
        response.result = set_all(request.parameters)
        return response

    def answer_each(request: Any, response: Any) -> Any:
        settable = current().__dataclass_fields__.keys() - FIXED_PARAMETERS
        together = [each for each in request.parameters if each.name.partition('.')[0] in settable]
        result = set_all(together)
        response.results = [
            result if each in together else set_all([each]) for each in request.parameters
        ]
        return response

    answer_with(node, SetParametersAtomically, answer_whole)
    answer_with(node, SetParameters, answer_each)
