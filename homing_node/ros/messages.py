# SPDX-License-Identifier: Apache-2.0
"""ROS messages to and from values, and parameter descriptors.

Scalars are cast to their field's type: a wrong type is not noticed when a message is sent.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from homing_interfaces.action import Home, Jog
from homing_interfaces.msg import AxisState, MemberState, SwitchEdge
from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState

from ..core.axis import Axis
from ..core.dispatch import DryRun
from ..core.outcome import Met, Outcome
from ..parameters.definition import Definition
from ..procedures.states import Error, State
from .serialized import NS


def descriptor(definition: Definition, read_only: bool = False) -> ParameterDescriptor:
    """Describe a parameter: text, unit, choices, range.

    Typing is dynamic so that integers are accepted for real parameters; the node converts.
    """
    text = definition.text + (f' [{definition.unit}]' if definition.unit else '')
    constraints = [
        definition.bounds and f'{definition.bounds} {definition.unit}'.rstrip(),
        definition.choices and 'one of ' + ', '.join(definition.choices),
    ]
    described = ParameterDescriptor(
        description=text,
        dynamic_typing=True,
        read_only=read_only,
        additional_constraints='; '.join(c for c in constraints if c),
    )
    bounded = math.isfinite(definition.minimum) or math.isfinite(definition.maximum)
    if definition.kind is float and bounded:
        described.floating_point_range = [
            FloatingPointRange(from_value=definition.least, to_value=definition.maximum)
        ]
    elif definition.kind is int and bounded:
        described.integer_range = [
            IntegerRange(
                from_value=int(max(definition.least, -(2**31))),
                to_value=int(min(definition.maximum, 2**31)),
            )
        ]
    return described


def plain(value: object) -> object:
    """Return a parameter's value as ROS stores it."""
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Sequence):
        return [str(item) for item in value]
    return value


def constant_of(name: str) -> str:
    """Return the constant of an error or a state: `LSTriggered` has `LS_TRIGGERED`."""
    return re.sub(r'(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])', '_', name).upper()


#: The numbers of errors and states in the messages.
ERROR_CODES = {error: getattr(AxisState, constant_of(error.value)) for error in Error}
STATE_CODES = {state: getattr(AxisState, f'STATE_{constant_of(state.value)}') for state in State}

#: The numbers of levels; None: not known.
LEVELS = {
    False: AxisState.LEVEL_OFF,
    True: AxisState.LEVEL_ON,
    None: AxisState.LEVEL_UNKNOWN,
}


def to_stamp(nanoseconds: int) -> Time:
    return Time(sec=nanoseconds // NS, nanosec=nanoseconds % NS)


def data_of(data: bytes, kind: type[Any]) -> bool | float | None:
    """Return the value of a serialized Bool or Float64, None where it is broken."""
    try:
        value: bool | float = deserialize_message(data, kind).data
    except RuntimeError:
        return None
    return value


def joint_states(stamp: int, homed: Mapping[str, float]) -> JointState:
    """Return a message with the homed coordinates of the homed joints."""
    message = JointState(name=list(homed), position=[float(p) for p in homed.values()])
    message.header.stamp = to_stamp(stamp)
    return message


def first_failure(outcomes: Mapping[str, Outcome]) -> Outcome | None:
    """Return the first outcome that is an error, None if all axes are homed.

    A cancellation is a consequence, so another failure comes first.
    """
    failed = [outcome for outcome in outcomes.values() if not outcome.success]
    return min(failed, key=lambda outcome: outcome.error is Error.Canceled, default=None)


def home_message(outcomes: Mapping[str, Outcome]) -> str:
    """Say how a request for some axes ended: the first failure, or the home of each."""
    failure = first_failure(outcomes)
    if failure is not None:
        return _warned(f'{failure.error}: {failure.message}', failure)
    if any(one.jogged for one in outcomes.values()):
        return '; '.join(_jog_text(one) for one in outcomes.values())
    homes = {axis: _warned(_home_text(one), one) for axis, one in outcomes.items()}
    several = len(homes) > 1
    verified = all(one.verified is not None for one in outcomes.values())
    return ('Verified: ' if verified else 'Homed: ') + '; '.join(
        f'{axis}: {home}' if several else home for axis, home in homes.items()
    )


def _jog_text(outcome: Outcome) -> str:
    """Say how far a jog went, and how much it has met."""
    jogged = outcome.jogged
    if jogged is None:
        return ''
    met = len(jogged.edges)
    text = f'Jogged: {outcome.unit.length(jogged.distance, sign=True)}'
    return _warned(f'{text}, {met} edge{"" if met == 1 else "s"} met' if met else text, outcome)


def switch_edge(one: Met, stamp: int) -> SwitchEdge:
    """Return a change of an input that a jog has met; ``stamp``: when, in ROS time, ns."""
    return SwitchEdge(
        stamp=to_stamp(stamp),
        input=str(one.input),
        level=bool(one.level),
        position=float(one.position),
        uncertainty=float(one.uncertainty),
        velocity=float(one.velocity),
    )


def _home_text(outcome: Outcome) -> str:
    if outcome.verified is not None:
        unit = outcome.unit
        difference = unit.length(outcome.verified, sign=True)
        return f'{difference} ± {unit.length(outcome.verified_uncertainty)}'
    unit, unsure = outcome.unit, outcome.uncertainty
    text = (
        f'home_position_raw={place(outcome.home_position_raw, unsure)} {unit} ± '
        f'{unit.length(unsure)} home_offset={place(outcome.home_offset, unsure)} {unit} '
        f'uncertainty={unsure:.3g} {unit}'
    )
    if outcome.passes > 1:
        text += (
            f' passes={outcome.passes} range={unit.length(outcome.passes_range)} '
            f'deviation={unit.length(outcome.passes_deviation)}'
        )
    if outcome.applied is not None:
        text += f' applied={place(outcome.applied, unsure)} {unit}'
    if outcome.index_margin is not None:
        text += f' index_margin={outcome.index_margin:.3f}'
    for one in outcome.members[1:]:
        square = f'{unit.length(one.squareness, sign=True)} ± {unit.length(one.uncertainty)}'
        text += f' {one.name}: squareness={square}' if one.uncertainty else ''
    return f'{text}, {outcome.duration:.2f} s' if outcome.duration else text


def place(value: float, uncertainty: float) -> str:
    """Return a position with nine digits behind the point, more if more are known."""
    known = 1 - math.floor(math.log10(uncertainty)) if uncertainty > 0.0 else 0
    return f'{value:.{min(max(9, known), 12)}f}'


def _warned(text: str, outcome: Outcome) -> str:
    return ' | warning: '.join([text, *outcome.warnings])


def dry_run(
    run: DryRun, durations: Sequence[float], unknown: str, states: Sequence[AxisState]
) -> Home.Result:
    """Return the answer to a dry run.

    Args:
        run: The order, and what is missing.
        durations: The time of each step, s; NaN if it is not known.
        unknown: Which times are not known, and why.
        states: The state of each axis.
    """
    nothing = '; '.join(filter(None, ('dry run: nothing is missing', unknown)))
    first = run.missing[0][1] if run.missing else None
    missing = [
        ': '.join(filter(None, (name, str(one.error), one.message))) for name, one in run.missing
    ]
    return Home.Result(
        success=not missing,
        message=f'{first.error}: {first.message}' if first else nothing,
        error_code=ERROR_CODES[first.error] if first else 0,
        states=list(states),
        steps=[', '.join(group) for group in run.groups],
        durations=[float(one) for one in durations],
        missing=missing,
    )


def cancel_message(moving: Sequence[str], waiting: Sequence[str]) -> str:
    """Say what was canceled: axes that moved and now rest, and axes that waited to start."""
    parts = [
        f'{what}: {", ".join(names)}'
        for what, names in (('at rest', moving), ('not started', waiting))
        if names
    ]
    return f'canceled, {"; ".join(parts)}' if parts else 'nothing to cancel'


def axis_state(stamp: int, axis: Axis) -> AxisState:
    """Return the state of an axis; while it stops after an error, with that error already."""
    outcome, levels = axis.outcome, axis.levels
    message = AxisState(
        axis=axis.name,
        state=str(axis.state),
        state_code=STATE_CODES[axis.state],
        paused=axis.paused,
        homed=bool(axis.homed),
        error=str(axis.error),
        error_code=ERROR_CODES[axis.error],
        message=axis.message,
        position=float(axis.position),
        home_offset=float(outcome.home_offset),
        home_position_raw=float(axis.home_position_raw),
        uncertainty=float(outcome.uncertainty),
        home_source=axis.home_source if axis.homed else 'none',
        command=float(axis.command),
        following_error=float(axis.following_error),
        inputs=[name for name, _ in levels],
        levels=[LEVELS[level] for _, level in levels],
        members=[MemberState(**member._asdict()) for member in axis.members],
    )
    message.header.stamp = to_stamp(stamp)
    return message


def feedback(stamp: int, axes: Sequence[Axis]) -> Home.Feedback:
    """Return how far each axis of a goal has come; a bound of 0 is none."""
    message = Home.Feedback(states=[axis_state(stamp, axis) for axis in axes])
    for axis in axes:
        traveled, bound = axis.machine.traveled if axis.machine else (0.0, 0.0)
        message.distance_traveled.append(float(traveled))
        message.distance_bound.append(float(bound) if math.isfinite(bound) else 0.0)
    return message


def jog_feedback(stamp: int, axes: Sequence[Axis]) -> Jog.Feedback:
    """Return how far the axis of a jog has to go."""
    (axis,) = axes
    return Jog.Feedback(state=axis_state(stamp, axis), distance_to_go=float(axis.distance_to_go))


def diagnostics(
    stamp: int,
    node: str,
    axes: Iterable[Axis],
    inputs_of: Callable[[Axis], Mapping[str, str]] = lambda axis: {},
) -> DiagnosticArray:
    """Return level, state, last outcome, inputs and history of every axis.

    Args:
        stamp: The ROS time, ns.
        node: The full name of the node.
        axes: The axes.
        inputs_of: Returns what to say of each input of an axis.
    """
    message = DiagnosticArray(status=[_diagnostic(node, axis, inputs_of(axis)) for axis in axes])
    message.header.stamp = to_stamp(stamp)
    return message


def _diagnostic(node: str, axis: Axis, inputs: Mapping[str, str]) -> DiagnosticStatus:
    outcome = axis.outcome
    level, text = DiagnosticStatus.OK, 'homed' if axis.homed else str(axis.state)
    if outcome.error is not Error.NoError:
        level, text = DiagnosticStatus.ERROR, f'{outcome.error}: {outcome.message}'
    elif not axis.homed and not axis.running:
        level, text = DiagnosticStatus.WARN, '; '.join(['not homed', *axis.notes])
    elif notes := [*_restored(axis), *outcome.warnings, *axis.notes]:
        level, text = DiagnosticStatus.WARN, f'{text}; {"; ".join(notes)}'
    history = axis.history
    values = {
        'state': axis.state,
        'homed': axis.homed,
        'home_source': axis.home_source if axis.homed else 'none',
        'error': outcome.error,
        'home_position_raw': outcome.home_position_raw,
        'home_offset': outcome.home_offset,
        'uncertainty': outcome.uncertainty,
        'index_margin': outcome.index_margin,
        'applied': outcome.applied,
        'runs': history.runs,
        'runs_homed': history.homed,
        'home_range': history.range,
        'home_deviation': history.deviation,
        'memory': '; '.join(axis.notes),
        **{f'{one.name}.squareness': one.squareness for one in axis.members[1:]},
        **{f'{one.name}.skew': one.skew for one in axis.members[1:]},
        **inputs,
    }
    return DiagnosticStatus(
        level=level,
        name=f'{node}: {axis.name}',
        message=text,
        hardware_id=f'{node}/{axis.name}',
        values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
    )


def _restored(axis: Axis) -> list[str]:
    """Return the warning for a home that was taken over and not verified."""
    restored = axis.home_source == 'restored'
    return ['the home was restored from before a restart; verify it'] if restored else []
