# SPDX-License-Identifier: Apache-2.0
"""Who else publishes the setpoints, without a graph."""

from types import SimpleNamespace

import pytest
from rclpy.qos import QoSProfile

from homing_node.core.outcome import Outcome
from homing_node.procedures.states import Error
from homing_node.ros.controllers import Controllers

TOPIC = '/cell1/homing_node/setpoints'


class Graph:
    """A node, the publishers of its setpoints that it sees, and the names of all nodes."""

    def __init__(self, publishers, names):
        self.publishers, self.names = publishers, names

    def create_timer(self, *_, **__):
        return SimpleNamespace(cancel=lambda: None, reset=lambda: None, is_canceled=lambda: True)

    def count_publishers(self, topic):
        assert topic == TOPIC
        return len(self.publishers)

    def get_publishers_info_by_topic(self, topic):
        return [
            SimpleNamespace(
                node_name=name,
                node_namespace='/cell1',
                topic_type='trajectory_msgs/msg/JointTrajectory',
                topic_type_hash=SimpleNamespace(version=0),
                qos_profile=QoSProfile(depth=1),
                endpoint_gid=[number],
            )
            for number, name in enumerate(self.publishers)
        ]

    def get_subscriptions_info_by_topic(self, topic):
        return []

    def get_service_names_and_types(self):
        return []

    def get_node_names_and_namespaces(self):
        return [(name, '/cell1') for name in self.names]

    def get_fully_qualified_name(self):
        return '/cell1/homing_node'


@pytest.mark.parametrize(
    ('publishers', 'names', 'conflict'),
    [
        (['homing_node'], ['homing_node', 'driver'], ''),
        (['homing_node', 'other'], ['homing_node', 'other'], '/cell1/other'),
        (['homing_node', 'homing_node'], ['homing_node', 'homing_node'], '/cell1/homing_node'),
        # A discovery server tells a node nothing of a topic that others publish as it does.
        (['homing_node'], ['homing_node', 'homing_node'], '/cell1/homing_node'),
        (['homing_node'], ['homing_node', 'other'], ''),
    ],
)
def test_who_else_publishes_the_setpoints(publishers, names, conflict):
    lost = []
    controllers = Controllers(
        Graph(publishers, names),
        SimpleNamespace(topic_name=TOPIC),
        setpoints=lambda: None,
        running=lambda: True,
        lost=lost.append,
    )
    controllers.look()
    found = controllers.conflict()
    if not conflict:
        assert found is None
        return
    assert isinstance(found, Outcome)
    assert found.error is Error.PublisherConflict
    assert found.message.startswith(f'{TOPIC} is published by {conflict}, too')
    assert found in lost  # a run that is on ends
