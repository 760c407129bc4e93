# SPDX-License-Identifier: Apache-2.0
"""Many messages of one type at once: a serialized message whose numbers are replaced."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

NS = 1_000_000_000


class Template:
    """A serialized message, and where its numbers stand in it."""

    def __init__(self, data: bytes, places: Mapping[str, tuple[str, int]]) -> None:
        """Keep the message.

        Args:
            data: The message.
            places: The format (of NumPy) and the place of each number, by its name. A stamp has
                the names `sec` and `nanosec`.
        """
        self._data = data
        self._kind = np.dtype(
            {
                'names': list(places),
                'formats': [kind for kind, _ in places.values()],
                'offsets': [place for _, place in places.values()],
                'itemsize': len(data),
            }
        )

    def rows(
        self, stamps: NDArray[np.int64] | None = None, **columns: ArrayLike
    ) -> NDArray[np.uint8]:
        """Return messages with these numbers, a row each.

        Args:
            stamps: The stamp of each message, ns; None: the message has none.
            columns: The numbers of all messages, by name.
        """
        if stamps is not None:
            columns = {'sec': stamps // NS, 'nanosec': stamps % NS, **columns}
        count = len(np.asarray(next(iter(columns.values()))))
        rows = np.frombuffer(bytearray(self._data * count), np.uint8).reshape(count, -1)
        numbers = rows.view(self._kind)[:, 0]
        for name, values in columns.items():
            numbers[name] = values
        return rows
