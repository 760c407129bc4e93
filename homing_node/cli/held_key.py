# SPDX-License-Identifier: Apache-2.0
"""A key of the terminal that is held down, as a deadman.

A terminal tells no release of a key, only that a held key repeats; its first repeat may come half
a second later. So a key counts as held for HOLD after each of its repeats.
"""

import os
import select
import sys
import termios
import threading
import time
import tty
from types import TracebackType

#: How long after its last repeat a key counts as held, s.
HOLD = 0.7


class HeldKey:
    """Watches the terminal; a context. Any key will do."""

    def __init__(self) -> None:
        self._pressed = -HOLD
        self._file = sys.stdin.fileno()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> 'HeldKey':
        self._before = termios.tcgetattr(self._file)
        tty.setcbreak(self._file)
        self._thread.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._ended.set()
        self._thread.join()
        termios.tcsetattr(self._file, termios.TCSADRAIN, self._before)

    def held(self) -> bool:
        """Return whether a key is held."""
        return time.monotonic() - self._pressed < HOLD

    def _watch(self) -> None:
        while not self._ended.is_set():
            ready, _, _ = select.select([self._file], [], [], 0.05)
            if ready and os.read(self._file, 1024):
                self._pressed = time.monotonic()
