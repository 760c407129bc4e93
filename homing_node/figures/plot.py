# SPDX-License-Identifier: Apache-2.0
"""Draws a course as the manual does: the position diagram and the profile.

The home states are coloured bands behind all panels, named above them; the switches are bands
across the position diagram, named beside it. Whatever a colour tells is written too.
"""

from collections.abc import Sequence
from math import inf, isfinite
from os import PathLike
from typing import Any

from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ..course import Course, Sample
from ..plant.layout import AxisLayout
from ..procedures.states import TextEnum
from .gantry_plot import draw_followers, draw_skew, sides_of
from .near_home import layout_from, reach_of, shifted
from .palette import (
    BLUE,
    GREY,
    INK,
)
from .position_panel import Scale, draw_position, labels_of, time_of_home
from .sheet import (
    LARGE,
    LEFT,
    LINE,
    NORMAL,
    POINTS,
    RIGHT,
    SCALE,
    SMALL,
    STRIP,
    WIDTH,
    right_margin,
)
from .sheet import save as write
from .state_strip import bands_of, draw_names, names_need, place_names


class Panel(TextEnum):
    """A part of the picture; all parts share the time axis."""

    POSITION = 'position'
    CLOSE = 'near home'  # of a long axis, below its position diagram
    SKEW = 'skew'  # of a gantry, there, too
    VELOCITY = 'velocity'
    ACCELERATION = 'acceleration'


POSITION_DIAGRAM = (Panel.POSITION,)
PROFILE = (Panel.VELOCITY, Panel.ACCELERATION)
WHOLE = POSITION_DIAGRAM + PROFILE

#: How strongly the states colour a panel: the position diagram has the switches besides.
TINT = {
    Panel.POSITION: 0.09,
    Panel.CLOSE: 0.09,
    Panel.SKEW: 0.17,
    Panel.VELOCITY: 0.17,
    Panel.ACCELERATION: 0.17,
}

# Lengths on the sheet: in.
HEIGHTS = {
    Panel.POSITION: 2.8,
    Panel.CLOSE: 1.6,
    Panel.SKEW: 1.1,
    Panel.VELOCITY: 1.1,
    Panel.ACCELERATION: 1.1,
}
TITLE, GAP, TIME_AXIS, LEGEND = 0.34, 0.09, 0.40, 0.17

#: A course shorter than this part of its axis is shown closely.
CLOSE = 0.3


def figure(
    course: Course,
    layout: AxisLayout | None = None,
    title: str = '',
    panels: Sequence[Panel] = WHOLE,
    unit: str = 'm',
    beneath: Course | None = None,
) -> Figure:
    """Draw a course.

    ``beneath`` is another course, drawn lightly under it: the rehearsal of a recorded one.
    ``layout`` tells what stands along the axis, as far as it is known (hard stops may be
    infinite); without it only what the course itself recorded is drawn. ``unit`` is the unit of
    the positions, m or rad; m is shown as mm where the view is shorter than 2 m.

    Where the turns around home are too small to be seen, a panel shows them closely. The position
    diagram of a gantry has its followers, too, as far as the leader's encoder would show them, and
    their skew below.
    """
    samples = course.samples
    sides = sides_of(course, layout)
    if sides and Panel.POSITION in panels:
        below = panels.index(Panel.POSITION) + 1
        panels = (*panels[:below], Panel.SKEW, *panels[below:])
    view = _view(course, layout)
    time, span = time_of_home(course, view[1] - view[0]), view[1] - view[0]
    reach = 0.0 if sides else reach_of(course, time, span)
    if reach and Panel.POSITION in panels:
        below = panels.index(Panel.POSITION) + 1
        panels = (*panels[:below], Panel.CLOSE, *panels[below:])
    begin = samples[0].time if samples else 0.0
    end = (samples[-1].time - begin if samples else 0.0) or 1.0
    bands = list(bands_of(samples))
    under = beneath.samples if beneath is not None else []
    last = max(end, under[-1].time - under[0].time if under else 0.0)
    scale = _scale(span, unit)
    beside = labels_of(course, layout, view, scale) if Panel.POSITION in panels else []
    right = right_margin([label.text for label in beside], SCALE if sides else RIGHT)
    right = max(right, names_need(bands, last))
    inner = WIDTH - LEFT - right
    names = place_names(bands, last, inner, right)

    lines = max((name.level for name in names), default=0)
    top = (TITLE if title else 0.06) + lines * LINE / POINTS + STRIP
    bottom = TIME_AXIS + (LEGEND if Panel.POSITION in panels else 0.0)
    height = top + sum(HEIGHTS[panel] + GAP for panel in panels) + bottom
    sheet = Figure((WIDTH, height), facecolor='white')
    FigureCanvasAgg(sheet)
    if title:
        sheet.text(LEFT / WIDTH, 1.0 - 0.08 / height, title, size=LARGE, weight='bold', va='top')

    def axes(bottom: float, tall: float) -> Axes:
        made = sheet.add_axes((LEFT / WIDTH, bottom / height, inner / WIDTH, tall / height))
        made.set_xlim(0.0, last)
        made.tick_params(labelsize=SMALL, length=2.5, width=0.6, color=GREY)
        for spine in made.spines.values():
            spine.set(linewidth=0.6, color=GREY)
        return made

    level = height - top
    draw_names(axes(level, STRIP), bands, names)
    for panel in panels:
        level -= GAP + HEIGHTS[panel]
        one = axes(level, HEIGHTS[panel])
        one.yaxis.set_label_coords(-0.42 / inner, 0.5)
        for band in bands:
            one.axvspan(band.begin, band.end, color=band.colour, alpha=TINT[panel], lw=0, zorder=0)
            one.axvline(band.end, color=GREY, lw=0.5, alpha=0.7, zorder=2.5)
        if panel is Panel.POSITION:
            legend = draw_position(one, course, layout, begin, view, scale, HEIGHTS[panel])
            legend += _draw_under(one, under, 'feedback', scale)
            legend += draw_followers(one, sides, begin, scale.factor)
            sheet.legend(
                handles=legend,
                loc='lower left',
                bbox_to_anchor=(LEFT / WIDTH, 0.03 / height),
                ncols=len(legend),
                frameon=False,
                fontsize=SMALL,
                handlelength=1.5,
                handletextpad=0.5,
                columnspacing=1.4,
                borderaxespad=0.0,
                borderpad=0.0,
            )
        elif panel is Panel.CLOSE and course.outcome is not None:
            home, nearby = course.outcome.home_position_raw, _scale(2.0 * reach, unit)
            where = layout and layout_from(layout, home)
            draw_position(
                one, shifted(course, home), where, begin, (-reach, reach), nearby, HEIGHTS[panel]
            )
            if beneath is not None:
                _draw_under(one, shifted(beneath, home).samples, 'feedback', nearby)
            one.set_ylabel(f'from home\nin {nearby.unit}', size=NORMAL)
        elif panel is Panel.SKEW:
            draw_skew(one, course, sides, begin, unit)
        else:
            _draw_rate(one, panel, [*samples, *under], scale)
            _draw_under(one, under, panel, scale)
            _draw_line(one, samples, panel, scale, color=INK, lw=1.3, zorder=5)
        one.tick_params(labelbottom=panel is panels[-1])
    one.set_xlabel('time in s', size=NORMAL, labelpad=2)
    return sheet


def save(
    path: str | PathLike[str],
    course: Course,
    layout: AxisLayout | None = None,
    title: str = '',
    panels: Sequence[Panel] = WHOLE,
    unit: str = 'm',
    beneath: Course | None = None,
) -> None:
    """Draw a course into a file whose suffix tells its format (.png, .svg, .pdf).

    The same course gives the same file, byte for byte. Raises ValueError for an unknown format,
    OSError where the file cannot be written.
    """
    write(figure(course, layout, title, panels, unit, beneath), path)


# ------------------------------------------------------------------------------- what is shown


def _scale(span: float, unit: str) -> Scale:
    return Scale(1e3, 'mm') if unit == 'm' and span < 2.0 else Scale(1.0, unit)


def _view(course: Course, layout: AxisLayout | None) -> tuple[float, float]:
    """Return the lowest and the highest position to show, raw: the axis, or the course alone.

    A course that is short against its axis is shown closely.
    """
    positions = [
        position for sample in course.samples for position in (sample.position, sample.feedback)
    ]
    low, high = min(positions, default=0.0), max(positions, default=0.0)
    close, first, last = True, -inf, inf
    if layout is not None:
        first, last = layout.hard_stops
        flags = layout.switches.values()
        marks = [first, last, *(f.on_from for f in flags), *(f.on_to for f in flags)]
        known = [mark for mark in marks if isfinite(mark) and first <= mark <= last]
        lowest, highest = min([low, *known]), max([high, *known])
        close = 0.0 < high - low < CLOSE * (highest - lowest)
        low, high = (low, high) if close else (lowest, highest)
    little = 0.06 * (high - low) or 0.001
    margin = 4 * little if close else little
    return (
        max(low - margin, min(low, first) - little),
        min(high + margin, max(high, last) + little),
    )


# ----------------------------------------------------------------------------------- the profile


def _draw_rate(axes: Axes, panel: Panel, samples: Sequence[Sample], scale: Scale) -> None:
    """Prepare a panel of the commanded velocity or acceleration."""
    rates = [abs(getattr(sample, panel)) * scale.factor for sample in samples]
    largest = max((rate for rate in rates if isfinite(rate)), default=0.0) or 1.0
    axes.set_ylim(-1.2 * largest, 1.2 * largest)
    axes.axhline(0.0, color=GREY, lw=0.6, zorder=2)
    axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
    per = 's' if panel is Panel.VELOCITY else 's²'
    axes.set_ylabel(f'{panel}\ncommand\nin {scale.unit}/{per}', size=NORMAL)


def _draw_line(
    axes: Axes, samples: Sequence[Sample], what: str, scale: Scale, **style: Any
) -> list[Artist]:
    """Draw a quantity of a course over the time since it began."""
    times = [sample.time - samples[0].time for sample in samples]
    return [*axes.plot(times, [getattr(s, what) * scale.factor for s in samples], **style)]


def _draw_under(axes: Axes, samples: Sequence[Sample], what: str, scale: Scale) -> list[Artist]:
    """Draw a quantity of the course beneath, if there is one; return its legend."""
    if not samples:
        return []
    return _draw_line(
        axes, samples, what, scale, color=BLUE, lw=2.6, alpha=0.55, zorder=3.5, label='rehearsal'
    )
