# SPDX-License-Identifier: Apache-2.0
"""How messages leave a process: over UDP, not through shared memory, unless the user has chosen.

On one machine Fast DDS hands messages over in shared memory, where each receiver has a queue with
a lock. A receiver that is killed at the wrong moment leaves it locked, and whoever sends to it
waits: a second for each message, with the interpreter's lock. Over UDP nobody waits for one.
"""

from collections.abc import MutableMapping
from pathlib import Path

#: What a user chooses the transports of Fast DDS by.
CHOICES = (
    'FASTDDS_BUILTIN_TRANSPORTS',
    'FASTDDS_DEFAULT_PROFILES_FILE',
    'FASTRTPS_DEFAULT_PROFILES_FILE',
)
#: The range LOCALHOST, for which rmw_fastrtps has transports of its own, without shared memory.
LOCALHOST = Path(__file__).with_name('localhost.xml')


def choose_udp(environment: MutableMapping[str, str], middleware: str) -> None:
    """Let Fast DDS use UDP alone in this process; before ``rclpy.init``.

    ``middleware`` is the identifier of the rmw. What the user has chosen stays, and so does
    LOCALHOST with static peers.
    """
    if 'fastrtps' not in middleware or any(map(environment.get, CHOICES)):
        return
    if environment.get('ROS_AUTOMATIC_DISCOVERY_RANGE') != 'LOCALHOST':
        environment['FASTDDS_BUILTIN_TRANSPORTS'] = 'UDPv4'
    elif not environment.get('ROS_STATIC_PEERS'):
        environment['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'SYSTEM_DEFAULT'
        environment['FASTRTPS_DEFAULT_PROFILES_FILE'] = str(LOCALHOST)
