# SPDX-License-Identifier: Apache-2.0
"""Pairs of limit switches that are wired in series: one input says that one of them is on.

A rise counts for the limit that the axis moves into, so that the axis can be moved away from it
afterwards. The memory of the end lasts from run to run, while the input stays on.
"""

from collections.abc import Iterable

from ..procedures.states import LIMIT_PAIRS, Input, LimitPair


class SeriesLimits:
    """The pairs of limit switches of an axis that are one input.

    Attributes:
        pairs: These pairs.
    """

    def __init__(self, pairs: Iterable[LimitPair] = ()) -> None:
        self.pairs = frozenset(pairs)
        self._on_at: dict[LimitPair, Input] = {}

    def rose(self, pair: LimitPair, switch: Input) -> None:
        """Remember at which end the input of a pair rose."""
        self._on_at[pair] = switch

    def is_at(self, pair: LimitPair, switch: Input) -> bool:
        """Return whether the input of a pair, if it is on, is on for this limit."""
        return pair not in self.pairs or self._on_at.get(pair) is switch

    def end_known(self, pair: LimitPair) -> bool:
        """Return whether it is known at which end the input of a pair rose."""
        return pair in self._on_at

    def rose_without_run(self, switch: Input) -> None:
        """Forget the end of a pair whose input rose while nothing of ours moved the axis."""
        for pair in self.pairs:
            if switch in LIMIT_PAIRS[pair]:
                self._on_at.pop(pair, None)
