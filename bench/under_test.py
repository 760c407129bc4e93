"""Runs the homing node; saves when the cycles that published setpoints were due.

under_test.py FILE --ros-args ...; FILE -: nothing is saved.
"""

import sys
from collections.abc import Callable, Mapping

from grid import Grid

from homing_node.axis import Setpoint
from homing_node.node import HomingNode, main
from homing_node.timebase import TimeBase

grid = Grid()
sleep_until, publish = TimeBase.sleep_until, HomingNode._publish
now_due = 0.0


def waiting(self: TimeBase, due: float, ended: Callable[[], bool]) -> None:
    global now_due
    now_due = due
    sleep_until(self, due, ended)


def publishing(self: HomingNode, setpoints: Mapping[str, Setpoint]) -> None:
    grid.note(now_due)
    publish(self, setpoints)


if __name__ == '__main__':
    file = sys.argv.pop(1)
    if file == '-':
        sys.exit(main())
    TimeBase.sleep_until = waiting  # type: ignore[method-assign]
    HomingNode._publish = publishing  # type: ignore[method-assign]
    status = main()
    grid.save(file)
    sys.exit(status)
