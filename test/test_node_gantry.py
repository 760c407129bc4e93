# SPDX-License-Identifier: Apache-2.0
"""A gantry between real processes: two simulated axes are its two sides, without a spring."""

import pytest
import ros_harness as ros
from action_msgs.msg import GoalStatus
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

#: The follower of y is 1 mm behind at the start, and its switches sit 0.3 mm further.
SKEW, OFFSET = -0.001, 0.0003
SIDE = {**ros.LAYOUT, 'home_switch': [0.055, 0.07]}


def follower_layout(skew=SKEW, offset=OFFSET):
    moved = {
        name: [value[0] + offset, value[1] + offset]
        for name, value in SIDE.items()
        if isinstance(value, list) and name != 'hard_stops'
    }
    return {**SIDE, **moved, 'start': 0.04 + skew}


def gantry(name, plant, **changes):
    """Return the parameters of a gantry whose follower is another simulated axis."""
    own = changes.pop('own', {})
    topics = {
        f'topics.{switch}': f'/homing_node/{plant}/{switch}'
        for switch in ('home_switch', 'positive_limit_switch', 'negative_limit_switch')
    }
    return {
        'joint': f'{name}_joint',
        'followers': [f'{name}2'],
        'max_skew': 0.002,
        f'{name}2': {'joint': f'{plant}_joint', 'switch_offset': OFFSET, **topics, **own},
        **changes,
    }


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    plant = {'y': SIDE, 'other': follower_layout(), 'x': SIDE}
    plant |= {'dead': {**follower_layout(), 'home_switch': [0.4, 0.41]}}
    plant |= {'z': SIDE}
    for name in ('c', 'e'):
        plant |= {name: SIDE, f'{name}_other': follower_layout(skew=-0.0019)}
    parameters = ros.node_parameters(
        {
            'y': gantry('y', 'other'),
            'x': {'joint': 'x_joint'},
            'z': gantry('z', 'dead'),
            **{
                name: gantry(name, f'{name}_other', homing_velocity_slow=0.002)
                for name in ('c', 'e')
            },
        },
    )
    joints = {f'{name}.joint': f'{name}_joint' for name in plant}
    with ros.World(
        tmp_path_factory.mktemp('gantry'),
        parameters,
        {**ros.plant_parameters(plant), **joints},
    ) as running:
        yield running


def state_of(states):
    return states[-1].message


def squared(client, states):
    """Return the members of a gantry that has just homed."""
    client.until(lambda: states and state_of(states).homed, what='a homed gantry')
    leader, follower = state_of(states).members
    assert (leader.name, follower.name) == ('y', 'y2')
    assert (leader.joint, follower.joint) == ('y_joint', 'other_joint')
    return leader, follower


def test_a_gantry_homes_square_beside_a_single_axis(world):
    client = world.client
    states = client.record_states('y')
    setpoints = client.record(JointTrajectory, 'setpoints')
    homed = client.record(JointState, 'joint_states')
    answers = client.home('x', 'y')
    answer = answers['y']
    assert answers['x'].success
    assert answer.success, answer.message
    leader, follower = squared(client, states)
    assert abs(follower.squareness) <= 5e-5 + follower.uncertainty
    assert abs(follower.home_position_raw - 0.0553) <= follower.uncertainty
    assert abs(follower.skew + SKEW) < 1e-4  # it has moved so much more than the leader
    assert abs(follower.position - leader.position) < 1e-4  # that is square on this plant
    path = ros.course(states)
    assert path[-5:] == ['HomeShift', 'Squaring', 'Proving', 'HomeShift', 'Idle']
    client.until(lambda: homed and 'other_joint' in homed[-1].message.name)
    at = dict(zip(homed[-1].message.name, homed[-1].message.position, strict=True))
    assert abs(at['other_joint'] - at['y_joint']) < 1e-4
    for one in setpoints:  # killed at any time, the node leaves a stop of both sides
        if 'y_joint' in one.message.joint_names:
            assert set(one.message.joint_names) - {'x_joint'} == {'y_joint', 'other_joint'}
            last = one.message.points[-1]
            places = dict(zip(one.message.joint_names, last.positions, strict=True))
            assert not any(last.velocities)
            assert abs(places['other_joint'] - places['y_joint'] - SKEW) <= 0.002
    alone = ros.course_of(setpoints, 'y_joint'), ros.course_of(setpoints, 'other_joint')
    for samples in alone:
        ros.assert_within_limits(samples, 0.05, 0.5, 20.0)


def test_a_follower_cannot_be_asked_for_alone(world):
    client = world.client
    for name in ('y2', 'y.y2'):
        act = ActionClient(client.node, Home, client.name('home'))
        client.until(act.server_is_ready)
        goal = client.answer(act.send_goal_async(Home.Goal(axes=[name])))
        result = client.answer(goal.get_result_async())
        act.destroy()
        assert result.status == GoalStatus.STATUS_ABORTED
        assert result.result.error_code == AxisState.UNKNOWN_AXIS
        assert 'is a follower of the gantry y: home y' in result.result.message
    names = dict(client.node.get_service_names_and_types())
    assert '/homing_node/y/home' in names and not any('/y2/' in name for name in names)


def test_the_direction_of_a_gantry_stays(world):
    """With another one a mirrored side would be driven against the others."""
    result = world.client.set(y__home_direction='Negative')
    assert not result.successful and 'y.home_direction' in result.reason


def test_a_dead_switch_of_a_follower_stops_both_sides(world):
    client = world.client
    setpoints = client.record(JointTrajectory, 'setpoints')
    answer = client.home('z')['z']
    assert not answer.success
    assert answer.message.startswith('FollowerSwitchMissing: axis z: the home switch of z.z2')
    for joint in ('z_joint', 'dead_joint'):
        samples = ros.course_of(setpoints, joint)
        assert samples[-1].velocity == 0.0
        assert samples[-1].position - samples[0].position < 0.025


@pytest.mark.parametrize(
    ('name', 'error'), [('c', 'Canceled'), ('e', 'EmergencyStop')], ids=['cancel', 'stop']
)
def test_a_gantry_stops_while_it_squares(world, name, error):
    """Only the follower moves then: it stops on its own path, and the gantry is not homed."""
    client = world.client
    states = client.record_states(name)
    setpoints = client.record(JointTrajectory, 'setpoints')
    asking = client.asking_to_home(name)
    stop = client.node.create_publisher(Bool, client.name('emergency_stop'), 1)

    def squares():
        refusal = asking.answer()
        assert refusal is None, refusal.message
        return states and state_of(states).state == 'Squaring'

    client.until(squares, timeout=40.0, what='Squaring')
    begun = len(setpoints)
    client.until(lambda: len(setpoints) > begun + 5)
    if error == 'Canceled':
        assert client.trigger(f'{name}/cancel').success
    else:
        client.until(lambda: stop.get_subscription_count() > 0)
        stop.publish(Bool(data=True))
    client.until(lambda: asking.answer(), what='an answer')
    answer = asking.answer()
    assert not answer.success and answer.message.startswith(error), answer.message
    if error == 'EmergencyStop':
        stop.publish(Bool(data=False))
    client.node.destroy_publisher(stop)
    client.until(lambda: state_of(states).state == 'Idle')
    assert not state_of(states).homed
    samples = ros.course_of(setpoints, f'{name}_other_joint')
    assert samples[-1].velocity == 0.0
    ros.assert_within_limits(samples, 0.05, 1.0, 20.0)
