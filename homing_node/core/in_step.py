# SPDX-License-Identifier: Apache-2.0
"""Switches that hear the same messages, which have said nothing new for long.

The times of their messages are the same then. One object serves all of them, so that a further
message costs little, however many they are.
"""

from collections.abc import Iterable

from .edge_time import REMEMBERED, MessageTimes
from .signals import Switch

#: After so many messages that repeat every level, the times that switches remember are the same.
LONG = REMEMBERED + 2


class InStep:
    """Switches of any axes whose messages have the same times."""

    def __init__(self, switches: Iterable[Switch], latency: float, stamp_error: float) -> None:
        """Let switches share their times where these are the same.

        Args:
            switches: each has a level, and no change of it waits for its debounce.
            latency: how long before its message each was read, s.
            stamp_error: how far the times may be wrong besides, s.
        """
        self._switches = list(switches)
        self._latency, self._stamp_error = latency, stamp_error
        self._times: list[MessageTimes] = []
        for switch in self._switches:
            for times in self._times:
                if times.is_as(switch.messages):
                    switch.messages = times
                    break
            else:
                self._times.append(switch.messages)

    def repeat(self, time: float, arrival: float, doubt: float) -> None:
        """Take a message with the levels of the one before; see `Readings.repeat`."""
        for switch in self._switches:
            switch.seen = arrival
        time, doubt = time - self._latency, doubt + self._stamp_error
        for times in self._times:
            times.repeat(time, doubt)

    def end(self) -> None:
        """Give each switch times of its own again."""
        for switch in self._switches:
            switch.messages = switch.messages.copy()
