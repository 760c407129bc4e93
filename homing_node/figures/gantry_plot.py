# SPDX-License-Identifier: Apache-2.0
"""The other sides of a gantry in the picture of a course, and their skew below."""

from collections.abc import Iterator, Sequence
from itertools import cycle
from math import isfinite
from typing import NamedTuple

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..course import Course, Happening
from ..plant.layout import AxisLayout
from ..procedures.states import LATCHES, Input
from .palette import BLUE, DARK_PURPLE, DARK_VERMILLION, GREY, INK
from .sheet import NORMAL, SMALL

#: Of the followers, in their order.
COLOURS = (DARK_VERMILLION, BLUE, DARK_PURPLE)
#: Below this, m, a skew is shown in µm.
SMALL_SKEW = 1e-4


class Side(NamedTuple):
    """A follower as it is drawn: in the leader's coordinates, square at the leader's place.

    Attributes:
        name: Its full name.
        course: What it did.
        layout: Where things are on its side, if that is known.
        colour: Its colour.
        apart: How far it is ahead of the leader where it is drawn at the leader's place.
    """

    name: str
    course: Course
    layout: AxisLayout | None
    colour: str
    apart: float

    def place(self, raw: float) -> float:
        """Return where a raw position is drawn."""
        return (-raw if self.course.mirrored else raw) - self.apart


def sides_of(course: Course, layout: AxisLayout | None) -> list[Side]:
    """Return the followers of a course."""
    known = {} if layout is None else layout.followers
    return [
        Side(name, other, known.get(name), colour, _apart(course, name, known.get(name)))
        for (name, other), colour in zip(course.followers.items(), cycle(COLOURS), strict=False)
    ]


def _apart(course: Course, name: str, layout: AxisLayout | None) -> float:
    """Return how far a follower is ahead of the leader where the gantry is square.

    The layout knows it; else the run that has homed, at its end. Without both it is where the
    follower was at the start.
    """
    if layout is not None:
        return layout.square_at
    other = course.followers[name]
    sign = -1.0 if other.mirrored else 1.0
    ahead = [
        sign * one.feedback - leader.feedback
        for one, leader in zip(other.samples, course.samples, strict=True)
    ]
    ahead = [each for each in ahead if isfinite(each)] or [0.0]
    outcome = course.outcome
    if outcome is None or not outcome.success:
        return ahead[0]
    short = name.rpartition('.')[2]
    squareness = {one.name: one.squareness for one in outcome.members}
    return ahead[-1] + squareness[short] if short in squareness else ahead[0]


def draw_followers(axes: Axes, sides: Sequence[Side], begin: float, k: float) -> list[Artist]:
    """Draw where the followers were and what their switches did; return the legend."""
    legend: list[Artist] = []
    if sides:
        legend.append(Line2D([], [], color=INK, lw=1.5, label='leader'))
    for side in sides:
        samples = side.course.samples
        legend += axes.plot(
            [sample.time - begin for sample in samples],
            [side.place(sample.feedback) * k for sample in samples],
            color=side.colour,
            lw=1.2,
            ls=(0, (4, 2)),
            zorder=5.5,
            label=side.name,
        )
        for one, on in _edges(side, begin):
            axes.plot(
                one.time - begin,
                side.place(one.position) * k,
                'o',
                ms=4.5,
                mfc=side.colour if on else 'white',
                mec=side.colour,
                mew=0.9,
                zorder=6,
            )
    return legend


def draw_skew(axes: Axes, course: Course, sides: Sequence[Side], begin: float, unit: str) -> None:
    """Draw how far each follower is ahead of the leader: out of square, where that is known."""
    times = [sample.time - begin for sample in course.samples]
    lines = [list(_ahead(course, side)) for side in sides]
    known = [abs(value) for line in lines for value in line if isfinite(value)]
    largest = max(known, default=0.0) or 1e-6
    k, shown = (1e3, 'mm') if unit == 'm' else (1.0, unit)
    if unit == 'm' and largest < SMALL_SKEW:
        k, shown = 1e6, 'µm'
    axes.set_ylim(-1.25 * largest * k, 1.25 * largest * k)
    axes.axhline(0.0, color=GREY, lw=0.6, zorder=2)
    for side, line in zip(sides, lines, strict=True):
        axes.plot(times, [value * k for value in line], color=side.colour, lw=1.3, zorder=5)
    axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
    axes.set_ylabel(f'skew\nin {shown}', size=NORMAL)
    stiffness = {side.layout.stiffness for side in sides if side.layout is not None}
    if len(stiffness) == 1 and (newton := stiffness.pop()):
        _draw_force(axes, newton / k)


def _ahead(course: Course, side: Side) -> Iterator[float]:
    """Yield how far a follower is ahead of the leader, in each cycle."""
    for one, leader in zip(side.course.samples, course.samples, strict=True):
        yield side.place(one.feedback) - leader.feedback


def _draw_force(axes: Axes, newton: float) -> None:
    """Give the skew a second scale on the right: what the spring bears."""
    right = axes.twinx()
    low, high = axes.get_ylim()
    right.set_ylim(low * newton, high * newton)
    right.tick_params(labelsize=SMALL, length=2.5, width=0.6, color=GREY)
    for spine in right.spines.values():
        spine.set(linewidth=0.6, color=GREY)
    right.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
    right.set_ylabel('racking force\nin N', size=NORMAL, color=INK)


def _edges(side: Side, begin: float) -> Iterator[tuple[Happening, bool]]:
    """Yield what the switches of a follower did in the run, and whether they turned on."""
    for one in side.course.happenings:
        if one.time >= begin and Input(one.input) not in LATCHES:
            flag = side.layout.switches.get(one.input) if side.layout is not None else None
            inverted = one.input in side.course.inverted if flag is None else flag.inverted
            yield one, bool(one.value) is not inverted
