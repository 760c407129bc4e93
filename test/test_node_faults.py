# SPDX-License-Identifier: Apache-2.0
"""Faults between processes: what dies, hangs, lies or is cut off while an axis homes."""

import json
import math
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from types import SimpleNamespace

import cable
import homing_client
import pytest
import ros_harness as ros
import yaml
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, String
from trajectory_msgs.msg import JointTrajectory

SPEED = 0.05
DRIVE = {'command_timeout': 0.1, 'stop_dec': 1.0}
#: How far the controller goes on after the last message: the horizon, and the announced stop.
CONTROLLER_STOPS = SPEED * 0.02 + SPEED**2 / (2 * 0.5) + SPEED * 0.5 / (2 * 20.0)
#: The inputs of an axis whose drive reports that it is on.
REPORTING = ['home_switch', 'positive_limit_switch', 'negative_limit_switch', 'servo_enabled']


# -- a node that dies -----------------------------------------------------------------------------


@pytest.mark.long
def test_the_node_is_killed(tmp_path):
    """The controller stops the axis; the next node knows no home and moves nothing."""
    parameters = ros.node_parameters(
        {
            'x': {
                'homing_reverse_distance': 0.02,
                'homing_velocity_slow': 0.02,
                'edge_tolerance': 0.002,
                'switches': REPORTING,
            }
        }
    )
    with ros.World(tmp_path, parameters, ros.plant_parameters({'x': DRIVE})) as world:
        client = world.client
        assert client.home('x')['x'].success
        setpoints = client.record(JointTrajectory, 'setpoints')
        feedback = client.record(JointState, '/joint_states')
        client.start('x')
        client.until(lambda: setpoints and ros.course_of(setpoints, 'x')[-1].velocity < -0.0499)

        client.watch()
        world.node.signal(signal.SIGKILL)
        world.node.wait()
        world.processes.remove(world.node)
        client.until(lambda: at_rest(feedback, 40))
        rest = feedback[-1].message.position[0]
        went_on = ros.course_of(setpoints, 'x')[-1].position - rest
        assert CONTROLLER_STOPS - 0.001 < went_on < CONTROLLER_STOPS + 0.001

        states = client.record_states('x')
        setpoints.clear()
        restarted = time.time_ns()
        world.node = world.run('homing_node', parameters)
        client.watch(*world.processes)
        new = client.until(lambda: [h for h in states if h.sent > restarted], what='its state')
        client.pass_time(0.3)
        assert (new[0].message.state, new[0].message.homed) == ('Idle', False)
        assert not setpoints
        assert feedback[-1].message.position[0] == pytest.approx(rest, abs=1e-6)
        client.until(lambda: client.node.get_publishers_info_by_topic(client.name('x/state')))
        assert home_again(client).success


def at_rest(feedback, samples):
    last = [heard.message.position[0] for heard in feedback[-samples:]]
    return len(last) == samples and max(last) - min(last) < 1e-7


@pytest.mark.long
def test_the_drive_reports_that_it_stopped_by_itself(tmp_path):
    """The run ends; requests are refused until the servo was switched off and on again.

    Only positions need it: a controller that plays trajectories stops the axis by itself.
    """
    parameters = ros.node_parameters(
        {'x': {'switches': REPORTING, 'feedback_timeout': 10.0}},
        cycle_timeout=10.0,
        setpoint_interface='position',
    )
    plant = ros.plant_parameters({'x': DRIVE}, setpoint_interface='position')
    with ros.World(tmp_path, parameters, plant) as world:
        client = world.client
        feedback = client.record(JointState, '/joint_states')
        asking = client.asking_to_home('x')
        client.until(
            lambda: (
                asking.answer() is None
                and len(feedback) > 10
                and abs(feedback[-1].message.velocity[0]) > 0.95 * SPEED
            )
        )
        enabled = client.record(Bool, 'x/servo_enabled')
        world.node.signal(signal.SIGSTOP)
        client.until(lambda: enabled and not enabled[-1].message.data)
        world.node.signal(signal.SIGCONT)
        assert client.until(asking.answer).message.startswith('ServoOff: axis x: ')
        client.until(lambda: client.trigger('x/home').message.startswith('ServoOff: axis x: '))
        for on in (False, True):
            assert client.servo('x', on).success
        answer = client.until(
            lambda: (
                not (a := client.trigger('x/home', 40.0)).message.startswith(
                    ('ServoOff', 'NoCont')
                )
                and a
            )
        )
        assert answer.success, answer.message


def home_again(client, axis='x'):
    """Home at a node that was restarted, once its drive is on again.

    The killed one's services stay listed for a while, and a request may be lost to them.
    """
    return client.until(client.asking_to_home(axis, 'ServoOff', again=lambda: True).answer, 60.0)


# -- a node that hangs, clients and readers that vanish -------------------------------------------

AXES = {
    'x': {'home_type': 'HS', 'travel': 1.0, 'feedback_timeout': 1.0},
    'y': {'home_type': 'HS', 'travel': 1.0},
}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    parameters = ros.node_parameters(AXES, cycle_timeout=0.5)
    with ros.World(tmp_path_factory.mktemp('faults'), parameters) as world:
        world.hand = ros.HandPlant(world.client, x=0.0, y=0.0)
        for axis in AXES:
            world.hand.set_levels(axis)
        yield world
        world.hand.close()


@pytest.fixture
def client(world):
    yield world.client
    world.client.rest()
    world.hand.set('x/home_switch', False)


@pytest.fixture
def setpoints(client):
    return client.record(JointTrajectory, 'setpoints')


@pytest.mark.parametrize('held', [0.05, 0.2, 1.0])
def test_the_node_is_held_up(client, world, setpoints, held):
    """What was missed is not made up for; beyond cycle_timeout (0.5 s) the run ends."""
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    world.node.signal(signal.SIGSTOP)
    stopped = time.monotonic()
    client.until(lambda: time.monotonic() > stopped + held)
    world.node.signal(signal.SIGCONT)
    count = len(setpoints)
    if held > 0.5:
        answer = client.answer(future)
        assert answer.message.startswith('CycleLate: axis x: '), answer.message
        client.until(lambda: setpoints[-1].message.points[0].velocities[0] == 0.0)
    else:
        client.until(lambda: len(setpoints) > count + 50)
        assert not future.done()
        world.hand.set('x/home_switch', True)
        answer = client.answer(future)
        assert answer.success, answer.message
    ros.assert_within_limits(ros.course_of(setpoints, 'x'), SPEED, 1.0, 20.0)


READER = """
import sys, time, rclpy
from homing_interfaces.msg import AxisState
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
rclpy.init()
node = rclpy.create_node('reader', enable_rosout=False)
kept = [node.create_subscription(kind, '/homing_node/' + topic, print, 1)
        for kind, topic in ((JointTrajectory, 'setpoints'), (AxisState, 'x/state'),
                            (JointState, 'joint_states'))]
print('ready', flush=True)
time.sleep(1000.0)  # it never takes a message
"""


@contextmanager
def another(world, code, *arguments):
    """Run a program in the domain of the world, from its first line on."""
    with subprocess.Popen(
        [sys.executable, '-c', code, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env={**ros.os.environ, 'ROS_DOMAIN_ID': str(world.domain.number)},
    ) as process:
        try:
            assert process.stdout.readline() == 'ready\n'
            yield process
        finally:
            process.kill()


@pytest.mark.long
def test_a_reader_hangs_and_is_killed(client, world, setpoints):
    """The cycle does not wait for it: no setpoint is missed, and none is a larger step."""
    with another(world, READER) as reader:
        client.until(lambda: client.node.count_subscribers(client.name('x/state')) > 0)
        future = client.start('x')
        ros.at_speed(client, setpoints, 'x')
        count = len(setpoints)
        client.until(lambda: len(setpoints) > count + 100)
        reader.kill()
        reader.wait()
        count = len(setpoints)
        # A publisher may block seconds later.
        client.until(lambda: future.done() or len(setpoints) > count + 800)
        assert not future.done(), future.result().message
    world.hand.set('x/home_switch', True)
    answer = client.answer(future)
    assert answer.success, answer.message
    ros.assert_within_limits(ros.course_of(setpoints, 'x'), SPEED, 0.5, 20.0)


CALLER = """
import sys, rclpy
from homing_interfaces.action import Home
from rclpy.action import ActionClient
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node('caller', enable_rosout=False)
if sys.argv[1] == 'action':
    client = ActionClient(node, Home, '/homing_node/home')
    client.wait_for_server()
    client.send_goal_async(Home.Goal(axes=['x']))
else:
    client = node.create_client(Trigger, '/homing_node/x/home')
    client.wait_for_service()
    client.call_async(Trigger.Request())
print('ready', flush=True)
rclpy.spin(node)
"""


@pytest.mark.long
@pytest.mark.parametrize('kind', ['service', 'action'])
def test_a_client_vanishes_while_it_waits(client, world, setpoints, kind):
    """The run goes on to its end, and the node goes on serving."""
    states = client.record_states('x')
    with another(world, CALLER, kind) as caller:
        ros.at_speed(client, setpoints, 'x')
        caller.kill()
        caller.wait()
    count = len(setpoints)
    client.until(lambda: len(setpoints) > count + 50)
    world.hand.set('x/home_switch', True)
    client.until(lambda: states[-1].message.homed)
    world.hand.set('x/home_switch', False)
    setpoints.clear()
    future = client.start('x')
    assert not future.done()


# -- messages that lie ----------------------------------------------------------------------------


def test_feedback_that_is_huge_or_broken(client, world, setpoints):
    """Far too many joints, lengths that do not fit, names that are no text."""
    publisher = client.node.create_publisher(JointState, '/joint_states', 10)
    client.until(lambda: publisher.get_subscription_count() > 0)
    future = client.start('x')
    names = [f'joint_{i}' for i in range(20000)]
    broken = serialize_message(JointState(name=['AAAA'], position=[0.0]))
    for message in (
        JointState(name=names, position=[1.0] * 20000),
        JointState(name=['x'] * 3, position=[]),
        JointState(name=[], position=[1.0] * 1000),
        JointState(name=['x', 'y'], position=[math.nan, math.inf]),
        JointState(name=['', 'ж', '\x00x'[:1]], position=[1.0, 2.0, 3.0]),
        broken.replace(b'AAAA', b'\xff\xfe\xc3\x28'),
        broken[:-6],
    ):
        publisher.publish(message)
    ros.at_speed(client, setpoints, 'x')
    assert not future.done()
    assert world.node.alive
    ros.assert_within_limits(ros.course_of(setpoints, 'x'), SPEED, 0.5, 20.0)
    client.node.destroy_publisher(publisher)


def test_a_topic_of_another_type(client, world, setpoints):
    """A switch that publishes text is not heard: it does not stand in for the switch."""
    world.hand.drop('y/home_switch')
    publisher = client.node.create_publisher(String, client.name('y/home_switch'), 10)
    for _ in range(20):
        publisher.publish(String(data='on'))
        client.pump()
    refused = 'InvalidParameter: axis y: y.topics.home_switch: data is text, a number is expected'
    client.until(lambda: client.trigger('y/home').message.startswith(refused))
    assert not setpoints
    client.node.destroy_publisher(publisher)
    world.hand.until_heard('y/home_switch', False)
    client.start('y')


@pytest.mark.parametrize(
    'content',
    [
        b'\xff\xfe\x00axes',
        b'',
        b'\x00' * 64,
        b'/**:\n  ros__parameters:\n    axes: ["\xc3\x28"]\n',
        b'- 1\n- 2\n',
        b'/**: {ros__parameters: {axes: [.nan, .inf]}}\n',
        b'/**:\n  ros__parameters:\n    axes: ["x"]\n    x: {travel: .inf, home_type: HS}\n',
        b'/**:\n  ros__parameters: &a\n    axes: *a\n',
    ],
    ids=range(8),
)
def test_parameters_that_are_no_yaml(tmp_path, content):
    """They end the start with a message, whatever they are."""
    domain = ros.Domain()
    process = ros.Process('homing_node', tmp_path, domain, content)
    assert process.wait() == 1, process.output
    domain.release()
    assert 'homing_node: ' in process.output
    assert 'Traceback' not in process.output, process.output


# -- two hosts ------------------------------------------------------------------------------------

WHY_NOT = cable.missing()
needs_two_hosts = pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)


class Hosts:
    """The node and a client on one host, the plant on the other."""

    def __init__(self, folder):
        self.folder = folder
        self.cable = cable.Cable()
        self.domain = ros.Domain()
        self.processes = []
        axes = {
            'x': {
                'homing_velocity_slow': 0.02,
                'homing_reverse_distance': 0.02,
                'edge_tolerance': 0.002,
                'feedback_timeout': 0.4,
            }
        }
        self.start('homing_node', self.cable.near, ros.node_parameters(axes, ready_timeout=5.0))
        self.start('simulated_axes', self.cable.far, ros.plant_parameters({'x': DRIVE}))

    def start(self, name, host, parameters):
        file = self.folder / f'{name}.yaml'
        file.write_text(
            yaml.dump({'/**': {'ros__parameters': parameters}}, Dumper=ros.PlainDumper)
        )
        code = f'import sys; from {ros.MAINS[name]} import main; sys.exit(main())'
        self.processes.append(
            self.run(host, name, '-c', code, '--ros-args', '--params-file', str(file))
        )

    def run(self, host, name, *arguments):
        return self.cable.run(
            host, arguments, self.folder / f'{name}.log', ROS_DOMAIN_ID=str(self.domain.number)
        )

    def home(self, moving=lambda: None):
        """Home from a client on the node's host; return what it tells."""
        log = self.folder / 'client.log'
        process = self.run(self.cable.near, 'client', homing_client.__file__, 'x')
        try:
            ros.wait_for(lambda: 'moving' in log.read_text() or process.poll() is not None, 40.0)
            moving()
            process.wait(60.0)
        finally:
            process.kill()
            process.wait()
        lines = [line for line in log.read_text().splitlines() if line.startswith('{')]
        assert lines, log.read_text()
        return SimpleNamespace(**json.loads(lines[0]))

    def last_setpoint_of_the_drive(self):
        """Return the position after which the drive stopped by itself, as it tells it."""
        told = re.findall(
            'no setpoint came after (\\S+):',
            (self.folder / 'simulated_axes.log').read_text(),
        )
        assert told, 'the drive did not stop by itself'
        return float(told[-1])

    def close(self):
        for process in self.processes:
            process.send_signal(signal.SIGINT)
        statuses = [process.wait(10.0) for process in self.processes]
        self.cable.close()
        self.domain.release()
        assert statuses == [0, 0], [log.read_text() for log in self.folder.glob('*.log')]


@pytest.fixture(scope='module')
def hosts(tmp_path_factory):
    made = Hosts(tmp_path_factory.mktemp('hosts'))
    yield made
    made.close()


LATE = ('FeedbackStale', 'SwitchStale', 'EdgeNotRepeated', 'FollowingError')


def assert_homed_right_or_stopped(ended, errors=LATE):
    """Check that it homed within its uncertainty, or ended with an error at rest."""
    name, _, told = ended.message.partition(': ')
    if name == 'Homed':
        values = dict(part.split('=') for part in told.split() if '=' in part)
        found, unsure = float(values['home_position_raw']), float(values['uncertainty'])
        assert abs(found - ros.LAYOUT['home_switch'][0]) <= unsure + 1e-6
    else:
        assert name in errors
    positions = [position for position, _ in ended.setpoints]
    assert max(positions) < ros.LAYOUT['hard_stops'][1]
    # After FeedbackStale nothing is told: the controller has been told how to stop.
    assert ended.setpoints[-1][1] == 0.0 or name == 'FeedbackStale'
    return name


@pytest.mark.long
@needs_two_hosts
@pytest.mark.parametrize('delay', [0.0, 0.005], ids=['clean', 'late'])
def test_two_hosts(hosts, delay):
    hosts.cable.set(delay=delay, jitter=delay)
    name = assert_homed_right_or_stopped(hosts.home())
    if not delay:
        assert name == 'Homed'


@pytest.mark.long
@needs_two_hosts
def test_the_cable_is_cut(hosts):
    """The node ends with an error, the controller stops; joined again, the axis homes."""
    hosts.cable.set(delay=0.0, jitter=0.0)

    def cut():
        hosts.cable.set(cut=True)

    ended = hosts.home(cut)
    hosts.cable.set(cut=False)
    assert assert_homed_right_or_stopped(ended) in ('FeedbackStale', 'FollowingError')
    again = hosts.home()
    assert abs(again.feedback[0] - ended.setpoints[-1][0]) < CONTROLLER_STOPS + SPEED * 0.5
    assert assert_homed_right_or_stopped(again) == 'Homed'


@pytest.mark.long
@needs_two_hosts
def test_a_cable_that_loses_messages(hosts):
    """An edge that is lost comes again with its writer's next heartbeat, in 3 s at worst.

    By then a limit switch may have ended the run.
    """
    hosts.cable.set(delay=0.002, jitter=0.002, loss=0.05)
    assert_homed_right_or_stopped(hosts.home(), (*LATE, 'LSTriggered'))
