# SPDX-License-Identifier: Apache-2.0
"""One figure beside its bare counterpart: what every benchmark yields, and how it is shown."""

import os
import platform
from collections.abc import Callable, Iterable, Sequence
from importlib.metadata import version
from pathlib import Path
from statistics import median, quantiles
from time import perf_counter
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

COLUMNS = ('figure', 'unit', 'ours', 'bare', 'ours / bare', 'goal', '')


class Figure(NamedTuple):
    """A figure of ours and its counterpart from the same run: one value a repeat.

    ``bare`` is empty where there is none. ``goal`` says what is wanted, ``met`` whether it is
    (None: there is no goal).
    """

    what: str
    unit: str
    ours: Sequence[float]
    bare: Sequence[float] = ()
    goal: str = ''
    met: bool | None = None

    @property
    def ratios(self) -> list[float]:
        return [a / b for a, b in zip(self.ours, self.bare, strict=False) if b]

    @property
    def cells(self) -> tuple[str, ...]:
        met = '' if self.met is None else 'met' if self.met else 'missed'
        return (
            self.what,
            self.unit,
            spread(self.ours),
            spread(self.bare),
            spread(self.ratios),
            self.goal,
            met,
        )


def within(
    what: str, unit: str, ours: Sequence[float], bare: Sequence[float], factor: float
) -> Figure:
    """Return a figure whose median ratio to its counterpart must not exceed a factor."""
    figure = Figure(what, unit, ours, bare, f'≤ {factor:g} ×')
    return figure._replace(met=median(figure.ratios) <= factor)


def spread(values: Sequence[float]) -> str:
    """Tell the median and the quartiles of some values."""
    if not values:
        return ''
    if len(values) == 1 or min(values) == max(values):
        return f'{values[0]:.4g}'
    low, middle, high = quantiles(values, n=4, method='inclusive')
    return f'{middle:.4g} ({low:.3g}–{high:.3g})'


def nth(values: Iterable[float], share: float) -> float:
    """Return the value below which a share of the values lies."""
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))]


def seconds(work: Callable[[], object]) -> float:
    """Return how long some work takes."""
    start = perf_counter()
    work()
    return perf_counter() - start


def alternately(
    repeats: int, *works: Callable[[], float], warm_up: bool = True
) -> list[list[float]]:
    """Return what each of some measurements finds, taken in turns, so that all see one machine."""
    if warm_up:
        for work in works:
            work()
    turns = [[work() for work in works] for _ in range(repeats)]
    return [list(column) for column in zip(*turns, strict=True)]


def machine() -> str:
    """Name the machine and what runs on it."""
    cpu = next(
        (
            line.split(':')[1].strip()
            for line in Path('/proc/cpuinfo').read_text(encoding='utf-8').splitlines()
            if line.startswith('model name')
        ),
        platform.machine(),
    )
    load = ' '.join(f'{one:.1f}' for one in os.getloadavg())
    return (
        f'{cpu}, {os.cpu_count()} cores, {platform.system()} {platform.release()}, '
        f'CPython {platform.python_version()}, ruckig {version("ruckig")}; load {load}'
    )


def show(title: str, figures: Sequence[Figure], markdown: bool = False) -> None:
    """Print a table of figures: median (quartiles) over the repeats."""
    if markdown:
        print(f'\n## {title}\n')
        rows: list[Sequence[str]] = [COLUMNS, ['---'] * len(COLUMNS)]
        rows += [figure.cells for figure in figures]
        for row in rows:
            print('| ' + ' | '.join(row) + ' |')
        return
    table = Table(title=title, title_justify='left')
    for column in COLUMNS:
        table.add_column(column, justify='left' if column in ('figure', 'goal') else 'right')
    for figure in figures:
        table.add_row(*figure.cells, style='red' if figure.met is False else None)
    Console(width=None if os.isatty(1) else 150).print(table)
