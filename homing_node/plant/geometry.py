# SPDX-License-Identifier: Apache-2.0
"""An axis's layout as a homing run meets it: along its way, in the *toward* frame.

Going a way, every place is a distance along that way (``along``), so that what lies further on has
the larger number at both ends of the axis. Units: m or rad.
"""

from math import floor, inf, isfinite, isnan
from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..plant.layout import AxisLayout
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.procedure import Row
from ..procedures.states import HomeType, Input
from ..procedures.steps import HOME_SHIFT, Step


class Flag(NamedTuple):
    """The flag of a switch, in the toward frame."""

    low: float
    high: float
    hysteresis: float

    def enters(self, way: Way) -> float:
        """Return where the switch rises, along a way."""
        return self.low if way is Way.TOWARD else -self.high

    def leaves(self, way: Way) -> float:
        """Return where the switch falls, along a way."""
        return (self.high if way is Way.TOWARD else -self.low) + self.hysteresis


class Geometry:
    """Where things are along the axis, as far as it is known (unknown hard stops are infinite)."""

    def __init__(self, parameters: AxisParameters, layout: AxisLayout) -> None:
        self.sign = parameters.home_direction.sign
        self.parameters = parameters
        self.layout = layout
        self.flags: dict[Input, Flag] = {}
        for name, flag in layout.switches.items():
            low, high = sorted((self.sign * flag.on_from, self.sign * flag.on_to))
            self.flags[Input(name)] = Flag(low, high, flag.hysteresis)
        self.stops = {
            Way.TOWARD: max(self.sign * stop for stop in layout.hard_stops),
            Way.AWAY: max(-self.sign * stop for stop in layout.hard_stops),
        }
        self.probe = None if layout.touch_probe is None else self.sign * layout.touch_probe

    @property
    def span(self) -> float:
        """The distance between the hard stops, inf where one is unknown."""
        return self.stops[Way.TOWARD] + self.stops[Way.AWAY]

    @property
    def indexed(self) -> bool:
        """Whether it is known where the index pulses are."""
        return self.layout.index_pitch > 0.0 and not isnan(self.layout.index_offset)

    @property
    def target(self) -> Flag | None:
        """The flag of the limit that the type homes on."""
        pair = self.parameters.procedure.target
        return self.flags.get(self.parameters.limit_switch(pair, Way.TOWARD)) if pair else None

    def raw(self, place: float) -> float:
        """Return a place of the toward frame as a raw position."""
        return self.sign * place + 0.0  # not -0.0

    def flag_of(self, event: Event) -> Flag | None:
        """Return the flag whose edge an event is."""
        if event in (Event.HS_RISES, Event.HS_FALLS, Event.HS_ON):
            return self.flags.get(Input.HOME_SWITCH)
        if event in (Event.LS_RISES, Event.LS_FALLS, Event.LS_ON):
            return self.target
        return None

    def edge(self, event: Event, way: Way) -> float | None:
        """Return where an edge of the tables is, along a way; None where that is unknown."""
        flag = self.flag_of(event)
        if flag is None:
            return None
        rises = event in (Event.HS_RISES, Event.LS_RISES)
        found = flag.enters(way) if rises else flag.leaves(way)
        return found if isfinite(found) else None

    def pulse(self, beyond: float, way: Way, count: int = 1) -> float | None:
        """Return where the n-th index pulse beyond a place is, both along a way."""
        if not self.indexed or not isfinite(beyond):
            return None
        pitch = self.layout.index_pitch
        offset = way * self.sign * self.layout.index_offset
        first = floor((beyond - offset) / pitch) + 1
        if offset + first * pitch <= beyond:
            first += 1
        return offset + (first + count - 1) * pitch


def entries(parameters: AxisParameters, step: Step) -> list[tuple[Row, Event]]:
    """Return the rows from which an arrow leads into a step, with the arrow's event."""
    return [
        (row, event)
        for row in parameters.procedure.rows.values()
        for event, target in row.on.items()
        if target == step
    ]


def arming_edge(geometry: Geometry, step: Step, row: Row) -> tuple[str, float] | None:
    """Return what a row that waits for an index pulse counts from, along the row's way.

    The edge that led into the row, or the mechanical end; None where it is where the run began.
    """
    way = row.motion.way
    for before, event in entries(geometry.parameters, step):
        if event is Event.END_DETECTED:
            end = -geometry.stops[Way.TOWARD]
            return ('mechanical end', end) if isfinite(end) else None
        edge = geometry.edge(event, before.motion.way)
        if edge is not None:
            # The arrow may come from a row that went the other way; its edge is where it was.
            return str(event), edge if before.motion.way is way else -edge
    return None


def index_pulse(
    geometry: Geometry, step: Step, row: Row, start: float | None = None
) -> float | None:
    """Return where the index pulse that a row waits for is, along the row's way.

    ``start`` is the raw start position, for a row that waits for one from there on.
    """
    way, p = row.motion.way, geometry.parameters
    armed = arming_edge(geometry, step, row)
    if armed is None and start is not None and not entries(p, step):
        armed = 'the start', way * geometry.sign * start
    return (
        geometry.pulse(armed[1] + p.z_pulse_arm_delay, way, max(1, p.multiple_z_pulse))
        if armed
        else None
    )


def place_of(geometry: Geometry, event: Event, step: Step, row: Row) -> float | None:
    """Return where an event of a row comes about, along the row's way; None: not known."""
    way = row.motion.way
    if event is Event.Z_PULSE:
        return index_pulse(geometry, step, row)
    if event is Event.TOUCH_PROBE:
        return None if geometry.probe is None else way * geometry.probe
    if event is Event.END_DETECTED:
        end = geometry.stops[way]
        return end if isfinite(end) else None
    return geometry.edge(event, way)


def true_home(geometry: Geometry, start: float | None = None) -> float | None:
    """Return where home is, raw, as the layout says; None where that is not known.

    ``start`` is the raw start position, for the types whose home depends on it.
    """
    p = geometry.parameters
    if p.home_type is HomeType.CurrentPos:
        return start
    for step, row in p.procedure.rows.items():
        for event, target in row.on.items():
            if target == HOME_SHIFT:
                found = _reference(geometry, step, row, event, start)
                return None if found is None else geometry.raw(row.motion.way * found)
    return None


def _reference(
    geometry: Geometry, step: Step, row: Row, event: Event, start: float | None
) -> float | None:
    """Return where the home position is taken, along the row's way."""
    way = row.motion.way
    if event is Event.Z_PULSE:
        return index_pulse(geometry, step, row, start)
    if geometry.flag_of(event) is None:
        return place_of(geometry, event, step, row)
    edges = [geometry.edge(one, way) for one, target in row.on.items() if target == HOME_SHIFT]
    known = [edge for edge in edges if edge is not None]
    if Event.END_DETECTED in geometry.parameters.procedure.events:
        end = way * geometry.stops[Way.TOWARD]
        known = [edge for edge in known if edge > end]  # of a flag that lies on the end: the fall
    return min(known, default=inf) if known else None
