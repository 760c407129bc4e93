# SPDX-License-Identifier: Apache-2.0
"""The servers of the node's services and of its action.

Every callback is short, or a coroutine that awaits a future, so that the executor goes on
answering. The cycle decides when a wait ends; a callback of the executor sets the future.
``lock`` guards the axes.
"""

import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from homing_interfaces.action import Home
from rclpy.task import Future
from std_srvs.srv import SetBool, Trigger

from ..core.axis import Axis
from ..core.dispatch import Dispatch
from ..core.jog import Jog
from ..core.outcome import Outcome
from ..core.request import Request
from ..memory.expected import longest
from ..procedures.states import Error
from . import messages
from .memory import Memories
from .rehearsals import Rehearsals
from .reports import Reports
from .timebase import TimeBase

#: How much later than its acceptance a goal is executed, s.
ACCEPTANCE = 0.1


class Started(NamedTuple):
    """A request that was started.

    Attributes:
        owner: Who asked, for the log.
        request: The request.
        future: What to await its end with; None: it has ended.
        runs: How many runs of each axis had ended before.
    """

    owner: str
    request: Request
    future: Future | None
    runs: Mapping[str, int]


class Services:
    """Makes the servers; the node gives each of them its name.

    ``poll`` gives the axes the messages that have arrived: a message that was sent before a
    request counts before it. ``pause`` returns a future that is set after a time, s. ``open`` is
    the number of requests that wait for their answer.
    """

    def __init__(
        self,
        dispatch: Dispatch[Future],
        reports: Reports,
        timebase: TimeBase,
        lock: threading.Lock,
        poll: Callable[[], None],
        pause: Callable[[float], Future],
        memories: Memories,
        rehearsals: Rehearsals,
        logger: Any,
    ) -> None:
        self._dispatch, self._reports = dispatch, reports
        self._timebase, self._lock, self._poll = timebase, lock, poll
        self._pause, self._memories, self._logger = pause, memories, logger
        self._rehearsals = rehearsals
        self._goals: dict[bytes, Request] = {}
        self.open = 0

    def home(self, names: Sequence[str], owner: str, verify: bool = False) -> Any:
        """Return a server that homes some axes, or verifies, and answers when they have ended."""

        async def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            outcomes = await self._home(names, owner, verify=verify)
            response.success = all(outcome.success for outcome in outcomes.values())
            response.message = messages.home_message(outcomes)
            return response

        return serve

    def cancel(self, names: Sequence[str]) -> Any:
        """Return a server that stops some axes and answers when they are at rest."""

        async def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            with self._lock:
                moving, waiting, future = self._dispatch.cancel(names)
            self._logger.info(f'asked to cancel {", ".join(names)}')
            await self.wait(future)
            response.success = True
            response.message = messages.cancel_message(moving, waiting)
            return response

        return serve

    def resume(self, axis: Axis) -> Any:
        """Return a server that leaves the pause of an axis."""

        def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            with self._lock:
                response.success = axis.paused
                axis.resume()
            response.message = '' if response.success else f'axis {axis.name} is not paused'
            goes_on = f'axis {axis.name} goes on'
            self._logger.info(f'asked to continue: {response.message or goes_on}')
            return response

        return serve

    def servo(self, axis: Axis) -> Any:
        """Return a server that sets the servo that the node asks for."""

        def serve(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
            with self._lock:
                axis.set_servo(bool(request.data))
                self._reports.report(axis)  # off and on again within one cycle are two messages
            response.success = True
            response.message = f'servo_on of axis {axis.name}: {str(axis.servo_on).lower()}'
            self._logger.info(f'asked: {response.message}')
            return response

        return serve

    def accept_home(self, axis: Axis) -> Any:
        """Return a server that accepts a home that has moved."""

        def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            with self._lock:
                if axis.running:
                    response.message = f'{Error.Busy}: axis {axis.name} is homing ({axis.state})'
                    return response
                accepted = self._memories.accept(axis)
                self._reports.report(axis)
            response.success = bool(accepted)
            nothing = f'{Error.NotHomed}: axis {axis.name} has found no home that can be accepted'
            response.message = accepted or nothing
            self._logger.info(f'asked to accept the home of axis {axis.name}: {response.message}')
            return response

        return serve

    async def accept(self, goal: Any) -> None:
        """Execute a goal once its client can have the acceptance.

        rclpy's client drops a status that comes before the acceptance, and `ros2 action send_goal`
        cancels at Ctrl-C only a goal whose status it knows. The two take different ways, so the
        status EXECUTING leaves later. A dry run ends at once: nobody cancels it.
        """
        if not getattr(goal.request, 'dry_run', False):
            await self.wait(self._pause(ACCEPTANCE))
        goal.execute()

    async def execute(self, goal: Any) -> Home.Result:
        """Run a goal of the action; a refused goal is aborted, and its result says why."""
        names = list(dict.fromkeys(goal.request.axes)) or self._dispatch.names
        return await self._execute(goal, names, '~/home (action)', False)

    def verify(self, name: str) -> Any:
        """Return what runs a goal that verifies the home of an axis."""

        async def execute(goal: Any) -> Home.Result:
            names = list(dict.fromkeys([name, *goal.request.axes]))
            return await self._execute(goal, names, f'~/{name}/verify (action)', True)

        return execute

    async def _execute(
        self, goal: Any, names: Sequence[str], owner: str, verify: bool
    ) -> Home.Result:
        if goal.request.dry_run:
            return self._preview(goal, names)
        key = bytes(goal.goal_id.uuid)
        self._reports.follow(goal, names)
        outcomes = await self._home(names, owner, key, goal.is_cancel_requested, verify)
        self._reports.unfollow(goal)
        canceled = goal.is_cancel_requested
        self._goals.pop(key, None)
        success = all(outcome.success for outcome in outcomes.values())
        if success:
            goal.succeed()
        elif canceled:
            goal.canceled()
        else:
            goal.abort()
        with self._lock:
            states = self._reports.states(names)
            steps = self._dispatch.grouped(names)
        failure = messages.first_failure(outcomes)
        return Home.Result(
            success=success,
            message=messages.home_message(outcomes),
            error_code=0 if failure is None else messages.ERROR_CODES[failure.error],
            states=states,
            steps=[', '.join(group) for group in steps],
        )

    def _preview(self, goal: Any, names: Sequence[str]) -> Home.Result:
        """Answer what a goal would do; nothing moves."""
        with self._lock:
            self._poll()
            self._memories.look()
            run = self._dispatch.preview(names, self._timebase.polled)
            durations = [longest([*map(self._rehearsals.expected, group)]) for group in run.groups]
            unknown = self._rehearsals.unknown([name for group in run.groups for name in group])
            states = self._reports.states(names)
        if run.missing:
            goal.abort()
        else:
            goal.succeed()
        return messages.dry_run(run, durations, unknown, states)

    def cancel_goal(self, goal: Any) -> None:
        """Stop what a goal homes; its result comes when its axes are at rest."""
        with self._lock:
            request = self._goals.get(bytes(goal.goal_id.uuid))
            if request is not None:
                request.cancel(request.names)

    async def _home(
        self,
        names: Sequence[str],
        owner: str,
        key: bytes = b'',
        canceled: bool = False,
        verify: bool = False,
    ) -> dict[str, Outcome]:
        """Home some axes and return how each of them ended, or by '' why none was started."""
        if canceled:
            return {'': Outcome(Error.Canceled, 'canceled before anything moved')}
        started = self.start(names, owner, verify)
        if isinstance(started, Outcome):
            return {'': started}
        if key:
            self._goals[key] = started.request
        return await self.ended(started)

    def start(
        self, names: Sequence[str], owner: str, verify: bool = False, jog: Jog | None = None
    ) -> 'Outcome | Started':
        """Start homing, or a jog; return why not, or what was started.

        The executor runs this, and cancels: no cancel can come between this and its answer.
        """
        with self._lock:
            self._poll()
            self._memories.look()
            started = self._dispatch.home(names, owner, self._timebase.polled, verify, jog)
            if isinstance(started, Outcome):
                self._logger.warning(f'{owner} refused: {started.error}: {started.message}')
                return started
            runs = self._reports.runs(started.names)
            future = self._dispatch.waiter(started)
        self._logger.info(f'{owner} asked for {", ".join(started.names)}')
        return Started(owner, started, future, runs)

    async def ended(self, started: 'Started') -> dict[str, Outcome]:
        """Wait for the end of a request; return how it has ended for each of its axes."""
        owner, request, future, runs = started
        await self.wait(future)
        outcomes = {name: request.outcomes[name] for name in request.names}
        with self._lock:
            after = self._reports.runs(request.names)
        for name, outcome in outcomes.items():
            if not outcome.success and after[name] == runs[name]:  # no run tells it
                self._logger.warning(f'{owner} refused: {outcome.error}: {outcome.message}')
        return outcomes

    async def wait(self, future: Future | None) -> None:
        """Wait for a future, if there is anything to wait for."""
        if future is None:
            return
        self.open += 1
        try:
            await future
        finally:
            self.open -= 1
