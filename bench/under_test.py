# SPDX-License-Identifier: Apache-2.0
"""Runs the homing node; saves when the cycles that published setpoints were due.

under_test.py FILE --ros-args ...
"""

import sys
from typing import Any

from grid import Grid

from homing_node.ros.cycle import Cycle
from homing_node.ros.main import main
from homing_node.ros.setpoints import TrajectorySetpoints

grid = Grid()
cycle, publish = Cycle._once, TrajectorySetpoints.publish
now_due = 0.0


def cycling(self: Cycle, now: float, due: float) -> None:
    global now_due
    now_due = due
    cycle(self, now, due)


def publishing(self: TrajectorySetpoints, message: Any) -> None:
    grid.note(now_due)
    publish(self, message)


if __name__ == '__main__':
    file = sys.argv.pop(1)
    Cycle._once = cycling  # type: ignore[method-assign]
    TrajectorySetpoints.publish = publishing  # type: ignore[method-assign]
    status = main()
    grid.save(file)
    sys.exit(status)
