# SPDX-License-Identifier: Apache-2.0
"""Whether any of many inputs has a message, without asking each of them in every cycle."""

import ctypes
import os
import sys
from typing import Any

#: int (int event, uint64_t *count): not 0 where nothing was added; os.eventfd_read raises there,
#: which takes as long again.
_take_event = ctypes.PyDLL(None).eventfd_read
#: int (subscription, void (*told)(const void *what, size_t messages), const void *what)
_tell_of_messages = ctypes.CDLL('librcl.so').rcl_subscription_set_on_new_message_callback
_tell_of_messages.argtypes = [ctypes.c_void_p] * 3
#: int (int event, uint64_t added): where pointers have 64 bits it can be called as ``told``.
_add_to_event = ctypes.cast(ctypes.CDLL(None).eventfd_write, ctypes.c_void_p)


class Arrivals:
    """Tells whether a message has come: the middleware's thread writes to an eventfd, no Python.

    Where the middleware cannot, there always may be one.
    """

    def __init__(self) -> None:
        self._event = os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC)
        self._count = ctypes.byref(ctypes.c_uint64())
        self._told_of_all = sys.maxsize > 2**32

    def watch(self, subscription: Any) -> None:
        """Be told of the messages of a subscription, those that are there included."""
        if self._told_of_all:
            with subscription.handle:
                self._told_of_all = not _tell_of_messages(
                    subscription.handle.pointer, _add_to_event, self._event
                )
        self.expect()

    def expect(self) -> None:
        """Let ``pending`` be true at its next call."""
        os.eventfd_write(self._event, 1)

    def pending(self) -> bool:
        """Return whether there may be a message that came after the last call."""
        nothing_told = _take_event(self._event, self._count)
        return not (nothing_told and self._told_of_all)
