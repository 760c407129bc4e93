# SPDX-License-Identifier: Apache-2.0
"""A node that declares its parameters from definitions: with text, unit, range and choices."""

from collections.abc import Mapping
from typing import Any

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from ..parameters.definition import Definition, InvalidParameters
from ..parameters.node_fields import COMMON_DEFINITIONS
from . import messages


class DeclaringNode(Node):
    """A node whose parameters have dynamic types, so that an integer is a number.

    ``given`` are the values that the user gives, None where one has no value. Raises
    InvalidParameters if a parameter that every node has is of a wrong type.
    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        try:
            super().__init__(name, automatically_declare_parameters_from_overrides=True, **kwargs)
        except InvalidParameterTypeException as error:  # of what every node has
            raise InvalidParameters([str(error)]) from None
        # rcl makes an empty array a parameter without a value.
        self.given: dict[str, Any] = {
            key: [] if parameter.type_ is Parameter.Type.NOT_SET else parameter.value
            for key, parameter in self.get_parameters_by_prefix('').items()
        }

    def declare_parameters(
        self, namespace: str, parameters: Any, ignore_override: bool = False
    ) -> list[Parameter]:
        """Declare parameters with dynamic types.

        rclpy declares the parameters that the user gives by this call, with static types, which
        an empty array cannot have.
        """
        dynamic = [
            (name, value, *descriptor)
            if descriptor and descriptor[0].dynamic_typing
            else (name, value, ParameterDescriptor(dynamic_typing=True))
            for name, value, *descriptor in parameters
        ]
        return super().declare_parameters(namespace, dynamic, ignore_override)

    def describe_clock(self) -> None:
        """Describe `use_sim_time`, which rclpy has declared already."""
        clock = COMMON_DEFINITIONS['use_sim_time']
        self.set_descriptor(clock.name, messages.descriptor(clock, read_only=True))

    def declare(
        self,
        definitions: Mapping[str, Definition],
        given: Mapping[str, object],
        prefix: str = '',
        read_only: bool = False,
    ) -> None:
        """Declare parameters with what is known of them, and with the values that were given."""
        declared, empty = [], []
        for key, definition in definitions.items():
            name = prefix + key
            if self.has_parameter(name):  # without a description until now
                self.undeclare_parameter(name)
            value = messages.plain(given.get(name, definition.initial))
            if value == []:  # rclpy takes it for an array of bytes
                empty.append(Parameter(name, Parameter.Type.STRING_ARRAY, value))
            fixed = read_only or self.fixed(key)
            described = messages.descriptor(definition, read_only=fixed)
            declared.append((name, value, described))
        self.declare_parameters('', declared, ignore_override=True)
        self.set_parameters(empty)

    def fixed(self, key: str) -> bool:
        """Return whether a parameter takes effect at the start only."""
        return True
