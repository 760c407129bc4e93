# SPDX-License-Identifier: Apache-2.0
"""Draws the homes of many runs as a control chart: the centre, and what is suspicious."""

from collections.abc import Sequence
from os import PathLike

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from ..memory.series import FAR, Series, Value
from ..parameters.units import Unit
from .palette import BLUE, DARK_GREY, DARK_VERMILLION, GREY, INK
from .sheet import save

MICRO = 1e6


def draw(path: str | PathLike[str], series: Series, title: str, unit: Unit) -> None:
    """Draw into a .png, .svg or .pdf.

    Raises ValueError for an unknown format, OSError where the file cannot be written.
    """
    save(figure(series, title, unit), path)


def figure(series: Series, title: str, unit: Unit) -> Figure:
    """Return the chart of a series that has a baseline."""
    drawn = Figure(figsize=(7.9, 3.6), layout='constrained')
    FigureCanvasAgg(drawn)
    axes = drawn.add_subplot()
    centre = series.centre
    least = max(one.uncertainty for one in series.values)
    bound = FAR * series.scale(least) * MICRO
    axes.axhline(0.0, color=INK, linewidth=0.8)
    for sign in (-1, 1):
        axes.axhline(sign * bound, color=GREY, linewidth=0.8, linestyle='--')
    for accepted, colour, name in (
        (True, BLUE, 'in the baseline'),
        (False, DARK_VERMILLION, 'suspicious'),
    ):
        found = [one for one in series.values if one.accepted is accepted]
        if found:
            _points(axes, found, centre, colour, name)
    axes.set_xlabel('run')
    axes.set_ylabel(f'from the centre, µ{unit}')
    axes.set_title(title, loc='left', color=INK, fontsize=10.5, fontweight='bold')
    axes.annotate(
        f'suspicious beyond: {FAR:g} scales, {bound:.3g} µ{unit}',
        (1.0, bound),
        xycoords=('axes fraction', 'data'),
        xytext=(-3, 2),
        textcoords='offset points',
        ha='right',
        color=DARK_GREY,
    )
    axes.legend(loc='best', frameon=False)
    for side in ('top', 'right'):
        axes.spines[side].set_visible(False)
    return drawn


def _points(axes: object, found: Sequence[Value], centre: float, colour: str, name: str) -> None:
    axes.errorbar(  # type: ignore[attr-defined]
        [one.run for one in found],
        [(one.value - centre) * MICRO for one in found],
        yerr=[one.uncertainty * MICRO for one in found],
        fmt='o',
        markersize=3.5,
        elinewidth=0.7,
        color=colour,
        label=name,
    )
