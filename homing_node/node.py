"""The homing node: topics, services and parameters around the axes.

Three threads. The *cycle* polls the inputs, updates the axes and publishes setpoints on a fixed
grid. The *executor* (the main thread) answers services and parameters. The *reporter* publishes
what others watch, so that a slow reader never delays a setpoint. ``_lock`` guards the axes;
nothing is published or waited for while it is held.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from queue import Empty, SimpleQueue
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from homing_interfaces.msg import AxisState
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import CallbackGroup, ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Float64MultiArray
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from . import convert
from .axis import Axis, Outcome, Setpoint
from .configuration import (
    AXIS_SPECS,
    NODE_SPECS,
    SetpointInterface,
    check_axis_values,
    check_node_value,
    configuration,
    home_sequence,
)
from .parameters import InvalidParameters, axis_parameters
from .request import Request
from .stamps import Stamps
from .states import LATCHES, Error, Input

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
LATCHED_ONE = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)
OVERRIDABLE = QoSOverridingOptions([
    QoSPolicyKind.HISTORY, QoSPolicyKind.DEPTH, QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY])

#: Period of the homed joint states, s; axis states and diagnostics come every so many of it.
REPORT_PERIOD = 0.02
STATE_EVERY = 5
DIAGNOSTICS_EVERY = 50
#: How often a running axis's publishers are counted, s.
WATCH_PERIOD = 0.1
#: Samples of feedback in a row that may have overtaken each other.
REORDERED = 2
#: How long the last answers may take to leave after the axes have stopped, s.
FAREWELL = 1.0


class Polled(CallbackGroup):
    """Keeps subscriptions from the executor: the cycle polls them (a tenth of the load)."""

    def can_execute(self, entity: object) -> bool:
        return False

    def beginning_execution(self, entity: object) -> bool:
        return False

    def ending_execution(self, entity: object) -> None:
        pass


class HomingNode(Node):
    """Homes the axes that its parameters describe; doc/ros_interface.md is its contract.

    Raises InvalidParameters, with every fault, where the parameters are bad.
    """

    def __init__(self, **kwargs: Any) -> None:
        super().__init__('homing_node', **kwargs)
        given = {name: parameter.value for name, parameter in self._parameter_overrides.items()}
        checked = configuration(given)
        self._declare(checked.axes)
        self._period = 1.0 / checked.update_rate
        self._cycle_timeout = checked.cycle_timeout
        self._groups = checked.home_sequence
        self._by_trajectory = checked.setpoint_interface is SetpointInterface.trajectory
        self._simulated = bool(self.get_parameter('use_sim_time').value)
        self._axes = {name: Axis(name, parameters, self._period)
                      for name, parameters in checked.axes.items()}
        self._joints = checked.joints
        self._by_joint = {joint: self._axes[axis] for axis, joint in self._joints.items()}
        self._faults: dict[str, Sequence[str]] = {}  # of parameters set since the start

        self._lock = threading.Lock()
        self._active: list[tuple[Request, Future]] = []
        self._canceling: list[tuple[tuple[str, ...], Future]] = []
        self._holds: dict[str, float] = {}  # what idle axes are told in position_commands
        self._reports: SimpleQueue[tuple[Any, Any]] = SimpleQueue()
        self._reported: dict[str, tuple[object, ...]] = {}
        self._wall = self._now = 0.0
        self._watched = 0.0
        self._stop_requested = False
        self.finished = threading.Event()

        self._polled, self._requests = Polled(), ReentrantCallbackGroup()
        self._create_publishers()
        self._create_inputs()
        self._create_services()
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)

    # ---------------------------------------------------------------------------------- creation

    def _declare(self, axes: Iterable[str]) -> None:
        """Declare every parameter with its descriptor."""
        for spec in NODE_SPECS.values():
            self.declare_parameter(spec.name, convert.plain(spec.initial),
                                   convert.descriptor(spec))
        for axis in axes:
            self.declare_parameters(axis, [
                (name, convert.plain(spec.initial), convert.descriptor(spec))
                for name, spec in AXIS_SPECS.items()])

    def _create_publishers(self) -> None:
        self._trajectory = self.create_publisher(
            JointTrajectory, '~/setpoints', 1, qos_overriding_options=OVERRIDABLE)
        self._position_commands = self.create_publisher(
            Float64MultiArray, '~/position_commands', 1, qos_overriding_options=OVERRIDABLE)
        self._joint_states = self.create_publisher(JointState, '~/joint_states', 10)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 1)
        self._states = {name: self.create_publisher(AxisState, f'~/{name}/state', LATCHED)
                        for name in self._axes}
        self._servo_on = {name: self.create_publisher(Bool, f'~/{name}/servo_on', LATCHED_ONE)
                          for name in self._axes}

    def _create_inputs(self) -> None:
        self._feedback = self._subscribe(JointState, 'joint_states', BEST_EFFORT)
        self._feedback_stamps = {
            joint: Stamps(axis.parameters.feedback_timeout, REORDERED)
            for joint, axis in self._by_joint.items()}
        self._emergency_stop = self._subscribe(Bool, '~/emergency_stop', 10)
        self._inputs: dict[str, list[tuple[Input, Any, Callable[[Any, Any], None]]]] = {}
        for name in self._axes:
            self._wire(name)

    def _subscribe(self, kind: Any, topic: str, qos: Any) -> Any:
        return self.create_subscription(
            kind, topic, _never_called, qos, callback_group=self._polled,
            qos_overriding_options=OVERRIDABLE)

    def _wire(self, name: str) -> None:
        """Subscribe to the inputs that an axis's parameters name, on their topics."""
        axis = self._axes[name]
        for _, subscription, _ in self._inputs.get(name, ()):
            self.destroy_subscription(subscription)
        self._inputs[name] = []
        for source in axis.parameters.inputs:
            topic = self.get_parameter(f'{name}.topics.{source}').value or f'~/{name}/{source}'
            kind = Float64 if source in LATCHES else Bool
            depth = 10 if source is Input.SERVO_ENABLED else 100
            self._inputs[name].append(
                (source, self._subscribe(kind, topic, depth), self._taker(axis, source)))

    def _taker(self, axis: Axis, source: Input) -> Callable[[Any, Any], None]:
        """Return what takes a message of an input, and its stamps, to the axis."""
        if source in LATCHES:
            return lambda message, info: axis.latch(source, float(message.data))
        if source is Input.SERVO_ENABLED:
            return lambda message, info: axis.enable(bool(message.data))
        stamps = Stamps(axis.parameters.feedback_timeout)

        def take(message: Bool, info: Mapping[str, int]) -> None:
            arrival = self._time_of(info['received_timestamp'])
            stamp = arrival if self._simulated else self._time_of(info['source_timestamp'])
            found = stamps.believe(stamp, arrival)
            if found is not None:
                axis.switch(source, found[0], bool(message.data), arrival)

        return take

    def _create_services(self) -> None:
        def serve(kind: Any, name: str, callback: Any) -> None:
            self.create_service(kind, name, callback, callback_group=self._requests)

        for name in self._axes:
            serve(Trigger, f'~/{name}/home', self._home_server((name,), f'~/{name}/home'))
            serve(Trigger, f'~/{name}/cancel', self._cancel_server((name,)))
            serve(Trigger, f'~/{name}/continue', self._continue_server(self._axes[name]))
            serve(SetBool, f'~/{name}/servo', self._servo_server(self._axes[name]))
        serve(Trigger, '~/home', self._home_server(tuple(self._axes), '~/home'))
        serve(Trigger, '~/cancel', self._cancel_server(tuple(self._axes)))

    # ---------------------------------------------------------------------------------- services

    def _home_server(self, names: tuple[str, ...], owner: str) -> Any:
        async def home(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            started = self._request(names, owner)
            if isinstance(started, Outcome):
                outcomes = [started]
            else:
                request = await started
                outcomes = list(request.outcomes.values())
            response.success = all(outcome.success for outcome in outcomes)
            response.message = convert.home_message(outcomes)
            return response

        return home

    def _request(self, names: tuple[str, ...], owner: str) -> Outcome | Future:
        """Start homing some axes; return why not, or what will be done with the request."""
        groups = [tuple(name for name in group if name in names) for group in self._groups]
        groups = [group for group in groups if group]
        groups += [(name,) for name in names if not any(name in group for group in groups)]
        with self._lock:
            if self._stop_requested:
                return Outcome(Error.Canceled, 'the node is shutting down')
            for name in names:
                refusal = self._refusal(name)
                if refusal is not None:
                    return refusal
            if not self._active:
                self._holds = {axis.name: axis.hold_position for axis in self._axes.values()}
            future = Future()
            request = Request(groups, self._axes, owner)
            request.start(self._now)
            self._active.append((request, future))
            return future

    def _refusal(self, name: str) -> Outcome | None:
        """Return why an axis cannot home now for a reason that the node knows, not the axis."""
        for request, _ in self._active:
            if name in request.names and not request.done:
                state = self._axes[name].state
                return Outcome(Error.Busy, f'axis {name}: {request.owner} is homing '
                                           f'{", ".join(request.names)} ({name}: {state})')
        faults = self._faults.get(name)
        if faults:
            return Outcome(Error.InvalidParameter, '; '.join(faults))
        for source, subscription, _ in self._inputs[name]:
            publishers = subscription.get_publisher_count()
            topic = subscription.topic_name
            if publishers > 1:
                nodes = ', '.join(sorted(
                    f'{p.node_namespace.rstrip("/")}/{p.node_name}'
                    for p in self.get_publishers_info_by_topic(topic)))
                return Outcome(Error.PublisherConflict, (
                    f'axis {name}: {publishers} publishers on {topic}: {nodes} (one that was '
                    'killed stays listed for about 20 s)'))
            if publishers == 0 and source in LATCHES:
                return Outcome(Error.SwitchUnknown, f'axis {name}: nobody publishes {topic}')
        return None

    def _cancel_server(self, names: tuple[str, ...]) -> Any:
        async def cancel(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            response.success = True
            with self._lock:
                moving = tuple(name for name in names if self._axes[name].running)
                for request, _future in self._active:
                    if set(request.names) <= set(names):
                        request.cancel()
                for name in moving:
                    self._axes[name].cancel()
                if moving:
                    future = Future()
                    self._canceling.append((moving, future))
            if not moving:
                response.message = 'nothing to cancel'
                return response
            await future
            response.message = f'Canceled: {", ".join(moving)} at rest'
            return response

        return cancel

    def _continue_server(self, axis: Axis) -> Any:
        def resume(_: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
            with self._lock:
                response.success = axis.paused
                axis.resume()
            response.message = '' if response.success else f'axis {axis.name} is not paused'
            return response

        return resume

    def _servo_server(self, axis: Axis) -> Any:
        def servo(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
            with self._lock:
                axis.set_servo(bool(request.data))
            response.success = True
            response.message = f'servo_on of axis {axis.name} is {str(axis.servo_on).lower()}'
            return response

        return servo

    # -------------------------------------------------------------------------------- parameters

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Set parameters; a bad value is answered with its name, value, bound and unit.

        Checked here before rclpy tests the range, which would answer without them.
        """
        known = [p for p in parameter_list if self.has_parameter(p.name)]
        result = self._check_parameters(known)
        if not result.successful:
            return result
        return super().set_parameters_atomically(parameter_list)

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Check each value, and of several set together the cross-checks."""
        faults: list[str] = []
        together: dict[str, dict[str, object]] = {}
        for parameter in parameters:
            name, value = parameter.name, parameter.value
            axis, _, rest = name.partition('.')
            try:
                if name in NODE_SPECS:
                    check_node_value(name, value, list(self._axes))
                elif axis in self._axes:
                    if self._axes[axis].running:
                        faults.append(f'{name}: axis {axis} is homing '
                                      f'({self._axes[axis].state}); set it afterwards')
                        continue
                    together.setdefault(axis, {})[rest] = AXIS_SPECS[rest].convert(value)
            except ValueError as error:
                faults.append(f'{axis}.{error}' if axis in self._axes else str(error))
        if not faults:
            for axis, values in together.items():
                if len(values) > 1:
                    faults += check_axis_values(axis, {**self._values(axis), **values})
        return SetParametersResult(successful=not faults, reason='; '.join(faults))

    def _apply_parameters(self, parameters: list[Parameter]) -> None:
        """Take new values: the axis has them at its next run."""
        for parameter in parameters:
            if parameter.name == 'home_sequence':
                self._groups = home_sequence(list(parameter.value or []), list(self._axes))
            elif parameter.name == 'cycle_timeout':
                self._cycle_timeout = float(parameter.value)
        for name in {p.name.partition('.')[0] for p in parameters} & set(self._axes):
            try:
                new = axis_parameters(self._values(name), name)
            except InvalidParameters as error:
                self._faults[name] = error.faults
                continue
            with self._lock:
                self._faults.pop(name, None)
                self._axes[name].configure(new)
                self._wire(name)

    def _values(self, axis: str) -> dict[str, object]:
        """Return the values of an axis's own parameters that are set."""
        return {name: value for name in AXIS_SPECS
                if not name.startswith('topics.')
                and (value := self.get_parameter(f'{axis}.{name}').value) is not None}

    # ------------------------------------------------------------------------------------- cycle

    def start(self) -> None:
        """Start the cycle and the reporter."""
        for name in self._axes:
            self._report_change(self._axes[name])
        for loop in (self._cycle_loop, self._report_loop):
            threading.Thread(target=self._guarded, args=(loop,), daemon=True,
                             name=loop.__name__).start()

    def stop(self) -> None:
        """Stop every axis, answer every request, then finish."""
        self._stop_requested = True

    def _guarded(self, loop: Callable[[], None]) -> None:
        """Run a thread's loop; where it breaks the node ends, for it must not seem alive."""
        try:
            loop()
        except Exception as error:
            if not self.finished.is_set():
                self.get_logger().fatal(f'{loop.__name__}: {error!r}')
                self.finished.set()
                raise

    def _read_clock(self) -> float:
        """Return the time of the core in s, and remember how stamps relate to it."""
        if self._simulated:
            self._wall_ns, self._now = 0, self.get_clock().now().nanoseconds * 1e-9
            self._base = 0.0
        else:
            self._wall_ns, self._now = time.time_ns(), time.monotonic()
            self._base = self._now
        return self._now

    def _time_of(self, nanoseconds: int) -> float:
        """Return a stamp in the time of the core."""
        return self._base + (nanoseconds - self._wall_ns) * 1e-9

    def _cycle_loop(self) -> None:
        due = self._read_clock()
        while not self.finished.is_set():
            due += self._period
            self._sleep_until(due)
            late = self._read_clock() - due
            if late > self._cycle_timeout or late < -self._period:
                self._fail_all(Error.CycleLate, f'a control cycle was {late:.3f} s late, more '
                                                f'than {self._cycle_timeout:g} s (cycle_timeout)')
            if late >= self._period or late < -self._period:
                due = self._now  # cycles that were missed are not made up for
            self._cycle()

    def _sleep_until(self, due: float) -> None:
        if not self._simulated:
            time.sleep(max(0.0, due - time.monotonic()))
            return
        while self._read_clock() < due and not self.finished.is_set():
            time.sleep(0.0005)

    def _cycle(self) -> None:
        """Poll the inputs, update the axes, publish the setpoints, answer what has ended."""
        with self._lock:
            self._poll()
            setpoints = {}
            for name, axis in self._axes.items():
                setpoint = axis.update(self._now)
                if setpoint is not None:
                    setpoints[name] = setpoint
                self._report_change(axis)
            if self._stop_requested:
                self._stop_all()
            ended = self._ended()
        if setpoints:
            self._publish(setpoints)
        for future, result in ended:
            future.set_result(result)
        if ended:
            self.executor.create_task(_never_called)  # wakes it: the answers can go out
        if self._stop_requested and not self._active:
            self.finished.set()
            self.executor.create_task(_never_called)

    def _poll(self) -> None:
        """Give every message that has arrived to its axis, the feedback last."""
        for inputs in self._inputs.values():
            for _, subscription, take in inputs:
                kind = subscription.msg_type
                while (taken := subscription.handle.take_message(kind, False)) is not None:
                    take(*taken)
        while (taken := self._emergency_stop.handle.take_message(Bool, False)) is not None:
            for axis in self._axes.values():
                axis.set_emergency_stop(bool(taken[0].data))
        while (taken := self._feedback.handle.take_message(JointState, False)) is not None:
            self._take_feedback(*taken)
        if self._active and self._now - self._watched > WATCH_PERIOD:
            self._watched = self._now
            self._watch_publishers()

    def _take_feedback(self, message: JointState, info: Mapping[str, int]) -> None:
        arrival = self._now if self._simulated else self._time_of(info['received_timestamp'])
        sampled = convert.to_nanoseconds(message.header.stamp)
        if sampled == 0 and self._simulated:
            stamp = arrival
        else:
            stamp = self._time_of(sampled or info['source_timestamp'])
        for joint, position in convert.positions(message):
            axis = self._by_joint.get(joint)
            if axis is not None:
                found = self._feedback_stamps[joint].believe(stamp, arrival)
                if found is not None:
                    axis.feedback(found[0], position, arrival)

    def _watch_publishers(self) -> None:
        """End a run whose switch has lost its publisher."""
        for name, axis in self._axes.items():
            if not axis.running:
                continue
            for source, subscription, _ in self._inputs[name]:
                if subscription.get_publisher_count() == 0:
                    axis.stop(Error.SwitchStale, f'{source} lost its publisher '
                                                 f'({subscription.topic_name})')

    def _ended(self) -> list[tuple[Future, Any]]:
        """Follow the requests; return what is to be answered."""
        ended: list[tuple[Future, Any]] = []
        for request, future in list(self._active):
            if request.update(self._now):
                self._active.remove((request, future))
                ended.append((future, request))
        for names, future in list(self._canceling):
            if not any(self._axes[name].running for name in names):
                self._canceling.remove((names, future))
                ended.append((future, None))
        return ended

    def _fail_all(self, error: Error, text: str) -> None:
        with self._lock:
            for axis in self._axes.values():
                axis.stop(error, text)

    def _stop_all(self) -> None:
        for request, _ in self._active:
            request.cancel()

    def _publish(self, setpoints: Mapping[str, Setpoint]) -> None:
        if self._by_trajectory:
            by_joint = {self._joints[name]: s for name, s in setpoints.items()}
            self._trajectory.publish(convert.trajectory(by_joint, self._period))
            return
        for name, setpoint in setpoints.items():
            self._holds[name] = setpoint.position
        self._position_commands.publish(convert.position_commands(self._holds.values()))

    # ----------------------------------------------------------------------------------- reports

    def _report_change(self, axis: Axis) -> None:
        """Queue what others see of an axis where it has changed."""
        seen = (axis.state, axis.paused, axis.homed, axis.error, axis.servo_on)
        before = self._reported.get(axis.name)
        if seen == before:
            return
        self._reported[axis.name] = seen
        stamp = self.get_clock().now().nanoseconds
        self._reports.put((self._states[axis.name], convert.axis_state(stamp, axis)))
        if before is None or before[-1] != axis.servo_on:
            self._reports.put((self._servo_on[axis.name], Bool(data=bool(axis.servo_on))))

    def _report_loop(self) -> None:
        """Publish changes as they come, and what is due by time."""
        turn, due = 0, time.monotonic()
        while not self.finished.is_set() or not self._reports.empty():
            try:
                publisher, message = self._reports.get(timeout=max(0.0, due - time.monotonic()))
                publisher.publish(message)
                continue
            except Empty:
                pass
            turn, due = turn + 1, time.monotonic() + REPORT_PERIOD
            for publisher, message in self._due_reports(turn):
                publisher.publish(message)

    def _due_reports(self, turn: int) -> list[tuple[Any, Any]]:
        stamp = self.get_clock().now().nanoseconds
        reports: list[tuple[Any, Any]] = []
        with self._lock:
            homed = {self._joints[a.name]: a.position for a in self._axes.values() if a.homed}
            if homed:
                reports.append((self._joint_states, convert.joint_states(stamp, homed)))
            if turn % STATE_EVERY == 0:
                reports += [(self._states[axis.name], convert.axis_state(stamp, axis))
                            for axis in self._axes.values() if axis.running]
            if turn % DIAGNOSTICS_EVERY == 0:
                reports.append((self._diagnostics, convert.diagnostics(
                    stamp, self.get_name(), self._axes.values())))
        return reports


def _never_called(*_: object) -> None:
    """Stand where rclpy wants a callback: polled subscriptions have none, waking needs none."""


def _signal_pipe() -> int:
    """Return a file descriptor that becomes readable at SIGINT or SIGTERM.

    A handler alone would run only once the main thread leaves rcl's wait.
    """
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    signal.set_wakeup_fd(writer)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _never_called)
    return reader


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; return the exit status."""
    signaled = _signal_pipe()
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = HomingNode()
    except InvalidParameters as error:
        print('homing_node: the parameters are not valid:', *error.faults, sep='\n  ',
              file=sys.stderr)
        return 1
    except Exception as error:
        print(f'homing_node: {error}', file=sys.stderr)
        return 1
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    node.start()

    def wait_for_signal() -> None:
        os.read(signaled, 1)
        node.stop()

    threading.Thread(target=wait_for_signal, daemon=True).start()
    while not node.finished.is_set():
        executor.spin_once()
    until = time.monotonic() + FAREWELL
    while executor._tasks and time.monotonic() < until:
        executor.spin_once(timeout_sec=0.01)
    node.destroy_node()
    rclpy.shutdown()
    return 0
