# SPDX-License-Identifier: Apache-2.0
"""The position diagram: the axis with its switches, the way of the axis, and how the run ended."""

from collections.abc import Iterator
from math import ceil, floor
from typing import NamedTuple

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..course import Course
from ..plant.layout import AxisLayout
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

#: More index marks than these would be a grey area.
MARKS = 60


class Scale(NamedTuple):
    """What a length in SI is multiplied with, and the unit in which it is shown then."""

    factor: float
    unit: str


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
    axes.yaxis.set_major_locator(MaxNLocator(7))
    labels: list[Label] = []
    legend: list[Artist] = []
    if layout is not None:
        labels += _draw_axis(axes, layout, view, k)
        legend += _draw_index(axes, layout, view, k)

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
    feedback = [s.feedback * k for s in samples]
    shown = axes.plot(times, feedback, color=INK, lw=1.5, zorder=5, label='feedback')
    if apart:
        legend += shown

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
        axes.plot(0.0, start, '>', ms=6, color=INK, clip_on=False, zorder=7)
        labels.append(Label(start, 'start', INK))
    else:
        axes.text(0.5, 0.5, 'no motion', transform=axes.transAxes, ha='center', color=GREY)
    labels += _draw_outcome(axes, course, begin, view, scale, legend)
    draw_labels(axes, labels, low, high, height)
    return legend


def _draw_axis(
    axes: Axes, layout: AxisLayout, view: tuple[float, float], k: float
) -> Iterator[Label]:
    """Draw the hard stops and the switches; yield their labels."""
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
            yield Label(stop * k, 'hard stop', DARK_GREY)
    for name, flag in layout.switches.items():
        bottom = max(flag.on_from, low, view[0])
        top = min(flag.on_to, high, view[1])
        if bottom >= top:
            continue
        limit = Input(name) in LIMIT_SWITCHES
        colour = DARK_VERMILLION if limit else BLUE
        axes.axhspan(bottom * k, top * k, color=colour, alpha=0.22, lw=0.0, zorder=2)
        for edge in (flag.on_from, flag.on_to):
            if bottom <= edge <= top and low < edge < high:
                axes.axhline(edge * k, color=colour, lw=0.8, zorder=3)
        inner = bottom if flag.on_to >= high else top if flag.on_from <= low else None
        height = (bottom + top) / 2 if inner is None else inner
        text = Input(name).text.removesuffix(' switch') if limit else Input(name).text
        yield Label(height * k, text, colour)
    if layout.touch_probe is not None and view[0] < layout.touch_probe < view[1]:
        axes.axhline(layout.touch_probe * k, color=PURPLE, lw=1.0, ls=(0, (1, 1.5)), zorder=3)
        yield Label(layout.touch_probe * k, 'touch probe', DARK_PURPLE)


def _draw_index(
    axes: Axes, layout: AxisLayout, view: tuple[float, float], k: float
) -> list[Artist]:
    """Draw the index marks as long as they can be told apart; return their legend."""
    pitch, offset = layout.index_pitch, layout.index_offset
    if not pitch or (view[1] - view[0]) / pitch > MARKS:
        return []
    marks = [
        offset + n * pitch
        for n in range(ceil((view[0] - offset) / pitch), floor((view[1] - offset) / pitch) + 1)
    ]
    marks = [mark * k for mark in marks if layout.hard_stops[0] <= mark <= layout.hard_stops[1]]
    for mark in marks:
        axes.axhline(mark, color=DARK_PURPLE, lw=0.7, ls=(0, (1, 3)), zorder=2)
    if not marks:
        return []
    return [Line2D([], [], color=DARK_PURPLE, lw=0.9, ls=(0, (1, 2)), label='index mark')]


def _draw_outcome(
    axes: Axes,
    course: Course,
    begin: float,
    view: tuple[float, float],
    scale: Scale,
    legend: list[Artist],
) -> Iterator[Label]:
    """Mark where the run took its home position, or where it failed; yield its label."""
    outcome, samples, k = course.outcome, course.samples, scale.factor
    if outcome is None or not samples:
        return
    if not outcome.success:
        last = samples[-1]
        legend += axes.plot(
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
        return
    home = outcome.home_position_raw
    time = _time_of_home(course, home, begin, view[1] - view[0])
    axes.axhline(home * k, color=DARK_GREEN, lw=1.0, ls=(0, (5, 2)), zorder=4)
    legend += axes.plot(
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
    yield Label(home * k, f'home {home * k:.3f} {scale.unit}', DARK_GREEN)


def _switch_edges(
    course: Course, layout: AxisLayout | None, begin: float
) -> Iterator[tuple[float, float, bool]]:
    """Yield (s since the run began, position, on) of every switch edge during the run."""
    for time, name, value, position in course.happenings:
        if time >= begin and Input(name) not in LATCHES:
            flag = layout.switches.get(name) if layout is not None else None
            inverted = name in course.inverted or (flag is not None and flag.inverted)
            yield time - begin, position, bool(value) is not inverted


def _time_of_home(course: Course, home: float, begin: float, span: float) -> float:
    """Return when the axis was at its home position for the first pass of it that counted."""
    shift = next((s.time for s in course.samples if s.state == State.HomeShift), begin)
    at_home = [
        time
        for time, _, _, position in course.happenings
        if begin <= time <= shift and abs(position - home) <= 1e-3 * span
    ]
    return max(at_home, default=shift) - begin
