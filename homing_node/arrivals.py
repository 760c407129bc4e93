"""Whether any of many inputs has a message, without asking each of them in every cycle."""

import threading
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from typing import Any

from rclpy.context import Context
from rclpy.exceptions import InvalidHandle
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation

#: After so many looks in a row that found nothing, waiting is cheaper than looking.
EMPTY_LOOKS = 10
#: No wait is longer, s.
LONGEST_WAIT = 0.1


class Arrivals:
    """Waits for a message of any of its subscriptions, in a thread of its own.

    ``expected`` says whether to look for messages. It stays true while looks find some. A message
    that is there when a wait begins ends it at once: none is missed between looking and waiting.
    ``changed`` ends a wait that knows the subscriptions of before.
    """

    def __init__(self, context: Context, changed: GuardCondition) -> None:
        self._context, self._changed = context, changed
        self._subscriptions: list[Any] = []
        self._waiting = threading.Event()  # set by looks in vain, cleared by a message
        self._empty_looks = 0

    @property
    def expected(self) -> bool:
        return not self._waiting.is_set()

    def expect(self) -> None:
        """Let the next poll look, whether a message has been noticed or not."""
        self._waiting.clear()

    def watch(self, subscriptions: Iterable[Any]) -> None:
        """Wait for messages of these alone; others may be destroyed after it."""
        self._subscriptions = list(subscriptions)
        self._waiting.clear()
        self._changed.trigger()

    def looked(self, found: bool) -> None:
        """Take whether a look at all subscriptions found a message."""
        self._empty_looks = 0 if found else self._empty_looks + 1
        if self._empty_looks >= EMPTY_LOOKS:
            self._waiting.set()

    def run(self, ended: Callable[[], bool]) -> None:
        """Wait whenever looking has found nothing for a while, until ``ended`` says so."""
        while not ended():
            if self._waiting.wait(LONGEST_WAIT):
                self._wait()
                self._waiting.clear()

    def _wait(self) -> None:
        subscriptions = self._subscriptions
        wait_set = rclpy_implementation.WaitSet(
            len(subscriptions), 1, 0, 0, 0, 0, self._context.handle)
        wait_set.clear_entities()
        wait_set.add_guard_condition(self._changed.handle)
        with ExitStack() as in_use:
            try:
                for subscription in subscriptions:
                    in_use.enter_context(subscription.handle)
                    wait_set.add_subscription(subscription.handle)
            except InvalidHandle:  # destroyed since: there are others by now
                return
            wait_set.wait(round(LONGEST_WAIT * 1e9))
