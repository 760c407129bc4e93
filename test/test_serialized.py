# SPDX-License-Identifier: Apache-2.0
"""Serialized joint states and trajectories, against what rclpy makes of them."""

import math
import struct

import pytest
from builtin_interfaces.msg import Duration, Time
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from homing_node.core.announcement import Row
from homing_node.ros.serialized import (
    JointStateReader,
    PlainJointStateReader,
    PlainTrajectoryWriter,
    TrajectoryWriter,
)

NAMES = st.sampled_from(['x', '', 'joint_1', 'жж', 'a name of some more bytes'])
FINITE = st.floats(allow_nan=False, allow_infinity=False)


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


@pytest.mark.parametrize(
    ('message', 'names', 'positions'),
    [
        (JointState(name=['a', 'b'], position=[1.0, math.inf]), ('a', 'b'), (1.0, math.inf)),
        (JointState(name=['a', 'b'], position=[1.0]), ('a', 'b'), (1.0,)),
        (JointState(name=['a'], position=[1.0, 2.0]), ('a',), (1.0,)),
        (JointState(name=['a'], velocity=[1.0]), ('a',), ()),
        (JointState(), (), ()),
    ],
)
@pytest.mark.parametrize('reader', [JointStateReader, PlainJointStateReader])
def test_positions(reader, message, names, positions):
    message.header.stamp = Time(sec=3, nanosec=5)
    read = reader().read(serialize_message(message))
    assert read == (3_000_000_005, names, positions)


JOINT_STATES = st.builds(
    lambda frame, names, positions, velocities, sec, nanosec: JointState(
        header=Header(frame_id=frame, stamp=Time(sec=sec, nanosec=nanosec)),
        name=names,
        position=positions,
        velocity=velocities,
    ),
    st.sampled_from(['', 'base', 'é']),
    st.lists(NAMES),
    st.lists(FINITE),
    st.lists(st.floats(), max_size=2),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(0, 2**32 - 1),
)


@settings(max_examples=max(1, settings.default.max_examples // 3))
@given(st.lists(JOINT_STATES, max_size=6), st.floats(0.0, 1.0))
def test_joint_states_are_read_as_rclpy_reads_them(messages, part):
    """Whole ones between broken ones, in any order; of a broken one nothing is made up."""
    reader, plain = JointStateReader(), PlainJointStateReader()
    for message in messages:
        data = serialize_message(message)
        names = tuple(message.name)
        expected = ns(message.header.stamp), names, tuple(message.position)[: len(names)]
        assert reader.read(data) == plain.read(data) == expected
        assert plain.read(data[: int(part * len(data))]) in (None, expected)
        assert reader.read(data[: int(part * len(data))]) in (None, expected)
        assert reader.read(data) == expected


def test_a_joint_state_in_the_other_byte_order():
    data = (
        b'\0\0\0\0'
        + struct.pack('>iIIxxxxI', 3, 5, 1, 1)
        + struct.pack('>I2s2xI', 2, b'x\0', 1)
        + struct.pack('>dII', 1.5, 0, 0)
    )
    assert deserialize_message(data, JointState).position[0] == 1.5
    assert JointStateReader().read(data) == (3_000_000_005, ('x',), (1.5,))


NUMBER = st.floats(allow_nan=False) | st.just(1.0)


@st.composite
def trajectories(draw):
    """Return names, a stamp, the times of some points and a row for each."""
    names = draw(st.lists(NAMES, min_size=1, unique=True))
    times = draw(st.lists(st.integers(0, 3 * 10**9), min_size=1, max_size=4))
    one_each = st.lists(NUMBER, min_size=len(names), max_size=len(names))
    rows = [Row(draw(one_each), draw(one_each), draw(one_each)) for _ in times]
    return names, draw(st.integers(0, 2**31 * 10**9 - 1)), times, rows


@settings(max_examples=max(1, settings.default.max_examples // 5))
@given(st.lists(trajectories(), max_size=5))
def test_trajectories_are_written_as_rclpy_writes_them(cycles):
    writer, plain = TrajectoryWriter(), PlainTrajectoryWriter()
    for names, stamp, times, rows in cycles:
        expected = JointTrajectory(
            header=Header(stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9)),
            joint_names=names,
            points=[
                JointTrajectoryPoint(
                    positions=row.positions,
                    velocities=row.velocities,
                    accelerations=row.accelerations,
                    time_from_start=Duration(sec=time // 10**9, nanosec=time % 10**9),
                )
                for time, row in zip(times, rows, strict=True)
            ],
        )
        assert plain.write(names, stamp, times, rows) == expected
        data = writer.write(names, stamp, times, rows)
        assert len(data) == len(serialize_message(expected))
        assert deserialize_message(data, JointTrajectory) == expected


def test_what_was_written_stays():
    writer = TrajectoryWriter()
    first = writer.write(['x'], 1, [0], [Row([1.0], [2.0], [3.0])])
    before = bytes(first)
    writer.write(['x'], 2, [1], [Row([4.0], [5.0], [6.0])])
    assert first == before
