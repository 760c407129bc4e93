# SPDX-License-Identifier: Apache-2.0
"""Collects the facts about a running homing node for `homing doctor`: it asks and listens only.

Everything is found through the graph, the parameter services and the topics; nothing is set, and
nothing is published.
"""

import os
import time
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from typing import Any

import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState

from ..diagnosis.facts import (
    Controller,
    Endpoint,
    Facts,
    Heard,
    Manager,
    Sample,
    Setpoints,
    Topic,
)
from ..parameters.configuration import Configuration, configuration
from ..procedures.states import Input
from . import graph, managers
from .asking import Parameters, of_interest
from .managers import ManagerList

#: The service by which a homing node is known.
ACTION = 'homing_interfaces/action/Home_SendGoal'
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
        InvalidParameters: The parameters of the node contradict each other.
    """
    doctor = Doctor(node)
    try:
        return doctor.examine(listen, discovery, lags or {})
    finally:
        doctor.close()


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
        self._heard: dict[str, list[tuple[float, float, float]]] = {}
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
        checked = configuration(values)
        setpoints = self._setpoints(checked)
        feedback = self._subscribed_of_type('sensor_msgs/msg/JointState')
        inputs = self._inputs(checked)
        until = time.monotonic() + listen

        def over() -> bool:
            self._listen_to_feedback(feedback)
            for topic in inputs.values():
                self._listen_to_input(topic)
            return time.monotonic() > until

        self._until(over, listen + 1.0)
        controllers, found_managers = self._listeners(setpoints)
        return Facts(
            node=self.target,
            setpoints=setpoints,
            publishers=graph.publishers(self._node, setpoints.topic),
            controllers=controllers,
            feedback=self._topic(
                feedback, _heard([(one.arrival, one.sent, 0.0) for one in self._samples])
            ),
            samples=tuple(self._samples),
            inputs={
                key: self._topic(topic, _heard(self._heard.get(topic, [])))
                for key, topic in inputs.items()
            },
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
        ending = '/home/_action/send_goal'
        return [
            name.removesuffix(ending)
            for name in graph.services_of_type(self._node, ACTION)
            if name.endswith(ending)
        ]

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
            {checked.joints[axis]: (axis, p) for axis, p in checked.axes.items()},
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

    def _inputs(self, checked: Configuration) -> dict[tuple[str, Input], str]:
        return {
            (axis, source): graph.expand(
                (checked.topics[axis].get(source) or f'~/{axis}/{source}').partition('#')[0],
                self.target,
            )
            for axis, p in checked.axes.items()
            for source in p.inputs
        }

    def _topic(self, name: str, heard: Heard) -> Topic:
        own = [e for e in graph.subscriptions(self._node, name) if e.node == self.target]
        return Topic(name, graph.publishers(self._node, name), own[0] if own else None, heard)

    def _listen_to_feedback(self, topic: str) -> None:
        if topic not in self._listening:
            self._listening.add(topic)
            self._node.create_subscription(JointState, topic, self._take_feedback, LISTEN)

    def _listen_to_input(self, topic: str) -> None:
        """Subscribe once a publisher shows its type, if that type is installed here."""
        if topic in self._listening:
            return
        offers = graph.publishers(self._node, topic)
        kind = _message_type(offers)
        if offers:
            self._listening.add(topic)
        if kind is not None:
            self._heard[topic] = []
            self._node.create_subscription(kind, topic, partial(self._take, topic), LISTEN)

    def _take_feedback(self, message: JointState, info: Mapping[str, int]) -> None:
        stamp = message.header.stamp
        self._samples.append(
            Sample(
                info['received_timestamp'] * 1e-9,
                info['source_timestamp'] * 1e-9,
                stamp.sec + stamp.nanosec * 1e-9,
                dict(zip(message.name, message.position, strict=False)),
            )
        )

    def _take(self, topic: str, message: Any, info: Mapping[str, int]) -> None:
        value = getattr(message, 'data', 0.0)
        self._heard[topic].append(
            (
                info['received_timestamp'] * 1e-9,
                info['source_timestamp'] * 1e-9,
                float(value) if isinstance(value, bool | int | float) else 0.0,
            )
        )


def _heard(messages: list[tuple[float, float, float]]) -> Heard:
    """Return messages, each its arrival, its sending and its value, as the rules want them."""
    return Heard(*map(tuple, zip(*messages, strict=True))) if messages else Heard()


def _message_type(offers: tuple[Endpoint, ...]) -> Any:
    """Return the class of the messages that publishers offer, None where it is not installed."""
    for offer in offers:
        package, _, name = offer.kind.partition('/msg/')
        try:
            return getattr(import_module(f'{package}.msg'), name)
        except (ImportError, AttributeError):
            continue
    return None
