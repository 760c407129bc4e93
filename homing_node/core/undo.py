# SPDX-License-Identifier: Apache-2.0
"""The undo of an arrow: an edge of an earlier time may arrive when a later one has acted.

The earlier edge decides, however late its message arrives. The command goes on; nothing else of
the arrow stays.
"""

from typing import NamedTuple, Protocol

from ..procedures.events import Event
from ..procedures.procedure import Row
from ..procedures.steps import Step
from .passes import Passes
from .signals import Edge, Mark


class Progress(Protocol):
    """What an arrow changes in a run; the attributes are those of `Machine`."""

    step: Step
    row: Row
    arrows: list[tuple[Step, Event]]
    reversed: bool
    reference: Mark | None
    passes: Passes


class Undo(NamedTuple):
    """What stood before an edge took its arrow; of passes, only the marks."""

    edge: Edge
    step: Step
    row: Row
    reversed: bool
    reference: Mark | None
    coarse_pass: Mark | None
    fine_passes: tuple[Mark, ...]

    @classmethod
    def of(cls, run: Progress, cause: Mark) -> 'Undo | None':
        """Return what stands now; None if it is no edge that takes the arrow."""
        if not isinstance(cause, Edge):
            return None
        passes = run.passes
        return cls(
            cause,
            run.step,
            run.row,
            run.reversed,
            run.reference,
            passes.coarse,
            tuple(passes.fine),
        )

    def take_back(self, run: Progress) -> None:
        """Take back the last arrow of a run."""
        run.step, run.row = self.step, self.row
        del run.arrows[-1]
        run.reversed, run.reference = self.reversed, self.reference
        run.passes.coarse, run.passes.fine = self.coarse_pass, list(self.fine_passes)
