# SPDX-License-Identifier: Apache-2.0
"""Homes a simulated gantry over a real ROS 2 graph, and draws how it becomes square.

Starts the machine of config/simulated_gantry.yaml and the homing node with config/gantry.yaml as
processes, calls the home service from this one, prints the course of both sides live with the
skew and the racking force, and writes demo_gantry.png. `make demo-gantry` runs it.
"""

import os
import sys
import threading

from processes import ROOT, process  # first of all: it chooses the ROS domain
from rich.console import Console
from rich.text import Text
from std_msgs.msg import Float64

from homing_node.client import HomingClient
from homing_node.core.outcome import MemberHome, Outcome
from homing_node.course import Course
from homing_node.figures import plot
from homing_node.figures.palette import state_colour
from homing_node.parameters.yaml_file import load
from homing_node.plant import layout_file
from homing_node.procedures.states import Error

CONFIG = ROOT / 'config' / 'gantry.yaml'
PLANT = ROOT / 'config' / 'simulated_gantry.yaml'
AXIS, FOLLOWER = 'y', 'y2'
PICTURE = ROOT / 'demo_gantry.png'
#: How a run ends if the computer holds a process up for some tenths of a second: such a run is
#: made again, RUNS in all.
HELD_UP = (str(Error.CycleLate), str(Error.FollowingError), str(Error.FeedbackStale))
RUNS = 3

console = Console(highlight=False)


class RackingForce:
    """What the spring between the sides bears: the newest value and the largest, N."""

    def __init__(self, homing: HomingClient) -> None:
        self.now = self.largest = 0.0
        homing.node.create_subscription(
            Float64, f'/simulated_axes/{AXIS}/{FOLLOWER}/racking_force', self._take, 100
        )

    def _take(self, message: Float64) -> None:
        self.now = message.data
        self.largest = max(self.largest, abs(self.now))


def show(course: Course, force: RackingForce, square: float, ended: threading.Event) -> None:
    """Print a line at every change of state and five times a second."""
    other = course.followers[f'{AXIS}.{FOLLOWER}']
    printed, state, due = 0, '', 0.0
    while True:
        last = ended.wait(0.02)
        for sample, beside in list(zip(course.samples, other.samples, strict=False))[printed:]:
            printed += 1
            if sample.state == state and sample.time < due:
                continue
            due = sample.time + 0.2
            name = sample.state if sample.state != state else ''
            state = sample.state
            line = Text(f'{sample.time - course.samples[0].time:8.2f} s  ')
            line.append(f'{name:<18}', style=f'bold {state_colour(state)}')
            ahead = beside.feedback - sample.feedback - square
            line.append(
                f'{1e3 * sample.feedback:9.3f} mm  {AXIS}.{FOLLOWER} {1e3 * ahead:+7.3f} mm ahead'
                f'  {force.now:+7.1f} N'
            )
            console.print(line)
        if last:
            return


def main() -> int:
    """Run the demo; return 0 if the gantry was homed."""
    configuration = load(CONFIG)
    layout = layout_file.load(PLANT).layouts[AXIS]
    name = f'{AXIS}.{FOLLOWER}'
    joint, beside = configuration.joints[AXIS], configuration.joints[name]
    console.print(
        f'ROS domain {os.environ["ROS_DOMAIN_ID"]}: starting simulated_axes and homing_node; '
        f'{joint} leads, {beside} follows'
    )
    with (
        process('simulated_axes', PLANT),
        process('homing_node', CONFIG),
        HomingClient(discovery=30.0) as homing,
    ):
        force = RackingForce(homing)
        square = layout.followers[name].square_at
        for _ in range(RUNS):
            with homing.record(AXIS, joint, {FOLLOWER: beside}) as course:
                console.print(f'ros2 service call /homing_node/{AXIS}/home std_srvs/srv/Trigger\n')
                ended = threading.Event()
                printer = threading.Thread(target=show, args=(course, force, square, ended))
                printer.start()
                answer = homing.call_home(AXIS, timeout=60.0)
                ended.set()
                printer.join()
                state = homing.state(AXIS)
                rest = force.now
            style = 'bold green' if answer else 'bold red'
            console.print(f'\n{answer.message}', soft_wrap=True, style=style)
            if answer or not answer.message.startswith(HELD_UP):
                break
            console.print('This computer was too busy for the processes; once more.')
    if not answer:
        return 1
    for member in state.members[1:]:
        console.print(
            f'{AXIS}.{member.name} is {1e6 * member.squareness:.1f} µm out of square, known to '
            f'within {1e6 * member.uncertainty:.1f} µm'
        )
    console.print(
        f'the sides were up to {1e3 * course.largest_skew:.3f} mm skewed in the run; their spring '
        f'bore up to {force.largest:.0f} N, and bears {rest:.1f} N now'
    )
    members = tuple(
        MemberHome(*(getattr(member, field) for field in MemberHome._fields))
        for member in state.members
    )
    course.outcome = Outcome(
        Error.NoError,
        '',
        state.home_position_raw,
        state.home_offset,
        state.uncertainty,
        members=members,
    )
    plot.save(PICTURE, course, layout, title=f'A gantry, {AXIS} and {name}: HSHS')
    console.print(f'wrote {PICTURE.relative_to(ROOT)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
