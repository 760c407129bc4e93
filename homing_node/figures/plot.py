# SPDX-License-Identifier: Apache-2.0
"""Draws a course as the manual does: the position diagram and the profile.

The home states are coloured bands behind all panels, named above them; the switches are bands
across the position diagram, named beside it. Whatever a colour tells is written too.
"""

from collections.abc import Iterator, Sequence
from math import ceil, floor, inf, isfinite
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from ..course import Course, Sample
from ..plant.layout import AxisLayout
from ..procedures.states import LATCHES, LIMIT_SWITCHES, Input, State, TextEnum
from .gantry_plot import draw_followers, draw_skew, sides_of
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
from .sheet import INNER, LARGE, LEFT, LINE, NORMAL, POINTS, SMALL, STRIP, WIDTH
from .state_strip import bands_of, draw_names, place_names


class Panel(TextEnum):
    """A part of the picture; all parts share the time axis."""

    POSITION = 'position'
    SKEW = 'skew'  # of a gantry, below its position diagram
    VELOCITY = 'velocity'
    ACCELERATION = 'acceleration'


POSITION_DIAGRAM = (Panel.POSITION,)
PROFILE = (Panel.VELOCITY, Panel.ACCELERATION)
WHOLE = POSITION_DIAGRAM + PROFILE

#: How strongly the states colour a panel: the position diagram has the switches besides.
TINT = {Panel.POSITION: 0.09, Panel.SKEW: 0.17, Panel.VELOCITY: 0.17, Panel.ACCELERATION: 0.17}

# Lengths on the sheet: in.
HEIGHTS = {Panel.POSITION: 2.8, Panel.SKEW: 1.1, Panel.VELOCITY: 1.1, Panel.ACCELERATION: 1.1}
TITLE, GAP, TIME_AXIS, LEGEND = 0.34, 0.09, 0.40, 0.17

#: A course shorter than this part of its axis is shown closely.
CLOSE = 0.3
#: More index marks than these would be a grey area.
MARKS = 60


class Scale(NamedTuple):
    """What a length in SI is multiplied with, and the unit in which it is shown then."""

    factor: float
    unit: str


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
    infinite); without it only what the course itself recorded is drawn. ``unit`` is that of the
    positions, m or rad; m is shown as mm where the view is shorter than 2 m.

    The position diagram of a gantry has its followers, too, as far as the leader's encoder would
    show them, and their skew below.
    """
    samples = course.samples
    sides = sides_of(course, layout)
    if sides and Panel.POSITION in panels:
        below = panels.index(Panel.POSITION) + 1
        panels = (*panels[:below], Panel.SKEW, *panels[below:])
    begin = samples[0].time if samples else 0.0
    end = (samples[-1].time - begin if samples else 0.0) or 1.0
    bands = list(bands_of(samples))
    view = _view(course, layout)
    under = beneath.samples if beneath is not None else []
    last = max(end, under[-1].time - under[0].time if under else 0.0)
    names = place_names(bands, last)
    scale = Scale(1e3, 'mm') if unit == 'm' and view[1] - view[0] < 2.0 else Scale(1.0, unit)

    lines = max((name.level for name in names), default=0)
    top = (TITLE if title else 0.06) + lines * LINE / POINTS + STRIP
    bottom = TIME_AXIS + (LEGEND if Panel.POSITION in panels else 0.0)
    height = top + sum(HEIGHTS[panel] + GAP for panel in panels) + bottom
    sheet = Figure((WIDTH, height), facecolor='white')
    FigureCanvasAgg(sheet)
    if title:
        sheet.text(LEFT / WIDTH, 1.0 - 0.08 / height, title, size=LARGE, weight='bold', va='top')

    def axes(bottom: float, tall: float) -> Axes:
        made = sheet.add_axes((LEFT / WIDTH, bottom / height, INNER / WIDTH, tall / height))
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
        one.yaxis.set_label_coords(-0.40 / INNER, 0.5)
        for band in bands:
            one.axvspan(band.begin, band.end, color=band.colour, alpha=TINT[panel], lw=0, zorder=0)
            one.axvline(band.end, color=GREY, lw=0.5, alpha=0.7, zorder=2.5)
        if panel is Panel.POSITION:
            legend = _draw_position(one, course, layout, begin, view, scale)
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
    drawn = figure(course, layout, title, panels, unit, beneath)
    dated = Path(path).suffix in ('.svg', '.pdf')
    date = {'.svg': {'Date': None}, '.pdf': {'CreationDate': None}}
    with rc_context({'svg.hashsalt': 'homing_node', 'hatch.linewidth': 0.5}):
        drawn.savefig(path, dpi=160, metadata=date[Path(path).suffix] if dated else None)


# ------------------------------------------------------------------------------- what is shown


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


# ---------------------------------------------------------------------------- the axis's picture


def _draw_position(
    axes: Axes,
    course: Course,
    layout: AxisLayout | None,
    begin: float,
    view: tuple[float, float],
    scale: Scale,
) -> list[Artist]:
    """Draw the position diagram; return what its legend explains."""
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
    draw_labels(axes, labels, low, high, HEIGHTS[Panel.POSITION])
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


# ----------------------------------------------------------------------------------- the profile


def _draw_rate(axes: Axes, panel: Panel, samples: Sequence[Sample], scale: Scale) -> None:
    """Prepare a panel of the commanded velocity or acceleration."""
    rates = [abs(getattr(sample, panel)) * scale.factor for sample in samples]
    largest = max((rate for rate in rates if isfinite(rate)), default=0.0) or 1.0
    axes.set_ylim(-1.2 * largest, 1.2 * largest)
    axes.axhline(0.0, color=GREY, lw=0.6, zorder=2)
    axes.yaxis.set_major_locator(MaxNLocator(5, symmetric=True))
    per = 's' if panel is Panel.VELOCITY else 's²'
    axes.set_ylabel(f'{panel}\nin {scale.unit}/{per}', size=NORMAL)


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
