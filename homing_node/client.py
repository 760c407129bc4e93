# SPDX-License-Identifier: Apache-2.0
"""Home axes from a Python script, without writing a node.

    from homing_node.client import HomingClient

    with HomingClient() as homing:
        print(homing.home('x').message)

Positions in m or rad, times in s.
"""

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import Any

from homing_interfaces.action import Home, Jog
from homing_interfaces.msg import AxisState
from rclpy.parameter import Parameter, ParameterMsg
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger

from .course import Course
from .procedures.states import Error
from .ros import graph
from .ros.calls import Abandoned, Calls, Interrupted, NotThere
from .ros.course_recorder import CourseRecorder

__all__ = ['Abandoned', 'Answer', 'HomingClient', 'Interrupted', 'NotThere']

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: How often a deadman that is held says so, s.
DEADMAN_PERIOD = 0.05


@dataclass(frozen=True)
class Answer:
    """The answer of the homing node; it is true if the request has succeeded.

    Attributes:
        success: Whether the request has succeeded.
        message: What was done, or `<ErrorName>: <text>`.
        states: The last state of each axis of a `home`.
        steps: The order of a `home`: the axes of each step, with commas.
        durations: Of a dry run: how long each step takes, s; NaN: not known.
        missing: Of a dry run: what would refuse the request.
    """

    success: bool
    message: str
    states: tuple[AxisState, ...] = ()
    steps: tuple[str, ...] = ()
    durations: tuple[float, ...] = ()
    missing: tuple[str, ...] = ()

    @property
    def error(self) -> str:
        """The name of the error, '' if the request has succeeded or names none."""
        name, colon, _ = self.message.partition(':')
        return name if colon and not self.success else ''

    def __bool__(self) -> bool:
        return self.success


class HomingClient:
    """A client of one homing node, in a context and a thread of its own.

    Every call raises TimeoutError if no answer comes.
    """

    def __init__(
        self, node_name: str = '/homing_node', discovery: float = 10.0, patience: float = 5.0
    ) -> None:
        """Join the graph.

        Args:
            node_name: The full name of the homing node.
            discovery: Longest wait for the node, s.
            patience: A request that comes before the node has heard its feedback and switches is
                repeated for this long, s.
        """
        self.node_name = node_name
        self.discovery = discovery
        self.patience = patience
        self._calls = Calls(node_name, discovery)
        self.node = self._calls.node
        self._subscriptions: dict[str, Any] = {}  # to the states, by axis
        self._states: dict[str, AxisState] = {}
        self._changed = threading.Condition()

    def __enter__(self) -> 'HomingClient':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the graph."""
        self._calls.close()

    def home(
        self,
        *axes: str,
        dry_run: bool = False,
        force: bool = False,
        on_feedback: Callable[[Home.Feedback], None] | None = None,
        timeout: float | None = None,
    ) -> Answer:
        """Home some axes and return how it ended.

        KeyboardInterrupt (as Interrupted) and a timeout stop the axes before they leave this call.

        Args:
            axes: The names of the axes; none: all axes, in `home_sequence`.
            dry_run: Nothing moves: the answer has the order, the times, and what is missing.
            force: A coordinator homes what is homed, too, whatever its `skip_homed` says.
            on_feedback: Called at 10 Hz, in the client's thread. What it raises leaves this call,
                once the axes rest; it is not called any more then.
            timeout: Longest wait for the end, s; None: no bound.
        """
        goal = Home.Goal(axes=list(axes), dry_run=dry_run, force=force)
        return self._patiently(lambda: self._home('home', goal, on_feedback, timeout))

    def verify(
        self,
        *axes: str,
        on_feedback: Callable[[Home.Feedback], None] | None = None,
        timeout: float | None = None,
    ) -> Answer:
        """Compare the homes of some axes, one at least, with what is found again.

        The rest is as in :meth:`home`.
        """
        first, *others = axes
        goal = Home.Goal(axes=others)
        return self._patiently(lambda: self._home(f'{first}/verify', goal, on_feedback, timeout))

    def jog(
        self,
        axis: str,
        distance: float,
        velocity: float,
        held: Callable[[], bool] | None = None,
        on_feedback: Callable[[Jog.Feedback], None] | None = None,
        timeout: float | None = None,
    ) -> Jog.Result:
        """Move an axis by a distance, and return what it has met.

        KeyboardInterrupt (as Interrupted) and a timeout stop the axis before they leave this call.

        Args:
            axis: The name of the axis.
            distance: How far, raw, with its sign, m or rad.
            velocity: How fast, m/s or rad/s.
            held: Returns whether the deadman is held; called in the client's thread. None: the jog
                has no deadman.
            on_feedback: Called at 10 Hz, in the client's thread.
            timeout: Longest wait for the end, s; None: no bound.
        """
        goal = Jog.Goal(
            axis=axis,
            distance=float(distance),
            velocity=float(velocity),
            deadman=held is not None,
        )
        if held is None:
            return self._calls.act(Jog, 'jog', goal, on_feedback, timeout)
        topic = f'{self.node_name}/{axis}/deadman'
        publisher = self._calls.client(topic, lambda: self.node.create_publisher(Bool, topic, 1))
        timer = self.node.create_timer(
            DEADMAN_PERIOD, lambda: publisher.publish(Bool(data=bool(held())))
        )
        try:
            return self._calls.act(Jog, 'jog', goal, on_feedback, timeout)
        finally:
            self.node.destroy_timer(timer)

    def call_home(self, axis: str = '', timeout: float | None = None) -> Answer:
        """Home one axis, or all, through the service instead of the action.

        If this raises TimeoutError, the axis goes on homing: `cancel` stops it.
        """
        return self._patiently(lambda: self._trigger(axis, 'home', timeout), axis)

    def cancel(self, axis: str = '') -> Answer:
        """Stop one axis, or all; return when they are at rest."""
        return self._trigger(axis, 'cancel')

    def cancel_each(self, *axes: str) -> dict[str, Answer]:
        """Stop some axes at the same time; return when they are at rest.

        Where one has no such service, the others are stopped all the same.
        """
        names = {axis: f'{self.node_name}/{axis}/cancel' for axis in axes}
        clients = {axis: self._calls.service(Trigger, name) for axis, name in names.items()}
        until = time.monotonic() + self.discovery
        sent: dict[str, Any] = {}
        while len(sent) < len(clients) and time.monotonic() < until:
            for axis, client in clients.items():
                if axis not in sent and client.service_is_ready():
                    sent[axis] = client.call_async(Trigger.Request())
            time.sleep(0.01)
        answers = {
            axis: Answer(False, f'no service {name} within {self.discovery:g} s')
            for axis, name in names.items()
        }
        for axis, future in sent.items():
            response = self._calls.wait(future, None, clients[axis].service_is_ready)
            answers[axis] = Answer(response.success, response.message)
        return answers

    def resume(self, axis: str) -> Answer:
        """Leave the pause of `pause_mode`."""
        return self._trigger(axis, 'continue')

    def servo(self, axis: str, on: bool) -> Answer:
        """Set the servo that the node asks for."""
        return self._call(SetBool, f'{axis}/servo', SetBool.Request(data=on))

    def set_parameters(self, axis: str, **values: Any) -> Answer:
        """Set some parameters of an axis together, for its next run."""
        client = self._calls.client(
            'parameters', lambda: AsyncParameterClient(self.node, self.node_name)
        )
        if not client.wait_for_services(self.discovery):
            raise NotThere(f'no node {self.node_name} within {self.discovery:g} s')
        parameters = [Parameter(f'{axis}.{name}', value=value) for name, value in values.items()]
        result = self._calls.wait(
            client.set_parameters_atomically(parameters), self.discovery
        ).result
        return Answer(result.successful, result.reason)

    def parameters(self, *names: str) -> dict[str, Any]:
        """Return those parameters of the node that it has."""
        client = self._calls.client(
            'parameters', lambda: AsyncParameterClient(self.node, self.node_name)
        )
        if not client.wait_for_services(self.discovery):
            raise NotThere(f'no node {self.node_name} within {self.discovery:g} s')
        values = self._calls.wait(client.get_parameters(list(names)), self.discovery).values
        found = (
            Parameter.from_parameter_msg(ParameterMsg(name=name, value=value))
            for name, value in zip(names, values, strict=False)
        )
        return {one.name: one.value for one in found if one.value is not None}

    def others(self) -> list[str]:
        """Return the full names of all homing nodes and coordinators that are in reach now."""
        return graph.homing_nodes(self.node)

    def wait_for_node(self) -> bool:
        """Wait until the node is in reach; return whether it is."""
        until = time.monotonic() + self.discovery
        while self.node_name not in self.others():
            if time.monotonic() > until:
                return False
            time.sleep(0.02)
        return True

    def state(self, axis: str) -> AxisState:
        """Return the newest state of an axis."""
        with self._changed:
            if axis not in self._subscriptions:
                self._subscriptions[axis] = self.node.create_subscription(
                    AxisState,
                    f'{self.node_name}/{axis}/state',
                    partial(self._take_state, axis),
                    LATCHED,
                )
            if not self._changed.wait_for(lambda: axis in self._states, self.discovery):
                raise NotThere(f'no {self.node_name}/{axis}/state within {self.discovery:g} s')
            return self._states[axis]

    @contextmanager
    def record(
        self, axis: str, joint: str = '', followers: Mapping[str, str] = MappingProxyType({})
    ) -> Iterator[Course]:
        """Record the setpoints, the feedback and the switches of an axis into a course.

        The axis publishes `setpoint_interface: trajectory`. ``followers`` has the joints of the
        followers of a gantry, by their names; they are in `Course.followers`, by full names.
        The recording begins once the feedback of all joints has been heard.

        Raises:
            TimeoutError: nothing was heard of a joint within `discovery`.
        """
        self.state(axis)
        recorder = CourseRecorder(
            self.node, self.node_name, axis, joint or axis, self.state, followers
        )
        try:
            recorder.wait(self.discovery)
            yield recorder.course
        finally:
            recorder.close()

    # ------------------------------------------------------------------------------------- inside

    def _home(
        self,
        name: str,
        goal: Home.Goal,
        on_feedback: Callable[[Home.Feedback], None] | None,
        timeout: float | None,
    ) -> Answer:
        result = self._calls.act(Home, name, goal, on_feedback, timeout)
        for state in result.states:
            self._take_state(state.axis, state)
        return Answer(
            result.success,
            result.message,
            tuple(result.states),
            tuple(result.steps),
            tuple(result.durations),
            tuple(result.missing),
        )

    def _patiently(self, run: Callable[[], Answer], axis: str = '') -> Answer:
        """Repeat a request while it is refused because the node has not heard its inputs."""
        until = time.monotonic() + self.patience
        while True:
            answer = run()
            if not self._unheard(answer, axis) or time.monotonic() > until:
                return answer
            time.sleep(0.05)

    def _unheard(self, answer: Answer, axis: str) -> bool:
        """Return whether a request was refused because something is not there yet.

        Only then nothing has moved. FeedbackStale and NoController can also end a run, and are
        then the error in the state of its axis.
        """
        if answer.error in (Error.FeedbackStale, Error.NoController):
            states = answer.states or ((self.state(axis),) if axis else ())
            return bool(states) and all(state.error != answer.error for state in states)
        return answer.error == Error.SwitchUnknown

    def _trigger(self, axis: str, verb: str, timeout: float | None = None) -> Answer:
        name = f'{axis}/{verb}' if axis else verb
        return self._call(Trigger, name, Trigger.Request(), timeout)

    def _call(self, kind: Any, name: str, request: Any, timeout: float | None = None) -> Answer:
        response = self._calls.call(kind, f'{self.node_name}/{name}', request, timeout)
        return Answer(response.success, response.message)

    def _take_state(self, axis: str, message: AxisState) -> None:
        """Keep a state unless it is older than the newest one."""
        with self._changed:
            known = self._states.get(axis)
            if known is None or _time_of(message) >= _time_of(known):
                self._states[axis] = message
            self._changed.notify_all()


def _time_of(state: AxisState) -> tuple[int, int]:
    stamp = state.header.stamp
    return stamp.sec, stamp.nanosec
