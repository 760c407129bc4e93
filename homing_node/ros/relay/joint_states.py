# SPDX-License-Identifier: Apache-2.0
"""The thread of the relay that turns joint states: it polls, turns bytes, and publishes them.

Nothing else is as quick with rclpy's public calls: an executor that only waits for this one topic
takes longer to wake up, and a message as an object costs several times as much as its bytes
(`bench relay`; doc/decisions/0011-relay.md).
"""

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from ...relay.joint_states import JointStates
from ...relay.known_home import Knowledge, KnownHome
from .. import graph
from ..polling import Polled, never_called, taker, waiting
from ..timebase import wake_precisely

#: How often the thread looks for a message, s.
POLL = 0.0002
#: Messages that wait at most: 2 s at 500 Hz, of a machine that is busy with something else.
DEPTH = 1000
RELIABLE = QoSProfile(depth=DEPTH)
BEST_EFFORT = QoSProfile(depth=DEPTH, reliability=ReliabilityPolicy.BEST_EFFORT)


class JointStateThread:
    """Publishes `~/joint_states` from `joint_states`, at the rate and with the stamps of these."""

    def __init__(
        self,
        node: Node,
        axes: Sequence[KnownHome],
        lock: threading.Lock,
        now: Callable[[], float],
        lost: Callable[[], object],
    ) -> None:
        """Create the topics.

        Args:
            node: The node of the relay.
            axes: Its axes.
            lock: What guards the axes.
            now: Returns the time by which the age of the feedback is judged, s.
            lost: Called when an axis has lost its home, from this thread.
        """
        self._node, self._axes, self._lock, self._now, self._lost = node, axes, lock, now, lost
        self._states = JointStates(
            {axis.joint: axis for axis in axes},
            lambda data: serialize_message(deserialize_message(data, JointState)),
        )
        self._group = Polled()
        self._publisher = node.create_publisher(JointState, '~/joint_states', DEPTH)
        self._reliable = True
        self._subscription = self._subscribe(RELIABLE)
        self._next: Any = None  # replaces the subscription
        self._old: list[Any] = []  # subscriptions that were replaced
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name='joint states')

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._ended.set()
        self._thread.join()

    def watch(self) -> None:
        """Hear publishers that are best effort, too; called by the executor now and then."""
        while self._old:
            self._node.destroy_subscription(self._old.pop())
        topic = self._subscription.topic_name
        if self._reliable and any(not p.reliable for p in graph.publishers(self._node, topic)):
            self._reliable = False
            self._next = self._subscribe(BEST_EFFORT)

    def _subscribe(self, qos: QoSProfile) -> Any:
        return self._node.create_subscription(
            JointState, 'joint_states', never_called, qos, callback_group=self._group
        )

    def _run(self) -> None:
        wake_precisely()
        take = taker(self._subscription, serialized=True)
        while not self._ended.is_set():
            if self._next is not None:
                self._old.append(self._subscription)
                self._subscription, self._next = self._next, None
                take = taker(self._subscription, serialized=True)
            idle = True
            for data, info in waiting(take):
                idle = False
                self._turn(data, info.get('publication_sequence_number', 0))
            if idle:
                time.sleep(POLL)

    def _turn(self, data: bytes, number: int) -> None:
        with self._lock:
            before = self._lost_ones()
            homed = self._states.turn(data, self._now(), number)
            lost = self._lost_ones() > before
        if homed is not None:
            self._publisher.publish(homed)
        if lost:
            self._lost()

    def _lost_ones(self) -> int:
        return sum(axis.knowledge is Knowledge.LostHere for axis in self._axes)
