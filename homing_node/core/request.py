# SPDX-License-Identifier: Apache-2.0
"""Homing of several axes: the groups one after another, the axes of a group together.

If one axis fails, is refused or is canceled, its group stops and the later groups do not start. A
request for one axis has one group with one axis. A group whose axes are not ready yet waits: for
`rest_timeout` if an axis moves, for `ready_timeout` if inputs or a controller are missing.
:meth:`Request.update` is called after the axes, in each cycle in which a run has ended or a
request is :attr:`~Request.pending`.
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence

from ..procedures.states import Error
from .axis import Axis
from .jog import Jog
from .outcome import Outcome

#: What a request waits for: inputs, and a controller, that are not there yet.
MISSING = (Error.FeedbackStale, Error.SwitchUnknown, Error.NoController)


def may_pass(refusal: Outcome) -> bool:
    """Return whether waiting may end what forbids a run."""
    return refusal.error in MISSING and not refusal.final


class Request:
    """One request of a client: its axes in groups, and how each of them ended.

    Attributes:
        groups: the names of the axes, in the order of the groups.
        owner: who has asked, for messages.
        outcomes: how the run of each axis ended, by name.
    """

    def __init__(
        self,
        groups: Iterable[Sequence[str]],
        axes: Mapping[str, Axis],
        owner: str,
        unready: Callable[[str], Outcome | None],
        ready_timeout: float = 0.0,
        verify: bool = False,
        jog: Jog | None = None,
    ) -> None:
        self.groups = [tuple(group) for group in groups]
        self.owner = owner
        self.outcomes: dict[str, Outcome] = {}
        self._axes, self._unready = axes, unready
        self._ready_timeout = ready_timeout
        self._verify = verify  # the homes are only compared
        self._jog = jog  # the axes do not home, they jog
        self._since: float | None = None  # a group waits until it is ready
        self._waiting = list(self.groups)
        self._running: tuple[str, ...] = ()
        self._canceled: set[str] = set()

    @property
    def names(self) -> tuple[str, ...]:
        """All axes of the request, in order."""
        return tuple(name for group in self.groups for name in group)

    @property
    def done(self) -> bool:
        return not self._waiting and not self._running

    @property
    def success(self) -> bool:
        return self.done and all(outcome.success for outcome in self.outcomes.values())

    @property
    def pending(self) -> bool:
        """Whether the next group waits until its axes are ready: call update in each cycle."""
        return self._since is not None

    def waits(self, name: str) -> bool:
        """Return whether an axis still waits for its turn."""
        return any(name in group for group in self._waiting)

    def start(self, now: float) -> None:
        """Start the first group."""
        self._start_next(now)

    def cancel(self, names: Collection[str]) -> None:
        """Stop the named axes that run, and refuse the ones that wait when their turn comes."""
        self._canceled.update(names)
        for name in self._running:
            if name in names:
                self._axes[name].cancel()

    def abandon(self, reason: str) -> None:
        """Mark every axis that has not ended as canceled, with a reason."""
        for name in self.names:
            self.outcomes.setdefault(name, self._cancellation(name, reason))
        self._waiting.clear()
        self._running, self._since = (), None

    def update(self, now: float) -> bool:
        """Record the runs that have ended; return whether the whole request has ended."""
        ended = [name for name in self._running if not self._axes[name].running]
        for name in ended:
            self.outcomes[name] = self._axes[name].ended
            if not self.outcomes[name].success:
                self._stop_for(name)
        if ended:
            self._running = tuple(name for name in self._running if name not in ended)
            if not self._running:
                self._start_next(now)
        elif self.pending:
            self._start_next(now)
        return self.done

    def _start_next(self, now: float) -> None:
        if not self._waiting:
            return
        group = self._waiting[0]
        refusals = {
            name: refusal for name in group if (refusal := self._refusal(name, now)) is not None
        }
        if self._since is None:
            self._since = now
        waited = now - self._since
        if refusals and all(waited < self._patience(*refusal) for refusal in refusals.items()):
            return
        self._since = None
        if refusals:
            for name, refusal in refusals.items():
                text = refusal.message
                if waited:
                    text += f', after waiting for {waited:.3g} s'
                self.outcomes[name] = refusal._replace(message=text)
            self._stop_for(next(iter(refusals)))
            return
        del self._waiting[0]
        self._running = group
        for name in group:
            axis = self._axes[name]
            axis.jog(now, self._jog) if self._jog else axis.home(now, self._verify)

    def _refusal(self, name: str, now: float) -> Outcome | None:
        if name in self._canceled:
            return self._cancellation(name, 'not started: canceled')
        axis = self._axes[name]
        if self._jog:
            return self._unready(name) or axis.jog_refusal(now, self._jog)
        return self._unready(name) or axis.refusal(now, self._verify)

    def _patience(self, name: str, refusal: Outcome) -> float:
        """Return how long to wait until what forbids a run has passed, s."""
        if refusal.error is Error.AxisMoving:
            return self._axes[name].parameters.rest_timeout
        return self._ready_timeout if may_pass(refusal) else 0.0

    def _stop_for(self, failed: str) -> None:
        """Stop the axes that run and start no others, because an axis was not homed."""
        for name in self._running:
            self._axes[name].cancel()
        reason = f'axis {failed} was not homed ({self.outcomes[failed].error})'
        for name in (name for group in self._waiting for name in group):
            why = 'canceled' if name in self._canceled else reason
            self.outcomes.setdefault(name, self._cancellation(name, f'not started: {why}'))
        self._waiting.clear()

    @staticmethod
    def _cancellation(name: str, reason: str) -> Outcome:
        return Outcome(Error.Canceled, f'axis {name}: {reason}')
