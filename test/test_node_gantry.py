# SPDX-License-Identifier: Apache-2.0
"""A gantry between real processes: its sides are two simulated axes, or have a spring between."""

import signal

import pytest
import ros_harness as ros
from action_msgs.msg import GoalStatus
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionClient
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from trajectory_msgs.msg import JointTrajectory

#: The follower of y is 1 mm behind at the start, and its switches sit 0.3 mm further.
SKEW, OFFSET = -0.001, 0.0003
SIDE = {**ros.LAYOUT, 'home_switch': [0.055, 0.07]}
#: N/m, and what the spring of these gantries may bear, N.
STIFFNESS = 2e5
MOST_FORCE = STIFFNESS * 0.002


def follower_layout(skew=SKEW, offset=OFFSET):
    moved = {
        name: [value[0] + offset, value[1] + offset]
        for name, value in SIDE.items()
        if isinstance(value, list) and name != 'hard_stops'
    }
    return {**SIDE, **moved, 'start': 0.04 + skew}


def sprung(name, skew=-0.0019):
    """Return the layout of a gantry with a spring, its follower that far behind."""
    moved = follower_layout(skew)
    own = {key: moved[key] for key in ('home_switch', 'start')}
    return {**SIDE, 'followers': [f'{name}2'], f'{name}2': {**own, 'stiffness': STIFFNESS}}


def slow_gantry(name):
    """Return the parameters of a gantry whose squaring takes long enough to be met."""
    own = {'joint': f'{name}2_joint', 'switch_offset': OFFSET}
    return {
        'joint': f'{name}_joint',
        'followers': [f'{name}2'],
        'max_skew': 0.002,
        'homing_velocity_slow': 0.003,
        f'{name}2': own,
    }


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
    plant |= {name: sprung(name) for name in ('e', 'k')}
    parameters = ros.node_parameters(
        {
            'y': gantry('y', 'other'),
            'x': {'joint': 'x_joint'},
            'z': gantry('z', 'dead'),
            **{name: slow_gantry(name) for name in ('e', 'k')},
        },
    )
    joints = {f'{name}.joint': f'{name}_joint' for name in plant}
    joints |= {f'{name}.{name}2.joint': f'{name}2_joint' for name in ('e', 'k')}
    with ros.World(
        tmp_path_factory.mktemp('gantry'),
        parameters,
        {**ros.plant_parameters(plant), **joints},
    ) as running:
        running.parameters = parameters
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
    result = world.client.set(y__y2__switch_offset=0.1)  # what is a follower's own stays, too
    assert not result.successful and 'read-only' in result.reason, result.reason


def test_a_dead_switch_of_a_follower_stops_both_sides(world):
    client = world.client
    setpoints = client.record(JointTrajectory, 'setpoints')
    answer = client.home('z')['z']
    assert not answer.success
    assert answer.message.startswith('FollowerSwitchMissing: axis z: the home switch of z.z2')
    for joint in ('z_joint', 'dead_joint'):
        samples = ros.course_of(setpoints, joint)
        assert samples[-1].velocity == 0.0
        # 15 mm to the leader's switch, max_skew and the offset, 50 and 20 ms of patience, 2.5 mm
        # to stop; and on a busy machine 0.1 s until all of that is heard.
        most = 0.015 + 0.0023 + 0.0035 + 0.0025 + 0.05 * 0.1
        assert samples[-1].position - samples[0].position < most


def home_until(client, name, state):
    """Ask a gantry to home; return the request once the gantry is in a state and moves there."""
    states = client.record_states(name)
    asking = client.asking_to_home(name)

    def is_there():
        refusal = asking.answer()
        assert refusal is None, refusal.message
        return states and state_of(states).state == state

    client.until(is_there, timeout=40.0, what=state)
    setpoints = client.record(JointTrajectory, 'setpoints')
    client.until(lambda: len(setpoints) > 5)
    return asking


def assert_ends(client, name, asking, error):
    """Check that a run ends with an error, not homed."""
    answer = client.until(asking.answer, what='an answer')
    assert not answer.success and answer.message.startswith(error), answer.message
    states = client.record_states(name)
    client.until(lambda: states and state_of(states).state == 'Idle')
    assert not state_of(states).homed


def forces_of(client, name):
    """Record what the spring of a gantry bears."""
    return client.record(Float64, f'/simulated_axes/{name}/{name}2/racking_force')


def assert_square(client, name, forces):
    """Home a gantry, and check that the spring never bore more than max_skew is worth."""
    answer = client.home(name)[name]
    assert answer.success, answer.message
    heard = len(forces)
    client.until(lambda: len(forces) > heard + 50)
    assert max(abs(one.message.data) for one in forces) <= MOST_FORCE
    assert abs(forces[-1].message.data) <= STIFFNESS * 7e-5


def stop_of(client):
    """Return the publisher of the emergency stop, once the node listens."""
    stop = client.node.create_publisher(Bool, client.name('emergency_stop'), 1)
    client.until(lambda: stop.get_subscription_count() > 0)
    return stop


def test_an_emergency_stop_in_squaring(world):
    """Only the follower moves then: it stops on its own path, and the gantry is not homed."""
    client = world.client
    forces, stop = forces_of(client, 'e'), stop_of(client)
    setpoints = client.record(JointTrajectory, 'setpoints')
    asking = home_until(client, 'e', 'Squaring')
    stop.publish(Bool(data=True))
    assert_ends(client, 'e', asking, 'EmergencyStop')
    stop.publish(Bool(data=False))
    samples = ros.course_of(setpoints, 'e2_joint')
    assert samples[-1].velocity == 0.0
    ros.assert_within_limits(samples, 0.05, 1.0, 20.0)
    assert max(abs(one.message.data) for one in forces) <= MOST_FORCE
    client.node.destroy_publisher(stop)


@pytest.mark.long
def test_the_node_is_killed_in_squaring_and_its_successor_canceled_in_proving(world):
    """The machine comes to rest by what it was told; a new node squares what is left.

    After the cancel the gantry is square, but not homed.
    """
    client = world.client
    forces = forces_of(client, 'k')
    home_until(client, 'k', 'Squaring')
    world.processes.remove(world.node)
    client.watch(*world.processes)
    world.node.signal(signal.SIGKILL)
    world.node.wait()
    feedback = client.record(JointState, '/joint_states')

    def rests():
        newest = [one.message for one in feedback[-50:]]
        places = [one.position[one.name.index('k2_joint')] for one in newest]
        return len(newest) == 50 and max(places) - min(places) < 1e-6

    client.until(rests, what='rest')
    world.node = world.run('homing_node', world.parameters)
    client.watch(*world.processes)
    states = client.record_states('k')
    client.until(lambda: any(one.sent > feedback[-50].sent for one in states), what='a new node')
    assert not state_of(states).homed
    asking = home_until(client, 'k', 'Proving')
    assert client.trigger('k/cancel').success
    assert_ends(client, 'k', asking, 'Canceled')
    assert_square(client, 'k', forces)


# ----------------------------------------------------- what only a plant by hand does to a gantry


@pytest.fixture(scope='module')
def hand(tmp_path_factory):
    """A gantry whose switches stay off; the test moves its sides, and switches its drives."""
    inputs = ['home_switch', 'positive_limit_switch', 'negative_limit_switch', 'servo_enabled']
    own = gantry('y', 'other')
    own['y2'] = {'joint': 'other_joint'}
    parameters = ros.node_parameters({'y': {**own, 'switches': inputs, 'travel': 1.0}})
    with ros.World(tmp_path_factory.mktemp('hand'), parameters) as running:
        plant = ros.HandPlant(running.client, y_joint=0.0, other_joint=0.1)
        for side in ('y', 'y/y2'):
            plant.set_levels(side)
            plant.until_heard(f'{side}/servo_enabled', True)
        running.hand = plant
        yield running
        plant.close()


def moving(world):
    """Start the gantry; return its request and the setpoints, once it is fast."""
    client = world.client
    setpoints = client.record(JointTrajectory, 'setpoints')
    asking = client.asking_to_home('y')

    def is_fast():
        refusal = asking.answer()
        assert refusal is None, refusal.message
        samples = ros.course_of(setpoints[-5:], 'y_joint')
        return samples and samples[-1].velocity > 0.0499

    client.until(is_fast, what='motion')
    return asking, setpoints


def test_the_feedback_of_one_side_stands_still(hand):
    """Both sides stop; what was racked then is not added to by the next run."""
    client, plant = hand.client, hand.hand
    asking, setpoints = moving(hand)
    plant.hard_stops['other_joint'] = plant.positions['other_joint']
    answer = client.until(asking.answer, what='an answer')
    assert answer.message.startswith('SkewTooLarge: axis y: y.y2 is '), answer.message
    for joint in ('y_joint', 'other_joint'):
        samples = ros.course_of(setpoints, joint)
        assert samples[-1].velocity == 0.0
        ros.assert_within_limits(samples, 0.05, 1.0, 20.0)
    again = client.trigger('y/home')
    assert again.message.startswith('SkewTooLarge'), again.message
    assert 'before the run that failed' in again.message
    assert client.servo('y', False).success
    del plant.hard_stops['other_joint']
    plant.positions['other_joint'] = plant.positions['y_joint'] + 0.1  # squared by hand
    assert client.servo('y', True).success


@pytest.mark.parametrize('side', ['y', 'y/y2'])
def test_the_drive_of_one_side_trips(hand, side):
    """The other one comes to rest; then the node switches both off."""
    client, plant = hand.client, hand.hand
    told = {one: client.record(Bool, f'{one}/servo_on', ros.LATCHED) for one in ('y', 'y/y2')}
    asking, _ = moving(hand)
    plant.set(f'{side}/servo_enabled', False)
    answer = client.until(asking.answer, what='an answer')
    name = side.replace('/', '.')
    wanted = f'ServoOff: axis y: the drive of {name} switched its servo off'
    assert answer.message.startswith(wanted), answer.message
    client.until(lambda: all(one and not one[-1].message.data for one in told.values()))
    assert client.trigger('y/home').message.startswith('ServoOff')
    plant.until_heard(f'{side}/servo_enabled', True)
    assert client.servo('y', True).success
