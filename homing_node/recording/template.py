# SPDX-License-Identifier: Apache-2.0
"""Many messages of one type at once: a serialized message whose numbers are replaced."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

NS = 1_000_000_000


class Template:
    """A serialized message, and where its numbers stand in it.

    Attributes:
        size: How long a message is, bytes.
    """

    def __init__(self, data: bytes, places: Mapping[str, tuple[str, int]]) -> None:
        """Keep the message.

        Args:
            data: The message.
            places: The format (of NumPy) and the place of each number, by its name. A stamp has
                the names `sec` and `nanosec`.
        """
        self.size = len(data)
        self._data, self._places = data, places
        self._kinds: dict[tuple[str, ...], np.dtype[Any]] = {}  # by the names of what is in front

    def one(self, value: float) -> bytes:
        """Return the message `data` with a value."""
        return self.copies(1, np.dtype([]), {'data': value}).tobytes()

    def copies(
        self,
        count: int,
        head: np.dtype[Any],
        columns: Mapping[str, ArrayLike],
        stamps: NDArray[np.int64] | None = None,
    ) -> NDArray[Any]:
        """Return messages with these numbers, with room in front of each.

        Args:
            count: How many.
            head: What stands in front of each message; it is zero.
            columns: The numbers of all messages, by name.
            stamps: The stamp of each message, ns; None: the message has none.
        """
        names = head.names or ()
        if names not in self._kinds:
            self._kinds[names] = self._kind_behind(head)
        one = bytes(head.itemsize) + self._data
        made = np.frombuffer(bytearray(one * count), self._kinds[names])
        for name, values in columns.items():
            made[name] = values
        if stamps is not None:
            made['sec'], made['nanosec'] = np.divmod(stamps, NS)
        return made

    def _kind_behind(self, head: np.dtype[Any]) -> np.dtype[Any]:
        places: list[tuple[str, np.dtype[Any], int]] = [
            (name, kind, place) for name, (kind, place, *_) in (head.fields or {}).items()
        ]
        places += [
            (name, np.dtype(kind), head.itemsize + place)
            for name, (kind, place) in self._places.items()
        ]
        names, formats, offsets = zip(*places, strict=True)
        size = head.itemsize + self.size
        return np.dtype({'names': names, 'formats': formats, 'offsets': offsets, 'itemsize': size})
