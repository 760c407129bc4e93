# SPDX-License-Identifier: Apache-2.0
"""Drivers as real machines have them, between processes: `simulated_axes` publishes as they do.

The cases are those of doc/faults.md.
"""

import re
from itertools import pairwise

import pytest
import ros_harness as ros
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

#: Where the home switch turns on, m.
EDGE = ros.LAYOUT['home_switch'][0]
#: What computing rounds, m.
ROUNDING = 1e-9


def world(folder, values, plant, **axis):
    return ros.World(
        folder,
        ros.node_parameters({'x': {'max_jerk': 200.0, **values}}),
        ros.plant_parameters({'x': {'lag': 0.002, **axis}}, **plant),
    )


def homed(client):
    """Home the axis; return where home is, how far that may be wrong, m, and the message."""
    answer = client.home('x')['x']
    assert answer.success, answer.message
    numbers = dict(re.findall(r'(\w+)=([-+.e\d]+)', answer.message))
    return float(numbers['home_position_raw']), float(numbers['uncertainty']), answer.message


@pytest.mark.long
def test_a_switch_that_is_polled_and_passed_twice(tmp_path):
    """Case 1: 50 Hz, HSHS from 100 to 10 mm/s."""
    values = {'homing_velocity_fast': 0.1, 'homing_velocity_slow': 0.01}
    with world(tmp_path, values, {'switch_rate': 50.0}, home_switch=[0.055, 0.075]) as one:
        heard = one.client.record(Bool, 'x/home_switch')
        for _ in range(3):
            home, uncertainty, _ = homed(one.client)
            assert abs(home - EDGE) <= uncertainty + ROUNDING
            # Half of the gap and the stamps leave 0.12 mm open; a busy machine polls later.
            assert 0.01 * 0.009 <= uncertainty <= 1.2 * 0.01 * (0.5 * longest(heard) + 0.002)


def longest(heard):
    """Return the longest time between two messages, s."""
    sent = [one.sent for one in heard]
    return max(b - a for a, b in pairwise(sent)) * 1e-9


def test_a_switch_that_is_polled_seldom(tmp_path):
    """Case 2: 5 Hz, HS at 50 mm/s."""
    values = {'home_type': 'HS', 'following_error': 0.02}
    with world(tmp_path, values, {'switch_rate': 5.0}, home_switch=[0.055, 0.075]) as one:
        states = one.client.record_states('x')
        home, uncertainty, _ = homed(one.client)
        assert abs(home - EDGE) <= uncertainty + ROUNDING
        assert 0.05 * 0.09 <= uncertainty <= 1.2 * 0.05 * 0.15
        told = one.client.until(lambda: [s for s in states if s.message.homed])[-1].message.message
        assert 'times a second' in told + one.node.output


@pytest.mark.long
@pytest.mark.parametrize('offset', [-0.1, 0.1])
def test_a_header_clock_of_its_own(tmp_path, offset):
    """Case 3: the stamps of the feedback are 0.1 s beside the sending, HS at 50 mm/s."""
    with world(tmp_path, {'home_type': 'HS'}, {'header_clock_offset': offset}) as one:
        home, uncertainty, _ = homed(one.client)
        assert abs(home - EDGE) <= uncertainty + ROUNDING
        assert 'feedback_clock' in one.node.output
        if offset < 0.0:  # both readings are possible, 5 mm apart
            assert uncertainty >= 0.05 * 0.04  # a busy machine slows the axis down


@pytest.mark.long
def test_a_driver_that_reads_seldom(tmp_path):
    """A staircase: read at 50 Hz, published at 500 Hz."""
    with world(tmp_path, {'home_type': 'HS'}, {'feedback_read_rate': 50.0}) as one:
        feedback = one.client.record(JointState, '/joint_states')
        home, uncertainty, _ = homed(one.client)
        positions = [heard.message.position[0] for heard in feedback]
        assert len(set(positions)) < len(positions) / 5
        assert abs(home - EDGE) <= uncertainty + ROUNDING


def test_two_sources_of_one_joint(tmp_path):
    """Case 4: a second node says that the joint is at 0; no run starts."""
    plant = {'feedback_rate': 100.0, 'second_source': 20.0}
    with world(tmp_path, {}, plant, start=0.05) as one:
        setpoints = one.client.record(JointTrajectory, 'setpoints')
        answer = one.client.home('x')['x']
        assert not answer.success
        error, _, text = answer.message.partition(': ')
        assert error == 'PublisherConflict'
        for said in ("'x'", '0.05', '/simulated_axes', '/second_source'):
            assert said in text
        assert not setpoints


@pytest.mark.long
def test_a_heartbeat_is_no_polling(tmp_path):
    """A switch that is published on change and repeats its level is as exact as ever.

    Its driver proves that by a change that comes early, which about every other run has; and a
    home whose edge comes when the next repeat is due stays open.
    """
    values = {'home_type': 'HS', 'switch_stamp_error': 0.0005}
    with world(tmp_path, values, {'switch_heartbeat': 0.3, 'switch_jitter': 0.3}) as one:
        for _ in range(12):
            home, uncertainty, _ = homed(one.client)
            assert abs(home - EDGE) <= uncertainty + ROUNDING
            if uncertainty <= 0.05 * 0.005:
                return
        pytest.fail('none of twelve homes was exact')
