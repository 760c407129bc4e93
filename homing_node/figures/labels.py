# SPDX-License-Identifier: Apache-2.0
"""Labels beside a panel that do not cover each other."""

from collections.abc import Sequence
from typing import NamedTuple

from matplotlib.axes import Axes

from .sheet import BESIDE, LINE, POINTS, SMALL


class Label(NamedTuple):
    """What stands beside a panel, and the height (as in the panel) that it names."""

    height: float
    text: str
    colour: str


def draw_labels(axes: Axes, labels: Sequence[Label], low: float, high: float, tall: float) -> None:
    """Write labels right of a panel, apart from each other, each tied to its height.

    The panel shows heights from ``low`` to ``high`` and is ``tall`` inches tall.
    """
    points = tall * POINTS / (high - low)
    ordered = sorted(label for label in labels if low <= label.height <= high)
    spread = _spread([(label.height - low) * points for label in ordered], LINE)
    for label, place in zip(ordered, spread, strict=True):
        axes.annotate(
            label.text,
            (1.0, label.height),
            xycoords=('axes fraction', 'data'),
            xytext=(BESIDE, place - (label.height - low) * points),
            textcoords='offset points',
            size=SMALL,
            color=label.colour,
            va='center',
            annotation_clip=False,
            arrowprops={
                'arrowstyle': '-',
                'color': label.colour,
                'lw': 0.6,
                'shrinkA': 0.0,
                'shrinkB': 0.0,
                'relpos': (0.0, 0.5),
            },
        )


def _spread(heights: Sequence[float], gap: float) -> list[float]:
    """Move ascending heights as little as it takes to be ``gap`` apart."""
    clusters: list[list[float]] = []  # of those that touch: each one's height less its place
    for place, height in enumerate(heights):
        clusters.append([height - place * gap])
        while len(clusters) > 1 and _mean(clusters[-2]) >= _mean(clusters[-1]):
            last = clusters.pop()
            clusters[-1] += last
    levels = [_mean(cluster) for cluster in clusters for _ in cluster]
    return [level + place * gap for place, level in enumerate(levels)]


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)
