# SPDX-License-Identifier: Apache-2.0
"""The coordinator's side of one cell: goals, checks and cancels out, states and answers in.

Nothing blocks: an answer comes to a callback of the executor. States and claims are polled, for an
executor rebuilds its wait set at every message (doc/decisions/0002-polled-inputs.md).
"""

import math
import os
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger
from unique_identifier_msgs.msg import UUID

from ..coordination.coordinator import Coordinator
from ..coordination.turn import Ask, Checked
from ..coordination.turn_table import Asks
from ..core.outcome import Outcome
from ..procedures.states import Error
from . import cell_messages
from .adapting import mismatch
from .latched import latched_publisher
from .polling import Take, taker, waiting
from .subscriptions import Subscriptions, qos

#: How often it is looked whether a node has our messages, and whether it must be asked for its
#: axes, s.
LOOK_PERIOD = 1.0
STATE_TYPE = 'homing_interfaces/msg/AxisState'
#: A check waits so long for the node to be there, s.
HELD = 5.0
#: So many goals that were given up are remembered, so that a late acceptance is noticed.
GOALS = 2000


class CellLink:
    """Talks with the homing node of one cell.

    ``progress`` is how far each axis has come in its search, and the bound of it, m or rad.
    ``foreign`` is why the messages of the node cannot be relied on, '' if they can.
    """

    def __init__(
        self,
        node: Node,
        core: Coordinator,
        cell: str,
        subscriptions: Subscriptions,
        identity: str,
        new_axis: Callable[[str], None],
        on_state: Callable[[str, AxisState], None],
        on_unknown: Callable[[str, Outcome], None],
        on_event: Callable[[], None],
    ) -> None:
        """Make the clients.

        Args:
            node: The node of the coordinator.
            core: What gets the events.
            cell: The name of the cell.
            subscriptions: Makes the subscriptions that are polled.
            identity: What tells this process from other coordinators.
            new_axis: Called with each axis that the cell turns out to have.
            on_state: Called with each state of an axis, and with the axis's name in the line.
            on_unknown: Called with an axis of which nothing is known any more, and why.
            on_event: Called after each event.
        """
        self._node, self._core, self._cell, self._identity = node, core, cell, identity
        self._subscriptions, self._new_axis = subscriptions, new_axis
        self._on_state, self._on_unknown, self._on_event = on_state, on_unknown, on_event
        self.target = core.cells[cell].node
        self._client = ActionClient(node, Home, f'{self.target}/home')
        self._cancel = node.create_client(CancelGoal, f'{self.target}/home/_action/cancel_goal')
        self._parameters = node.create_client(GetParameters, f'{self.target}/get_parameters')
        self._triggers: dict[str, Any] = {}
        self._locks = latched_publisher(node, DiagnosticStatus, f'{self.target}/locks')
        claims = subscriptions.subscribe(
            DiagnosticStatus, f'{self.target}/locks', qos(latched=True, depth=10), False
        )
        self._claims = taker(claims, False)
        self._states: dict[str, tuple[Any, Take]] = {}
        self._sequence: dict[str, int] = {}  # of the newest state of each axis
        self.progress: dict[str, tuple[float, float]] = {}
        self._ids: dict[int, UUID] = {}
        self._handles: dict[int, Any] = {}
        self._held: list[tuple[Ask, float]] = []
        self._looked = -math.inf
        self._lost = False
        self.foreign = ''
        self._said: tuple[float, Mapping[str, str]] = (-math.inf, {})

    def watch(self, axis: str) -> None:
        """Read the states of an axis from now on."""
        if axis not in self._states:
            topic = f'{self.target}/{cell_messages.local(axis)}/state'
            made = self._subscriptions.subscribe(
                AxisState, topic, qos(latched=True, depth=20), False
            )
            self._states[axis] = made, taker(made, True)

    # ------------------------------------------------------------------------------ the rhythm

    def poll(self, now: float) -> None:
        """Take what has arrived, and send what had to wait."""
        if now - self._looked > LOOK_PERIOD:
            self._looked = now
            self._look(now)
        for axis, (_, take) in self._states.items():
            for data, info in waiting(take):
                if not self.foreign:
                    state = deserialize_message(data, AxisState)
                    self._take_state(axis, state, int(info['publication_sequence_number']), now)
        for claim, _ in waiting(self._claims):
            if claim.hardware_id != self._identity:
                self._core.claims.take(claim.hardware_id, claim.name, now)
        self._watch_loss(now)
        held, self._held = self._held, []
        for ask, until in held:
            if now < until:
                self._check(ask, until)

    def say_locks(self, now: float, period: float) -> None:
        """Publish the locks of the cell if they have changed, and now and then."""
        locks = self._core.locks(self._cell, now)
        said, before = self._said
        if locks == before and now - said < period:
            return
        self._said = now, locks
        values = [KeyValue(key=cell_messages.local(a), value=why) for a, why in locks.items()]
        self._locks.publish(
            DiagnosticStatus(
                name=self._node.get_fully_qualified_name(),
                hardware_id=self._identity,
                values=values,
            )
        )

    # ------------------------------------------------------------------------------- questions

    def ask(self, ask: Ask) -> None:
        """Ask something of the cell."""
        if ask.kind is Asks.Check:
            self._check(ask, time.monotonic() + HELD)
        elif ask.kind is Asks.Goal:
            self._send(ask)
        elif ask.kind is Asks.Result and ask.number in self._handles:
            self._await_result(ask.number, self._handles[ask.number])
        elif ask.kind is Asks.Cancel and ask.number in self._ids:
            request = CancelGoal.Request()
            request.goal_info.goal_id = self._ids[ask.number]
            self._cancel.call_async(request)

    def trigger(self, name: str) -> Any:
        """Call a Trigger service of the node; return the future, None if nobody serves it."""
        if name not in self._triggers:
            self._triggers[name] = self._node.create_client(Trigger, f'{self.target}/{name}')
        client = self._triggers[name]
        return client.call_async(Trigger.Request()) if client.service_is_ready() else None

    # ---------------------------------------------------------------------------------- inside

    def _take_state(self, axis: str, state: AxisState, sequence: int, now: float) -> None:
        if sequence < self._sequence.get(axis, 0):
            self._sequence.clear()
            self._core.restarted(self._cell, now)
        self._sequence[axis] = sequence
        self._core.state(axis, cell_messages.seen(state), now)
        self._on_state(axis, state)

    def _watch_loss(self, now: float) -> None:
        """Say once that nothing is known of the axes of a cell that is lost."""
        lost = self._core.cells[self._cell].lost(now)
        if lost and not self._lost:
            text = f'{self.target} is silent; what the axis does is not known'
            for axis in self._states:
                self._on_unknown(axis, Outcome(Error.CellLost, text))
        self._lost = lost

    def _look(self, now: float) -> None:
        """See whether the node has our messages; ask for its axes if they may have changed."""
        self.foreign = self._other_messages()
        cell = self._core.cells[self._cell]
        if (cell.axes is None or cell.lost(now)) and self._parameters.service_is_ready():
            self._ask_axes()

    def _other_messages(self) -> str:
        """Return how the node's states differ from ours; all its axes have the same type."""
        axes = self._core.cells[self._cell].axes or tuple(self._states)
        made, _ = self._states.get(axes[0], (None, None)) if axes else (None, None)
        if made is None:
            return ''
        own = self._subscriptions.asked(made.topic_name, STATE_TYPE)
        return '' if own is None else mismatch(self._subscriptions.offers(made.topic_name), own)

    def _ask_axes(self) -> None:
        def take(future: Any) -> None:
            answer = future.result()
            if answer is not None and answer.values:
                names = [
                    cell_messages.full(self._cell, name)
                    for name in answer.values[0].string_array_value
                ]
                self._core.axes(self._cell, names)
                for name in names:
                    self._new_axis(name)
                for axis in self._states:
                    if axis not in names:
                        text = f'{self.target} has no such axis'
                        self._on_unknown(axis, Outcome(Error.UnknownAxis, text))

        self._parameters.call_async(GetParameters.Request(names=['axes'])).add_done_callback(take)

    def _check(self, ask: Ask, until: float) -> None:
        """Send a dry run; one of a node that is not there yet waits."""
        if self.foreign or not self._client.server_is_ready():
            self._held.append((ask, until))
            return
        names = [cell_messages.local(axis) for axis in ask.axes]
        goal = Home.Goal(axes=names, dry_run=True)

        def accepted(future: Any) -> None:
            handle = future.result()
            if handle.accepted:
                handle.get_result_async().add_done_callback(answered)

        def answered(future: Any) -> None:
            response = future.result()
            if response.status not in (GoalStatus.STATUS_SUCCEEDED, GoalStatus.STATUS_ABORTED):
                return
            answer: Checked = cell_messages.checked(self._cell, ask.axes, response.result)
            self._core.checked(ask.number, self._cell, answer, time.monotonic())
            self._on_event()

        self._client.send_goal_async(goal).add_done_callback(accepted)

    def _send(self, ask: Ask) -> None:
        """Send a goal. To a node that is not there none is sent: its turn ends by itself."""
        if not self._client.server_is_ready():
            return
        number = ask.number
        self._ids[number] = UUID(uuid=list(os.urandom(16)))
        for old in list(self._ids)[:-GOALS]:
            del self._ids[old]
        goal = Home.Goal(axes=[cell_messages.local(ask.axes[0])])
        sent = self._client.send_goal_async(
            goal, partial(self._under_way, number, ask.axes[0]), self._ids[number]
        )
        sent.add_done_callback(partial(self._accepted, number))

    def _under_way(self, number: int, axis: str, message: Any) -> None:
        told = message.feedback
        if told.distance_traveled and told.distance_bound:
            self.progress[axis] = told.distance_traveled[0], told.distance_bound[0]
        self._core.under_way(number, time.monotonic())

    def _accepted(self, number: int, future: Any) -> None:
        handle, now = future.result(), time.monotonic()
        if handle.accepted:
            self._handles[number] = handle
            self._await_result(number, handle)
            self._core.accepted(number, now)
        else:
            text = f'{self.target} has rejected the goal'
            self._core.refused(number, Outcome(Error.InternalError, text), now)
        self._on_event()

    def _await_result(self, number: int, handle: Any) -> None:
        def take(future: Any) -> None:
            response, now = future.result(), time.monotonic()
            self._handles.pop(number, None)
            if response.status == GoalStatus.STATUS_UNKNOWN:
                self._core.gone(number, now)
            else:
                result = response.result
                outcome = cell_messages.outcome(self._cell, result)
                last = cell_messages.seen(result.states[0]) if result.states else None
                for state in result.states:  # its topic may bring it later
                    self._on_state(cell_messages.full(self._cell, state.axis), state)
                self._core.result(number, outcome, now, last)
            self._on_event()

        handle.get_result_async().add_done_callback(take)
