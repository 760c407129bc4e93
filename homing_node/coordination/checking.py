# SPDX-License-Identifier: Apache-2.0
"""What the answers to a check say: may an axis home, is there nothing to do, is it locked?"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from ..core.outcome import Outcome
from ..parameters.line import cell_of
from ..procedures.states import Error
from .cells import Seen
from .turn import Checked


class Verdict(NamedTuple):
    """What a check says. Nothing of it: the axis may home.

    Attributes:
        outcome: how the turn ends without a goal.
        skipped: whether it ends because the axis is homed.
        lock: why the node of the axis refuses it still; asking again may find it open.
    """

    outcome: Outcome | None = None
    skipped: bool = False
    lock: Outcome | None = None


def judge(
    axis: str, required: Sequence[str], answers: Mapping[str, Checked], force: bool
) -> Verdict:
    """Judge the answers of the cells of an axis and of what it requires.

    Args:
        axis: The axis.
        required: What must be homed before it homes.
        answers: The answers by cell.
        force: Whether it is homed again if it is homed.
    """
    own = answers[cell_of(axis)]
    seen = own.seen.get(axis)
    if seen is None:
        text = f'{axis}: cell {cell_of(axis)} has no such axis'
        return Verdict(Outcome(Error.UnknownAxis, text))
    if seen.homed and not force:
        return Verdict(homed(seen), skipped=True)
    unmet = [one for one in required if not _homed(answers[cell_of(one)].seen.get(one))]
    if unmet:
        verb = 'is' if len(unmet) == 1 else 'are'
        text = f'{axis} requires {", ".join(unmet)}, which {verb} not homed'
        return Verdict(Outcome(Error.PrerequisiteMissing, text))
    name = f'{Error.PrerequisiteMissing}: '
    locks = [text for text in own.missing.get(axis, ()) if text.startswith(name)]
    if locks:
        text = f'{axis}: its node keeps it locked: {locks[0].removeprefix(name)}'
        return Verdict(lock=Outcome(Error.PrerequisiteMissing, text))
    return Verdict()


def homed(seen: Seen) -> Outcome:
    """Return the outcome of an axis that is homed."""
    return Outcome(
        Error.NoError,
        home_position_raw=seen.home_position_raw,
        home_offset=seen.home_offset,
        uncertainty=seen.uncertainty,
    )


def _homed(seen: Seen | None) -> bool:
    return seen is not None and seen.homed
