# SPDX-License-Identifier: Apache-2.0
"""Collects the facts about a running homing node for `homing doctor`: it asks and listens only.

Everything is found through the graph, the parameter services and the topics; nothing is set, and
nothing is published.
"""

import os
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from ..diagnosis.facts import (
    Controller,
    Facts,
    Heard,
    Manager,
    Sample,
    Setpoints,
    Topic,
)
from ..language.cdr import Broken
from ..language.expression import BadExpression, Source
from ..language.reader import Missing, NotMine, Reader
from ..language.resolve import bind
from ..parameters.configuration import Configuration
from ..parameters.connections import FEEDBACK
from ..procedures.states import Input
from . import graph, managers, message_types
from .asking import Parameters, configuration_of, of_interest
from .managers import ManagerList
from .wired_input import default_value

#: How long an answer may take, s.
PATIENCE = 2.0
#: Whatever a publisher offers, this hears what is published from now on.
LISTEN = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)


class NoSuchNode(Exception):
    """There is no homing node of the name; ``there`` names those that are there."""

    def __init__(self, node: str, there: list[str]) -> None:
        self.there = there
        super().__init__(node)


def examine(
    node: str,
    listen: float = 3.0,
    discovery: float = 5.0,
    lags: Mapping[str, float] | None = None,
) -> Facts:
    """Collect the facts about a homing node.

    Args:
        node: The fully qualified name of the homing node.
        listen: How long to listen to its inputs, s.
        discovery: How long to look for the node, s.
        lags: The lag of each axis's drive, s, as far as it is known.

    Raises:
        NoSuchNode: There is no homing node of this name, or it does not answer.
        IsCoordinator: The node is a coordinator.
        InvalidParameters: The parameters of the node contradict each other.
    """
    doctor = Doctor(node)
    try:
        return doctor.examine(listen, discovery, lags or {})
    finally:
        doctor.close()


@dataclass
class HeardInput:
    """An input of the node, and what was heard of it.

    Attributes:
        topic: the full name of its topic.
        written: what the user wrote for it.
        joint: the joint, if it is feedback.
        messages: the arrival, the sending and the value of each message.
        problem: why the expression does not fit the type.
        missing: why the last message did not say it.
    """

    topic: str
    written: Source
    joint: str = ''
    messages: list[tuple[float, float, float]] = field(default_factory=list)
    problem: str = ''
    missing: str = ''


class Doctor:
    """A node in a context of its own that looks at one homing node."""

    def __init__(self, target: str) -> None:
        self.target = target
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node(
            f'homing_doctor_{os.getpid()}',
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._samples: list[Sample] = []
        self._listening: set[str] = set()

    def close(self) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._node.destroy_node()
        self._context.try_shutdown()

    def examine(self, listen: float, discovery: float, lags: Mapping[str, float]) -> Facts:
        """Collect the facts; see :func:`examine`."""
        if not self._until(self._is_there, discovery):
            raise NoSuchNode(self.target, self._homing_nodes())
        values = self._parameters(self.target, lambda _: True)
        if values is None:
            raise NoSuchNode(self.target, [self.target])
        checked = configuration_of(values)
        setpoints = self._setpoints(checked)
        feedback = self._subscribed_of_type('sensor_msgs/msg/JointState')
        inputs = self._inputs(checked)
        topics: dict[str, list[HeardInput]] = {}
        for one in inputs.values():
            topics.setdefault(one.topic, []).append(one)
        own = {axis: one for (axis, source), one in inputs.items() if source == FEEDBACK}
        elsewhere = {checked.joints[axis] for axis in own}
        until = time.monotonic() + listen

        def over() -> bool:
            self._listen_to_feedback(feedback, elsewhere)
            for topic, of_topic in topics.items():
                self._listen_to(topic, of_topic)
            return time.monotonic() > until

        self._until(over, listen + 1.0)
        controllers, found_managers = self._listeners(setpoints)
        return Facts(
            node=self.target,
            setpoints=setpoints,
            publishers=graph.publishers(self._node, setpoints.topic),
            controllers=controllers,
            feedback=self._topic(
                feedback,
                _heard(
                    [
                        (one.arrival, one.sent, 0.0)
                        for one in self._samples
                        if one.topic == feedback
                    ]
                ),
            ),
            samples=tuple(self._samples),
            inputs={
                (axis, Input(source)): self._topic_of(one)
                for (axis, source), one in inputs.items()
                if source != FEEDBACK
            },
            own_feedback={axis: self._topic_of(one) for axis, one in own.items()},
            managers=found_managers,
            sim_time=bool(values.get('use_sim_time', False)),
            twins=self._names().count(self.target),
            listened=listen,
            lags=lags,
        )

    # ------------------------------------------------------------------------------------ asking

    def _until(self, condition: Callable[[], bool], timeout: float) -> bool:
        """Spin until a condition holds; return whether it does."""
        until = time.monotonic() + timeout
        while not condition():
            if time.monotonic() > until:
                return False
            self._executor.spin_once(timeout_sec=0.02)
        return True

    def _names(self) -> list[str]:
        """Return the full names of all nodes; a name stands there as often as nodes have it."""
        nodes = self._node.get_node_names_and_namespaces()
        return [graph.full_name(namespace, name) for name, namespace in nodes]

    def _is_there(self) -> bool:
        return self.target in self._homing_nodes() and self.target in self._names()

    def _homing_nodes(self) -> list[str]:
        return graph.homing_nodes(self._node)

    def _parameters(self, node: str, wanted: Callable[[str], bool]) -> dict[str, Any] | None:
        reading = Parameters(self._node, node, wanted, PATIENCE)
        self._until(reading.poll, 3 * PATIENCE)
        reading.close()
        return reading.values

    def _setpoints(self, checked: Configuration) -> Setpoints:
        interface = str(checked.setpoint_interface)
        kind = graph.SETPOINT_TYPES[interface]
        name, namespace = graph.split_name(self.target)
        topics: list[str] = []

        def found() -> bool:
            published = self._node.get_publisher_names_and_types_by_node(name, namespace)
            topics.extend(topic for topic, kinds in published if kind in kinds)
            return bool(topics)

        self._until(found, PATIENCE)
        return Setpoints(
            topics[0] if topics else f'{self.target}/{graph.SETPOINT_TOPICS[interface]}',
            interface,
            checked.position_joints,
            {checked.joints[axis]: (axis, p) for axis, p in checked.drives.items()},
            checked.update_rate,
        )

    def _listeners(
        self, setpoints: Setpoints
    ) -> tuple[tuple[Controller, ...], tuple[Manager, ...]]:
        known: dict[str, managers.Known] = {}
        found = []
        for service in managers.services(self._node):
            asked = ManagerList(self._node, service, PATIENCE)
            self._until(asked.poll, PATIENCE + 1.0)
            listed = asked.controllers
            known |= listed or {}
            claims = listed and {
                name: one.claimed for name, one in listed.items() if one.state == 'active'
            }
            found.append(Manager(asked.node, self._parameters(asked.node, of_interest), claims))
        nodes = dict.fromkeys(e.node for e in graph.subscriptions(self._node, setpoints.topic))
        controllers = []
        for node in nodes:
            one = Controller(node, self._parameters(node, of_interest))
            if node in known:
                one = one._replace(state=known[node].state, claimed=known[node].claimed)
            controllers.append(one)
        return tuple(controllers), tuple(found)

    # --------------------------------------------------------------------------------- listening

    def _subscribed(self) -> dict[str, list[str]]:
        name, namespace = graph.split_name(self.target)
        return dict(self._node.get_subscriber_names_and_types_by_node(name, namespace))

    def _subscribed_of_type(self, kind: str) -> str:
        topics: list[str] = []

        def found() -> bool:
            topics.extend(topic for topic, kinds in self._subscribed().items() if kind in kinds)
            return bool(topics)

        self._until(found, PATIENCE)
        return topics[0] if topics else graph.expand('joint_states', self.target)

    def _inputs(self, checked: Configuration) -> dict[tuple[str, str], HeardInput]:
        """Return every wired input, and the feedback of the axes that have their own."""
        found = {}
        for axis, p in checked.drives.items():
            connections = checked.connections[axis]
            own = [FEEDBACK] if FEEDBACK in connections.sources else []
            for source in [*p.inputs, *own]:
                written = connections.source(axis, source)
                topic = graph.expand(written.topic, self.target)
                joint = checked.joints[axis] if source == FEEDBACK else ''
                found[axis, str(source)] = HeardInput(topic, written, joint)
        return found

    def _topic(self, name: str, heard: Heard) -> Topic:
        own = [e for e in graph.subscriptions(self._node, name) if e.node == self.target]
        return Topic(name, graph.publishers(self._node, name), own[0] if own else None, heard)

    def _topic_of(self, one: HeardInput) -> Topic:
        return self._topic(one.topic, _heard(one.messages))._replace(
            expression=one.written.expression, problem=one.problem, missing=one.missing
        )

    def _listen_to_feedback(self, topic: str, elsewhere: Collection[str]) -> None:
        if topic not in self._listening:
            self._listening.add(topic)
            take = partial(self._take_feedback, topic, elsewhere)
            self._node.create_subscription(JointState, topic, take, LISTEN)

    def _listen_to(self, topic: str, inputs: Sequence[HeardInput]) -> None:
        """Subscribe once a publisher shows its type, if that type is installed here."""
        name = f'{topic}#'  # besides the feedback
        if name in self._listening:
            return
        offers = graph.publishers(self._node, topic)
        if not offers:
            return
        self._listening.add(name)
        kind = offers[0].kind
        try:
            layout, kind_class = message_types.layout(kind), message_types.message_class(kind)
        except BadExpression as error:
            for one in inputs:
                one.problem = str(error)
            return
        fitting, bounds = [], []
        for one in inputs:
            default = default_value(layout.names, one.joint)
            try:
                bounds.append(bind(one.written, layout, default))
                fitting.append(one)
            except BadExpression as error:
                one.problem = str(error)
        take = partial(self._take, Reader(layout, bounds), fitting)
        self._node.create_subscription(kind_class, topic, take, LISTEN, raw=True)

    def _take_feedback(
        self, topic: str, elsewhere: Collection[str], message: JointState, info: Mapping[str, int]
    ) -> None:
        """Take the positions, but for the joints whose feedback comes from elsewhere."""
        stamp = message.header.stamp
        positions = zip(message.name, message.position, strict=False)
        self._samples.append(
            Sample(
                info['received_timestamp'] * 1e-9,
                info['source_timestamp'] * 1e-9,
                stamp.sec + stamp.nanosec * 1e-9,
                {name: position for name, position in positions if name not in elsewhere},
                topic,
            )
        )

    def _take(
        self,
        reader: Reader,
        inputs: Sequence[HeardInput],
        data: bytes,
        info: Mapping[str, int],
    ) -> None:
        arrival, sent = info['received_timestamp'] * 1e-9, info['source_timestamp'] * 1e-9
        try:
            reading = reader.read(data)
        except Broken as error:
            for one in inputs:
                one.missing = str(error)
            return
        for one, value in zip(inputs, reading.values, strict=True):
            if isinstance(value, NotMine):
                continue
            one.missing = value.text if isinstance(value, Missing) else ''
            if isinstance(value, Missing):
                continue
            one.messages.append((arrival, sent, float(value)))
            if one.joint:
                positions = {one.joint: float(value)}
                self._samples.append(
                    Sample(arrival, sent, reading.stamp * 1e-9, positions, one.topic)
                )


def _heard(messages: list[tuple[float, float, float]]) -> Heard:
    """Return messages, each its arrival, its sending and its value, as the rules want them."""
    return Heard(*map(tuple, zip(*messages, strict=True))) if messages else Heard()
