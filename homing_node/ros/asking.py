# SPDX-License-Identifier: Apache-2.0
"""Questions to other nodes, which never block: services that are asked and then looked at.

Whoever asks calls ``poll`` now and then, and spins the executor in between.
"""

import time
from collections.abc import Callable
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python


def of_interest(name: str) -> bool:
    """Tell whether a parameter of a controller may matter: gains and the description do not."""
    return not name.startswith(('gains.', 'robot_description', 'qos_overrides.'))


class Question:
    """Calls of one service: sent when the service is there, given up after ``patience`` s.

    ``done`` tells whether the call that was made last needs no more polling; ``answer`` is None
    where nobody answered.
    """

    def __init__(self, node: Node, kind: Any, service: str, request: Any, patience: float) -> None:
        self._node, self._request, self._patience = node, request, patience
        self._client = node.create_client(kind, service)
        self.ask()

    def ask(self) -> None:
        """Ask, once more if it was done before."""
        self.done = False
        self.answer: Any = None
        self._future: Any = None
        self._until = time.monotonic() + self._patience

    def poll(self) -> bool:
        """Send what can be sent, take what has come; return whether it is over."""
        if self.done:
            return True
        if self._future is None and self._client.service_is_ready():
            self._future = self._client.call_async(self._request)
        if self._future is not None and self._future.done():
            self.answer, self.done = self._future.result(), True
        elif time.monotonic() > self._until:
            self.done = True
        return self.done

    def close(self) -> None:
        """Ask no more."""
        self.done = True
        self._node.destroy_client(self._client)


class Parameters:
    """Reads some parameters of another node: their names first, as rclcpp answers known ones only.

    ``values`` is None until they are read, and stays None where the node does not answer.
    """

    def __init__(
        self, node: Node, name: str, wanted: Callable[[str], bool], patience: float
    ) -> None:
        self.name = name
        self.values: dict[str, Any] | None = None
        self._node, self._wanted, self._patience = node, wanted, patience
        self._names: list[str] = []
        self._listing = Question(
            node, ListParameters, f'{name}/list_parameters', ListParameters.Request(), patience
        )
        self._getting: Question | None = None
        self.done = False

    def poll(self) -> bool:
        """Go on reading; return whether it is over."""
        if self.done or not self._listing.poll():
            return self.done
        if self._listing.answer is None:
            self.close()
            return True
        if self._getting is None:
            self._names = [n for n in self._listing.answer.result.names if self._wanted(n)]
            self._getting = Question(
                self._node,
                GetParameters,
                f'{self.name}/get_parameters',
                GetParameters.Request(names=self._names),
                self._patience,
            )
        if self._getting.poll():
            answer = self._getting.answer
            if answer is not None and len(answer.values) == len(self._names):
                read = map(parameter_value_to_python, answer.values)
                self.values = {
                    name: value
                    for name, value in zip(self._names, read, strict=True)
                    if value is not None
                }
            self.close()
        return self.done

    def close(self) -> None:
        """Ask no more."""
        if self.done:
            return
        self.done = True
        for question in (self._listing, self._getting):
            if question is not None:
                question.close()
