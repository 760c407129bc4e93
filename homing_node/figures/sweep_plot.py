# SPDX-License-Identifier: Apache-2.0
"""Draws what runs from everywhere along an axis came to: time and outcome over the start."""

from collections.abc import Sequence
from os import PathLike

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..plant.layout import AxisLayout
from ..procedures.states import LIMIT_SWITCHES, Input
from ..rehearsal.sweep import Trial
from .palette import BLUE, DARK_GREY, DARK_VERMILLION, GREEN, GREY, INK, VERMILLION
from .sheet import save

MARKS = 'Xsv^DP*hd<>'
SMALL = 7.5


def draw(
    path: str | PathLike[str],
    trials: Sequence[Trial],
    layout: AxisLayout,
    title: str = '',
    unit: str = 'm',
) -> None:
    """Draw into a .png, .svg or .pdf; the same trials give the same file.

    Raises ValueError for an unknown format, OSError where the file cannot be written.
    """
    save(figure(trials, layout, title, unit), path)


def figure(
    trials: Sequence[Trial], layout: AxisLayout, title: str = '', unit: str = 'm'
) -> Figure:
    """Draw time and outcome over the start position; m is shown as mm below 2 m."""
    low, high = trials[0].start, trials[-1].start
    margin = 0.03 * (high - low) or 0.001
    view = low - margin, high + margin
    k, unit = (1e3, 'mm') if unit == 'm' and high - low < 2.0 else (1.0, unit)
    sheet = Figure((7.9, 3.6), facecolor='white', layout='constrained')
    FigureCanvasAgg(sheet)
    axes = sheet.subplots()
    axes.set_title(title, loc='left', fontsize=10.5, fontweight='bold', pad=30)
    axes.set_xlim(view[0] * k, view[1] * k)
    _draw_axis(axes, layout, view, k)
    axes.plot(
        [trial.start * k for trial in trials],
        [trial.course.duration for trial in trials],
        color=GREY,
        lw=0.8,
        zorder=3,
    )
    outcomes = dict.fromkeys(trial.error for trial in trials)
    for n, error in enumerate(sorted(outcomes)):
        points = [
            (trial.start * k, trial.course.duration) for trial in trials if trial.error == error
        ]
        axes.plot(
            *zip(*points, strict=True),
            MARKS[n % len(MARKS)] if error else 'o',
            ms=6 if error else 4,
            mfc=VERMILLION if error else GREEN,
            mec=INK,
            mew=0.4,
            ls='',
            label=error or 'homed',
            zorder=5 if error else 4,
        )
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel(f'start position in {unit}')
    axes.set_ylabel('time in s')
    axes.legend(loc='upper left', bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
    return sheet


def _draw_axis(axes: Axes, layout: AxisLayout, view: tuple[float, float], k: float) -> None:
    """Draw the hard stops, and the switches with their names above, one line higher each."""
    shown = [
        (max(flag.on_from, view[0]), min(flag.on_to, view[1]), Input(name))
        for name, flag in layout.switches.items()
    ]
    ends = float('-inf'), float('-inf')
    for left, right, name in sorted(each for each in shown if each[0] < each[1]):
        colour = DARK_VERMILLION if name in LIMIT_SWITCHES else BLUE
        axes.axvspan(left * k, right * k, color=colour, alpha=0.16, lw=0.0)
        middle, text = (left + right) / 2, name.text.removesuffix(' switch')
        half = 0.0055 * len(text) * (view[1] - view[0])
        line = 0 if middle - half > ends[0] else 1
        ends = (middle + half, ends[1]) if line == 0 else (ends[0], middle + half)
        axes.annotate(
            text,
            (middle * k, 1.0),
            xycoords=('data', 'axes fraction'),
            xytext=(0, 3 + 10 * line),
            textcoords='offset points',
            ha='center',
            fontsize=SMALL,
            color=colour,
        )
    for stop in layout.hard_stops:
        if view[0] <= stop <= view[1]:
            axes.axvline(stop * k, color=DARK_GREY, lw=1.5)
