# SPDX-License-Identifier: Apache-2.0
"""How far each axis of a request has come: bars on a terminal, else a line for each new state."""

from collections.abc import Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from ..procedures.states import Error, State

#: A terminal that is narrower has no room for the state beside the bar, characters.
NARROW = 70


class Display:
    """Shows the feedback of a goal; a context."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = console.is_terminal and not console.is_dumb_terminal
        self._shown: dict[str, str] = {}  # the last line of each axis
        self._tasks: dict[str, Any] = {}
        state = TextColumn('{task.fields[state]}', markup=False)
        self._progress = Progress(
            TextColumn('{task.description}', markup=False),
            *([state] if console.width >= NARROW else []),
            BarColumn(bar_width=None),
            TextColumn('{task.fields[way]}', markup=False),
            console=console,
            expand=True,
            disable=not self._live,
        )

    def __enter__(self) -> 'Display':
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def feedback(self, message: Any) -> None:
        """Take the feedback of an action `Home`."""
        for state, traveled, bound in zip(
            message.states, message.distance_traveled, message.distance_bound, strict=True
        ):
            way = f'{traveled:.4g} of {bound:.4g}' if bound else f'{traveled:.4g}'
            self.show(state.axis, condition(state), traveled, bound, way)

    def ended(self, states: Sequence[Any]) -> None:
        """Take the last state of each axis."""
        for state in states:
            self.show(state.axis, condition(state), float(state.homed), 1.0, '')

    def show(self, axis: str, state: str, done: float, bound: float, way: str) -> None:
        """Show one axis: its state in words, and how much is done of what bounds it (0: none)."""
        if not self._live:
            if self._shown.get(axis) != state:
                self._shown[axis] = state
                with suppress(BrokenPipeError):  # who read has gone: the run goes on, and its end
                    print(f'{axis}: {state}', flush=True)  # is told by the status
            return
        if axis not in self._tasks:
            self._tasks[axis] = self._progress.add_task(axis, state=state, way=way)
        self._progress.update(
            self._tasks[axis], completed=done, total=bound or None, state=state, way=way
        )


def condition(state: Any) -> str:
    """Return what an axis does, or how its run has ended, in one word."""
    if state.paused:
        return f'{state.state}, paused'
    if state.state != State.Idle:
        return str(state.state)
    if state.error != Error.NoError:
        return str(state.error)
    return 'homed' if state.homed else 'at rest'
