# SPDX-License-Identifier: Apache-2.0
"""Passes over the reference: do they agree, and what is home then.

Positions are in the *toward* frame, m or rad.
"""

from statistics import fmean, pstdev

from ..parameters.axis import AxisParameters
from ..procedures.states import Error, Input
from .outcome import Failure
from .signals import Edge, Mark

#: The part of `edge_tolerance` within which a quick run must find the reference where it was
#: before; else it takes one more pass.
EXPECTED = 0.2


class Passes:
    """The coarse pass over a switch, if there was one, and the passes that give home."""

    def __init__(self, parameters: AxisParameters) -> None:
        self._parameters = parameters
        self.coarse: Mark | None = None
        self.fine: list[Mark] = []
        self.expected: Mark | None = None  # where earlier runs have found the reference

    def forget(self) -> None:
        """Begin again: the procedure does."""
        self.coarse = self.expected = None
        self.fine.clear()

    def add(self, mark: Mark) -> bool:
        """Take a pass that gives home; return whether one more is wanted.

        A first pass that is not where earlier runs have found the reference is a coarse one.
        """
        expected, self.expected = self.expected, None
        if expected is not None and self.coarse is None and not self._agree(mark, expected):
            self.coarse = mark
            return True
        self.fine.append(mark)
        return len(self.fine) < self._parameters.repeat

    def near_edge_of(self, position: float) -> Input | None:
        """Return the switch at whose edge the last pass ended, if a position is all but there.

        Not of a type whose only pass is a fast one: a home that is uncertain may lie further
        toward than the axis has been.
        """
        edge = self.fine[-1] if self.fine else None
        if not isinstance(edge, Edge) or (edge.rises and self.coarse is None):
            return None
        short = edge.position - position
        near = short <= self._parameters.edge_agreement + edge.uncertainty
        return edge.input if near else None

    def _agree(self, one: Mark, another: Mark) -> bool:
        """Return whether two passes agree so well that no further one is needed."""
        unsure = one.uncertainty + another.uncertainty
        tolerance = EXPECTED * self._parameters.edge_agreement
        return abs(one.position - another.position) <= tolerance + unsure

    @property
    def range(self) -> float:
        """Largest minus smallest position of the passes."""
        positions = [mark.position for mark in self.fine]
        return max(positions) - min(positions) if positions else 0.0

    @property
    def deviation(self) -> float:
        """Standard deviation of the passes."""
        return pstdev(mark.position for mark in self.fine) if self.fine else 0.0

    @property
    def mean(self) -> Mark:
        """The home position that the passes give; no less certain than the worst of them."""
        return Mark(
            fmean(mark.position for mark in self.fine), max(mark.uncertainty for mark in self.fine)
        )

    def disagreement(self) -> Failure | None:
        """Return why the passes are no home: they disagree with each other or the coarse one.

        A coarse pass is compared only with the same edge: a pulse, a probe or the edge of the
        other sense lies elsewhere.
        """
        p = self._parameters
        coarse, first = self.coarse, self.fine[0] if self.fine else None
        if isinstance(coarse, Edge) and isinstance(first, Edge) and first.rises == coarse.rises:
            apart = abs(first.position - coarse.position)
            unsure = first.uncertainty + coarse.uncertainty
            if apart > p.edge_agreement + unsure:
                return Failure(
                    Error.EdgeNotRepeated,
                    f'the second pass found the {first.input.text} {apart:.6g} m from the '
                    f'first, more than {p.edge_agreement:.6g} m (edge_tolerance) and both '
                    f'uncertainties, {unsure:.6g} m',
                    'noise on the switch, or late messages?',
                )
        unsure = sum(sorted(mark.uncertainty for mark in self.fine)[-2:])
        if self.range > p.repeat_agreement + unsure:
            return Failure(
                Error.EdgeNotRepeated,
                f'{len(self.fine)} passes spread over {self.range:.6g} m, more than '
                f'{p.repeat_agreement:.6g} m (repeat_tolerance) and the uncertainties of two, '
                f'{unsure:.6g} m',
            )
        return None
