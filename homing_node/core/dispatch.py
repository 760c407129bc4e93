# SPDX-License-Identifier: Apache-2.0
"""Requests from clients to axes: who homes what, and who waits for which answer.

No ROS: the shell says what a client waits with (a future of its executor, say), and gets back
those whose wait has ended.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Generic, NamedTuple, TypeVar

from ..procedures.states import Error
from .axis import Axis
from .jog import Jog
from .outcome import Outcome
from .request import Request, may_pass

#: What a client waits with.
Waiter = TypeVar('Waiter')


CLOSED = 'the node is shutting down'


class DryRun(NamedTuple):
    """What a request would do: the axes in their groups, and what would refuse which axis."""

    groups: list[tuple[str, ...]]
    missing: list[tuple[str, Outcome]]


class Dispatch(Generic[Waiter]):
    """The one lock of the axes for all clients: an axis obeys one request at a time.

    ``unready`` returns why an axis cannot home now for a reason that the axis does not know, else
    None. ``new_waiter`` makes what one client waits with. ``ready_timeout`` is how long a request
    waits for missing inputs, s.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        groups: Sequence[Sequence[str]],
        unready: Callable[[str], Outcome | None],
        new_waiter: Callable[[], Waiter],
        ready_timeout: float = 0.0,
    ) -> None:
        self.groups = groups
        self.closed = False
        self.ready_timeout = ready_timeout
        self._axes = axes
        self._unready = unready
        self._new_waiter = new_waiter
        self._active: list[tuple[Request, Waiter]] = []
        self._canceling: list[tuple[Sequence[str], Waiter]] = []

    @property
    def names(self) -> list[str]:
        """All axes, in the order of the groups."""
        listed = [name for group in self.groups for name in group]
        return listed + [name for name in self._axes if name not in listed]

    @property
    def pending(self) -> bool:
        """Whether a request waits until its axes are ready: call update in each cycle."""
        return any(request.pending for request, _ in self._active)

    @property
    def idle(self) -> bool:
        return not self._active and not self._canceling

    def home(
        self,
        names: Sequence[str],
        owner: str,
        now: float,
        verify: bool = False,
        jog: Jog | None = None,
    ) -> Outcome | Request:
        """Start homing some axes in the order of the groups; return why not, or the request.

        With ``verify`` their homes are only compared with what is found again. With ``jog`` they
        do not home, they jog.
        """
        if self.closed:
            return Outcome(Error.Canceled, CLOSED)
        for name in names:
            refusal = self._unknown(name) or self.busy(name) or self._unready(name)
            if refusal is None or (self.ready_timeout and may_pass(refusal)):
                continue
            return refusal
        request = Request(
            self.grouped(names), self._axes, owner, self._unready, self.ready_timeout, verify, jog
        )
        request.start(now)
        if not request.done:
            self._active.append((request, self._new_waiter()))
        return request

    def preview(self, names: Sequence[str], now: float) -> DryRun:
        """Return what homing some axes would do now; nothing moves."""
        missing: list[tuple[str, Outcome]] = []
        if self.closed:
            missing.append(('', Outcome(Error.Canceled, CLOSED)))
        for name in names:
            refusal = self._unknown(name)
            if refusal is None:
                refusal = self.busy(name) or self._unready(name)
                refusal = refusal or self._axes[name].refusal(now)
            if refusal is not None:
                missing.append((name, refusal))
        known = [name for name in names if name in self._axes]
        return DryRun(self.grouped(known), missing)

    def grouped(self, names: Sequence[str]) -> list[tuple[str, ...]]:
        """Return some axes in the order of the groups; those in no group follow, one by one."""
        listed = {name for group in self.groups for name in group}
        groups = [*self.groups, *((name,) for name in names if name not in listed)]
        wanted = [tuple(name for name in group if name in names) for group in groups]
        return [group for group in wanted if group]

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

    def waiter(self, request: Request) -> Waiter | None:
        """Return what to wait with for the end of a request; None if it has ended."""
        return next((waiter for active, waiter in self._active if active is request), None)

    def cancel(self, names: Sequence[str]) -> tuple[list[str], list[str], Waiter | None]:
        """Stop some axes; return those that move, those that wait, and what to wait with.

        An axis that waits for its turn will not start. None: nothing moves, nothing to wait for.
        """
        moving = [name for name in names if self._axes[name].running]
        waiting = [
            name for name in names if any(request.waits(name) for request, _ in self._active)
        ]
        for request, _ in self._active:
            request.cancel(names)
        if not moving:
            return moving, waiting, None
        waiter = self._new_waiter()
        self._canceling.append((moving, waiter))
        return moving, waiting, waiter

    def close(self) -> None:
        """Cancel everything and refuse what comes."""
        self.closed = True
        for request, _ in self._active:
            request.cancel(request.names)

    def abandon(self, reason: str) -> list[Waiter]:
        """End every wait, though the axes are not at rest; no update may follow."""
        self.close()
        for request, _ in self._active:
            request.abandon(reason)
        ended = [waiter for _, waiter in [*self._active, *self._canceling]]
        self._active.clear()
        self._canceling.clear()
        return ended

    def update(self, now: float) -> list[Waiter]:
        """Follow the axes, once one has changed; return the waiters whose wait has ended."""
        ended = [entry for entry in self._active if entry[0].update(now)]
        rested = [
            entry
            for entry in self._canceling
            if not any(self._axes[name].running for name in entry[0])
        ]
        for entry in ended:
            self._active.remove(entry)
        for waiting in rested:
            self._canceling.remove(waiting)
        return [waiter for _, waiter in [*ended, *rested]]

    def _unknown(self, name: str) -> Outcome | None:
        if name in self._axes:
            return None
        for axis in self._axes.values():
            for follower in list(axis.drives)[1:]:
                if name in (follower, follower.partition('.')[2]):
                    text = f'{name!r} is a follower of the gantry {axis.name}: home {axis.name}'
                    return Outcome(Error.UnknownAxis, text)
        return Outcome(Error.UnknownAxis, f'{name!r} is none of the axes {", ".join(self._axes)}')
