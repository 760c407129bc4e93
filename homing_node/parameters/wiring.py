# SPDX-License-Identifier: Apache-2.0
"""Which inputs of which axes are one and the same signal."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from ..procedures.states import LIMIT_PAIRS, Input, LimitPair
from .configuration import Configuration


class Place(NamedTuple):
    """An input of an axis."""

    axis: str
    input: Input

    def __str__(self) -> str:
        return f'{self.axis}.{self.input}'


class Wiring:
    """The signal that each wired input reads.

    Attributes:
        signals: What identifies the signal of each input: its topic, and the part of a message.
    """

    def __init__(self, signals: Mapping[Place, str]) -> None:
        self.signals = dict(signals)
        self._places: defaultdict[str, list[Place]] = defaultdict(list)
        for place, signal in self.signals.items():
            self._places[signal].append(place)

    def others(self, place: Place) -> tuple[Place, ...]:
        """Return the other inputs that read the signal of an input."""
        signal = self.signals.get(place)
        if signal is None:
            return ()
        return tuple(other for other in self._places[signal] if other != place)

    def sharing(self, axis: str, inputs: Iterable[Input]) -> dict[Input, tuple[Place, ...]]:
        """Return the inputs of an axis whose signal other axes read too, and who reads it."""
        found = {}
        for name in inputs:
            others = tuple(one for one in self.others(Place(axis, name)) if one.axis != axis)
            if others:
                found[name] = others
        return found

    def in_series(self, axis: str) -> frozenset[LimitPair]:
        """Return the pairs of limit switches of an axis that are wired as one input."""
        return frozenset(
            pair
            for pair, (positive, negative) in LIMIT_PAIRS.items()
            if Place(axis, negative) in self.others(Place(axis, positive))
        )


def wiring_of(configuration: Configuration) -> Wiring:
    """Return the wiring that the parameters describe; a remapping at the start is not in them."""
    return Wiring(
        {
            Place(axis, name): str(configuration.connections[axis].source(axis, name))
            for axis, parameters in configuration.drives.items()
            for name in parameters.inputs
        }
    )
