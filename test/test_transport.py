# SPDX-License-Identifier: Apache-2.0
"""How messages leave our processes: over UDP, whatever the middleware does by default."""

from pathlib import Path

import pytest
import ros_harness as ros

from homing_node.ros.transport import LOCALHOST, choose_udp

FAST_DDS = 'rmw_fastrtps_cpp'
HERE = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
UDP = {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}


@pytest.mark.parametrize(
    'before, after',
    [
        ({}, UDP),
        ({'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}, UDP),
        (
            HERE,
            {
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
                'FASTRTPS_DEFAULT_PROFILES_FILE': str(LOCALHOST),
            },
        ),
        ({**HERE, 'ROS_STATIC_PEERS': '192.168.0.1'}, {}),
        ({'FASTDDS_BUILTIN_TRANSPORTS': 'DEFAULT'}, {}),
        ({**HERE, 'FASTDDS_DEFAULT_PROFILES_FILE': 'mine.xml'}, {}),
        ({**HERE, 'FASTRTPS_DEFAULT_PROFILES_FILE': 'mine.xml'}, {}),
        (
            {**HERE, 'FASTRTPS_DEFAULT_PROFILES_FILE': ''},
            {
                'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
                'FASTRTPS_DEFAULT_PROFILES_FILE': str(LOCALHOST),
            },
        ),
    ],
)
def test_udp_is_chosen_where_the_user_has_not(before, after):
    environment = dict(before)
    choose_udp(environment, FAST_DDS)
    assert environment == {**before, **after}


def test_another_middleware_is_left_alone():
    environment = dict(HERE)
    choose_udp(environment, 'rmw_cyclonedds_cpp')
    assert environment == HERE


def test_a_process_neither_shares_memory_nor_hears_the_network(tmp_path):
    """The names of its threads tell what it listens to; this one, the client, shares memory."""
    with ros.World(
        tmp_path, ros.node_parameters({'x': {}}), ros.plant_parameters({'x': {}})
    ) as world:
        assert world.client.home('x')['x'].success
        multicast = f'dds.udp.{7400 + 250 * world.domain.number}'
        for process in world.processes:
            names = threads_of(process.process.pid)
            assert any(name.startswith('dds.udp') for name in names)
            assert not any(name.startswith('dds.shm') for name in names)
            assert multicast not in names
        assert any(name.startswith('dds.shm') for name in threads_of('self'))


def threads_of(process):
    return {file.read_text().strip() for file in Path(f'/proc/{process}/task').glob('*/comm')}
