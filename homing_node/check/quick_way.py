# SPDX-License-Identifier: Apache-2.0
"""Checks the quick way to a remembered switch: what if the encoder has slipped meanwhile?"""

from collections.abc import Iterator
from math import isfinite

from ..procedures.motions import Pace
from .axis_with_layout import SIDES, AxisWithLayout
from .finding import Finding, Severity


class QuickWay(AxisWithLayout):
    """A velocity at which the limit switches no longer stop the axis before the hard stop."""

    def check(self) -> Iterator[Finding]:
        p, quick = self.p, list(self.p.procedure.quick.values())
        velocity = p.pace(Pace.QUICK)[0]
        if not (p.rehome and quick and velocity > p.homing_velocity_fast):
            return
        for row in quick:
            way = row.motion.way
            stop = self.at.stops[way]
            stops = [one for one in self.limit_stops(row) if one.place < stop]
            if not stops or not isfinite(stop):
                continue
            first = min(stops, key=lambda one: one.place)
            room, overrun = stop - first.place, first.overrun(velocity)
            if overrun > room:
                yield self.found(
                    Severity.warning,
                    'quick-way',
                    f'at {velocity:g} m/s the axis goes on by {overrun:.4g} m after the '
                    f'{first.name}, into the hard stop {SIDES[way]}, which is {room:.4g} m away',
                    'it comes there only if the switch is not where it is remembered, because the '
                    'encoder has slipped',
                    'rehome_velocity',
                    velocity,
                )
