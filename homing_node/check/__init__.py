# SPDX-License-Identifier: Apache-2.0
"""Proves a configuration before the first motion.

Pure: parameters, where things are along the axis (as far as that is known) and how fast messages
travel go in, findings come out. Without a layout only what the parameters alone tell is checked,
as the node does at its start.
"""

from collections.abc import Mapping
from types import MappingProxyType

from ..parameters.axis import AxisParameters
from ..parameters.configuration import Configuration
from ..plant.layout import AxisLayout
from ..plant.timing import Timing
from .bounds import Bounds
from .ends import Ends
from .finding import Finding, Severity, worst_first
from .places import Places
from .remedy import applicable
from .shift import Shift
from .values import check_values

__all__ = ['Finding', 'Severity', 'Timing', 'check', 'check_axis', 'errors']

NOWHERE: Mapping[str, AxisLayout] = MappingProxyType({})


def check(
    axes: Configuration | Mapping[str, AxisParameters],
    layouts: Mapping[str, AxisLayout] | None = None,
    timing: Timing | None = None,
) -> list[Finding]:
    """Check all axes; return what was found, by axis, the worst first.

    A configuration's own update rate takes the place of that in ``timing``. With ``layouts`` every
    axis is expected to be in it.
    """
    timing = timing or Timing()
    findings: list[Finding] = []
    if isinstance(axes, Configuration):
        timing = timing._replace(update_rate=axes.update_rate)
        findings += _check_node(axes)
        axes = axes.axes
    for axis, parameters in axes.items():
        findings += check_axis(axis, parameters, (layouts or NOWHERE).get(axis), timing)
        if layouts is not None and axis not in layouts:
            findings.append(
                Finding(
                    Severity.info,
                    axis,
                    'layout-missing',
                    'the layout has no such axis',
                    'what depends on where its switches are is not checked',
                )
            )
    return worst_first(findings)


def check_axis(
    axis: str,
    parameters: AxisParameters,
    layout: AxisLayout | None = None,
    timing: Timing | None = None,
) -> list[Finding]:
    """Check one axis; return what was found, the worst first."""
    timing = timing or Timing()
    try:
        findings = list(check_values(axis, parameters, timing, layout is not None))
        if layout is not None:
            for part in (Places, Ends, Bounds, Shift):
                findings += part(axis, parameters, layout, timing).check()
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
    return worst_first(applicable(finding, parameters) for finding in findings)


def errors(findings: list[Finding]) -> list[Finding]:
    """Return those findings for which a run fails, or something is hit."""
    return [finding for finding in findings if finding.severity is Severity.error]


def _check_node(configuration: Configuration) -> list[Finding]:
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
