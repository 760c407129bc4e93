# SPDX-License-Identifier: Apache-2.0
"""The action, beside the services."""

import os
import statistics
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import pytest
import ros_harness as ros
from action_msgs.msg import GoalStatus, GoalStatusArray
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionClient
from rclpy.time import Time
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

LONG = {
    'hard_stops': [-0.005, 1.005],
    'positive_limit_switch': [1.0, 1.2],
    'home_switch': [0.9, 0.91],
    'start': 0.1,
}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    axes = {'long': {'travel': 1.0}, 'a': {}, 'b': {'home_type': 'HS'}, 'two': {}}
    with ros.World(
        tmp_path_factory.mktemp('action'),
        ros.node_parameters(axes, home_sequence=['b', 'a']),
        ros.plant_parameters({**{axis: {} for axis in axes}, 'long': LONG}),
    ) as world:
        client = world.client
        client.homing = ActionClient(client.node, Home, client.name('home'))
        client.until(client.homing.server_is_ready)
        client.home('a')  # the plant is heard
        yield world
        client.homing.destroy()


@pytest.fixture
def client(world):
    yield world.client
    world.client.rest()


def send(client, *axes):
    """Send a goal; return its handle, its feedback so far, and the future of its end."""
    feedback = []
    sent = client.homing.send_goal_async(
        Home.Goal(axes=list(axes)), lambda message: feedback.append(message.feedback)
    )
    handle = client.answer(sent)
    assert handle.accepted
    return handle, feedback, handle.get_result_async()


def test_a_goal_homes_axes_in_sequence(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    _, feedback, ended = send(client, 'a', 'b')
    client.until(lambda: setpoints)
    waiting = client.set(a__homing_velocity_fast=0.04)  # a waits for b: its run has them already
    assert not waiting.successful
    assert waiting.reason.startswith('a.homing_velocity_fast: axis a: ~/home (action) is homing')
    end = client.answer(ended)
    assert end.status == GoalStatus.STATUS_SUCCEEDED
    assert end.result.success
    assert end.result.error_code == 0
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
        for traveled, bound in zip(message.distance_traveled, message.distance_bound, strict=True):
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


def test_a_goal_whose_client_is_interrupted_is_canceled(client, world):
    """Its process knows the status 0.3 s after the acceptance."""
    ended = subprocess.run(
        [sys.executable, str(Path(__file__).with_name('send_goal.py')), 'long', '0.3'],
        env={**os.environ, 'ROS_DOMAIN_ID': str(world.domain.number)},
        check=True,
        capture_output=True,
        text=True,
        timeout=ros.PATIENCE,
    )
    assert ended.stdout == f'canceled {GoalStatus.STATUS_CANCELED}\n'
    assert 'nothing to cancel' in client.trigger('long/cancel').message


def test_a_goal_is_executed_later_than_accepted(client):
    """A client drops the status that comes before the acceptance, and then does not cancel."""
    statuses = client.record(GoalStatusArray, 'home/_action/status', ros.LATCHED)
    handle, _, ended = send(client, 'long')
    goal = list(handle.goal_id.uuid)

    def executing():
        return [
            heard.sent - Time.from_msg(status.goal_info.stamp).nanoseconds
            for heard in statuses
            for status in heard.message.status_list
            if status.status == GoalStatus.STATUS_EXECUTING
            and list(status.goal_info.goal_id.uuid) == goal
        ]

    client.until(executing)
    client.answer(handle.cancel_goal_async())
    client.answer(ended)
    assert executing()[0] > 0.05e9


def test_a_goal_that_is_canceled_before_it_is_executed(client):
    """It moves nothing."""
    setpoints = client.record(JointTrajectory, 'setpoints')
    handle, _, ended = send(client, 'long')
    client.answer(handle.cancel_goal_async())
    end = client.answer(ended)
    assert end.status == GoalStatus.STATUS_CANCELED
    assert end.result.error_code == AxisState.CANCELED
    assert {joint for heard in setpoints for joint in heard.message.joint_names} <= {'long'}
    if 'before anything moved' in end.result.message:
        assert not setpoints


def test_a_goal_that_cannot_run_says_why(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    future = client.send(Trigger, 'long/home')
    ros.at_speed(client, setpoints, 'long')
    for axes, start in (
        ((), 'Busy: axis long: ~/long/home is homing'),
        (('a', 'long'), 'Busy: axis long: ~/long/home is homing'),
        (('a', 'q'), "UnknownAxis: 'q' is none of the axes long, a, b, two"),
    ):
        end = client.answer(send(client, *axes)[2], 3.0)
        assert end.status == GoalStatus.STATUS_ABORTED
        assert not end.result.success
        assert end.result.message.startswith(start), end.result.message
        assert end.result.error_code in (AxisState.BUSY, AxisState.UNKNOWN_AXIS)
    assert not future.done()
    assert {joint for heard in setpoints for joint in heard.message.joint_names} == {'long'}


def test_an_axis_that_waits_is_canceled(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    _, _, ended = send(client, 'a', 'b')
    client.until(lambda: setpoints)
    assert client.trigger('a/cancel').message == 'canceled, not started: a'
    end = client.answer(ended)
    assert end.status == GoalStatus.STATUS_ABORTED
    assert end.result.message == 'Canceled: axis a: not started: canceled'
    assert end.result.states[1].homed
    assert {joint for h in setpoints for joint in h.message.joint_names} == {'b'}


def test_an_axis_whose_turn_comes_when_its_switch_has_two_publishers(client):
    setpoints = client.record(JointTrajectory, 'setpoints')
    _, _, ended = send(client, 'a', 'b', 'two')
    client.until(lambda: setpoints)
    another = client.node.create_publisher(Bool, client.name('two/home_switch'), 1)
    end = client.answer(ended)
    client.node.destroy_publisher(another)
    assert end.status == GoalStatus.STATUS_ABORTED
    assert end.result.message.startswith('PublisherConflict: axis two: '), end.result.message
    assert [state.homed for state in end.result.states] == [True, True, False]
    assert 'two' not in {joint for h in setpoints for joint in h.message.joint_names}


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


# -- many axes ------------------------------------------------------------------------------------

#: The state in which an axis is canceled -> its home type. All of them begin between the home
#: switch and the limit, so that they meet the limit first. They are sent in this order: the one
#: that has to be canceled first is the last to begin.
CANCELED_IN = {
    'HomeShift': 'HSHS',
    'ZPulseSearchReverse': 'HSReverseZPulse',
    'SecondHSSearch': 'HSHS',
    'HSClearReverse': 'HSHS',
    'HSFallingEdgeSearchReverse': 'HSHS',
    'HSSearch': 'HSHS',
}
#: q fails: its switch is further away than it may search. s would follow.
GROUP = {'p': {'travel': 1.0}, 'q': {'max_search_distance': 0.01}, 'r': {'travel': 1.0}, 's': {}}


@pytest.fixture(scope='module')
def machine(tmp_path_factory):
    switches = ['home_switch', 'positive_limit_switch', 'negative_limit_switch', 'z_pulse']
    # No state is over before a busy machine has told of it and the cancel has come.
    lasting = {
        'homing_velocity_fast': 0.025,
        'homing_reverse_distance': 0.008,
        'home_shift_distance': -0.02,
        'switches': switches,
    }
    axes = {state: {'home_type': home_type, **lasting} for state, home_type in CANCELED_IN.items()}
    axes['HomeShift']['homing_velocity_slow'] = 0.02  # the last of them passes all states
    plant = {**{state: {'start': 0.07} for state in axes}, 'p': LONG, 'q': {}, 'r': LONG, 's': {}}
    sequence = [', '.join(axes), 'p, q, r', 's']
    with ros.World(
        tmp_path_factory.mktemp('machine'),
        ros.node_parameters({**axes, **GROUP}, home_sequence=sequence),
        ros.plant_parameters(plant),
    ) as world:
        client = world.client
        client.homing = ActionClient(client.node, Home, client.name('home'))
        client.until(client.homing.server_is_ready)
        client.home('s')
        yield world
        client.homing.destroy()


@pytest.mark.parametrize('by', ['goal', pytest.param('service', marks=pytest.mark.long)])
def test_cancel_in_each_state(machine, by):
    """Each axis stops within its limits, is not homed, and nothing moves afterwards."""
    client = machine.client
    setpoints = client.record(JointTrajectory, 'setpoints')
    states = {axis: client.record_states(axis) for axis in CANCELED_IN}
    client.until(lambda: all(states.values()))
    goals = {axis: send(client, axis) for axis in CANCELED_IN}
    waiting, canceled, moved = set(goals), [], set()

    def cancel_those_who_are_there():
        for heard in setpoints[-20:]:
            moved.update(heard.message.joint_names)
        for axis in waiting:
            if goals[axis][2].done():  # its state was over before this machine told of it
                goals[axis] = send(client, axis)
        for axis in waiting & moved:
            if states[axis][-1].message.state == axis:
                waiting.discard(axis)
                canceled.append(
                    goals[axis][0].cancel_goal_async()
                    if by == 'goal'
                    else client.send(Trigger, f'{axis}/cancel')
                )
        return not waiting

    client.until(cancel_those_who_are_there)
    for axis, (_, _, ended) in goals.items():
        end = client.answer(ended, 3.0)
        assert end.status == (
            GoalStatus.STATUS_CANCELED if by == 'goal' else GoalStatus.STATUS_ABORTED
        ), axis
        assert end.result.message.startswith(f'Canceled: axis {axis}: '), end.result.message
        assert [(s.state, s.homed) for s in end.result.states] == [('Idle', False)]
        client.until(lambda told=states[axis]: told[-1].message.state == 'Idle')
        # The topic keeps one state: a slow reader may miss Cancel.
        assert [s for s in ros.course(states[axis]) if s != 'Cancel'][-2:] == [axis, 'Idle']
        samples = ros.course_of(setpoints, axis)
        assert samples[-1].velocity == samples[-1].acceleration == 0.0
    count = len(setpoints)
    client.pass_time(0.15)
    assert len(setpoints) == count


def test_one_of_a_group_fails(machine):
    """Its group stops, the next one is not begun, and each axis has a verdict of its own."""
    client = machine.client
    setpoints = client.record(JointTrajectory, 'setpoints')
    _, _, ended = send(client, 'p', 'q', 'r', 's')
    end = client.answer(ended)
    assert end.status == GoalStatus.STATUS_ABORTED
    assert end.result.message.startswith('SearchDistanceExceeded: axis q: '), end.result.message
    assert [(s.axis, s.error, s.homed) for s in end.result.states] == [
        ('p', 'Canceled', False),
        ('q', 'SearchDistanceExceeded', False),
        ('r', 'Canceled', False),
        ('s', 'NoError', True),
    ]  # s keeps the home that it had
    assert all(s.state == 'Idle' for s in end.result.states)
    assert {joint for h in setpoints for joint in h.message.joint_names} == {'p', 'q', 'r'}
    for axis in 'pqr':
        assert ros.course_of(setpoints, axis)[-1].velocity == 0.0


def test_a_late_joiner_receives_the_latched_state(machine):
    client = machine.client
    assert client.home('s')['s'].success
    late = client.record_states('s')
    client.until(lambda: late)
    assert (late[-1].message.state, late[-1].message.homed) == ('Idle', True)


def test_feedback_comes_ten_times_a_second(machine):
    client = machine.client
    setpoints = client.record(JointTrajectory, 'setpoints')
    handle, feedback, ended = send(client, 'p')
    ros.at_speed(client, setpoints, 'p')
    client.until(lambda: len(feedback) >= 11)
    told = [message.states[0].header.stamp for message in feedback]
    seconds = [stamp.sec % 1000 + stamp.nanosec * 1e-9 for stamp in told]
    steps = [later - earlier for earlier, later in pairwise(seconds)]
    assert statistics.median(steps) == pytest.approx(0.1, rel=0.5)
    client.answer(handle.cancel_goal_async())
    client.answer(ended, 3.0)
