# SPDX-License-Identifier: Apache-2.0
"""The homing node: topics, services and parameters around the axes.

Three threads. The *cycle* polls the inputs, updates the axes and publishes setpoints on a fixed
grid. The *executor* (the main thread) answers services and parameters. The *reports* publish all
that is not a setpoint. ``_lock`` guards the axes; nothing is published or waited for while it is
held.
"""

import threading
import time
import traceback
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.exceptions import NameValidationException
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool, Trigger

from ..core.dispatch import Dispatch
from ..core.outcome import Outcome, together
from ..core.shared_signals import SharedSignals
from ..diagnosis import facts
from ..parameters.axis import AxisParameters
from ..parameters.configuration import home_sequence
from ..parameters.qos import POLICIES
from ..procedures.states import Error
from .configured_node import ConfiguredNode
from .controllers import Controllers
from .guarded_axis import GuardedAxis
from .inputs import Inputs
from .joint_order import JointOrder
from .polling import Polled, never_called
from .reports import Publishers, Reports
from .services import Services
from .setpoints import INTERFACES, PositionSetpoints
from .timebase import Lead, TimeBase, wake_precisely

BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
OVERRIDABLE = QoSOverridingOptions([QoSPolicyKind[policy.upper()] for policy in POLICIES])

#: Simulated time is 0 until /clock is heard, s.
FIRST_INSTANT = 1e-9
#: How often the publishers of the inputs are counted, s.
WATCH_PERIOD = 0.1


def latched(depth: int) -> QoSProfile:
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class HomingNode(ConfiguredNode):
    """Homes the axes that its parameters describe; doc/ros_interface.md is its contract.

    Raises InvalidParameters, with every fault, if the parameters are bad.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('homing_node', **kwargs)
        checked = self.configuration
        self._period = 1.0 / checked.update_rate
        self._cycle_timeout = checked.cycle_timeout
        self._joints = checked.joints
        self._axes = {
            name: GuardedAxis(name, parameters, self._period, self._axis_broke, checked.lead)
            for name, parameters in checked.axes.items()
        }
        self._watched = 0.0
        self._lead = Lead(self._period)
        self._stop_requested = False
        self.finished = threading.Event()
        self.broken = False
        self._inputs_ignored = False  # while the axes stop because the cycle has broken

        self._lock = threading.Lock()
        simulated = bool(self.get_parameter('use_sim_time').value)
        self._timebase = TimeBase(self._ros_time if simulated else None)
        polled = Polled()

        def subscribe(kind: Any, topic: str, qos: Any) -> Any:
            try:
                return self.create_subscription(
                    kind,
                    topic,
                    never_called,
                    qos,
                    callback_group=polled,
                    qos_overriding_options=OVERRIDABLE,
                )
            except (RuntimeError, NameValidationException) as error:  # another type; too long
                why = str(error).partition('\n')[0].rstrip(':')
                raise ValueError(f'cannot subscribe to {topic}: {why}') from None

        self._inputs = Inputs(
            self._axes,
            self._joints,
            self._timebase,
            subscribe,
            self.destroy_subscription,
            BEST_EFFORT,
            self._late_cycle,
            checked.serialized,
        )
        for name in self._axes:
            self._inputs.wire(name, self.topics_of(name))
        self._shared_signals = SharedSignals(self._axes, self._inputs.wiring)
        self._note_wiring()
        self._dispatch: Dispatch[Future] = Dispatch(
            self._axes,
            checked.home_sequence,
            self._unready,
            self._new_future,
            checked.ready_timeout,
        )
        self._setpoints = INTERFACES[checked.setpoint_interface](
            self._axes, checked, self._timebase, self._create_setpoints
        )
        self._controllers = Controllers(
            self, self._setpoint_publisher, self._describe_setpoints, self._any_run, self._lose
        )
        by_place = isinstance(self._setpoints, PositionSetpoints)
        self._order = JointOrder(self._axes, self._period) if by_place else None
        self._create_publishers()
        self._create_services()
        self.serve_parameters()

    # ---------------------------------------------------------------------------------- creation

    def _create_setpoints(self, kind: Any, topic: str) -> Any:
        """Create the publisher of a setpoint interface."""
        self._setpoint_publisher = self.create_publisher(
            kind, topic, 1, qos_overriding_options=OVERRIDABLE
        )
        return self._setpoint_publisher

    def _describe_setpoints(self) -> facts.Setpoints:
        """Return what the rules about controllers must know."""
        axes = self._axes.items()
        return facts.Setpoints(
            self._setpoint_publisher.topic_name,
            str(self.configuration.setpoint_interface),
            tuple(self._joints.values()),
            {self._joints[name]: (name, axis.parameters) for name, axis in axes},
            self.configuration.update_rate,
        )

    def _any_run(self) -> bool:
        return any(axis.running for axis in self._axes.values())

    def _lose(self, outcome: Outcome) -> None:
        """End every run: the controller that played the setpoints is gone, or another came."""
        with self._lock:
            for axis in self._axes.values():
                axis.stop(outcome.error, outcome.message)

    def _new_future(self) -> Future:
        """Return what a request waits with; `_end_waits` sets it."""
        return Future(executor=self.executor)

    def _create_publishers(self) -> None:
        def per_axis(kind: Any, name: str, qos: Any) -> dict[str, Any]:
            return {
                axis: self.create_publisher(kind, f'~/{axis}/{name}', qos) for axis in self._axes
            }

        publishers = Publishers(
            states=per_axis(AxisState, 'state', latched(1)),
            servos=per_axis(Bool, 'servo_on', latched(1)),
            torque_limits=per_axis(Float64, 'torque_limit', latched(1)),
            joint_states=self.create_publisher(JointState, '~/joint_states', 10),
            diagnostics=self.create_publisher(DiagnosticArray, '/diagnostics', 1),
        )
        self._reports = Reports(
            self._axes,
            self._joints,
            publishers,
            self._ros_time,
            self._lock,
            self.get_fully_qualified_name(),
            self.get_logger(),
        )

    def _create_services(self) -> None:
        group = ReentrantCallbackGroup()
        services = self.servers = Services(
            self._dispatch,
            self._reports,
            self._timebase,
            self._lock,
            self._inputs.poll,
            partial(self._pause, group),
        )

        def serve(kind: Any, name: str, callback: Any) -> None:
            self.create_service(kind, name, callback, callback_group=group)

        for name, axis in self._axes.items():
            serve(Trigger, f'~/{name}/home', services.home([name], f'~/{name}/home'))
            serve(Trigger, f'~/{name}/cancel', services.cancel([name]))
            serve(Trigger, f'~/{name}/continue', services.resume(axis))
            serve(SetBool, f'~/{name}/servo', services.servo(axis))
        serve(Trigger, '~/home', services.home(list(self._axes), '~/home'))
        serve(Trigger, '~/cancel', services.cancel(list(self._axes)))

        def cancel(goal: Any) -> CancelResponse:
            services.cancel_goal(goal)
            return CancelResponse.ACCEPT

        self._action = ActionServer(
            self,
            Home,
            '~/home',
            services.execute,
            callback_group=group,
            handle_accepted_callback=services.accept,
            cancel_callback=cancel,
        )

    def _pause(self, group: CallbackGroup, seconds: float) -> Future:
        """Return a future that the executor sets after a time of the steady clock."""
        future = self._new_future()

        def end() -> None:
            self.destroy_timer(timer)
            future.set_result(None)

        clock = Clock(clock_type=ClockType.STEADY_TIME)
        timer = self.create_timer(seconds, end, callback_group=group, clock=clock)
        return future

    def _ros_time(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _wrong(self, name: str) -> Outcome | None:
        """Return why an axis cannot home for a reason that waiting does not mend, else None."""
        if name in self.faults:
            return Outcome(Error.InvalidParameter, '; '.join(self.faults[name]))
        return (
            self._inputs.conflict(name, self._publishers_of)
            or self._shared_signals.refusal(name)
            or self._controllers.conflict()
            or self._controllers.verdict.wrong
            or (self._order and self._order.wrong)
        )

    def _missing(self, name: str) -> list[Outcome]:
        """Return everything that an axis still needs for a run."""
        if self._timebase.now < FIRST_INSTANT:
            text = 'use_sim_time is true, but /clock was not heard, or is at 0'
            return [Outcome(Error.FeedbackStale, text)]
        missing = self._inputs.missing(name)
        others = self._setpoints.unready()
        if others is not None:
            missing.append(others)
        verdict = self._controllers.verdict
        missing += verdict.missing
        if self._order and not missing and not verdict.proven and not self._any_run():
            unproven = self._order.missing
            missing += [] if unproven is None else [unproven]
        return missing

    def _unready(self, name: str) -> Outcome | None:
        """Return why an axis cannot home now for a reason that only the node knows, else None."""
        wrong = self._wrong(name)
        missing = [] if wrong else self._missing(name)
        return together(missing) if missing else wrong

    def _publishers_of(self, topic: str) -> list[str]:
        return sorted(
            f'{info.node_namespace.rstrip("/")}/{info.node_name}'
            for info in self.get_publishers_info_by_topic(topic)
        )

    # -------------------------------------------------------------------------------- parameters

    def in_use(self, axis: str) -> str:
        """Return who homes an axis, or will within a sequence; '' if nobody does."""
        with self._lock:
            refusal = self._dispatch.busy(axis)
        return '' if refusal is None else refusal.message

    def take_axis(self, axis: str, parameters: AxisParameters) -> None:
        """Give an axis new parameters, which it has at its next run."""
        with self._lock:
            self._axes[axis].configure(parameters)
            self._inputs.wire(axis, self.topics_of(axis))
            self._note_wiring()

    def _note_wiring(self) -> None:
        """Note which inputs read the same signal."""
        wiring = self._shared_signals.wiring = self._inputs.wiring
        for name, axis in self._axes.items():
            axis.readings.wire_in_series(wiring.in_series(name))

    def take(self, name: str, value: Any) -> None:
        """Take a new value of one of the node's own parameters."""
        if name == 'home_sequence':
            self._dispatch.groups = home_sequence(value, list(self._axes))
        elif name == 'cycle_timeout':
            self._cycle_timeout = float(value)
        elif name == 'ready_timeout':
            self._dispatch.ready_timeout = float(value)

    # ------------------------------------------------------------------------------------- cycle

    def start(self) -> None:
        """Start the threads; the caller spins the executor."""
        ended = self.finished.is_set
        loops = {'cycle': self._cycle_loop, 'reports': self._reports.run}
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

    def _axis_broke(self, text: str, error: Exception) -> None:
        """Log why an axis has broken; it stops, and the others go on."""
        trace = ''.join(traceback.format_exception(error))
        self.get_logger().error(f'{text}\n{trace}')

    def _guarded(
        self, name: str, loop: Callable[[Callable[[], bool]], None], ended: Callable[[], bool]
    ) -> None:
        """Run a thread's loop; if it breaks, the axes stop and the node ends."""
        try:
            loop(ended)
        except Exception as error:
            if not ended():
                self.get_logger().fatal(f'the {name} broke: {error!r}')
                self.broken = True
                if name == 'cycle':
                    self._abandon('the node ended because its cycle broke')
                else:
                    self.stop()
                raise

    def _cycle_loop(self, ended: Callable[[], bool]) -> None:
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
            late_cycle = self._late_cycle(late)
            if late_cycle:
                with self._lock:
                    for axis in self._axes.values():
                        axis.cycle_was_late(clock.now - self._cycle_timeout, late_cycle)
            elif late < -self._period:
                self._set_back(-late)
            try:
                self._cycle(clock.now, due)
            except Exception as error:
                if self._inputs_ignored:  # the stop has broken, too
                    raise
                self.get_logger().fatal(f'the cycle broke, every axis stops: {error!r}')
                self.broken = self._inputs_ignored = True
                self.stop()

    def _late_cycle(self, late: float) -> str:
        """Return the message of CycleLate if a cycle was too late, else ''; ``late`` in s."""
        limit = self._cycle_timeout
        return (
            ''
            if late <= limit
            else (f'a control cycle was {late:.3f} s late, more than {limit:g} s (cycle_timeout)')
        )

    def _cycle(self, now: float, due: float) -> None:
        """Poll the inputs, update the axes, publish setpoints, answer the requests that ended."""
        setpoints, changed = {}, False
        watching = now - self._watched > WATCH_PERIOD
        if watching:
            self._watched = now
        with self._lock:
            if not self._inputs_ignored:
                self._inputs.poll()
                if watching:
                    self._inputs.watch()
            if self._stop_requested:
                self._dispatch.close()
            for name, axis in self._axes.items():
                setpoint = axis.update(now)
                if setpoint is not None:
                    setpoints[name] = setpoint
                changed = self._reports.report(axis) or changed
            ended = []
            if changed or self._dispatch.pending:
                ended = self._dispatch.update(now)
            finished = self._dispatch.closed and self._dispatch.idle
            message = self._setpoints.message(setpoints, due)
            if self._order and self._order.cycle(bool(setpoints)):
                message = self._setpoints.hold(self._order.held)
        if message is not None:
            if not self._timebase.simulated:
                self._lead.learn(time.monotonic() > due)
            self._setpoints.publish(message)
        if ended:
            self._reports.afterwards(self._end_waits, ended)
        if watching and self._controllers.watch() and self.executor is not None:
            self.executor.create_task(self._controllers.look)
        if finished:
            self._finish()

    def _abandon(self, reason: str) -> None:
        """End although axes may not be at rest: nothing can stop them any more."""
        with self._lock:
            ended = self._dispatch.abandon(reason)
        self._reports.afterwards(self._end_waits, ended)
        self._finish()

    def _set_back(self, step: float) -> None:
        """Stop every axis and discard the history that is newer than the new time."""
        text = f'simulated time was set back by about {step:.3f} s'
        now = self._watched = self._timebase.now
        with self._lock:
            for axis in self._axes.values():
                axis.stop(Error.CycleLate, text)
                axis.time_jumped_back(now)

    def _finish(self) -> None:
        self.finished.set()
        self._wake()

    def _wake(self) -> None:
        """Let the executor look whether the node has finished."""
        if self.executor is not None:
            self.executor.create_task(never_called)

    def _end_waits(self, futures: Sequence[Future]) -> None:
        """Let the executor set the futures of requests that have ended.

        The executor must be woken once more: Kilted's may have looked at the coroutine that waits
        before it ran this task.
        """
        executor = self.executor
        if executor is None:
            return

        def end() -> None:
            for future in futures:
                future.set_result(None)
            executor.wake()

        executor.create_task(end)
