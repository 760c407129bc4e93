# SPDX-License-Identifier: Apache-2.0
"""The home states of a course: a strip of colours with their names, above the panels."""

from collections.abc import Iterator, Sequence
from itertools import count, groupby
from typing import NamedTuple

from matplotlib.axes import Axes

from ..course import Sample
from ..procedures.states import State
from .palette import GREY, INK, state_colour
from .sheet import LINE, POINTS, SMALL, STRIP, text_width

#: No strip is narrower, in.
NARROWEST = 4.5


class Band(NamedTuple):
    """A stretch of time in one home state, s since the run began."""

    begin: float
    end: float
    state: str

    @property
    def colour(self) -> str:
        return state_colour(self.state)


def bands_of(samples: Sequence[Sample]) -> Iterator[Band]:
    """Yield the home states that a run went through."""
    if not samples:
        return
    begin = samples[0].time
    starts = [
        (state, next(stretch).time - begin)
        for state, stretch in groupby(samples, key=lambda sample: sample.state)
    ]
    ends = [*(start for _, start in starts[1:]), samples[-1].time - begin]
    for (state, start), end in zip(starts, ends, strict=True):
        if state != State.Idle:
            yield Band(start, end, state)


class Name(NamedTuple):
    """Where a state's name stands: the middle of the text in s, lines above the strip."""

    middle: float
    level: int


def names_need(bands: Sequence[Band], end: float) -> float:
    """Return how far names may have to go beyond the strip, in: each can begin over its band."""
    inch = end / NARROWEST
    widths = [(text_width(band.state) + 6.0) / POINTS for band in bands]
    return max(
        (
            width - (end - (band.begin + band.end) / 2) / inch
            for band, width in zip(bands, widths, strict=True)
            if width > (band.end - band.begin) / inch
        ),
        default=0.0,
    )


def place_names(bands: Sequence[Band], end: float, inner: float, right: float) -> list[Name]:
    """Put each name into its band (level 0) or, where that is too short, on a free line above.

    No name covers another one or the stroke that ties another one to its band: from right to
    left, each goes to the lowest line where it can stand over its band or begin there.

    Args:
        bands: The bands.
        end: Where the strip ends, s.
        inner: How wide the strip is, in.
        right: How far a name may go beyond the strip, in.
    """
    point = end / (inner * POINTS)
    middles = [(band.begin + band.end) / 2 for band in bands]
    widths = [(text_width(band.state) + 6.0) * point for band in bands]
    inside = [width <= band.end - band.begin for band, width in zip(bands, widths, strict=True)]
    strokes = [middle for middle, fits in zip(middles, inside, strict=True) if not fits]
    names: list[Name] = []
    taken: list[tuple[int, float, float, float]] = []  # line, left and right end, stroke
    for middle, width, fits in zip(
        reversed(middles), reversed(widths), reversed(inside), strict=True
    ):
        if fits:
            names.append(Name(middle, 0))
            continue
        strokes.pop()
        level, left = next(
            (level, left)
            for level in count(1)
            for left in (max(0.0, middle - width / 2), middle)
            if left + width <= end + right * POINTS * point
            and not any(left < stroke < left + width for stroke in strokes)
            and not any(
                left < stroke < left + width for line, _, _, stroke in taken if line > level
            )
            and not any(left < b and a < left + width for line, a, b, _ in taken if line == level)
        )
        taken.append((level, left, left + width, middle))
        names.append(Name(left + width / 2, level))
    return names[::-1]


def draw_names(strip: Axes, bands: Sequence[Band], names: Sequence[Name]) -> None:
    strip.set(ylim=(0.0, 1.0), xticks=[], yticks=[])
    line = LINE / POINTS / STRIP
    for band, name in zip(bands, names, strict=True):
        strip.axvspan(band.begin, band.end, facecolor=band.colour, edgecolor=GREY, lw=0.5)
        y = 0.46 if name.level == 0 else 1.1 + (name.level - 0.5) * line
        strip.text(name.middle, y, band.state, size=SMALL, color=INK, ha='center', va='center')
        if name.level:
            middle = (band.begin + band.end) / 2
            strip.plot(
                [middle, middle],
                [0.5, 1.1 + (name.level - 0.9) * line],
                color=INK,
                lw=0.5,
                clip_on=False,
            )
