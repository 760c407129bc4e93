# SPDX-License-Identifier: Apache-2.0
"""Says in words where a recorded run differs from its rehearsal."""

from collections.abc import Iterator
from itertools import groupby, zip_longest

from ..core.outcome import Outcome
from ..course import Course
from ..parameters.units import Unit
from ..procedures.states import State


def differences(recorded: Course, rehearsed: Course, unit: Unit) -> list[str]:
    """Return sentences about the outcome, the way, the time and the home of two runs.

    Args:
        recorded: The run of the machine.
        rehearsed: The run of the simulation.
        unit: The unit of positions.
    """
    found = [*_way(recorded, rehearsed), *_time(recorded, rehearsed)]
    one, other = recorded.outcome, rehearsed.outcome
    if one is None or other is None:
        return [*found, 'the record ends before the run: its home is not known']
    return [*found, _home(one, other, unit)]


def _way(recorded: Course, rehearsed: Course) -> Iterator[str]:
    """Yield where the home states of two runs part."""
    ways = [state for state, _ in _stretches(recorded)], [s for s, _ in _stretches(rehearsed)]
    if ways[0] == ways[1]:
        yield f'both went through {", ".join(ways[0]) or "no state"}'
        return
    pairs = list(zip_longest(*ways, fillvalue='its end'))
    place, (one, other) = next((n, pair) for n, pair in enumerate(pairs) if pair[0] != pair[1])
    after = f'after {ways[0][place - 1]}' if place else 'at the start'
    yield f'they part {after}: the run went to {one}, the rehearsal to {other}'


def _time(recorded: Course, rehearsed: Course) -> Iterator[str]:
    """Yield how long both took, and in which state they differ most."""
    took, planned = recorded.duration, rehearsed.duration
    more = took - planned
    share = f' ({100.0 * more / planned:+.1f} %)' if planned else ''
    yield f'the run took {took:.3f} s, the rehearsal {planned:.3f} s: {more:+.3f} s{share}'
    one, other = list(_stretches(recorded)), list(_stretches(rehearsed))
    if [state for state, _ in one] != [state for state, _ in other] or not one:
        return
    gaps = [(a - b, state) for (state, a), (_, b) in zip(one, other, strict=True)]
    gap, state = max(gaps, key=lambda pair: abs(pair[0]))
    if abs(gap) >= 0.001:
        yield f'most of it in {state}: {gap:+.3f} s'


def _home(one: Outcome, other: Outcome, unit: Unit) -> str:
    if not (one.success and other.success):
        ends = ['homed' if each.success else f'ended with {each.error}' for each in (one, other)]
        return f'the run {ends[0]}, the rehearsal {ends[1]}'
    apart = one.home_position_raw - other.home_position_raw
    unsure = one.uncertainty + other.uncertainty
    where = (
        f'home was found at {one.home_position_raw:.6f} {unit} (raw), '
        f'{unit.length(apart, sign=True)} from where the rehearsal found it'
    )
    known = f'what is uncertain of both ({unit.length(unsure)})'
    if abs(apart) <= unsure:
        return f'{where}: within {known}'
    return f'{where}: more than {known}; is the layout true?'


def _stretches(course: Course) -> Iterator[tuple[str, float]]:
    """Yield each home state of a run, and how long it lasted, s."""
    starts = [
        (state, next(samples).time)
        for state, samples in groupby(course.samples, lambda sample: sample.state)
    ]
    ends = [time for _, time in starts[1:]]
    ends += [course.samples[-1].time] if course.samples else []
    for (state, begin), end in zip(starts, ends, strict=True):
        if state != State.Idle:
            yield state, end - begin
