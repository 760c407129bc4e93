# SPDX-License-Identifier: Apache-2.0
"""The pitch of an encoder index, and where its marks are, from latched positions. m or rad."""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from .passes import SeenEdge

#: Marks are no closer than this many times what they may be off.
APART = 6.0


class Marks(NamedTuple):
    """An index: marks at ``offset`` + k x ``pitch``.

    Attributes:
        pitch: The distance of two marks.
        offset: The mark that is nearest to 0 from above.
        pitch_half: How far the pitch may be off.
        offset_half: How far any mark on the way that was surveyed may be off.
        seen: How many marks were seen.
    """

    pitch: float
    offset: float
    pitch_half: float
    offset_half: float
    seen: int


def marks_of(pulses: Sequence[SeenEdge]) -> Marks | float | None:
    """Return the index, its only mark where one alone was seen, None where there is none.

    Raises:
        ValueError: The distances of the marks are no multiples of one pitch; the message says it.
    """
    if not pulses:
        return None
    doubt = max(one.uncertainty for one in pulses)
    places = _places(sorted(one.position for one in pulses), APART * doubt)
    if len(places) < 2:
        return places[0]
    gaps = [high - low for low, high in pairwise(places)]
    pitch = min(gaps)
    number = [0]
    for gap in gaps:
        number.append(number[-1] + round(gap / pitch))
    pitch = (places[-1] - places[0]) / number[-1]
    middle = sum(place - k * pitch for place, k in zip(places, number, strict=True)) / len(places)
    worst = max(abs(place - middle - k * pitch) for place, k in zip(places, number, strict=True))
    if worst > 2.0 * doubt + 0.01 * pitch:
        raise ValueError(
            f'the marks are not evenly spaced: one is {worst:.3g} m from where a pitch of '
            f'{pitch:.6g} m has it'
        )
    half = max(worst, doubt)
    return Marks(pitch, middle % pitch, 2.0 * half / number[-1], half, len(places))


def _places(positions: Sequence[float], apart: float) -> list[float]:
    """Return where marks are: the mean of what was latched at each of them."""
    groups: list[list[float]] = []
    for position in positions:
        if groups and position - groups[-1][-1] <= apart:
            groups[-1].append(position)
        else:
            groups.append([position])
    return [sum(group) / len(group) for group in groups]
