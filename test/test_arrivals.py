"""A wait for messages: none is missed, none is waited for where looking finds them."""

import itertools
import threading

import pytest
import rclpy
from rclpy.context import Context
from ros_harness import Domain, wait_for
from std_msgs.msg import Bool

from homing_node import arrivals
from homing_node.arrivals import EMPTY_LOOKS, Arrivals


def never(*_):
    raise AssertionError('nothing is spun here')


class Waiting:
    """Arrivals in a thread, with publishers and subscriptions of their own in a graph."""

    def __init__(self):
        self._domain = Domain()
        self._context = Context()
        rclpy.init(context=self._context, domain_id=self._domain.number)
        self._node = rclpy.create_node('waiting', context=self._context)
        self.arrivals = Arrivals(
            self._context, self._node.create_guard_condition(never))
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self.arrivals.run, args=(self._ended.is_set,))
        self._thread.start()

    def close(self):
        self._ended.set()
        wait_for(lambda: not self._thread.is_alive(), pump=self._disturb)
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)
        self._domain.release()

    def _disturb(self):
        self.arrivals.watch([])
        self.silence()
        self._thread.join(0.01)

    def inputs(self, *topics):
        """Subscribe to topics; return the subscriptions and what publishes to them."""
        subscriptions = [self._node.create_subscription(Bool, topic, never, 10)
                         for topic in topics]
        publishers = [self._node.create_publisher(Bool, topic, 10) for topic in topics]
        for publisher in publishers:
            wait_for(publisher.get_subscription_count)
        return subscriptions, publishers

    def silence(self):
        for _ in range(EMPTY_LOOKS):
            self.arrivals.looked(False)

    def rest(self):
        """Look in vain until it is waited for messages, without any that wakes it."""
        wait_for(lambda: not self.arrivals.expected, pump=self.silence)
        calm = threading.Event()
        while not calm.wait(0.05) and self.arrivals.expected:  # it was still awake
            self.silence()

    def until_expected(self):
        wait_for(lambda: self.arrivals.expected)

    def destroy(self, subscription):
        self._node.destroy_subscription(subscription)

    @property
    def alive(self):
        return self._thread.is_alive()


@pytest.fixture
def waiting(monkeypatch):
    """Nothing but a message ends a wait in time."""
    monkeypatch.setattr(arrivals, 'LONGEST_WAIT', 600.0)
    waiting = Waiting()
    yield waiting
    waiting.close()


def take(subscription):
    return subscription.handle.take_message(Bool, False)


def test_a_message_of_any_of_them_ends_the_wait(waiting):
    subscriptions, publishers = waiting.inputs('a', 'b', 'c')
    waiting.arrivals.watch(subscriptions)
    for subscription, publisher in zip(subscriptions, publishers, strict=True):
        waiting.rest()
        publisher.publish(Bool(data=True))
        waiting.until_expected()
        assert take(subscription) is not None


def test_a_message_that_nobody_took_lets_no_wait_last(waiting):
    subscriptions, publishers = waiting.inputs('a', 'b')
    waiting.arrivals.watch(subscriptions)
    publishers[1].publish(Bool())
    for _ in range(3):
        waiting.silence()
        waiting.until_expected()
    assert take(subscriptions[1]) is not None


def test_looks_that_find_something_go_on(waiting):
    waiting.arrivals.watch([])
    for found in itertools.chain(*[[False] * (EMPTY_LOOKS - 1) + [True]] * 3):
        waiting.arrivals.looked(found)
        assert waiting.arrivals.expected


def test_a_request_looks_during_a_wait(waiting):
    waiting.arrivals.watch([])
    waiting.rest()
    waiting.arrivals.expect()
    assert waiting.arrivals.expected


def test_a_wait_that_is_under_way_learns_of_new_ones(waiting):
    (old, new), (_, publisher) = waiting.inputs('a', 'b')
    waiting.arrivals.watch([old])
    waiting.rest()
    waiting.arrivals.watch([new])
    waiting.destroy(old)
    waiting.rest()
    publisher.publish(Bool())
    waiting.until_expected()
    assert take(new) is not None
    assert waiting.alive


def test_one_that_is_gone_is_not_waited_for(waiting):
    """What cannot be waited for is looked for."""
    (gone,), _ = waiting.inputs('a')
    waiting.destroy(gone)
    waiting.arrivals.watch([gone])
    for _ in range(3):
        waiting.silence()
        waiting.until_expected()
    assert waiting.alive


def test_no_wait_is_long(monkeypatch):
    monkeypatch.setattr(arrivals, 'LONGEST_WAIT', 0.01)
    waiting = Waiting()
    try:
        for _ in range(3):
            waiting.silence()
            waiting.until_expected()
    finally:
        waiting.close()
