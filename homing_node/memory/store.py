# SPDX-License-Identifier: Apache-2.0
"""The file of one axis: JSON lines, each with a checksum, replaced as a whole.

The first line is the head, the second the axis at rest, and each further line a run. A line that
its checksum contradicts is left out, and the file is then not whole: no home is restored from it.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple
from zlib import crc32

from .disk import Disk, replace_file
from .records import FORMAT, MOST_RUNS, Head, Rest, Run, as_mapping, from_mapping

#: What a line begins with: the checksum of all that follows.
BEGIN = '{"crc32":"%08x",'
LENGTH = len(BEGIN % 0)


def line_of(record: Head | Rest | Run) -> bytes:
    """Return the line of a record."""
    rest = json.dumps(as_mapping(record), separators=(',', ':'), allow_nan=False)[1:].encode()
    return (BEGIN % crc32(rest)).encode() + rest + b'\n'


def record_of(line: bytes) -> Head | Rest | Run:
    """Return the record of a line; raise ValueError if the line is not whole."""
    begin, rest = line[:LENGTH], line[LENGTH:].rstrip(b'\n')
    if begin.decode('ascii', 'replace') != BEGIN % crc32(rest):
        raise ValueError('the checksum contradicts the line')
    mapping: Any = json.loads(line)
    return from_mapping(mapping)


class Contents(NamedTuple):
    """What a file holds.

    ``whole`` is False if a line was left out. ``foreign`` says why the file is not one of this
    axis on this machine, '' if it is; then nothing else is in it.
    """

    rest: Rest | None = None
    runs: tuple[Run, ...] = ()
    whole: bool = True
    foreign: str = ''


class Store:
    """The file of one axis.

    Attributes:
        path: Where it is.
    """

    def __init__(self, path: Path, head: Head, disk: Disk) -> None:
        self.path = path
        self._head, self._disk = head, disk
        self._lines: dict[int, bytes] = {}  # of the runs, by number

    def load(self) -> Contents:
        """Read the file.

        Raises:
            OSError: It cannot be read.
        """
        data = self._disk.read(self.path)
        if data is None:
            return Contents()
        contents = read(data, self._head)
        self._lines = {run.number: line_of(run) for run in contents.runs}
        return contents

    def save(self, rest: Rest, runs: Sequence[Run]) -> None:
        """Replace the file; the oldest of too many runs are dropped.

        Raises:
            OSError: The disk is full or cannot be written. The old file stays.
        """
        kept = runs[-MOST_RUNS:]
        self._lines = {run.number: self._lines.get(run.number) or line_of(run) for run in kept}
        data = b''.join([line_of(self._head), line_of(rest), *self._lines.values()])
        replace_file(self._disk, self.path, data)

    def forget(self, number: int) -> None:
        """Write the line of a run anew when the file is saved next: it has changed."""
        self._lines.pop(number, None)

    def set_aside(self) -> Path:
        """Keep the file under another name, because it is not ours; return the name."""
        aside = self.path.with_name(self.path.name + '.other')
        self._disk.rename(self.path, aside)
        return aside


def read(data: bytes, head: Head | None = None) -> Contents:
    """Return what the data of a file hold.

    Args:
        data: The data.
        head: Whose file it must be; None: anybody's.
    """
    records: list[Head | Rest | Run] = []
    lines = data.splitlines(keepends=True)
    for line in lines:
        try:
            records.append(record_of(line))
        except ValueError:
            continue
    heads = [one for one in records if isinstance(one, Head)]
    if heads and head is not None:
        foreign = _foreign(heads[0], head)
        if foreign:
            return Contents(foreign=foreign)
    rests = [one for one in records if isinstance(one, Rest)]
    runs = {one.number: one for one in records if isinstance(one, Run)}
    whole = len(records) == len(lines) and bool(heads) and data.endswith(b'\n')
    ordered = tuple(run for _, run in sorted(runs.items()))
    return Contents(rests[-1] if rests else None, ordered, whole)


def _foreign(found: Head, ours: Head) -> str:
    """Return why a file is not ours, '' if it is."""
    if found.format > FORMAT:
        return f'its format is {found.format}, and this version knows up to {FORMAT}'
    if found.axis != ours.axis:
        return f'it is of axis {found.axis}'
    if found.machine != ours.machine:
        return 'it is of another machine'
    return ''
