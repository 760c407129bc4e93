# SPDX-License-Identifier: Apache-2.0
"""The coordinator as a process, over cells that answer, keep silent and lie as a test wants it.

Whatever happens, no goal leaves that should not, and every request ends with an answer.
"""

import pytest
import ros_harness as ros
from cell_stand_in import CellStandIn
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionClient

#: They have a process of the coordinator, and some wait for seconds.
pytestmark = pytest.mark.long

LINE = {
    'nodes': ['/cell1/homing_node', '/cell2/homing_node'],
    'steps': ['cell1/z, cell2/z', 'cell1/x, cell2/y'],
    'requires': ['cell2/y: cell1/z'],
    'cell_timeout': 4.0,  # the machine of the tests is busy
}
AXES = {'cell1': ['x', 'z'], 'cell2': ['y', 'z']}
HOUR = 3600.0


class Line:
    def __init__(self, folder):
        self.folder, self.domain = folder, ros.Domain()
        self.client = ros.Client(self.domain, '/homing_coordinator')
        self.cells = {
            name: CellStandIn(self.client.context, name, axes) for name, axes in AXES.items()
        }
        for cell in self.cells.values():
            self.client.spin(cell.node)
        self.processes = []
        self.action = ActionClient(self.client.node, Home, '/homing_coordinator/home')
        self.start()

    def start(self):
        """Start a coordinator; return when nothing is missing for it."""
        self.coordinator = ros.Process('homing_coordinator', self.folder, self.domain, LINE)
        self.processes.append(self.coordinator)
        self.client.until(self.action.server_is_ready, 40.0)
        # One that was killed may still be listed as well.
        asking = ros.Asking(
            lambda: self.action.send_goal_async(Home.Goal(dry_run=True)), lambda: True
        )
        self.client.until(asking.answer, 60.0, 'the coordinator')
        self.client.until(lambda: self.home(dry_run=True).success, 40.0)

    def kill(self):
        self.coordinator.process.kill()
        self.coordinator.wait()

    def close(self):
        statuses = [process.close() for process in self.processes]
        for cell in self.cells.values():
            cell.end()
        self.client.close()
        self.domain.release()
        assert set(statuses) <= {0, -9}, [one.output for one in self.processes]
        assert not any('Traceback' in one.output for one in self.processes)

    def send(self, *axes, **goal):
        """Send a goal to the coordinator; return the future of its result."""
        handle = self.client.answer(
            self.action.send_goal_async(Home.Goal(axes=list(axes), **goal))
        )
        future = handle.get_result_async()
        future.handle = handle
        return future

    def result(self, future):
        self.client.until(future.done, 30.0, 'a result')
        return future.result().result

    def home(self, *axes, **goal):
        return self.result(self.send(*axes, **goal))

    def goal(self, axis):
        """Wait for the goal of an axis; return it."""
        cell, _, name = axis.partition('/')
        goals = self.cells[cell].goals
        return self.client.until(lambda: goals.pop(name, None), 15.0, f'the goal of {axis}')

    def end(self, *axes):
        for axis in axes:
            self.goal(axis).end()


@pytest.fixture(scope='module')
def a_line(tmp_path_factory):
    made = Line(tmp_path_factory.mktemp('stand_ins'))
    yield made
    made.close()


@pytest.fixture
def of(a_line):
    for cell in a_line.cells.values():
        cell.homed.clear()
        for record in (cell.checks, cell.goals, cell.canceled):
            record.clear()
    a_line.client.until(
        lambda: not any(state.homed for state in a_line.home(dry_run=True).states), 15.0
    )
    yield a_line
    for cell in a_line.cells.values():
        cell.release()
        cell.on_cancel, cell.clock = lambda goal: goal.end('Canceled'), 0.0
        for goal in cell.goals.values():
            goal.end('Canceled')


def test_a_coordinator_that_is_killed_during_a_check_starts_nothing(of):
    cell = of.cells['cell1']
    cell.hold = True
    of.send('cell1/x')
    of.client.until(lambda: ['x'] in cell.checks, 15.0)
    of.kill()
    cell.release()
    of.client.pass_time(1.5)
    assert not cell.goals
    of.start()
    later = of.send('cell1/x')
    of.end('cell1/x')
    assert of.result(later).success


def test_a_coordinator_that_is_killed_between_steps_starts_no_step_more(of):
    """Started again, it homes what is left."""
    of.send()
    of.client.until(lambda: of.cells['cell1'].goals and of.cells['cell2'].goals, 15.0)
    for cell in of.cells.values():
        cell.hold = True  # the checks of the next step
    of.end('cell1/z', 'cell2/z')
    of.client.until(lambda: any('x' in axes for axes in of.cells['cell1'].checks), 15.0)
    of.kill()
    for cell in of.cells.values():
        cell.release()
    of.client.pass_time(1.5)
    assert not of.cells['cell1'].goals
    assert not of.cells['cell2'].goals
    of.start()
    again = of.send()
    of.end('cell1/x', 'cell2/y')
    result = of.result(again)
    assert result.message.endswith('homed before: cell1/z, cell2/z'), result.message


@pytest.mark.parametrize('homed', [True, False])
def test_a_result_that_is_lost_while_its_cell_lives(of, homed):
    """The last state of the axis is told; nothing of the next step starts."""
    request = of.send()
    of.end('cell2/z')
    of.goal('cell1/z')
    of.cells['cell1'].stop('z', homed)
    result = of.result(request)
    assert result.error_code == AxisState.RESULT_LOST, result.message
    assert 'cell1/z' in result.message
    (state,) = (state for state in result.states if state.axis == 'cell1/z')
    assert (state.state, state.homed) == ('Idle', homed)
    assert not of.cells['cell1'].goals
    assert not of.cells['cell2'].goals


@pytest.mark.parametrize('error', ['', 'Canceled'])
def test_a_cancel_that_races_with_the_result(of, error):
    """The run ends in the moment in which the cancel arrives: its result counts."""
    of.cells['cell1'].on_cancel = lambda goal: goal.end(error)
    request = of.send('cell1/x')
    of.goal('cell1/x')
    of.client.answer(request.handle.cancel_goal_async())
    result = of.result(request)
    assert of.cells['cell1'].canceled == ['x']
    assert result.error_code == (AxisState.CANCELED if error else AxisState.NO_ERROR)
    assert result.states[0].homed == (not error)


def test_clocks_of_cells_that_are_apart_and_set_back(of):
    of.cells['cell1'].clock, of.cells['cell2'].clock = HOUR, -HOUR
    request = of.send()
    of.end('cell1/z', 'cell2/z', 'cell1/x', 'cell2/y')
    assert of.result(request).success
    of.cells['cell1'].clock = -HOUR
    of.cells['cell1'].homed.clear()  # of what its new stamps tell
    of.client.until(
        lambda: not any(state.homed for state in of.home('cell1/z', dry_run=True).states), 15.0
    )
    request = of.send()
    of.end('cell1/z', 'cell1/x')
    result = of.result(request)
    assert result.message.endswith('homed before: cell2/z, cell2/y'), result.message


def test_a_cell_that_restarts_between_steps(of):
    """Its home is gone: what requires it does not start."""
    request = of.send()
    of.client.until(lambda: of.cells['cell1'].goals and of.cells['cell2'].goals, 15.0)
    first, second = of.cells['cell1'], of.cells['cell2']
    second.hold = True  # the check of cell2/y stays open while its prerequisite goes
    of.end('cell1/z', 'cell2/z')
    of.client.until(lambda: any('y' in axes for axes in second.checks), 15.0)
    first.end()
    first.goals.clear()
    first.start()
    of.client.spin(first.node)
    of.client.pass_time(0.5)
    second.release()
    result = of.result(request)
    assert result.error_code in (AxisState.PREREQUISITE_MISSING, AxisState.CELL_LOST)
    assert 'y' not in second.goals
    assert not second.moving
