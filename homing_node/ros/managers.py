# SPDX-License-Identifier: Apache-2.0
"""Asks controller managers which controllers are active, and what they hold.

The package controller_manager_msgs need not be installed: nothing is asked then.
"""

from typing import Any, NamedTuple

from rclpy.node import Node

from . import graph
from .asking import Question

try:
    from controller_manager_msgs.srv import ListControllers
except ImportError:
    ListControllers = None

LIST_CONTROLLERS = 'controller_manager_msgs/srv/ListControllers'


class Known(NamedTuple):
    """A controller as its manager knows it: lifecycle state, and the interfaces that it holds."""

    state: str
    claimed: tuple[str, ...]


class ManagerList:
    """The controllers of one manager."""

    def __init__(self, node: Node, service: str, patience: float) -> None:
        self.node = service.rpartition('/')[0]
        self._question = (
            None
            if ListControllers is None
            else Question(node, ListControllers, service, ListControllers.Request(), patience)
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
