# SPDX-License-Identifier: Apache-2.0
"""Trends in words."""

from collections.abc import Callable

from ..parameters.units import Unit
from .trends import Trend


def words_of(trend: Trend, name: str, unit: Unit, pitch: float, when: Callable[[int], str]) -> str:
    """Say what the values of a quantity do.

    Args:
        trend: What they do.
        name: The name of the quantity.
        unit: The unit of the axis.
        pitch: The pitch of the index; 0: there is none.
        when: Returns the words for the number of a run.
    """
    since = when(trend.since)
    size = unit.length(trend.size, sign=True)
    if trend.kind == 'step':
        return f'{name} stepped by {size} at {since}{about_pitches(trend.size, pitch)}'
    if trend.kind == 'drift':
        return f'{name} drifts by {size} a run since {since}'
    if trend.kind == 'alternates':
        apart = unit.length(trend.size)
        return (
            f'{name} alternates between two values {apart} apart since {since}: is the flag loose?'
        )
    return (
        f'the spread of {name} has grown to {unit.length(trend.size)} since {since}: does the '
        'switch wear, or is something loose?'
    )


def about_pitches(change: float, pitch: float) -> str:
    """Return the words for a change of about a whole number of pitches, or ''."""
    count = round(abs(change) / pitch) if pitch else 0
    if not count or abs(abs(change) - count * pitch) > 0.1 * pitch:
        return ''
    pitches = 'one pitch' if count == 1 else f'{count} pitches'
    return f' (about {pitches} of the index: it may be another pulse)'
