# SPDX-License-Identifier: Apache-2.0
"""A line of cells: what a cell and the coordinator need, at rest and while a line homes in steps.

Each cell is a process with many axes at a low rate; this process plays the drives of all of them.
Time is real. Everything runs on this machine, which the figures describe; `of all that runs` says
whether it had time left.

The processes find each other by a discovery server: without it each one learns of all endpoints of
all others, 1100 for a cell with 32 axes, and compares them with all of its own. `DISCOVERY=simple`
does without the server.
"""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import rclpy
from figures import Figure, nth
from graph import EXECUTABLE, HERE, free_domain
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

DISCOVERY = os.environ.get('DISCOVERY', 'server')
AXES, STEPS = int(os.environ.get('AXES', '32')), 2
RATE, FEEDBACK = 5.0, 5.0  # Hz, of a node's cycle and of its feedback
MOST_REQUESTS = 8  # until the line must be homed
AT_ONCE = 4  # axes home at the same time
REST = 5.0  # s, that the line is measured at rest
PATIENCE = 120.0  # s
GOING = 10.0  # s, after which a process that has not ended is killed
LATCHED = QoSProfile(depth=50, durability=DurabilityPolicy.TRANSIENT_LOCAL)
NAMES = [f'a{i}' for i in range(AXES)]
#: An axis that moves without a switch: home is where it is, then it goes 5 mm further.
AXIS = {
    'home_type': 'CurrentPos',
    'travel': 1.0,
    'homing_velocity_fast': 0.002,
    'homing_velocity_slow': 0.002,
    'home_shift_distance': 0.005,
    'feedback_timeout': 10.0,
    'following_error': 0.05,  # the drives play at a low rate
    'switches': '[]',
}
#: Where the discovery server listens.
SERVER = '127.0.0.1', 11811
#: This machine alone, over UDP (doc/decisions/0009-transport.md).
BY_SERVER = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
    'ROS_DISCOVERY_SERVER': '{}:{}'.format(*SERVER),
    'FASTRTPS_DEFAULT_PROFILES_FILE': str(HERE / 'by_server.xml'),
}
UDP = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
    'FASTRTPS_DEFAULT_PROFILES_FILE': str(HERE.parent / 'config' / 'localhost_udp.xml'),
}
PAGE = os.sysconf('SC_PAGE_SIZE')


class Usage(NamedTuple):
    """Processor time, s, and memory, MB, of a process."""

    processor: float
    memory: float


def usage(process: 'subprocess.Popen[bytes]') -> Usage:
    """Return what a process has used."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    ticks = int(fields[11]) + int(fields[12])
    return Usage(ticks / os.sysconf('SC_CLK_TCK'), int(fields[21]) * PAGE / 1e6)


class Line:
    """The processes of a line, its drives, and a user's client."""

    def __init__(self, cells: int) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix='homing_bench_'))
        self.domain, self._lock = free_domain()
        self.cells = [f'cell{i}' for i in range(1, cells + 1)]
        self.server = self._serve() if DISCOVERY == 'server' else None
        os.environ.update(BY_SERVER if self.server else UDP)
        self.context = Context()
        rclpy.init(context=self.context, domain_id=self.domain)
        self.node = rclpy.create_node(
            'user', context=self.context, enable_rosout=False, start_parameter_services=False
        )
        self._drives = rclpy.create_node(
            'drives', context=self.context, enable_rosout=False, start_parameter_services=False
        )
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self.positions = {cell: [0.1] * AXES for cell in self.cells}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._drive)
        self._thread.start()
        self.nodes: list[subprocess.Popen[bytes]] = []
        self.coordinator = self._run('homing_coordinator', self._line(), '')
        self.states: list[tuple[float, float]] = []  # age, s, and time of each state
        self._watched = [
            self._drives.create_subscription(
                AxisState, f'/homing_coordinator/{cell}/{name}/state', print, LATCHED, raw=True
            )
            for cell in self.cells
            for name in NAMES[:STEPS]
        ]
        self.action = ActionClient(self.node, Home, '/homing_coordinator/home')

    def start(self) -> None:
        """Start the cells, one after another: each is there before the next one comes."""
        for cell in self.cells:
            self.nodes.append(self._run('homing_node', self._cell(), cell))
            there = self.node.create_client(GetParameters, f'/{cell}/homing_node/get_parameters')
            self.until(there.service_is_ready, f'{cell} to be there')

    def _serve(self) -> 'subprocess.Popen[bytes]':
        """Start a discovery server."""
        address, port = SERVER
        return subprocess.Popen(
            [EXECUTABLE.with_name('fast-discovery-server'), '-i0', f'-l{address}', f'-p{port}'],
            stdin=subprocess.PIPE,  # it ends with its input
            stdout=subprocess.DEVNULL,
            env={**os.environ, 'FASTRTPS_DEFAULT_PROFILES_FILE': str(HERE / 'by_server.xml')},
        )

    def close(self) -> None:
        processes = (self.coordinator, *self.nodes)
        for process in processes:
            process.send_signal(signal.SIGINT)
        end = time.monotonic() + GOING
        for process in processes:
            try:
                process.wait(max(0.1, end - time.monotonic()))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        self._ended.set()
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        self._drives.destroy_node()
        rclpy.shutdown(context=self.context)
        self._lock.close()
        if self.server:
            self.server.terminate()
            self.server.wait()

    def _cell(self) -> str:
        lines = ['/**:', '  ros__parameters:', f'    axes: {NAMES}', f'    update_rate: {RATE}']
        lines += [
            '    memory: ""',
            '    record: ""',
            '    cycle_timeout: 10.0',
            '    ready_timeout: 60.0',
        ]
        for name in NAMES:
            lines.append(f'    {name}:')
            lines += [f'      {key}: {value}' for key, value in AXIS.items()]
        return '\n'.join(lines) + '\n'

    def _line(self) -> str:
        steps = [', '.join(f'{cell}/{name}' for cell in self.cells) for name in NAMES[:STEPS]]
        nodes = [f'/{cell}/homing_node' for cell in self.cells]
        lines = ['/**:', '  ros__parameters:', f'    nodes: {nodes}', f'    steps: {steps}']
        requires = [f'{cell}/{NAMES[1]}: {self.cells[0]}/{NAMES[0]}' for cell in self.cells]
        lines += [f'    requires: {requires}', '    cell_timeout: 20.0', f'    at_once: {AT_ONCE}']
        return '\n'.join(lines) + '\n'

    def _run(self, name: str, parameters: str, namespace: str) -> 'subprocess.Popen[bytes]':
        file = self.folder / f'{name}_{namespace}.yaml'
        file.write_text(parameters)
        environment = {
            **os.environ,
            'ROS_DOMAIN_ID': str(self.domain),
            'ROS_LOG_DIR': str(self.folder / 'log'),
        }
        environment.pop('ROS_PYTHON_CHECK_FIELDS', None)
        arguments = ['--ros-args', '--params-file', str(file)]
        arguments += ['-r', f'__ns:=/{namespace}'] if namespace else []
        with (self.folder / f'{name}_{namespace}.log').open('w') as output:
            return subprocess.Popen(
                [sys.executable, str(EXECUTABLE.with_name(name)), *arguments],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
            )

    def _drive(self) -> None:
        """Follow the setpoints of every cell, and say where its axes are."""
        node = self._drives
        setpoints = {
            cell: node.create_subscription(
                JointTrajectory, f'/{cell}/homing_node/setpoints', print, 100
            )
            for cell in self.cells
        }
        publishers = {
            cell: node.create_publisher(JointState, f'/{cell}/joint_states', 10)
            for cell in self.cells
        }
        due = time.monotonic()
        while not self._ended.is_set():
            due = max(due + 1.0 / FEEDBACK, time.monotonic())
            time.sleep(max(0.0, due - time.monotonic()))
            for cell, subscription in setpoints.items():
                while taken := subscription.handle.take_message(JointTrajectory, False):
                    message, _ = taken
                    for name, position in zip(
                        message.joint_names, message.points[0].positions, strict=True
                    ):
                        self.positions[cell][NAMES.index(name)] = position
                state = JointState(name=NAMES, position=self.positions[cell])
                stamp = time.time_ns()
                state.header.stamp.sec = stamp // 1_000_000_000
                state.header.stamp.nanosec = stamp % 1_000_000_000
                publishers[cell].publish(state)

    # ------------------------------------------------------------------------------- the user

    def spin(self) -> None:
        self._executor.spin_once(timeout_sec=0.02)
        for subscription in self._watched:
            while taken := subscription.handle.take_message(AxisState, True):
                now = time.time()
                stamp = deserialize_message(taken[0], AxisState).header.stamp
                self.states.append((now - stamp.sec - stamp.nanosec * 1e-9, now))

    def until(self, condition: Callable[[], Any], what: str) -> Any:
        end = time.monotonic() + PATIENCE
        while not (found := condition()):
            self.spin()
            self._see_that_all_live()
            if time.monotonic() > end:
                raise TimeoutError(what)
        return found

    def _see_that_all_live(self) -> None:
        for process in (*self.nodes, self.coordinator):
            if process.poll() is not None:
                raise RuntimeError(f'{process.args[1]} has ended; its log is in {self.folder}')

    def until_ready(self) -> None:
        """Wait until a dry run finds nothing missing."""
        end = time.monotonic() + PATIENCE
        while missing := self.home(dry_run=True).missing:
            if time.monotonic() > end:
                raise TimeoutError('; '.join(missing[:3]))

    def wait(self, seconds: float) -> None:
        """Listen for a while."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.spin()

    def home(self, **goal: Any) -> Home.Result:
        sent = self.action.send_goal_async(Home.Goal(**goal))
        self.until(sent.done, 'the goal')
        result = sent.result().get_result_async()
        self.until(result.done, 'the result')
        return result.result().result

    def ages(self, since: float) -> list[float]:
        return [age for age, when in self.states if when > since]


class Part(NamedTuple):
    """What was measured in a part of a case: of a cell, of the coordinator; ages in s."""

    cell: float  # processor, % of a core
    coordinator: float
    machine: float  # % of all cores, whoever used them
    ages: list[float]
    lasted: float


def machine_busy() -> float:
    """Return how long the cores of the machine have worked, added up, s."""
    fields = Path('/proc/stat').read_text().splitlines()[0].split()[1:]
    idle = int(fields[3]) + int(fields[4])
    return (sum(map(int, fields)) - idle) / os.sysconf('SC_CLK_TCK')


def measured(line: Line, work: Callable[[], Any]) -> Part:
    """Measure the processes while something is done."""

    def used() -> list[float]:
        processes = [usage(one).processor for one in (*line.nodes, line.coordinator)]
        return [*processes, machine_busy() / (os.cpu_count() or 1)]

    before = used()
    begun, since = time.monotonic(), time.time()
    work()
    lasted = time.monotonic() - begun
    shares = [100.0 * (b - a) / lasted for a, b in zip(before, used(), strict=True)]
    *cells, coordinator, machine = shares
    return Part(sum(cells) / len(cells), coordinator, machine, line.ages(since), lasted)


class Case(NamedTuple):
    """What was measured of a line: times in s, memory in MB."""

    cells: int
    started: float
    answered: float  # a dry run of the line
    rest: Part
    homing: Part
    requests: int  # until the whole line was homed
    memory: float  # of a cell
    own_memory: float  # of the coordinator


def case(cells: int, rest: float) -> Case:
    """Measure a line with a number of cells."""
    line = Line(cells)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit('terminated'))  # no process stays
    try:
        begun = time.monotonic()
        line.start()
        line.until(line.action.server_is_ready, 'the coordinator')
        line.until_ready()
        started = time.monotonic() - begun
        line.wait(3.0)
        asked = time.monotonic()
        check(line.home(dry_run=True))
        answered = time.monotonic() - asked
        at_rest = measured(line, lambda: line.wait(rest))
        requests: list[Home.Result] = []
        homing = measured(line, lambda: requests.extend(until_homed(line)))
        memory = [usage(one).memory for one in line.nodes]
        own = usage(line.coordinator).memory
    finally:
        line.close()
    return Case(cells, started, answered, at_rest, homing, len(requests), sum(memory) / cells, own)


def of_case(one: Case) -> Iterator[Figure]:
    """Yield the figures of a line."""
    what = f'{one.cells} cells × {AXES} axes'
    yield Figure(f'{what}: until every cell answers', 's', [one.started])
    yield Figure(f'{what}: a dry run of {STEPS * one.cells} axes', 's', [one.answered])
    yield Figure(f'{what}: {STEPS} steps of {one.cells} axes', 's', [one.homing.lasted])
    for name, part in (('at rest', one.rest), ('homing', one.homing)):
        yield Figure(f'{what}, {name}: processor of a cell', '% of a core', [part.cell])
        yield Figure(f'{what}, {name}: of the coordinator', '% of a core', [part.coordinator])
        yield Figure(f'{what}, {name}: of all that runs', '% of all cores', [part.machine])
        ages = [1000.0 * age for age in part.ages]
        middle, old = nth(ages, 0.5), nth(ages, 0.99)
        yield Figure(f'{what}, {name}: age of a state, median', 'ms', [middle])
        yield Figure(
            f'{what}, {name}: age of a state, 99 of 100', 'ms', [old], (), '≤ 200', old <= 200.0
        )
    yield Figure(
        f'{what}: requests until the line was homed',
        '',
        [one.requests],
        (),
        '1',
        one.requests == 1,
    )
    yield Figure(f'{what}: memory of a cell', 'MB', [one.memory])
    yield Figure(f'{what}: memory of the coordinator', 'MB', [one.own_memory])


def growth(few: Case, many: Case) -> Iterator[Figure]:
    """Yield what the coordinator needs more for each further cell."""
    further = many.cells - few.cells
    what = f'for each cell more ({few.cells} to {many.cells})'
    for name, before, after in (
        ('at rest', few.rest, many.rest),
        ('homing', few.homing, many.homing),
    ):
        more = (after.coordinator - before.coordinator) / further
        yield Figure(f'{what}, {name}: processor of the coordinator', '% of a core', [more])
    yield Figure(
        f'{what}: memory of the coordinator', 'MB', [(many.own_memory - few.own_memory) / further]
    )


def until_homed(line: Line) -> list[Home.Result]:
    """Home the line, and what is left while cells answer too late; return the results."""
    results = [line.home(force=True)]
    while results[-1].error_code in (AxisState.CELL_LOST, AxisState.RESULT_LOST):
        print(results[-1].message[:300])
        if len(results) == MOST_REQUESTS:
            break
        results.append(line.home())
    check(results[-1])
    return results


def check(result: Home.Result) -> None:
    """See that the whole line was homed."""
    if not result.success:
        raise RuntimeError(result.message)


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield the figures of 4, 8 and 16 cells; `CELLS=4,8` and `AXES=8` choose others."""
    print(
        f'real time; cycle {RATE:g} Hz, feedback {FEEDBACK:g} Hz, {AT_ONCE} axes at once, '
        f'discovery: {DISCOVERY}'
    )
    chosen = os.environ.get('CELLS', '2' if quick else '4,8,16')
    cases = []
    for cells in map(int, chosen.split(',')):
        cases.append(case(cells, 2.0 if quick else REST))
        yield from of_case(cases[-1])
    if len(cases) > 1:
        yield from growth(cases[0], cases[-1])
