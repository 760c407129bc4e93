# SPDX-License-Identifier: Apache-2.0
"""Subscriptions of the node that the cycle polls, with the QoS that their publishers offer.

`qos_overrides` of the user win over what was adapted. Only the policies that the user has
overridden are handed to rclpy: it declares a parameter for every policy that it is handed, with
the value of the first subscription, and would give that to a later subscription of the topic.
"""

from typing import Any

from rclpy.exceptions import NameValidationException
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions, QoSPolicyKind

from ..diagnosis.facts import Endpoint
from ..parameters.qos import POLICIES
from . import graph
from .polling import Polled, never_called

#: How many messages wait for a poll.
DEPTH = 100


def qos(reliable: bool = True, latched: bool = False, depth: int = DEPTH) -> QoSProfile:
    """Return a QoS profile with two policies chosen."""
    return QoSProfile(
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE),
    )


class Subscriptions:
    """Makes polled subscriptions of a node, and tells what its graph shows of topics."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._group = Polled()

    def resolve(self, topic: str) -> str:
        """Return the full name of a topic, with the remappings of the node.

        Raises ValueError if there can be no such topic.
        """
        try:
            return str(self._node.resolve_topic_name(topic))
        except (RuntimeError, NameValidationException) as error:  # too long
            raise _cannot(topic, error) from None

    def subscribe(
        self, kind: Any, topic: str, profile: QoSProfile, overridable: bool = True
    ) -> Any:
        """Return a subscription; ``overridable``: `qos_overrides` hold for it.

        Raises ValueError if there can be none.
        """
        try:
            prefix = f'qos_overrides.{self.resolve(topic)}.subscription'
            overridden = [
                QoSPolicyKind[policy.upper()]
                for policy in POLICIES
                if overridable and self._node.has_parameter(f'{prefix}.{policy}')
            ]
            return self._node.create_subscription(
                kind,
                topic,
                never_called,
                profile,
                callback_group=self._group,
                qos_overriding_options=QoSOverridingOptions(overridden),
            )
        except (RuntimeError, NameValidationException) as error:  # another type
            raise _cannot(topic, error) from None

    def destroy(self, subscription: Any) -> None:
        """End a subscription."""
        self._node.destroy_subscription(subscription)

    def offers(self, topic: str) -> tuple[Endpoint, ...]:
        """Return the publishers of a topic."""
        return graph.publishers(self._node, topic)

    def count(self, topic: str) -> int:
        """Return how many publishers a topic has, whether a subscription matches them or not."""
        return int(self._node.count_publishers(topic))

    def asked(self, topic: str, kind: str) -> Endpoint | None:
        """Return the node's own subscription of a topic, as the graph shows it."""
        own = self._node.get_fully_qualified_name()
        for one in graph.subscriptions(self._node, topic):
            if one.node == own and one.kind == kind:
                return one
        return None


def _cannot(topic: str, error: Exception) -> ValueError:
    why = str(error).partition('\n')[0].rstrip(':')
    return ValueError(f'cannot subscribe to {topic}: {why}')
