# SPDX-License-Identifier: Apache-2.0
"""Homes a simulated axis over a real ROS 2 graph, shows its course and draws it.

Starts the plant and the homing node as processes, calls the home service from this one, prints
the course live and writes demo.png. `make demo` runs it; nothing else is needed.
"""

import os
import subprocess
import sys
import threading
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CONFIG = ROOT / 'config' / 'demo.yaml'
PLANT = ROOT / 'config' / 'simulated_axes.yaml'
AXIS = 'z'  # starts beyond its home switch: it meets the limit and turns
PICTURE = ROOT / 'demo.png'

os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
os.environ.setdefault('ROS_DOMAIN_ID', str(1 + os.getpid() % 100))

import yaml  # noqa: E402
from rich.console import Console  # noqa: E402
from rich.text import Text  # noqa: E402

from homing_node.client import HomingClient  # noqa: E402
from homing_node.core.axis import Outcome  # noqa: E402
from homing_node.course import Course  # noqa: E402
from homing_node.figures import plot  # noqa: E402
from homing_node.figures.palette import state_colour  # noqa: E402
from homing_node.plant.layout import layouts_from  # noqa: E402
from homing_node.procedures.states import Error  # noqa: E402

console = Console(highlight=False)


@contextmanager
def process(executable: str, parameters: Path):
    """Run an executable of this package."""
    child = subprocess.Popen(
        [
            Path(sys.executable).with_name(executable),
            '--ros-args',
            '--log-level',
            'warn',
            '--params-file',
            str(parameters),
        ],
        cwd=ROOT,
    )
    try:
        yield child
    finally:
        child.terminate()
        child.wait()


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


def main() -> int:
    """Run the demo; return 0 if the axis was homed."""
    console.print(
        f'ROS domain {os.environ["ROS_DOMAIN_ID"]}: starting simulated_axes and homing_node'
    )
    with (
        process('simulated_axes', PLANT),
        process('homing_node', CONFIG),
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
    colour = 'green' if answer else 'red'
    console.print(f'\n{answer.message}', soft_wrap=True, style=f'bold {colour}')
    if not answer:
        return 1
    course.outcome = Outcome(
        Error.NoError, '', state.home_position_raw, state.home_offset, state.uncertainty
    )
    layout = layout_of(AXIS)
    edge = layout.switches['home_switch'].on_from
    console.print(
        f'the true edge is at {edge:.9g}: home is '
        f'{1e6 * abs(state.home_position_raw - edge):.2f} µm off'
    )
    plot.save(PICTURE, course, layout, title='HSHS, the limit switch hit first')
    console.print(f'wrote {PICTURE.relative_to(ROOT)}')
    return 0


if __name__ == '__main__':
    sys.exit(main())
