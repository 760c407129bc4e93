# SPDX-License-Identifier: Apache-2.0
"""Requests from clients to axes: who homes what, and who waits for which answer.

No ROS: the services await an :class:`Answer`, which the cycle gives.
"""

from collections.abc import Callable, Generator, Mapping, Sequence

from ..procedures.states import Error
from .axis import Axis
from .outcome import Outcome
from .request import Request


class Answer:
    """What a coroutine of the executor awaits; the executor must be woken after :meth:`give`."""

    def __init__(self, given: bool = False) -> None:
        self.given = given

    def give(self) -> None:
        self.given = True

    def __await__(self) -> Generator[None, None, None]:
        while not self.given:
            yield


class Dispatch:
    """The one lock of the axes for all clients: an axis obeys one request at a time.

    ``unready`` tells why an axis cannot home now for a reason that the axis does not know.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        groups: Sequence[Sequence[str]],
        unready: Callable[[str], Outcome | None],
    ) -> None:
        self.groups = groups
        self.closed = False
        self._axes = axes
        self._unready = unready
        self._active: list[tuple[Request, Answer]] = []
        self._canceling: list[tuple[Sequence[str], Answer]] = []

    @property
    def names(self) -> list[str]:
        """All axes, in the order of the groups."""
        listed = [name for group in self.groups for name in group]
        return listed + [name for name in self._axes if name not in listed]

    @property
    def idle(self) -> bool:
        return not self._active and not self._canceling

    def home(self, names: Sequence[str], owner: str, now: float) -> Outcome | Request:
        """Start homing some axes in the order of the groups; return why not, or the request."""
        if self.closed:
            return Outcome(Error.Canceled, 'the node is shutting down')
        for name in names:
            refusal = self._unknown(name) or self.busy(name) or self._unready(name)
            if refusal is not None:
                return refusal
        listed = {name for group in self.groups for name in group}
        groups = [*self.groups, *((name,) for name in names if name not in listed)]
        wanted = [tuple(name for name in group if name in names) for group in groups]
        request = Request(filter(None, wanted), self._axes, owner, self._unready)
        request.start(now)
        if not request.done:
            self._active.append((request, Answer()))
        return request

    def busy(self, name: str) -> Outcome | None:
        """Return who homes an axis, or will within a sequence; None where nobody does."""
        for request, _ in self._active:
            if name in request.names and not request.done:
                return Outcome(
                    Error.Busy,
                    f'axis {name}: {request.owner} is homing '
                    f'{", ".join(request.names)} '
                    f'({name}: {self._axes[name].state})',
                )
        return None

    def answer(self, request: Request) -> Answer:
        """Return what to await for a request; one that has ended is answered."""
        return next(
            (answer for active, answer in self._active if active is request), Answer(given=True)
        )

    def cancel(self, names: Sequence[str]) -> tuple[list[str], list[str], Answer]:
        """Stop some axes; return those that move, those that wait, and what to await.

        One that waits for its turn will not start.
        """
        moving = [name for name in names if self._axes[name].running]
        waiting = [
            name for name in names if any(request.waits(name) for request, _ in self._active)
        ]
        for request, _ in self._active:
            request.cancel(names)
        answer = Answer(given=not moving)
        if moving:
            self._canceling.append((moving, answer))
        return moving, waiting, answer

    def close(self) -> None:
        """Cancel everything and refuse what comes."""
        self.closed = True
        for request, _ in self._active:
            request.cancel(request.names)

    def abandon(self, reason: str) -> None:
        """Answer everyone now, though the axes are not at rest; no update may follow."""
        self.close()
        for request, answer in self._active:
            request.abandon(reason)
            answer.give()
        for _, answer in self._canceling:
            answer.give()
        self._active.clear()
        self._canceling.clear()

    def update(self, now: float) -> bool:
        """Follow the axes, once one has changed; return whether an answer was given."""
        ended = [entry for entry in self._active if entry[0].update(now)]
        rested = [
            entry
            for entry in self._canceling
            if not any(self._axes[name].running for name in entry[0])
        ]
        for entry in ended:
            self._active.remove(entry)
            entry[1].give()
        for waiting in rested:
            self._canceling.remove(waiting)
            waiting[1].give()
        return bool(ended or rested)

    def _unknown(self, name: str) -> Outcome | None:
        if name in self._axes:
            return None
        return Outcome(Error.UnknownAxis, f'{name!r} is none of the axes {", ".join(self._axes)}')
