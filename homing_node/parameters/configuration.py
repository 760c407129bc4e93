# SPDX-License-Identifier: Apache-2.0
"""The parameters of the node and of all its axes, from ROS or from a YAML file.

The node's own parameters stand in node_fields.py; AXIS_DEFINITIONS holds the parameters of each
axis and its connections, such as ``<axis>.topics.<input>``. SI units.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from . import gantry
from .axis import DEFINITIONS, AxisParameters, axis_parameters
from .connections import CONNECTION_DEFINITIONS, Connections, connections
from .definition import Definition, InvalidParameters, read, unknown
from .node_fields import (
    AXIS_NAME,
    COMMON_DEFINITIONS,
    NODE_DEFINITIONS,
    RESERVED,
    SetpointInterface,
    SetpointStamp,
)
from .qos import check_override

AXIS_DEFINITIONS: Mapping[str, Definition] = {**DEFINITIONS, **CONNECTION_DEFINITIONS}


class Configuration(NamedTuple):
    """A checked configuration: the parameters of the node and of each axis, in their order.

    ``position_joints`` are the joints of an array of positions, those of the axes by default.
    ``followers`` are the parameters of the followers of each gantry, by their full names; the
    connections of a follower are in ``connections``.
    """

    axes: Mapping[str, AxisParameters]
    connections: Mapping[str, Connections]
    update_rate: float
    cycle_timeout: float
    ready_timeout: float
    setpoint_interface: SetpointInterface
    position_joints: tuple[str, ...]
    serialized: bool
    setpoint_horizon: float
    setpoint_lead: float
    setpoint_stamp: SetpointStamp
    home_sequence: tuple[tuple[str, ...], ...]
    memory: str
    record: str
    record_runs: int
    record_failures: int
    marker_frame: str
    lifecycle: bool = False
    coordinated: bool = False
    layout: str = ''
    followers: Mapping[str, Mapping[str, AxisParameters]] = MappingProxyType({})

    @property
    def drives(self) -> dict[str, AxisParameters]:
        """The parameters of all drives: of each axis, and then of its followers."""
        found = {}
        for axis, parameters in self.axes.items():
            found[axis] = parameters
            found.update(self.followers.get(axis, {}))
        return found

    @property
    def joints(self) -> dict[str, str]:
        """The joint of each drive."""
        return {name: parameters.joint or name for name, parameters in self.drives.items()}

    @property
    def lead(self) -> float:
        """How long before it acts a change of the plan is told, s; only trajectories tell it."""
        by_trajectory = self.setpoint_interface is SetpointInterface.trajectory
        return self.setpoint_lead if by_trajectory else 0.0


def configuration(values: Mapping[str, Any]) -> Configuration:
    """Check a flat mapping of parameter names to plain values; None: the value is not set.

    Raises:
        InvalidParameters: Every fault, a line each.
    """
    values = {name: value for name, value in values.items() if value is not None}
    own = {name: values[name] for name in NODE_DEFINITIONS if name in values}
    node, faults = read(own, NODE_DEFINITIONS)
    faults += bad_names(node.get('axes'))
    names = list(dict.fromkeys(node.get('axes', [])))
    axes: dict[str, AxisParameters] = {}
    connected: dict[str, Connections] = {}
    followers: dict[str, dict[str, AxisParameters]] = {}
    for axis in names:
        below, own = gantry.split(
            {
                name.removeprefix(f'{axis}.'): value
                for name, value in values.items()
                if name.startswith(f'{axis}.')
            }
        )
        faults += gantry.unlisted(axis, below)
        connected[axis], found = connections(below, axis)
        faults += found
        try:
            axes[axis] = axis_parameters(
                {n: value for n, value in below.items() if n not in CONNECTION_DEFINITIONS}, axis
            )
        except InvalidParameters as error:
            faults += error.faults
            continue
        if own:
            followers[axis], more, found = gantry.followers_of(axis, axes[axis], own)
            connected |= more
            faults += found
    drives = {**axes, **{name: p for of in followers.values() for name, p in of.items()}}
    faults += bad_common(values)
    faults += _unknown(values, names)
    faults += gantry.bad_gantries(names, axes, followers, connected)
    faults += _shared_joints(drives)
    faults += _bad_position_joints(node.get('position_joints', []), drives)
    try:
        sequence = home_sequence(node.get('home_sequence', []), names)
    except ValueError as error:
        faults.append(str(error))
    if faults:
        raise InvalidParameters(faults)
    checked = Configuration(
        axes,
        connected,
        node['update_rate'],
        node['cycle_timeout'],
        node['ready_timeout'],
        node['setpoint_interface'],
        tuple(node['position_joints']),
        node['serialized'],
        node['setpoint_horizon'],
        node['setpoint_lead'],
        node['setpoint_stamp'],
        sequence,
        node['memory'],
        node['record'],
        node['record_runs'],
        node['record_failures'],
        node['marker_frame'],
        node['lifecycle'],
        node['coordinated'],
        node['layout'],
        followers,
    )
    joints = checked.position_joints or tuple(checked.joints.values())
    return checked._replace(position_joints=joints)


def home_sequence(groups: list[str], axes: list[str]) -> tuple[tuple[str, ...], ...]:
    """Read groups such as ["z", "x, y"]; without groups the axes home one after another.

    Raises ValueError for an unknown axis or one that stands in two groups.
    """
    if not groups:
        return tuple((axis,) for axis in axes)
    sequence = tuple(tuple(axis.strip() for axis in group.split(',')) for group in groups)
    seen: set[str] = set()
    for axis in (axis for group in sequence for axis in group):
        if axis not in axes:
            raise ValueError(f'home_sequence: {axis!r} is none of the axes {", ".join(axes)}')
        if axis in seen:
            raise ValueError(f'home_sequence: {axis!r} stands there twice')
        seen.add(axis)
    return sequence


def check_axis_values(axis: str, values: Mapping[str, object]) -> tuple[str, ...]:
    """Return the faults of an axis's parameters taken together, cross-checks included."""
    own = {name: value for name, value in values.items() if name not in CONNECTION_DEFINITIONS}
    _, faults = connections(values, axis)
    try:
        axis_parameters(own, axis)
    except InvalidParameters as error:
        return (*error.faults, *faults)
    return tuple(faults)


def check_node_value(name: str, value: Any, axes: list[str]) -> None:
    """Check one of the node's own parameters; raise ValueError with what is wrong."""
    definition = NODE_DEFINITIONS[name]
    if value is None:
        if definition.required:
            raise ValueError(definition.missing)
        return
    value = definition.convert(value)
    if name == 'home_sequence':
        home_sequence(value, axes)


def bad_names(names: list[str] | None) -> list[str]:
    """Return what is wrong with the names of axes; None: that they are missing is known."""
    if names is None:
        return []
    faults = [] if names else ["axes: no axis is named: axes: ['x', 'y']"]
    for name in names:
        if not AXIS_NAME.fullmatch(name):
            faults.append(f'axes: {name!r} is not a name: a letter, then letters, digits and _')
        elif name in RESERVED:
            faults.append(f"axes: {name!r} is a name of the node's own")
    if len(set(names)) < len(names):
        faults.append(f'axes: a name stands twice in {", ".join(names)}')
    return faults


def _common(name: str) -> bool:
    """Whether every ROS node has such a parameter."""
    return name in COMMON_DEFINITIONS or name.startswith('qos_overrides.')


def bad_common(values: Mapping[str, Any]) -> list[str]:
    """Return what is wrong with the parameters that every ROS node has."""
    faults = []
    for name, value in values.items():
        try:
            if name in COMMON_DEFINITIONS:
                COMMON_DEFINITIONS[name].convert(value)
            elif _common(name):
                check_override(name, value)
        except ValueError as error:
            faults.append(str(error))
    return faults


def _unknown(values: Mapping[str, Any], axes: list[str]) -> list[str]:
    """Return the faults of names that belong to nothing; an axis judges its own names."""
    faults: dict[str, None] = {}
    for name in values:
        axis, dot, _ = name.partition('.')
        if name in NODE_DEFINITIONS or _common(name) or (dot and axis in axes):
            continue
        if dot:
            faults[unknown_axis(axis, axes)] = None
        else:
            faults[unknown(name, [*NODE_DEFINITIONS, *(f'{axis}.' for axis in axes)])] = None
    return list(faults)


def unknown_axis(axis: str, axes: Iterable[str]) -> str:
    """Return the message for a block of parameters of an axis that is not in ``axes``."""
    return (
        f'{axis}: {axis!r} is none of the axes {", ".join(axes)}: add it to axes, or delete its '
        'parameters'
    )


def _shared_joints(axes: Mapping[str, AxisParameters]) -> list[str]:
    owner: dict[str, str] = {}
    faults = []
    for axis, parameters in axes.items():
        joint = parameters.joint or axis
        if joint in owner:
            faults.append(f'{axis}.joint: {joint!r} is already the joint of axis {owner[joint]}')
        owner.setdefault(joint, axis)
    return faults


def _bad_position_joints(joints: list[str], axes: Mapping[str, AxisParameters]) -> list[str]:
    """Return what is wrong with the joints of a position array; [] means those of the axes."""
    faults = [
        f'position_joints: {joint!r} stands there twice'
        for joint in dict.fromkeys(joints)
        if joints.count(joint) > 1
    ]
    if '' in joints:
        faults.append('position_joints: a joint has no name')
    for axis, parameters in axes.items():
        joint = parameters.joint or axis
        if joints and joint not in joints:
            faults.append(
                f'position_joints: {joint!r}, the joint of axis {axis}, is missing in '
                f'{", ".join(joints)}'
            )
    return faults
