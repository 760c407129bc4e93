# SPDX-License-Identifier: Apache-2.0
"""The node under the rules of rclpy 7.1.9, which apt's Jazzy has and PyPI's has not."""

import os
import time
from pathlib import Path
from typing import NamedTuple

import pytest
import ros_harness as ros
from trajectory_msgs.msg import JointTrajectory

#: They take long.
pytestmark = pytest.mark.long

#: The executable's module under each set of rules.
RULES = {'installed': 'homing_node.ros.main', '7.1.9': 'rclpy_7_1_9'}
#: More of a core than this, on top of the installed rclpy's share, is an executor that spins. (It
#: took 0.96 of a core instead of 0.18 with a coroutine that yields None, and 3.3 times as long.)
NOISE = 0.2
#: Each of these homes once, in turn; the best counts, for other processes may hold one up.
AXES = ('x', 'y')
#: How much longer a home may take.
LONGER = 1.5
#: How long the answer of a node that has ended may take, s.
FAREWELL = 2.0
TICK = os.sysconf('SC_CLK_TCK')


class Seen(NamedTuple):
    """Homes of axes, one after another, and the end of the node in the middle of another one."""

    share: float  # of a core, while the request waited
    took: float  # s, from the first setpoint to the last one
    success: bool
    status: int
    answer: str
    output: str


def processor_time(process):
    """Return the processor time of a process, s."""
    fields = Path(f'/proc/{process.process.pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def see(folder):
    # A slow search: a share of less than a second would be mostly noise.
    parameters = ros.node_parameters({axis: {'homing_velocity_fast': 0.02} for axis in AXES})
    plant = ros.plant_parameters({axis: {} for axis in AXES})
    with ros.World(folder, parameters, plant, anew=True) as world:
        client = world.client
        shares, times, answers = [], [], []
        for axis in AXES:
            setpoints = client.record(JointTrajectory, 'setpoints')
            waiting = client.start(axis)
            began, used = time.monotonic(), processor_time(world.node)
            answers.append(client.answer(waiting, 40.0).success)
            shares.append((processor_time(world.node) - used) / (time.monotonic() - began))
            course = ros.course_of(setpoints, axis)
            times.append((course[-1].sent - course[0].sent) * 1e-9)
            client.forget(setpoints)
        waiting = client.start('x')
        client.watch()
        world.node.signal()
        status = client.until(lambda: None if world.node.alive else [world.node.wait()])[0]
        end = time.monotonic() + FAREWELL
        client.until(lambda: waiting.done() or time.monotonic() > end)
        world.processes.remove(world.node)
        message = waiting.result().message if waiting.done() else 'none'
        return Seen(min(shares), min(times), all(answers), status, message, world.node.output)


@pytest.fixture(scope='module')
def seen(tmp_path_factory):
    """Home under both sets of rules, one after the other."""
    with pytest.MonkeyPatch.context() as patch:
        path = [str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')]
        patch.setenv('PYTHONPATH', os.pathsep.join(path))
        found = {}
        for rules, module in RULES.items():
            patch.setitem(ros.MAINS, 'homing_node', module)
            found[rules] = see(tmp_path_factory.mktemp('rules'))
        return found


def test_the_axis_homes_in_the_same_time(seen):
    assert all(one.success for one in seen.values())
    assert seen['7.1.9'].took < LONGER * seen['installed'].took


def test_a_request_that_waits_costs_no_processor_time(seen):
    assert seen['7.1.9'].share < seen['installed'].share + NOISE


def test_no_coroutine_makes_the_executor_spin(seen):
    assert 'coroutines yielded None 0 times' in seen['7.1.9'].output


@pytest.mark.parametrize('rules', RULES)
def test_a_signal_ends_the_node_with_its_answers_and_status_0(seen, rules):
    assert seen[rules].status == 0, seen[rules].output
    assert seen[rules].answer.startswith('Canceled: ')
    assert 'Traceback' not in seen[rules].output
