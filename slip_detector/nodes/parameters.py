"""Dataclass fields as ROS parameters."""

import dataclasses
import sys
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.node import Node
from rclpy.parameter import Parameter

from slip_detector.parameter_sets import OF_RCLPY, ConfigType, allowed, default_of


def declare(node: Node, config_class: type[ConfigType]) -> ConfigType:
    """Declare all fields of a configuration on a node, with the values the user gave.

    Values are checked here and not by rclpy, which ignores unknown names, refuses ``100`` for a
    floating-point parameter and has no empty list.

    Raises
    ------
    ValueError
        For an unknown name or a value that is not allowed.
    """
    # rclpy offers given values only one by one and for declared names; an unknown name would
    # pass unseen. Its own declare_parameter reads the same attribute.
    given: dict[str, Parameter] = node._parameter_overrides
    values = {
        name: [] if parameter.type_ == Parameter.Type.NOT_SET else parameter.value
        for name, parameter in given.items()
        if name.split('.')[0] not in OF_RCLPY
    }
    config = config_class.from_parameters(values)
    fields = {field.name: field for field in dataclasses.fields(config)}
    for name, value in config.to_parameters().items():
        field = fields[name.split('.')[0]]
        node.declare_parameter(name, value, _descriptor(field, value), ignore_override=True)
    return config


def _descriptor(field: 'dataclasses.Field[Any]', value: Any) -> ParameterDescriptor:
    unit = f' [{field.metadata["unit"]}]' if field.metadata['unit'] else ''
    descriptor = ParameterDescriptor(
        description=f'{field.metadata["meaning"]}{unit}',
        additional_constraints=allowed(field),
        read_only=True,
        # An empty list has no type, and a vote is a number or a word.
        dynamic_typing=isinstance(value, list) or field.name == 'vote',
    )
    low, high = field.metadata['low'], field.metadata['high']
    if low is None and high is None:
        return descriptor
    default = default_of(field)
    if isinstance(default, float):
        low = -sys.float_info.max if low is None else float(low)
        high = sys.float_info.max if high is None else float(high)
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif isinstance(default, int):
        low = -(2**63) if low is None else int(low)
        high = 2**63 - 1 if high is None else int(high)
        descriptor.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return descriptor
