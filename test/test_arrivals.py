# SPDX-License-Identifier: Apache-2.0
"""The middleware tells of every message, in one process with a graph of its own."""

import threading

import pytest
import rclpy
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_harness import Domain, wait_for
from std_msgs.msg import Bool, Float64

from homing_node.ros import arrivals
from homing_node.ros.arrivals import Arrivals

LATCHED = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Graph:
    """Publishers, and subscriptions that are watched."""

    def __init__(self):
        self._domain = Domain()
        self._context = Context()
        rclpy.init(context=self._context, domain_id=self._domain.number)
        self.node = rclpy.create_node('inputs', context=self._context)
        self.arrivals = Arrivals()

    def close(self):
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)
        self._domain.release()

    def input(self, topic, kind=Bool, qos=10):
        """Return a publisher, and the subscription to it that is watched."""
        publisher = self.node.create_publisher(kind, topic, qos)
        subscription = self.node.create_subscription(kind, topic, print, qos)
        self.arrivals.watch(subscription)
        wait_for(publisher.get_subscription_count)
        return publisher, subscription

    def until_told(self):
        wait_for(self.arrivals.pending, pump=lambda: None)

    def is_silent(self):
        return not any(self.arrivals.pending() for _ in range(100))


@pytest.fixture
def graph():
    graph = Graph()
    yield graph
    graph.close()


def take(subscription):
    return subscription.handle.take_message(subscription.msg_type, False)


def test_each_message_is_told_of(graph):
    """Nobody looks at anything before he is told, a few hundred times."""
    inputs = [
        graph.input('home_switch'),
        graph.input('z_pulse', Float64),
        graph.input('limit', qos=LATCHED),
    ]
    assert graph.arrivals.pending()  # of what may have come before
    assert graph.is_silent()
    for publisher, subscription in inputs * 100:
        publisher.publish(subscription.msg_type())
        graph.until_told()
        assert take(subscription) is not None
    assert graph.is_silent()


def test_a_burst_is_told_of(graph):
    (one, first), (other, second) = graph.input('a'), graph.input('b')
    graph.arrivals.pending()
    for _ in range(5):
        one.publish(Bool())
        other.publish(Bool())
    found = 0
    while found < 10:
        graph.until_told()
        while take(first) or take(second):
            found += 1
    assert take(first) is take(second) is None


def test_what_came_before_is_told_of(graph):
    publisher = graph.node.create_publisher(Bool, 'a', LATCHED)
    publisher.publish(Bool())
    late = graph.node.create_subscription(Bool, 'a', print, LATCHED)
    graph.arrivals.watch(late)
    graph.arrivals.pending()
    wait_for(lambda: take(late) is not None)


def test_subscriptions_come_and_go_while_messages_come(graph):
    publisher, _ = graph.input('a')
    ended = threading.Event()

    def publish():
        while not ended.is_set():
            publisher.publish(Bool())

    thread = threading.Thread(target=publish)
    thread.start()
    try:
        for _ in range(200):
            subscription = graph.node.create_subscription(Bool, 'a', print, 10)
            graph.arrivals.watch(subscription)
            graph.node.destroy_subscription(subscription)
    finally:
        ended.set()
        thread.join()
    kept = graph.node.create_subscription(Bool, 'a', print, 10)
    graph.arrivals.watch(kept)
    wait_for(lambda: publisher.get_subscription_count() == 2)
    while graph.arrivals.pending():
        pass
    publisher.publish(Bool())
    graph.until_told()


def test_it_is_looked_again_where_that_is_wanted(graph):
    assert graph.is_silent()
    graph.arrivals.expect()
    assert graph.arrivals.pending()
    assert graph.is_silent()


def test_where_the_middleware_tells_of_nothing_it_is_always_looked(graph, monkeypatch):
    monkeypatch.setattr(arrivals, '_tell_of_messages', lambda *_: 3)
    graph.input('a')
    assert all(graph.arrivals.pending() for _ in range(10))
    monkeypatch.undo()
    graph.input('b')  # one that is told of does not make up for it
    assert all(graph.arrivals.pending() for _ in range(10))
