# SPDX-License-Identifier: Apache-2.0
"""The steps of a hand-over as a table of data; handover.py follows it.

The rules of an undo:

- While the driver's coordinates are surely the old ones, the controllers are activated again
  (``Reactivate``).
- Once they may be changed, the controllers stay as they are: to activate one would perhaps move
  the axis. The message says so.
- A controller that does not activate, or moves the axis, is deactivated again (``Release``).
"""

from collections.abc import Mapping
from typing import NamedTuple

from ..procedures.states import TextEnum


class Step(TextEnum):
    """A step of the hand-over, as HandoverFailed names it."""

    Rest = 'rest'
    Deactivate = 'deactivate'
    Settle = 'settle'
    Apply = 'apply'
    See = 'see'
    Activate = 'activate'
    Reactivate = 'reactivate'
    Release = 'release'
    Done = 'done'
    Failed = 'failed'


class Asks(TextEnum):
    """What a step asks of others."""

    Deactivate = 'deactivate'
    Call = 'call'
    Look = 'look'
    Activate = 'activate'


class Event(TextEnum):
    """What ends a step. ``Late``: its time is over. ``Doubt``: no, but the feedback changed."""

    Rests = 'rests'
    Yes = 'yes'
    No = 'no'
    Doubt = 'doubt'
    Late = 'late'
    Seen = 'seen'
    Changed = 'changed'
    Canceled = 'canceled'
    Stopped = 'stopped'


class Row(NamedTuple):
    """A step: what it waits for, what it asks of others, and the step after each event."""

    waits: str
    asks: Asks | None
    after: Mapping[Event, Step]


#: An event that is not in a row does not end its step.
TABLE: Mapping[Step, Row] = {
    Step.Rest: Row(
        'the axis, and every other one, rests',
        None,
        {
            Event.Rests: Step.Deactivate,
            Event.Late: Step.Failed,
            Event.Canceled: Step.Failed,
            Event.Stopped: Step.Failed,
        },
    ),
    Step.Deactivate: Row(
        'the controllers are inactive',
        Asks.Deactivate,
        {
            Event.Yes: Step.Settle,
            Event.No: Step.Failed,
            Event.Late: Step.Reactivate,
            Event.Canceled: Step.Reactivate,
            Event.Stopped: Step.Failed,
        },
    ),
    Step.Settle: Row(
        'the axis rests without its controllers',
        None,
        {
            Event.Rests: Step.Apply,
            Event.Late: Step.Reactivate,
            Event.Canceled: Step.Reactivate,
            Event.Stopped: Step.Failed,
        },
    ),
    Step.Apply: Row(
        'the home is taken',
        Asks.Call,
        {
            Event.Yes: Step.See,
            Event.No: Step.Reactivate,
            Event.Doubt: Step.Failed,
            Event.Late: Step.Failed,
            Event.Stopped: Step.Failed,
        },
    ),
    Step.See: Row(
        'the feedback shows the home',
        Asks.Look,
        {
            Event.Seen: Step.Activate,
            Event.No: Step.Reactivate,
            Event.Late: Step.Failed,
            Event.Stopped: Step.Failed,
        },
    ),
    Step.Activate: Row(
        'the controllers are active, and the axis stays',
        Asks.Activate,
        {
            Event.Yes: Step.Done,
            Event.No: Step.Release,
            Event.Late: Step.Release,
            Event.Changed: Step.Release,
            Event.Stopped: Step.Release,
        },
    ),
    Step.Reactivate: Row(
        'the controllers are active again',
        Asks.Activate,
        {
            Event.Yes: Step.Failed,
            Event.No: Step.Failed,
            Event.Late: Step.Failed,
            Event.Stopped: Step.Failed,
        },
    ),
    Step.Release: Row(
        'the controllers are inactive again',
        Asks.Deactivate,
        {
            Event.Yes: Step.Failed,
            Event.No: Step.Failed,
            Event.Late: Step.Failed,
        },
    ),
}
ENDS = (Step.Done, Step.Failed)
#: The steps that only undo: what went wrong before them is what counts.
UNDO = (Step.Reactivate, Step.Release)
SWITCHES = (Asks.Deactivate, Asks.Activate)
