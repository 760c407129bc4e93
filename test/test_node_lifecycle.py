# SPDX-License-Identifier: Apache-2.0
"""A managed node whose manager does everything at the wrong time."""

import pytest
import ros_harness as ros
from homing_interfaces.action import Home, Jog
from homing_interfaces.msg import AxisState
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetAvailableTransitions, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient
from std_srvs.srv import SetBool, Trigger

#: Two processes, and runs that are slow enough to be disturbed.
pytestmark = pytest.mark.long

CONFIGURE, ACTIVATE = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
DEACTIVATE, CLEANUP = Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP
UNCONFIGURED, INACTIVE = State.PRIMARY_STATE_UNCONFIGURED, State.PRIMARY_STATE_INACTIVE
ACTIVE, FINALIZED = State.PRIMARY_STATE_ACTIVE, State.PRIMARY_STATE_FINALIZED
SHUTDOWN = Transition.TRANSITION_ACTIVE_SHUTDOWN
AXES = {'x': {}, 'z': {'home_type': 'CurrentPos', 'switches': []}}


class Managed:
    def __init__(self, folder):
        parameters = ros.node_parameters(
            {axis: {'feedback_timeout': 2.0, **own} for axis, own in AXES.items()},
            update_rate=100.0,
            lifecycle=True,
            ready_timeout=5.0,
        )
        plant = ros.plant_parameters({axis: {} for axis in AXES}, feedback_rate=200.0)
        self.world = ros.World(folder, parameters, plant)
        self.client = self.world.client
        self.states = {axis: self.client.record_states(axis) for axis in AXES}
        self.action = ActionClient(self.client.node, Home, '/homing_node/home')

    @property
    def life(self):
        return self.client.ask(GetState, 'get_state').current_state.id

    def transit(self, *transitions):
        """Ask for transitions; return whether the last one succeeded."""
        for number in transitions:
            asked = Transition(id=number)
            done = self.client.ask(ChangeState, 'change_state', 20.0, transition=asked)
        return done.success

    def to(self, state):
        """Bring the node into a state, by what is allowed."""
        way = {UNCONFIGURED: 0, INACTIVE: 1, ACTIVE: 2}
        while (now := self.life) != state:
            up = way[now] < way[state]
            step = {0: CONFIGURE, 1: ACTIVATE} if up else {2: DEACTIVATE, 1: CLEANUP}
            assert self.transit(step[way[now]])

    def said(self, axis):
        return self.states[axis][-1].message

    def refused(self, service='x/home'):
        return self.client.ask(Trigger, service).message.startswith('NotActive')

    def until_it_moves(self, axis):
        self.client.until(lambda: self.said(axis).state != 'Idle', what=f'{axis} to move')


@pytest.fixture(scope='module')
def managed(tmp_path_factory):
    made = Managed(tmp_path_factory.mktemp('managed'))
    yield made
    made.world.close()


def test_nothing_moves_before_it_is_active(managed):
    client = managed.client
    assert managed.life == UNCONFIGURED
    assert managed.refused()
    assert managed.refused('home')
    assert managed.refused('x/verify')
    jog = ActionClient(client.node, Jog, '/homing_node/jog')
    client.until(jog.server_is_ready)
    handle = client.answer(jog.send_goal_async(Jog.Goal(axis='x', distance=0.005, velocity=0.01)))
    result = client.answer(handle.get_result_async()).result
    assert result.error_code == AxisState.NOT_ACTIVE, result.message
    assert not managed.transit(ACTIVATE)  # it is not configured
    assert managed.life == UNCONFIGURED
    assert managed.transit(CONFIGURE)
    assert managed.refused()
    offered = client.ask(GetAvailableTransitions, 'get_available_transitions')
    assert {one.transition.label for one in offered.available_transitions} == {
        'activate',
        'cleanup',
        'shutdown',
    }
    assert client.trigger('cancel').success
    assert client.ask(SetBool, 'x/servo', data=True).success


def test_parameters_are_set_while_it_is_inactive_and_bad_ones_fail_configure(managed):
    client = managed.client

    def put(name, value):
        kind = ParameterType.PARAMETER_DOUBLE
        parameter = Parameter(name=name, value=ParameterValue(type=kind, double_value=value))
        return client.ask(SetParameters, 'set_parameters', parameters=[parameter]).results[0]

    managed.to(INACTIVE)
    before = float(ros.AXIS['homing_velocity_fast'])
    assert put('x.homing_velocity_fast', before / 2.0).successful
    assert not put('x.homing_velocity_fast', -1.0).successful
    assert put('x.homing_velocity_slow', before).successful  # slower than fast it is not
    managed.to(UNCONFIGURED)
    assert not managed.transit(CONFIGURE)
    assert managed.life == UNCONFIGURED
    assert put('x.homing_velocity_fast', before).successful
    assert put('x.homing_velocity_slow', float(ros.AXIS['homing_velocity_slow'])).successful
    assert managed.transit(CONFIGURE)


def test_it_is_activated_twice_and_cleaned_up_while_it_homes(managed):
    managed.to(ACTIVE)
    assert not managed.transit(ACTIVATE)
    assert managed.life == ACTIVE
    future = managed.client.send(Trigger, 'x/home')
    managed.until_it_moves('x')
    assert not managed.transit(CLEANUP)  # not from here: the run goes on
    assert not managed.transit(CONFIGURE)
    answer = managed.client.answer(future, 40.0)
    assert answer.success, answer.message
    assert managed.said('x').homed


def test_it_is_deactivated_in_the_middle_of_a_run_and_of_a_wait(managed):
    """Every request has its answer; the home of before stays until cleanup."""
    managed.to(ACTIVE)
    assert managed.client.trigger('z/home').success
    sent = managed.client.answer(
        managed.action.send_goal_async(Home.Goal(axes=['x'])),
    )
    result = sent.get_result_async()
    managed.until_it_moves('x')
    assert managed.transit(DEACTIVATE)
    assert managed.client.answer(result).result.error_code == AxisState.CANCELED
    assert managed.said('x').state == 'Idle'
    assert managed.said('z').homed
    assert managed.refused()
    assert not managed.transit(DEACTIVATE)
    assert managed.transit(CLEANUP)
    managed.client.until(lambda: not managed.said('z').homed)
    assert managed.transit(CONFIGURE, ACTIVATE)
    assert managed.client.trigger('x/home', 40.0).success


def test_the_last_one_a_shutdown_in_a_run_is_for_good(managed):
    managed.to(ACTIVE)
    future = managed.client.send(Trigger, 'x/home')
    managed.until_it_moves('x')
    assert managed.transit(SHUTDOWN)
    assert managed.client.answer(future).message.startswith('Canceled')
    assert managed.life == FINALIZED
    assert managed.refused()
    assert not managed.transit(CONFIGURE)
