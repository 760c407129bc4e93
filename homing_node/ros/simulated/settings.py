# SPDX-License-Identifier: Apache-2.0
"""The parameters of `simulated_axes`."""

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from ...parameters.configuration import bad_names, unknown_axis
from ...parameters.definition import Definition, InvalidParameters, read, table
from ...parameters.node_fields import COMMON_DEFINITIONS, NODE_DEFINITIONS, SetpointInterface
from ...plant.layout import (
    DEAD_TIME,
    FEEDBACK_RATE,
    AxisLayout,
    sides_of,
    with_switch_rate,
)
from ...plant.layout_reader import layouts_from
from ..setpoints import dof_command
from . import drivers, services


@dataclass(frozen=True)
class Settings:
    """The parameters of the node; rates in Hz, times in s.

    ``layouts`` has the axes, ``joints`` the joint of each of ``sides``.

    Position commands do not say how long they take: ``setpoint_period``. The controller that
    plays the setpoints updates at ``controller_rate``; ``interpolate``: it joins their points.
    """

    layouts: Mapping[str, AxisLayout]
    joints: Sequence[str]
    feedback_rate: float
    step_rate: float
    dead_time: float
    target_node: str
    setpoint_interface: SetpointInterface
    setpoint_period: float
    controller_rate: float
    interpolate: bool
    switch_rate: float
    switch_jitter: float
    switch_heartbeat: float
    feedback_read_rate: float
    header_clock_offset: float
    second_source: float
    second_source_position: float
    controller: str
    answer_time: float
    set_position_answer: services.Answer
    activate_answer: services.Answer

    @property
    def sides(self) -> Mapping[str, AxisLayout]:
        """The axes, and after each the followers of its gantry, by full names."""
        return sides_of(self.layouts)


#: The node's own parameters; those of an axis are the keys of its layout, and ``joint``.
DEFINITIONS = table(
    NODE_DEFINITIONS['axes'],
    FEEDBACK_RATE,
    Definition(
        'rate of the steps of the simulation',
        float,
        'Hz',
        100.0,
        10000.0,
        name='step_rate',
        default=1000.0,
    ),
    DEAD_TIME,
    Definition(
        'how long a position command takes',
        float,
        's',
        0.0,
        1.0,
        name='setpoint_period',
        default=0.004,
    ),
    Definition(
        'the node whose topics the axes are wired to',
        str,
        name='target_node',
        default='homing_node',
    ),
    NODE_DEFINITIONS['setpoint_interface'],
    Definition(
        'rate of the updates of the controller that plays the setpoints',
        float,
        'Hz',
        10.0,
        10000.0,
        name='controller_rate',
        default=500.0,
    ),
    Definition(
        'join the points of a trajectory as joint_trajectory_controller does (false: forward the '
        'next one)',
        bool,
        name='interpolate',
        default=True,
    ),
    *drivers.DEFINITIONS,
    *services.DEFINITIONS,
    *COMMON_DEFINITIONS.values(),
)


def settings_from(parameters: Mapping[str, Any]) -> Settings:
    """Read the node's parameters.

    Raises:
        InvalidParameters: Every fault, a line each.
    """
    values = {
        name: list(value) if isinstance(value, array) else value
        for name, value in parameters.items()
        if value is not None
    }
    axes = values.get('axes')
    axes = axes if isinstance(axes, list) else []
    entries: dict[str, dict[str, Any]] = {axis: {} for axis in axes}
    own: dict[str, Any] = {}
    strays: dict[str, None] = {}
    for name, value in values.items():
        axis, dot, key = name.partition('.')
        if axis in entries and dot:
            entries[axis][key] = value
        elif dot:
            strays[unknown_axis(axis, map(str, axes))] = None
        else:
            own[name] = value
    good, found = read(own, DEFINITIONS)
    faults = [*found, *strays, *bad_names(good.get('axes'))]
    if good.get('setpoint_interface') is SetpointInterface.dof:
        try:
            dof_command()
        except InvalidParameters as error:
            faults += error.faults
    if good.get('use_sim_time'):
        faults.append('use_sim_time: must be false, the simulated axes run in real time')
    dead_time, step_rate = good.get('dead_time'), good.get('step_rate')
    if dead_time is not None and step_rate is not None and dead_time < 2.0 / step_rate:
        faults.append(
            f'dead_time: {dead_time:g} s must be >= 2 steps, {2.0 / step_rate:g} s (step_rate)'
        )
    joints = [joint for axis, below in entries.items() for joint in _joints(axis, below)]
    if len(set(joints)) < len(joints):
        faults.append(f'joint: two axes have the same joint: {", ".join(joints)}')
    layouts: Mapping[str, AxisLayout] = {}
    try:
        layouts = layouts_from(entries)
    except InvalidParameters as error:
        faults += error.faults
    rate = good.get('switch_rate')
    layouts = {name: with_switch_rate(layout, rate) for name, layout in layouts.items()}
    faults += drivers.contradictions(good, sides_of(layouts))
    if faults:
        raise InvalidParameters(faults)
    good['target_node'] = good['target_node'].rstrip('/')
    names = [one.name for one in fields(Settings) if one.name in good]
    return Settings(layouts, joints, **{name: good[name] for name in names})


def _joints(axis: str, below: dict[str, Any]) -> list[str]:
    """Take the joints out of the entries of an axis; return its own and those of its followers."""
    listed = below.get('followers')
    followers = [str(one) for one in listed] if isinstance(listed, list) else []
    return [
        str(below.pop('joint', axis)),
        *(str(below.pop(f'{one}.joint', one)) for one in dict.fromkeys(followers)),
    ]
