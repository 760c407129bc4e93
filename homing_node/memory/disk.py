# SPDX-License-Identifier: Apache-2.0
"""The few things that are asked of a disk, and how a file is replaced as a whole."""

import os
from pathlib import Path
from typing import BinaryIO

#: So much of a new file waits at most for a flush, bytes.
BUFFER = 1 << 17


class Disk:
    """The disk. Tests replace it by one that loses its power or that is full."""

    def read(self, path: Path) -> bytes | None:
        """Return what a file holds, None if there is no such file."""
        try:
            return path.read_bytes()
        except FileNotFoundError:
            return None

    def write(self, path: Path, data: bytes) -> None:
        """Write a new file, or an old one from its beginning."""
        path.write_bytes(data)

    def sync(self, path: Path) -> None:
        """Wait until a file, or the list of the files of a folder, is on the disk."""
        number = os.open(path, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)

    def create(self, path: Path) -> BinaryIO:
        """Create a file, and its folder; raise FileExistsError if there is one of this name.

        What is written goes to the file at each flush at once, up to BUFFER.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open('xb', BUFFER)

    def delete(self, path: Path) -> None:
        """Delete a file, if it is there."""
        path.unlink(missing_ok=True)

    def names(self, folder: Path) -> list[str]:
        """Return the names of the files in a folder; of one that is not there, none."""
        return os.listdir(folder) if folder.is_dir() else []

    def rename(self, path: Path, name: Path) -> None:
        """Give a file the name of another one, which is gone then."""
        path.replace(name)


def replace_file(disk: Disk, path: Path, data: bytes) -> None:
    """Replace a file: after a power cut at any time it holds the old data or the new.

    Raises:
        OSError: The disk is full, cannot be written, or is gone. The old file stays.
    """
    new = path.with_name(path.name + '.new')
    disk.write(new, data)
    disk.sync(new)
    disk.rename(new, path)
    disk.sync(path.parent)
