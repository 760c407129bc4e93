# SPDX-License-Identifier: Apache-2.0
"""The folder of the files of a node: where it is, whose it is, and which machine this is."""

import fcntl
import hashlib
import os
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from .disk import Disk
from .records import Head
from .store import Store

#: The end of the name of a file of an axis, and the name of the lock.
SUFFIX, LOCK = '.jsonl', 'lock'


class FolderInUse(OSError):
    """Another node has the folder."""


def folder_path(value: str, node: str, environment: Mapping[str, str]) -> Path | None:
    """Return where the files are, None if nothing is kept.

    Args:
        value: The parameter `memory`; `$ROS_HOME`, `~` and `<node>` stand for what they name.
        node: The full name of the node, with its namespace.
        environment: The variables of the process.
    """
    if not value:
        return None
    home = environment.get('HOME') or '~'
    ros_home = environment.get('ROS_HOME') or f'{home}/.ros'
    text = value.replace('$ROS_HOME', ros_home).replace('<node>', node.strip('/'))
    return Path(text).expanduser()


def this_machine(machine_id: Path = Path('/etc/machine-id')) -> str:
    """Return what tells this machine from others: a hash of its id, else of its name."""
    try:
        text = machine_id.read_text().strip()
    except OSError:
        text = ''
    return hashlib.sha256((text or socket.gethostname()).encode()).hexdigest()[:16]


def this_boot(boot_id: Path = Path('/proc/sys/kernel/random/boot_id')) -> str:
    """Return the id of the present boot of the host, '' if there is none."""
    try:
        return boot_id.read_text().strip()
    except OSError:
        return ''


class Folder:
    """A folder that one node at a time uses.

    Attributes:
        path: Where it is.
        warning: Why nothing can be written there, '' if it can.
    """

    def __init__(self, path: Path, owner: str, disk: Disk | None = None) -> None:
        """Take the folder.

        Raises:
            FolderInUse: Another node has it.
        """
        self.path = path
        self.warning = ''
        self._disk = disk or Disk()
        self._lock: TextIO | None = None
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = (path / LOCK).open('a+')
        except OSError as error:
            self.warning = f'{path}: {error.strerror or error}'
            return
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._lock.seek(0)
            other = self._lock.read().strip() or 'another node'
            self._lock.close()
            raise FolderInUse(f'{path} is in use by {other}') from None
        try:
            self._lock.truncate(0)
            self._lock.write(f'{owner} (process {os.getpid()})')
            self._lock.flush()
        except OSError as error:
            self.warning = f'{path}: {error.strerror or error}'

    def store(self, axis: str, machine: str) -> Store:
        """Return the file of an axis."""
        return Store(self.path / f'{axis}{SUFFIX}', Head(axis, machine), self._disk)

    def release(self) -> None:
        """Let another node take the folder."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None
