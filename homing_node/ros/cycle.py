# SPDX-License-Identifier: Apache-2.0
"""The control cycle, a thread: poll the inputs, update the axes, publish the setpoints.

It runs on a fixed grid of time. ``lock`` guards the axes; nothing is published or waited for
while it is held.
"""

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from rclpy.task import Future

from ..core.dispatch import Dispatch
from ..procedures.states import Error
from .controllers import Controllers
from .guarded_axis import GuardedAxis
from .handovers import Handovers
from .inputs import Inputs
from .joint_order import JointOrder
from .locks import Permissions
from .outputs import Outputs
from .polling import never_called
from .readiness import FIRST_INSTANT
from .recorder import Recorder
from .reports import Reports
from .setpoints import Setpoints
from .timebase import Lead, TimeBase, wake_precisely
from .waits import Waits

#: How often the publishers of the inputs are counted, s.
WATCH_PERIOD = 0.1


def late_cycle(late: float, limit: float) -> str:
    """Return the message of CycleLate if a cycle was later than the limit, else ''; in s."""
    if late <= limit:
        return ''
    return f'a control cycle was {late:.3f} s late, more than {limit:g} s (cycle_timeout)'


class Cycle:
    """Runs the axes until `stop` is called and every one of them is at rest.

    ``finished`` is set at the end, ``broken`` tells whether the node ends because it broke.
    ``timeout`` is the parameter cycle_timeout, s.
    """

    def __init__(
        self,
        axes: Mapping[str, GuardedAxis],
        period: float,
        timeout: float,
        timebase: TimeBase,
        lock: threading.Lock,
        inputs: Inputs,
        dispatch: Dispatch[Future],
        setpoints: Setpoints,
        order: JointOrder | None,
        controllers: Controllers,
        handovers: Handovers,
        outputs: Outputs,
        reports: Reports,
        waits: Waits,
        recorder: Recorder,
        permissions: Permissions,
        logger: Any,
    ) -> None:
        """Keep the parts that a cycle works with.

        Args:
            axes: The axes, by name.
            period: From one cycle to the next, s.
            timeout: How late a cycle may be at most, s.
            timebase: The clock of the node.
            lock: What guards the axes.
            inputs: The inputs of the axes.
            dispatch: The requests.
            setpoints: The interface of the setpoints.
            order: The order of the joints in an array of positions, if setpoints are such arrays.
            controllers: Who plays the setpoints.
            handovers: The hand-overs of the homes.
            outputs: What drives are told besides setpoints.
            reports: All that is published besides the setpoints.
            waits: The futures of the requests.
            recorder: The records of the runs.
            permissions: What forbids axes to home from outside.
            logger: The logger of the node.
        """
        self._axes, self._period, self.timeout = axes, period, timeout
        self._followers = [one for axis in axes.values() for one in list(axis.drives.values())[1:]]
        self._timebase, self._lock = timebase, lock
        self._inputs, self._dispatch, self._setpoints = inputs, dispatch, setpoints
        self._order, self._controllers, self._reports = order, controllers, reports
        self._handovers, self._outputs = handovers, outputs
        self._waits, self._recorder, self._logger = waits, recorder, logger
        self._permissions = permissions
        self._lead = Lead(period)
        self._watched = 0.0
        self._stop_requested = False
        self._inputs_ignored = False  # while the axes stop because the cycle has broken
        self.finished = threading.Event()
        self.broken = False

    def start(self) -> None:
        """Start the threads of the cycle and of the reports."""
        ended = self.finished.is_set
        loops = {'cycle': self._loop, 'reports': self._reports.run}
        self._threads = [
            threading.Thread(target=self._guarded, args=(name, loop, ended), name=name)
            for name, loop in loops.items()
        ]
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Stop every axis, answer every request, then finish."""
        self._stop_requested = True

    def join(self) -> None:
        """Wait for the threads."""
        for thread in self._threads:
            thread.join()

    # -------------------------------------------------------------------------------- the threads

    def _guarded(
        self, name: str, loop: Callable[[Callable[[], bool]], None], ended: Callable[[], bool]
    ) -> None:
        """Run a thread's loop; if it breaks, the axes stop and the node ends."""
        try:
            loop(ended)
        except Exception as error:
            if not ended():
                self._logger.fatal(f'the {name} broke: {error!r}')
                self.broken = True
                if name == 'cycle':
                    self._abandon('the node ended because its cycle broke')
                else:
                    self.stop()
                raise

    def _loop(self, ended: Callable[[], bool]) -> None:
        clock = self._timebase
        wake_precisely()

        def hopeless() -> bool:
            return ended() or (self._stop_requested and clock.stands)

        with self._lock:
            for axis in self._axes.values():
                self._reports.report(axis)
        clock.sleep_until(FIRST_INSTANT, hopeless)
        due = clock.read()
        while not ended():
            due += self._period
            begin = due - self._lead.time
            clock.sleep_until(begin, hopeless)
            if hopeless():
                self._abandon('the node ended while simulated time stood still')
                return
            late = clock.read() - begin
            if abs(late) >= self._period:
                due, planned = clock.now + self._lead.time, due
                with self._lock:
                    for axis in self._axes.values():
                        axis.cycles_were_missed(max(0.0, due - planned))
            too_late = late_cycle(late, self.timeout)
            if too_late:
                with self._lock:
                    for axis in self._axes.values():
                        axis.cycle_was_late(clock.now - self.timeout, too_late)
            elif late < -self._period:
                self._set_back(-late)
            try:
                self._once(clock.now, due)
            except Exception as error:
                if self._inputs_ignored:  # the stop has broken, too
                    raise
                self._break_off(error)

    def _once(self, now: float, due: float) -> None:
        """Poll the inputs, update the axes, publish setpoints, answer the requests that ended."""
        setpoints, changed, look = {}, False, False
        watching = now - self._watched > WATCH_PERIOD
        if watching:
            self._watched = now
        with self._lock:
            if not self._inputs_ignored:
                try:
                    if watching:
                        self._permissions.poll()
                    self._inputs.poll()
                    look = watching and self._inputs.watch()
                except Exception as error:  # the axes must not miss the cycle
                    self._break_off(error)
            if self._stop_requested:
                self._dispatch.close()
            for name, axis in self._axes.items():
                setpoint = axis.update(now)
                if setpoint is not None:
                    setpoints[name] = setpoint
                changed = self._reports.report(axis) or changed
            for follower in self._followers:
                if follower.setpoint is not None:
                    setpoints[follower.name] = follower.setpoint
            if self._recorder.open:
                self._recorder.cycle(now, setpoints)
            ended = []
            if changed or self._dispatch.pending:
                ended = self._dispatch.update(now)
            finished = self._dispatch.closed and self._dispatch.idle
            asks = self._handovers.cycle()
            message = self._setpoints.message(setpoints, due)
            if self._order and any(axis.handover for axis in self._axes.values()):
                self._order.forget()
            if self._order and self._order.cycle(bool(setpoints)):
                message = self._setpoints.hold(self._order.held)
        if message is not None:
            if not self._timebase.simulated:
                self._lead.learn(time.monotonic() > due)
            self._setpoints.publish(message)
        if ended:
            self._reports.afterwards(self._waits.end, ended)
        if asks is not None:
            self._reports.afterwards(self._hand_over, asks)
        if look:
            self._waits.call(self._inputs.look)
        if watching and self._outputs.used:
            self._waits.call(self._outputs.look)
        if watching and self._controllers.watch():
            self._waits.call(self._controllers.look)
        if finished:
            self._finish()

    def _break_off(self, error: Exception) -> None:
        """Let every axis stop, and the node end, because a cycle has raised."""
        self._logger.fatal(f'the cycle broke, every axis stops: {error!r}')
        self.broken = self._inputs_ignored = True
        self.stop()

    def _hand_over(self, asks: Mapping[str, int]) -> None:
        """Let the executor ask what hand-overs ask now."""
        self._handovers.release(asks)
        self._waits.call(self._handovers.look)

    def _set_back(self, step: float) -> None:
        """Stop every axis and discard the history that is newer than the new time."""
        text = f'simulated time was set back by about {step:.3f} s'
        now = self._watched = self._timebase.now
        with self._lock:
            for axis in self._axes.values():
                axis.stop(Error.CycleLate, text)
                axis.time_jumped_back(now)

    def _abandon(self, reason: str) -> None:
        """End although axes may not be at rest: nothing can stop them any more."""
        with self._lock:
            ended = self._dispatch.abandon(reason)
        self._reports.afterwards(self._waits.end, ended)
        self._finish()

    def _finish(self) -> None:
        self.finished.set()
        self._waits.call(never_called)  # the executor looks whether the node has finished
