"""The action, beside the services."""

import pytest
import ros_harness as ros
from action_msgs.msg import GoalStatus
from homing_interfaces.action import Home
from rclpy.action import ActionClient
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

LONG = {'hard_stops': [-0.005, 1.005], 'positive_limit_switch': [1.0, 1.2],
        'home_switch': [0.9, 0.91], 'start': 0.1}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    axes = {'long': {'travel': 1.0}, 'a': {}, 'b': {'home_type': 'HS'}}
    with ros.World(tmp_path_factory.mktemp('action'),
                   ros.node_parameters(axes, home_sequence=['b', 'a']),
                   ros.plant_parameters({'long': LONG, 'a': {}, 'b': {}})) as world:
        client = world.client
        client.homing = ActionClient(client.node, Home, client.name('home'))
        client.until(client.homing.server_is_ready)
        client.home('a')  # the plant is heard
        yield world
        client.homing.destroy()


@pytest.fixture
def client(world):
    yield world.client
    assert world.client.trigger('cancel').success


def send(client, *axes):
    """Send a goal; return its handle, its feedback so far, and the future of its end."""
    feedback = []
    sent = client.homing.send_goal_async(
        Home.Goal(axes=list(axes)), lambda message: feedback.append(message.feedback))
    handle = client.answer(sent)
    assert handle.accepted
    return handle, feedback, handle.get_result_async()


def test_a_goal_homes_axes_in_sequence(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    _, feedback, ended = send(client, 'a', 'b')
    end = client.answer(ended)
    assert end.status == GoalStatus.STATUS_SUCCEEDED
    assert end.result.success
    assert end.result.message.startswith('Homed: ')
    assert [state.axis for state in end.result.states] == ['a', 'b']
    for state in end.result.states:
        assert (state.state, state.homed, state.error) == ('Idle', True, 'NoError')
        assert state.home_position_raw == pytest.approx(0.055, abs=1e-4)
    order = [heard.message.joint_names for heard in setpoints]
    assert order == sorted(order, reverse=True)  # all of b, then all of a
    assert order[0] == ['b']
    assert order[-1] == ['a']
    assert feedback
    for message in feedback:
        assert [state.axis for state in message.states] == ['a', 'b']
        assert len(message.distance_traveled) == len(message.distance_bound) == 2
        for traveled, bound in zip(
                message.distance_traveled, message.distance_bound, strict=True):
            assert traveled >= 0
            assert traveled <= bound or bound == 0  # none


def test_a_goal_that_is_canceled_stops_first(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    handle, feedback, ended = send(client, 'long')
    ros.at_speed(client, setpoints, 'long')
    answer = client.trigger('long/home')
    assert answer.message.startswith('Busy: axis long: ')
    assert 'action' in answer.message
    client.until(lambda: feedback and feedback[-1].distance_traveled[0] > 0.005)
    assert feedback[-1].states[0].state == 'HSSearch'
    traveled = [message.distance_traveled[0] for message in feedback[1:]]
    assert traveled == sorted(traveled)
    canceled = handle.cancel_goal_async()
    end = client.answer(ended, 3.0)
    assert client.answer(canceled).goals_canceling
    assert end.status == GoalStatus.STATUS_CANCELED
    assert not end.result.success
    assert end.result.message.startswith('Canceled: axis long: ')
    (state,) = end.result.states
    assert (state.state, state.homed, state.error) == ('Idle', False, 'Canceled')
    ros.assert_stopped(client, setpoints, 'long', 0.5)


def test_a_goal_that_cannot_run_says_why(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    future = client.send(Trigger, 'long/home')
    ros.at_speed(client, setpoints, 'long')
    for axes, start in (((), 'Busy: axis long: ~/long/home is homing'),
                        (('a', 'long'), 'Busy: axis long: ~/long/home is homing'),
                        (('a', 'q'), "UnknownAxis: 'q' is none of the axes long, a, b")):
        end = client.answer(send(client, *axes)[2], 3.0)
        assert end.status == GoalStatus.STATUS_ABORTED
        assert not end.result.success
        assert end.result.message.startswith(start), end.result.message
    assert not future.done()
    assert {joint for heard in setpoints for joint in heard.message.joint_names} == {'long'}


def test_two_goals_for_different_axes(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    handle, _, ended = send(client, 'long')
    ros.at_speed(client, setpoints, 'long')
    assert client.answer(send(client, 'b')[2]).status == GoalStatus.STATUS_SUCCEEDED
    assert not ended.done()
    client.answer(handle.cancel_goal_async())
    assert client.answer(ended, 3.0).status == GoalStatus.STATUS_CANCELED


def test_the_service_cancels_a_goal(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    _, _, ended = send(client, 'long')
    ros.at_speed(client, setpoints, 'long')
    assert client.trigger('cancel').success
    end = client.answer(ended, 3.0)
    assert end.status == GoalStatus.STATUS_ABORTED
    assert end.result.message.startswith('Canceled: axis long: ')
