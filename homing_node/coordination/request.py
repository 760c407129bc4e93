# SPDX-License-Identifier: Apache-2.0
"""One request for axes of several cells: its steps, and what a failure stops.

A step begins when every turn of the step before has ended. At most `at_once` axes of all requests
have their turn at the same time. `on_failure`:

- `stop_all`: the other axes that home are stopped, and nothing more starts. A step begins only
  while every axis of the steps before is homed.
- `stop_step`: the other axes of the step are stopped; later steps begin.
- `go_on`: all others go on.

Whatever is set, an axis that does not come to rest after a cancel stops all others, and nothing
more starts; and no axis starts whose `requires` do not hold: a check before each start asks.
"""

from collections.abc import Collection, Iterable, Sequence

from ..core.outcome import Outcome
from ..parameters.line import OnFailure
from .turn import Turn
from .turn_table import Phase


class Request:
    """The turns of the axes of one request.

    Attributes:
        steps: the turns of each step.
        turns: all turns, in order.
        turn_of: the turn of each axis.
        owner: who has asked, for messages.
        force: whether axes that are homed are homed again.
        begun: the number of steps that have begun.
    """

    def __init__(
        self, steps: Iterable[Sequence[str]], owner: str, on_failure: OnFailure, force: bool
    ) -> None:
        self.steps = [[Turn(axis) for axis in step] for step in steps if step]
        self.turns = [turn for step in self.steps for turn in step]
        self.turn_of = {turn.axis: turn for turn in self.turns}
        self.owner, self.force = owner, force
        self.begun = 0
        self._on_failure = on_failure
        self._judged: set[str] = set()  # axes whose failure has had its consequences

    @property
    def names(self) -> list[str]:
        return list(self.turn_of)

    @property
    def done(self) -> bool:
        return all(turn.ended for turn in self.turns)

    @property
    def outcomes(self) -> dict[str, Outcome]:
        """How the turn of each axis ended."""
        return {turn.axis: turn.outcome for turn in self.turns}

    @property
    def step(self) -> list[Turn]:
        """The turns of the present step."""
        return self.steps[self.begun - 1] if self.begun else []

    @property
    def due(self) -> list[Turn]:
        """The turns of the present step that have not begun; a step that is over is followed."""
        while self.begun < len(self.steps) and all(turn.ended for turn in self.step):
            self.begun += 1
        return [turn for turn in self.step if turn.phase is Phase.Waiting]

    @property
    def earlier(self) -> list[str]:
        """The axes that must still be homed in this step, because they homed in earlier ones."""
        if self._on_failure is not OnFailure.stop_all:
            return []
        return [turn.axis for step in self.steps[: max(0, self.begun - 1)] for turn in step]

    def to_stop(self) -> list[tuple[Turn, str]]:
        """Return the turns that failures stop, each with the reason; a failure counts once."""
        found: list[tuple[Turn, str]] = []
        for step in self.steps:
            for turn in step:
                if not turn.failed or turn.axis in self._judged:
                    continue
                self._judged.add(turn.axis)
                if self._on_failure is OnFailure.go_on and not turn.restless:
                    continue
                whole = self._on_failure is OnFailure.stop_all or turn.restless
                what = 'may still move' if turn.restless else 'was not homed'
                reason = f'{turn.axis} {what} ({turn.outcome.error})'
                found += [
                    (other, f'not started: {reason}' if other.phase is Phase.Waiting else reason)
                    for other in (self.turns if whole else step)
                    if not other.ended
                ]
        return found

    def to_cancel(self, axes: Collection[str]) -> list[Turn]:
        """Return the turns of some axes that a cancel stops.

        The other axes of the request go on as `on_failure` says: with `stop_all` they stop, too.
        """
        whole = self._on_failure is OnFailure.stop_all and any(a in axes for a in self.names)
        return [turn for turn in self.turns if not turn.ended and (whole or turn.axis in axes)]
