# SPDX-License-Identifier: Apache-2.0
"""The node and the controller behind its setpoints, between real processes."""

import json
import os
import signal
from itertools import pairwise

import pytest
import ros_harness as ros
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from test_diagnosis import FORWARD, JTC
from trajectory_msgs.msg import JointTrajectory

TOPIC = '/axes_controller/joint_trajectory'
REMAP = ('--ros-args', '-r', f'~/setpoints:={TOPIC}', '-r', f'~/position_commands:={TOPIC}')

DEFAULTS = {
    **JTC,
    'allow_partial_joints_goal': False,
    'interpolate_from_desired_state': False,
}


class Controller:
    """A stand-in for a controller, as a process of its own."""

    def __init__(self, world, parameters, interface='trajectory', **options):
        given = {'name': 'axes_controller', 'parameters': parameters, 'topic': TOPIC}
        fifo = world.folder / f'controller_{len(list(world.folder.iterdir()))}'
        os.mkfifo(fifo)
        self._process = ros.Forked(
            module='controller_stand_in',
            arguments=[json.dumps({**given, 'interface': interface, **options})],
            environment={**os.environ, 'ROS_DOMAIN_ID': str(world.domain.number)},
            input=fifo,
            log=f'{fifo}.log',
        )
        self._input = fifo.open('w')

    def become(self, state, silently=False):
        self._input.write(f'{"silently " if silently else ""}{state}\n')
        self._input.flush()

    def close(self):
        self._input.close()
        self._process.wait(10.0)


@pytest.fixture
def cell(tmp_path):
    """Return what makes a node of two axes with its plant, and controllers beside it."""
    opened = []

    def make(controller=None, interface='trajectory', timeout=5.0, twice=False, **options):
        axes = {'x': {'joint': 'x_joint'}, 'y': {'joint': 'y_joint'}}
        patient = {name: {**axis, 'following_error': 0.05} for name, axis in axes.items()}
        world = ros.World(
            tmp_path,
            ros.node_parameters(patient, ready_timeout=timeout, setpoint_interface=interface),
            ros.plant_parameters({name: dict(values) for name, values in axes.items()}),
            arguments=REMAP[1:],
        )
        opened.append(world)
        if controller is not None:
            opened.append(Controller(world, controller, interface, **options))
            world.controller = opened[-1]
            found = f'the setpoints on {TOPIC} go to /axes_controller'
            world.client.until(lambda: found in world.node.output, what=found)
        world.kind = JointTrajectory if interface == 'trajectory' else Float64MultiArray
        return world

    yield make
    for one in reversed(opened):
        one.close()


def refused(world):
    """Ask once to home x; return the answer, once nothing was published."""
    messages = world.client.record(world.kind, TOPIC)
    return messages, world.client.answer(world.client.send(Trigger, 'x/home'))


@pytest.mark.long
def test_case_31_nobody_listens(cell):
    world = cell(timeout=8.0)
    client = world.client
    future = client.send(Trigger, 'x/home')
    assert client.get('ready_timeout') == [8.0]  # it answers others while a request waits
    assert not future.done()
    answer = client.answer(future)
    assert not answer.success
    assert answer.message.startswith(f'NoController: nobody subscribes to {TOPIC}')
    assert answer.message.endswith('after waiting for 8 s')


@pytest.mark.long
def test_a_request_waits_for_its_controller(cell):
    world = cell(timeout=20.0)
    future = world.client.send(Trigger, 'x/home')
    world.client.get('ready_timeout')
    controller = Controller(world, JTC)
    try:
        answer = world.client.answer(future)
    finally:
        controller.close()
    assert 'NoController' not in answer.message  # it began: nothing plays its setpoints


def test_everything_that_is_missing_is_named_in_one_answer(cell):
    world = cell(timeout=1.0)
    world.plant.close()
    world.client.watch(world.node)
    world.processes.remove(world.plant)
    missing = 'home_switch', 'positive_limit_switch', 'no feedback yet', 'nobody subscribes'

    def all_are_named():  # the graph may show the plant a little longer
        answer = world.client.answer(world.client.send(Trigger, 'x/home'))
        return all(text in answer.message for text in missing) and answer

    world.client.until(all_are_named)


def test_a_request_that_waits_is_canceled(cell):
    world = cell(timeout=60.0)
    future = world.client.send(Trigger, 'x/home')
    world.client.get('ready_timeout')
    answer = world.client.trigger('x/cancel')
    assert answer.success and 'not started: x' in answer.message
    assert world.client.answer(future).message.startswith('Canceled')


def test_the_node_ends_while_a_request_waits(cell):
    world = cell(timeout=60.0)
    future = world.client.send(Trigger, 'x/home')
    world.client.get('ready_timeout')
    world.client.watch()
    world.node.signal()
    assert world.client.answer(future).message.startswith('Canceled')
    assert world.node.wait() == 0


def test_case_12_two_nodes_of_one_name(cell):
    world = cell(JTC)
    second = world.run(
        'homing_node',
        ros.node_parameters({'x': {'joint': 'x_joint'}}, ready_timeout=5.0),
        REMAP[1:],
    )
    client = world.client

    def listed():
        names = client.node.get_node_names()
        return names.count('homing_node') == 2 and client.node.count_publishers(TOPIC) == 2

    client.until(listed, what='two nodes')

    def refuses():  # the nodes may find each other later than the client finds them
        messages, answer = refused(world)  # both nodes are asked, and one of them answers first
        return 'is published by /homing_node, too' in answer.message and messages == []

    client.until(refuses, what='PublisherConflict')
    messages, answer = refused(world)
    assert answer.message.startswith('PublisherConflict: ')
    assert messages == []
    client.watch(world.plant, world.node)
    second.close()


def test_another_publisher_is_named(cell):
    world = cell(JTC)
    other = world.client.node.create_publisher(JointTrajectory, TOPIC, 1)

    def refuses():
        _, answer = refused(world)
        return answer.message.startswith('PublisherConflict: ') and '/client' in answer.message

    world.client.until(refuses, what='PublisherConflict')
    world.client.node.destroy_publisher(other)


def test_case_30_joints_in_another_order(cell):
    world = cell({**FORWARD, 'joints': ['y_joint', 'x_joint']}, 'position')
    messages, answer = refused(world)
    assert answer.message.startswith('NoController: /axes_controller has the joints ')
    assert '[y_joint, x_joint]' in answer.message and '[x_joint, y_joint]' in answer.message
    assert messages == []


def test_case_33_a_controller_that_refuses_the_setpoints(cell):
    world = cell(DEFAULTS)
    messages, answer = refused(world)
    assert answer.message.startswith('NoController: /axes_controller: allow_partial_joints_goal')
    assert messages == []


def test_case_32_a_tolerance_below_the_lag_is_named(cell):
    world = cell({**JTC, 'constraints.x_joint.trajectory': 0.0002})
    text = 'path-tolerance: axis x: /axes_controller: constraints.x_joint.trajectory is 0.0002'
    world.client.until(lambda: text in world.node.output, what='a warning')


def home_and_move(world):
    """Start to home x; return the future of the answer once setpoints come."""
    messages = world.client.record(world.kind, TOPIC)
    future = world.client.send(Trigger, 'x/home')
    world.client.until(lambda: messages or future.done(), what='setpoints')
    assert not future.done(), future.result().message
    return future


def test_case_29_a_controller_that_leaves_active_ends_the_run(cell):
    world = cell(JTC, state='active')
    future = home_and_move(world)
    world.controller.become('inactive')
    answer = world.client.answer(future)
    assert answer.message.startswith('NoController: axis x: /axes_controller became inactive')


def test_case_29_a_controller_that_is_activated_in_a_run_ends_it(cell):
    world = cell(JTC)
    future = home_and_move(world)
    world.controller.become('active')
    answer = world.client.answer(future)
    assert answer.message.startswith('NoController: axis x: /axes_controller became active')


def test_case_29_a_controller_that_is_unloaded_ends_the_run(cell):
    world = cell(JTC)
    future = home_and_move(world)
    world.controller.close()
    answer = world.client.answer(future)
    assert answer.message.startswith('NoController: axis x: ')


@pytest.mark.long
def test_a_controller_that_was_deactivated_is_waited_for(cell):
    world = cell(JTC)
    home = world.client.send(Trigger, 'x/home')
    world.client.answer(home)  # by then its transitions are heard
    world.controller.become('inactive')
    world.client.set(ready_timeout=0.3)

    def inactive():
        _, answer = refused(world)
        return 'is inactive, not active' in answer.message

    world.client.until(inactive, what='a refusal')


@pytest.fixture
def managed(cell):
    """Return a cell whose controller has a manager, and publishes no transitions."""
    pytest.importorskip('controller_manager_msgs')

    def make(state):
        return cell(JTC, state=state, manager={'update_rate': 500})

    return make


@pytest.mark.long
def test_a_manager_says_that_the_controller_is_not_active(managed):
    world = managed('inactive')
    world.client.set(ready_timeout=8.0)
    messages, answer = refused(world)
    assert answer.message.startswith('NoController: /axes_controller is inactive, not active')
    assert messages == []


@pytest.mark.long
def test_a_request_waits_until_the_controller_is_active(managed):
    world = managed('inactive')
    future = world.client.send(Trigger, 'x/home')
    world.client.get('ready_timeout')
    world.controller.become('active', silently=True)
    assert 'NoController' not in world.client.answer(future).message


def test_case_29_a_manager_says_that_the_controller_has_left_active(managed):
    world = managed('active')
    future = home_and_move(world)
    world.controller.become('inactive', silently=True)
    answer = world.client.answer(future)
    assert answer.message.startswith('NoController: axis x: /axes_controller became inactive')


@pytest.mark.long
def test_an_unknown_listener_of_positions_gets_the_axes_held_first(cell):
    """A listener whose joints cannot be read: the first setpoints of a run hold every axis."""
    world = cell({'interface': 'unknown'}, 'position')
    messages = world.client.record(world.kind, TOPIC)
    home_and_move(world)
    world.client.until(lambda: len({tuple(one.message.data) for one in messages}) > 5)
    world.client.trigger('x/cancel')
    held = list(messages[0].message.data)
    still = [one for one in messages if list(one.message.data) == held]
    assert still[-1].sent - still[0].sent > 0.19e9
    assert held == pytest.approx([0.04, 0.04], abs=1e-4)
    assert abs(messages[len(still)].message.data[0] - held[0]) < 1e-4  # the run begins there


#: The joints of a controller that takes commands by name, in its order.
JOINTS = ['y', 'other', 'x']


@pytest.fixture(scope='module')
def named(tmp_path_factory):
    """Return a world whose setpoints are commands by name; y is long."""
    kind = pytest.importorskip('control_msgs.msg').MultiDOFCommand
    ends = {'hard_stops': [-1.0, 5.0], 'home_switch': [4.0, 4.1]}
    long = {
        **ends,
        'negative_limit_switch': [-2.0, -0.5],
        'positive_limit_switch': [4.5, 6.0],
    }
    home = {'home_type': 'HS', 'following_error': 0.05}
    with ros.World(
        tmp_path_factory.mktemp('named'),
        ros.node_parameters(
            {'x': home, 'y': {**home, 'travel': 5.0}},
            setpoint_interface='dof',
            position_joints=JOINTS,
            ready_timeout=5.0,
        ),
        ros.plant_parameters(
            {name: long if name == 'y' else {} for name in JOINTS}, setpoint_interface='dof'
        ),
    ) as world:
        world.commands = world.client.record(kind, 'dof_commands')
        yield world


@pytest.mark.long
def test_commands_by_name_for_all_joints_of_the_controller(named):
    """In the order of `position_joints`; a joint that no axis homes stays where it is."""
    answer = named.client.home('x')['x']
    assert answer.success, answer.message
    heard = [one.message for one in named.commands]
    assert all(one.dof_names == JOINTS for one in heard)
    assert {tuple(one.values[:2]) for one in heard} == {tuple(heard[0].values[:2])}
    assert heard[0].values == pytest.approx([0.04] * 3, abs=1e-4)
    assert max(one.values_dot[2] for one in heard) == pytest.approx(0.05)


def test_a_node_that_was_held_up_begins_from_rest(named):
    """The controller held the last value meanwhile: at full speed the next would be a jerk."""
    client, commands = named.client, named.commands
    asking = client.asking_to_home('y')
    commands.clear()
    client.until(
        lambda: (
            asking.answer() is None and commands and commands[-1].message.values_dot[0] > 0.0499
        )
    )
    named.node.signal(signal.SIGSTOP)
    client.pass_time(0.1)
    named.node.signal(signal.SIGCONT)
    count = len(commands)
    client.until(
        lambda: len(commands) > count + 20 and commands[-1].message.values_dot[0] > 0.0499
    )
    client.trigger('y/cancel')
    values = [one.message.values[0] for one in commands]
    steps = [b - a for a, b in pairwise(values)]
    assert min(steps) >= 0.0 and max(steps) <= 1.001 * 0.05 * 0.004
    pauses = [b.sent - a.sent for a, b in pairwise(commands)]
    longest = pauses.index(max(pauses))
    assert pauses[longest] > 0.09e9
    assert max(steps[:longest]) > 0.049 * 0.004
    # jerk 20 m/s^3 for a period; a setpoint that was made before may leave behind the pause
    assert min(steps[longest : longest + 2]) < 0.02 * 0.05 * 0.004


@pytest.mark.long
def test_an_unknown_listener_with_another_order_is_noticed_before_a_run(tmp_path):
    """The plant has its axes in another order, and no parameters that can be read."""
    with ros.World(
        tmp_path,
        ros.node_parameters({'x': {}, 'y': {}}, setpoint_interface='position', ready_timeout=5.0),
        ros.plant_parameters({'y': {'start': 0.02}, 'x': {}}, setpoint_interface='position'),
    ) as world:
        messages = world.client.record(Float64MultiArray, 'position_commands')
        answer = world.client.answer(world.client.send(Trigger, 'x/home'))
        assert answer.message.startswith('NoController: axis x moved by ')
        assert 'in the order x, y?' in answer.message
        assert len({tuple(one.message.data) for one in messages}) == 1  # held, nothing else
