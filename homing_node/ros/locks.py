# SPDX-License-Identifier: Apache-2.0
"""What may forbid an axis of the node to home, besides itself: locks, and a node at rest.

Coordinators publish their locks on ``~/locks``: `name` is the coordinator, `hardware_id` its
process, `values` are the axes that it guards, each with the reason why it must not home ('': it
may). The message is repeated, so that the node notices when a coordinator dies.
"""

import threading
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

from ..core.locks import Locks
from ..core.outcome import Outcome
from ..procedures.states import Error

#: Two coordinators can be there.
LATCHED = QoSProfile(depth=2, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Permissions:
    """Whether axes may home: the node is active, and no coordinator keeps them locked.

    ``inactive`` is why the whole node homes nothing, '' if it does. ``lock`` guards the axes.
    """

    def __init__(
        self, node: Node, coordinated: bool, lock: threading.Lock, group: CallbackGroup
    ) -> None:
        self.inactive = ''
        self._locks, self._lock = Locks(coordinated), lock
        node.create_subscription(
            DiagnosticStatus, '~/locks', self._take, LATCHED, callback_group=group
        )

    def refusal(self, axis: str) -> Outcome | None:
        """Return why an axis must not home now, else None; the lock is held."""
        if self.inactive:
            return Outcome(Error.NotActive, f'axis {axis}: {self.inactive}', final=True)
        return self._locks.refusal(axis, time.monotonic())

    def _take(self, message: Any) -> None:
        reasons = {one.key: one.value for one in message.values}
        with self._lock:
            self._locks.take(message.hardware_id, message.name, reasons, time.monotonic())
