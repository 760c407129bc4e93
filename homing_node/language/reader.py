# SPDX-License-Identifier: Apache-2.0
"""Reads the values of some inputs from the messages of one topic.

Most messages repeat the message before but for their stamp, which a comparison of their bytes
shows. Any other message is walked, and what is wanted is found in it.
"""

import struct
from collections.abc import Sequence
from math import isfinite
from typing import NamedTuple

from .cdr import Broken, Fields, TextArrays
from .layout import Structure
from .resolve import Bound, BoundSource
from .search import NOT_MINE, Missing, NotMine, Said, Wanted

NS = 1_000_000_000
#: A stamp: seconds and nanoseconds, by byte order.
STAMPS = {order: struct.Struct(f'{order}iI') for order in '<>'}


class Reading(NamedTuple):
    """What a message says.

    Attributes:
        stamp: its header's stamp, ns; 0 where it has none.
        values: the number of each input.
        counters: the number of each counter, None where an input has none.
        same: whether all of them are as in the message before.
    """

    stamp: int
    values: Sequence[Said]
    counters: Sequence[Said | None]
    same: bool


class Reader:
    """Reads messages of one type; ``sources`` says what of them."""

    def __init__(self, layout: Structure, sources: Sequence[BoundSource]) -> None:
        self._values = [source.value for source in sources]
        self._counters = [source.counter for source in sources]
        bounds = [*self._values, *filter(None, self._counters)]
        self._wanted = Wanted(bounds)
        self._stamp = _stamp_field(layout)
        last = max((_last_field(bound) for bound in bounds), default=-1)
        self._fields = Fields(layout, 1 + max(last, -1 if self._stamp is None else self._stamp))
        self._texts = TextArrays()
        # The last message: its bytes before and behind the stamp, what unpacks that, what was
        # found, and what was said.
        self._before = self._behind = b''
        self._stamps = STAMPS['<']
        self._found: list[Said] = []
        self._reading: Reading | None = None

    def forget(self) -> None:
        """Take the next message as a new one, whatever it says."""
        self._reading = None

    def read(self, data: bytes) -> Reading:
        """Return what a message says.

        Raises:
            Broken: the bytes are no message of this type.
        """
        begin = len(self._before)
        if self._reading is not None and data.startswith(self._before):
            if self._stamp is None:
                if len(data) == begin:
                    return self._again(0)
            elif data[begin + STAMPS['<'].size :] == self._behind:
                seconds, nanoseconds = self._stamps.unpack_from(data, begin)
                return self._again(seconds * NS + nanoseconds)
        return self._walk(data)

    def _again(self, stamp: int) -> Reading:
        assert self._reading is not None
        return Reading(stamp, self._reading.values, self._reading.counters, True)

    def _walk(self, data: bytes) -> Reading:
        """Walk through a message."""
        walk, places = self._fields.walk(data, self._texts)
        found = self._wanted.find(walk, places)
        stamp, self._before = 0, data
        if self._stamp is not None:
            begin, _ = places[self._stamp][0]
            self._stamps = STAMPS[walk.order]
            seconds, nanoseconds = self._stamps.unpack_from(data, begin)
            stamp = seconds * NS + nanoseconds
            self._before, self._behind = data[:begin], data[begin + self._stamps.size :]
        if self._reading is not None and found == self._found:
            return self._again(stamp)
        self._found, rest = found, iter(found[len(self._values) :])
        self._reading = Reading(
            stamp,
            [_said(*one) for one in zip(self._values, found, strict=False)],
            [None if one is None else _said(one, next(rest)) for one in self._counters],
            False,
        )
        return self._reading


def _said(bound: Bound, number: Said) -> Said:
    """Return a number as it was written: masked, or compared (0 or 1)."""
    if not isinstance(number, int | float):
        return number
    if not isfinite(number):
        return Missing(f'it is {number:g}', unread=True)
    if bound.mask is not None:
        if number != int(number):
            return Missing(f'{number:g} has no bits')
        number = int(number) & bound.mask
    return number if bound.equals is None else number == bound.equals


def _last_field(bound: Bound) -> int:
    """Return the last field of a message that the way to a value needs."""
    first = bound.steps[0]
    return max([first.field, *(key.field for key in (*first.beside, *first.filters))])


def _stamp_field(layout: Structure) -> int | None:
    """Return which field is a header with a stamp, None if there is none."""
    header = layout.field('header')
    if not isinstance(header, Structure) or header.names[:1] != ('stamp',):
        return None
    stamp = header.fields[0]
    if not isinstance(stamp, Structure) or stamp.names != ('sec', 'nanosec'):
        return None
    return layout.names.index('header')


__all__ = ['NOT_MINE', 'Broken', 'Missing', 'NotMine', 'Reader', 'Reading', 'Said']
