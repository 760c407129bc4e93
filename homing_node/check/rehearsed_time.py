# SPDX-License-Identifier: Apache-2.0
"""Rehearses axes that have a timeout of their own, and says from where it is too short.

run_bounds.py knows the least time of a run, without ramps and overruns; where the passes are slow
these are the greatest part. The node never imports this: it rehearses nothing.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf

from ..parameters.axis import AxisParameters
from ..parameters.configuration import Configuration
from ..plant.geometry import Geometry
from ..plant.layout import AxisLayout
from ..procedures.motions import Way
from ..procedures.states import Error, Input
from ..rehearsal.run import rehearse
from .finding import Finding, Severity


def too_short(
    configuration: Configuration, layouts: Mapping[str, AxisLayout], known: list[Finding]
) -> Iterator[Finding]:
    """Yield a finding for each axis whose timeout ends a rehearsed run.

    ``known``: what was found without a rehearsal; an axis whose timeout is in it is left out.
    """
    done = {one.axis for one in known if one.check == 'timeout'}
    for axis, p in configuration.axes.items():
        layout = layouts.get(axis)
        if layout is None or not p.timeout or axis in configuration.followers or axis in done:
            continue
        late = [name for name, start in _starts(p, layout).items() if _times_out(p, layout, start)]
        if late:
            yield Finding(
                Severity.error,
                axis,
                'timeout',
                f'timeout is {p.timeout:g} s, but a run from {" and from ".join(late)} is not '
                'over by then, as rehearsed',
                'it ends with Timeout (0: computed)',
                'timeout',
                p.timeout,
                0.0,
                's',
            )


def _starts(parameters: AxisParameters, layout: AxisLayout) -> Mapping[str, float]:
    """Return where the longest runs begin, raw: at the far end, on the home switch, beyond it."""
    at = Geometry(parameters, layout)
    if max(map(abs, layout.hard_stops)) == inf:
        return {}
    starts = {'the far end': at.raw(-at.stops[Way.AWAY])}
    home = at.flags.get(Input.HOME_SWITCH)
    if home:
        middle = 0.5 * (max(home.low, -at.stops[Way.AWAY]) + min(home.high, at.stops[Way.TOWARD]))
        starts['the home switch'] = at.raw(middle)
    if home and home.leaves(Way.TOWARD) < at.stops[Way.TOWARD]:
        starts['beyond the home switch'] = at.raw(home.leaves(Way.TOWARD))
    return starts


def _times_out(parameters: AxisParameters, layout: AxisLayout, start: float) -> bool:
    """Return whether a rehearsed run ends with Timeout."""
    course = rehearse(replace(parameters, pause_mode=False), layout, position=start)
    return course.outcome is not None and course.outcome.error is Error.Timeout
