# SPDX-License-Identifier: Apache-2.0
"""Remembers when the cycle of each published message was due, so that lateness can be told."""

import time
from array import array
from pathlib import Path


class Grid:
    """Due times, s of the monotonic clock; ``note`` costs a tenth of a microsecond."""

    def __init__(self) -> None:
        self.due = array('d')
        self.note = self.due.append

    def save(self, path: str) -> None:
        """Write the due times as system time, s, as the middleware stamps messages."""
        offset = time.time() - time.monotonic()
        with Path(path).open('wb') as file:
            array('d', [due + offset for due in self.due]).tofile(file)


def load(path: Path) -> list[float]:
    """Read what `save` wrote: the due time of each message, in the order of publication."""
    due = array('d')
    with path.open('rb') as file:
        due.fromfile(file, path.stat().st_size // due.itemsize)
    return list(due)
