# SPDX-License-Identifier: Apache-2.0
"""The two messages of every cycle in their serialized form, without message objects in between.

An object and its conversion cost several times as much as all else that is done with the values.
Source: OMG DDS-XTypes 1.3, 7.4.1 (a number of n bytes lies at a multiple of n, counted from behind
the first four).
"""

import struct
from collections.abc import Iterable

from builtin_interfaces.msg import Duration
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

NS = 1_000_000_000
#: How a message in plain CDR of little endian byte order begins, and numbers in it.
LITTLE_ENDIAN = b'\x00\x01'
STAMP, LENGTH = struct.Struct('<iI'), struct.Struct('<I')
#: A number that no name contains the bytes of: where it stands first, the positions begin.
MARK = 1.0


class JointStateReader:
    """Reads joint states. Names are the same from one message to the next, and read once."""

    def __init__(self) -> None:
        self._head = b''  # from the length of frame_id to the number of positions
        self._names: tuple[str, ...] = ()
        self._begin = 0  # where the positions stand
        self._positions = struct.Struct('')

    def read(self, data: bytes) -> tuple[int, tuple[str, ...], tuple[float, ...]] | None:
        """Return the stamp in ns, the names and as many positions, or fewer where they lack.

        None where the message is broken.
        """
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
    """Return a text and where the next number of four bytes stands."""
    (length,) = LENGTH.unpack_from(data, at)
    end = at + 4 + length
    return data[at + 4 : end - 1].decode(errors='replace'), end + -end % 4


class TrajectoryWriter:
    """Writes trajectories of one point a period ahead; their stamp is 0: now.

    The middleware writes what stays from one to the next, and tells where the numbers stand.
    """

    def __init__(self, period: float) -> None:
        nanoseconds = round(period * NS)
        self._ahead = Duration(sec=nanoseconds // NS, nanosec=nanoseconds % NS)
        self._names: list[str] = []
        self._data = bytearray()
        self._begin = 0
        self._numbers = struct.Struct('')

    def write(self, names: list[str], setpoints: Iterable[tuple[float, float, float]]) -> bytes:
        """Return the message with each joint's position, velocity and acceleration, SI."""
        count = len(names)
        if names != self._names:
            self._write_frame(names)
        positions, velocities, accelerations = zip(*setpoints, strict=True)
        self._numbers.pack_into(
            self._data, self._begin, *positions, count, *velocities, count, *accelerations
        )
        return bytes(self._data)

    def _write_frame(self, names: list[str]) -> None:
        marks = [MARK] * len(names)
        self._data = bytearray(
            serialize_message(
                JointTrajectory(
                    joint_names=names,
                    points=[
                        JointTrajectoryPoint(
                            positions=marks,
                            velocities=marks,
                            accelerations=marks,
                            time_from_start=self._ahead,
                        )
                    ],
                )
            )
        )
        self._begin = self._data.index(struct.pack('=d', MARK))
        doubles = f'{len(names)}d'
        self._numbers = struct.Struct('=' + 'I4x'.join([doubles] * 3))
        self._names = list(names)
