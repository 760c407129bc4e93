# SPDX-License-Identifier: Apache-2.0
"""The folder of the records: the names of the files, and which of them are kept.

A name tells when a run began (UTC), the node, the axis and how the run ended:
`20261128T105100-123456.homing_node.x.Homed.mcap`.
"""

from collections import deque
from datetime import datetime, timezone
from pathlib import Path
from typing import BinaryIO, NamedTuple

from ..memory.disk import Disk

SUFFIX = '.mcap'
#: How a record ends: while its run is on; when the node ended before the run; when all went well.
RUNNING, CUT = 'Running', 'Cut'
GOOD = ('Homed', 'Verified')


class Name(NamedTuple):
    """What the name of a record tells.

    Attributes:
        begun: When the run began, as it stands in the name.
        node: The full name of the node, with dots.
        axis: The axis.
        ended: How the run ended: Homed, Verified, the name of an error, Running or Cut.
    """

    begun: str
    node: str
    axis: str
    ended: str

    def __str__(self) -> str:
        return '.'.join(self) + SUFFIX


def name_of(path: Path) -> Name | None:
    """Return what the name of a file tells, None if it is none of a record."""
    parts = path.name.removesuffix(SUFFIX).split('.')
    if len(parts) < 4 or path.suffix != SUFFIX:
        return None
    begun, *node, axis, ended = parts
    return Name(begun, '.'.join(node), axis, ended)


class RecordFolder:
    """The records of one node in a folder, which other nodes may use, too.

    Attributes:
        path: The folder.
        runs: How many records of runs that ended well are kept.
        failures: How many others are kept.
    """

    def __init__(
        self,
        path: Path,
        node: str,
        runs: int,
        failures: int,
        disk: Disk | None = None,
    ) -> None:
        """Make the folder known; nothing is written yet.

        Args:
            path: The folder.
            node: The full name of the node.
            runs: How many records of runs that ended well are kept.
            failures: How many others are kept.
            disk: The disk.
        """
        self.path, self.runs, self.failures = path, runs, failures
        self._node = node.strip('/').replace('/', '.')
        self._disk = disk or Disk()
        self._last = 0  # when the newest run began, µs
        #: Those whose run has ended, by whether it ended well, the oldest first; None: not looked.
        self._ended: dict[bool, deque[Path]] | None = None

    def begin(self, axis: str, nanoseconds: int) -> tuple[Path, BinaryIO]:
        """Create the file of a run that began at a time of the system's clock, ns.

        Names grow: a run that does not begin later than the one before is named as if it did.

        Raises:
            OSError: It cannot be created.
        """
        self._last = max(nanoseconds // 1000, self._last + 1)
        seconds, rest = divmod(self._last, 1_000_000)
        when = datetime.fromtimestamp(seconds, timezone.utc)
        begun = f'{when:%Y%m%dT%H%M%S}-{rest:06d}'
        path = self.path / str(Name(begun, self._node, axis, RUNNING))
        return path, self._disk.create(path)

    def end(self, path: Path, ended: str) -> Path:
        """Give a record the name that tells how its run ended, and delete those that are too many.

        Raises:
            OSError: The folder cannot be written.
        """
        name = name_of(path)
        assert name is not None
        new = self.path / str(name._replace(ended=ended))
        self._disk.rename(path, new)
        if self._ended is not None:
            self._ended[ended in GOOD].append(new)
        self.prune()
        return new

    def tidy(self) -> None:
        """Name the records Cut that a node of this name left behind when it was killed.

        Raises:
            OSError: The folder cannot be written.
        """
        for path, name in self._records():
            if name.ended == RUNNING:
                self._disk.rename(path, self.path / str(name._replace(ended=CUT)))
        self._ended = None
        self.prune()

    def prune(self) -> None:
        """Delete the oldest records that are too many; a run that is on keeps its own.

        Raises:
            OSError: The folder cannot be written.
        """
        if self._ended is None:
            records = [(path, name.ended) for path, name in self._records()]
            self._ended = {
                good: deque(
                    path for path, ended in records if ended != RUNNING and (ended in GOOD) is good
                )
                for good in (True, False)
            }
        for good, most in ((True, self.runs), (False, self.failures)):
            of_kind = self._ended[good]
            while len(of_kind) > most:
                self._disk.delete(of_kind[0])
                of_kind.popleft()

    def _records(self) -> list[tuple[Path, Name]]:
        """Return the records of this node, the oldest first."""
        paths = [self.path / name for name in sorted(self._disk.names(self.path))]
        named = [(path, name_of(path)) for path in paths]
        return [(path, name) for path, name in named if name and name.node == self._node]
