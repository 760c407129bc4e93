# SPDX-License-Identifier: Apache-2.0
"""The node in simulated time, with a plant whose every message the test controls."""

import signal
import time
from contextlib import contextmanager

import pytest
import ros_harness as ros
from trajectory_msgs.msg import JointTrajectory

from homing_node.ros.timebase import STANDSTILL


@contextmanager
def simulated_world(folder):
    with ros.World(
        folder,
        ros.node_parameters(
            {'x': {'home_type': 'HS', 'travel': 1.0, 'feedback_timeout': 5.0}}, use_sim_time=True
        ),
    ) as world:
        world.hand = ros.HandPlant(world.client, x=0.0)
        world.first_states = world.client.record_states('x')
        world.without_time = world.client.trigger('x/home').message
        world.client.until(lambda: world.first_states, what='a state before any time')
        world.hand.sim_time = 100_000_000_000
        world.hand.set_levels('x')
        yield world
        world.hand.close()


@pytest.fixture(scope='module')
def simulated(tmp_path_factory):
    with simulated_world(tmp_path_factory.mktemp('simulated')) as world:
        yield world


def test_without_a_time_nothing_begins(simulated):
    assert simulated.without_time == (
        'FeedbackStale: use_sim_time is true, but /clock was not heard, or is at 0'
    )
    first = simulated.first_states[0].message
    assert (first.state, first.homed, first.header.stamp.sec) == ('Idle', False, 0)


def test_simulated_time(simulated):
    client, hand = simulated.client, simulated.hand
    setpoints = client.record(JointTrajectory, 'setpoints')
    states = client.record_states('x')
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')

    hand.held = True  # the clock stands still
    client.pass_time(0.1)
    count = len(setpoints)
    client.pass_time(0.5)  # longer than every timeout
    assert len(setpoints) == count
    assert not future.done()
    hand.held = False
    client.until(lambda: len(setpoints) > count + 20)

    hand.set('x/home_switch', True)
    flag = hand.positions['x']
    answer = client.answer(future)
    assert answer.success, answer.message
    raw = float(answer.message.split('home_position_raw=')[1].split()[0])
    assert raw == pytest.approx(flag, abs=0.05 * 0.02)
    client.until(lambda: states[-1].message.homed)
    assert 100 <= states[-1].message.header.stamp.sec < 200
    ros.assert_within_limits(ros.course_of(setpoints, 'x'), 0.05, 0.5, 20.0)
    hand.set('x/home_switch', False)


def test_what_needs_no_motion_is_answered_while_simulated_time_stands(simulated):
    client, hand = simulated.client, simulated.hand
    hand.held = True
    assert client.servo('x', False).success
    assert client.trigger('x/home').message.startswith('ServoOff: axis x: ')
    assert client.servo('x', True).success
    for service in ('x/cancel', 'cancel'):
        assert client.trigger(service).message == 'nothing to cancel'
    hand.held = False


def test_simulated_time_jumps(simulated):
    client, hand = simulated.client, simulated.hand
    setpoints = client.record(JointTrajectory, 'setpoints')
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    hand.sim_time += 2_000_000_000  # too late for a cycle (1 s), not for the feedback (5 s)
    answer = client.answer(future, 5.0)
    assert answer.message.startswith('CycleLate: axis x: '), answer.message
    ros.assert_stopped(client, setpoints, 'x')


def test_simulated_time_is_set_back(simulated):
    """The run ends with a stop; then the node homes, though its times were there before."""
    client, hand = simulated.client, simulated.hand
    setpoints = client.record(JointTrajectory, 'setpoints')
    states = client.record_states('x')
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    hand.sim_time -= 50_000_000_000
    answer = client.answer(future, 5.0)
    assert answer.message.startswith('CycleLate: axis x: '), answer.message
    ros.assert_stopped(client, setpoints, 'x')

    setpoints.clear()
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    hand.set('x/home_switch', True)
    assert client.answer(future, 5.0).success
    client.until(lambda: states[-1].message.homed)
    hand.sim_time -= 10_000_000_000
    client.until(lambda: not states[-1].message.homed, 5.0)
    hand.set('x/home_switch', False)


def test_a_signal_while_simulated_time_stands(simulated):
    """Nothing can come to rest then; the node ends all the same."""
    client, hand = simulated.client, simulated.hand
    setpoints = client.record(JointTrajectory, 'setpoints')
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    hand.held = True
    client.watch()
    told = time.monotonic()
    simulated.node.signal()
    client.until(lambda: not simulated.node.alive)
    assert simulated.node.wait() == 0
    assert time.monotonic() - told < 3.0
    answer = client.answer(future, 1.0)
    assert not answer.success
    assert answer.message.startswith('Canceled: axis x: '), answer.message


@pytest.mark.long
def test_a_signal_after_a_hold_up(tmp_path):
    """Simulated time went on meanwhile: the axis comes to rest."""
    with simulated_world(tmp_path) as world:
        client = world.client
        setpoints = client.record(JointTrajectory, 'setpoints')
        future = client.start('x')
        ros.at_speed(client, setpoints, 'x')
        client.watch()
        world.node.signal(signal.SIGSTOP)
        client.pass_time(1.5 * STANDSTILL)
        world.node.signal(signal.SIGTERM)
        world.node.signal(signal.SIGCONT)
        client.until(lambda: not world.node.alive)
        assert world.node.wait() == 0
        assert 'stood still' not in client.answer(future, 1.0).message
        ros.assert_stopped(client, setpoints, 'x')
