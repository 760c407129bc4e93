# SPDX-License-Identifier: Apache-2.0
"""A survey in words, and as a layout file."""

from collections.abc import Iterator, Sequence
from math import inf, isnan

from ..parameters.units import Unit
from ..plant.layout import LAYOUT, SWITCHES
from .judgement import Survey

#: The keys of a layout that a survey finds, besides the switches, in the order of the file.
OTHERS = ('index_pitch', 'index_offset', 'touch_probe', 'start', 'lag')


def layout_text(axis: str, survey: Survey, unit: Unit, about: Sequence[str] = ()) -> str:
    """Return a layout file of one axis, with how exact each number is, as YAML.

    Args:
        axis: The name of the axis.
        survey: What is known of it.
        unit: The unit of its positions.
        about: Lines that stand at the top as comments.
    """
    lines = [f'# {line}' for line in about]
    lines += [f'{axis!r}:', *(f'  {line}' for line in _entries(survey, unit))]
    for title, texts in (
        ('Doubts', [one.text for one in survey.doubts]),
        ('Seen', survey.seen),
        ('Not seen', survey.unseen),
    ):
        if texts:
            lines += [f'  # {title}:', *(f'  # - {text}' for text in texts)]
    return '\n'.join(lines) + '\n'


def _entries(survey: Survey, unit: Unit) -> Iterator[str]:
    layout, exact = survey.layout, survey.exact
    yield f'hard_stops: {_pair(*layout.hard_stops)}'
    for name in SWITCHES:
        flag = layout.switches.get(name)
        if flag is None:
            continue
        halves = [exact.get(f'{name}[{n}]') for n in (0, 1)]
        known = [unit.length(half) for half in halves if half is not None]
        comment = f'  # ± {", ± ".join(known)}' if known else ''
        yield f'{name}: {_pair(flag.on_from, flag.on_to)}{comment}'
        key = f'{name}_hysteresis'
        if key in exact:
            yield f'{key}: {_number(flag.hysteresis)}  # ± {unit.length(exact[key])}'
    flags = {**layout.stays_off, **layout.switches}
    inverted = [name for name in SWITCHES if name in flags and flags[name].inverted]
    if inverted:
        yield f'inverted: [{", ".join(inverted)}]'
    if layout.stays_off:
        yield f'stays_off: [{", ".join(layout.stays_off)}]'
    for key in OTHERS:
        value = getattr(layout, key)
        if value is None or (key != 'start' and value == LAYOUT[key].default) or isnan(value):
            continue
        comment = f'  # ± {unit.length(exact[key])}' if key in exact else ''
        yield f'{key}: {_number(value)}{comment}'
    if layout.switch_rate is not None:
        yield f'switch_rate: {_number(layout.switch_rate)}'


def _pair(low: float, high: float) -> str:
    return f'[{_number(low)}, {_number(high)}]'


def _number(value: float) -> str:
    """Return a number as YAML, null if it is not known."""
    if abs(value) == inf:
        return 'null'
    text = f'{value:.9g}'
    return text if any(sign in text for sign in '.e') else f'{text}.0'
