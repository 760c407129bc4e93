# SPDX-License-Identifier: Apache-2.0
"""Rehearses a gantry with a switch of one side at fault, and says what becomes of it.

The node never imports this: it rehearses nothing.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf, isnan

from ..parameters.axis import AxisParameters
from ..parameters.configuration import Configuration
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from ..procedures.motions import Way
from ..procedures.states import LATCHES, Input
from ..rehearsal.gantry import home_gantry
from ..rehearsal.side_faults import FaultTrial, SideFault, fault_trials
from ..rehearsal.sweep import transport_of
from .finding import Finding, Severity, in_unit
from .gantry import Gantry

NOT_HOMED = 'nothing is taken for homed'
#: What is found where a fault is noticed; ``what`` is completed by what the run comes to.
FOUND: Mapping[SideFault, Finding] = {
    SideFault.dead: Finding(
        Severity.info, '', 'side-dead', 'with {switch} dead (it never turns on)', NOT_HOMED
    ),
    SideFault.stuck: Finding(
        Severity.info, '', 'side-stuck', 'with {switch} stuck (it never turns off)', NOT_HOMED
    ),
    SideFault.swapped: Finding(
        Severity.info,
        '',
        'side-swapped',
        'with the cables of {switch} and {axis} swapped',
        NOT_HOMED,
    ),
}


def rehearsed(
    configuration: Configuration, layouts: Mapping[str, AxisLayout], timing: Timing
) -> list[Finding]:
    """Return what the rehearsals of all gantries find whose layouts have all that they need."""
    timing = timing._replace(update_rate=configuration.update_rate)
    findings: list[Finding] = []
    for axis, followers in configuration.followers.items():
        parameters, layout = configuration.axes[axis], layouts.get(axis)
        if layout is not None and _complete(parameters, followers, layout):
            findings += (
                in_unit(finding, parameters.unit)
                for finding in _of_gantry(axis, parameters, followers, layout, timing)
            )
    return findings


def _complete(
    parameters: AxisParameters, followers: Mapping[str, AxisParameters], layout: AxisLayout
) -> bool:
    """Return whether a layout has all that a run needs of every side."""
    if set(followers) - set(layout.followers):
        return False
    used = parameters.procedure.inputs
    for own, where in (
        (parameters, layout),
        *((followers[name], layout.followers[name]) for name in followers),
    ):
        fitted = {Input(name) for name in where.switches} | {Input.SERVO_ENABLED}
        fitted |= {Input.Z_PULSE} if where.index_pitch and not isnan(where.index_offset) else set()
        fitted |= set() if where.touch_probe is None else {Input.TOUCH_PROBE}
        if any(name not in fitted for name in own.inputs if name in used or name not in LATCHES):
            return False
    return True


def _of_gantry(
    axis: str,
    parameters: AxisParameters,
    followers: Mapping[str, AxisParameters],
    layout: AxisLayout,
    timing: Timing,
) -> Iterator[Finding]:
    transport = replace(transport_of(timing), poll_rate=layout.switch_rate or 0.0)
    outcome = home_gantry(axis, parameters, followers, layout, transport).outcome
    if outcome is None or not outcome.success:
        yield Finding(
            Severity.warning,
            axis,
            'gantry-run',
            f'a rehearsed run from {layout.start:g} m ends with '
            f'{outcome.error if outcome else "nothing"}',
            outcome.message if outcome else '',
        )
        return
    p, alone = parameters, Gantry(axis, parameters, followers, layout, timing).without_reference()
    squares = p.square and not p.gantry_homing_retain_sync_offset and not list(alone)
    tolerance = p.square_tolerance if squares else inf
    for switch in _references(parameters):
        for trial in fault_trials(axis, parameters, followers, layout, transport, switch):
            yield finding_of(axis, trial, tolerance)


def _references(parameters: AxisParameters) -> list[Input]:
    """Return the switches that a home type looks for."""
    found = [Input.HOME_SWITCH] if Input.HOME_SWITCH in parameters.procedure.inputs else []
    target = parameters.procedure.target
    if target is not None:
        found.append(parameters.limit_switch(target, Way.TOWARD))
    return found


def finding_of(axis: str, trial: FaultTrial, tolerance: float) -> Finding:
    """Return what a rehearsed fault comes to.

    Args:
        axis: The name of the gantry.
        trial: The run with the fault.
        tolerance: The squareness that a run must leave, m; inf where it need not.
    """
    outcome = trial.course.outcome
    assert outcome is not None
    unsure = max((member.uncertainty for member in outcome.members), default=0.0)
    wrong = trial.homed and trial.left > tolerance + unsure
    found = FOUND[trial.fault]._replace(axis=trial.side)
    what = found.what.format(switch=f'the {trial.switch.text} of {trial.side}', axis=f'of {axis}')
    ends = 'homes' if trial.homed else f'ends with {outcome.error}'
    found = found._replace(
        what=f'{what} a run {ends} after {trial.course.duration:.3g} s, and leaves the gantry '
        f'{round(trial.left, 6):g} m out of square; a spring bore at most '
        f'{round(trial.force, 1):g} N'
    )
    if wrong:
        return found._replace(severity=Severity.error, why='the gantry is taken for square')
    return found._replace(why='that does no harm') if trial.homed else found
