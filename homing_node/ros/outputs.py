# SPDX-License-Identifier: Apache-2.0
"""What the node tells a drive besides setpoints: by topics, services and command interfaces.

`servo_on`, `torque_limit` and `arm_latch` of an axis are latched topics. Each may also be called
as a service, or commanded as an interface of a group (gpio_controllers). Whatever way it goes, a
value is told once at the start and then at each change.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node
from std_msgs.msg import Bool, Float64
from std_srvs.srv import SetBool, Trigger

from ..parameters.connections import Calls, Command, Connections, Output
from ..parameters.definition import InvalidParameters
from .latched import latched_publisher
from .message_types import message_class

#: The type of the topics that command interfaces of groups, and of the values of one group.
GROUP_VALUES = 'control_msgs/msg/DynamicInterfaceGroupValues'
INTERFACE_VALUE = 'control_msgs/msg/InterfaceValue'
#: How long the answer of a service may take, s.
PATIENCE = 5.0

TYPES: Mapping[Output, Any] = {
    Output.SERVO_ON: Bool,
    Output.TORQUE_LIMIT: Float64,
    Output.ARM_LATCH: Bool,
}


class Sink:
    """Where one output of an axis goes."""

    def __init__(self, publisher: Any, ways: Iterable[Callable[[float], object]] = ()) -> None:
        """Make a sink; ``ways`` take each value besides the publisher."""
        self._publisher = publisher
        self._ways = tuple(ways)

    def add(self, way: Callable[[float], object]) -> None:
        """Let something else take each value, too."""
        self._ways = (*self._ways, way)

    def publish(self, value: float) -> None:
        """Tell a value; True, False or a number."""
        self._publisher.publish(self._publisher.msg_type(data=value))
        for way in self._ways:
            way(value)


class GroupCommands:
    """Commands interfaces of groups on one topic.

    Each message has all values of this topic: a controller takes only the newest message of a
    cycle. It is sent at each change, and again when a controller joins, for what was sent before
    is not kept for it.
    """

    def __init__(self, node: Node, topic: str) -> None:
        """Make the publisher; raises LookupError where the type is not installed."""
        self._node, self._kind = node, message_class(GROUP_VALUES)
        self._value = message_class(INTERFACE_VALUE)
        self._publisher = node.create_publisher(self._kind, topic, 1)
        self._values: dict[str, dict[str, float]] = {}
        self._listeners = 0
        self._lock = threading.Lock()

    def set(self, command: Command, value: float) -> None:
        """Command an interface; from any thread."""
        with self._lock:
            self._values.setdefault(command.group, {})[command.interface] = float(value)
            self._publish()

    def look(self) -> None:
        """Tell everything again if a controller has joined."""
        before, self._listeners = self._listeners, self._publisher.get_subscription_count()
        if self._listeners > before:
            with self._lock:
                self._publish()

    def _publish(self) -> None:
        if not self._values:
            return
        message = self._kind()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.interface_groups = list(self._values)
        message.interface_values = [
            self._value(interface_names=list(values), values=list(values.values()))
            for values in self._values.values()
        ]
        self._publisher.publish(message)


class ServiceCalls:
    """Calls services when a value changes, one call after the other, in their order.

    While a service is not there, only the newest value waits for it. Everything happens in the
    executor.
    """

    def __init__(self, node: Node, name: str, calls: Calls) -> None:
        """Make the clients; ``name`` stands in the messages of the log."""
        self._logger, self._name = node.get_logger(), name
        group = ReentrantCallbackGroup()

        def client(kind: Any, service: str) -> Any:
            return node.create_client(kind, service, callback_group=group) if service else None

        self._set = client(SetBool, calls.set)
        self._trigger = {True: client(Trigger, calls.true), False: client(Trigger, calls.false)}
        self._waiting: deque[tuple[Any, Any, bool]] = deque()
        self._future: Any = None
        self._until = 0.0

    @property
    def pending(self) -> bool:
        return bool(self._waiting)

    def want(self, value: bool) -> None:
        """Call the services with a value."""
        for client, request in (
            (self._set, SetBool.Request(data=value)),
            (self._trigger[value], Trigger.Request()),
        ):
            if client is None:
                continue
            if self._future is None and self._waiting:  # the service is not there
                self._waiting = deque(one for one in self._waiting if one[0] is not client)
            self._waiting.append((client, request, value))
        self.look()

    def look(self) -> None:
        """Send the next call, if its service is there; give up one that is not answered."""
        if self._future is not None and time.monotonic() > self._until:
            self._future = None
            client, _, value = self._waiting.popleft()
            self._complain(client, value, f'no answer within {PATIENCE:g} s')
        if self._future is None and self._waiting:
            client, request, _ = self._waiting[0]
            if client.service_is_ready():
                self._until = time.monotonic() + PATIENCE
                self._future = client.call_async(request)
                self._future.add_done_callback(self._answered)

    def _answered(self, future: Any) -> None:
        if future is not self._future:
            return  # it was given up
        self._future = None
        client, _, value = self._waiting.popleft()
        answer = future.result()
        if not answer.success:
            self._complain(client, value, f'the answer was no success: {answer.message!r}')
        self.look()

    def _complain(self, client: Any, value: bool, what: str) -> None:
        wanted = str(value).lower()
        self._logger.error(f'{self._name} = {wanted} by {client.srv_name}: {what}')


class Outputs:
    """The outputs of all axes.

    Attributes:
        sinks: Where each output of each axis goes.
    """

    def __init__(
        self,
        node: Node,
        connections: Mapping[str, Connections],
        call: Callable[[Callable[[], object]], None],
    ) -> None:
        """Make the publishers and the clients.

        Args:
            node: The node.
            connections: The connections of each axis.
            call: Lets the executor call a function.

        Raises:
            InvalidParameters: The type of a command is not installed.
        """
        self._call = call
        self._commands: dict[str, GroupCommands] = {}
        self._calls: list[ServiceCalls] = []
        self.sinks: dict[str, dict[Output, Sink]] = {}
        faults: list[str] = []
        for axis, connected in connections.items():
            self.sinks[axis] = {}
            for output, kind in TYPES.items():
                ways: list[Callable[[float], object]] = []
                command, calls = connected.commands.get(output), connected.calls.get(output)
                if command is not None:
                    try:
                        ways.append(self._commanding(node, command, connected.no_torque_limit))
                    except LookupError as error:
                        faults.append(
                            f'{axis}.commands.{output}: the type {GROUP_VALUES} is not installed '
                            f'here: {error}'
                        )
                if calls is not None:
                    one = ServiceCalls(node, f'axis {axis}: {output}', calls)
                    self._calls.append(one)
                    ways.append(partial(self._calling, one))
                topic = f'~/{axis.replace(".", "/")}/{output}'
                publisher = latched_publisher(node, kind, topic)
                self.sinks[axis][output] = Sink(publisher, ways)
                leader = self.sinks.get(axis.partition('.')[0])
                if '.' in axis and leader:  # what the leader is told, its followers are told
                    leader[output].add(self.sinks[axis][output].publish)
        if faults:
            raise InvalidParameters(faults)

    def _commanding(
        self, node: Node, command: Command, no_limit: float
    ) -> Callable[[float], object]:
        """Return what sends a value as a command."""
        topic = node.resolve_topic_name(command.topic)
        if topic not in self._commands:
            self._commands[topic] = GroupCommands(node, topic)
        group = self._commands[topic]

        def send(value: float) -> None:
            is_limit = not isinstance(value, bool)
            group.set(command, (value or no_limit) if is_limit else float(value))

        return send

    def _calling(self, calls: ServiceCalls, value: float) -> None:
        self._call(partial(calls.want, bool(value)))

    @property
    def used(self) -> bool:
        """Whether `look` has anything to do."""
        return bool(self._commands) or any(one.pending for one in self._calls)

    def look(self) -> None:
        """Go on with calls that wait, and with commands for who has joined; in the executor."""
        for calls in self._calls:
            calls.look()
        for commands in self._commands.values():
            commands.look()
