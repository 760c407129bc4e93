# SPDX-License-Identifier: Apache-2.0
"""Follows the states of a running homing node, or of a coordinator, for `homing watch`.

The states and the diagnostics are polled: an executor would take more of a core than the node.
"""

import os
import time
from collections.abc import Collection
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from homing_interfaces.msg import AxisState
from rclpy.context import Context
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message

from ..diagnosis.board import Board, Change
from . import graph
from .polling import Polled, Take, never_called, taker, waiting

STATE = 'homing_interfaces/msg/AxisState'
#: How often the graph is searched for axes, s.
LOOK_PERIOD = 0.5


class Watcher:
    """A node in a context of its own that fills a board."""

    def __init__(self, target: str, axes: Collection[str] = ()) -> None:
        """Join the graph.

        Args:
            target: The full name of the homing node.
            axes: The axes to follow; none: all.
        """
        self.target, self._wanted = target, axes
        self.board = Board()
        self.found: set[str] = set()  # all axes whose states are published
        self._context = Context()
        rclpy.init(context=self._context)
        self._node = Node(
            f'homing_watch_{os.getpid()}',
            context=self._context,
            enable_rosout=False,
            start_parameter_services=False,
        )
        self._group = Polled()
        self._states: dict[str, Take] = {}
        self._keep: list[Any] = []
        self._diagnostics = self._subscribe(DiagnosticArray, '/diagnostics', 10)
        self._looked = 0.0

    def close(self) -> None:
        """Leave the graph."""
        self._node.destroy_node()
        self._context.try_shutdown()

    def nodes(self) -> list[str]:
        """Return the full names of the homing nodes and coordinators that are in reach now."""
        return graph.homing_nodes(self._node)

    def poll(self) -> list[Change]:
        """Take what has arrived; return what has changed."""
        now = time.monotonic()
        if now - self._looked > LOOK_PERIOD:
            self._looked = now
            self._look()
        changes: list[Change] = []
        for axis, take in self._states.items():
            for data, _ in waiting(take):
                state = deserialize_message(data, AxisState)
                changes += self.board.take_state(axis, state, now)
        begin = f'{self.target}: '
        for data, _ in waiting(self._diagnostics):
            for status in deserialize_message(data, DiagnosticArray).status:
                if status.name.startswith(begin):
                    values = {one.key: one.value for one in status.values}
                    self.board.take_inputs(status.name.removeprefix(begin), values)
        return changes

    def _look(self) -> None:
        """Subscribe to the states of axes that are new."""
        begin, end = f'{self.target}/', '/state'
        for topic, kinds in self._node.get_topic_names_and_types():
            axis = topic.removeprefix(begin).removesuffix(end)
            if STATE not in kinds or f'{begin}{axis}{end}' != topic:
                continue
            self.found.add(axis)
            if axis not in self._states and (not self._wanted or axis in self._wanted):
                qos = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
                self._states[axis] = self._subscribe(AxisState, topic, qos)

    def _subscribe(self, kind: Any, topic: str, qos: QoSProfile | int) -> Take:
        subscription = self._node.create_subscription(
            kind, topic, never_called, qos, callback_group=self._group
        )
        self._keep.append(subscription)
        return taker(subscription, True)
