"""What others watch of the axes: states, the wanted servo, homed joint states, diagnostics.

The cycle queues, a thread of its own publishes: a slow reader never delays a setpoint.
"""

import threading
import time
from collections.abc import Callable, Mapping
from queue import Empty, SimpleQueue
from typing import Any

from std_msgs.msg import Bool

from . import convert
from .axis import Axis

#: Period of the homed joint states, s; states and diagnostics come every so many of it.
PERIOD = 0.02
STATE_EVERY = 5
DIAGNOSTICS_EVERY = 50


class Reports:
    """Publishes every change of an axis, and what is due by time.

    ``publishers`` are for the axis states and the servos by axis, the joint states and the
    diagnostics; ``stamp`` returns the ROS time in ns; ``lock`` guards the axes.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        joints: Mapping[str, str],
        publishers: tuple[Mapping[str, Any], Mapping[str, Any], Any, Any],
        stamp: Callable[[], int],
        lock: threading.Lock,
        node_name: str,
    ) -> None:
        self._axes, self._joints = axes, joints
        self._states, self._servos, self._joint_states, self._diagnostics = publishers
        self._stamp, self._lock, self._node_name = stamp, lock, node_name
        self._queue: SimpleQueue[tuple[Any, Any]] = SimpleQueue()
        self._seen: dict[str, tuple[object, ...]] = {}

    def note(self, axis: Axis) -> None:
        """Queue the state of an axis where it has changed; the lock is held."""
        seen = (axis.state, axis.paused, axis.homed, axis.error, axis.servo_on)
        before = self._seen.get(axis.name)
        if seen == before:
            return
        self._seen[axis.name] = seen
        self._queue.put((self._states[axis.name], convert.axis_state(self._stamp(), axis)))
        if before is None or before[-1] != axis.servo_on:
            self._queue.put((self._servos[axis.name], Bool(data=bool(axis.servo_on))))

    def run(self, ended: Callable[[], bool]) -> None:
        """Publish until the node has ended and all that was queued is out."""
        turn, due = 0, time.monotonic()
        while not (ended() and self._queue.empty()):
            try:
                publisher, message = self._queue.get(timeout=max(0.0, due - time.monotonic()))
                publisher.publish(message)
            except Empty:
                turn, due = turn + 1, time.monotonic() + PERIOD
                for publisher, message in self._due(turn):
                    publisher.publish(message)

    def _due(self, turn: int) -> list[tuple[Any, Any]]:
        stamp = self._stamp()
        due: list[tuple[Any, Any]] = []
        with self._lock:
            axes = list(self._axes.values())
            homed = {self._joints[axis.name]: axis.position for axis in axes if axis.homed}
            if homed:
                due.append((self._joint_states, convert.joint_states(stamp, homed)))
            if turn % STATE_EVERY == 0:
                due += [(self._states[axis.name], convert.axis_state(stamp, axis))
                        for axis in axes if axis.running]
            if turn % DIAGNOSTICS_EVERY == 0:
                due.append((self._diagnostics,
                            convert.diagnostics(stamp, self._node_name, axes)))
        return due
