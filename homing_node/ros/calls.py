# SPDX-License-Identifier: Apache-2.0
"""Services and goals of one node, asked by a script that waits for the answers.

The node that asks has a context, an executor and a thread of its own. Only that thread sends
goals: rclpy's action client registers a request after it has sent it, so that an answer which
another thread takes in between would be lost.
"""

import math
import os
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

#: Interval at which a waiting client checks that the node is alive, s.
ALIVE_PERIOD = 1.0
#: A node that sends no feedback about a goal for so long is silent, s; it sends some at 10 Hz.
SILENCE = 5.0


class NotThere(TimeoutError):
    """What would have answered is not in reach, so that nothing was asked of it."""


class Interrupted(KeyboardInterrupt):
    """Ctrl-C while a goal was on: it was canceled, and ``result`` is how it has ended, at rest."""

    def __init__(self, result: Any) -> None:
        self.result = result
        super().__init__()


class Abandoned(KeyboardInterrupt):
    """A second Ctrl-C: the goal was canceled, and nobody has waited until the axes rest."""


class Calls:
    """Asks one node. Every call raises TimeoutError if no answer comes."""

    def __init__(self, node_name: str, discovery: float) -> None:
        """Join the graph.

        Args:
            node_name: The full name of the node that is asked.
            discovery: Longest wait for it, s.
        """
        self._asked, self._discovery = node_name, discovery
        self._context = Context()
        rclpy.init(context=self._context)
        self.node = Node(
            f'homing_client_{os.getpid()}',
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._closed: Future = Future()  # a context that ends in a spin breaks it
        self._clients: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Leave the graph."""
        self._closed.set_result(None)
        self._thread.join()
        self._context.try_shutdown()
        self.node.destroy_node()

    def client(self, name: str, make: Callable[[], Any]) -> Any:
        """Return the client of a name; ``make`` makes it the first time."""
        if name not in self._clients:
            self._clients[name] = make()
        return self._clients[name]

    def service(self, kind: Any, full: str) -> Any:
        """Return the client of a service."""
        return self.client(full, lambda: self.node.create_client(kind, full))

    def call(self, kind: Any, full: str, request: Any, timeout: float | None = None) -> Any:
        """Call a service, and return its response."""
        client = self.service(kind, full)
        if not client.wait_for_service(self._discovery):
            raise NotThere(f'no service {full} within {self._discovery:g} s')
        return self.wait(client.call_async(request), timeout, client.service_is_ready)

    def act(
        self,
        kind: Any,
        name: str,
        goal: Any,
        on_feedback: Callable[[Any], None] | None = None,
        timeout: float | None = None,
    ) -> Any:
        """Send a goal, and return its result; stop it where this call ends before.

        Raises:
            NotThere: There is no such action, and nothing was sent.
            Interrupted, Abandoned: Ctrl-C, once and twice.
            TimeoutError: No result came in time, or the node has ended.
        """
        action = f'{self._asked}/{name}'
        client = self.client(f'{name} (action)', lambda: ActionClient(self.node, kind, action))
        if not client.wait_for_server(self._discovery):
            raise NotThere(f'no action {action} within {self._discovery:g} s')
        heard = time.monotonic()
        broken: Exception | None = None

        def forward(message: Any) -> None:
            nonlocal heard, broken
            heard = time.monotonic()
            if on_feedback is not None and broken is None:
                try:
                    on_feedback(message.feedback)
                except Exception as error:  # the thread must go on: the result is to come
                    broken = error

        def alive() -> bool:
            return client.server_is_ready() and time.monotonic() - heard < SILENCE

        sent = self._send(lambda: client.send_goal_async(goal, forward))
        try:
            accepted = self._answer(sent, self._discovery, client.server_is_ready)
            if not accepted.accepted:
                return kind.Result(message=f'{self._asked} has rejected the goal')
            heard = time.monotonic()
            result = self._answer(self._send(accepted.get_result_async), timeout, alive).result
        except KeyboardInterrupt:
            heard = time.monotonic()
            try:
                result = self._stop(client, sent, alive)
            except KeyboardInterrupt:
                raise Abandoned from None
            raise Interrupted(result) from None
        except TimeoutError:
            heard = time.monotonic()
            self._stop(client, sent, alive)
            raise
        if broken is not None:
            raise broken
        return result

    def wait(
        self, future: Any, timeout: float | None, alive: Callable[[], bool] = lambda: True
    ) -> Any:
        """Return a future's result; ``alive()`` returns whether its server is still there."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        until = math.inf if timeout is None else time.monotonic() + timeout
        while not done.wait(max(0.0, min(ALIVE_PERIOD, until - time.monotonic()))):
            if time.monotonic() >= until:
                raise TimeoutError(f'{self._asked} did not answer within {timeout:g} s')
            if not alive():
                raise TimeoutError(f'{self._asked} has ended, or is out of reach')
        return future.result()

    # ------------------------------------------------------------------------------------- inside

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            self._executor.spin_until_future_complete(self._closed)

    def _send(self, send: Callable[[], Any]) -> Any:
        """Let the thread send a request of an action; return the future of the answer's future."""
        return self._executor.create_task(send)

    def _answer(self, sent: Any, timeout: float | None, alive: Callable[[], bool]) -> Any:
        """Return the answer of a request that `_send` has sent."""
        return self.wait(self.wait(sent, self._discovery), timeout, alive)

    def _stop(self, client: Any, sent: Any, alive: Callable[[], bool]) -> Any:
        """Cancel a goal that was sent, and return its result, which comes when all is at rest.

        A heavy axis may brake for long: the wait ends when ``alive()`` returns false.
        """
        ready = client.server_is_ready
        goal = self._answer(sent, self._discovery, ready)
        self._answer(self._send(goal.cancel_goal_async), self._discovery, ready)
        return self._answer(self._send(goal.get_result_async), None, alive).result
