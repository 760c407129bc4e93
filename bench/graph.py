# SPDX-License-Identifier: Apache-2.0
"""A ROS graph for benchmarks: a process under test, and what feeds and watches it at little cost.

The axes search for as long as a benchmark likes: their travel is endless, their feedback stands.
"""

import fcntl
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from core import ENDLESS
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

HERE = Path(__file__).resolve().parent
#: What a user runs.
EXECUTABLE = Path(sys.executable).with_name('homing_node')
PATIENCE = 30.0  # s
SWITCHES = ('home_switch', 'positive_limit_switch', 'negative_limit_switch')
NODE = '/homing_node'
#: Answers that mean only that the node has not heard us yet.
UNHEARD = ('SwitchUnknown', 'FeedbackStale', 'NoController')


def free_domain() -> tuple[int, Any]:
    """Return a ROS domain that nobody else here uses, and the lock to keep (as the tests do)."""
    folder = Path(tempfile.gettempdir()) / 'homing_node_test_domains'
    folder.mkdir(exist_ok=True)
    for number in range(100, 0, -1):
        lock = (folder / str(number)).open('a')
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
        else:
            return number, lock
    raise RuntimeError('all ROS domains are in use')


def parameters(axes: int, rate: float) -> str:
    """Return the parameters of a node with axes that search without end, as YAML."""
    names = [f'a{i}' for i in range(axes)]
    own = {**ENDLESS, 'feedback_timeout': 5.0}
    lines = [
        '/**:',
        '  ros__parameters:',
        f'    axes: {names}',
        f'    update_rate: {rate}',
        f'    home_sequence: ["{", ".join(names)}"]',
        '    cycle_timeout: 5.0',
    ]
    for name in names:
        lines.append(f'    {name}:')
        lines += [f'      {key}: {value}' for key, value in own.items()]
    return '\n'.join(lines) + '\n'


class Heard(NamedTuple):
    """A setpoint message, its number from 0, and when it was published, s of the system clock."""

    message: Any
    number: int
    sent: float


class World:
    """Everything around the process under test: its feedback, switches, requests, setpoints.

    ``feedback_rate`` in Hz, 0: none. ``raw``: keep setpoints as they came, not as messages.
    """

    def __init__(self, axes: int, feedback_rate: float, raw: bool = True) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix='homing_bench_'))
        self.names = [f'a{i}' for i in range(axes)]
        self.domain, self._lock = free_domain()
        self.context = Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node(
            'world', context=self.context, enable_rosout=False, start_parameter_services=False
        )
        # What is polled belongs to a node that no executor spins.
        self._listener = rclpy.create_node(
            'listener', context=self.context, enable_rosout=False, start_parameter_services=False
        )
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._raw = raw
        self._setpoints = self._listener.create_subscription(
            JointTrajectory, f'{NODE}/setpoints', print, 5000, raw=raw
        )
        self.switches = {
            (name, switch): self.node.create_publisher(Bool, f'{NODE}/{name}/{switch}', 10)
            for name in self.names
            for switch in SWITCHES
        }
        self._clients: dict[str, Any] = {}
        self._child: subprocess.Popen[bytes] | None = None
        self._ended = threading.Event()
        self._feeder = threading.Thread(target=self._feed, args=(feedback_rate,))
        self._feeder.start()

    def close(self) -> None:
        self._ended.set()
        self._feeder.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._listener.destroy_node()
        rclpy.shutdown(context=self.context)
        self._lock.close()

    def _feed(self, rate: float) -> None:
        if not rate:
            return
        publisher = self._listener.create_publisher(JointState, 'joint_states', 10)
        message = JointState(name=self.names, position=[0.0] * len(self.names))
        due = time.monotonic()
        while not self._ended.is_set():
            due += 1.0 / rate
            time.sleep(max(0.0, due - time.monotonic()))
            stamp = time.time_ns()
            message.header.stamp.sec = stamp // 1_000_000_000
            message.header.stamp.nanosec = stamp % 1_000_000_000
            publisher.publish(message)

    # -------------------------------------------------------------------------- process under test

    @contextmanager
    def running(self, script: str, *arguments: str) -> Iterator['subprocess.Popen[bytes]']:
        """Run a script, of this folder or anywhere, as the process under test."""
        environment = {
            **os.environ,
            'ROS_DOMAIN_ID': str(self.domain),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_LOG_DIR': str(self.folder / 'log'),
            'ROS_HOME': str(self.folder / 'ros_home'),
        }
        for ours in 'ROS_PYTHON_CHECK_FIELDS', 'FASTRTPS_DEFAULT_PROFILES_FILE':
            environment.pop(ours, None)
        log = self.folder / 'output'
        with log.open('w') as output:
            self._child = child = subprocess.Popen(
                [sys.executable, str(HERE / script), *arguments],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
            )
        try:
            yield child
        except BaseException:
            print(log.read_text(), file=sys.stderr)
            raise
        finally:
            child.send_signal(signal.SIGINT)
            try:
                child.wait(PATIENCE)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()

    def homing_node(self, rate: float, grid: Path | None = None, *more: str) -> Any:
        """Run the homing node with all axes.

        ``grid``: save there when its cycles were due; ``more``: further arguments.
        """
        file = self.folder / 'parameters.yaml'
        file.write_text(parameters(len(self.names), rate))
        command = ['under_test.py', str(grid)] if grid else [str(EXECUTABLE)]
        return self.running(*command, '--ros-args', '--params-file', str(file), *more)

    # ------------------------------------------------------------------------------------- clients

    def until(self, condition: Callable[[], Any], what: str = '') -> Any:
        """Spin until a condition is true and return it."""
        end = time.monotonic() + PATIENCE
        while not (found := condition()):
            self._executor.spin_once(timeout_sec=0.002)
            if time.monotonic() > end:
                raise TimeoutError(what)
            if self._child is not None and self._child.poll() is not None:
                raise RuntimeError('the process under test has ended')
        return found

    def call(self, service: str) -> Any:
        """Call a Trigger service of the node; return the future of its answer."""
        if service not in self._clients:
            self._clients[service] = self.node.create_client(Trigger, f'{NODE}/{service}')
        client = self._clients[service]
        self.until(client.service_is_ready, service)
        return client.call_async(Trigger.Request())

    def ask(self, service: str) -> Any:
        future = self.call(service)
        self.until(future.done, service)
        return future.result()

    def start_homing(self) -> None:
        """Home all axes; return when setpoints come."""
        for publisher in self.switches.values():
            self.until(publisher.get_subscription_count, publisher.topic_name)
            publisher.publish(Bool(data=False))
        future = self.call('home')

        def moves() -> bool:
            nonlocal future
            if future.done():
                message = future.result().message
                if not message.startswith(UNHEARD):
                    raise RuntimeError(message)
                future = self.call('home')
            return bool(self.heard())

        self.until(moves, 'setpoints')

    def heard(self) -> list[Heard]:
        """Return the setpoints that have come since the last call."""
        found = []
        handle = self._setpoints.handle
        while (taken := handle.take_message(JointTrajectory, self._raw)) is not None:
            message, info = taken
            found.append(
                Heard(
                    message,
                    info['publication_sequence_number'] - 1,
                    info['source_timestamp'] * 1e-9,
                )
            )
        return found

    def listen(self, duration: float) -> list[Heard]:
        """Return the setpoints of some time, s; costs next to nothing."""
        found, end = [], time.monotonic() + duration
        while (left := end - time.monotonic()) > 0.0:
            time.sleep(min(0.1, left))
            found += self.heard()
        return found


def cpu_seconds(process: int) -> float:
    """Return the processor time that the threads of a process have used, s."""
    total = 0
    for file in Path(f'/proc/{process}/task').glob('*/schedstat'):
        with suppress(OSError):
            total += int(file.read_text(encoding='ascii').split()[0])
    return total * 1e-9
