# SPDX-License-Identifier: Apache-2.0
"""Listens to a running homing node for `homing record`: setpoints, feedback, inputs and states.

Topics and parameters are found through the graph and the parameter service. All is polled, and
nothing is published.
"""

import os
import time
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, BinaryIO

import rclpy
from homing_interfaces.msg import AxisState
from rcl_interfaces.msg import ParameterEvent
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import parameter_value_to_python
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ..language.cdr import Broken
from ..language.expression import BadExpression
from ..language.reader import Missing, NotMine, Reader
from ..language.resolve import bind
from ..parameters import yaml_file
from ..parameters.configuration import AXIS_DEFINITIONS, Configuration
from ..parameters.connections import FEEDBACK
from ..parameters.node_fields import NODE_DEFINITIONS
from ..procedures.states import LATCHES, State
from ..recording.heard import Described, Heard, HeardRuns, Said
from ..recording.run_file import (
    AXIS_STATE,
    BOOL,
    FLOAT64,
    JOINT_STATE,
    JOINT_TRAJECTORY,
    mirrored,
)
from ..version import version
from . import graph, message_types, messages
from .asking import Parameters, configuration_of
from .configured_node import OF_SEVERAL
from .polling import Polled, Take, never_called, taker, waiting
from .record_messages import RecordMessages
from .serialized import NS
from .subscriptions import qos
from .wired_input import default_value

#: How often the graph is searched for publishers that are new, s.
LOOK_PERIOD = 0.5
#: How many messages of a topic wait for a poll.
DEPTH = 1000
#: A level that does not change is written so often, ns.
REPEAT = 100_000_000
PARAMETER_EVENTS = '/parameter_events'
#: How long to look for the setpoints of the node, s.
PATIENCE = 2.0
#: What a message says of an input that it does not tell.
UNSAID = Missing, NotMine

#: Takes a message of a topic: CDR, and when it has arrived, ns.
Use = Callable[[bytes, int], None]


class Listener:
    """A node in a context of its own that hands what it hears to a record."""

    def __init__(self, target: str) -> None:
        """Join the graph.

        Args:
            target: The full name of the homing node.
        """
        self.target = target
        self.checked: Configuration | None = None
        self.heard = time.monotonic()  # when the newest state arrived
        self.states: dict[str, int] = {}  # by axis: how many were heard
        self._values: dict[str, Any] = {}
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node(
            f'homing_record_{os.getpid()}',
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._group = Polled()
        self._messages = RecordMessages()
        self._wanted: list[tuple[str, Callable[[str], list[Use]]]] = []  # topics not heard yet
        self._takes: list[tuple[Take, list[Use]]] = []
        self._looked = 0.0
        self._keep: list[Any] = []

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def nodes(self) -> list[str]:
        """Return the full names of the homing nodes and coordinators that are in reach now."""
        return graph.homing_nodes(self._node)

    def is_there(self) -> bool:
        """Return whether the homing node is in reach now, with its name and its action."""
        return self._is_named() and self.target in self.nodes()

    def ask(self, patience: float) -> bool:
        """Read the parameters of the node; return whether it has answered.

        Raises:
            IsCoordinator: It is a coordinator.
            InvalidParameters: It is no homing node, or its parameters contradict each other.
        """
        asked = Parameters(self._node, self.target, lambda _: True, patience)
        while not asked.poll():
            self._executor.spin_once(timeout_sec=0.02)
        if asked.values is None:
            return False
        self._values = asked.values
        self.checked = configuration_of(self._values)
        return True

    def record(self, file: BinaryIO, axes: Collection[str]) -> HeardRuns:
        """Begin to listen; return the record of the runs of some axes."""
        assert self.checked is not None
        made_by = version()

        def describe() -> Iterator[Described]:
            for axis in axes:
                values = self._of_axis(axis)
                yield Described(axis, self._about(axis, made_by), values)

        runs = HeardRuns(file, self.target, made_by, describe, self._messages)
        for axis in axes:
            topic = f'{self.target}/{axis}/state'
            self._want(topic, self._state_use(runs, axis, topic))
        self._want(PARAMETER_EVENTS, self._parameters_changed)
        self._want_setpoints(runs)
        self._want_inputs(runs, axes)
        return runs

    def poll(self) -> None:
        """Take what has arrived.

        Raises:
            OSError: The file of the record cannot be written.
        """
        now = time.monotonic()
        if now - self._looked > LOOK_PERIOD:
            self._looked = now
            self._look()
        for take, uses in self._takes:
            for data, info in waiting(take):
                for use in uses:
                    use(data, info['received_timestamp'])

    # ------------------------------------------------------------------------------ what is heard

    def _want(self, topic: str, *uses: Use) -> None:
        self._wanted.append((topic, lambda _: list(uses)))

    def _look(self) -> None:
        """Subscribe to the topics that have a publisher now, with the QoS that it offers."""
        left = []
        for topic, uses_of in self._wanted:
            offers = graph.publishers(self._node, topic)
            if not offers:
                left.append((topic, uses_of))
                continue
            kind = offers[0].kind
            try:
                kind_class, uses = message_types.message_class(kind), uses_of(kind)
            except (LookupError, BadExpression):  # not installed here, or none that fits
                continue
            profile = qos(
                all(one.reliable for one in offers), all(one.latched for one in offers), DEPTH
            )
            subscription = self._node.create_subscription(
                kind_class, topic, never_called, profile, callback_group=self._group
            )
            self._keep.append(subscription)
            self._takes.append((taker(subscription, True), uses))
        self._wanted = left

    def _state_use(self, runs: HeardRuns, axis: str, topic: str) -> Use:
        def use(data: bytes, arrived: int) -> None:
            message = deserialize_message(data, AxisState)
            stamp = message.header.stamp
            said = Said(
                axis,
                stamp.sec * NS + stamp.nanosec,
                message.state == State.Idle,
                message.error,
            )
            self.heard = time.monotonic()
            self.states[axis] = self.states.get(axis, 0) + 1
            runs.state(Heard(topic, AXIS_STATE, arrived, data), said)

        return use

    def _parameters_changed(self, data: bytes, _: int) -> None:
        event = deserialize_message(data, ParameterEvent)
        if event.node == self.target:
            for one in (*event.new_parameters, *event.changed_parameters):
                self._values[one.name] = parameter_value_to_python(one.value)

    def _want_setpoints(self, runs: HeardRuns) -> None:
        checked = self.checked
        assert checked is not None
        interface = str(checked.setpoint_interface)
        topic = self._published(graph.SETPOINT_TYPES[interface]) or graph.expand(
            f'~/{graph.SETPOINT_TOPICS[interface]}', self.target
        )
        if interface == 'trajectory':
            self._want(topic, lambda data, at: runs.take(Heard(topic, JOINT_TRAJECTORY, at, data)))
            return
        kind = message_types.message_class(graph.SETPOINT_TYPES[interface])
        name = f'{self.target}/setpoints'
        due = round((checked.lead + 1.0 / checked.update_rate) * NS)

        def use(data: bytes, at: int) -> None:
            message = deserialize_message(data, kind)
            made = trajectory_of(message, checked.position_joints, due)
            runs.take(Heard(name, JOINT_TRAJECTORY, at, self._messages.serialized(made)))

        self._want(topic, use)

    def _want_inputs(self, runs: HeardRuns, axes: Collection[str]) -> None:
        """Want the feedback and all inputs; a topic that several come from is heard once."""
        checked = self.checked
        assert checked is not None
        common = graph.expand('joint_states', self.target)
        by_topic: dict[str, list[tuple[str, str]]] = {}
        drives = {
            name: p
            for axis in axes
            for name, p in {axis: checked.axes[axis], **checked.followers.get(axis, {})}.items()
        }
        for name, p in drives.items():
            connections = checked.connections[name]
            own = [FEEDBACK] if FEEDBACK in connections.sources else []
            for source in [*map(str, p.inputs), *own]:
                topic = graph.expand(connections.source(name, source).topic, self.target)
                by_topic.setdefault(topic, []).append((name, source))
        subscribed = self._subscribed(JOINT_STATE) - set(by_topic)
        common = common if common in subscribed else next(iter(sorted(subscribed)), common)
        for topic, places in by_topic.items():
            self._wanted.append(
                (topic, lambda kind, places=places: self._uses(runs, kind, places, common))
            )
        if any(FEEDBACK not in checked.connections[name].sources for name in drives):
            self._want(common, lambda data, at: runs.take(Heard(common, JOINT_STATE, at, data)))

    def _uses(
        self, runs: HeardRuns, kind: str, places: list[tuple[str, str]], common: str
    ) -> list[Use]:
        """Return what takes the messages of a topic that inputs come from.

        Raises:
            BadExpression: The type of the topic does not fit what the parameters say.
        """
        checked = self.checked
        assert checked is not None
        layout = message_types.layout(kind)
        uses = []
        for drive, source in places:
            joint = checked.joints[drive] if source == FEEDBACK else ''
            bound = bind(
                checked.connections[drive].source(drive, source),
                layout,
                default_value(layout.names, joint),
            )
            path = drive.replace('.', '/')
            name = common if joint else f'{self.target}/{path}/{source}'
            reader = Reader(layout, [bound])
            uses.append(_InputUse(runs, reader, name, source, joint, self._messages))
        return list(uses)

    # ---------------------------------------------------------------------------------- the graph

    def _is_named(self) -> bool:
        """Return whether the graph knows the node by its name: its services may come first."""
        names = self._node.get_node_names_and_namespaces()
        return self.target in [graph.full_name(namespace, name) for name, namespace in names]

    def _published(self, kind: str) -> str:
        """Return the topic of a type that the node publishes, '' if none is found."""
        name, namespace = graph.split_name(self.target)
        until = time.monotonic() + PATIENCE
        while self._is_named() and time.monotonic() < until:
            found = self._node.get_publisher_names_and_types_by_node(name, namespace)
            for topic, kinds in found:
                if kind in kinds:
                    return str(topic)
            time.sleep(0.02)
        return ''

    def _subscribed(self, kind: str) -> set[str]:
        name, namespace = graph.split_name(self.target)
        if not self._is_named():
            return set()
        found = self._node.get_subscriber_names_and_types_by_node(name, namespace)
        return {topic for topic, kinds in found if kind in kinds}

    # ----------------------------------------------------------------------------- the parameters

    def _about(self, axis: str, version: str) -> dict[str, str]:
        assert self.checked is not None
        p = self.checked.axes[axis]
        return {
            'version': version,
            'node': self.target,
            'axis': axis,
            'joint': p.joint or axis,
            'unit': str(p.unit),
            'home_type': str(self._values.get(f'{axis}.home_type', p.home_type)),
            **mirrored(p, self.checked.followers.get(axis, {})),
        }

    def _of_axis(self, axis: str) -> str:
        """Return the parameters of an axis that differ from their defaults, as a file."""
        return yaml_file.written(self.target, values_of(axis, self._values))


class _InputUse:
    """Takes the messages that an input, or the feedback of an axis, comes from."""

    def __init__(
        self,
        runs: HeardRuns,
        reader: Reader,
        topic: str,
        source: str,
        joint: str,
        made: RecordMessages,
    ) -> None:
        self._runs, self._reader, self._topic, self._joint = runs, reader, topic, joint
        self._made = made
        self._latch = source in LATCHES
        self._last: tuple[bool | None, int] = None, 0  # the level, and when it was written
        self._counter: Any = None

    def __call__(self, data: bytes, at: int) -> None:
        try:
            reading = self._reader.read(data)
        except Broken:
            return
        (value,), (counter,) = reading.values, reading.counters
        if isinstance(value, UNSAID) or isinstance(counter, UNSAID):
            return
        if self._joint:
            stamp = messages.to_stamp(reading.stamp)
            message = JointState(name=[self._joint], position=[float(value)])
            message.header.stamp = stamp
            self._take(JOINT_STATE, at, self._made.serialized(message))
        elif self._latch:
            before, self._counter = self._counter, counter
            if counter is None or before not in (None, counter):
                self._take(FLOAT64, at, self._made.latched.one(value))
        elif (level := value >= 0.5) is not self._last[0] or at > self._last[1] + REPEAT:
            self._last = level, at
            self._take(BOOL, at, self._made.level.one(level))

    def _take(self, kind: str, at: int, data: bytes) -> None:
        self._runs.take(Heard(self._topic, kind, at, data))


def trajectory_of(message: Any, joints: Collection[str], due: int) -> JointTrajectory:
    """Return a trajectory of one point that says what an array of positions says.

    Args:
        message: A Float64MultiArray, or a MultiDOFCommand.
        joints: The joints of the array.
        due: How long after the message the joints shall be there, ns.
    """
    by_name = hasattr(message, 'dof_names')
    point = JointTrajectoryPoint(
        positions=message.values if by_name else message.data,
        velocities=message.values_dot if by_name else [],
    )
    point.time_from_start.sec, point.time_from_start.nanosec = divmod(due, NS)
    return JointTrajectory(
        joint_names=list(message.dof_names if by_name else joints), points=[point]
    )


def values_of(axis: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return what a node that has one axis alone would have, of the parameters of a node.

    Those that have their default are left out.
    """
    found: dict[str, Any] = {'axes': [axis]}
    for name, value in values.items():
        if name.startswith(f'{axis}.'):
            definition = AXIS_DEFINITIONS.get(name.removeprefix(f'{axis}.'))
        else:
            definition = None if name in OF_SEVERAL else NODE_DEFINITIONS.get(name)
            if definition is None:
                continue
        plain = list(value) if not isinstance(value, str) and hasattr(value, '__len__') else value
        if definition is None or plain != messages.plain(definition.initial):
            found[name] = plain
    return found
