# SPDX-License-Identifier: Apache-2.0
"""The sheet of a picture: its lengths, the sizes of its texts, and how it is written."""

from collections.abc import Sequence
from functools import cache
from os import PathLike
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.textpath import TextPath

# Lengths on the sheet: in.
WIDTH, LEFT = 7.9, 0.90
STRIP = 0.19
#: Right of the panels there is at least so much; of a gantry, whose skew has a scale there.
RIGHT, SCALE = 0.16, 0.80
# Lengths on the sheet: points.
POINTS = 72.0
SMALL, NORMAL, LARGE = 7.5, 8.5, 10.5
LINE = 11.0
#: From a panel to the labels that stand beside it.
BESIDE = 14.0


#: The formats of pictures, and what keeps a date out of them.
FORMATS = {'.png': None, '.svg': {'Date': None}, '.pdf': {'CreationDate': None}}


def save(drawn: Figure, path: str | PathLike[str]) -> None:
    """Write a picture; the same picture gives the same file.

    Raises ValueError for an unknown format, OSError where the file cannot be written.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise ValueError(f'{path}: a picture is written as .png, .svg or .pdf')
    with rc_context({'svg.hashsalt': 'homing_node', 'hatch.linewidth': 0.5}):
        drawn.savefig(path, dpi=160, metadata=FORMATS[suffix])


@cache
def text_width(text: str, size: float = SMALL) -> float:
    """Return the width of a text, points; measuring one takes 30 ms."""
    return float(TextPath((0.0, 0.0), text, size=size).get_extents().width)


def right_margin(labels: Sequence[str], least: float = RIGHT) -> float:
    """Return what labels beside the panels need, in."""
    widest = max(map(text_width, labels), default=0.0)
    return max(least, (BESIDE + widest) / POINTS + 0.1 if labels else 0.0)
