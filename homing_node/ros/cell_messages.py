# SPDX-License-Identifier: Apache-2.0
"""Messages of cells to values of the coordinator, and its answers to messages."""

import math
from collections.abc import Mapping, Sequence

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState

from ..coordination.cells import Seen
from ..coordination.health import LINE, Health, Level
from ..coordination.preview import Preview
from ..coordination.request import Request
from ..coordination.turn import Checked
from ..core.outcome import Outcome
from ..procedures.states import Error, State
from ..version import version
from . import messages

LEVELS = {
    Level.ok: DiagnosticStatus.OK,
    Level.warn: DiagnosticStatus.WARN,
    Level.error: DiagnosticStatus.ERROR,
}
ERRORS = {code: error for error, code in messages.ERROR_CODES.items()}


def local(axis: str) -> str:
    """Return the name that an axis of the line has in its cell."""
    return axis.rpartition('/')[2]


def full(cell: str, axis: str) -> str:
    """Return the name in the line of an axis of a cell."""
    return f'{cell}/{axis}'


def seen(state: AxisState) -> Seen:
    """Return what a state says."""
    return Seen(
        homed=state.homed,
        idle=state.state == State.Idle,
        error=state.error,
        home_position_raw=state.home_position_raw,
        home_offset=state.home_offset,
        uncertainty=state.uncertainty,
        stamp=state.header.stamp.sec + state.header.stamp.nanosec * 1e-9,
    )


def outcome(cell: str, result: Home.Result) -> Outcome:
    """Return how the goal of one axis ended."""
    state = result.states[0] if result.states else AxisState()
    if result.success:
        return Outcome(
            Error.NoError,
            home_position_raw=state.home_position_raw,
            home_offset=state.home_offset,
            uncertainty=state.uncertainty,
        )
    error = ERRORS.get(result.error_code, Error.InternalError)
    if error is Error.NoError:
        error = Error.InternalError
    text = result.message.removeprefix(f'{error}: ')
    return Outcome(error, f'cell {cell}: {text}')


def checked(cell: str, axes: Sequence[str], result: Home.Result) -> Checked:
    """Return the answer to a dry run of some axes."""
    missing: dict[str, list[str]] = {axis: [] for axis in axes}
    for text in result.missing:
        name, _, rest = text.partition(': ')
        if full(cell, name) in missing:
            missing[full(cell, name)].append(rest)
        else:
            for one in missing.values():
                one.append(text)
    durations = list(result.durations)
    return Checked(
        {full(cell, state.axis): seen(state) for state in result.states},
        {axis: tuple(texts) for axis, texts in missing.items()},
        durations[0] if len(durations) == 1 else math.nan,
    )


def of_line(axis: str, state: AxisState) -> AxisState:
    """Return a state of a cell with the name that its axis has in the line."""
    state.axis = axis
    return state


def doubted(state: AxisState, why: Outcome) -> AxisState:
    """Return the last state of an axis of which nothing is known any more: it is not homed."""
    return AxisState(
        header=state.header,
        axis=state.axis,
        state=state.state,
        error=str(why.error),
        error_code=messages.ERROR_CODES[why.error],
        message=why.message,
        home_source='none',
    )


def unseen(axis: str, outcome: Outcome) -> AxisState:
    """Return the state of an axis of which none was seen."""
    return AxisState(
        axis=axis,
        state=str(State.Idle),
        error=str(outcome.error),
        error_code=messages.ERROR_CODES[outcome.error],
        message=outcome.message,
        home_source='none',
    )


def refusal(outcome: Outcome) -> Home.Result:
    """Return the result of a goal that did not begin."""
    return Home.Result(
        success=False,
        message=f'{outcome.error}: {outcome.message}',
        error_code=messages.ERROR_CODES[outcome.error],
    )


def result(request: Request, states: Mapping[str, AxisState]) -> Home.Result:
    """Return the result of a goal that has ended."""
    failure = messages.first_failure(request.outcomes)
    return Home.Result(
        success=failure is None,
        message=words(request),
        error_code=0 if failure is None else messages.ERROR_CODES[failure.error],
        states=[states.get(axis) or unseen(axis, how) for axis, how in request.outcomes.items()],
        steps=[', '.join(turn.axis for turn in step) for step in request.steps],
    )


def words(request: Request) -> str:
    """Say how a request ended: the first failure, or the home of each axis."""
    failure = messages.first_failure(request.outcomes)
    if failure is not None:
        homed = [turn.axis for turn in request.turns if turn.outcome.success]
        text = f'; homed: {", ".join(homed)}' if homed else ''
        return f'{failure.error}: {failure.message}{text}'
    new = {turn.axis: turn.outcome for turn in request.turns if not turn.skipped}
    old = [turn.axis for turn in request.turns if turn.skipped]
    parts = [messages.home_message(new).removeprefix('Homed: ')] if new else []
    parts += [f'homed before: {", ".join(old)}'] if old else []
    return f'Homed: {"; ".join(parts)}'


def dry_run(preview: Preview, states: Mapping[str, AxisState]) -> Home.Result:
    """Return the answer to a dry run."""
    missing, error = preview.missing, preview.error
    nothing = '; '.join(filter(None, ('dry run: nothing is missing', preview.unknown)))
    axes = [axis for step in preview.steps for axis in step]
    return Home.Result(
        success=not missing,
        message=_first(missing, error) if missing else nothing,
        error_code=messages.ERROR_CODES[error],
        states=[states[axis] for axis in axes if axis in states],
        steps=[', '.join(step) for step in preview.order],
        durations=[float(one) for one in preview.durations],
        missing=missing,
    )


def _first(missing: Sequence[str], error: Error) -> str:
    """Return the first thing that is missing, with its error in front."""
    text = missing[0]
    axis, _, rest = text.partition(f': {error}: ')
    return f'{error}: {axis}: {rest}' if rest else text


def diagnostics(stamp: int, node: str, entries: Sequence[Health]) -> DiagnosticArray:
    """Return what the coordinator says of itself and of the cells.

    Args:
        stamp: The ROS time, ns.
        node: The full name of the coordinator's node.
        entries: What it says.
    """
    made_by = {'version': version()}
    message = DiagnosticArray(
        status=[
            DiagnosticStatus(
                level=LEVELS[one.level],
                name=f'{node}: {one.name}',
                message=one.text,
                hardware_id=f'{node}/{one.name}',
                values=[
                    KeyValue(key=key, value=str(value))
                    for key, value in {
                        **one.values,
                        **(made_by if one.name == LINE else {}),
                    }.items()
                ],
            )
            for one in entries
        ]
    )
    message.header.stamp = messages.to_stamp(stamp)
    return message
