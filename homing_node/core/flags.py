# SPDX-License-Identifier: Apache-2.0
"""The ends of the flags of the switches, as the axis passed them going toward.

Positions are in the *toward* frame, m or rad. A contact bounces where it changes: if edges lie
within ``flag_bounce_distance`` of each other, only the first one is an end of the flag.
"""

from ..parameters.axis import AxisParameters
from ..procedures.states import Input
from .signals import Edge


class FlagEnds:
    """The ends of each flag, and which end an edge going away belongs to."""

    def __init__(self, parameters: AxisParameters) -> None:
        self._bounce_distance = parameters.flag_bounce_distance
        self._tolerance = parameters.edge_agreement
        self._newest: dict[tuple[Input, bool], Edge] = {}
        self._ends: dict[tuple[Input, bool], Edge] = {}
        #: How far behind the opposite edge the last bounce was, None if there was none.
        self.dismissed: float | None = None

    def add(self, edge: Edge) -> None:
        """Record an edge that the axis passed going toward."""
        key = edge.input, edge.rises
        opposite = self._newest.get((edge.input, not edge.rises))
        bounce = opposite and abs(edge.position - opposite.position) <= self._bounce_distance
        if not bounce or key not in self._ends:
            self._ends[key] = edge
        self._newest[key] = edge

    def bounces(self, edge: Edge) -> bool:
        """Return whether an edge going toward may be a bounce of the opposite edge before it."""
        opposite = self._newest.get((edge.input, not edge.rises))
        if opposite is None or edge.position > opposite.position + self._bounce_distance:
            return False
        self.dismissed = edge.position - opposite.position
        return True

    def at_entry(self, edge: Edge) -> bool:
        """Return whether an edge going away is at the end where the axis entered the flag.

        Going toward, the edge at that end had the opposite sense. The edge going away must lie no
        further toward than it, within the uncertainty of both and a tolerance, which is at most
        half of the flag's width.
        """
        end = self._ends.get((edge.input, not edge.rises))
        if end is None:
            return True
        tolerance = self._tolerance
        other = self._ends.get((edge.input, edge.rises))
        if other is not None and other.position > end.position:
            tolerance = min(tolerance, 0.5 * (other.position - end.position))
        unsure = end.uncertainty + edge.uncertainty
        return edge.position <= end.position + tolerance + unsure
