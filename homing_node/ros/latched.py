# SPDX-License-Identifier: Apache-2.0
"""Latched topics: whoever subscribes later gets what was said last."""

from typing import Any

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile

#: A publisher has two event handlers by default, and the executor looks at each one whenever it
#: wakes; a node with 32 axes has 128 latched topics. Such a topic, which is reliable too, fits
#: the QoS of nearly every subscription; one of another type is told by its own process.
WITHOUT_EVENTS = PublisherEventCallbacks(use_default_callbacks=False)


def latched(depth: int = 1) -> QoSProfile:
    """Return the QoS of a latched topic."""
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def latched_publisher(node: Node, kind: Any, topic: str) -> Any:
    """Return the publisher of a latched topic."""
    return node.create_publisher(kind, topic, latched(), event_callbacks=WITHOUT_EVENTS)
