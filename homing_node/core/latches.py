# SPDX-License-Identifier: Apache-2.0
"""The latched positions of the Z-pulse and the touch probe, and which one is the reference.

Positions are in the *toward* frame, m or rad.
"""

from collections import deque
from collections.abc import Iterable
from itertools import pairwise
from math import inf
from statistics import median

from ..parameters.axis import AxisParameters
from ..procedures.events import Event
from ..procedures.motions import Way
from ..procedures.states import Error, Input
from .outcome import Failure
from .signals import Mark

#: The number of spacings from which the pitch is computed.
MOST_SPACINGS = 32

EVENTS = {Input.Z_PULSE: Event.Z_PULSE, Input.TOUCH_PROBE: Event.TOUCH_PROBE}


class Latches:
    """The positions that were latched since the axis turned."""

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self._positions: dict[Event, set[float]] = {event: set() for event in EVENTS.values()}
        self._newest: float | None = None  # Z-pulse of this stretch of travel
        self._spacings: deque[float] = deque(maxlen=MOST_SPACINGS)

    def add(self, source: Input, position: float) -> None:
        positions = self._positions[EVENTS[source]]
        if source is Input.Z_PULSE and position not in positions:
            if self._newest is not None:
                self._spacings.append(abs(position - self._newest))
            self._newest = position
        positions.add(position)

    def forget(self) -> None:
        """Forget the positions that were latched while the axis still traveled the other way."""
        self._newest = None
        for positions in self._positions.values():
            positions.clear()

    @property
    def pitch(self) -> float | None:
        """The distance between Z-pulses, m: z_pulse_distance_check, else as seen in this run."""
        expected = self._parameters.z_pulse_distance_check
        return expected or (median(self._spacings) if self._spacings else None)

    def margin(self, origin: float, way: Way) -> float | None:
        """Return the distance from where the Z-pulse was armed to the first pulse, in pitches."""
        armed = origin + way * self._parameters.z_pulse_arm_delay
        first = self._first_beyond(armed, way)
        return first / self.pitch if first < inf and self.pitch else None

    def doubt(self, edge: Mark, way: Way) -> float:
        """Return how far the Z-pulse that counts may be from the one found, m.

        Where a pulse lies within the uncertainty of the edge that armed it, the first pulse beyond
        the true edge may be another one: whole pitches away or, where no pitch is known, anywhere
        in the search.
        """
        p, unsure, pitch = self._parameters, edge.uncertainty, self.pitch
        first = self._first_beyond(edge.position + way * p.z_pulse_arm_delay, way)
        if pitch:
            before = (first + unsure) // pitch
            beyond = (unsure - first) // pitch + 1.0
            return pitch * max(before, beyond, 0.0)
        return (p.max_z_pulse_distance or p.search_distance) if first <= unsure else 0.0

    def _first_beyond(self, armed: float, way: Way) -> float:
        """Return how far beyond a place the first Z-pulse lies, m; inf without one."""
        beyond = ((latch - armed) * way for latch in self._positions[Event.Z_PULSE])
        return min((distance for distance in beyond if distance > 0.0), default=inf)

    def margin_failure(self, margin: float) -> Failure | None:
        """Return what is wrong with a margin and where to move the switch; None if it is good.

        Half a pitch is best. Source: SERCOS S-0-0298, home switch distance.
        """
        least, pitch = self._parameters.index_margin, self.pitch or 0.0
        if least <= margin <= 1.0 - least:
            return None
        shift = (margin - 0.5) * pitch
        return Failure(
            Error.IndexMarginError,
            f'the Z-pulse lies {margin:.3f} of its pitch ({pitch:.6g} m) behind the edge that '
            f'arms it, not within {least:g} to {1.0 - least:g} (index_margin)',
            f'move the switch {abs(shift):.6g} m '
            + ('on along' if shift > 0.0 else 'back against')
            + ' the travel at that edge',
        )

    @staticmethod
    def doubt_failure(edge: Mark, doubt: float) -> Failure:
        """Return what is wrong with an edge that leaves a doubt of the Z-pulse."""
        return Failure(
            Error.IndexMarginError,
            f'the edge that arms the Z-pulse is known to {edge.uncertainty:.3g} m, so that the '
            f'Z-pulse may be another one, up to {doubt:.6g} m away',
            'go over that edge more slowly, or move the switch',
        )

    def found(
        self, events: Iterable[Event], origin: float, way: Way, feedback: float
    ) -> tuple[Event, Mark] | Failure | None:
        """Return the latch that a row waits for: the n-th one beyond an origin.

        A latched position ahead of the feedback waits, because it may be wrong.

        Args:
            events: the latches that the row has an arrow for.
            origin: beyond where a latch counts, m or rad.
            way: the way of travel.
            feedback: the newest feedback, m or rad.

        Returns:
            The event and its place, None if none counts yet, or a Failure if the spacing of the
            Z-pulses is wrong or no pulse comes.
        """
        p = self._parameters
        for event in events:
            z_pulse = event is Event.Z_PULSE
            count = max(1, p.multiple_z_pulse) if z_pulse else 1
            delay = p.z_pulse_arm_delay if z_pulse else 0.0
            beyond = sorted(
                (
                    latch
                    for latch in self._positions[event]
                    if delay < (latch - origin) * way <= (feedback - origin) * way
                ),
                key=lambda latch: latch * way,
            )[:count]
            failure = self._spacing_failure(beyond) if z_pulse else None
            if failure is not None:
                return failure
            if len(beyond) == count:
                return event, Mark(beyond[-1])
            missing = (feedback - (beyond[-1] if beyond else origin)) * way
            if z_pulse and p.max_z_pulse_distance and missing > p.max_z_pulse_distance:
                return Failure(
                    Error.ZPulseNotFound,
                    f'no Z-pulse within {p.max_z_pulse_distance:.6g} m (max_z_pulse_distance)',
                    'is the index wired, and its pitch shorter than the bound?',
                )
        return None

    def _spacing_failure(self, latches: Iterable[float]) -> Failure | None:
        p = self._parameters
        expected, tolerance = p.z_pulse_distance_check, p.z_pulse_distance_tolerance
        for one, another in pairwise(latches):
            apart = abs(another - one)
            if expected and abs(apart - expected) > expected * tolerance:
                return Failure(
                    Error.ZPulseDistanceCheckError,
                    f'two Z-pulses are {apart:.6g} m apart, not {expected:.6g} m '
                    f'+- {100 * tolerance:.3g} % (z_pulse_distance_check)',
                )
        return None
