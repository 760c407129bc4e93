# SPDX-License-Identifier: Apache-2.0
"""Questions to other nodes, which never block: services that are asked and then looked at.

Whoever asks calls ``poll`` now and then, and spins the executor in between.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rcl_interfaces.srv import GetParameters, ListParameters
from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python

from ..parameters.configuration import Configuration, configuration


def of_interest(name: str) -> bool:
    """Tell whether a parameter of a controller may matter: gains and the description do not."""
    return not name.startswith(('gains.', 'robot_description', 'qos_overrides.'))


class IsCoordinator(Exception):
    """A node is a coordinator, which has no axes of its own; ``nodes`` are those of its cells."""

    def __init__(self, nodes: Sequence[str]) -> None:
        self.nodes = list(nodes)
        super().__init__(self.nodes)


def configuration_of(values: Mapping[str, Any]) -> Configuration:
    """Return what the parameters of a homing node say.

    Raises:
        IsCoordinator: They are those of a coordinator.
        InvalidParameters: They contradict each other.
    """
    if 'nodes' in values and 'axes' not in values:
        raise IsCoordinator(values['nodes'])
    return configuration(values)


class Clients:
    """Clients that are kept: a service may drop its answer to one that has only just come."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._clients: dict[tuple[Any, str], Any] = {}

    def of(self, kind: Any, service: str) -> Any:
        """Return the client of a service.

        Raises:
            ValueError: The service's name is none.
        """
        if (kind, service) not in self._clients:
            try:
                self._clients[kind, service] = self._node.create_client(kind, service)
            except NameValidationException as error:
                raise ValueError(str(error).partition('\n')[0].rstrip(':')) from None
        return self._clients[kind, service]


class Question:
    """Calls of one service: sent when the service is there, given up after ``patience`` s.

    ``done`` tells whether the call that was made last needs no more polling; ``answer`` is None
    where nobody answered.
    """

    def __init__(
        self,
        node: Node,
        kind: Any,
        service: str,
        request: Any,
        patience: float,
        clients: Clients | None = None,
        again: float = 0.0,
    ) -> None:
        """Ask.

        Args:
            node: The node that asks.
            kind: The type of the service.
            service: Its name.
            request: What is asked.
            patience: How long an answer may take, s.
            clients: Where the client is kept; None: it ends with the question.
            again: After this time without an answer it is asked once more, s; 0: never.
        """
        self._node, self._request, self._patience = node, request, patience
        self._kept, self._again = clients is not None, again
        kept = clients and clients.of(kind, service)
        self._client = kept or node.create_client(kind, service)
        self._future: Any = None
        self.ask()

    def ask(self) -> None:
        """Ask, once more if it was done before."""
        self.done = False
        self.answer: Any = None
        self._drop()
        self._until = time.monotonic() + self._patience
        self._sent = 0.0

    def poll(self) -> bool:
        """Send what can be sent, take what has come; return whether it is over."""
        if self.done:
            return True
        now = time.monotonic()
        if self._again and now > self._sent + self._again and not self._answered:
            self._drop()
        if self._future is None and self._client.service_is_ready():
            self._future, self._sent = self._client.call_async(self._request), now
        if self._answered:
            self.answer, self.done = self._future.result(), True
        elif now > self._until:
            self.done = True
        return self.done

    @property
    def _answered(self) -> bool:
        return self._future is not None and bool(self._future.done())

    def _drop(self) -> None:
        """Forget what was asked."""
        if self._future is not None and not self._future.done():
            self._client.remove_pending_request(self._future)
        self._future = None

    def close(self) -> None:
        """Ask no more."""
        self.done = True
        self._drop()
        if not self._kept:
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
