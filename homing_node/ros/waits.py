# SPDX-License-Identifier: Apache-2.0
"""What waits in the executor: futures that the cycle ends, and calls that it hands over."""

from collections.abc import Callable, Sequence
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future


class Waits:
    """Makes the futures that requests await; only the executor's thread sets them."""

    def __init__(self, node: Node, group: CallbackGroup) -> None:
        """Keep the node whose executor runs the calls, and the callback group of its timers."""
        self._node, self._group = node, group

    def future(self) -> Future:
        """Return what a request awaits; `end` sets it."""
        return Future(executor=self._node.executor)

    def pause(self, seconds: float) -> Future:
        """Return a future that the executor sets after a time of the steady clock."""
        future = self.future()

        def end() -> None:
            self._node.destroy_timer(timer)
            future.set_result(None)

        clock = Clock(clock_type=ClockType.STEADY_TIME)
        timer = self._node.create_timer(seconds, end, callback_group=self._group, clock=clock)
        return future

    def call(self, function: Callable[[], Any]) -> None:
        """Let the executor call a function, or run a coroutine; from any thread."""
        executor = self._node.executor
        if executor is not None:
            executor.create_task(function)

    def end(self, futures: Sequence[Future]) -> None:
        """Let the executor set the futures of requests that have ended.

        The executor must be woken once more: Kilted's may have looked at the coroutine that waits
        before it ran this task.
        """
        executor = self._node.executor
        if executor is None:
            return

        def end() -> None:
            for future in futures:
                future.set_result(None)
            executor.wake()

        executor.create_task(end)
