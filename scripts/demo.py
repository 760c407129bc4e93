# SPDX-License-Identifier: Apache-2.0
"""Homes a simulated axis over a real ROS 2 graph, moves it in homed coordinates, and draws it.

Starts the plant, the homing node and the relay as processes, calls the home service from this one,
sends the homed axis to 0.1 m by a FollowJointTrajectory goal, prints the course live and writes
demo.png. `make demo` runs it; nothing else is needed.
"""

import os
import sys
import threading
import time

from processes import ROOT, process

CONFIG = ROOT / 'config' / 'homed_machine.yaml'
PLANT = ROOT / 'config' / 'simulated_axes.yaml'
AXIS = 'z'  # starts beyond its home switch: it meets the limit and turns
CONTROLLER = 'axes_controller'  # simulated, too
TO, SECONDS = 0.1, 1.0  # where the goal leads, homed, m, and how long it takes, s
REST = 0.3  # what is shown of the rest after it, s
PICTURE = ROOT / 'demo.png'

#: What the homing node sends, the controller plays; the client listens there, too.
REMAPPED = ('-r', f'/homing_node/setpoints:=/{CONTROLLER}/joint_trajectory')
sys.argv += ['--ros-args', *REMAPPED]

import yaml  # noqa: E402
from builtin_interfaces.msg import Duration  # noqa: E402
from control_msgs.action import FollowJointTrajectory  # noqa: E402
from rclpy.action import ActionClient  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.text import Text  # noqa: E402
from sensor_msgs.msg import JointState  # noqa: E402
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint  # noqa: E402

from homing_node.client import HomingClient  # noqa: E402
from homing_node.core.outcome import Outcome  # noqa: E402
from homing_node.course import Course, Sample  # noqa: E402
from homing_node.figures import plot  # noqa: E402
from homing_node.figures.palette import state_colour  # noqa: E402
from homing_node.plant.layout_reader import layouts_from  # noqa: E402
from homing_node.procedures.states import Error, State  # noqa: E402

console = Console(highlight=False)


def layout_of(axis: str):
    """Read where the plant has its switches."""
    with PLANT.open(encoding='utf-8') as file:
        parameters = next(iter(yaml.safe_load(file).values()))['ros__parameters']
    return layouts_from({axis: parameters[axis]})[axis]


def show(course: Course, ended: threading.Event) -> None:
    """Print a line at every change of state and five times a second."""
    printed, state, due = 0, '', 0.0
    while True:
        last = ended.wait(0.02)
        for sample in course.samples[printed:]:
            printed += 1
            if sample.state != state or sample.time >= due:
                due = sample.time + 0.2
                name = sample.state if sample.state != state else ''
                state = sample.state
                line = Text(f'{sample.time - course.samples[0].time:8.2f} s  ')
                line.append(f'{name:<28}', style=f'bold {state_colour(state)}')
                line.append(f'{1e3 * sample.feedback:10.3f} mm {1e3 * sample.velocity:9.2f} mm/s')
                console.print(line)
        if last:
            return


class Motion:
    """Sends a homed axis somewhere through the relay; notes where its driver says that it is."""

    def __init__(self, homing: HomingClient) -> None:
        self._node = homing.node
        self._raw: list[tuple[float, float]] = []  # s, and the raw position in m
        self._action = ActionClient(
            self._node, FollowJointTrajectory, '/homed_axes/follow_joint_trajectory'
        )

    def go(self, position: float) -> str:
        """Go to a homed position; return why not, '' once the axis is there."""
        if not self._action.wait_for_server(10.0):
            return 'the relay is not there'
        heard = self._node.create_subscription(JointState, 'joint_states', self._take, 100)
        point = JointTrajectoryPoint(
            positions=[position],
            velocities=[0.0],
            accelerations=[0.0],
            time_from_start=Duration(sec=int(SECONDS), nanosec=int(SECONDS % 1 * 1e9)),
        )
        goal = FollowJointTrajectory.Goal(
            trajectory=JointTrajectory(joint_names=[AXIS], points=[point])
        )
        handle = self._result(self._action.send_goal_async(goal))
        ended = self._result(handle.get_result_async()).result
        time.sleep(REST)
        self._node.destroy_subscription(heard)
        return '' if ended.error_code == ended.SUCCESSFUL else str(ended.error_string)

    def samples(self, begin: float) -> list[Sample]:
        """Return the motion as the end of a course; ``begin``: when it follows on that, s."""
        raw = self._raw[::5]  # velocities are differences
        times = [begin + time - raw[0][0] for time, _ in raw]
        places = [place for _, place in raw]
        speeds = _slopes(times, places)
        rates = _slopes(times, speeds)
        return [
            Sample(time, str(State.Idle), place, speed, rate, place)
            for time, place, speed, rate in zip(times, places, speeds, rates, strict=True)
        ]

    def _take(self, message: JointState) -> None:
        stamp = message.header.stamp
        place = message.position[message.name.index(AXIS)]
        self._raw.append((stamp.sec + stamp.nanosec * 1e-9, place))

    @staticmethod
    def _result(future):
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        if not done.wait(20.0):
            raise TimeoutError('the relay does not answer')
        return future.result()


def _slopes(times: list[float], values: list[float]) -> list[float]:
    """Return the slope at each value, from its neighbours."""
    last = len(values) - 1
    pairs = [(max(i - 1, 0), min(i + 1, last)) for i in range(len(values))]
    return [(values[b] - values[a]) / (times[b] - times[a]) for a, b in pairs]


def main() -> int:
    """Run the demo; return 0 if the axis was homed."""
    console.print(
        f'ROS domain {os.environ["ROS_DOMAIN_ID"]}: starting simulated_axes, homing_node and '
        'homed_axes'
    )
    with (
        process('simulated_axes', PLANT, '-p', f'controller:={CONTROLLER}'),
        process('homing_node', CONFIG, *REMAPPED),
        process('homed_axes', CONFIG),
        HomingClient() as homing,
        homing.record(AXIS) as course,
    ):
        console.print(f'ros2 service call /homing_node/{AXIS}/home std_srvs/srv/Trigger\n')
        ended = threading.Event()
        printer = threading.Thread(target=show, args=(course, ended))
        printer.start()
        answer = homing.call_home(AXIS, timeout=60.0)
        ended.set()
        printer.join()
        state = homing.state(AXIS)
        motion, why = Motion(homing), ''
        if answer:
            console.print(f'\n{answer.message}', soft_wrap=True, style='bold green')
            console.print(
                f'\nros2 action send_goal /homed_axes/follow_joint_trajectory: {AXIS} to {TO:g} m'
            )
            why = motion.go(TO)
    if not answer or why:
        console.print(f'\n{why or answer.message}', soft_wrap=True, style='bold red')
        return 1
    last = course.samples[-1].time
    course.happenings = [one for one in course.happenings if one.time <= last]
    course.samples += motion.samples(last + 0.1)
    raw = course.samples[-1].feedback
    console.print(
        f'the axis is at {raw - state.home_offset:.6f} m, homed; its driver says {raw:.6f} m'
    )
    course.outcome = Outcome(
        Error.NoError, '', state.home_position_raw, state.home_offset, state.uncertainty
    )
    layout = layout_of(AXIS)
    edge = layout.switches['home_switch'].on_from
    console.print(
        f'the true edge is at {edge:.9g}: home is '
        f'{1e6 * abs(state.home_position_raw - edge):.2f} µm off'
    )
    plot.save(PICTURE, course, layout, title=f'HSHS, the limit switch hit first; then to {TO:g} m')
    console.print(f'wrote {PICTURE.relative_to(ROOT)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
