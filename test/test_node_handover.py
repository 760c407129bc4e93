# SPDX-License-Identifier: Apache-2.0
"""The home goes to the machine: driver, controller, relay and homing node as processes.

Two machines, each for all tests of its part; the tests of a part follow one another. All
combinations of faults and steps are in test_handover.py and test_relay.py.
"""

import signal
import struct

import pytest
import ros_harness as ros
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from controller_manager_msgs.srv import ListControllers, SwitchController
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.action import ActionClient
from rclpy.parameter import Parameter
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

CONTROLLER = 'axes_controller'
REMAP = ('-r', f'~/setpoints:=/{CONTROLLER}/joint_trajectory')
RAW, HOMED = 0.04, 0.2  # where the axis is, by its driver and by its home
SUCCEEDED, CANCELED, ABORTED = 4, 5, 6


class Machine:
    """A driver with its controller, the homing node, and a client."""

    def __init__(self, folder, axis, relay=False):
        self.axis = {'joint': 'x_joint', 'home_type': 'CurrentPos', 'home_position': HOMED, **axis}
        self.parameters = ros.node_parameters({'x': self.axis}, ready_timeout=10.0)
        self.world = ros.World(
            folder,
            self.parameters,
            ros.plant_parameters({'x': {'joint': 'x_joint'}}, controller=CONTROLLER),
            arguments=REMAP,
        )
        if relay:
            self.relay = self.run_relay()
        self.client = self.world.client
        self.client.watch(*self.world.processes)
        self.states = self.client.record_states('x')
        self.raw = self.client.record(JointState, '/joint_states')

    def run_relay(self, *arguments):
        given = {'axes': ['x'], 'x': self.parameters['x'], 'controllers': [CONTROLLER]}
        return self.world.run('homed_axes', given, arguments)

    @property
    def state(self):
        return self.states[-1].message

    def home(self):
        return self.client.home('x')['x']

    def kill(self, process):
        """End a process as the kernel does when memory is short."""
        self.client.watch()
        process.signal(signal.SIGKILL)
        process.wait()
        self.world.processes.remove(process)

    def restart_node(self):
        self.world.node = self.world.run('homing_node', self.parameters, REMAP)

    def rests(self, position):
        """Check that the axis has not moved: the driver says the same for a while."""
        count = len(self.raw)
        self.client.until(lambda: len(self.raw) > count + 20)
        for heard in self.raw[count:]:
            assert heard.message.position[0] == pytest.approx(position, abs=1e-6)

    def answers(self, **values):
        """Set how the services of the driver and of the manager answer."""
        parameters = [Parameter(n, value=v).to_parameter_msg() for n, v in values.items()]
        service = '/simulated_axes_drives/set_parameters'
        results = self.client.ask(SetParameters, service, parameters=parameters).results
        assert all(one.successful for one in results)

    def active(self):
        (one,) = self.client.ask(
            ListControllers, '/controller_manager/list_controllers'
        ).controller
        return one.state == 'active'

    def activate(self):
        request = {'activate_controllers': [CONTROLLER], 'strictness': 2}
        assert self.client.ask(
            SwitchController, '/controller_manager/switch_controller', **request
        ).ok

    def close(self):
        self.world.close()


# -- by a service of the driver, with the controllers switched ------------------------------------


SERVICE = {
    'apply': 'service',
    'apply_service': '/simulated_axes/x/set_position',
    'apply_type': 'homing_interfaces/srv/SetPosition',
    'apply_request': '{position: {position}}',
    'apply_timeout': 0.5,
    'switch_controllers': [CONTROLLER],
}


@pytest.fixture(scope='module')
def served(tmp_path_factory):
    machine = Machine(tmp_path_factory.mktemp('served'), SERVICE)
    yield machine
    machine.close()


def test_the_driver_reads_homed_positions(served):
    answer = served.home()
    assert answer.success, answer.message
    assert 'home_offset=0.000000' in answer.message
    assert f'applied={RAW - HOMED:.6f}' in answer.message
    served.rests(HOMED)
    assert served.active()
    assert served.state.homed
    assert served.state.home_offset == 0.0
    steps = [heard.message.message.rpartition(' ')[2] for heard in served.states]
    order = ['rest', 'deactivate', 'apply', 'see', 'activate']
    assert [step for step in dict.fromkeys(steps) if step in order] == order


def test_homed_twice_is_not_added(served):
    answer = served.home()
    assert answer.success, answer.message
    served.rests(HOMED)


@pytest.mark.long
def test_nobody_is_there_who_would_take_the_home(served):
    """It is said before anything moves: no run begins."""
    client = served.client
    assert client.set(ready_timeout=0.2).successful
    assert client.set(x__apply_service='/nobody').successful
    count = len(served.states)
    answer = served.home()
    assert answer.message == (
        'HandoverFailed: axis x: step apply: nobody serves /nobody (apply, apply_service)'
    )
    assert all(heard.message.state == 'Idle' for heard in served.states[count:])
    assert client.set(x__apply_service=SERVICE['apply_service']).successful
    assert client.set(ready_timeout=10.0).successful
    assert served.home().success


@pytest.mark.parametrize(
    ('fault', 'step', 'active', 'position'),
    [
        ({'set_position_answer': 'no'}, 'apply: refused', True, HOMED),
        ({'activate_answer': 'no'}, f'activate: {CONTROLLER} does not activate', False, HOMED),
        ({'activate_answer': 'lie'}, 'activate: waited 0.5 s', False, HOMED),
        ({'set_position_answer': 'lie'}, 'see: waited 0.5 s', False, RAW),
    ],
    ids=['no', 'stays-off', 'stays-off-lies', 'lies'],
)
def test_what_others_do_wrong(served, fault, step, active, position):
    if position == RAW:  # so that the lie makes a difference
        assert served.client.ask(Trigger, '/simulated_axes/restart').success
        served.client.until(lambda: abs(served.raw[-1].message.position[0] - RAW) < 1e-6)
        served.rests(RAW)
    served.answers(**fault)
    answer = served.home()
    served.answers(set_position_answer='good', activate_answer='good')
    assert answer.message.startswith(f'HandoverFailed: axis x: step {step}')
    assert ('left inactive' in answer.message) != active
    assert served.active() == active
    assert not served.state.homed
    served.rests(position)
    served.activate()


def test_a_driver_that_restarts_is_no_longer_homed(served):
    assert served.home().success
    assert served.client.ask(Trigger, '/simulated_axes/restart').success
    served.client.until(lambda: not served.state.homed)
    assert served.state.error == 'HomeLost'
    assert 'the publisher of the feedback has changed' in served.state.message
    served.rests(RAW)


def killed(machine, process, step):
    """Home, and kill a process when the hand-over is at a step; return the request."""
    machine.answers(answer_time=0.2)
    client, states = machine.client, machine.states
    count = len(states)
    asking = client.asking_to_home('x')

    def is_there():
        refusal = asking.answer()
        assert refusal is None, refusal.message
        return any(f'step {step}' in heard.message.message for heard in states[count:])

    client.until(is_there)
    machine.kill(process)
    return asking


def assert_a_new_node_moves_nothing(machine):
    """Start a node in place of the one that was killed: no home, and the axis rests."""
    machine.restart_node()
    count = len(machine.states)
    machine.client.until(lambda: len(machine.states) > count)
    assert not any(heard.message.homed for heard in machine.states[count:])
    at = machine.raw[-1].message.position[0]
    place = min((RAW, HOMED), key=lambda one: abs(one - at))  # the driver may have taken the call
    machine.rests(place)
    machine.activate()
    machine.rests(place)


def assert_it_is_told(machine, asking):
    """The driver was killed: the answer names the hand-over, and the axis is not homed."""
    answer = machine.client.answer(asking.last)
    assert answer.message.startswith('HandoverFailed: axis x: step ')
    assert not machine.state.homed


def test_killed_in_the_hand_over(served):
    """First the homing node, then the driver with its controller manager, at `apply`."""
    served.activate()
    killed(served, served.world.node, 'apply')
    assert not served.active()
    assert_a_new_node_moves_nothing(served)
    assert_it_is_told(served, killed(served, served.world.plant, 'apply'))


@pytest.mark.long
@pytest.mark.parametrize('step', ['deactivate', 'activate'])
@pytest.mark.parametrize('process', ['node', 'plant'])
def test_killed_at_other_steps(tmp_path, process, step):
    machine = Machine(tmp_path, SERVICE)
    try:
        asking = killed(machine, getattr(machine.world, process), step)
        if process == 'node':
            assert_a_new_node_moves_nothing(machine)
        else:
            assert_it_is_told(machine, asking)
    finally:
        machine.close()


# -- by the relay ---------------------------------------------------------------------------------


class Goals:
    """Sends goals to the relay; ``feedback`` of the last one."""

    def __init__(self, machine):
        self._client = machine.client
        self._action = ActionClient(
            machine.client.node, FollowJointTrajectory, '/homed_axes/follow_joint_trajectory'
        )
        self._client.until(self._action.server_is_ready)

    def send(self, position, seconds=0.4):
        goal = FollowJointTrajectory.Goal(trajectory=trajectory(position, seconds))
        self.feedback = []
        future = self._action.send_goal_async(
            goal, feedback_callback=lambda message: self.feedback.append(message.feedback)
        )
        handle = self._client.answer(future)
        assert handle.accepted
        return handle

    def under_way(self, position):
        handle = self.send(position, 5.0)
        result = handle.get_result_async()
        self._client.until(lambda: self.feedback or result.done())
        assert not result.done(), result.result()
        return handle

    def end(self, handle):
        """Return the status and the words of a goal that has ended."""
        answer = self._client.answer(handle.get_result_async())
        return answer.status, answer.result.error_string

    def go(self, position):
        return self.end(self.send(position))


def trajectory(position, seconds):
    whole, part = divmod(seconds, 1.0)
    return JointTrajectory(
        joint_names=['x_joint'],
        points=[
            JointTrajectoryPoint(
                positions=[position],
                velocities=[0.0],
                time_from_start=Duration(sec=int(whole), nanosec=int(part * 1e9)),
            )
        ],
    )


@pytest.fixture(scope='module')
def relayed(tmp_path_factory):
    machine = Machine(
        tmp_path_factory.mktemp('relayed'),
        {'apply': 'relay', 'apply_timeout': 1.0, 'travel_min': 0.17, 'travel_max': 0.23},
        relay=True,
    )
    machine.homed = machine.client.record(JointState, '/homed_axes/joint_states')
    machine.goals = Goals(machine)
    yield machine
    machine.close()


def test_no_motion_before_the_axis_is_homed(relayed):
    assert relayed.goals.go(HOMED) == (ABORTED, 'axis x is not homed')
    publisher = relayed.client.node.create_publisher(
        JointTrajectory, '/homed_axes/joint_trajectory', 10
    )
    relayed.client.until(lambda: publisher.get_subscription_count() == 1)
    publisher.publish(trajectory(HOMED, 0.1))
    relayed.client.until(lambda: 'a trajectory is refused' in relayed.relay.output)
    relayed.rests(RAW)
    assert relayed.homed == []
    relayed.client.node.destroy_publisher(publisher)


def test_the_world_is_in_homed_coordinates(relayed):
    answer = relayed.home()
    assert answer.success, answer.message
    offset = relayed.state.home_offset
    assert relayed.goals.go(0.21) == (SUCCEEDED, '')
    for feedback in relayed.goals.feedback:  # on the way, in homed coordinates
        assert HOMED - 1e-4 < feedback.actual.positions[0] < 0.21 + 1e-4
    relayed.rests(RAW + 0.01)
    stamps = {(h.message.header.stamp.sec, h.message.header.stamp.nanosec): h for h in relayed.raw}
    assert len(relayed.homed) > 100
    for heard in relayed.homed:
        stamp = heard.message.header.stamp
        raw = stamps.get((stamp.sec, stamp.nanosec))
        if raw is not None:
            wanted = raw.message.position[0] - offset
            assert struct.pack('d', heard.message.position[0]) == struct.pack('d', wanted)
    numbers = [heard.sequence for heard in relayed.homed]
    assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))


def test_limits_cancel_and_preemption(relayed):
    status, why = relayed.goals.go(0.3)
    assert status == ABORTED
    assert 'beyond its soft limits 0.17 to 0.23 m' in why
    first = relayed.goals.under_way(0.18)
    cancel = relayed.client.answer(first.cancel_goal_async())
    assert cancel.goals_canceling
    assert relayed.goals.end(first)[0] == CANCELED
    second = relayed.goals.under_way(0.18)
    assert relayed.goals.go(HOMED) == (SUCCEEDED, '')
    status, why = relayed.goals.end(second)
    assert status == ABORTED
    assert 'preempted' in why


def test_two_relays_are_a_conflict(relayed):
    other = relayed.run_relay('-r', '__node:=other')
    topic = f'/{CONTROLLER}/joint_trajectory'
    find = relayed.client.node.get_publishers_info_by_topic
    relayed.client.until(lambda: any(info.node_name == 'other' for info in find(topic)))

    def refused():
        status, why = relayed.goals.go(HOMED)
        return status == ABORTED and why

    why = relayed.client.until(refused)
    assert why.startswith('PublisherConflict: /axes_controller/joint_trajectory is published by ')

    def not_homed():  # as soon as the homing node has found the second relay, too
        answer = relayed.client.answer(relayed.client.send(Trigger, 'x/home'))
        return answer.message.startswith('PublisherConflict')

    relayed.client.until(not_homed)
    relayed.world.processes.remove(other)
    assert other.close() == 0
    relayed.client.until(lambda: not refused())


def test_the_relay_outlives_the_homing_node(relayed):
    relayed.kill(relayed.world.node)
    assert relayed.goals.go(0.21) == (SUCCEEDED, '')
    relayed.restart_node()
    count = len(relayed.states)
    relayed.client.until(lambda: len(relayed.states) > count)
    assert not relayed.state.homed  # it knows no home
    assert relayed.goals.go(HOMED) == (SUCCEEDED, '')


def test_a_goal_that_runs_when_the_home_is_lost(relayed):
    answer = relayed.home()
    assert answer.success, answer.message
    goal = relayed.goals.under_way(0.18)
    assert relayed.client.ask(Trigger, '/simulated_axes/restart').success
    status, why = relayed.goals.end(goal)
    assert status == ABORTED
    assert why.startswith('axis x ')  # the relay or the homing node has seen it first
    assert why.endswith('feedback has changed: did the driver restart?')
    relayed.client.until(lambda: not relayed.state.homed)
    status, why = relayed.goals.go(HOMED)
    assert status == ABORTED
    assert 'HomeLost' in why or 'lost its home' in why
    values = relayed.client.ask(
        GetParameters, '/homed_axes/get_parameters', names=['x.home_offset']
    ).values
    assert values[0].double_value == relayed.state.home_offset


def test_a_relay_that_is_killed_is_a_hand_over_that_fails(relayed):
    """The last test: the killed one stays listed for some 20 s."""
    relayed.kill(relayed.relay)
    answer = relayed.home()
    assert answer.message.startswith('HandoverFailed: axis x: step apply: waited 1 s')
    assert not relayed.state.homed
