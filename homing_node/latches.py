"""Latched positions of the Z-pulse and the touch probe: which one is the reference.

Positions are in the *toward* frame, m or rad.
"""

from collections.abc import Iterable
from itertools import pairwise

from .events import Event
from .motions import Way
from .parameters import AxisParameters
from .signals import Mark
from .states import Error, Input
from .travel import Fault

EVENTS = {Input.Z_PULSE: Event.Z_PULSE, Input.TOUCH_PROBE: Event.TOUCH_PROBE}


class Latches:
    """What was latched since the axis turned."""

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._positions: dict[Event, set[float]] = {event: set() for event in EVENTS.values()}

    def add(self, source: Input, position: float) -> None:
        self._positions[EVENTS[source]].add(position)

    def forget(self) -> None:
        """Forget what was latched while the axis still traveled the other way."""
        for positions in self._positions.values():
            positions.clear()

    def found(
        self, events: Iterable[Event], origin: float, way: Way, feedback: float
    ) -> tuple[Event, Mark] | Fault | None:
        """Return the latch that a row waits for: of those beyond an origin, the n-th.

        ``events`` are the row's. A Fault where Z-pulses are too far apart or do not come.
        """
        p = self._parameters
        for event in events:
            if event not in self._positions:
                continue
            z_pulse = event is Event.Z_PULSE
            count = max(1, p.multiple_z_pulse) if z_pulse else 1
            beyond = sorted(
                (latch for latch in self._positions[event] if (latch - origin) * way > 0.0),
                key=lambda latch: latch * way)[:count]
            fault = self._spacing_fault(beyond) if z_pulse else None
            if fault is not None:
                return fault
            if len(beyond) == count:
                return event, Mark(beyond[-1])
            missing = (feedback - (beyond[-1] if beyond else origin)) * way
            if z_pulse and p.max_z_pulse_distance and missing > p.max_z_pulse_distance:
                return Fault(
                    Error.ZPulseNotFound,
                    f'no Z-pulse within {p.max_z_pulse_distance:.6g} m (max_z_pulse_distance)',
                    'is the index wired, and its pitch shorter than the bound?')
        return None

    def _spacing_fault(self, latches: Iterable[float]) -> Fault | None:
        p = self._parameters
        expected, tolerance = p.z_pulse_distance_check, p.z_pulse_distance_tolerance
        for one, another in pairwise(latches):
            apart = abs(another - one)
            if expected and abs(apart - expected) > expected * tolerance:
                return Fault(
                    Error.ZPulseDistanceCheckError,
                    f'two Z-pulses are {apart:.6g} m apart, not {expected:.6g} m '
                    f'+- {100 * tolerance:.3g} % (z_pulse_distance_check)')
        return None
