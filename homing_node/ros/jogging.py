# SPDX-License-Identifier: Apache-2.0
"""The action `~/jog`: one axis moves by a distance, as long as a deadman is held if one is wanted.

``lock`` guards the axes. The executor runs all of this; the cycle ends a jog in time even where
the executor is late (Axis.deadman).
"""

import threading
from collections.abc import Callable
from typing import Any

from homing_interfaces.action import Jog
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Bool

from ..core import jog as core
from ..core.axis import Axis
from ..core.outcome import Outcome
from ..core.request import Request
from ..procedures.states import Error
from . import messages
from .reports import Reports
from .services import Services
from .timebase import TimeBase

#: How long a goal waits for the first true of its deadman, and how often it looks, s.
DEADMAN_PATIENCE, DEADMAN_LOOK = 2.0, 0.02


class Jogs:
    """Serves the action."""

    def __init__(
        self,
        node: Node,
        axes: dict[str, Axis],
        services: Services,
        reports: Reports,
        timebase: TimeBase,
        lock: threading.Lock,
        pause: Callable[[float], Future],
        group: CallbackGroup,
    ) -> None:
        """Create the server of the action; the parts are those of the node."""
        self._node, self._axes = node, axes
        self._services, self._reports, self._timebase = services, reports, timebase
        self._lock, self._pause, self._group = lock, pause, group
        self._canceled: set[bytes] = set()
        self._requests: dict[bytes, Request] = {}
        self._held: dict[str, float] = {}  # when a deadman was held last, by axis, s
        self.server = ActionServer(
            node,
            Jog,
            '~/jog',
            self._execute,
            callback_group=group,
            handle_accepted_callback=services.accept,
            cancel_callback=self._cancel,
        )

    def _cancel(self, goal: Any) -> CancelResponse:
        key = bytes(goal.goal_id.uuid)
        self._canceled.add(key)
        with self._lock:
            request = self._requests.get(key)
            if request is not None:
                request.cancel(request.names)
        return CancelResponse.ACCEPT

    async def _execute(self, goal: Any) -> Jog.Result:
        wanted, key = goal.request, bytes(goal.goal_id.uuid)
        name = wanted.axis
        jog = core.Jog(float(wanted.distance), float(wanted.velocity), bool(wanted.deadman))
        if name not in self._axes:
            text = f'{name!r} is none of the axes {", ".join(self._axes)}'
            outcome = Outcome(Error.UnknownAxis, text)
        else:
            self._reports.follow(goal, [name], messages.jog_feedback)
            subscription = self._watch_deadman(name) if jog.deadman else None
            try:
                outcome = await self._jog(name, jog, key)
            finally:
                self._reports.unfollow(goal)
                if subscription is not None:
                    self._node.destroy_subscription(subscription)
                self._requests.pop(key, None)
        if outcome.success:
            goal.succeed()
        elif goal.is_cancel_requested:
            goal.canceled()
        else:
            goal.abort()
        self._canceled.discard(key)
        return self._result(name, outcome)

    async def _jog(self, name: str, jog: core.Jog, key: bytes) -> Outcome:
        """Jog an axis, and return how it has ended."""
        if jog.deadman and not await self._deadman_is_held(name, key):
            text = (
                f'axis {name}: the deadman is not held: no true on '
                f'{self._node.resolve_topic_name(f"~/{name}/deadman")} within '
                f'{DEADMAN_PATIENCE:g} s'
            )
            return Outcome(Error.Canceled, text)
        if key in self._canceled:
            return Outcome(Error.Canceled, f'axis {name}: canceled before anything moved')
        started = self._services.start([name], '~/jog (action)', jog=jog)
        if isinstance(started, Outcome):
            return started
        self._requests[key] = started.request
        return (await self._services.ended(started))[name]

    def _watch_deadman(self, name: str) -> Any:
        self._held.pop(name, None)
        axis = self._axes[name]

        def take(message: Bool) -> None:
            with self._lock:
                if message.data:
                    self._held[name] = self._timebase.now
                else:
                    self._held.pop(name, None)
                axis.deadman(self._timebase.now, bool(message.data))

        return self._node.create_subscription(
            Bool, f'~/{name}/deadman', take, 10, callback_group=self._group
        )

    async def _deadman_is_held(self, name: str, key: bytes) -> bool:
        """Wait for the first true of a deadman; return whether it has come."""
        for _ in range(round(DEADMAN_PATIENCE / DEADMAN_LOOK)):
            if name in self._held or key in self._canceled:
                return True
            await self._services.wait(self._pause(DEADMAN_LOOK))
        return False

    def _result(self, name: str, outcome: Outcome) -> Jog.Result:
        """Return the result of a goal."""
        met = outcome.jogged.edges if outcome.jogged else ()
        with self._lock:
            offset = self._timebase.offset
            states = self._reports.states([name])
        result = Jog.Result(
            success=outcome.success,
            message=messages.home_message({name: outcome}),
            error_code=messages.ERROR_CODES[outcome.error],
            edges=[messages.switch_edge(one, round(one.time * 1e9) + offset) for one in met],
        )
        if states:
            result.state = states[0]
        return result
