# SPDX-License-Identifier: Apache-2.0
"""The two messages of every cycle, read and written as bytes; and the same with rclpy's objects.

Why bytes: an object and its conversion cost several times as much as all else that is done with
the values. A `JointState` takes 66 µs to take as an object, 17 µs as bytes; a `JointTrajectory` of
eight axes 10 µs to write as an object, 4 µs as bytes (doc/decisions/0007-cycle.md). The parameter
`serialized: false` selects the plain classes, so that a fault can be tried without the bytes.

Source of the format: OMG DDS-XTypes 1.3, 7.4.1 (numbers of n bytes are aligned to n, counted from
the end of the 4-byte header).
"""

import struct
from collections.abc import Sequence
from typing import NamedTuple

from builtin_interfaces.msg import Duration
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from ..core.announcement import Row

NS = 1_000_000_000
#: The first bytes of a message in plain CDR of little endian byte order, and its numbers.
LITTLE_ENDIAN = b'\x00\x01'
STAMP, LENGTH = struct.Struct('<iI'), struct.Struct('<I')
#: Marker whose bytes cannot occur in a name (UTF-8): its first occurrence is the first position.
MARK = 1.0


#: A joint state as read: its stamp in ns, the names, and as many positions, or fewer if the
#: message has fewer.
Read = tuple[int, tuple[str, ...], tuple[float, ...]]


class PlainJointStateReader:
    """Reads joint states with rclpy."""

    def __init__(self) -> None:
        self._names: tuple[str, ...] = ()

    def read(self, data: bytes) -> Read | None:
        """Return what the message says, None if it is broken."""
        try:
            message = deserialize_message(data, JointState)
        except RuntimeError:
            return None
        if list(self._names) != message.name:
            self._names = tuple(message.name)
        stamp = message.header.stamp
        positions = tuple(message.position[: len(self._names)])
        return stamp.sec * NS + stamp.nanosec, self._names, positions


class JointStateReader:
    """Reads joint states from their bytes; names that do not change are read once."""

    def __init__(self) -> None:
        self._head = b''  # from the length of frame_id to the number of positions
        self._names: tuple[str, ...] = ()
        self._begin = 0  # the place of the positions
        self._positions = struct.Struct('')

    def read(self, data: bytes) -> Read | None:
        """Return what the message says, None if it is broken."""
        try:
            if data[:2] != LITTLE_ENDIAN:
                data = serialize_message(deserialize_message(data, JointState))
            seconds, nanoseconds = STAMP.unpack_from(data, 4)
            if not (self._head and data.startswith(self._head, 12)):
                self._read_head(data)
            positions = self._positions.unpack_from(data, self._begin)
        except (RuntimeError, struct.error):
            return None
        return seconds * NS + nanoseconds, self._names, positions

    def _read_head(self, data: bytes) -> None:
        _, at = _text(data, 12)
        (count,) = LENGTH.unpack_from(data, at)
        at += 4
        names = []
        for _ in range(count):
            name, at = _text(data, at)
            names.append(name)
        count = min(LENGTH.unpack_from(data, at)[0], len(names))
        at += 4
        self._names, self._head = tuple(names), data[12:at]
        self._begin = at + (at + 4) % 8
        self._positions = struct.Struct(f'<{count}d')


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Return a text and the place of the next number of four bytes."""
    (length,) = LENGTH.unpack_from(data, at)
    end = at + 4 + length
    return data[at + 4 : end - 1].decode(errors='replace'), end + -end % 4


class PlainTrajectoryWriter:
    """Writes trajectories as message objects."""

    def write(
        self, names: list[str], stamp: int, times: Sequence[int], rows: Sequence[Row]
    ) -> JointTrajectory:
        """Return the message of points with each joint's position, velocity and acceleration.

        Args:
            names: The joints.
            stamp: When the trajectory starts, ns of ROS time; 0: when it is received.
            times: The time of each point from the start, ns.
            rows: The points, SI.
        """
        points = []
        for time, row in zip(times, rows, strict=True):
            points.append(
                JointTrajectoryPoint(
                    positions=row.positions,
                    velocities=row.velocities,
                    accelerations=row.accelerations,
                    time_from_start=Duration(sec=time // NS, nanosec=time % NS),
                )
            )
        message = JointTrajectory(joint_names=names, points=points)
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, NS)
        return message


class TrajectoryWriter:
    """Writes the same trajectories as bytes.

    rclpy serializes the constant part once for each number of points; each cycle packs only the
    numbers.
    """

    def __init__(self) -> None:
        self._names: list[str] = []
        self._frames: dict[int, Frame] = {}  # by the number of points

    def write(
        self, names: list[str], stamp: int, times: Sequence[int], rows: Sequence[Row]
    ) -> bytes:
        """Return the message; the arguments are those of `PlainTrajectoryWriter.write`."""
        if names != self._names:
            self._names, self._frames = list(names), {}
        count, joints = len(times), len(names)
        frame = self._frames.get(count)
        if frame is None:
            frame = self._frames[count] = _frame(names, count)
        numbers: list[float] = []
        for time, (positions, velocities, accelerations) in zip(times, rows, strict=True):
            if numbers:
                numbers.append(joints)
            numbers += positions
            numbers.append(joints)
            numbers += velocities
            numbers.append(joints)
            numbers += accelerations
            numbers += (0, time // NS, time % NS)  # no efforts; time_from_start
        STAMP.pack_into(frame.data, 4, stamp // NS, stamp % NS)
        frame.numbers.pack_into(frame.data, frame.begin, *numbers)
        return bytes(frame.data)


class Frame(NamedTuple):
    """A message with room for its numbers: where they begin, and how they are packed."""

    data: bytearray
    begin: int
    numbers: struct.Struct


def _frame(names: list[str], count: int) -> Frame:
    marks = [MARK] * len(names)
    point = JointTrajectoryPoint(positions=marks, velocities=marks, accelerations=marks)
    message = JointTrajectory(joint_names=names, points=[point] * count)
    data = bytearray(serialize_message(message))
    doubles = f'{len(names)}d'
    one = 'I4x'.join([doubles] * 3) + 'IiI'
    return Frame(
        data, data.index(struct.pack('=d', MARK)), struct.Struct('=' + 'I'.join([one] * count))
    )
