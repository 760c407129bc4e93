# SPDX-License-Identifier: Apache-2.0
"""What the demos share: a ROS domain and a transport, and the processes that they start.

Importing it chooses both; do so before anything of ROS is imported.
"""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

#: Messages over UDP alone, within this machine (doc/decisions/0009-transport.md).
PROFILE = ROOT / 'config' / 'localhost_udp.xml'

if 'FASTRTPS_DEFAULT_PROFILES_FILE' not in os.environ:
    os.environ['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(PROFILE)
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SYSTEM_DEFAULT'
os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))


@contextmanager
def process(executable: str, parameters: Path, *arguments: str) -> Iterator[subprocess.Popen]:
    """Run an executable of this package."""
    child = subprocess.Popen(
        [
            Path(sys.executable).with_name(executable),
            '--ros-args',
            '--log-level',
            'warn',
            '--params-file',
            str(parameters),
            *arguments,
        ],
        cwd=ROOT,
    )
    try:
        yield child
    finally:
        child.terminate()
        child.wait()
