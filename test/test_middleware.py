# SPDX-License-Identifier: Apache-2.0
"""When the node warns of shared memory."""

import pytest

from homing_node.ros.middleware import shared_memory_hazard

FAST_DDS = 'rmw_fastrtps_cpp'
LOCAL = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
UDP = {'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4'}
PROFILE = {'FASTRTPS_DEFAULT_PROFILES_FILE': '/some.xml'}


@pytest.mark.parametrize(
    ('environment', 'remedy'),
    [
        ({}, 'set FASTDDS_BUILTIN_TRANSPORTS=UDPv4, for'),
        ({'FASTDDS_BUILTIN_TRANSPORTS': 'SHM'}, 'set FASTDDS_BUILTIN_TRANSPORTS=UDPv4, for'),
        (LOCAL, 'set a profile with UDP alone'),
        ({**LOCAL, **UDP}, 'set a profile with UDP alone'),  # it has no effect there
    ],
)
def test_shared_memory_is_a_hazard(environment, remedy):
    warning = shared_memory_hazard(environment, FAST_DDS)
    assert warning.startswith('messages go through the shared memory of Fast DDS')
    assert remedy in warning


@pytest.mark.parametrize(
    ('environment', 'middleware'),
    [
        (UDP, FAST_DDS),
        (PROFILE, FAST_DDS),
        ({**LOCAL, **PROFILE}, FAST_DDS),
        ({'FASTDDS_DEFAULT_PROFILES_FILE': '/some.xml'}, FAST_DDS),
        ({}, 'rmw_cyclonedds_cpp'),
        (LOCAL, 'rmw_zenoh_cpp'),
    ],
)
def test_other_settings_are_none(environment, middleware):
    assert shared_memory_hazard(environment, middleware) == ''
