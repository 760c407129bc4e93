# SPDX-License-Identifier: Apache-2.0
"""The position diagram: the axis with its switches, the way of the axis, and how the run ended."""

from collections.abc import Iterator, Sequence
from math import ceil, floor
from typing import NamedTuple

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..course import Course
from ..plant.layout import AxisLayout, SwitchLayout
from ..procedures.states import LATCHES, LIMIT_SWITCHES, Input, State
from .labels import Label, draw_labels
from .palette import (
    BLUE,
    DARK_GREEN,
    DARK_GREY,
    DARK_PURPLE,
    DARK_VERMILLION,
    GREEN,
    GREY,
    INK,
    LIGHT_GREY,
    PURPLE,
    VERMILLION,
)
from .sheet import NORMAL

#: More index marks than these would be a grey area: then each second, fifth, tenth, … is drawn.
MARKS = 24


class Scale(NamedTuple):
    """What a length in SI is multiplied with, and the unit in which it is shown then."""

    factor: float
    unit: str

    @property
    def digits(self) -> int:
        """Return how many digits a position has behind the point: µm, or µrad."""
        return 3 if self.factor > 1.0 else 6


def labels_of(
    course: Course, layout: AxisLayout | None, view: tuple[float, float], scale: Scale
) -> list[Label]:
    """Return what is named beside the position diagram: what is in the view."""
    k = scale.factor
    labels = [] if layout is None else list(_labels_of_axis(layout, view, k))
    if course.samples:
        labels.append(Label(course.samples[0].feedback * k, 'start', INK))
    outcome = course.outcome
    if outcome is not None and outcome.success and course.samples:
        home = outcome.home_position_raw * k
        labels.append(Label(home, f'home {home:.{scale.digits}f} {scale.unit}', DARK_GREEN))
    return [label for label in labels if view[0] * k <= label.height <= view[1] * k]


def draw_position(
    axes: Axes,
    course: Course,
    layout: AxisLayout | None,
    begin: float,
    view: tuple[float, float],
    scale: Scale,
    height: float,
) -> list[Artist]:
    """Draw the position diagram, `height` in high; return what its legend explains."""
    k, samples = scale.factor, course.samples
    low, high = (end * k for end in view)
    axes.set_ylim(low, high)
    axes.set_ylabel(f'position in {scale.unit}', size=NORMAL)
    axes.yaxis.set_major_locator(MaxNLocator(max(3, round(2.5 * height))))
    legend: list[Artist] = []
    if layout is not None:
        _draw_axis(axes, layout, view, k)
        legend += _draw_index(axes, course, layout, view, k)

    times = [sample.time - begin for sample in samples]
    furthest = max((abs(s.position - s.feedback) for s in samples), default=0.0)
    apart = furthest > 0.03 * (view[1] - view[0])
    if apart:
        legend += axes.plot(
            times,
            [s.position * k for s in samples],
            color=INK,
            lw=0.9,
            ls=(0, (3, 2)),
            zorder=4,
            label='command',
        )
    legend += axes.plot(
        times,
        [s.feedback * k for s in samples],
        color=INK,
        lw=1.5,
        zorder=5,
        label='feedback' if apart else 'feedback, command',
    )

    edges = list(_switch_edges(course, layout, begin))
    for on, face, text in ((True, INK, 'switch turns on'), (False, 'white', 'switch turns off')):
        points = [(time, position * k) for time, position, which in edges if which is on]
        if points:
            legend += axes.plot(
                *zip(*points, strict=True),
                'o',
                ms=4.5,
                mfc=face,
                mec=INK,
                mew=0.9,
                zorder=6,
                label=text,
            )
    if samples:
        start = samples[0].feedback * k
        if low <= start <= high:
            axes.plot(0.0, start, '>', ms=6, color=INK, clip_on=False, zorder=7)
    else:
        axes.text(0.5, 0.5, 'no motion', transform=axes.transAxes, ha='center', color=GREY)
    legend += _draw_outcome(axes, course, begin, view, scale)
    draw_labels(axes, labels_of(course, layout, view, scale), low, high, height)
    return legend


def _draw_axis(axes: Axes, layout: AxisLayout, view: tuple[float, float], k: float) -> None:
    """Draw the hard stops and the switches."""
    low, high = layout.hard_stops
    for stop, beyond in ((low, view[0]), (high, view[1])):
        if view[0] < stop < view[1]:
            axes.axhspan(
                stop * k,
                beyond * k,
                facecolor=LIGHT_GREY,
                edgecolor=GREY,
                lw=0.0,
                hatch='//////',
                zorder=2,
            )
            axes.axhline(stop * k, color=INK, lw=1.2, zorder=3)
    for name, flag, bottom, top in _flags(layout, view):
        colour = DARK_VERMILLION if name in LIMIT_SWITCHES else BLUE
        axes.axhspan(bottom * k, top * k, color=colour, alpha=0.22, lw=0.0, zorder=2)
        for edge in (flag.on_from, flag.on_to):
            if bottom <= edge <= top and low < edge < high:
                axes.axhline(edge * k, color=colour, lw=0.8, zorder=3)
    if layout.touch_probe is not None and view[0] < layout.touch_probe < view[1]:
        axes.axhline(layout.touch_probe * k, color=PURPLE, lw=1.0, ls=(0, (1, 1.5)), zorder=3)


def _labels_of_axis(layout: AxisLayout, view: tuple[float, float], k: float) -> Iterator[Label]:
    """Yield the labels of what stands along the axis."""
    low, high = layout.hard_stops
    for stop in layout.hard_stops:
        if view[0] < stop < view[1]:
            yield Label(stop * k, 'hard stop', DARK_GREY)
    for name, flag, bottom, top in _flags(layout, view):
        limit = name in LIMIT_SWITCHES
        inner = bottom if flag.on_to >= high else top if flag.on_from <= low else None
        height = (bottom + top) / 2 if inner is None else inner
        text = name.text.removesuffix(' switch') if limit else name.text
        yield Label(height * k, text, DARK_VERMILLION if limit else BLUE)
    if layout.touch_probe is not None:
        yield Label(layout.touch_probe * k, 'touch probe', DARK_PURPLE)


def _flags(
    layout: AxisLayout, view: tuple[float, float]
) -> Iterator[tuple[Input, SwitchLayout, float, float]]:
    """Yield each switch that is on somewhere in the view, and from where to where it is shown."""
    low, high = layout.hard_stops
    for name, flag in layout.switches.items():
        bottom = max(flag.on_from, low, view[0])
        top = min(flag.on_to, high, view[1])
        if bottom < top:
            yield Input(name), flag, bottom, top


def _thinned(count: float) -> int:
    """Return that each n-th of so many index marks is drawn: n is 1, 2, 5, 10, 20, …."""
    power = 1
    while True:
        for step in (power, 2 * power, 5 * power):
            if count / step <= MARKS:
                return step
        power *= 10


def _draw_index(
    axes: Axes, course: Course, layout: AxisLayout, view: tuple[float, float], k: float
) -> list[Artist]:
    """Draw the index marks, some where they are too many; return their legend."""
    if not layout.index_pitch:
        return []
    each = _thinned((view[1] - view[0]) / layout.index_pitch)
    pitch, offset = layout.index_pitch * each, layout.index_offset
    if course.outcome is not None:  # the pulse at home is among them
        home = course.outcome.home_position_raw - offset
        offset += round(home / layout.index_pitch) * layout.index_pitch
    marks = [
        offset + n * pitch
        for n in range(ceil((view[0] - offset) / pitch), floor((view[1] - offset) / pitch) + 1)
    ]
    marks = [mark * k for mark in marks if layout.hard_stops[0] <= mark <= layout.hard_stops[1]]
    for mark in marks:
        axes.axhline(mark, color=DARK_PURPLE, lw=0.7, ls=(0, (1, 3)), zorder=2)
    if not marks:
        return []
    nth = {1: '', 2: 'each 2nd '}.get(each, f'each {each}th ')
    return [Line2D([], [], color=DARK_PURPLE, lw=0.9, ls=(0, (1, 2)), label=f'{nth}index mark')]


def _draw_outcome(
    axes: Axes,
    course: Course,
    begin: float,
    view: tuple[float, float],
    scale: Scale,
) -> Sequence[Artist]:
    """Mark where the run took its home position, or where it failed; return its legend."""
    outcome, samples, k = course.outcome, course.samples, scale.factor
    if outcome is None or not samples:
        return []
    if not outcome.success:
        last = samples[-1]
        if not view[0] <= last.feedback <= view[1]:
            return []
        return axes.plot(
            last.time - begin,
            last.feedback * k,
            'X',
            ms=8,
            mfc=VERMILLION,
            mec=INK,
            mew=0.6,
            clip_on=False,
            zorder=8,
            label=str(outcome.error),
        )
    home = outcome.home_position_raw
    time = time_of_home(course, view[1] - view[0])
    axes.axhline(home * k, color=DARK_GREEN, lw=1.0, ls=(0, (5, 2)), zorder=4)
    return axes.plot(
        time,
        home * k,
        'D',
        ms=7.5,
        mfc=GREEN,
        mec='white',
        mew=1.0,
        zorder=8,
        label='home position taken',
    )


def _switch_edges(
    course: Course, layout: AxisLayout | None, begin: float
) -> Iterator[tuple[float, float, bool]]:
    """Yield (s since the run began, position, on) of every switch edge during the run."""
    for time, name, value, position in course.happenings:
        if time >= begin and Input(name) not in LATCHES:
            flag = layout.switches.get(name) if layout is not None else None
            inverted = name in course.inverted or (flag is not None and flag.inverted)
            yield time - begin, position, bool(value) is not inverted


def time_of_home(course: Course, span: float) -> float:
    """Return when a run took its home position, s since it began; ``span`` is what is shown."""
    if course.outcome is None or not course.samples:
        return 0.0
    begin, home = course.samples[0].time, course.outcome.home_position_raw
    shift = next((s.time for s in course.samples if s.state == State.HomeShift), begin)
    at_home = [
        time
        for time, _, _, position in course.happenings
        if begin <= time <= shift and abs(position - home) <= 1e-3 * span
    ]
    return max(at_home, default=shift) - begin
