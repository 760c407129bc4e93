# SPDX-License-Identifier: Apache-2.0
"""A setting of the middleware that can stop the setpoints (doc/decisions/0009-transport.md)."""

from collections.abc import Mapping

#: The variables by which a user chooses a profile of Fast DDS, and with it the transports.
PROFILES = ('FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE')
#: The variable by which a user chooses the transports, and those that use no shared memory.
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
WITHOUT_SHARED_MEMORY = ('UDPv4', 'UDPv6', 'TCPv4', 'TCPv6')


def shared_memory_hazard(environment: Mapping[str, str], middleware: str) -> str:
    """Return a warning if messages go through the shared memory of Fast DDS, else ''.

    A process that is killed while it reads there can hold up every publisher for seconds.

    Args:
        environment: The variables of the process.
        middleware: The identifier of the rmw implementation.
    """
    if 'fastrtps' not in middleware or any(map(environment.get, PROFILES)):
        return ''
    local = environment.get('ROS_AUTOMATIC_DISCOVERY_RANGE') == 'LOCALHOST'
    if environment.get(TRANSPORTS) in WITHOUT_SHARED_MEMORY and not local:
        return ''
    remedy = (
        'a profile with UDP alone (FASTRTPS_DEFAULT_PROFILES_FILE), for '
        f'{TRANSPORTS} has no effect with ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST'
        if local
        else f'{TRANSPORTS}=UDPv4'
    )
    return (
        'messages go through the shared memory of Fast DDS: a program that listens and is killed '
        f'can hold up the setpoints for seconds; set {remedy}, for the node and for its drives'
    )
