# SPDX-License-Identifier: Apache-2.0
"""Nodes, topics and endpoints as the ROS graph shows them."""

from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from ..diagnosis.facts import Endpoint

#: The service by which a homing node, or a coordinator, is known, and how its name ends.
ACTION, SEND_GOAL = 'homing_interfaces/action/Home_SendGoal', '/home/_action/send_goal'
#: The message type of the setpoints, for each value of `setpoint_interface`.
SETPOINT_TYPES = {
    'trajectory': 'trajectory_msgs/msg/JointTrajectory',
    'position': 'std_msgs/msg/Float64MultiArray',
    'dof': 'control_msgs/msg/MultiDOFCommand',
}
#: The topic of the setpoints, below the node's name.
SETPOINT_TOPICS = {
    'trajectory': 'setpoints',
    'position': 'position_commands',
    'dof': 'dof_commands',
}


def full_name(namespace: str, name: str) -> str:
    """Return the fully qualified name of a node."""
    return f'{namespace.rstrip("/")}/{name}'


def split_name(node: str) -> tuple[str, str]:
    """Return the name and the namespace of a fully qualified name."""
    namespace, _, name = node.rpartition('/')
    return name, namespace or '/'


def node_names(node: Node) -> list[str]:
    """Return the full names of all nodes in reach; a name that two of them have stands twice."""
    return [full_name(place, name) for name, place in node.get_node_names_and_namespaces()]


def publishers(node: Node, topic: str) -> tuple[Endpoint, ...]:
    """Return the publishers of a topic."""
    return tuple(_endpoint(info) for info in node.get_publishers_info_by_topic(topic))


def subscriptions(node: Node, topic: str) -> tuple[Endpoint, ...]:
    """Return the subscriptions of a topic."""
    return tuple(_endpoint(info) for info in node.get_subscriptions_info_by_topic(topic))


def services_of_type(node: Node, kind: str) -> list[str]:
    """Return the names of all services of a type, such as ``std_srvs/srv/Trigger``."""
    return sorted(name for name, kinds in node.get_service_names_and_types() if kind in kinds)


def homing_nodes(node: Node) -> list[str]:
    """Return the full names of all homing nodes and coordinators that are in reach now."""
    names = services_of_type(node, ACTION)
    return [name.removesuffix(SEND_GOAL) for name in names if name.endswith(SEND_GOAL)]


def expand(topic: str, node: str) -> str:
    """Return the full name of a topic as a node with a fully qualified name would have it."""
    if topic.startswith('/'):
        return topic
    if topic.startswith('~/'):
        return f'{node}/{topic[2:]}'
    return f'{node.rpartition("/")[0]}/{topic}'


def _endpoint(info: Any) -> Endpoint:
    qos = info.qos_profile
    return Endpoint(
        full_name(info.node_namespace, info.node_name),
        info.topic_type,
        qos.reliability is not ReliabilityPolicy.BEST_EFFORT,
        qos.durability is DurabilityPolicy.TRANSIENT_LOCAL,
        _definition(info.topic_type_hash),
    )


def _definition(type_hash: Any) -> str:
    """Return the hash of a type's definition, '' where the endpoint does not tell it."""
    return str(type_hash) if type_hash.version > 0 else ''
