# SPDX-License-Identifier: Apache-2.0
"""The turn of one axis within a request, as a table of data; turn.py follows it.

The rules behind the table:

- A goal leaves only after a check: the cells have just said that the axis may home.
- Every phase that waits for a cell ends by itself, for events may be lost.
- A goal that may still run when its turn has ended is canceled, whatever ended the turn. So is a
  goal that is accepted later (`Turn.accepted`).
- The result counts, even if it comes after a cancel: it says what became of the axis.
"""

import math
from collections.abc import Mapping
from typing import NamedTuple

from ..procedures.states import Error, TextEnum


class Phase(TextEnum):
    """Where the turn of an axis stands."""

    Waiting = 'waiting'
    Checking = 'checking'
    Sent = 'sent'
    Running = 'running'
    Asking = 'asking'
    Stopping = 'stopping'
    Ended = 'ended'


class Asks(TextEnum):
    """What is asked of a cell."""

    Check = 'check'
    Goal = 'goal'
    Result = 'result'
    Cancel = 'cancel'


class Event(TextEnum):
    """What happens to a turn.

    Attributes:
        Due: It is the axis's turn.
        Holds: The check says that the axis may home.
        Over: There is nothing to do, or the axis may not home.
        Accepted: The cell has accepted the goal.
        Refused: The cell has refused the goal.
        Result: The result of the goal.
        Gone: The cell does not know the goal.
        Silent: The cell lives, but neither the goal nor the axis shows a run.
        Lost: The cell is silent.
        Restarted: The cell has restarted: it knows neither goals nor homes.
        Cancel: The axis must not home, or must stop.
        Late: The patience of the phase is over.
    """

    Due = 'due'
    Holds = 'holds'
    Over = 'over'
    Accepted = 'accepted'
    Refused = 'refused'
    Result = 'result'
    Gone = 'gone'
    Silent = 'silent'
    Lost = 'lost'
    Restarted = 'restarted'
    Cancel = 'cancel'
    Late = 'late'


class To(NamedTuple):
    """The phase after an event, and the error that it makes; None: the event brings the outcome.

    An error that came earlier in the turn stays.
    """

    phase: Phase
    error: Error | None = None


class Row(NamedTuple):
    """A phase: what it waits for, what it asks of the cell, for how long (s), what follows."""

    waits: str
    asks: Asks | None
    patience: float
    after: Mapping[Event, To]


#: The events of a goal that its cell no longer knows how to end.
_LOSSES: Mapping[Event, To] = {
    Event.Lost: To(Phase.Ended, Error.CellLost),
    Event.Restarted: To(Phase.Ended, Error.CellLost),
}

#: An event that is not in a row changes nothing.
TABLE: Mapping[Phase, Row] = {
    Phase.Waiting: Row(
        'its turn',
        None,
        math.inf,
        {
            Event.Due: To(Phase.Checking),
            Event.Over: To(Phase.Ended),
            Event.Cancel: To(Phase.Ended, Error.Canceled),
        },
    ),
    Phase.Checking: Row(
        'the cells to say what is homed',
        Asks.Check,
        5.0,
        {
            Event.Holds: To(Phase.Sent),
            Event.Over: To(Phase.Ended),
            Event.Cancel: To(Phase.Ended, Error.Canceled),
            Event.Lost: To(Phase.Ended, Error.CellLost),
            Event.Late: To(Phase.Ended, Error.CellLost),
        },
    ),
    Phase.Sent: Row(
        'the goal to be accepted',
        Asks.Goal,
        5.0,
        {
            Event.Accepted: To(Phase.Running),
            Event.Refused: To(Phase.Ended),
            Event.Result: To(Phase.Ended),
            Event.Cancel: To(Phase.Stopping, Error.Canceled),
            Event.Late: To(Phase.Stopping, Error.ResultLost),
            **_LOSSES,
        },
    ),
    Phase.Running: Row(
        'the result',
        None,
        math.inf,
        {
            Event.Result: To(Phase.Ended),
            Event.Gone: To(Phase.Ended, Error.ResultLost),
            Event.Silent: To(Phase.Asking),
            Event.Cancel: To(Phase.Stopping, Error.Canceled),
            **_LOSSES,
        },
    ),
    Phase.Asking: Row(
        'the result, asked for once more',
        Asks.Result,
        2.0,
        {
            Event.Result: To(Phase.Ended),
            Event.Gone: To(Phase.Ended, Error.ResultLost),
            Event.Cancel: To(Phase.Stopping, Error.Canceled),
            Event.Late: To(Phase.Ended, Error.ResultLost),
            **_LOSSES,
        },
    ),
    Phase.Stopping: Row(
        'the axis to rest',
        Asks.Cancel,
        10.0,
        {
            Event.Accepted: To(Phase.Stopping),
            Event.Refused: To(Phase.Ended),
            Event.Result: To(Phase.Ended),
            Event.Gone: To(Phase.Ended, Error.ResultLost),
            Event.Silent: To(Phase.Ended, Error.Canceled),
            Event.Late: To(Phase.Ended, Error.ResultLost),
            **_LOSSES,
        },
    ),
    Phase.Ended: Row('nothing', None, math.inf, {}),
}
#: The phases in which a goal may run at the cell.
UNDER_WAY = (Phase.Sent, Phase.Running, Phase.Asking, Phase.Stopping)
#: What proves that a goal does not run, or does not run any more.
PROOFS = (Event.Refused, Event.Result, Event.Gone, Event.Restarted)
#: The phases that count for `at_once`.
BUSY = (Phase.Checking, *UNDER_WAY)
