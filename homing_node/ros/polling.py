# SPDX-License-Identifier: Apache-2.0
"""Subscriptions that a loop polls, kept from the executor.

This is the only place that takes messages with `subscription.handle.take_message`. rclpy has no
other call that takes a message without an executor, and its executor rebuilds its wait set at
every wake: 55 subscriptions with feedback at 500 Hz used 67 to 82 % of a core in
SingleThreadedExecutor, the same subscriptions polled at 250 Hz 6 %
(doc/decisions/0002-polled-inputs.md).
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any

from rclpy.callback_groups import CallbackGroup

#: What the middleware says of a message: `source_timestamp` and `received_timestamp` in ns of the
#: system clock, among others.
Info = Mapping[str, int]
#: Returns the next message of a subscription and its info, None if there is none.
Take = Callable[[], tuple[Any, Info] | None]

#: A poll takes no more messages of one subscription than a queue of the usual depth holds: a
#: publisher that floods a topic cannot hold the loop. The rest waits for the next poll.
MOST_AT_ONCE = 100


class Polled(CallbackGroup):
    """Keeps its subscriptions from the executor: it never finds that it can execute one."""

    def can_execute(self, entity: object) -> bool:
        """Return False."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Return False."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Do nothing: nothing was executed."""


def never_called(*_: object) -> None:
    """Stand where rclpy wants the callback of a polled subscription."""


def taker(subscription: Any, serialized: bool) -> Take:
    """Return the function that takes the next message of a subscription.

    Args:
        subscription: The subscription.
        serialized: Whether messages are taken as bytes. A take of nothing then costs half.
    """
    return partial(subscription.handle.take_message, subscription.msg_type, serialized)


def waiting(take: Take) -> Iterator[tuple[Any, Info]]:
    """Yield the messages that wait, at most `MOST_AT_ONCE`."""
    for _ in range(MOST_AT_ONCE):
        taken = take()
        if taken is None:
            return
        yield taken
