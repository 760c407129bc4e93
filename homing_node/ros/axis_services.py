# SPDX-License-Identifier: Apache-2.0
"""The services of the axes of a line, in an executor and a thread of their own.

An executor looks at each of its entities whenever it wakes. A line may have hundreds of axes and
goals whose feedback comes ten times a second: what seldom happens must not be looked at then.
"""

import threading
from collections.abc import Awaitable, Callable
from typing import Any

from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

#: Answers a request: whether it has succeeded, and a text.
Answering = Callable[[], Awaitable[tuple[bool, str]]]


class AxisServices:
    """Serves Trigger services whose requests another node's executor answers.

    ``node`` may also have subscriptions that are polled.
    """

    def __init__(self, owner: Node) -> None:
        """Make the hidden node that has the services.

        Args:
            owner: The node whose services they seem to be, and whose executor runs the requests.
        """
        self._owner = owner
        self.node = Node(
            f'_{owner.get_name()}_axes',
            namespace=owner.get_namespace(),
            context=owner.context,
            use_global_arguments=False,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=owner.context)
        self._executor.add_node(self.node)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._spin, name='services', daemon=True)

    def start(self) -> None:
        """Serve; the owner has its executor."""
        self._thread.start()

    def close(self) -> None:
        """Serve no more."""
        self._ended.set()
        self._executor.wake()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()

    def serve(self, name: str, answering: Answering) -> None:
        """Serve a Trigger service under a name of the owner."""

        async def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            future = Future(executor=self._executor)

            async def answer() -> None:
                found = await answering()
                self._executor.create_task(lambda: future.set_result(found))
                self._executor.wake()

            self._owner.executor.create_task(answer)
            response.success, response.message = await future
            return response

        full = f'{self._owner.get_fully_qualified_name()}/{name}'
        self.node.create_service(Trigger, full, serve)

    def _spin(self) -> None:
        while not self._ended.is_set():
            self._executor.spin_once(timeout_sec=1.0)


def trigger(answering: Answering) -> Any:
    """Return the callback of a Trigger service that the node's own executor runs."""

    async def serve(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = await answering()
        return response

    return serve
