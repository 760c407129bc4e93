# SPDX-License-Identifier: Apache-2.0
"""Serialized joint states and trajectories, against what rclpy makes of them."""

import math
import struct

import pytest
from builtin_interfaces.msg import Duration, Time
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

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


SETPOINTS = st.dictionaries(
    NAMES, st.tuples(*[st.floats(allow_nan=False) | st.just(1.0)] * 3), min_size=1
)


@given(st.sampled_from([0.001, 1 / 300, 1.0, 2.5]), st.lists(SETPOINTS, max_size=6))
def test_trajectories_are_written_as_rclpy_writes_them(period, cycles):
    writer, plain = TrajectoryWriter(period), PlainTrajectoryWriter(period)
    ahead = Duration(sec=int(period), nanosec=round(period % 1.0 * 1e9))
    for setpoints in cycles:
        positions, velocities, accelerations = zip(*setpoints.values(), strict=True)
        expected = JointTrajectory(
            joint_names=list(setpoints),
            points=[
                JointTrajectoryPoint(
                    positions=positions,
                    velocities=velocities,
                    accelerations=accelerations,
                    time_from_start=ahead,
                )
            ],
        )
        assert plain.write(list(setpoints), setpoints.values()) == expected
        data = writer.write(list(setpoints), setpoints.values())
        assert len(data) == len(serialize_message(expected))
        assert deserialize_message(data, JointTrajectory) == expected


def test_what_was_written_stays():
    writer = TrajectoryWriter(0.004)
    first = writer.write(['x'], [(1.0, 2.0, 3.0)])
    before = bytes(first)
    writer.write(['x'], [(4.0, 5.0, 6.0)])
    assert first == before
