"""Homing of several axes: groups in order, the axes of a group together.

One axis that fails stops its group; later groups are not started. A request for one axis is a
request of one group with one axis. No clock, no ROS: :meth:`Request.update` is called once a
cycle, after the axes.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence

from .axis import Axis, Outcome
from .states import Error


class Request:
    """One request: which axes, in which groups, and how each of them ended.

    ``unready`` tells why an axis cannot home now for a reason that the axis does not know.
    """

    def __init__(
        self,
        groups: Iterable[Sequence[str]],
        axes: Mapping[str, Axis],
        owner: str,
        unready: Callable[[str], Outcome | None],
    ) -> None:
        self.groups = [tuple(group) for group in groups]
        self.owner = owner
        self.outcomes: dict[str, Outcome] = {}
        self._axes, self._unready = axes, unready
        self._waiting = list(self.groups)
        self._running: tuple[str, ...] = ()

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

    def start(self, now: float) -> None:
        """Start the first group."""
        self._start_next(now)

    def cancel(self) -> None:
        """Stop what runs; later groups are not started."""
        for name in self._running:
            self._axes[name].cancel()
        self._drop_waiting(Error.Canceled, 'not started: the request was canceled')

    def abandon(self, reason: str) -> None:
        """Take what still runs for canceled, for a reason."""
        for name in self._running:
            self.outcomes[name] = Outcome(Error.Canceled, f'axis {name}: {reason}')
        self._running = ()

    def update(self, now: float) -> bool:
        """Follow the axes; return whether the whole request has ended."""
        ended = [name for name in self._running if not self._axes[name].running]
        for name in ended:
            self.outcomes[name] = self._axes[name].outcome
            if not self.outcomes[name].success:
                self._stop_for(name)
        if ended:
            self._running = tuple(name for name in self._running if name not in ended)
            if not self._running:
                self._start_next(now)
        return self.done

    def _start_next(self, now: float) -> None:
        while self._waiting and not self._running:
            group = self._waiting.pop(0)
            refusals = {name: self._unready(name) or self._axes[name].refusal(now)
                        for name in group}
            refused = [name for name, refusal in refusals.items() if refusal is not None]
            for name in group:
                refusal = refusals[name]
                if refusal is not None:
                    self.outcomes[name] = refusal
                elif refused:
                    self.outcomes[name] = self._not_run(name, refused[0])
                else:
                    self._axes[name].home(now)
            if refused:
                self._stop_for(refused[0])
            else:
                self._running = group

    def _stop_for(self, failed: str) -> None:
        """Stop the rest because an axis failed."""
        for name in self._running:
            self._axes[name].cancel()
        self._drop_waiting(Error.Canceled, f'not started: axis {failed} failed')

    def _drop_waiting(self, error: Error, reason: str) -> None:
        for group in self._waiting:
            for name in group:
                self.outcomes[name] = Outcome(error, f'axis {name}: {reason}')
        self._waiting.clear()

    @staticmethod
    def _not_run(name: str, failed: str) -> Outcome:
        return Outcome(Error.Canceled, f'axis {name}: not started: axis {failed} was refused')
