# SPDX-License-Identifier: Apache-2.0
"""Two cells and their coordinator as processes; the second cell is a managed node."""

import json
import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import cable
import pytest
import ros_harness as ros
import yaml
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.action import ActionClient
from std_srvs.srv import Trigger

from homing_node.cli import main

NODES = {'cell1': '/cell1/homing_node', 'cell2': '/cell2/homing_node'}
AXES = {'cell1': ['x', 'z'], 'cell2': ['y', 'z']}
LINE = {
    'nodes': list(NODES.values()),
    'steps': ['cell1/z, cell2/z', 'cell1/x, cell2/y'],
    'requires': ['cell2/y: cell1/z'],
    'cell_timeout': 5.0,  # the machine of the tests is busy
}

#: They take long: each line has five processes.
pytestmark = pytest.mark.long

#: Five processes share the machine: nothing is faster than it must be, and everything may be late.
RATES = {'feedback_rate': 100.0, 'step_rate': 200.0, 'controller_rate': 100.0, 'dead_time': 0.02}
PATIENT = {'feedback_timeout': 5.0, 'following_error': 0.04}
#: Slow enough that a test can act while an axis moves.
SLOW = {**PATIENT, 'homing_reverse_distance': 0.02}

ERROR = DiagnosticStatus.ERROR
#: The state after each transition.
AFTER = {
    Transition.TRANSITION_CONFIGURE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_ACTIVATE: State.PRIMARY_STATE_ACTIVE,
    Transition.TRANSITION_DEACTIVATE: State.PRIMARY_STATE_INACTIVE,
    Transition.TRANSITION_CLEANUP: State.PRIMARY_STATE_UNCONFIGURED,
}


class Line:
    """The processes, and what a user's node sees of them."""

    def __init__(self, folder):
        self.folder, self.domain = folder, ros.Domain()
        self.processes = []
        self.layout = folder / 'layout.yaml'  # of the first cell
        self.layout.write_text(yaml.dump(dict.fromkeys(AXES['cell1'], ros.LAYOUT)))
        for cell, axes in AXES.items():
            plant = ros.plant_parameters({axis: {'start': 0.05} for axis in axes}, **RATES)
            self.run('simulated_axes', plant, '-r', f'__ns:=/{cell}')
        self.nodes = {cell: self.start(cell) for cell in AXES}
        self.coordinator = self.run('homing_coordinator', LINE)
        self.client = ros.Client(self.domain, '/homing_coordinator')
        self.states = {
            f'{cell}/{axis}': self.client.record(AxisState, f'{cell}/{axis}/state', ros.LATCHED)
            for cell, axes in AXES.items()
            for axis in axes
        }
        self.action = ActionClient(self.client.node, Home, '/homing_coordinator/home')

    def run(self, name, parameters, *arguments):
        process = ros.Process(name, self.folder, self.domain, parameters, arguments)
        self.processes.append(process)
        return process

    def start(self, cell, names=()):
        axes = {axis: SLOW if axis == 'z' else PATIENT for axis in names or AXES[cell]}
        parameters = ros.node_parameters(
            axes,
            update_rate=100.0,
            cycle_timeout=5.0,
            ready_timeout=10.0,
            lifecycle=cell == 'cell2',
            layout=str(self.layout) if cell == 'cell1' else '',
        )
        return self.run('homing_node', parameters, '-r', f'__ns:=/{cell}')

    def close(self):
        statuses = [process.close() for process in reversed(self.processes)]
        outputs = [process.output for process in self.processes]
        self.client.close()
        self.domain.release()
        assert set(statuses) <= {0, -9}, (statuses, outputs)
        assert not any('Traceback' in output for output in outputs), outputs

    def insist(self, kind, service, **fields):
        """Call a service until it answers: a node that was killed may still be listed as well."""
        asking = ros.Asking(lambda: self.client.send(kind, service, **fields), lambda: True)
        return self.client.until(asking.answer, 90.0, service)

    def life(self, cell):
        return self.insist(GetState, f'{NODES[cell]}/get_state').current_state.id

    def transit(self, cell, *transitions):
        for number in transitions:
            asked = Transition(id=number)
            self.insist(ChangeState, f'{NODES[cell]}/change_state', transition=asked)
            assert self.life(cell) == AFTER[number]

    def activate(self, cell):
        self.transit(cell, Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE)

    def send(self, *axes, **goal):
        """Send a goal to the coordinator; return its handle."""
        return self.client.answer(self.action.send_goal_async(Home.Goal(axes=list(axes), **goal)))

    def result(self, handle):
        future = handle.get_result_async()
        self.client.until(future.done, 60.0, 'a result')
        return future.result().result

    def home(self, *axes, **goal):
        return self.result(self.send(*axes, **goal))

    def at_node(self, cell, name):
        return self.client.ask(Trigger, f'{NODES[cell]}/{name}', 40.0)

    def state(self, axis):
        return self.states[axis][-1].message if self.states[axis] else AxisState()

    def restart_coordinator(self):
        """Start it again; it finds what is homed."""
        self.coordinator = self.run('homing_coordinator', LINE)
        answer = self.insist(Trigger, 'home')
        assert answer.success, answer.message

    def until_said(self, name, text):
        """Wait until the diagnostics say that a cell, or the line, is in trouble."""
        full = f'/homing_coordinator: {name}'
        heard = self.client.record(DiagnosticArray, '/diagnostics')
        self.client.until(
            lambda: any(
                one.name == full and one.message.startswith(text) and one.level == ERROR
                for array in heard
                for one in array.message.status
            ),
            what=text,
        )
        self.client.forget(heard)

    def until_moving(self, *axes, handle=None):
        """Wait until axes move, which a goal homes."""
        ended = handle and handle.get_result_async()
        still = ('', 'Idle')  # '': nothing is heard yet

        def moving():
            assert not (ended and ended.done()), ended.result().result.message
            return all(self.state(axis).state not in still for axis in axes)

        self.client.until(moving, 40.0)


@pytest.fixture(scope='module')
def a_line(tmp_path_factory):
    made = Line(tmp_path_factory.mktemp('line'))
    try:
        made.client.until(made.action.server_is_ready, 60.0)
        made.activate('cell2')
        yield made
    finally:
        made.close()


@pytest.fixture
def of(a_line):
    yield a_line
    assert a_line.client.trigger('cancel', 40.0).success


def test_a_line_homes_in_steps_and_a_node_knows_its_lock(of):
    of.client.until(lambda: 'cell1/z is not homed' in of.at_node('cell2', 'y/home').message)
    of.client.until(lambda: (dry_run := of.home(dry_run=True)).success or not dry_run.missing)
    assert list(of.home(dry_run=True).steps) == LINE['steps']

    def rehearsed():
        dry_run = of.home('cell1/z', 'cell1/x', dry_run=True)
        return not any(map(math.isnan, dry_run.durations)) and dry_run

    dry_run = of.client.until(rehearsed, 60.0)
    assert all(1.0 < duration < 60.0 for duration in dry_run.durations), dry_run.durations
    dry_run = of.home('cell2/z', dry_run=True)  # its node has no layout
    assert math.isnan(dry_run.durations[0])
    assert 'how long cell2/z will take is not known' in dry_run.message

    result = of.home()
    assert result.success, result.message
    assert [state.axis for state in result.states] == ['cell1/z', 'cell2/z', 'cell1/x', 'cell2/y']
    assert all(state.homed for state in result.states)

    def times(axis):
        moving = [heard.sent for heard in of.states[axis] if heard.message.state != 'Idle']
        return min(moving), max(moving)

    assert max(times('cell1/z')[1], times('cell2/z')[1]) < times('cell2/y')[0]
    assert of.home().message == 'Homed: homed before: cell1/z, cell2/z, cell1/x, cell2/y'
    again = of.home(dry_run=True, force=True)
    assert list(again.steps) == LINE['steps']
    assert all(0.1 < duration < 60.0 for duration in again.durations)
    assert of.client.trigger('cell2/y/home').message == 'Homed: homed before: cell2/y'
    answer = of.at_node('cell2', 'y/home')
    assert answer.success, answer.message


def test_names_that_nothing_has(of):
    assert of.home('cell3/x').error_code == AxisState.UNKNOWN_CELL
    assert of.home('cell1/q').error_code == AxisState.UNKNOWN_AXIS


def test_two_coordinators_refuse_until_one_has_ended_and_what_is_on_ends(of):
    handle = of.send('cell1/z', force=True)
    of.until_moving('cell1/z', handle=handle)
    second = of.run('homing_coordinator', LINE, '-r', '__node:=second')
    assert of.result(handle).success
    answer = of.insist(Trigger, '/second/cell1/x/home')
    assert answer.message.startswith('CoordinatorConflict: /homing_coordinator guards cells')
    assert of.home('cell1/x').error_code == AxisState.COORDINATOR_CONFLICT
    of.until_said('line', 'CoordinatorConflict: /second guards cells of this line, too')
    assert second.close() == 0
    of.client.until(lambda: of.home('cell1/x').success)


def test_a_canceled_request_answers_when_every_axis_rests(of):
    handle = of.send(force=True)
    of.until_moving('cell1/z', 'cell2/z', handle=handle)
    answer = of.client.trigger('cancel')
    assert answer.success, answer.message
    result = of.result(handle)
    assert result.error_code == AxisState.CANCELED
    assert all(state.state == 'Idle' for state in result.states)
    assert result.message.startswith('Canceled: ')


def test_the_command_homing_works_against_a_coordinator(of, monkeypatch, capsys):
    monkeypatch.setenv('ROS_DOMAIN_ID', str(of.domain.number))

    def homing(verb, *arguments):
        status = main([verb, *arguments, '--node', '/homing_coordinator'])
        return status, *capsys.readouterr()

    status, out, err = homing('home', '--dry-run', '--force')
    assert (status, err) == (0, ''), out
    assert out.startswith('step 1: cell1/z, cell2/z: ') and 'nothing is missing' in out
    status, out, _ = homing('home', 'cell1/x', '--force')
    assert status == 0 and 'cell1/x: SecondHSSearch' in out and 'Homed: home_position_raw' in out
    assert homing('home', 'cell1/x')[1].endswith('Homed: homed before: cell1/x\n')
    status, out, _ = homing('home', 'cell1/x', '--dry-run', '--json')
    assert status == 0 and json.loads(out)['steps'] == []
    status, out, err = homing('repeat', 'cell1/x', '--runs', '2')
    assert err == '' and out.count(': Homed: home_position_raw=') == 2
    status, out, _ = homing('watch', '--once', '--json')
    told = json.loads(out)['axes']
    assert status == 0 and set(told) == {'cell1/x', 'cell1/z', 'cell2/y', 'cell2/z'}
    assert told['cell1/x']['homed'] and told['cell1/x']['inputs']['home_switch']['level'] != '-'
    status, out, _ = homing('cancel', 'cell1/x', 'cell2/y')
    assert (status, out.count('nothing to cancel')) == (0, 2)
    for verb in (['verify'], ['continue'], ['doctor'], ['record', '-o', 'never.mcap']):
        status, _, err = homing(*verb)
        assert status == 2 and err.startswith('homing: /homing_coordinator is a coordinator, ')
        assert f'homing {verb[0]} --node /cell1/homing_node' in err


def test_ctrl_c_of_homing_home_waits_until_the_line_rests(of):
    code = 'import sys; from homing_node.start import homing; sys.exit(homing())'
    child = subprocess.Popen(
        [sys.executable, '-c', code, 'home', '--force', '--node', '/homing_coordinator'],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, 'ROS_DOMAIN_ID': str(of.domain.number)},
    )
    try:
        assert re.fullmatch('cell[12]/z: .*\n', child.stdout.readline())
        of.until_moving('cell1/z', 'cell2/z')
        child.send_signal(signal.SIGINT)
        _, err = child.communicate(timeout=40.0)
        ended = time.time_ns()
    finally:
        child.kill()
    assert child.returncode == 130
    assert err.startswith('homing: interrupted; the axes are at rest: Canceled: '), err
    of.client.until(lambda: all(of.state(axis).state == 'Idle' for axis in of.states))
    moving = [one for axis in of.states.values() for one in axis if one.message.state != 'Idle']
    assert max(one.sent for one in moving) < ended


def test_a_killed_coordinator_starts_nothing_more_and_its_locks_stay(of):
    assert of.home().success
    handle = of.send(force=True)
    of.until_moving('cell1/z', 'cell2/z', handle=handle)
    of.coordinator.process.kill()
    own = of.client.record(AxisState, f'{NODES["cell1"]}/z/state', ros.LATCHED)
    other = of.client.record(AxisState, f'{NODES["cell1"]}/x/state', ros.LATCHED)
    of.client.until(lambda: own and own[-1].message.homed, 40.0)  # its run ends well
    of.client.until(lambda: 'has been silent' in of.at_node('cell2', 'y/home').message)
    assert {heard.message.state for heard in other} == {'Idle'}
    of.restart_coordinator()


def test_a_coordinator_that_is_killed_in_the_last_step_leaves_its_runs_to_the_nodes(of):
    """An axis that it guards ends its run; then it is locked."""
    assert of.home().success
    handle = of.send('cell2/y', force=True)
    of.until_moving('cell2/y', handle=handle)
    of.coordinator.process.kill()
    own = of.client.record(AxisState, f'{NODES["cell2"]}/y/state', ros.LATCHED)
    of.client.until(lambda: own and own[-1].message.state == 'Idle', 40.0)
    assert own[-1].message.homed, own[-1].message
    of.client.until(lambda: 'has been silent' in of.at_node('cell2', 'y/home').message)
    assert of.at_node('cell1', 'x/home').success  # nothing guards it
    of.restart_coordinator()


def test_a_managed_node_stops_when_it_is_deactivated_and_forgets_when_cleaned(of):
    own = of.client.record(AxisState, f'{NODES["cell2"]}/z/state', ros.LATCHED)
    of.send('cell2/z', force=True)
    of.client.until(lambda: own and own[-1].message.state != 'Idle')
    of.transit('cell2', Transition.TRANSITION_DEACTIVATE)
    of.client.until(lambda: own[-1].message.error == 'Canceled')
    assert of.at_node('cell2', 'z/home').message.startswith('NotActive: axis z: the node is not')
    assert of.home('cell2/z').error_code == AxisState.NOT_ACTIVE
    of.transit('cell2', Transition.TRANSITION_ACTIVATE)
    assert of.home('cell2/z').success
    of.transit('cell2', Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP)
    of.client.until(lambda: not own[-1].message.homed)
    of.activate('cell2')


def test_a_cancel_that_crosses_the_result(of):
    own = of.client.record(AxisState, f'{NODES["cell1"]}/x/state', ros.LATCHED)
    handle = of.send('cell1/x', force=True)
    of.client.until(lambda: own and own[-1].message.state not in ('Idle', 'HSSearch'))
    of.client.until(lambda: own[-1].message.state == 'Idle')
    canceled = handle.cancel_goal_async()
    result = of.result(handle)
    of.client.until(canceled.done)
    (state,) = result.states
    assert state.state == 'Idle'
    assert state.homed  # its run had ended before
    assert result.error_code == AxisState.NO_ERROR, result.message


def test_a_cell_that_restarts_between_steps_has_lost_its_home(of):
    assert of.home().success
    handle = of.send('cell2/z', force=True)
    of.until_moving('cell2/z', handle=handle)
    assert of.client.trigger('cancel').success
    assert of.result(handle).error_code == AxisState.CANCELED
    before = len(of.states['cell2/y'])
    handle = of.send('cell2/z', 'cell2/y', force=True)  # cell1/z, which y requires, is homed
    of.until_moving('cell2/z', handle=handle)
    of.nodes['cell1'].process.kill()
    of.nodes['cell1'] = of.start('cell1')
    result = of.result(handle)
    assert result.error_code in (AxisState.PREREQUISITE_MISSING, AxisState.CELL_LOST)
    assert re.search('cell2/y.*cell1', result.message), result.message
    assert {heard.message.state for heard in of.states['cell2/y'][before:]} <= {'Idle'}
    of.client.until(lambda: 'cell1/z is not homed' in of.at_node('cell2', 'y/home').message)
    of.client.until(lambda: (again := of.home()).success or 'cell1' not in again.message, 60.0)


def test_a_result_that_is_lost_since_its_node_dies(of):
    own = of.client.record(AxisState, f'{NODES["cell1"]}/x/state', ros.LATCHED)
    handle = of.send('cell1/x', 'cell2/y', force=True)
    of.client.until(lambda: own and own[-1].message.state not in ('Idle', 'HSSearch'))
    of.nodes['cell1'].process.send_signal(signal.SIGSTOP)  # it says nothing more
    of.nodes['cell1'].process.kill()
    result = of.result(handle)
    assert result.error_code == AxisState.CELL_LOST, result.message
    assert 'cell1/x' in result.message
    assert not of.state('cell1/x').homed
    assert of.state('cell2/y').state == 'Idle'
    of.nodes['cell1'] = of.start('cell1')
    of.client.until(lambda: (again := of.home()).success or 'cell1' not in again.message, 60.0)


def test_a_killed_cell_is_lost_and_the_others_rest(a_line):
    """After it the second cell stays away."""
    handle = a_line.send(force=True)
    a_line.until_moving('cell1/z', 'cell2/z', handle=handle)
    before = len(a_line.states['cell1/x'])
    a_line.nodes['cell2'].process.kill()
    result = a_line.result(handle)
    assert result.error_code == AxisState.CELL_LOST, result.message
    assert {state.axis: state.state for state in result.states}['cell1/z'] == 'Idle'
    assert {heard.message.state for heard in a_line.states['cell1/x'][before:]} <= {'Idle'}
    stopped = a_line.client.trigger('cancel', 40.0)
    assert stopped.message.startswith('CellLost: no answer of cell2')
    a_line.client.until(lambda: a_line.state('cell2/y').error == 'CellLost')
    assert not a_line.state('cell2/y').homed
    a_line.until_said('cell2', 'CellLost: /cell2/homing_node is silent')


def test_a_cell_that_restarts_with_other_axes(a_line):
    """The last test of the line: the first cell stays another one."""
    assert a_line.home('cell1/x').success
    a_line.nodes['cell1'].process.kill()
    a_line.nodes['cell1'] = a_line.start('cell1', ['w'])
    gone = a_line.client.until(
        lambda: (said := a_line.home('cell1/z')).error_code != AxisState.CELL_LOST and said, 60.0
    )
    assert gone.error_code == AxisState.UNKNOWN_AXIS, gone.message
    a_line.client.until(lambda: a_line.home('cell1/w', dry_run=True).states)
    a_line.client.until(lambda: a_line.state('cell1/x').error == 'UnknownAxis')
    assert not a_line.state('cell1/x').homed
    a_line.until_said('cell1', 'UnknownAxis: cell1/z, cell1/x, which `steps` or `requires` name')


def test_a_bad_line_ends_with_every_fault(tmp_path):
    with_faults = {**LINE, 'steps': ['cell1/x, cell3/x', 'cell1/x'], 'at_once': 0}
    domain = SimpleNamespace(number=ros.DOMAINS[0])
    process = ros.Process('homing_coordinator', tmp_path, domain, with_faults)
    assert process.wait() == 1
    for text in ('at_once: 0', "'cell3' is none of the cells", 'stands in two steps, 1 and 2'):
        assert text in process.output


# -- a discovery server --------------------------------------------------------------------------

ADDRESS, PORT = '127.0.0.1', 11833
BY_SERVER = {
    'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SYSTEM_DEFAULT',
    'ROS_DISCOVERY_SERVER': f'{ADDRESS}:{PORT}',
    'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
}


@pytest.fixture
def server(monkeypatch):
    """A discovery server, by which the processes of a test find each other."""
    monkeypatch.setattr(ros, 'UDP', BY_SERVER)
    monkeypatch.delenv('FASTRTPS_DEFAULT_PROFILES_FILE')
    for name, value in BY_SERVER.items():
        monkeypatch.setenv(name, value)
    executable = Path(sys.executable).with_name('fast-discovery-server')
    with subprocess.Popen(
        [executable, '-i0', f'-l{ADDRESS}', f'-p{PORT}'],
        stdin=subprocess.PIPE,  # it ends with its input
        stdout=subprocess.DEVNULL,
    ) as process:
        yield
        process.terminate()


def test_a_line_whose_processes_find_each_other_by_a_discovery_server(tmp_path, server):
    """It tells a process only of the topics that it shares: a second node of one name is seen."""
    of = Line(tmp_path)
    try:
        of.client.until(of.action.server_is_ready, 60.0)
        of.activate('cell2')
        of.client.until(lambda: of.home().success, 90.0)
        second = of.start('cell1')
        said = 'setpoints is published by /cell1/homing_node, too'
        of.client.until(lambda: said in of.at_node('cell1', 'x/home').message, 60.0)
        assert second.close() == 0
        of.client.until(lambda: of.at_node('cell1', 'x/home').success, 60.0)
        handle = of.send('cell2/z', 'cell2/y', force=True)
        of.until_moving('cell2/z', handle=handle)
        of.nodes['cell2'].process.kill()
        result = of.result(handle)
        assert result.error_code == AxisState.CELL_LOST, result.message
    finally:
        of.close()


# -- two hosts ------------------------------------------------------------------------------------

WHY_NOT = cable.missing()


class Hosts:
    """The coordinator, a client and the first cell on one host, the second cell on the other."""

    def __init__(self, folder):
        self.folder, self.domain = folder, ros.Domain()
        self.cable = cable.Cable()
        self.processes = []
        near, far = self.cable.near, self.cable.far
        self.start('homing_coordinator', near, '', {**LINE, 'cell_timeout': 2.0})
        for cell, host in (('cell1', near), ('cell2', far)):
            axes = AXES[cell]
            layouts = {axis: {'start': 0.05} for axis in axes}
            parameters = {axis: SLOW if axis == 'z' else PATIENT for axis in axes}
            plant = ros.plant_parameters(layouts, **RATES)
            node = ros.node_parameters(
                parameters, update_rate=100.0, cycle_timeout=5.0, ready_timeout=20.0
            )
            self.start('simulated_axes', host, cell, plant)
            self.start('homing_node', host, cell, node)

    def start(self, name, host, cell, parameters):
        file = self.folder / f'{name}_{cell}.yaml'
        file.write_text(
            yaml.dump({'/**': {'ros__parameters': parameters}}, Dumper=ros.PlainDumper)
        )
        code = f'import sys; from {ros.MAINS[name]} import main; sys.exit(main())'
        namespace = ['-r', f'__ns:=/{cell}'] if cell else []
        arguments = ['-c', code, '--ros-args', '--params-file', str(file), *namespace]
        self.processes.append(self.run(host, f'{name}_{cell}', arguments))

    def run(self, host, name, arguments):
        log = self.folder / f'{name}.log'
        return self.cable.run(host, arguments, log, ROS_DOMAIN_ID=str(self.domain.number))

    def home(self, moving=None):
        """Home the line with the command `homing`; call a function once the far cell moves.

        The cable may lose the far cell before it moves: then there is nothing to call.
        """
        code = 'import sys; from homing_node.cli import main; sys.exit(main())'
        verb = ['-c', code, 'home', '--node', '/homing_coordinator']
        process = self.run(self.cable.near, 'client', verb)
        log = self.folder / 'client.log'
        try:
            if moving is not None:
                ros.wait_for(
                    lambda: 'cell2/z: HS' in log.read_text() or process.poll() is not None, 60.0
                )
                if process.poll() is None:
                    moving()
            process.wait(90.0)
        finally:
            process.kill()
            process.wait()
        return log.read_text()

    def close(self):
        for process in self.processes:
            process.send_signal(signal.SIGINT)
        statuses = [process.wait(20.0) for process in self.processes]
        self.cable.close()
        self.domain.release()
        assert set(statuses) == {0}, [log.read_text() for log in self.folder.glob('*.log')]


@pytest.mark.skipif(bool(WHY_NOT), reason=WHY_NOT)
def test_a_line_over_a_bad_cable_homes_or_names_the_cell_that_is_lost(tmp_path):
    hosts = Hosts(tmp_path)
    try:
        hosts.cable.set(delay=0.02, jitter=0.005, loss=0.05)
        told = hosts.home(lambda: hosts.cable.set(cut=True))
        assert re.search('(CellLost|ResultLost): cell2/z', told), told
        hosts.cable.set(cut=False)
        ros.wait_for(
            lambda: 'Homed' in (told := hosts.home()) or not re.search('cell2|there is no', told),
            180.0,
        )
    finally:
        hosts.close()
