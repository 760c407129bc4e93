# SPDX-License-Identifier: Apache-2.0
"""CiA 402 homing methods (object 0x6098) as aliases of home types.

A method is a home type and a homing direction. The home is the standard's: the same edge, passed
in the same direction, or the same index pulse. How the axis gets there may differ, and
:attr:`Method.differences` says how.

Source: CiA 402-2, homing mode; the manuals that doc/cia402.md names.
"""

import re
from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from .states import Direction, HomeType

#: How a method is written where a name is needed: ``'CiA402 17'``.
PREFIX = 'CiA402'

BACKS_OFF = (
    'a home switch that is on at the start: the axis leaves it fast, goes on by '
    'homing_reverse_distance and then searches as from anywhere else; the standard takes the '
    'edge on the way off'
)
LEAVES_LIMIT = (
    'a limit switch that is on at the start: the axis leaves it fast, goes on by '
    'homing_reverse_distance and then searches it again; the standard takes the edge or the index '
    'on the way off'
)
NO_REVERSAL = (
    'the standard has no limit reversal: a limit switch ahead ends the run '
    '(limit_reversal: true turns the axis there instead)'
)
ONE_REVERSAL = (
    'a second limit switch ahead in the same run ends it; the standard does not say how often an '
    'axis turns'
)
SECOND_PASS = (
    'the edge is passed twice, first fast and then slowly (HSHS), with homing_reverse_distance '
    'between the passes; HS takes it in one fast pass'
)
ONE_FAST_PASS = 'the edge is taken in the one fast pass; drives differ in which speed they use'
BOUNDED = 'the search is bounded (max_search_distance, max_z_pulse_distance); the standard is not'


class Method(NamedTuple):
    """A homing method: its number, the home type and the direction that it stands for.

    ``direction`` is None where nothing moves. ``limit_reversal`` tells whether a limit switch
    ahead turns the axis. ``motion`` and ``home`` are the standard's, in words.
    """

    number: int
    home_type: HomeType
    direction: Direction | None
    motion: str
    home: str
    differences: tuple[str, ...]
    limit_reversal: bool = True

    def __str__(self) -> str:
        return f'{PREFIX} {self.number}'


def _sides(direction: Direction) -> tuple[str, str]:
    """Return the sign and the limit's name of a direction."""
    return ('+', 'positive') if direction is Direction.Positive else ('-', 'negative')


def _on_limit(number: int, home_type: HomeType, direction: Direction, home: str) -> Method:
    sign, side = _sides(direction)
    motion = f'{sign} until the {side} limit switch is on, then back'
    return Method(number, home_type, direction, motion, home, (LEAVES_LIMIT,))


def _on_wide_switch(
    number: int, home_type: HomeType, direction: Direction, home: str, *differences: str
) -> Method:
    """Give a method whose home switch stays on up to the end of the axis."""
    sign, side = _sides(direction)
    other = '-' if sign == '+' else '+'
    motion = (
        f'{sign} while the home switch is off, {other} while it is on (it covers the {side} end)'
    )
    return Method(
        number, home_type, direction, motion, home, (*differences, BACKS_OFF, NO_REVERSAL), False
    )


def _on_momentary_switch(
    number: int, home_type: HomeType, direction: Direction, home: str, *differences: str
) -> Method:
    """Give a method whose home switch is on over a part of the axis; the limit ahead turns it."""
    sign, side = _sides(direction)
    motion = f'{sign} (the home switch is momentary); the {side} limit switch makes the axis turn'
    return Method(number, home_type, direction, motion, home, (*differences, ONE_REVERSAL))


def _index_methods() -> Iterator[Method]:
    plus, minus = Direction.Positive, Direction.Negative
    away, beyond = HomeType.HSReverseZPulse, HomeType.HSZPulse
    off_away, off_beyond = HomeType.HSOffReverseZPulse, HomeType.HSOffZPulse
    limit = HomeType.LSReverseZPulse
    yield _on_limit(1, limit, minus, 'first index to the right of where the limit switch falls')
    yield _on_limit(2, limit, plus, 'first index to the left of where the limit switch falls')
    yield _on_wide_switch(3, away, plus, "first index on the off side of the switch's edge")
    yield _on_wide_switch(4, beyond, plus, "first index on the on side of the switch's edge")
    yield _on_wide_switch(5, away, minus, "first index on the off side of the switch's edge")
    yield _on_wide_switch(6, beyond, minus, "first index on the on side of the switch's edge")
    yield _on_momentary_switch(
        7, away, plus, "first index to the left of the switch's left edge", BACKS_OFF
    )
    yield _on_momentary_switch(
        8, beyond, plus, "first index to the right of the switch's left edge", BACKS_OFF
    )
    yield _on_momentary_switch(
        9, off_away, plus, "first index to the left of the switch's right edge"
    )
    yield _on_momentary_switch(
        10, off_beyond, plus, "first index to the right of the switch's right edge"
    )
    yield _on_momentary_switch(
        11, away, minus, "first index to the right of the switch's right edge", BACKS_OFF
    )
    yield _on_momentary_switch(
        12, beyond, minus, "first index to the left of the switch's right edge", BACKS_OFF
    )
    yield _on_momentary_switch(
        13, off_away, minus, "first index to the right of the switch's left edge"
    )
    yield _on_momentary_switch(
        14, off_beyond, minus, "first index to the left of the switch's left edge"
    )


def _edge_methods() -> Iterator[Method]:
    plus, minus = Direction.Positive, Direction.Negative
    away, twice = HomeType.HSReverse, HomeType.HSHS
    off_away, off = HomeType.HSOffReverse, HomeType.HSOff
    limit = HomeType.LSOff
    yield _on_limit(17, limit, minus, 'where the limit switch falls')
    yield _on_limit(18, limit, plus, 'where the limit switch falls')
    yield _on_wide_switch(19, away, plus, 'where the switch falls, going -')
    yield _on_wide_switch(20, twice, plus, 'where the switch rises, going +', SECOND_PASS)
    yield _on_wide_switch(21, away, minus, 'where the switch falls, going +')
    yield _on_wide_switch(22, twice, minus, 'where the switch rises, going -', SECOND_PASS)
    yield _on_momentary_switch(
        23, away, plus, "the switch's left edge, where it falls, going -", BACKS_OFF
    )
    yield _on_momentary_switch(
        24, twice, plus, "the switch's left edge, where it rises, going +", SECOND_PASS, BACKS_OFF
    )
    yield _on_momentary_switch(
        25, off_away, plus, "the switch's right edge, where it rises, going -"
    )
    yield _on_momentary_switch(
        26, off, plus, "the switch's right edge, where it falls, going +", ONE_FAST_PASS
    )
    yield _on_momentary_switch(
        27, away, minus, "the switch's right edge, where it falls, going +", BACKS_OFF
    )
    yield _on_momentary_switch(
        28,
        twice,
        minus,
        "the switch's right edge, where it rises, going -",
        SECOND_PASS,
        BACKS_OFF,
    )
    yield _on_momentary_switch(
        29, off_away, minus, "the switch's left edge, where it rises, going +"
    )
    yield _on_momentary_switch(
        30, off, minus, "the switch's left edge, where it falls, going -", ONE_FAST_PASS
    )


def _methods() -> Iterator[Method]:
    yield from _index_methods()
    yield from _edge_methods()
    pulse, here = HomeType.ZPulse, HomeType.CurrentPos
    yield Method(33, pulse, Direction.Negative, '-', 'the next index', (BOUNDED,))
    yield Method(34, pulse, Direction.Positive, '+', 'the next index', (BOUNDED,))
    yield Method(35, here, None, 'none', 'here', ())
    yield Method(37, here, None, 'none', 'here', ())


#: Every method that has a home type, by its number.
METHODS: Mapping[int, Method] = MappingProxyType({m.number: m for m in _methods()})

#: How the numbers are listed in a message.
NUMBERS = '1 to 14, 17 to 30, 33 to 35 and 37'

_ALIAS = re.compile(rf'(?:{PREFIX}\s*)?([-+]?\d+)')


def method(value: object) -> Method | None:
    """Return the method that a value names (17, ``'CiA402 17'``), None where it names none.

    Raises ValueError where it is the number of no method.
    """
    if isinstance(value, bool) or not isinstance(value, int | str):
        return None
    found = _ALIAS.fullmatch(str(value).strip())
    if found is None:
        return None
    number = int(found[1])
    if number not in METHODS:
        kind = (
            "below 0 is the drive maker's own" if number < 0 else 'the others home on nothing here'
        )
        raise ValueError(f'{value!r} is none of the CiA 402 methods {NUMBERS} ({kind})')
    return METHODS[number]


def numbers_of(home_type: HomeType) -> tuple[int, ...]:
    """Return the numbers of the methods that a home type stands for."""
    return tuple(number for number, one in METHODS.items() if one.home_type is home_type)
