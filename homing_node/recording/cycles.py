# SPDX-License-Identifier: Apache-2.0
"""The cycles of the node while runs are recorded: their times, and the setpoints of all drives.

They are packed at once: what lies scattered in memory costs a multiple when it is looked at later.
"""

import struct
from collections.abc import Mapping, Sequence
from math import nan

import numpy as np
from numpy.typing import NDArray

from ..core.axis import Setpoint

#: The setpoint of a cycle in which the axis is not told to move, and how long one is.
NO_SETPOINT = nan, nan, nan
LENGTH = len(NO_SETPOINT)


class Cycles:
    """The cycles in which the same runs were on."""

    def __init__(self, axes: Sequence[str]) -> None:
        """Begin.

        Args:
            axes: The axes whose runs are on.
        """
        self._axes = tuple(axes)
        self._packed = bytearray()
        self._one = struct.Struct(f'{1 + LENGTH * len(self._axes)}d')

    def __len__(self) -> int:
        return len(self._packed) // self._one.size

    def note(self, now: float, setpoints: Mapping[str, Setpoint]) -> None:
        """Note a cycle."""
        numbers = [now]
        for axis in self._axes:
            numbers += setpoints.get(axis, NO_SETPOINT)
        self._packed += self._one.pack(*numbers)

    def of(self, axis: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the times of the cycles in which an axis had a setpoint, and the setpoints.

        The setpoints have a row for each of position, velocity and acceleration.
        """
        if axis not in self._axes or not self._packed:
            return np.empty(0), np.empty((LENGTH, 0))
        rows = np.frombuffer(bytes(self._packed)).reshape(len(self), -1).T
        first = 1 + LENGTH * self._axes.index(axis)
        times, numbers = rows[0], rows[first : first + LENGTH]
        told = ~np.isnan(numbers[0])
        return (times, numbers) if told.all() else (times[told], numbers[:, told])
