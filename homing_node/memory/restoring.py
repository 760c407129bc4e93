# SPDX-License-Identifier: Apache-2.0
"""May a home be taken over from before a restart? Only where the raw coordinates are proved.

They are continuous if the same publisher still sends the feedback, if the encoder is absolute, or
if it knows its place in a turn and a brake has held the axis. Every other case is refused, with
one of three texts.
"""

from typing import NamedTuple

from ..parameters.axis import AxisParameters
from ..procedures.states import Encoder
from .records import Rest
from .store import Contents

#: How each refusal begins.
MOVED = 'moved while off'
OTHER = 'another encoder, driver or file'
CHANGED = 'configuration changed'
#: A single_turn encoder proves nothing of a larger part of a turn.
PART_OF_TURN = 0.25


class Present(NamedTuple):
    """What is known of the axis now.

    Attributes:
        position: Where it is, raw, m or rad.
        configuration: The hash of everything that moves the origin.
        publisher: Who publishes the feedback.
        boot: The boot of the host.
    """

    position: float
    configuration: str
    publisher: str
    boot: str


class Restored(NamedTuple):
    """A home that is taken over; raw, m or rad."""

    home: float
    offset: float
    uncertainty: float


class Refused(NamedTuple):
    """Why a home is not taken over; '': there is none."""

    text: str = ''


def restored(contents: Contents, present: Present, p: AxisParameters) -> Restored | Refused:
    """Return the home that the file of an axis proves, or why it proves none."""
    rest = contents.rest
    if contents.foreign:
        return Refused(f'{OTHER}: {contents.foreign}')
    if not contents.whole:
        return Refused(f'{OTHER}: the file is not whole')
    if rest is None or rest.position is None or not (rest.homed or rest.moving):
        return Refused()
    if rest.configuration != present.configuration:
        return Refused(f'{CHANGED}: what moves the origin is not as it was')
    if rest.moving:
        return Refused(f'{MOVED}: the node ended during a run')
    same = bool(present.publisher) and (rest.publisher, rest.boot) == (
        present.publisher,
        present.boot,
    )
    if p.encoder is Encoder.incremental and not same:
        return Refused(_other_publisher(rest, present))
    if p.encoder is Encoder.single_turn and not same:
        refused = _not_held(rest, p)
        if refused:
            return Refused(refused)
        return _compared(rest, present, p, p.encoder_turn)
    return _compared(rest, present, p, p.wrap)


def _compared(
    rest: Rest, present: Present, p: AxisParameters, period: float
) -> Restored | Refused:
    """Compare where the axis is with where it was; positions may repeat by a period."""
    then = rest.position or 0.0
    turns = period * round((present.position - then) / period) if period else 0.0
    moved = present.position - turns - then
    limit, name = p.restore_tolerance, 'restore_tolerance'
    if p.encoder is Encoder.single_turn and period and PART_OF_TURN * period < limit:
        limit, name = PART_OF_TURN * period, 'a quarter of encoder_turn'
    if abs(moved) > limit:
        return Refused(
            f'{MOVED}: the axis was at {then:.6g} {p.unit} and is at '
            f'{present.position - turns:.6g} {p.unit}, {p.unit.length(moved, sign=True)}, more '
            f'than {p.unit.length(limit)} ({name})'
        )
    return Restored(rest.home + turns, rest.offset + turns, rest.uncertainty)


def _other_publisher(rest: Rest, present: Present) -> str:
    if rest.boot != present.boot:
        return f'{OTHER}: the host was started anew, and the encoder is incremental'
    return (
        f'{OTHER}: the feedback comes from {_name(present.publisher)}, which is not the '
        f'{_name(rest.publisher)} of before, and the encoder is incremental'
    )


def _not_held(rest: Rest, p: AxisParameters) -> str:
    """Return why a single_turn encoder proves nothing, '' if a brake has held the axis."""
    if not p.encoder_turn:
        return f'{OTHER}: encoder_turn is not set, so that the turns of the encoder are not known'
    if not p.brake:
        return f'{MOVED}: nothing has held the axis (brake: false); it may have gone whole turns'
    if not rest.ended:
        return f'{MOVED}: the node has not ended in order, and the axis may have gone whole turns'
    return ''


def _name(publisher: str) -> str:
    """Return the names of the publishers without their ids."""
    return ', '.join(one.partition(' ')[0] for one in publisher.split('; ')) or 'nobody'
