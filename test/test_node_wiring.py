# SPDX-License-Identifier: Apache-2.0
"""Wiring mistakes and shared inputs between processes; the cases are those of doc/faults.md."""

import pytest
import ros_harness as ros
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

HOME, POSITIVE, NEGATIVE = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'
#: Axes and what is special of each. The switches of all are published by the test.
AXES = {
    'stopped': {},
    # case 7: one home switch for two axes
    'left': {'switches': [HOME], 'topics': {HOME: '/io/shared'}},
    'right': {'switches': [HOME], 'topics': {HOME: '/io/shared'}},
    # both limits in series
    'series': {'topics': {POSITIVE: '/io/limits', NEGATIVE: '/io/limits'}},
    # case 13: something else moves it; case 23: its switches are dead
    'moving': {},
    'jammed': {'homing_velocity_fast': 0.06, 'following_error': 0.0},
    # case 21: normally closed, and nobody told so
    'closed': {'max_search_distance': 0.02},
}


@pytest.fixture(scope='module')
def wired(tmp_path_factory):
    """Run a node; an emergency stop was published before it began (case 11)."""
    domain = ros.Domain()
    client = ros.Client(domain)
    plant = ros.HandPlant(client, **dict.fromkeys(AXES, 0.1))
    plant.announce('emergency_stop').publish(Bool(data=True))
    axes = {
        axis: {**ros.AXIS, 'home_type': 'HS', 'travel': 0.5, **values}
        for axis, values in AXES.items()
    }
    parameters = {**ros.node_parameters(axes), 'ready_timeout': 2.0}
    node = ros.Process('homing_node', tmp_path_factory.mktemp('wired'), domain, parameters)
    client.watch(node)
    try:
        for axis, values in AXES.items():
            topics = values.get('topics', {})
            for name in values.get('switches', [HOME, POSITIVE, NEGATIVE]):
                plant.until_heard(topics.get(name, f'{axis}/{name}'), False)
        yield client, plant
    finally:
        plant.close()
        client.watch()
        node.signal()
        node.wait()
        client.close()
        domain.release()


@pytest.fixture
def client(wired):
    return wired[0]


@pytest.fixture
def plant(wired, request):
    """Let go of the emergency stop, but for the test that asks about it."""
    if 'emergency_stop' not in request.node.name:
        wired[1].set('emergency_stop', False)
    return wired[1]


def test_case_11_an_emergency_stop_from_before_the_start_is_heard(client, plant):
    setpoints = client.record(JointTrajectory, 'setpoints')
    answer = client.trigger('stopped/home')
    assert not answer.success
    assert answer.message.startswith('EmergencyStop: axis stopped: '), answer.message
    assert not setpoints
    plant.set('emergency_stop', False)
    plant.set('stopped/home_switch', True)
    plant.set('stopped/positive_limit_switch', True)
    plant.set('stopped/negative_limit_switch', True)  # refused: nothing shall move
    client.until(lambda: client.trigger('stopped/home').message.startswith('LimitsBothOn'))


def test_case_8_one_input_is_home_switch_and_limit(tmp_path):
    """Limit ahead and home switch are one input; another home switch is copied from a limit."""
    axes = {
        'ahead': {'topics': {HOME: '/io/end', POSITIVE: '/io/end'}},
        'behind': {'topics': {HOME: '/io/other_end', NEGATIVE: '/io/other_end'}},
    }
    domain = ros.Domain()
    node = ros.Process('homing_node', tmp_path, domain, ros.node_parameters(axes))
    assert node.wait() == 1
    assert 'axis ahead: home_switch and positive_limit_switch are one input' in node.output
    assert 'home_type: LS, or switches without positive_limit_switch' in node.output
    assert 'axis behind: home_switch and negative_limit_switch are one input' in node.output
    assert 'home_type: LS with home_direction: Negative' in node.output
    domain.release()


def test_case_7_a_shared_home_switch(client, plant):
    """Two axes never home on it at once, and not while it is on because of the other axis."""
    setpoints = client.record(JointTrajectory, 'setpoints')
    future = client.start('left')
    ros.at_speed(client, setpoints, 'left')
    answer = client.trigger('right/home')
    assert answer.message.startswith('Busy: axis right: '), answer.message
    assert 'left' in answer.message
    plant.set('/io/shared', True)
    assert client.answer(future).success
    answer = client.trigger('right/home')
    assert answer.message.startswith('SwitchUnknown: axis right: '), answer.message
    assert 'left' in answer.message
    assert 'right' not in {j for heard in setpoints for j in heard.message.joint_names}


def test_a_limit_in_series_reverses_as_the_limit_ahead(client, plant):
    setpoints = client.record(JointTrajectory, 'setpoints')
    future = client.start('series')
    ros.at_speed(client, setpoints, 'series')
    plant.set('/io/limits', True)
    client.until(lambda: ros.course_of(setpoints, 'series')[-1].velocity < -0.01)
    plant.set('/io/limits', False)
    plant.set('series/home_switch', True)
    client.pass_time(0.1)
    plant.set('series/home_switch', False)
    client.until(lambda: ros.course_of(setpoints, 'series')[-1].velocity > 0.01)
    plant.set('series/home_switch', True)
    answer = client.answer(future)
    assert answer.success, answer.message


def test_case_21_a_polarity_that_was_forgotten_is_named(client, plant):
    plant.set('closed/home_switch', True)
    setpoints = client.record(JointTrajectory, 'setpoints')
    future = client.start('closed')
    client.until(lambda: ros.course_of(setpoints, 'closed'))
    plant.set('closed/negative_limit_switch', True)
    answer = client.answer(future)
    assert not answer.success
    assert 'invert_hs_polarity' in answer.message, answer.message


def test_case_13_an_axis_that_something_else_moves(client, plant):
    setpoints = client.record(JointTrajectory, 'setpoints')
    begun = plant.positions['moving']
    plant.drift['moving'] = -0.02
    client.until(lambda: plant.positions['moving'] < begun - 0.004)
    answer = client.trigger('moving/home')
    assert answer.message.startswith('AxisMoving: axis moving: '), answer.message
    assert 'the axis moves at 0.0' in answer.message
    assert not setpoints
    plant.drift['moving'] = 0.0


def test_case_23_dead_switches_end_soon_behind_the_hard_stop(client, plant):
    """And case 5: an axis that does not follow is never homed."""
    setpoints = client.record(JointTrajectory, 'setpoints')
    plant.hard_stops['jammed'] = plant.positions['jammed'] + 0.02
    answer = client.answer(client.start('jammed'))
    assert answer.message.startswith('FollowingError: axis jammed: '), answer.message
    furthest = max(one.position for one in ros.course_of(setpoints, 'jammed'))
    # The default of following_error, and the way of a busy machine in 50 ms.
    assert furthest - plant.hard_stops['jammed'] < 0.06 * 0.05 + 0.001 + 0.06 * 0.05
