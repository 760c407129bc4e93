# SPDX-License-Identifier: Apache-2.0
"""A node that declares, checks and forwards the parameters of configuration.py."""

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from ..check import Severity, check, errors
from ..parameters import gantry
from ..parameters.axis import DEFINITIONS, AxisParameters, axis_parameters
from ..parameters.configuration import (
    AXIS_DEFINITIONS,
    Configuration,
    check_axis_values,
    check_node_value,
    configuration,
)
from ..parameters.connections import (
    CONNECTION_DEFINITIONS,
    TOPIC_DEFINITIONS,
    Connections,
    connections,
)
from ..parameters.definition import InvalidParameters
from ..parameters.gantry import FOLLOWER_DEFINITIONS
from ..parameters.node_fields import NODE_DEFINITIONS
from . import messages, words
from .declaring_node import DeclaringNode

#: Parameters that take effect at the start only.
FIXED = (
    'axes',
    'update_rate',
    'setpoint_interface',
    'position_joints',
    'setpoint_horizon',
    'setpoint_lead',
    'setpoint_stamp',
    'serialized',
    'memory',
    'record',
    'layout',
    'lifecycle',
    'coordinated',
    'joint',
    'followers',
)

#: The same for the parameters of an axis whose names begin so.
FIXED_KINDS = ('commands.', 'services.')

#: Parameters of the node that say nothing of a run of one axis.
OF_SEVERAL = (
    'axes',
    'home_sequence',
    'position_joints',
    'memory',
    'record',
    'record_runs',
    'record_failures',
    'marker_frame',
    'layout',
    'lifecycle',
    'coordinated',
)


class ConfiguredNode(DeclaringNode, ABC):
    """Reads, declares and checks the parameters of the homing node.

    ``configuration`` is the one at the start. ``faults``: by axis, the contradictions between
    parameters that were set one by one since then. Raises InvalidParameters, with every fault, if
    the parameters are bad.
    """

    def __init__(self, name: str, **kwargs: Any) -> None:
        super().__init__(name, **kwargs)
        given = self.given
        self.configuration = configuration(given)
        self.faults: dict[str, tuple[str, ...]] = {}
        self._unwired: dict[str, tuple[str, ...]] = {}  # why an axis lacks a topic
        self._prove(self.configuration)
        self.describe_clock()
        self.declare(NODE_DEFINITIONS, given)
        for axis, parameters in self.configuration.axes.items():
            implied = {  # by a CiA 402 method
                f'{axis}.home_direction': parameters.home_direction,
                f'{axis}.limit_reversal': parameters.limit_reversal,
            }
            self.declare(AXIS_DEFINITIONS, {**implied, **given}, f'{axis}.')
            if parameters.followers:  # a side would be driven against the others
                fixed = {'home_direction': AXIS_DEFINITIONS['home_direction']}
                self.declare(fixed, {**implied, **given}, f'{axis}.', read_only=True)
        self._declare_followers(given)

    def _declare_followers(self, given: Mapping[str, object]) -> None:
        """Declare what followers have of their own; it takes effect at the start only."""
        self._of_followers = {
            name: value
            for name, value in given.items()
            if any(name.startswith(f'{full}.') for full in self._follower_names())
        }
        for full in self._follower_names():
            own = {
                key: definition
                for key, definition in FOLLOWER_DEFINITIONS.items()
                if f'{full}.{key}' in given
            }
            self.declare(own, given, f'{full}.', read_only=True)

    def _follower_names(self) -> list[str]:
        return [name for of in self.configuration.followers.values() for name in of]

    def followers_of(self, axis: str, parameters: AxisParameters) -> dict[str, AxisParameters]:
        """Return the parameters of the followers of an axis, where the axis has these.

        Raises InvalidParameters where they do not fit.
        """
        own = {
            follower: {
                name.removeprefix(f'{axis}.{follower}.'): value
                for name, value in self._of_followers.items()
                if name.startswith(f'{axis}.{follower}.')
            }
            for follower in parameters.followers
        }
        found, _, faults = gantry.followers_of(axis, parameters, own)
        if faults:
            raise InvalidParameters(faults)
        return found

    def serve_parameters(self) -> None:
        """Let parameters be set from now on."""
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)

    def fixed(self, key: str) -> bool:
        """Return whether a parameter takes effect at the start only."""
        return key in FIXED or key.startswith(FIXED_KINDS)

    def topics_of(self, axis: str) -> dict[str, str]:
        """Return what an axis's parameters say of the topics of its inputs."""
        values = self._values(axis, TOPIC_DEFINITIONS)
        return {name.partition('.')[2]: str(value) for name, value in values.items()}

    def connections_of(self, axis: str) -> Connections:
        """Return the connections that an axis's parameters describe.

        Raises InvalidParameters if they contradict each other.
        """
        found, faults = connections(self._values(axis, CONNECTION_DEFINITIONS), axis)
        if faults:
            raise InvalidParameters(faults)
        return found

    def values_of(self, axis: str) -> dict[str, object]:
        """Return those parameters that a run of one axis depends on, if they differ from default.

        The names are those of a node that has this axis alone.
        """
        own = {
            name: value
            for name, definition in NODE_DEFINITIONS.items()
            if name not in OF_SEVERAL
            and (value := self.get_parameter(name).value) != messages.plain(definition.initial)
        }
        of_axis = {
            f'{axis}.{name}': value
            for name, value in self._values(axis).items()
            if value != messages.plain(AXIS_DEFINITIONS[name].initial)
        }
        of_followers = {
            name: value
            for name, value in self._of_followers.items()
            if name.startswith(f'{axis}.')
        }
        return {'axes': [axis], **own, **of_axis, **of_followers}

    # --------------------------------------------------------------------- the subclass has these

    @abstractmethod
    def in_use(self, axis: str) -> str:
        """Return who homes an axis, so that its parameters must stay; '' if nobody does."""

    @abstractmethod
    def take_axis(self, axis: str, parameters: AxisParameters) -> None:
        """Use new parameters of an axis."""

    @abstractmethod
    def take(self, name: str, value: Any) -> None:
        """Use a new value of one of the node's own parameters."""

    # ------------------------------------------------------------------------------------- inside

    def _prove(self, checked: Configuration) -> None:
        """Refuse what `homing check` finds to be an error; log its warnings."""
        findings = check(checked)
        if errors(findings):
            raise InvalidParameters(finding.text for finding in errors(findings))
        for finding in findings:
            if finding.severity is Severity.warning:
                self.get_logger().warning(finding.text)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; a bad value is answered with its name, value, bound and unit.

        Checked before rclpy tests the range, which would answer without them.
        """
        unknown = [p.name for p in parameter_list if not self.has_parameter(p.name)]
        if unknown:  # rclpy would not say which
            return self._refused(f'no such parameter: {", ".join(unknown)}')
        deleted = [p.name for p in parameter_list if p.type_ is Parameter.Type.NOT_SET]
        if deleted:
            names = ', '.join(deleted)
            return self._refused(f'{names}: cannot be deleted; set the value that is wanted')
        result = self._check_parameters(parameter_list)
        if not result.successful:
            return self._refused(result.reason)
        return super().set_parameters_atomically(parameter_list)

    def _refused(self, reason: str) -> SetParametersResult:
        self.get_logger().warning(f'not set: {reason}')
        return SetParametersResult(successful=False, reason=reason)

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Check each value, the cross-checks of values set together, and what `check` finds."""
        axes = self.configuration.axes
        faults: list[str] = []
        changed: dict[str, dict[str, object]] = {}
        for parameter in parameters:
            axis, _, name = parameter.name.partition('.')
            try:
                if parameter.name in NODE_DEFINITIONS:
                    check_node_value(parameter.name, parameter.value, list(axes))
                elif axis in axes and (user := self.in_use(axis)):
                    faults.append(f'{parameter.name}: {user}; set it afterwards')
                elif axis in axes and parameter.name not in self._of_followers:
                    value = AXIS_DEFINITIONS[name].convert(parameter.value)
                    changed.setdefault(axis, {})[name] = value
            except ValueError as error:
                faults.append(f'{axis}.{error}' if axis in axes else str(error))
        for axis, values in changed.items():
            if len(values) > 1 and not faults:
                faults += check_axis_values(axis, {**self._values(axis), **values})
        if not faults:
            faults += self._new_errors({one.name: one.value for one in parameters})
        return SetParametersResult(successful=not faults, reason='; '.join(faults))

    def _new_errors(self, values: Mapping[str, object]) -> list[str]:
        """Return the errors of `homing check` that new values would bring.

        Values that contradict each other are no reason to refuse one of them: the other may follow
        by its own request. A run does not start with them.
        """
        try:
            after = errors(check(configuration({**self._all_values(), **values})))
        except InvalidParameters:
            return []
        try:
            before = errors(check(configuration(self._all_values())))
        except InvalidParameters:
            before = []
        known = {(one.axis, one.check) for one in before}
        return [one.text for one in after if (one.axis, one.check) not in known]

    def _apply_parameters(self, parameters: list[Parameter]) -> None:
        """Forward new values; they take effect at the next run."""
        for parameter in parameters:
            self.get_logger().info(words.changed(parameter.name, parameter.value))
            if parameter.name in NODE_DEFINITIONS:
                self.take(parameter.name, parameter.value)
        problems = self._problems()
        for axis in {p.name.partition('.')[0] for p in parameters} & set(self.configuration.axes):
            self._unwired.pop(axis, None)
            try:
                self.take_axis(axis, axis_parameters(self._values(axis, DEFINITIONS), axis))
            except InvalidParameters as error:
                self._unwired[axis] = error.faults
        self.faults = {**self._unwired, **problems}

    def _problems(self) -> dict[str, tuple[str, ...]]:
        """Return why runs cannot start with the present values, by axis."""
        try:
            found = errors(check(configuration(self._all_values())))
        except InvalidParameters as error:
            faults = [(fault.partition('.')[0], fault) for fault in error.faults]
        else:
            faults = [(one.axis, one.text) for one in found]
        return {
            axis: of_axis
            for axis in self.configuration.axes
            if (of_axis := tuple(text for owner, text in faults if owner == axis))
        }

    def _all_values(self) -> dict[str, object]:
        """Return all parameters of the node and its axes that have a value, by flat name."""
        names = [*NODE_DEFINITIONS]
        for axis in self.configuration.axes:
            names += [f'{axis}.{name}' for name in AXIS_DEFINITIONS]
        values = {name: self.get_parameter(name).value for name in names}
        return {
            **{name: value for name, value in values.items() if value is not None},
            **self._of_followers,
        }

    def _values(self, axis: str, names: Iterable[str] = AXIS_DEFINITIONS) -> dict[str, object]:
        """Return those parameters of an axis that have a value."""
        values = {name: self.get_parameter(f'{axis}.{name}').value for name in names}
        return {name: value for name, value in values.items() if value is not None}
