# SPDX-License-Identifier: Apache-2.0
"""What others watch of the axes: states, the wanted servo, homed joints, diagnostics, the log.

The cycle queues, a thread of its own publishes: a slow reader never delays a setpoint.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import itemgetter
from queue import Empty, Queue
from typing import Any, NamedTuple

from std_msgs.msg import Bool, Float64

from ..core.axis import Axis
from ..core.outcome import Outcome
from ..procedures.states import Error
from . import convert

#: Periods of what comes by time, s: of each axis's state while it homes, and of the feedback to
#: a goal; of the homed joint states; of the diagnostics.
STATE_PERIOD = 0.1
STATES_AT_ONCE = 8
JOINT_STATES_PERIOD = 0.02
DIAGNOSTICS_PERIOD = 1.0
#: How long the node stays after its last report, s.
LINGER = 0.1

Publish = Callable[[Any], None]


class Publishers(NamedTuple):
    """Where reports go; the first three by axis."""

    states: Mapping[str, Any]
    servos: Mapping[str, Any]
    torque_limits: Mapping[str, Any]
    joint_states: Any
    diagnostics: Any


class Told:
    """What was told of an axis: ``shown`` in all, the runs logged, the state, the outputs."""

    __slots__ = ('shown', 'runs', 'state', 'outputs')

    def __init__(self) -> None:
        self.shown: tuple[object, ...] = ()
        self.runs = 0
        self.state: tuple[object, ...] = ()
        self.outputs: tuple[bool, float] | None = None


class Reports:
    """Publishes every change of an axis, and what is due by time; logs how each run ended.

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
        logger: Any,
    ) -> None:
        self._axes, self._joints = axes, joints
        self._to = publishers
        self._stamp, self._lock, self._node_name, self._logger = stamp, lock, node_name, logger
        # No SimpleQueue: until Python 3.13 a short wait for nothing may never end there.
        self._queue: Queue[tuple[Publish, Any]] = Queue()
        self._told = {name: Told() for name in axes}
        self._turn = 0  # the next of the running axes
        self._goals: dict[bytes, tuple[Any, list[Axis]]] = {}  # of the action

    def note(self, axis: Axis) -> bool:
        """Queue what has changed of an axis, and how its run ended; the lock is held.

        Return whether anything has changed: the end of a run always has.
        """
        told, shown = self._told[axis.name], axis.shown
        if told.shown == shown:
            return False
        told.shown = shown
        name, put = axis.name, self._queue.put
        if told.runs != axis.history.runs:
            told.runs = axis.history.runs
            put((partial(self._log, name), axis.outcome))
        state = (axis.state, axis.paused, axis.homed, axis.error, axis.outcome)
        if told.state != state:
            told.state = state
            put((self._to.states[name].publish, convert.axis_state(self._stamp(), axis)))
        outputs = (axis.servo_on, axis.torque_limit)
        if told.outputs != outputs:
            told.outputs = outputs
            put((self._to.servos[name].publish, Bool(data=bool(outputs[0]))))
            put((self._to.torque_limits[name].publish, Float64(data=outputs[1])))
        return True

    def run(self, ended: Callable[[], bool]) -> None:
        """Publish until the node has ended and all that was queued is out.

        Listeners drop what they have not read when they hear of our end: that waits a little.
        """
        told = -LINGER
        timetable = dict.fromkeys(
            (self._next_states, self._feedback, self._joint_states, self._diagnostics),
            time.monotonic(),
        )
        while not (ended() and self._queue.empty()):
            report, due = min(timetable.items(), key=itemgetter(1))
            try:
                publish, message = self._queue.get(timeout=max(0.0, due - time.monotonic()))
                publish(message)
                told = time.monotonic()
            except Empty:
                with self._lock:  # behind what the cycle has queued: states leave in their order
                    pause = report()
                timetable[report] = max(due, time.monotonic() - pause) + pause
        time.sleep(max(0.0, told + LINGER - time.monotonic()))

    def follow(self, goal: Any, names: Sequence[str]) -> None:
        """Send a goal of the action feedback about its axes."""
        with self._lock:
            self._goals[bytes(goal.goal_id.uuid)] = (
                goal,
                [self._axes[name] for name in names if name in self._axes],
            )

    def unfollow(self, goal: Any) -> None:
        """Send a goal no more."""
        with self._lock:
            self._goals.pop(bytes(goal.goal_id.uuid), None)

    def states(self, names: Sequence[str]) -> list[Any]:
        """Return the state messages of those axes that exist; the lock is held."""
        stamp = self._stamp()
        return [
            convert.axis_state(stamp, self._axes[name]) for name in names if name in self._axes
        ]

    def _log(self, name: str, outcome: Outcome) -> None:
        """Log how a run of an axis ended; rclpy wants a line of its own for each level."""
        text = convert.home_message({name: outcome})
        if outcome.success:
            self._logger.info(f'axis {name}: {text}')
        elif outcome.error is Error.Canceled:
            self._logger.warning(text)
        else:
            self._logger.error(text)

    # ------------------------ what comes by time: queue it, return when it comes again; lock held

    def _next_states(self) -> float:
        """Tell the states of a few axes; they take turns, so that the cycle never waits long."""
        running = [axis for axis in self._axes.values() if axis.running]
        if not running:
            return STATE_PERIOD
        if self._turn >= len(running):
            self._turn = 0
        for axis in running[self._turn : self._turn + STATES_AT_ONCE]:
            self._queue.put(
                (self._to.states[axis.name].publish, convert.axis_state(self._stamp(), axis))
            )
        self._turn += STATES_AT_ONCE
        return STATE_PERIOD / math.ceil(len(running) / STATES_AT_ONCE)

    def _feedback(self) -> float:
        stamp = self._stamp()
        for goal, axes in self._goals.values():
            self._queue.put((goal.publish_feedback, convert.feedback(stamp, axes)))
        return STATE_PERIOD

    def _joint_states(self) -> float:
        homed = {
            self._joints[axis.name]: axis.position for axis in self._axes.values() if axis.homed
        }
        if not homed:
            return STATE_PERIOD
        self._queue.put(
            (self._to.joint_states.publish, convert.joint_states(self._stamp(), homed))
        )
        return JOINT_STATES_PERIOD

    def _diagnostics(self) -> float:
        self._queue.put(
            (
                self._to.diagnostics.publish,
                convert.diagnostics(self._stamp(), self._node_name, self._axes.values()),
            )
        )
        return DIAGNOSTICS_PERIOD
