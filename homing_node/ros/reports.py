# SPDX-License-Identifier: Apache-2.0
"""Publishes axis states, outputs, homed joints and diagnostics; logs how runs end.

The cycle queues, a thread of its own publishes: a slow reader never delays a setpoint. What must
come after a report (the answer to a request) goes through the same queue.
"""

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import itemgetter
from queue import Empty, Queue
from typing import Any, NamedTuple

from homing_interfaces.msg import AxisState
from rclpy.serialization import serialize_message

from ..core.axis import Axis
from ..core.outcome import Outcome
from ..parameters.connections import Output
from ..procedures.states import Error
from . import messages

#: Period of each axis's state while it homes, and of the feedback to a goal, s.
STATE_PERIOD = 0.1
#: Period of each axis's state while it rests, s.
REST_PERIOD = 1.0
#: How often it is asked whether an input of an axis at rest has a new level, s.
LEVELS_PERIOD = 0.1
#: More states than these do not leave at once, so that the cycle never waits long for the lock.
STATES_AT_ONCE = 8
#: Periods of the homed joint states, where the cycle is not slower, and of the diagnostics, s.
JOINT_STATES_PERIOD = 0.02
DIAGNOSTICS_PERIOD = 1.0
#: How long the node stays after its last report, s.
LINGER = 0.1

#: A publisher's method and its message, or the like.
Report = tuple[Callable[[Any], object], Any]


class StateReport:
    """A state to publish, whose bytes are made once where it is recorded, too.

    Attributes:
        message: The state.
        recorded: Whether somebody else wants the bytes.
    """

    __slots__ = ('message', 'recorded', '_bytes')

    def __init__(self, message: AxisState) -> None:
        self.message, self.recorded = message, False
        self._bytes: bytes | None = None

    def publish(self, publisher: Any) -> None:
        """Publish the state."""
        publisher.publish(self.serialized() if self.recorded else self.message)

    def serialized(self) -> bytes:
        """Return the bytes of the state."""
        if self._bytes is None:
            self._bytes = bytes(serialize_message(self.message))
        return self._bytes


class Afterwards(NamedTuple):
    """An action in the queue of reports, which happens even if publishing has broken."""

    action: Callable[[Any], object]
    argument: Any


class Publishers(NamedTuple):
    """Where reports go; states and outputs by axis."""

    states: Mapping[str, Any]
    outputs: Mapping[str, Mapping[Output, Any]]
    joint_states: Any
    diagnostics: Any


class LastReport:
    """What was last reported of an axis.

    ``changes`` is `Axis.fingerprint` at that time, ``runs`` the number of runs logged, ``state``
    what the message said, ``homed`` whether the axis was homed, ``outputs`` the value of each
    output.
    """

    __slots__ = ('changes', 'runs', 'state', 'homed', 'outputs')

    def __init__(self) -> None:
        self.changes: tuple[object, ...] = ()
        self.runs = 0
        self.state: tuple[object, ...] = ()
        self.homed = False
        self.outputs: dict[Output, float] = {}


class Reports:
    """Publishes every change of an axis, and what is due by time; logs how each run ended.

    ``stamp`` returns the ROS time in ns; ``lock`` guards the axes; ``node_name`` is the fully
    qualified one; ``inputs_of`` returns what the diagnostics say of each input of an axis;
    ``note`` takes each state that is published (axis, stamp in ns, report), and returns whether
    it is recorded. ``period`` is that of the cycle, s: positions are new no more often.
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
        inputs_of: Callable[[Axis], Mapping[str, str]] = lambda axis: {},
        note: Callable[[Axis, int, StateReport], object] = lambda axis, stamp, report: None,
        period: float = 0.0,
    ) -> None:
        self._axes, self._joints, self._note = axes, joints, note
        self._joint_states_period = max(JOINT_STATES_PERIOD, period)
        self._to = publishers
        self._stamp, self._lock, self._node_name, self._logger = stamp, lock, node_name, logger
        # No SimpleQueue: until Python 3.13 a short wait for nothing may never end there.
        self._queue: Queue[Report | Afterwards] = Queue()
        self._inputs_of = inputs_of
        self._levels = {name: axis.levels for name, axis in axes.items()}
        self._last = {name: LastReport() for name in axes}
        self._turns = {True: 0, False: 0}  # the next of the running axes, and of the others
        # The goals of the actions, their axes, and what makes their feedback.
        self._goals: dict[bytes, tuple[Any, list[Axis], Callable[..., Any]]] = {}
        self._gate = threading.Lock()  # of `_over`
        self._over = False  # nothing is published any more

    def report(self, axis: Axis) -> bool:
        """Queue what has changed of an axis, and how its run ended; the lock is held.

        Returns:
            Whether anything has changed. The end of a run is always a change.
        """
        last, changes = self._last[axis.name], axis.fingerprint
        if last.changes == changes:
            return False
        last.changes = changes
        name, put = axis.name, self._queue.put
        if last.runs != axis.history.count and not axis.handing_over:
            last.runs = axis.history.count
            put((partial(self._log, name), axis.ended))
        elif last.homed and not (axis.homed or axis.running) and axis.error is not Error.NoError:
            put((self._log_loss, axis.message))
        last.homed = axis.homed
        state = (axis.state, axis.paused, axis.homed, axis.error, axis.message, axis.outcome)
        if last.state != state:
            last.state = state
            self._state(axis)
        for output, value in (
            (Output.SERVO_ON, bool(axis.servo_on)),
            (Output.TORQUE_LIMIT, float(axis.torque_limit)),
            (Output.ARM_LATCH, bool(axis.arm_latch)),
        ):
            if last.outputs.get(output) != value:
                last.outputs[output] = value
                put((self._to.outputs[name][output].publish, value))
        return True

    def afterwards(self, action: Callable[[Any], object], argument: Any) -> None:
        """Call an action once all that is queued now has been published, in that thread."""
        with self._gate:
            if not self._over:
                self._queue.put(Afterwards(action, argument))
                return
        action(argument)

    def run(self, ended: Callable[[], bool]) -> None:
        """Publish until the node has ended and all that was queued is out.

        Then wait a little: subscribers drop unread messages of a publisher that is gone.
        """
        try:
            self._publish_until(ended)
        finally:
            self._leave()

    def _publish_until(self, ended: Callable[[], bool]) -> None:
        last = -LINGER  # the time of the last message
        timetable = dict.fromkeys(
            (
                self._next_states,
                self._next_at_rest,
                self._changed_levels,
                self._feedback,
                self._joint_states,
                self._diagnostics,
            ),
            time.monotonic(),
        )
        while not (ended() and self._queue.empty()):
            report, due = min(timetable.items(), key=itemgetter(1))
            try:
                publish, message = self._queue.get(timeout=max(0.0, due - time.monotonic()))
                publish(message)
                last = time.monotonic()
            except Empty:
                with self._lock:  # behind what the cycle has queued: states leave in their order
                    pause = report()
                # A late report is timed anew; it does not catch up in a burst.
                timetable[report] = max(due, time.monotonic() - pause) + pause
        time.sleep(max(0.0, last + LINGER - time.monotonic()))

    def _leave(self) -> None:
        """Let the actions that still wait happen, where the thread broke before them."""
        with self._gate:
            self._over = True
        while True:
            try:
                item = self._queue.get_nowait()
            except Empty:
                return
            if isinstance(item, Afterwards):
                item.action(item.argument)

    def follow(
        self,
        goal: Any,
        names: Sequence[str],
        feedback: Callable[[int, Sequence[Axis]], Any] = messages.feedback,
    ) -> None:
        """Send a goal of an action feedback about its axes from now on.

        ``feedback`` makes the message of a stamp and the axes.
        """
        with self._lock:
            self._goals[bytes(goal.goal_id.uuid)] = (
                goal,
                [self._axes[name] for name in names if name in self._axes],
                feedback,
            )

    def unfollow(self, goal: Any) -> None:
        """Send a goal no more feedback."""
        with self._lock:
            self._goals.pop(bytes(goal.goal_id.uuid), None)

    def runs(self, names: Sequence[str]) -> dict[str, int]:
        """Return how many runs of some axes have ended; the lock is held."""
        return {name: self._axes[name].history.count for name in names}

    def states(self, names: Sequence[str]) -> list[Any]:
        """Return the state messages of those axes that exist; the lock is held."""
        stamp = self._stamp()
        return [
            messages.axis_state(stamp, self._axes[name]) for name in names if name in self._axes
        ]

    def _state(self, axis: Axis) -> None:
        """Queue the state of an axis; the lock is held."""
        stamp = self._stamp()
        report = StateReport(messages.axis_state(stamp, axis))
        report.recorded = bool(self._note(axis, stamp, report))
        self._queue.put((report.publish, self._to.states[axis.name]))

    def _log(self, name: str, outcome: Outcome) -> None:
        """Log how a run of an axis ended; rclpy wants a line of its own for each level."""
        text = messages.home_message({name: outcome})
        if outcome.success:
            self._logger.info(f'axis {name}: {text}')
        elif outcome.error is Error.Canceled:
            self._logger.warning(text)
        else:
            self._logger.error(text)

    def _log_loss(self, message: str) -> None:
        """Log that an axis at rest has lost its home."""
        self._logger.warning(message)

    # ---------- reports by time: queue them, return the time until the next, s; the lock is held

    def _next_states(self) -> float:
        return self._take_turns(running=True, period=STATE_PERIOD)

    def _next_at_rest(self) -> float:
        return self._take_turns(running=False, period=REST_PERIOD)

    def _changed_levels(self) -> float:
        """Queue the states of the axes at rest that have an input with a new level."""
        for name, axis in self._axes.items():
            levels = axis.levels
            if levels != self._levels[name]:
                self._levels[name] = levels
                if not axis.running:
                    self._queue.put(
                        (self._to.states[name].publish, messages.axis_state(self._stamp(), axis))
                    )
        return LEVELS_PERIOD

    def _take_turns(self, running: bool, period: float) -> float:
        """Queue the states of a few axes that home, or that do not; each has its turn."""
        axes = [axis for axis in self._axes.values() if axis.running is running]
        if not axes:
            return STATE_PERIOD
        first = self._turns[running] if self._turns[running] < len(axes) else 0
        self._turns[running] = first + STATES_AT_ONCE
        for axis in axes[first : first + STATES_AT_ONCE]:
            self._state(axis)
        return period / math.ceil(len(axes) / STATES_AT_ONCE)

    def _feedback(self) -> float:
        stamp = self._stamp()
        for goal, axes, feedback in self._goals.values():
            self._queue.put((goal.publish_feedback, feedback(stamp, axes)))
        return STATE_PERIOD

    def _joint_states(self) -> float:
        homed = {
            self._joints[axis.name]: axis.position for axis in self._axes.values() if axis.homed
        }
        if not homed:
            return STATE_PERIOD
        for axis in self._axes.values():
            if axis.homed and axis.members:
                for follower in axis.followers:
                    homed[self._joints[follower.name]] = axis.homed_position_of(follower)
        self._queue.put(
            (self._to.joint_states.publish, messages.joint_states(self._stamp(), homed))
        )
        return self._joint_states_period

    def _diagnostics(self) -> float:
        self._queue.put(
            (
                self._to.diagnostics.publish,
                messages.diagnostics(
                    self._stamp(), self._node_name, self._axes.values(), self._inputs_of
                ),
            )
        )
        return DIAGNOSTICS_PERIOD
