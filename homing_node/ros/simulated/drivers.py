# SPDX-License-Identifier: Apache-2.0
"""How the drivers of the simulated axes publish: switches, feedback, a second source of it.

Real drivers read their inputs in a loop, publish positions more often than they read them, stamp
them by a clock of their own, or are not the only ones that publish a joint. Each of these is a
parameter of `simulated_axes`, so that users can try what the homing node makes of it.
"""

from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from ...parameters.definition import Definition
from ...plant.drivers import SwitchDriver
from ...plant.layout import SWITCH_RATE, AxisLayout

#: Parts of a second that are rounding, s.
ROUNDING = 1e-9
#: The name of the node that publishes the joints once more.
SECOND_SOURCE = 'second_source'

#: The parameters of the drivers.
DEFINITIONS: Sequence[Definition] = (
    replace(SWITCH_RATE, default=0.0),
    Definition(
        'part of its period by which a message of a switch may come earlier or later',
        float,
        '',
        0.0,
        0.9,
        name='switch_jitter',
        default=0.0,
    ),
    Definition(
        'time after which a switch that is published on change repeats its level (0: never)',
        float,
        's',
        0.001,
        3600.0,
        or_zero=True,
        name='switch_heartbeat',
        default=0.0,
    ),
    Definition(
        'rate at which the driver reads the positions (0: for each message)',
        float,
        'Hz',
        0.1,
        5000.0,
        or_zero=True,
        name='feedback_read_rate',
        default=0.0,
    ),
    Definition(
        'how far the clock of the header stamps of joint_states is ahead',
        float,
        's',
        -1e6,
        1e6,
        name='header_clock_offset',
        default=0.0,
    ),
    Definition(
        'rate at which a second node publishes all joints on joint_states (0: there is none)',
        float,
        'Hz',
        0.1,
        1000.0,
        or_zero=True,
        name='second_source',
        default=0.0,
    ),
    Definition(
        'the position that the second node publishes for every joint',
        float,
        'm or rad',
        -1e6,
        1e6,
        name='second_source_position',
        default=0.0,
    ),
)


def contradictions(values: Mapping[str, Any], layouts: Mapping[str, AxisLayout]) -> Iterator[str]:
    """Yield what is wrong with parameters of the drivers that are good one by one."""
    heartbeat = values.get('switch_heartbeat')
    for name, layout in layouts.items():
        rate = layout.switch_rate
        if heartbeat and rate:
            yield (
                f'switch_heartbeat: {heartbeat:g} s, but the switches of axis {name} are read at '
                f'{rate:g} Hz (switch_rate): a polled switch has no heartbeat'
            )


def switch_driver(
    name: str, level: bool, rate: float, heartbeat: float, jitter: float
) -> SwitchDriver:
    """Return the driver of a switch whose level is known at time 0.

    Args:
        name: of the switch, from which its phase and its jitter come.
        level: the level at time 0.
        rate: how often it is read and published, Hz; 0: it is published on change.
        heartbeat: after which time its level is repeated, s; 0: never.
        jitter: by which part of itself a period may be longer or shorter.
    """
    driver = SwitchDriver(level, 1.0 / rate if rate else heartbeat, rate > 0.0, jitter, name)
    for _ in driver.past():
        pass
    return driver


class FeedbackDriver:
    """Reads the positions, perhaps less often than they are published.

    ``offset`` is how far the clock of its headers is ahead, ns.
    """

    def __init__(self, read_rate: float, clock_offset: float) -> None:
        self.offset = round(clock_offset * 1e9)
        self._period = 1.0 / read_rate if read_rate else 0.0
        self._due = 0.0
        self._newest: tuple[array[float], array[float]] | None = None

    def reading(
        self, time: float, position: 'array[float]', velocity: 'array[float]'
    ) -> tuple['array[float]', 'array[float]']:
        """Return the newest reading at a time, which may be older than the true values."""
        if not self._period:
            return position, velocity
        if self._newest is None or time >= self._due - ROUNDING:
            self._newest = position, velocity
            self._due += self._period * (1 + int((time - self._due + ROUNDING) / self._period))
        return self._newest


class SecondSource:
    """Another node that publishes the same joints, at a fixed position."""

    def __init__(self, node: Node, joints: Sequence[str], rate: float, position: float) -> None:
        """Create the node.

        Args:
            node: the node of the simulated axes, whose namespace and topic the other one has.
            joints: their names.
            rate: of its messages, Hz.
            position: of every joint, m or rad.
        """
        self._period = 1.0 / rate
        self._due = 0.0
        self._node = rclpy.create_node(
            SECOND_SOURCE,
            namespace=node.get_namespace(),
            context=node.context,
            use_global_arguments=False,
            start_parameter_services=False,
        )
        self._publisher = self._node.create_publisher(
            JointState, node.resolve_topic_name('joint_states'), QoSProfile(depth=10)
        )
        self._message = JointState(name=list(joints), position=[position] * len(joints))

    def step(self, time: float, system: int) -> None:
        """Publish if a message is due at a time, s; ``system`` is the system time, ns."""
        if time < self._due:
            return
        self._due = max(self._due, time - self._period) + self._period
        stamp = self._message.header.stamp
        stamp.sec, stamp.nanosec = divmod(system, 1_000_000_000)
        self._publisher.publish(self._message)

    def close(self) -> None:
        self._node.destroy_node()
