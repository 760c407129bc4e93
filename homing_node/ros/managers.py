# SPDX-License-Identifier: Apache-2.0
"""Asks controller managers which controllers are active and what they hold, and switches them.

The package controller_manager_msgs need not be installed: nothing is asked then.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from rclpy.node import Node

from . import graph
from .asking import Clients, Question

try:
    from controller_manager_msgs.srv import ListControllers, SwitchController
except ImportError:
    ListControllers = SwitchController = None

LIST_CONTROLLERS = 'controller_manager_msgs/srv/ListControllers'
#: Whether controllers can be listed and switched here.
INSTALLED = ListControllers is not None
#: The lifecycle states of a controller that is switched on, and off.
ON, OFF = 'active', 'inactive'


class Known(NamedTuple):
    """A controller as its manager knows it: lifecycle state, and the interfaces that it holds."""

    state: str
    claimed: tuple[str, ...]


class ManagerList:
    """The controllers of one manager."""

    def __init__(
        self, node: Node, service: str, patience: float, clients: Clients | None = None
    ) -> None:
        self.node = service.rpartition('/')[0]
        self._question = (
            None
            if ListControllers is None
            else Question(
                node, ListControllers, service, ListControllers.Request(), patience, clients
            )
        )

    def ask(self) -> None:
        """Ask once more."""
        if self._question is not None:
            self._question.ask()

    def poll(self) -> bool:
        """Go on asking; return whether it is over."""
        return self._question is None or self._question.poll()

    def close(self) -> None:
        """Ask no more."""
        if self._question is not None:
            self._question.close()

    @property
    def controllers(self) -> dict[str, Known] | None:
        """Each controller by the full name of its node; None where the manager did not answer."""
        answer: Any = self._question and self._question.answer
        if answer is None:
            return None
        namespace = self.node.rpartition('/')[0]
        return {
            f'{namespace}/{one.name}': Known(one.state, tuple(one.claimed_interfaces))
            for one in answer.controller
        }


def services(node: Node) -> list[str]:
    """Return the services of all controller managers that are there and can be asked."""
    return graph.services_of_type(node, LIST_CONTROLLERS)


def prepare(clients: Clients, manager: str) -> None:
    """Make the clients by which the controllers of a manager are switched."""
    clients.of(SwitchController, f'{manager}/switch_controller')


class Switch:
    """Switches controllers of one manager, and looks whether they are switched.

    ``answer``: None until it is over, then why not; '' means that they are as they should be.
    """

    def __init__(
        self,
        node: Node,
        manager: str,
        names: Sequence[str],
        on: bool,
        patience: float,
        clients: Clients,
    ) -> None:
        """Ask for the switch.

        Args:
            node: The node that asks.
            manager: The full name of the manager's node.
            names: The controllers, as the manager calls them.
            on: Activate them, else deactivate them.
            patience: How long an answer may take, s.
            clients: Where the clients of the manager are kept.
        """
        self.answer: str | None = None
        self._names, self._wanted = list(names), ON if on else OFF
        listed = list(names)
        request = SwitchController.Request(
            activate_controllers=listed if on else [],
            deactivate_controllers=[] if on else listed,
            strictness=SwitchController.Request.STRICT,
            activate_asap=True,
        )
        request.timeout.sec, request.timeout.nanosec = int(patience), int(patience % 1.0 * 1e9)
        self._switching = Question(
            node, SwitchController, f'{manager}/switch_controller', request, patience, clients
        )
        self._list = ManagerList(node, f'{manager}/list_controllers', patience, clients)

    def poll(self) -> bool:
        """Go on; return whether it is over."""
        if self.answer is None and self._switching.poll():
            said = self._switching.answer
            if said is None:
                self.answer = 'the controller manager does not answer'
            elif not said.ok:
                self.answer = said.message or 'the controller manager refuses'
            elif self._list.poll():
                known = self._list.controllers or {}
                states = {name.rpartition('/')[2]: one.state for name, one in known.items()}
                if all(states.get(name) == self._wanted for name in self._names):
                    self.answer = ''
                else:
                    self._list.ask()
        return self.answer is not None

    def close(self) -> None:
        """Ask no more."""
        self._switching.close()
        self._list.close()


def find(
    listed: Mapping[str, Mapping[str, Known]], names: Iterable[str]
) -> dict[str, tuple[str, Known]]:
    """Return the manager and the state of each controller that is known.

    Args:
        listed: The controllers by the full name of their node, by the node of their manager.
        names: Their names, or the full names of their nodes.
    """
    return {
        name: (manager, known)
        for name in names
        for manager, controllers in listed.items()
        for full, known in controllers.items()
        if full in (name, f'{manager.rpartition("/")[0]}/{name}')
    }
