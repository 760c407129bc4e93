# SPDX-License-Identifier: Apache-2.0
"""The executable `homing_coordinator`: homes the axes of many cells, in steps.

It moves nothing: it sends goals to the homing nodes of the cells, watches their states, cancels,
and keeps axes locked whose prerequisites do not hold (coordination/). Its action, services and
state topics are those of a homing node; an axis of it is `<cell>/<axis>`.
"""

import time
import uuid
from collections.abc import Callable
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.task import Future
from std_srvs.srv import Trigger

from ..coordination.coordinator import Coordinator
from ..coordination.health import health
from ..coordination.preview import Preview
from ..coordination.request import Request
from ..core.locks import REPEATED
from ..core.outcome import Outcome
from ..parameters.line import LINE_DEFINITIONS, cell_of, line
from ..procedures.states import Error
from . import cell_messages, process
from .axis_services import AxisServices, trigger
from .cell_link import CellLink
from .declaring_node import DeclaringNode
from .latched import latched_publisher
from .services import ACCEPTANCE
from .subscriptions import Subscriptions
from .waits import Waits

#: How often the cells are looked at, feedback is sent to goals, and diagnostics are published, s.
TICK, FEEDBACK, HEALTH = 0.05, 0.1, 1.0
#: Each so many feedbacks one is sent although nothing has changed: the coordinator lives.
BEAT = 10
#: Longest wait for a node to stop an axis, s.
STOP = 10.0
#: How long the process stays after its last answer, s.
LINGER = 0.2


class HomingCoordinator(DeclaringNode):
    """The coordinator. Raises InvalidParameters, with every fault, if the parameters are bad."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('homing_coordinator', **kwargs)
        self._core = Coordinator(line(self.given))
        self.describe_clock()
        self.declare(LINE_DEFINITIONS, self.given)
        self._group = ReentrantCallbackGroup()
        self._waits = Waits(self, self._group)
        self._states: dict[str, AxisState] = {}
        self._state_topics: dict[str, Any] = {}
        self._changed: dict[int, dict[str, AxisState]] = {}  # for the feedback of each goal
        self._goals: dict[int, tuple[Any, Request]] = {}
        self._dry_runs: list[Any] = []  # the goals that ask only
        self._feedbacks = 0
        self._by_id: dict[bytes, Request] = {}
        self._ends: list[tuple[Request | Preview, Future]] = []
        self._services_of_axes = AxisServices(self)
        identity, subscriptions = uuid.uuid4().hex, Subscriptions(self._services_of_axes.node)
        self._links = {
            cell: CellLink(
                self,
                self._core,
                cell,
                subscriptions,
                identity,
                self._add_axis,
                self._take_state,
                self._doubt,
                self._ask,
            )
            for cell in self._core.cells
        }
        for axis in self._core.line.axes:
            self._add_axis(axis)
        for name, answering in (
            ('~/home', partial(self._home, [], '~/home')),
            ('~/cancel', partial(self._cancel, '')),
        ):
            self.create_service(Trigger, name, trigger(answering), callback_group=self._group)
        self._action = ActionServer(
            self,
            Home,
            '~/home',
            self._execute,
            callback_group=self._group,
            handle_accepted_callback=self._accept,
            cancel_callback=self._cancel_goal,
        )
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TICK, self._tick, callback_group=self._group, clock=steady)
        self.create_timer(FEEDBACK, self._feedback, callback_group=self._group, clock=steady)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 1)
        self.create_timer(HEALTH, self._say_health, callback_group=self._group, clock=steady)

    def start(self) -> None:
        """Serve the axes; the node has its executor."""
        self._services_of_axes.start()

    def close(self) -> None:
        """End the thread."""
        self._services_of_axes.close()

    def stop(self) -> None:
        """Stop what this coordinator homes, and refuse what comes."""
        self._core.close(time.monotonic())
        self._ask()

    @property
    def finished(self) -> bool:
        """Whether every request has its answer."""
        return self._core.idle and not self._ends

    # ------------------------------------------------------------------------------ the cells

    def _add_axis(self, axis: str) -> None:
        """Serve an axis, and follow its states."""
        if axis in self._state_topics:
            return
        self._state_topics[axis] = latched_publisher(self, AxisState, f'~/{axis}/state')
        self._links[cell_of(axis)].watch(axis)
        serve = self._services_of_axes.serve
        serve(f'{axis}/home', partial(self._home, [axis], f'~/{axis}/home'))
        serve(f'{axis}/cancel', partial(self._cancel, axis))

    def _take_state(self, axis: str, state: AxisState) -> None:
        """Publish a state under the axis's name in the line, unless a newer one is known."""
        known, seen = self._states.get(axis), cell_messages.seen
        late = known is not None and seen(state).overtaken_by(seen(known))
        if late or axis not in self._state_topics:
            return
        state = self._states[axis] = cell_messages.of_line(axis, state)
        self._state_topics[axis].publish(state)
        for number, (_, request) in self._goals.items():
            if axis in request.turn_of:
                self._changed[number][axis] = state

    def _doubt(self, axis: str, why: Outcome) -> None:
        """Publish that nothing is known any more of an axis that had a state."""
        if axis in self._states:
            self._take_state(axis, cell_messages.doubted(self._states[axis], why))

    def _tick(self) -> None:
        now = time.monotonic()
        for link in self._links.values():
            link.poll(now)
        ended = self._core.tick(now)
        for link in self._links.values():
            link.say_locks(now, REPEATED)
        self._ask()
        for one, future in list(self._ends):
            if one in ended:
                self._ends.remove((one, future))
                future.set_result(None)

    def _say_health(self) -> None:
        foreign = {cell: link.foreign for cell, link in self._links.items()}
        entries = health(self._core, foreign, time.monotonic())
        stamp = self.get_clock().now().nanoseconds
        self._diagnostics.publish(
            cell_messages.diagnostics(stamp, self.get_fully_qualified_name(), entries)
        )

    def _ask(self) -> None:
        """Ask the cells what the core wants to know or to have."""
        while asks := self._core.take_asks():
            for ask in asks:
                self._links[ask.cell].ask(ask)

    def _end_of(self, one: Request | Preview) -> Future:
        """Return what is set when a request has ended."""
        future = self._waits.future()
        self._ends.append((one, future))
        self._ask()
        return future

    # --------------------------------------------------------------------------- the services

    async def _home(self, names: list[str], owner: str) -> tuple[bool, str]:
        """Home some axes, none for all; return how it ended."""
        begun = self._core.home(names, owner, time.monotonic())
        if isinstance(begun, Outcome):
            return False, f'{begun.error}: {begun.message}'
        await self._end_of(begun)
        success = all(one.success for one in begun.outcomes.values())
        return success, cell_messages.words(begun)

    async def _cancel(self, axis: str) -> tuple[bool, str]:
        """Stop an axis, '' for all; return when it rests.

        The nodes stop whatever homes there, also what this coordinator did not ask for.
        """
        names = [axis] if axis else list(self._state_topics)
        self._core.cancel(names, 'canceled', time.monotonic())
        self._ask()
        cells = [cell_of(axis)] if axis else list(self._links)
        name = f'{cell_messages.local(axis)}/cancel' if axis else 'cancel'
        sent = {cell: self._links[cell].trigger(name) for cell in cells}
        until = time.monotonic() + STOP
        while (now := time.monotonic()) < until and any(
            future is not None and not future.done() and not self._core.cells[cell].lost(now)
            for cell, future in sent.items()
        ):
            await self._waits.pause(TICK)
        said, lost = [], []
        for cell, future in sent.items():
            answered = future is not None and future.done()
            if answered and future.result().success:
                said.append(f'{cell}: {future.result().message}')
            else:
                lost.append(cell)
        if lost:
            text = f'{Error.CellLost}: no answer of {", ".join(lost)}; whether its axes rest '
            return False, '; '.join([f'{text}is not known', *said])
        return True, '; '.join(said)

    # ----------------------------------------------------------------------------- the action

    async def _accept(self, goal: Any) -> None:
        """Execute a goal once its client can have the acceptance (see Services.accept)."""
        await self._waits.pause(ACCEPTANCE)
        goal.execute()

    async def _execute(self, goal: Any) -> Home.Result:
        names, now = list(goal.request.axes), time.monotonic()
        if goal.request.dry_run:
            preview = self._core.preview(names, now, goal.request.force)
            self._dry_runs.append(goal)
            await self._end_of(preview)
            self._dry_runs.remove(goal)
            result = cell_messages.dry_run(preview, self._states)
            goal.succeed() if result.success else goal.abort()
            return result
        if goal.is_cancel_requested:
            goal.canceled()
            text = 'canceled before anything moved'
            return cell_messages.refusal(Outcome(Error.Canceled, text))
        begun = self._core.home(names, '~/home (action)', now, goal.request.force)
        if isinstance(begun, Outcome):
            goal.abort()
            return cell_messages.refusal(begun)
        key, number = bytes(goal.goal_id.uuid), id(begun)
        self._by_id[key], self._goals[number], self._changed[number] = begun, (goal, begun), {}
        await self._end_of(begun)
        for kept, one in ((self._by_id, key), (self._goals, number), (self._changed, number)):
            kept.pop(one, None)
        result = cell_messages.result(begun, self._states)
        if result.success:
            goal.succeed()
        elif goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        return result

    def _cancel_goal(self, goal: Any) -> CancelResponse:
        request = self._by_id.get(bytes(goal.goal_id.uuid))
        if request is not None:
            self._core.cancel(request.names, 'canceled', time.monotonic())
            self._ask()
        return CancelResponse.ACCEPT

    def _feedback(self) -> None:
        """Send each goal the states that have changed: a line may have hundreds of axes."""
        self._feedbacks += 1
        beat = self._feedbacks % BEAT == 0
        for goal in self._dry_runs if beat else ():
            goal.publish_feedback(Home.Feedback())
        for number, (goal, _) in list(self._goals.items()):
            changed, self._changed[number] = self._changed[number], {}
            if (changed or beat) and goal.is_active:
                come = [
                    self._links[cell_of(axis)].progress.get(axis, (0.0, 0.0)) for axis in changed
                ]
                goal.publish_feedback(
                    Home.Feedback(
                        states=list(changed.values()),
                        distance_traveled=[traveled for traveled, _ in come],
                        distance_bound=[bound for _, bound in come],
                    )
                )


def _end(node: HomingCoordinator, work: Callable[[], None]) -> None:
    """Stop what homes, and let the last answers leave."""
    node.stop()
    while not node.finished:
        work()
    end = time.monotonic() + LINGER
    while time.monotonic() < end:
        work()


def main(args: list[str] | None = None) -> int:
    """Run the coordinator until SIGINT or SIGTERM; return the exit status."""
    return process.run('homing_coordinator', HomingCoordinator, args, _end)
