# SPDX-License-Identifier: Apache-2.0
"""Starts the node and a plant as processes of their own and talks to them as a user would.

Nothing here sleeps in order to synchronise: everything waits for a condition, with a deadline.
Every world has a ROS domain of its own, so that runs side by side do not meet.
"""

import fcntl
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
import time
from functools import cache, cached_property
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import process_server
import rclpy
import yaml
from builtin_interfaces.msg import Time
from homing_interfaces.msg import AxisState
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from homing_node.ros.simulated.controller import PlayedTrajectories

#: How long anything may take that takes no time, s: only a failing or starved test waits for it.
PATIENCE = 20.0
#: What rmw says of an answer that it dropped, for the node had not discovered who waits for it.
DROPPED = 'failed to send response'
#: How often it is asked whether a request has to be sent again, s.
AGAIN = 1.0
#: Answers of a home request that only mean that the plant has not been heard yet.
UNHEARD = ('SwitchUnknown', 'FeedbackStale', 'NoController')
#: What a state of an axis looks like for a reader that joins late.
LATCHED = QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL)

#: A participant that joins later than half a second after another is found by it only with its
#: next announcement, which by default comes every 3 s.
PROFILE = Path(__file__).with_name('quick_discovery.xml')
#: What every process of a test runs with: this machine alone, over UDP (doc/decisions/0009).
UDP = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
    'FASTRTPS_DEFAULT_PROFILES_FILE': str(PROFILE.parents[1] / 'config' / 'localhost_udp.xml'),
}
os.environ.update(
    ROS_AUTOMATIC_DISCOVERY_RANGE='LOCALHOST',
    ROS_PYTHON_CHECK_FIELDS='1',
    FASTRTPS_DEFAULT_PROFILES_FILE=str(PROFILE),
)

#: Their ports lie beyond those that Linux gives to clients; people and programs prefer low ones.
DOMAINS = range(215, 232)

MAINS = {
    'homing_node': 'homing_node.ros.main',
    'homing_coordinator': 'homing_node.ros.coordinator',
    'homed_axes': 'homing_node.ros.relay.homed_axes',
    'simulated_axes': 'homing_node.ros.simulated.axes',
    'gantry_wires': 'gantry_wires',
}


def wait_for(condition, timeout=PATIENCE, what='', pump=lambda: time.sleep(0.01)):
    """Return the first true value of the condition; fail after the timeout."""
    until = time.monotonic() + timeout
    while not (value := condition()):
        if time.monotonic() > until:
            raise AssertionError(f'waited {timeout:g} s in vain: {what or condition}')
        pump()
    return value


class Domain:
    """A ROS domain that no other test of this machine uses at the same time."""

    used = 0

    def __init__(self):
        folder = Path(tempfile.gettempdir()) / f'homing_node_test_domains_{os.getuid()}'
        folder.mkdir(exist_ok=True)
        first = os.getpid() + Domain.used
        Domain.used += 1
        for number in (DOMAINS[(first + i) % len(DOMAINS)] for i in range(len(DOMAINS))):
            self._file = (folder / str(number)).open('a')
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                self._file.close()
            else:
                self.number = number
                return
        raise RuntimeError('all ROS domains of the tests are in use')

    def release(self):
        self._file.close()


class PlainDumper(yaml.SafeDumper):
    """Writes YAML as rcl reads it: no aliases, names in quotes (y is a boolean without)."""

    def ignore_aliases(self, data):
        return True

    def represent_str(self, data):
        return self.represent_scalar('tag:yaml.org,2002:str', data, style="'")


PlainDumper.add_representer(str, PlainDumper.represent_str)


class ProcessServer:
    """The process that forks others (process_server.py), one for each worker of the tests."""

    def __init__(self):
        self._server = subprocess.Popen(
            [sys.executable, process_server.__file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, 'PYTHONFAULTHANDLER': '1'},
            start_new_session=True,
        )
        self._answers = {}  # (number of the process, what is said of it) -> the value
        self._started = 0

    def start(self, **order):
        """Start a process; return its number here."""
        self._started += 1
        line = json.dumps({'number': self._started, **order})
        self._server.stdin.write(line.encode() + b'\n')
        self._server.stdin.flush()
        return self._started

    def answer(self, number, what, timeout):
        """Return what was said of a process, None if nothing was said until the timeout, s."""
        until = time.monotonic() + timeout
        while (number, what) not in self._answers:
            left = max(0.0, until - time.monotonic())
            if not select.select([self._server.stdout], [], [], left)[0]:
                return None
            line = os.read(self._server.stdout.fileno(), 65536)
            while not line.endswith(b'\n'):
                part = os.read(self._server.stdout.fileno(), 65536)
                assert part, 'the server of processes has ended'
                line += part
            for one in line.splitlines():
                about, said, value = json.loads(one)
                self._answers[about, said] = value
        return self._answers[number, what]


@cache
def server():
    return ProcessServer()


class Forked:
    """A forked process, as `subprocess.Popen` shows one."""

    def __init__(self, input=os.devnull, **order):
        self._number = server().start(input=str(input), **order)
        self.pid = server().answer(self._number, 'pid', PATIENCE)

    @property
    def returncode(self):
        return server().answer(self._number, 'status', 0.0)

    def poll(self):
        return self.returncode

    def wait(self, timeout=PATIENCE):
        status = server().answer(self._number, 'status', timeout)
        if status is None:
            raise subprocess.TimeoutExpired('a forked process', timeout)
        return status

    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self):
        self.send_signal(signal.SIGKILL)


class Process:
    """An executable of the package as a process of its own, with its parameters from YAML.

    ``anew``: it starts with an interpreter of its own, and ends with it.
    """

    def __init__(self, name, folder, domain, parameters, arguments=(), anew=False):
        self.name = name
        number = sum(1 for _ in folder.iterdir())
        self._log = folder / f'{number}_{name}.log'
        file = folder / f'{number}_{name}.yaml'
        if not isinstance(parameters, bytes | str):
            parameters = yaml.dump({'/**': {'ros__parameters': parameters}}, Dumper=PlainDumper)
        file.write_bytes(parameters if isinstance(parameters, bytes) else parameters.encode())
        environment = {
            **os.environ,
            **UDP,
            'ROS_DOMAIN_ID': str(domain.number),
            'PYTHONFAULTHANDLER': '1',
            'ROS_LOG_DIR': str(folder / 'log'),
            'ROS_HOME': str(folder / 'ros_home'),
        }
        arguments = ['--ros-args', '--params-file', str(file), *arguments]
        if MAINS[name] in process_server.MODULES and not anew:
            self._log.touch()
            self.process = Forked(
                module=MAINS[name],
                arguments=arguments,
                environment=environment,
                log=str(self._log),
            )
            return
        code = f'import sys; from {MAINS[name]} import main; sys.exit(main())'
        with self._log.open('w') as log:
            self.process = subprocess.Popen(
                [sys.executable, '-c', code, *arguments],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
            )

    @property
    def output(self):
        return self._log.read_text()

    @property
    def alive(self):
        return self.process.poll() is None

    def signal(self, number=signal.SIGINT):
        self.process.send_signal(number)

    def wait(self, timeout=PATIENCE):
        """Return the exit status."""
        return self.process.wait(timeout)

    def close(self):
        """Make sure that it has ended; return its exit status, or None if it had to be killed."""
        if self.alive:
            self.signal()
            try:
                self.process.wait(5.0)
            except subprocess.TimeoutExpired:
                self.signal(signal.SIGABRT)  # its log tells where every thread is
                self.process.wait()
                return None
        return self.process.returncode


class Heard:
    """A message that was recorded; times are the system's, ns.

    It is made of its bytes when it is first looked at: most are not, and the test's process is
    often the plant, too.
    """

    def __init__(self, kind, data, info):
        self._kind, self._data = kind, data
        self.sequence = info['publication_sequence_number']
        self.sent, self.received = info['source_timestamp'], info['received_timestamp']

    @cached_property
    def message(self):
        return deserialize_message(self._data, self._kind)


class Asking:
    """A request that is sent again where it was passed over, and when `again` says so."""

    def __init__(self, send, again, passed_over=()):
        self._send, self._again, self._passed_over = send, again, passed_over
        self._futures = []
        self._due = 0.0
        self.passed = ''  # the newest answer that was passed over

    @property
    def last(self):
        """The future of the last request."""
        return self._futures[-1]

    def answer(self):
        """Return the answer, None as long as there is none."""
        if not self._futures or (time.monotonic() > self._due and self._again()):
            self._futures.append(self._send())
        if time.monotonic() > self._due:
            self._due = time.monotonic() + AGAIN
        for future in [future for future in self._futures if future.done()]:
            answer = future.result()
            message = getattr(answer, 'message', '')
            ours = len(self._futures) > 1 and message.startswith('Busy')
            if not (ours or message.startswith(self._passed_over)):
                return answer
            self._futures.remove(future)
            self.passed = message
        return None


class Client:
    """A user's node in the test's process; only `until` and what calls it let time pass."""

    def __init__(self, domain, node='/homing_node'):
        self.target = node
        self.context = Context()
        rclpy.init(
            context=self.context,
            domain_id=domain.number,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        self.node = rclpy.create_node('client', context=self.context, enable_rosout=False)
        # What listens is polled: no executor may hold it up.
        self._listener = rclpy.create_node(
            'listener', context=self.context, enable_rosout=False, start_parameter_services=False
        )
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._clients = {}
        self._recordings = []
        self._watched = ()

    def close(self):
        self._executor.shutdown()
        self.node.destroy_node()
        self._listener.destroy_node()
        rclpy.shutdown(context=self.context)

    # ------------------------------------------------------------------------------- waiting

    def watch(self, *processes):
        """Fail at once, and not after the timeout, where one of these ends."""
        self._watched = processes

    def pump(self):
        self._drain()
        self._executor.spin_once(timeout_sec=0.01)
        self._drain()
        for process in self._watched:
            if not process.alive:
                raise AssertionError(f'{process.name} has ended:\n{process.output}')

    def until(self, condition, timeout=PATIENCE, what=''):
        """Return the first true value of the condition; fail after the timeout."""
        return wait_for(condition, timeout, what, self.pump)

    def spin(self, node):
        """Let time pass for another node, too."""
        self._executor.add_node(node)

    def pass_time(self, seconds):
        """Record for a while: only where a test shows that nothing happens."""
        end = time.monotonic() + seconds
        self.until(lambda: time.monotonic() > end)

    # ---------------------------------------------------------------------------- listening

    def name(self, name):
        """Return a full name of one that is relative to the node."""
        return name if name.startswith('/') else f'{self.target}/{name}'

    def record(self, kind, topic, qos=1000):
        """Return the list that from now on gets every message of a topic."""
        subscription = self._listener.create_subscription(
            kind, self.name(topic), lambda _: None, qos
        )
        heard = []
        self._recordings.append((subscription, heard))
        return heard

    def _drain(self):
        for subscription, heard in self._recordings:
            handle, kind = subscription.handle, subscription.msg_type
            while (taken := handle.take_message(kind, True)) is not None:
                data, info = taken
                heard.append(Heard(kind, data, info))

    def forget(self, *records):
        """End some recordings: each takes its time of every message."""
        for recording in [r for r in self._recordings if any(r[1] is heard for heard in records)]:
            self._recordings.remove(recording)
            self._listener.destroy_subscription(recording[0])

    def rest(self):
        """Stop every axis, and all recordings: what a test leaves behind."""
        self.forget(*(heard for _, heard in self._recordings))
        answer = self.trigger('cancel')
        assert answer.success, answer.message

    def record_states(self, axis):
        return self.record(AxisState, f'{axis}/state', LATCHED)

    # ------------------------------------------------------------------------------- asking

    def send(self, kind, service, **fields):
        """Call a service; return the future of its answer."""
        key = self.name(service)
        if key not in self._clients:
            self._clients[key] = self.node.create_client(kind, key)
        client = self._clients[key]
        self.until(client.service_is_ready, what=f'service {key}')
        return client.call_async(kind.Request(**fields))

    def ask(self, kind, service, timeout=PATIENCE, **fields):
        """Call a service; return its answer."""
        asking = Asking(lambda: self.send(kind, service, **fields), self._drops())
        return self.until(asking.answer, timeout, f'an answer of {service}')

    def answer(self, future, timeout=PATIENCE):
        self.until(future.done, timeout, 'an answer')
        return future.result()

    def trigger(self, service, timeout=PATIENCE):
        return self.ask(Trigger, service, timeout)

    def home(self, *axes, timeout=40.0):
        """Home axes by a request each, at the same time; return the answers by axis.

        Asks again while the node has not heard the plant.
        """
        asking = {axis: self.asking_to_home(axis) for axis in axes}
        answers = {}

        def look():
            answers.update(
                {
                    axis: answer
                    for axis, one in asking.items()
                    if axis not in answers and (answer := one.answer())
                }
            )
            return len(answers) == len(axes)

        self.until(look, timeout, f'homing of {axes}')
        return answers

    def asking_to_home(self, axis, *passed_over, again=None, unheard=UNHEARD):
        return Asking(
            lambda: self.send(Trigger, f'{axis}/home'),
            again or self._drops(),
            (*unheard, *passed_over),
        )

    def _drops(self):
        """Return what tells whether an answer was dropped since it was asked last."""

        def count():
            return sum(process.output.count(DROPPED) for process in self._watched)

        def dropped():
            nonlocal known
            before, known = known, count()
            return known > before

        known = count()
        return dropped

    def start(self, axis):
        """Request a home; return the future of its answer once the axis moves."""
        setpoints = self.record(JointTrajectory, 'setpoints')
        asking = self.asking_to_home(axis)

        def moves():
            refusal = asking.answer()
            assert refusal is None, refusal.message
            return any(axis in s.message.joint_names for s in setpoints)

        try:
            self.until(moves, what=f'motion of {axis}')
        except AssertionError as error:
            raise AssertionError(f'{error}; {asking.passed}') from None
        self.forget(setpoints)
        return asking.last

    def set(self, atomically=False, **values):
        """Set parameters (`__` stands for the point); return one result, or one of each."""
        parameters = [
            Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
            for name, value in values.items()
        ]
        if atomically:
            return self.ask(
                SetParametersAtomically, 'set_parameters_atomically', parameters=parameters
            ).result
        results = self.ask(SetParameters, 'set_parameters', parameters=parameters).results
        return results[0] if len(results) == 1 else results

    def get(self, *names):
        values = self.ask(GetParameters, 'get_parameters', names=list(names)).values
        return [
            Parameter.from_parameter_msg(
                rclpy.parameter.ParameterMsg(name=name, value=value)
            ).value
            for name, value in zip(names, values, strict=True)
        ]

    def servo(self, axis, on):
        return self.ask(SetBool, f'{axis}/servo', data=on)


class HandPlant:
    """A plant whose every message the test controls; the feedback is what a controller commands.

    A thread publishes the feedback (and the clock, where it is told to) until it is silenced, and
    calls ``also`` with the positions and the stamp, for a driver that publishes more.
    """

    PERIOD = 0.004

    def __init__(self, client, **positions):
        self.client = client
        self.positions = dict(positions)
        self.silent = False  # no feedback
        self.drift = {}  # of an axis that something else moves, m/s
        self.hard_stops = {}  # no axis gets further
        self.held = False  # nothing at all, not even the clock
        self.sim_time = None  # ns, of /clock while time is simulated
        self.also = lambda positions, stamp: None
        self._node = rclpy.create_node(
            'plant', context=client.context, enable_rosout=False, start_parameter_services=False
        )
        self._feedback = self._node.create_publisher(JointState, 'joint_states', 100)
        self._clock = self._node.create_publisher(Clock, '/clock', 10)
        self._setpoints = self._node.create_subscription(
            JointTrajectory, client.name('setpoints'), lambda _: None, 100
        )
        self._publishers = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self):
        self._ended.set()
        self._thread.join()
        self._node.destroy_node()

    def set(self, topic, value):
        """Publish a level or a latched position; the first call makes the publisher."""
        kind = Bool if isinstance(value, bool) else Float64
        self.announce(topic, kind).publish(kind(data=value))

    def announce(self, topic, kind=Bool):
        """Return the publisher of a topic; the first call makes it."""
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(
                kind, self.client.name(topic), LATCHED
            )
        return self._publishers[topic]

    def set_levels(self, axis, home=False, positive=False, negative=False):
        for name, level in (
            ('home_switch', home),
            ('positive_limit_switch', positive),
            ('negative_limit_switch', negative),
        ):
            self.until_heard(f'{axis}/{name}', level)

    def until_heard(self, topic, value):
        """Publish a value as soon as the node listens: its side does not ask for history."""
        self.set(topic, value)
        publisher = self._publishers[topic]
        self.client.until(lambda: publisher.get_subscription_count() > 0, what=topic)
        self.set(topic, value)

    def drop(self, topic):
        """Destroy a publisher, as a driver that ends does."""
        self._node.destroy_publisher(self._publishers.pop(topic))

    def _run(self):
        handle = self._setpoints.handle
        controller, before = None, 0
        while not self._ended.wait(self.PERIOD):
            if self.held:
                continue
            stamp = self.sim_time
            now = time.time_ns() if stamp is None else stamp
            if controller is None or now < before:  # a simulator that is reset starts it anew
                controller = PlayedTrajectories(
                    list(self.positions), list(self.positions.values()), 10_000.0, True
                )
            before = now
            newest = None
            while (taken := handle.take_message(JointTrajectory, True)) is not None:
                newest = taken[0]
            if newest is not None:  # a controller plays the newest message only
                controller.take(deserialize_message(newest, JointTrajectory), now)
            commands = controller.update(now)
            for joint, command in commands.items():
                self.positions[joint] = min(command[0], self.hard_stops.get(joint, command[0]))
            for joint, velocity in self.drift.items():
                self.positions[joint] += velocity * self.PERIOD
            if stamp is not None:
                self.sim_time = stamp = stamp + round(self.PERIOD * 1e9)
                self._clock.publish(Clock(clock=_stamp(stamp)))
            if not self.silent:
                message = JointState(
                    name=list(self.positions), position=[float(p) for p in self.positions.values()]
                )
                message.header.stamp = _stamp(time.time_ns() if stamp is None else stamp)
                self._feedback.publish(message)
                self.also(dict(self.positions), message.header.stamp)


def _stamp(nanoseconds):
    return Time(sec=nanoseconds // 1_000_000_000, nanosec=nanoseconds % 1_000_000_000)


class World:
    """A node, a client and, where its axes are given, a simulated plant."""

    def __init__(
        self,
        folder,
        parameters,
        plant=None,
        node='/homing_node',
        arguments=(),
        plant_arguments=(),
        anew=False,
    ):
        self.folder = Path(folder)
        self.domain = Domain()
        self.processes = []
        if plant is not None:
            self.plant = self.run('simulated_axes', plant, plant_arguments)
        self.node = self.run('homing_node', parameters, arguments, anew)
        self.client = Client(self.domain, node)
        self.client.watch(*self.processes)

    def run(self, name, parameters, arguments=(), anew=False):
        process = Process(name, self.folder, self.domain, parameters, arguments, anew)
        self.processes.append(process)
        return process

    def close(self):
        """End everything; the processes must end well. The node first: it misses no plant."""
        self.client.watch()
        statuses = {p.name: p.close() for p in reversed(self.processes)}
        outputs = {p.name: p.output for p in self.processes}
        self.client.close()
        self.domain.release()
        assert not any(statuses.values()), (statuses, outputs)
        assert None not in statuses.values(), (statuses, outputs)
        assert not any('Traceback' in output for output in outputs.values()), outputs

    def __enter__(self):
        return self

    def __exit__(self, kind, *_):
        try:
            self.close()
        except AssertionError:
            if kind is None:
                raise


# ------------------------------------------------------------------------------- machines

#: An axis of a simulated machine that homes toward positive, m and s. The marks of the index are
#: 1.5 mm before the home switch.
LAYOUT = {
    'hard_stops': [-0.005, 0.085],
    'negative_limit_switch': [-0.055, 0.0],
    'positive_limit_switch': [0.08, 0.135],
    'home_switch': [0.055, 0.061],
    'home_switch_hysteresis': 0.00005,
    'index_pitch': 0.01,
    'index_offset': 0.0035,
    'lag': 0.005,
    'start': 0.04,
}

AXIS = {
    'home_type': 'HSHS',
    'travel': 0.08,
    'homing_velocity_fast': 0.05,
    'homing_velocity_slow': 0.005,
    'homing_reverse_distance': 0.0005,
    'max_jerk': 20.0,
    'feedback_timeout': 1.0,  # on a busy machine the feedback may come late, ...
    'following_error': 0.025,  # ... and the axis may follow late
}


def mirrored(layout):
    """Return the layout whose axis homes toward negative."""
    other = {
        'negative_limit_switch': 'positive_limit_switch',
        'positive_limit_switch': 'negative_limit_switch',
    }
    new = {}
    for name, value in layout.items():
        if isinstance(value, list):
            new[other.get(name, name)] = [-value[1], -value[0]]
        elif name in ('index_offset', 'start', 'touch_probe'):
            new[name] = -value
        else:
            new[name] = value
    return new


def node_parameters(axes, **node):
    """Return the parameters of a node whose axes are given as name -> what differs from AXIS."""
    return {
        'axes': list(axes),
        'cycle_timeout': 1.0,
        'ready_timeout': 0.0,
        **node,
        **{name: {**AXIS, **values} for name, values in axes.items()},
    }


def plant_parameters(axes, **plant):
    """Return the parameters of a plant whose axes are given as name -> what differs of LAYOUT."""
    return {
        'axes': list(axes),
        **plant,
        **{name: {**LAYOUT, **values} for name, values in axes.items()},
    }


# --------------------------------------------------------------------------- what was heard


def course(states):
    """Return the states of an axis in order, without repetitions."""
    names = [heard.message.state for heard in states]
    return [name for before, name in zip([None, *names], names, strict=False) if name != before]


class Sample(NamedTuple):
    """One setpoint of a joint; ``time`` in s is when it is due."""

    sequence: int
    position: float
    velocity: float
    acceleration: float
    sent: int
    time: float


def course_of(setpoints, joint):
    """Return the setpoints of one joint: the present ones, the first point of each message."""
    samples = []
    for heard in setpoints:
        names, point = heard.message.joint_names, heard.message.points[0]
        if joint in names:
            i = names.index(joint)
            samples.append(
                Sample(
                    heard.sequence,
                    point.positions[i],
                    point.velocities[i],
                    point.accelerations[i],
                    heard.sent,
                    heard.message.header.stamp.sec % 1_000_000
                    + heard.message.header.stamp.nanosec * 1e-9,
                )
            )
    return samples


def assert_within_limits(samples, velocity, acceleration, jerk):
    """Check by differences that setpoints are continuous and keep to their limits.

    The mean of a derivative between two setpoints keeps to the limit, however late a cycle was.
    """
    assert len(samples) > 10
    sequences = [s.sequence for s in samples]
    assert sequences == list(range(sequences[0], sequences[0] + len(samples))), 'one was missed'
    for s in samples:
        assert abs(s.velocity) <= velocity * (1 + 1e-6)
        assert abs(s.acceleration) <= acceleration * (1 + 1e-6)
    for number, (a, b) in enumerate(pairwise(samples)):
        step = b.time - a.time
        if step < -1.0:  # simulated time was set back: the motion goes on
            assert abs(b.velocity - a.velocity) <= acceleration * 0.05
            assert abs(b.position - a.position) <= velocity * 0.05
            continue
        if step < 1e-6:  # the first messages of a run all begin where the motion begins
            assert a[1:4] == b[1:4]
            continue
        where = f'at {number} of {len(samples)}, {step:.4f} s'
        # What is said of velocity and acceleration is what the positions do.
        middle = (a.velocity + b.velocity) / 2
        assert abs((b.position - a.position) / step - middle) <= jerk * step**2 + 1e-6, where
        assert abs(b.velocity - a.velocity) <= acceleration * step * (1 + 1e-3) + 1e-9, where
        assert abs(b.acceleration - a.acceleration) <= jerk * step * (1 + 1e-3) + 1e-6, where


def at_speed(client, setpoints, joint, velocity=0.0499):
    """Wait until a joint has reached a velocity, toward positive."""
    client.until(
        lambda: (samples := course_of(setpoints[-20:], joint)) and samples[-1].velocity > velocity
    )


def assert_stopped(client, setpoints, joint, acceleration=1.0, velocity=0.05):
    """Check that a run stopped within its limits and that nothing moves afterwards."""
    samples = course_of(setpoints, joint)
    assert_within_limits(samples, velocity, acceleration, AXIS['max_jerk'])
    assert samples[-1].velocity == samples[-1].acceleration == 0.0
    count = len(setpoints)
    client.pass_time(0.15)
    assert len(setpoints) == count
