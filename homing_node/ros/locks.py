# SPDX-License-Identifier: Apache-2.0
"""What may forbid an axis of the node to home, besides itself: locks, and a node at rest.

Coordinators publish their locks on ``~/locks``: `name` is the coordinator, `hardware_id` its
process, `values` are the axes that it guards, each with the reason why it must not home ('': it
may). The message is repeated, so that the node notices when a coordinator dies.
"""

import time

from diagnostic_msgs.msg import DiagnosticStatus

from ..core.locks import Locks
from ..core.outcome import Outcome
from ..procedures.states import Error
from .polling import taker, waiting
from .subscriptions import Subscriptions, qos

#: So many messages wait for a poll: several coordinators can be there.
DEPTH = 10


class Permissions:
    """Whether axes may home: the node is active, and no coordinator keeps them locked.

    ``inactive`` is why the whole node homes nothing, '' if it does. The topic of the locks is
    polled: an executor rebuilds its wait set at every message, which takes 10 ms with 32 axes.
    """

    def __init__(self, subscriptions: Subscriptions, coordinated: bool) -> None:
        self.inactive = ''
        self._locks = Locks(coordinated)
        topic = subscriptions.subscribe(
            DiagnosticStatus, '~/locks', qos(latched=True, depth=DEPTH), overridable=False
        )
        self._take = taker(topic, False)

    def poll(self) -> None:
        """Take what coordinators have said; the axes are locked."""
        for message, _ in waiting(self._take):
            reasons = {one.key: one.value for one in message.values}
            self._locks.take(message.hardware_id, message.name, reasons, time.monotonic())

    def refusal(self, axis: str) -> Outcome | None:
        """Return why an axis must not home now, else None; the lock is held."""
        if self.inactive:
            return Outcome(Error.NotActive, f'axis {axis}: {self.inactive}', final=True)
        self.poll()
        return self._locks.refusal(axis, time.monotonic())
