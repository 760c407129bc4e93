# SPDX-License-Identifier: Apache-2.0
"""Homes a gantry with a switch of one side dead, stuck, or swapped with the other side's."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf
from typing import NamedTuple

from ..course import Course
from ..parameters.axis import AxisParameters
from ..plant.layout import AxisLayout, SwitchLayout
from ..procedures.states import Input, TextEnum
from .gantry import GantryRehearsal
from .link import Transport

#: Flags that are never reached, and never left.
NOWHERE, EVERYWHERE = (inf, inf), (-inf, inf)


class SideFault(TextEnum):
    """What is wrong with a switch of one side."""

    dead = 'dead'  # it never turns on
    stuck = 'stuck'  # it never turns off
    swapped = 'swapped'  # its cable and the one of the leader's switch are swapped


class FaultTrial(NamedTuple):
    """A rehearsed run with a fault.

    ``force`` (N) is the most that a spring bore, ``left`` (m) how far the gantry is out of square
    after the run.
    """

    side: str
    switch: Input
    fault: SideFault
    course: Course
    force: float
    left: float

    @property
    def homed(self) -> bool:
        """Whether the run has homed the gantry."""
        return bool(self.course.outcome and self.course.outcome.success)


def fault_trials(
    axis: str,
    parameters: AxisParameters,
    followers: Mapping[str, AxisParameters],
    layout: AxisLayout,
    transport: Transport,
    switch: Input,
) -> Iterator[FaultTrial]:
    """Rehearse a run with each fault on each side.

    Args:
        axis: The name of the gantry.
        parameters: The parameters of the leader.
        followers: Those of the followers, by their full names.
        layout: Where things are; all followers must be in it.
        transport: How messages travel.
        switch: The switch of the leader that is at fault, and of the followers that have it.
    """
    parameters = replace(parameters, pause_mode=False)

    def rehearsal(changed: AxisLayout) -> GantryRehearsal:
        return GantryRehearsal(axis, parameters, followers, changed, transport)

    for side, own in {axis: parameters, **followers}.items():
        if switch in own.inputs:
            for fault, flag in ((SideFault.dead, NOWHERE), (SideFault.stuck, EVERYWHERE)):
                made = rehearsal(_with_flag(layout, axis, side, switch, flag))
                yield _trial(made, side, switch, fault)
    for side, own in followers.items():
        if switch in own.inputs:
            made = rehearsal(_racked(layout, side, parameters.max_skew))
            link = made.links[side]
            made.switched, link.switched = link.axis, made.axis
            yield _trial(made, side, switch, SideFault.swapped)


def _trial(made: GantryRehearsal, side: str, switch: Input, fault: SideFault) -> FaultTrial:
    course = made.home()
    left = max((abs(by) for by in made.gantry.racked), default=0.0)
    return FaultTrial(side, switch, fault, course, course.largest_force or 0.0, left)


def _with_flag(
    layout: AxisLayout, axis: str, side: str, switch: Input, flag: tuple[float, float]
) -> AxisLayout:
    """Return a layout in which the flag of a switch of one side is elsewhere."""
    own = layout if side == axis else layout.followers[side]
    fitted = own.switches.get(switch.value, SwitchLayout(*flag))
    moved = fitted._replace(on_from=flag[0], on_to=flag[1])
    own = own._replace(switches={**own.switches, switch.value: moved})
    return own if side == axis else _with_follower(layout, side, own)


def _with_follower(layout: AxisLayout, side: str, own: AxisLayout) -> AxisLayout:
    return layout._replace(followers={**layout.followers, side: own})


def _racked(layout: AxisLayout, side: str, max_skew: float) -> AxisLayout:
    """Return a layout in which a side starts half of the largest skew from square."""
    own = layout.followers[side]
    square = layout.start + own.square_at
    start = square + 0.5 * max_skew
    return _with_follower(layout, side, own._replace(start=-start if own.mirrored else start))
