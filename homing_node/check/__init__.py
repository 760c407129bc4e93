# SPDX-License-Identifier: Apache-2.0
"""Proves a configuration before the first motion.

Everything here is pure: parameters, where things are along the axis (as far as it is known) and
how fast messages travel go in, findings come out. Without a layout, only the parameters are
checked, as the node does at its start.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from ..parameters.axis import AxisParameters
from ..parameters.configuration import Configuration
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from .accuracy import Accuracy
from .connected_inputs import ConnectedInputs
from .final_move import FinalMove
from .finding import Finding, Severity, in_unit, worst_first
from .follow_ups import without_follow_ups
from .following_error import FollowingError
from .gantry import OF_ANY_SIDE, Gantry
from .index_and_probe import IndexAndProbe
from .overruns import Overruns
from .parameters_only import ParametersOnly
from .quick_way import QuickWay
from .remedy import applicable
from .run_bounds import RunBounds
from .shared_inputs import SharedInputs
from .switch_positions import SwitchPositions
from .wired_inputs import WiredInputs

__all__ = ['Finding', 'Severity', 'Timing', 'check', 'check_axis', 'errors']

#: The checks that need a layout.
WITH_LAYOUT = (
    SwitchPositions,
    Overruns,
    RunBounds,
    IndexAndProbe,
    FollowingError,
    FinalMove,
    QuickWay,
)
NOWHERE: Mapping[str, AxisLayout] = MappingProxyType({})


def check(
    axes: Configuration | Mapping[str, AxisParameters],
    layouts: Mapping[str, AxisLayout] | None = None,
    timing: Timing | None = None,
) -> list[Finding]:
    """Check all axes; return the findings by axis, the worst first.

    The update rate of a configuration takes the place of the one in ``timing``. With ``layouts``,
    each axis is expected to be in it.
    """
    timing = timing or Timing()
    findings: list[Finding] = []
    gantries: Mapping[str, Mapping[str, AxisParameters]] = {}
    if isinstance(axes, Configuration):
        gantries = axes.followers
        timing = timing._replace(update_rate=axes.update_rate, lead=axes.lead)
        findings += [
            *_check_node(axes),
            *ConnectedInputs(axes).check(),
            *SharedInputs(axes).check(),
        ]
        axes = axes.axes
    for axis, parameters in axes.items():
        layout = (layouts or NOWHERE).get(axis)
        found = check_axis(axis, parameters, layout, timing)
        findings += found
        if followers := gantries.get(axis):
            findings += check_gantry(axis, parameters, followers, layout, timing, found)
        if layouts is not None and axis not in layouts:
            findings.append(
                Finding(
                    Severity.warning,
                    axis,
                    'layout-missing',
                    f'the layout has no axis {axis}, only {", ".join(layouts)}',
                    'where its switches and hard stops are is not checked: add it to the layout, '
                    'at least as "{axis}: {hard_stops: [from, to]}"'.replace('{axis}', axis),
                )
            )
    return worst_first(findings)


def check_axis(
    axis: str,
    parameters: AxisParameters,
    layout: AxisLayout | None = None,
    timing: Timing | None = None,
) -> list[Finding]:
    """Check one axis; return the findings, the worst first."""
    timing = timing or Timing()
    try:
        findings = without_follow_ups(_found(axis, parameters, layout, timing))
    except ArithmeticError as error:
        return [
            Finding(
                Severity.error,
                axis,
                'beyond-numbers',
                f'velocities, accelerations and jerk cannot be computed with ({error})',
                'one of them is absurdly small or large',
            )
        ]
    return worst_first(
        in_unit(applicable(finding, parameters), parameters.unit) for finding in findings
    )


def check_gantry(
    axis: str,
    parameters: AxisParameters,
    followers: Mapping[str, AxisParameters],
    layout: AxisLayout | None,
    timing: Timing,
    of_leader: Sequence[Finding] = (),
) -> list[Finding]:
    """Check the sides of a gantry: each follower as an axis, and all against each other.

    ``of_leader`` are the findings about the leader; a follower's that say the same are left out.
    """
    known = {(one.check, one.parameter, one.value, one.right) for one in of_leader}
    findings = []
    for name, own in followers.items():
        side = layout.followers.get(name) if layout else None
        findings += [
            one
            for one in check_axis(name, own, side, timing)
            if one.check not in OF_ANY_SIDE
            and (one.check, one.parameter, one.value, one.right) not in known
        ]
    gantry = Gantry(axis, parameters, followers, layout, timing)
    return findings + [in_unit(one, parameters.unit) for one in gantry.check()]


def _found(
    axis: str, parameters: AxisParameters, layout: AxisLayout | None, timing: Timing
) -> list[Finding]:
    found = [
        *WiredInputs(axis, parameters, timing).check(layout is not None),
        *ParametersOnly(axis, parameters, timing).check(layout is not None),
    ]
    found += Accuracy(axis, parameters, timing).check(layout)
    if layout is not None:
        for part in WITH_LAYOUT:
            found += part(axis, parameters, layout, timing).check()
    return found


def errors(findings: list[Finding]) -> list[Finding]:
    """Return those findings for which a run fails, or something is hit."""
    return [finding for finding in findings if finding.severity is Severity.error]


def _check_node(configuration: Configuration) -> list[Finding]:
    """Check the node's own parameters; the finding stands with the first axis."""
    period = 1.0 / configuration.update_rate
    if configuration.cycle_timeout >= 2 * period:
        return []
    return [
        Finding(
            Severity.warning,
            axis,
            'cycle-timeout',
            f'cycle_timeout is {configuration.cycle_timeout:g} s, less than two cycles of '
            f'{period:g} s',
            'a cycle that is a little late ends the run with CycleLate',
            'cycle_timeout',
            configuration.cycle_timeout,
            2 * period,
            's',
        )
        for axis in list(configuration.axes)[:1]
    ]
