# SPDX-License-Identifier: Apache-2.0
"""Joint states from raw to homed coordinates, as bytes.

The bytes are a `sensor_msgs/JointState` in CDR of little endian byte order (OMG DDS-XTypes 1.3,
7.4.1: numbers of n bytes are aligned to n, counted from the end of the 4-byte header). Names that
do not change are read once. A joint of an axis whose home is not known is left out: a raw position
must not pass for a homed one. Every other bit of a message stays as it is.
"""

import struct
from collections.abc import Callable, Mapping
from typing import NamedTuple

from .known_home import KnownHome

HEADER = 4
LITTLE_ENDIAN = b'\x00\x01'
STAMP, LENGTH = struct.Struct('<iI'), struct.Struct('<I')
#: More lists of joints than publishers can have: the oldest one is forgotten.
MANY_LISTS = 20
#: Messages may come in another order than they were sent in, by up to this many.
REORDERED = 10
#: Where the stamp stands, and what follows it.
STAMPED, AFTER_STAMP = 4, 12


class Layout(NamedTuple):
    """Where the parts of a message stand, for one list of names.

    Attributes:
        head: the bytes after the stamp, up to the first position.
        size: the bytes of the whole message.
        names: the joints.
        begin: where the positions begin.
        numbers: how the positions are packed.
        counts: where the numbers of positions, velocities and efforts stand, and what they are.
        places: the axes, and their places among the names.
    """

    head: bytes
    size: int
    names: tuple[str, ...]
    begin: int
    numbers: struct.Struct
    counts: tuple[tuple[int, int], ...]
    places: tuple[tuple[int, KnownHome], ...]


class JointStates:
    """Turns messages; ``axes`` by joint. ``normal`` turns other encodings into plain CDR."""

    def __init__(
        self, axes: Mapping[str, KnownHome], normal: Callable[[bytes], bytes] = bytes
    ) -> None:
        self._axes, self._normal = axes, normal
        self._layouts: list[Layout] = []  # the newest one first
        self._numbers: dict[tuple[str, ...], int] = {}  # of the last message of each list

    def turn(self, data: bytes, arrival: float, number: int = 0) -> bytes | None:
        """Return a message in homed coordinates, None if it is broken or nothing is left of it.

        Args:
            data: the message.
            arrival: when it arrived, s; its stamp may be of another clock.
            number: its number at its publisher, which counts from the beginning when it restarts.
        """
        try:
            if data[:2] != LITTLE_ENDIAN:
                data = self._normal(data)
            layout = self._find(data)
            if layout is None:
                return None
            positions = layout.numbers.unpack_from(data, layout.begin)
        except (struct.error, UnicodeDecodeError, RuntimeError):
            return None
        seconds, nanoseconds = STAMP.unpack_from(data, STAMPED)
        time = seconds + nanoseconds * 1e-9 if seconds or nanoseconds else arrival
        last = self._numbers.get(layout.names, 0)
        self._numbers[layout.names] = number
        if number + REORDERED < last:
            for _, axis in layout.places:
                axis.new_publisher()
        homed, missing = list(positions), False
        for place, axis in layout.places:
            if place >= len(positions):
                continue
            raw = positions[place]
            axis.feedback(time, raw, arrival)
            offset = axis.offset
            if offset is None:
                missing = True
            elif offset:
                homed[place] = raw - offset
        if missing:
            return self._without(data, layout, homed)
        out = bytearray(data)
        layout.numbers.pack_into(out, layout.begin, *homed)
        return bytes(out)

    def _find(self, data: bytes) -> Layout | None:
        layouts = self._layouts
        for layout in layouts:
            if _fits(layout, data):
                return layout
        read = _read(data, self._axes)
        if read is not None:
            layouts.insert(0, read)
            del layouts[MANY_LISTS:]
        return read

    def _without(self, data: bytes, layout: Layout, homed: list[float]) -> bytes | None:
        """Return a message without the joints whose home is not known."""
        unknown = {place for place, axis in layout.places if axis.offset is None}
        kept = [place for place in range(len(layout.names)) if place not in unknown]
        if not kept:
            return None
        (length,) = LENGTH.unpack_from(data, AFTER_STAMP)
        out = bytearray(data[: AFTER_STAMP + 4 + length])
        _put_length(out, len(kept))
        for place in kept:
            name = layout.names[place].encode() + b'\0'
            _put_length(out, len(name))
            out += name
        for (at, count), values in zip(layout.counts, (homed, None, None), strict=True):
            begin = _aligned(at + 4)
            numbers = values or struct.unpack_from(f'<{count}d', data, begin) if count else ()
            chosen = [numbers[place] for place in kept if place < count]
            _put_length(out, len(chosen))
            if chosen:
                out += bytes((HEADER - len(out)) % 8)
                out += struct.pack(f'<{len(chosen)}d', *chosen)
        return bytes(out)


def _fits(layout: Layout, data: bytes) -> bool:
    return (
        len(data) == layout.size
        and data.startswith(layout.head, AFTER_STAMP)
        and all(LENGTH.unpack_from(data, at)[0] == count for at, count in layout.counts)
    )


def _read(data: bytes, axes: Mapping[str, KnownHome]) -> Layout | None:
    _, at = _text(data, AFTER_STAMP)
    (count,) = LENGTH.unpack_from(data, at)
    at += 4
    names = []
    for _ in range(count):
        name, at = _text(data, at)
        names.append(name)
    counts, begin = [], 0
    for number in range(3):
        (length,) = LENGTH.unpack_from(data, at)
        counts.append((at, length))
        at += 4
        if length:
            at = _aligned(at)
        begin = begin if number else at
        at += 8 * length
        if length not in (0, count) or at > len(data):
            return None
    places = tuple((place, axes[name]) for place, name in enumerate(names) if name in axes)
    numbers = struct.Struct(f'<{counts[0][1]}d')
    head = data[AFTER_STAMP : counts[0][0] + 4]
    return Layout(head, len(data), tuple(names), begin, numbers, tuple(counts), places)


def _aligned(at: int) -> int:
    return at + (HEADER - at) % 8


def _text(data: bytes, at: int) -> tuple[str, int]:
    """Return a text and the place of the next number of four bytes."""
    (length,) = LENGTH.unpack_from(data, at)
    end = at + 4 + length
    if end > len(data):
        raise struct.error('the text is longer than the message')
    return data[at + 4 : end - 1].decode(), end + -end % 4


def _put_length(out: bytearray, length: int) -> None:
    out += bytes(-len(out) % 4)
    out += LENGTH.pack(length)
