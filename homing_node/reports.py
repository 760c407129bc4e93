"""What others watch of the axes: states, the wanted servo, homed joint states, diagnostics.

The cycle queues, a thread of its own publishes: a slow reader never delays a setpoint.
"""

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

from std_msgs.msg import Bool, Float64

from . import convert
from .axis import Axis

#: Period of the homed joint states, s; states and diagnostics come every so many of it.
PERIOD = 0.02
STATE_EVERY = 5
DIAGNOSTICS_EVERY = 50


Publish = Callable[[Any], None]


class Publishers(NamedTuple):
    """Where reports go; the first three by axis."""

    states: Mapping[str, Any]
    servos: Mapping[str, Any]
    torque_limits: Mapping[str, Any]
    joint_states: Any
    diagnostics: Any


class Reports:
    """Publishes every change of an axis, and what is due by time.

    ``stamp`` returns the ROS time in ns; ``lock`` guards the axes.
    """

    def __init__(
        self,
        axes: Mapping[str, Axis],
        joints: Mapping[str, str],
        publishers: Publishers,
        stamp: Callable[[], int],
        lock: threading.Lock,
        node_name: str,
    ) -> None:
        self._axes, self._joints = axes, joints
        self._to = publishers
        self._stamp, self._lock, self._node_name = stamp, lock, node_name
        self._queue: SimpleQueue[tuple[Publish, Any]] = SimpleQueue()
        self._seen_states: dict[str, tuple[object, ...]] = {}
        self._seen_outputs: dict[str, tuple[bool, float]] = {}
        self._goals: dict[bytes, tuple[Any, list[Axis]]] = {}  # of the action

    def note(self, axis: Axis) -> None:
        """Queue the state of an axis where it has changed; the lock is held."""
        name = axis.name
        state = (axis.state, axis.paused, axis.homed, axis.error)
        if self._seen_states.get(name) != state:
            self._seen_states[name] = state
            message = convert.axis_state(self._stamp(), axis)
            self._queue.put((self._to.states[name].publish, message))
        outputs = (axis.servo_on, axis.torque_limit)
        if self._seen_outputs.get(name) != outputs:
            self._seen_outputs[name] = outputs
            self._queue.put((self._to.servos[name].publish, Bool(data=bool(outputs[0]))))
            self._queue.put((self._to.torque_limits[name].publish, Float64(data=outputs[1])))

    def run(self, ended: Callable[[], bool]) -> None:
        """Publish until the node has ended and all that was queued is out."""
        turn, due = 0, time.monotonic()
        while not (ended() and self._queue.empty()):
            try:
                publish, message = self._queue.get(timeout=max(0.0, due - time.monotonic()))
                publish(message)
            except Empty:
                turn, due = turn + 1, time.monotonic() + PERIOD
                with self._lock:  # behind what the cycle has queued: states leave in their order
                    for item in self._due(turn):
                        self._queue.put(item)

    def follow(self, goal: Any, names: Sequence[str]) -> None:
        """Send a goal of the action feedback about its axes."""
        with self._lock:
            self._goals[bytes(goal.goal_id.uuid)] = (
                goal, [self._axes[name] for name in names if name in self._axes])

    def unfollow(self, goal: Any) -> None:
        """Send a goal no more."""
        with self._lock:
            self._goals.pop(bytes(goal.goal_id.uuid), None)

    def states(self, names: Sequence[str]) -> list[Any]:
        """Return the state messages of those axes that exist; the lock is held."""
        stamp = self._stamp()
        return [convert.axis_state(stamp, self._axes[name])
                for name in names if name in self._axes]

    def _due(self, turn: int) -> list[tuple[Publish, Any]]:
        """Return what is to be published by time; the lock is held."""
        stamp = self._stamp()
        due: list[tuple[Publish, Any]] = []
        axes = list(self._axes.values())
        homed = {self._joints[axis.name]: axis.position for axis in axes if axis.homed}
        if homed:
            due.append((self._to.joint_states.publish, convert.joint_states(stamp, homed)))
        if turn % STATE_EVERY == 0:
            due += [(self._to.states[axis.name].publish, convert.axis_state(stamp, axis))
                    for axis in axes if axis.running]
            due += [(goal.publish_feedback, convert.feedback(stamp, followed))
                    for goal, followed in self._goals.values()]
        if turn % DIAGNOSTICS_EVERY == 0:
            due.append((self._to.diagnostics.publish,
                        convert.diagnostics(stamp, self._node_name, axes)))
        return due
