# SPDX-License-Identifier: Apache-2.0
"""Draws a home type's state diagram as SVG.

The normal path goes down the middle. Beside the boxes that lead there stand, on the left, what
the start position changes and, on the right, the reversal from a limit switch. What bounds a
search is written in its box, with the error that it gives.
"""

from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import NamedTuple
from xml.sax.saxutils import escape

from ..procedures.events import CONDITIONS, Event
from ..procedures.procedure import Procedure
from .diagram import END, Arrow, Box, arrows, bounds, boxes, motions
from .palette import DARK_GREY, DARK_VERMILLION, GREY, INK, state_colour

# Lengths in px.
SIZE, SMALL = 13.0, 11.0
BAR, ROW, LINE, PAD = 24.0, 24.0, 15.0, 10.0
INSIDE, BETWEEN, BESIDE, MARGIN = 40.0, 44.0, 116.0, 14.0
#: Mean width of a letter over its size; usual fonts have less.
LETTER = 0.6

HEAD = """\
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}"\
 height="{height:.0f}" font-family="DejaVu Sans, Verdana, Arial, sans-serif" font-size="{size:g}">
<title>{title}</title>
<defs><marker id="tip" viewBox="0 0 8 8" refX="7.5" refY="4" markerWidth="8" markerHeight="8"\
 orient="auto"><path d="M0 0.5 8 4 0 7.5z" fill="{ink}"/></marker></defs>
<rect width="100%" height="100%" fill="white"/>
"""


class Place(NamedTuple):
    """Where a box stands."""

    x: float
    y: float
    width: float
    height: float

    @property
    def middle(self) -> float:
        return self.x + self.width / 2

    @property
    def right(self) -> float:
        return self.x + self.width

    @property
    def bottom(self) -> float:
        return self.y + self.height


class Columns(NamedTuple):
    """The boxes from left to right, each column from its top."""

    left: list[str]
    middle: list[str]
    right: list[str]


def svg(procedure: Procedure) -> str:
    """Return the state diagram of a home type as an SVG document."""
    drawn = {box.name: box for box in boxes(procedure)}
    links = arrows(procedure)
    columns = _columns(next(iter(drawn)), drawn, links)
    places = _places(procedure, drawn, links, columns)
    parts = [_dot(places[columns.middle[0]])]
    parts += (part for box in drawn.values() for part in _box(procedure, box, places[box.name]))
    parts += _vertical(columns, links, places)
    for side, aside in ((-1, columns.left), (1, columns.right)):
        parts += _sideways(side, aside, columns.middle, links, places)
    parts.append(_homed(places[END]))
    width = max(place.right for place in places.values()) + MARGIN
    height = max(place.bottom for place in places.values()) + MARGIN
    head = HEAD.format(
        width=width,
        height=height,
        size=SIZE,
        ink=INK,
        title=f'State diagram of {procedure.home_type}',
    )
    return head + '\n'.join(parts) + '\n</svg>\n'


# ------------------------------------------------------------------------------ where it stands


def _columns(first: str, names: Iterable[str], links: list[Arrow]) -> Columns:
    """Put the normal path into the middle, the reversal right of it, and the rest left."""
    middle = [first]
    while middle[-1] != END:
        middle.append(
            next(
                link.target
                for link in links
                if link.source == middle[-1]
                and link.target not in middle
                and link.label not in CONDITIONS
            )
        )
    aside = [name for name in names if name not in middle]
    right = [
        name
        for name in aside
        if any(link.target == name and link.label == Event.LIMIT_AHEAD for link in links)
    ]
    return Columns([name for name in aside if name not in right], middle, right)


def _places(
    procedure: Procedure, drawn: dict[str, Box], links: list[Arrow], columns: Columns
) -> dict[str, Place]:
    """Place the boxes: the middle column first, the others beside what leads to them."""
    sizes = {name: _size(procedure, box) for name, box in drawn.items()} | {END: (16.0, 16.0)}
    places: dict[str, Place] = {}
    x = MARGIN
    for column in columns:
        width = max((sizes[name][0] for name in column), default=0.0)
        y = MARGIN + BETWEEN
        for name in column:
            if column is not columns.middle:
                sources = {link.source for link in links if link.target == name}
                first = next(each for each in columns.middle if each in sources)
                y = max(y, _top(first, columns.middle, sizes))
            places[name] = Place(x, y, width, sizes[name][1])
            y += sizes[name][1] + BETWEEN
        x += width + BESIDE if width else 0.0
    return places


def _top(name: str, column: list[str], sizes: dict[str, tuple[float, float]]) -> float:
    above = column[: column.index(name)]
    return MARGIN + BETWEEN + sum(sizes[each][1] + BETWEEN for each in above)


def _size(procedure: Procedure, box: Box) -> tuple[float, float]:
    """Return the width and the height of a box."""
    rows, failures = len(box.steps), _failures(procedure, box)
    texts = [SIZE * len(text) for text in motions(procedure, box)]
    inner = [SMALL * len(label) * 2 for _, _, label in _inner_arrows(procedure, box)]
    widths = [1.1 * SIZE * len(box.title), *texts, *inner, *(SMALL * len(f) for f in failures)]
    body = rows * ROW + (rows - 1) * INSIDE + len(failures) * LINE
    return LETTER * max(widths) + 4 * PAD, BAR + body + (2 * PAD if rows > 1 else PAD)


def _failures(procedure: Procedure, box: Box) -> list[str]:
    """Return the lines that tell what bounds the searches of a box."""
    return [
        line
        for source, error, bound in bounds(procedure)
        if source == box.name
        for line in (f'beyond {bound}:', error)
    ]


def _inner_arrows(procedure: Procedure, box: Box) -> Iterator[tuple[int, int, str]]:
    """Yield (row, row, label) of the arrows inside a box."""
    for row, step in enumerate(box.steps):
        for event, target in procedure.rows[step].on.items():
            if target in box.steps:
                yield row, box.steps.index(target), str(event)


# --------------------------------------------------------------------------------- what is drawn


def _text(
    x: float,
    y: float,
    text: str,
    *,
    anchor: str = 'middle',
    size: float = SIZE,
    colour: str = INK,
    bold: bool = False,
) -> str:
    weight = ' font-weight="bold"' if bold else ''
    return (
        f'<text x="{x:g}" y="{y:g}" text-anchor="{anchor}" font-size="{size:g}" '
        f'fill="{colour}"{weight}>{escape(text)}</text>'
    )


def _label(x: float, y: float, text: str, *, left: bool) -> str:
    return _text(
        x - 7 if left else x + 7,
        y,
        text,
        anchor='end' if left else 'start',
        size=SMALL,
        colour=DARK_GREY,
    )


def _line(*points: tuple[float, float]) -> str:
    path = ' '.join(f'{x:g} {y:g}' for x, y in points)
    return f'<path d="M{path}" fill="none" stroke="{INK}" marker-end="url(#tip)"/>'


def _dot(first: Place) -> str:
    return f'<circle cx="{first.middle:g}" cy="{MARGIN + 7:g}" r="7" fill="{INK}"/>' + _line(
        (first.middle, MARGIN + 14), (first.middle, first.y)
    )


def _homed(end: Place) -> str:
    x, y = end.middle, end.y + 8
    return (
        f'<circle cx="{x:g}" cy="{y:g}" r="8" fill="white" stroke="{INK}"/>'
        f'<circle cx="{x:g}" cy="{y:g}" r="4.5" fill="{INK}"/>'
        + _text(x + 14, y + 4.5, 'homed', anchor='start')
    )


def _box(procedure: Procedure, box: Box, place: Place) -> Iterator[str]:
    x, y, width, height = place
    colour = state_colour(box.steps[0].state)
    yield (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6" fill="{colour}"/>'
    )
    yield (
        f'<path d="M{x:g} {y + BAR:g}h{width:g}v{height - BAR - 6:g}a6 6 0 0 1-6 6'
        f'h{12 - width:g}a6 6 0 0 1-6-6z" fill="white"/>'
    )
    yield (
        f'<rect x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" rx="6" fill="none" '
        f'stroke="{GREY}"/>'
    )
    yield _text(place.middle, y + 17, box.title, bold=True)
    several = len(box.steps) > 1
    top = y + BAR + (PAD if several else 0.0)
    for row, text in enumerate(motions(procedure, box)):
        level = top + row * (ROW + INSIDE)
        if several:
            yield (
                f'<rect x="{x + PAD:g}" y="{level:g}" width="{width - 2 * PAD:g}" '
                f'height="{ROW:g}" rx="4" fill="#f6f6f6" stroke="{GREY}"/>'
            )
        yield _text(place.middle, level + 16.5, text)
    inner = list(_inner_arrows(procedure, box))
    for source, target, label in inner:
        level = top + min(source, target) * (ROW + INSIDE) + ROW
        down = target > source
        shift = 0.0 if len(inner) == 1 else -6.0 if down else 6.0
        ends = [(place.middle + shift, level), (place.middle + shift, level + INSIDE)]
        yield _line(*(ends if down else ends[::-1]))
        yield _label(place.middle + shift, level + INSIDE / 2 + 4, label, left=shift < 0.0)
    failures = _failures(procedure, box)
    for line, text in enumerate(reversed(failures)):
        yield _text(
            place.middle, place.bottom - 7 - line * LINE, text, size=SMALL, colour=DARK_VERMILLION
        )


def _vertical(columns: Columns, links: list[Arrow], places: dict[str, Place]) -> Iterator[str]:
    """Draw the arrows between neighbours in the middle column."""
    for upper, lower in pairwise(columns.middle):
        between = [link for link in links if {link.source, link.target} == {upper, lower}]
        left, right = between[: len(between) // 2], between[len(between) // 2 :]
        for side, here in ((-1, left), (1, right)):
            x = places[upper].middle + (side * 14.0 if left else 0.0)
            for link in here:
                ends = [(x, places[upper].bottom), (x, places[lower].y)]
                yield _line(*(ends if link.source == upper else ends[::-1]))
                yield _label(x, sum(y for _, y in ends) / 2 + 4, link.label, left=side < 0)
                x += side * (LETTER * SMALL * len(link.label) + 21.0)  # clear of the label


def _sideways(
    side: int, aside: list[str], middle: list[str], links: list[Arrow], places: dict[str, Place]
) -> Iterator[str]:
    """Draw the arrows between the middle column and the one on a side of it."""
    for name in middle:
        here = places[name]
        own = [
            link
            for link in links
            if name in (link.source, link.target)
            and (link.source in aside or link.target in aside)
        ]
        for n, link in enumerate(own):
            there = places[link.target if link.source == name else link.source]
            y = here.y + BAR / 2 + n * ROW
            begin = here.right if side > 0 else here.x
            if y < there.bottom - 6:
                path = [(begin, y), (there.x if side > 0 else there.right, y)]
            else:
                path = [(begin, y), (there.middle, y), (there.middle, there.bottom)]
            yield _line(*(path if link.source == name else path[::-1]))
            yield _label(begin + side * 5, y - 4, link.label, left=side < 0)
