# SPDX-License-Identifier: Apache-2.0
"""Rules about the controller behind the setpoint topic: does it play the setpoints as they are?

The names and the defaults of its parameters are those of ros2_controllers on Jazzy. A controller
is known where it has the parameter that names its joints. An error here means that the controller
refuses the setpoints or takes them for something else: the node starts no run then.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..check.finding import Finding, Severity
from .facts import Controller, Setpoints

#: The parameter that names the joints, for each value of `setpoint_interface`.
JOINTS = {'trajectory': ('joints',), 'position': ('joints', 'joint'), 'dof': ('dof_names',)}
#: A step of a controller at this rate is as long as the plan in a message, Hz.
SLOWEST = 50.0

ACTIVE = 'active'


def is_known(controller: Controller, interface: str) -> bool:
    """Tell whether a node is a controller whose joints can be read."""
    return bool(_joints(controller.parameters or {}, interface))


def judge_controller(
    controller: Controller, setpoints: Setpoints, lags: Mapping[str, float] | None = None
) -> Iterator[Finding]:
    """Yield what is wrong between one known controller and the setpoints.

    Args:
        controller: A controller for which ``is_known`` is true.
        setpoints: The setpoints that it gets.
        lags: The lag of each axis's drive in s, as far as it is known.
    """
    parameters = controller.parameters or {}
    judge = {'trajectory': _trajectory, 'position': _position, 'dof': _dof}[setpoints.interface]
    yield from judge(controller.node, parameters, setpoints)
    if setpoints.interface == 'trajectory':
        for joint, (axis, p) in setpoints.axes.items():
            tolerance = _number(parameters, f'constraints.{joint}.trajectory')
            lag = (lags or {}).get(axis)
            yield from _tolerance(
                controller.node,
                axis,
                joint,
                tolerance,
                p.homing_velocity_fast,
                p.following_error_limit,
                lag,
            )


def _joints(parameters: Mapping[str, Any], interface: str) -> list[str]:
    for name in JOINTS[interface]:
        value = parameters.get(name)
        if value:
            return [value] if isinstance(value, str) else [str(joint) for joint in value]
    return []


def _number(parameters: Mapping[str, Any], name: str) -> float:
    value = parameters.get(name)
    return float(value) if isinstance(value, int | float) else 0.0


def _listed(names: Sequence[str]) -> str:
    return f'[{", ".join(names)}]'


def _trajectory(node: str, given: Mapping[str, Any], setpoints: Setpoints) -> Iterator[Finding]:
    """Judge a joint_trajectory_controller."""
    joints = _joints(given, 'trajectory')
    own = list(setpoints.axes)
    absent = [joint for joint in own if joint not in joints]
    if absent:
        yield Finding(
            Severity.error,
            '',
            'controller-joints',
            f'{node} has the joints {_listed(joints)}, the setpoints have {_listed(own)}',
            f'it refuses every message that names {", ".join(absent)}',
            'joints',
        )
    commanded = given.get('command_joints')
    passive = [joint for joint in own if commanded and joint not in commanded]
    if passive:
        yield Finding(
            Severity.error,
            '',
            'controller-joints',
            f'{node} commands only {_listed(list(commanded or ()))} (command_joints)',
            f'{", ".join(passive)} would not move',
            'command_joints',
        )
    if len(joints) > 1 and given.get('allow_partial_joints_goal') is False:
        yield Finding(
            Severity.error,
            '',
            'partial-joints',
            f'{node}: allow_partial_joints_goal is false, and it has {len(joints)} joints',
            'it refuses each message without all of them; only joints that home are in a message',
            'allow_partial_joints_goal',
            'false',
            True,
        )
    if given.get('interpolation_method') == 'none':
        yield Finding(
            Severity.warning,
            '',
            'interpolation',
            f"{node}: interpolation_method is 'none'",
            'the command is a staircase: the drive sees steps, not the planned acceleration',
            'interpolation_method',
            'none',
            'splines',
        )
    from_desired = given.get('interpolate_from_desired_state'), given.get('open_loop_control')
    if from_desired[0] is False and not from_desired[1]:
        yield Finding(
            Severity.warning,
            '',
            'desired-state',
            f'{node}: interpolate_from_desired_state is false',
            'each message begins at the measured state: a run may begin with a jerk (2.3 m/s² '
            'was seen where 0.5 m/s² was planned)',
            'interpolate_from_desired_state',
            'false',
            True,
        )
    if given.get('allow_nonzero_velocity_at_trajectory_end') is True:
        yield Finding(
            Severity.info,
            '',
            'nonzero-end',
            f'{node}: allow_nonzero_velocity_at_trajectory_end is true',
            'the setpoints end at rest and do not need it; a message of another publisher that '
            'ends in motion lets the axis run on',
            'allow_nonzero_velocity_at_trajectory_end',
            'true',
            False,
        )
    if given.get('allow_trajectory_replacement') is True:
        yield Finding(
            Severity.warning,
            '',
            'replacement',
            f'{node}: allow_trajectory_replacement is true',
            'it blends each message with the one before, instead of taking the newest',
            'allow_trajectory_replacement',
            'true',
            False,
        )
    interfaces = given.get('command_interfaces')
    if interfaces and 'position' not in interfaces:
        yield Finding(
            Severity.warning,
            '',
            'command-interfaces',
            f'{node}: command_interfaces is {_listed(list(interfaces))}',
            'the controller closes the position loop itself, by its gains: the axis lags by what '
            'they leave, and `following_error` must allow it',
            'command_interfaces',
        )
    states = given.get('state_interfaces')
    if states and 'velocity' not in states and from_desired[0] is False and not from_desired[1]:
        yield Finding(
            Severity.warning,
            '',
            'state-interfaces',
            f'{node}: state_interfaces is {_listed(list(states))}, without velocity',
            'each message begins at the measured position with velocity 0',
            'interpolate_from_desired_state',
            'false',
            True,
        )
    scaling = given.get('speed_scaling.initial_scaling_factor')
    if isinstance(scaling, float) and scaling != 1.0:
        yield Finding(
            Severity.warning,
            '',
            'speed-scaling',
            f'{node}: speed_scaling.initial_scaling_factor is {scaling:g}',
            'it plays the setpoints slower than they come: the axis falls behind, FollowingError',
            'speed_scaling.initial_scaling_factor',
            scaling,
            1.0,
        )
    yield from _timeouts(node, given)
    rate = _number(given, 'update_rate')
    if 0.0 < rate < SLOWEST:
        yield Finding(
            Severity.warning,
            '',
            'controller-rate',
            f'{node} runs at {rate:g} Hz',
            'one step of it is longer than the plan in a message',
            'update_rate',
            rate,
            max(SLOWEST, min(setpoints.rate, 250.0)),
            'Hz',
        )


def _timeouts(node: str, given: Mapping[str, Any]) -> Iterator[Finding]:
    timeout, goal = _number(given, 'cmd_timeout'), _number(given, 'constraints.goal_time')
    if 0.0 < timeout <= goal:
        yield Finding(
            Severity.warning,
            '',
            'cmd-timeout',
            f'{node}: cmd_timeout is {timeout:g} s, constraints.goal_time {goal:g} s',
            'the controller ignores a cmd_timeout that is not longer than goal_time',
            'cmd_timeout',
            timeout,
            2.0 * goal,
            's',
        )
    elif 'velocity' in (given.get('command_interfaces') or ()) and not timeout:
        yield Finding(
            Severity.info,
            '',
            'cmd-timeout',
            f'{node}: cmd_timeout is 0, and it commands a velocity',
            'setpoints end at rest by themselves; a message of another publisher that ends in '
            'motion would run on for ever',
            'cmd_timeout',
            timeout,
            0.5,
            's',
        )


def _tolerance(
    node: str,
    axis: str,
    joint: str,
    tolerance: float,
    velocity: float,
    following_error: float,
    lag: float | None,
) -> Iterator[Finding]:
    """Judge constraints.<joint>.trajectory against the lag of the drive (s, None: not known)."""
    if tolerance <= 0.0:
        return
    name, unit = f'constraints.{joint}.trajectory', 'm'
    behind = None if lag is None else lag * velocity
    if behind is not None and behind >= tolerance:
        yield Finding(
            Severity.error,
            axis,
            'path-tolerance',
            f'{node}: {name} is {tolerance:g}, and the drive is {behind:.3g} behind at '
            'homing_velocity_fast',
            'the controller holds and goes on in turn at each message; 0 switches it off',
            name,
            tolerance,
            0.0,
            unit,
        )
    elif tolerance < following_error:
        yield Finding(
            Severity.warning,
            axis,
            'path-tolerance',
            f'{node}: {name} is {tolerance:g}, less than following_error {following_error:.3g}',
            f'a drive that lags by more than {tolerance / velocity:.3g} s at homing_velocity_fast '
            'makes the controller hold and go on in turn, with an error for each message; 0 '
            'switches it off',
            name,
            tolerance,
            0.0,
            unit,
        )


def _position(node: str, given: Mapping[str, Any], setpoints: Setpoints) -> Iterator[Finding]:
    """Judge a forward_command_controller."""
    joints = _joints(given, 'position')
    yield from _array(
        node, joints, setpoints, 'a message of another length switches the controller off'
    )
    interfaces = given.get('interface_names') or given.get('interface_name')
    names = [interfaces] if isinstance(interfaces, str) else list(interfaces or ())
    if names and names != ['position']:
        yield Finding(
            Severity.error,
            '',
            'command-interfaces',
            f'{node} commands {", ".join(names)}',
            'the setpoints are positions',
            'interface_name',
            ', '.join(names),
            'position',
        )
    yield from _without_plan(node, given, setpoints)


def _dof(node: str, given: Mapping[str, Any], setpoints: Setpoints) -> Iterator[Finding]:
    """Judge a controller that takes control_msgs/MultiDOFCommand, such as pid_controller."""
    names = [str(name) for name in given.get('reference_and_state_dof_names') or ()]
    names = names or _joints(given, 'dof')
    yield from _array(node, names, setpoints, 'it ignores a message of another length')
    references = [str(name) for name in given.get('reference_and_state_interfaces') or ()]
    if references and references[0] != 'position':
        yield Finding(
            Severity.error,
            '',
            'command-interfaces',
            f'{node} takes the values for {references[0]} (reference_and_state_interfaces)',
            'the setpoints are positions, and their velocities',
            'reference_and_state_interfaces',
            _listed(references),
            '[position, velocity]',
        )
    yield from _without_plan(node, given, setpoints)


def _array(
    node: str, joints: Sequence[str], setpoints: Setpoints, length: str
) -> Iterator[Finding]:
    """Judge the joints of a controller that takes values by their place, whatever their names."""
    ours = list(setpoints.joints)
    if list(joints) == ours:
        return
    why = 'values go by their place: each would go to the joint of another'
    if sorted(joints) != sorted(ours):
        other = 'values go by their place: a joint would get the position of another'
        why = length if len(joints) != len(ours) else other
    yield Finding(
        Severity.error,
        '',
        'controller-joints',
        f'{node} has the joints {_listed(joints)}, the position commands are for {_listed(ours)}',
        why,
        'position_joints',
        right=_listed(joints) if set(setpoints.axes) <= set(joints) else None,
    )


def _without_plan(node: str, given: Mapping[str, Any], setpoints: Setpoints) -> Iterator[Finding]:
    """Judge a controller that is told one position at a time."""
    yield Finding(
        Severity.info,
        '',
        'no-watchdog',
        f'{node} holds its last value for ever',
        'where the node dies nothing stops the axis smoothly: it halts with the last setpoint; '
        "use a joint_trajectory_controller, or the drive's own watchdog",
    )
    rate = _number(given, 'update_rate')
    if rate and abs(rate - setpoints.rate) > 0.01 * rate:
        yield Finding(
            Severity.warning,
            '',
            'controller-rate',
            f'{node} runs at {rate:g} Hz, the setpoints come at {setpoints.rate:g} Hz',
            'the command is a staircase: the drive must interpolate, or both rates be the same',
            'update_rate',
            setpoints.rate,
            rate,
            'Hz',
        )
