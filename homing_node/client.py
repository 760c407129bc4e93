# SPDX-License-Identifier: Apache-2.0
"""Home axes from a Python script, without writing a node.

    from homing_node.client import HomingClient

    with HomingClient() as homing:
        print(homing.home('x').message)

Positions in m or rad, times in s.
"""

import math
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from typing import Any

import rclpy
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from .course import Course, Happening, Sample
from .procedures.states import LATCHES, Input, State

#: How a request is refused where an input was not heard yet; nothing has moved then.
UNHEARD = ('no feedback yet', 'no message yet', 'nobody publishes')
#: States that a node told before we came arrive at once, one after another: no more than so far
#: apart, s; one that homes tells another every 0.1 s.
APART = 0.05
#: How often it is looked whether a node that takes its time is there still, s.
LOOK = 1.0
LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)


@dataclass(frozen=True)
class Answer:
    """What the homing node answered: true where all is well, ``message`` says what or why not."""

    success: bool
    message: str
    states: tuple[AxisState, ...] = ()

    def __bool__(self) -> bool:
        return self.success


class HomingClient:
    """A client of one homing node, in a context and a thread of its own.

    ``node_name`` is the homing node's full name, ``discovery`` how long to wait for it. A node
    that has just started may not have heard its feedback and switches yet: a request refused for
    that is repeated for ``patience``. Every call raises TimeoutError where no answer comes.
    """

    def __init__(
        self, node_name: str = '/homing_node', discovery: float = 10.0, patience: float = 5.0
    ) -> None:
        self.node_name = node_name
        self.discovery = discovery
        self.patience = patience
        self._context = Context()
        rclpy.init(context=self._context)
        self.node = Node(
            f'homing_client_{os.getpid()}',
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._states: dict[str, AxisState] = {}
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def __enter__(self) -> 'HomingClient':
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Leave the graph."""
        self._context.try_shutdown()
        self._thread.join()
        self.node.destroy_node()

    def home(
        self,
        *axes: str,
        on_feedback: Callable[[Home.Feedback], None] | None = None,
        timeout: float | None = None,
    ) -> Answer:
        """Home some axes (none: all, in `home_sequence`) and return how it ended.

        ``on_feedback`` is called at 10 Hz, in the client's thread. KeyboardInterrupt and a
        timeout stop the axes before they leave this call.
        """
        client = self._client(
            'home (action)', lambda: ActionClient(self.node, Home, f'{self.node_name}/home')
        )
        if not client.wait_for_server(self.discovery):
            raise TimeoutError(f'no action {self.node_name}/home within {self.discovery:g} s')

        def tell(message: Any) -> None:
            if on_feedback is not None:
                on_feedback(message.feedback)

        def run() -> Answer:
            sent = client.send_goal_async(Home.Goal(axes=list(axes)), tell)
            goal = self._wait(sent, self.discovery)
            result = goal.get_result_async()
            try:
                answer = self._wait(result, timeout, client.server_is_ready).result
            except (KeyboardInterrupt, TimeoutError):
                self._wait(goal.cancel_goal_async(), self.discovery, client.server_is_ready)
                self._wait(result, self.discovery, client.server_is_ready)
                raise
            return Answer(answer.success, answer.message, tuple(answer.states))

        return self._patiently(run)

    def call_home(self, axis: str = '', timeout: float | None = None) -> Answer:
        """Home one axis, or all, through the service instead of the action.

        Where this raises TimeoutError the axis goes on homing: `cancel` stops it.
        """
        return self._patiently(lambda: self._trigger(axis, 'home', timeout))

    def cancel(self, axis: str = '') -> Answer:
        """Stop one axis, or all; answered when they are at rest."""
        return self._trigger(axis, 'cancel')

    def resume(self, axis: str) -> Answer:
        """Leave the pause of `pause_mode`."""
        return self._trigger(axis, 'continue')

    def servo(self, axis: str, on: bool) -> Answer:
        """Set the servo that the node asks for."""
        return self._call(SetBool, f'{axis}/servo', SetBool.Request(data=on))

    def set_parameters(self, axis: str, **values: Any) -> Answer:
        """Set some parameters of an axis together; they hold from its next run on."""
        client = self._client(
            'parameters', lambda: AsyncParameterClient(self.node, self.node_name)
        )
        if not client.wait_for_services(self.discovery):
            raise TimeoutError(f'no node {self.node_name} within {self.discovery:g} s')
        parameters = [Parameter(f'{axis}.{name}', value=value) for name, value in values.items()]
        result = self._wait(client.set_parameters_atomically(parameters), self.discovery).result
        return Answer(result.successful, result.reason)

    def state(self, axis: str) -> AxisState:
        """Return the newest state of an axis."""
        with self._changed:
            new = axis not in self._clients
            if new:
                self._clients[axis] = self.node.create_subscription(
                    AxisState,
                    f'{self.node_name}/{axis}/state',
                    partial(self._take_state, axis),
                    LATCHED,
                )
            if not self._changed.wait_for(lambda: axis in self._states, self.discovery):
                raise TimeoutError(f'no {self.node_name}/{axis}/state within {self.discovery:g} s')
            state = self._states[axis]
            while new and self._changed.wait_for(
                lambda known=state: self._states[axis] is not known, APART
            ):
                state = self._states[axis]
            return state

    @contextmanager
    def record(self, axis: str, joint: str = '') -> Iterator[Course]:
        """Record the setpoints, the feedback and the switches of an axis into a course.

        The axis publishes `setpoint_interface: trajectory`.
        """
        self.state(axis)
        recorder = Recorder(self, axis, joint or axis)
        try:
            yield recorder.course
        finally:
            recorder.close()

    # ------------------------------------------------------------------------------------- inside

    def _spin(self) -> None:
        with suppress(ExternalShutdownException):
            self._executor.spin()

    def _patiently(self, run: Callable[[], Answer]) -> Answer:
        """Repeat a request that was refused for an input that was not heard yet."""
        until = time.monotonic() + self.patience
        while True:
            answer = run()
            if not any(text in answer.message for text in UNHEARD) or time.monotonic() > until:
                return answer
            time.sleep(0.05)

    def _client(self, name: str, make: Callable[[], Any]) -> Any:
        if name not in self._clients:
            self._clients[name] = make()
        return self._clients[name]

    def _trigger(self, axis: str, verb: str, timeout: float | None = None) -> Answer:
        name = f'{axis}/{verb}' if axis else verb
        return self._call(Trigger, name, Trigger.Request(), timeout)

    def _call(self, kind: Any, name: str, request: Any, timeout: float | None = None) -> Answer:
        full = f'{self.node_name}/{name}'
        client = self._client(full, lambda: self.node.create_client(kind, full))
        if not client.wait_for_service(self.discovery):
            raise TimeoutError(f'no service {full} within {self.discovery:g} s')
        response = self._wait(client.call_async(request), timeout, client.service_is_ready)
        return Answer(response.success, response.message)

    def _wait(
        self, future: Any, timeout: float | None, there: Callable[[], bool] = lambda: True
    ) -> Any:
        """Return a future's result; ``there`` tells whether who shall give it still is."""
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        until = math.inf if timeout is None else time.monotonic() + timeout
        while not done.wait(max(0.0, min(LOOK, until - time.monotonic()))):
            if time.monotonic() >= until:
                raise TimeoutError(f'{self.node_name} did not answer within {timeout:g} s')
            if not there():
                raise TimeoutError(f'{self.node_name} has ended, or is out of reach')
        return future.result()

    def _take_state(self, axis: str, message: AxisState) -> None:
        with self._changed:
            self._states[axis] = message
            self._changed.notify_all()


Info = Mapping[str, int]  # what the middleware tells of a message


class Recorder:
    """Fills a course from the topics of one axis; the times are those of publishing."""

    def __init__(self, client: HomingClient, axis: str, joint: str) -> None:
        self.course = Course()
        self._client, self._axis, self._joint = client, axis, joint
        self._begun = time.time_ns()
        self._feedback = 0.0
        self._levels: dict[Input, bool] = {}
        node, name = client.node, client.node_name

        self._subscriptions = [
            node.create_subscription(
                JointTrajectory, f'{name}/setpoints', self._take_setpoint, 100
            ),
            node.create_subscription(JointState, 'joint_states', self._take_feedback, BEST_EFFORT),
        ]
        for source in Input:
            if source is not Input.SERVO_ENABLED:
                self._subscriptions.append(
                    node.create_subscription(
                        Float64 if source in LATCHES else Bool,
                        f'{name}/{axis}/{source}',
                        self._input_taker(source),
                        100,
                    )
                )

    def close(self) -> None:
        """Stop recording."""
        for subscription in self._subscriptions:
            self._client.node.destroy_subscription(subscription)

    def _time(self, info: Info) -> float:
        return (info['source_timestamp'] - self._begun) * 1e-9

    def _take_setpoint(self, message: JointTrajectory, info: Info) -> None:
        if self._joint not in message.joint_names:
            return
        index, point = message.joint_names.index(self._joint), message.points[0]
        state = self._client.state(self._axis).state
        if state != State.Idle:
            self.course.samples.append(
                Sample(
                    self._time(info),
                    state,
                    point.positions[index],
                    point.velocities[index],
                    point.accelerations[index],
                    self._feedback,
                )
            )

    def _take_feedback(self, message: JointState) -> None:
        if self._joint in message.name:
            self._feedback = message.position[message.name.index(self._joint)]

    def _input_taker(self, source: Input) -> Callable[[Any, Info], None]:
        def take(message: Bool | Float64, info: Info) -> None:
            value = message.data
            latched = source in LATCHES
            if not latched:
                before, self._levels[source] = self._levels.get(source, value), value
                if before == value:
                    return
            self.course.happenings.append(
                Happening(
                    self._time(info), str(source), value, value if latched else self._feedback
                )
            )

        return take
