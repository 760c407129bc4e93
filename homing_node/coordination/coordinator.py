# SPDX-License-Identifier: Apache-2.0
"""The coordinator: knows the cells, runs requests over them, guards what axes require.

The shell calls a method for each event, :meth:`Coordinator.tick` some times a second, and does
what :meth:`Coordinator.take_asks` returns. Events may be lost, late or doubled: an answer counts
only with the number of the question that is open. All times are of one monotonic clock, in s.
"""

from collections.abc import Iterable, Sequence

from ..core.outcome import Outcome
from ..parameters.line import Line, cell_of
from ..procedures.states import Error
from .cells import Cells, Seen
from .checking import judge
from .claims import Claims
from .preview import Preview
from .request import Request
from .stray_goals import StrayGoals
from .turn import Ask, Checked, Turn
from .turn_table import BUSY, UNDER_WAY, Asks, Event, Phase

#: A goal of which nothing was seen for this time is silent, s.
SILENT = 2.0
#: When a check that was not answered is repeated, s.
UNANSWERED = 1.0
#: When a check that met a lock is repeated, and for how long, s.
LOCKED, INSIST = 0.2, 3.0
#: After a longer gap between two ticks the coordinator itself did not listen, s.
DEAF = 0.3


class Coordinator:
    """All requests of one coordinator.

    Attributes:
        line: the parameters.
        cells: the cells, by name.
        requests: those that have not ended.
        claims: what other coordinators claim.
        closed: whether it ends, so that every request is refused.
    """

    def __init__(self, line: Line) -> None:
        self.line = line
        self.cells = Cells(line)
        self.closed = False
        self.requests: list[Request] = []
        self._previews: list[Preview] = []
        self._turns: dict[int, tuple[Request, Turn]] = {}  # by the number of a goal or a check
        self._strays = StrayGoals()
        self._asks: list[Ask] = []
        self._number = 0
        self._ticked: float | None = None
        self.claims = Claims()

    # ----------------------------------------------------------------------------------- requests

    def home(
        self, names: Sequence[str], owner: str, now: float, force: bool = False
    ) -> Outcome | Request:
        """Start homing axes, in the order of `steps`; return why not, or the request.

        Axes that stand in no step home after the others, one after another. ``force``: homed ones
        are homed again, in spite of `skip_homed`.
        """
        names = list(dict.fromkeys(names)) or self.cells.names
        refusal = self._refusal(names, now)
        if refusal is not None:
            return refusal
        force = force or not self.line.skip_homed
        request = Request(self.cells.ordered(names), owner, self.line.on_failure, force)
        self.requests.append(request)
        self._advance(now)
        return request

    def preview(self, names: Sequence[str], now: float, force: bool = False) -> Preview:
        """Ask the cells what homing axes would do; nothing moves."""
        names = list(dict.fromkeys(names)) or self.cells.names
        refusal = self._refusal(names, now)
        known = [name for name in names if self.cells.unknown(name) is None]
        force = force or not self.line.skip_homed
        preview = Preview(self.line, self.cells.ordered(known), refusal, force)
        self._previews.append(preview)
        self._advance(now)
        return preview

    def cancel(self, names: Iterable[str], reason: str, now: float) -> list[Turn]:
        """Stop axes, and refuse those that wait; return the turns that must end."""
        names = set(names)
        stopped = []
        for request in self.requests:
            for turn in request.to_cancel(names):
                stopped.append(turn)
                self._handle(request, turn, Event.Cancel, now, text=reason)
        self._advance(now)
        return stopped

    def close(self, now: float) -> None:
        """Stop everything, and refuse what comes."""
        self.closed = True
        self.cancel([name for one in self.requests for name in one.names], 'shutting down', now)

    @property
    def idle(self) -> bool:
        """Whether no request is open."""
        return not self.requests and not self._previews

    def take_asks(self) -> list[Ask]:
        """Return what is to be asked of the cells, each once."""
        asks, self._asks = self._asks, []
        return asks

    def locks(self, cell: str, now: float) -> dict[str, str]:
        """Return why axes of a cell must not home, '' where they may; those with `requires`."""
        return self.cells.locks(cell, self._homing, now)

    # -------------------------------------------------------------------------- events: the cells

    def state(self, axis: str, seen: Seen, now: float) -> None:
        """Take the state of an axis."""
        self.cells[cell_of(axis)].take(axis, seen, now)
        if not seen.idle:
            for request in self.requests:
                turn = request.turn_of.get(axis)
                if turn is not None:
                    turn.active = now

    def axes(self, cell: str, axes: Sequence[str]) -> None:
        """Take which axes a cell has, by their names in the line."""
        self.cells[cell].has(axes)

    def restarted(self, cell: str, now: float) -> None:
        """Take that the node of a cell has restarted: its goals and homes are gone."""
        self.cells[cell].restart()
        for request in self.requests:
            for turn in request.turns:
                if turn.cell == cell:
                    self._handle(request, turn, Event.Restarted, now)
                if turn.phase is Phase.Checking:  # an answer may be of before
                    self._check(request, turn, now)
        self._advance(now)

    # ------------------------------------------------------------- events: what comes of questions

    def checked(self, number: int, cell: str, answer: Checked, now: float) -> None:
        """Take the answer of a cell to a check."""
        for axis, seen in answer.seen.items():
            self.cells[cell].take(axis, seen, now)
        for preview in self._previews:
            preview.checked(number, answer, now)
        request, turn = self._turns.get(number, (None, None))
        if request and turn and number in turn.checks and cell in turn.awaited:
            turn.awaited.discard(cell)
            turn.answers[cell] = answer
            if not turn.awaited and turn.phase is Phase.Checking:
                self._judge(request, turn, now)
        self._advance(now)

    def accepted(self, number: int, now: float) -> None:
        """Take that a cell has accepted a goal; one that nobody waits for any more is canceled."""
        request, turn = self._turns.get(number, (None, None))
        if request is not None and turn is not None and not turn.ended:
            self.cells[turn.cell].heard = turn.active = now
            self._handle(request, turn, Event.Accepted, now)
            self._advance(now)
            return
        self._cancel_stray(number, turn)

    def refused(self, number: int, outcome: Outcome, now: float) -> None:
        """Take that a cell has refused a goal."""
        self._answer(number, Event.Refused, now, outcome)

    def result(self, number: int, outcome: Outcome, now: float, seen: Seen | None = None) -> None:
        """Take the result of a goal: how its axis ended, and its state then."""
        _, turn = self._turns.get(number, (None, None))
        if turn is not None and seen is not None and turn.goal == number and not turn.ended:
            self.cells[turn.cell].take(turn.axis, seen, now)
        self._answer(number, Event.Result, now, outcome)

    def gone(self, number: int, now: float) -> None:
        """Take that a cell does not know a goal."""
        self._answer(number, Event.Gone, now)

    def under_way(self, number: int, now: float) -> None:
        """Take that a goal is still under way at its cell; one that is a stray is canceled."""
        _, turn = self._turns.get(number, (None, None))
        if turn is not None and turn.goal == number and turn.phase in UNDER_WAY:
            cell = self.cells[turn.cell]
            turn.active = cell.heard = now
            cell.owing.add(number)
        elif self._strays.cancel_is_due(number, now):
            self._cancel_stray(number, turn)

    def tick(self, now: float) -> list[Request | Preview]:
        """Let time pass; return the requests that have ended since the last tick."""
        gap = 0.0 if self._ticked is None else now - self._ticked
        self._ticked = now
        if gap > DEAF:  # nobody listened: a cell that was not heard then is not silent
            for cell in self.cells.values():
                cell.heard += gap
        silent = {name for name, cell in self.cells.items() if cell.lost(now)}
        for request in self.requests:
            for turn in request.turns:
                if not turn.ended:
                    self._watch(request, turn, silent, now)
        for preview in self._previews:
            preview.tick(silent, now)
        self._advance(now)
        return self._ended()

    # ------------------------------------------------------------------------------------- inside

    def _refusal(self, names: Sequence[str], now: float) -> Outcome | None:
        """Return why a request cannot begin."""
        if self.closed:
            return Outcome(Error.Canceled, 'the coordinator is shutting down')
        if not names:
            text = '`steps` is empty, and no cell has said yet which axes it has'
            return Outcome(Error.UnknownAxis, text)
        for name in names:
            unknown = self.cells.unknown(name)
            if unknown is not None:
                return unknown
        other = self.claims.living(now)
        if other:
            text = f'{other} guards cells of this line, too; end one of the coordinators'
            return Outcome(Error.CoordinatorConflict, text)
        for request in self.requests:
            busy = [name for name in names if name in request.turn_of]
            if busy and not request.done:
                return Outcome(Error.Busy, f'{request.owner} is homing {", ".join(busy)}')
        return None

    def _next_number(self, request: Request, turn: Turn) -> int:
        self._number += 1
        self._turns[self._number] = request, turn
        return self._number

    def _handle(
        self,
        request: Request,
        turn: Turn,
        event: Event,
        now: float,
        outcome: Outcome | None = None,
        text: str = '',
    ) -> None:
        """Let an event happen to a turn, and ask what it asks."""
        before = turn.phase
        asked = turn.handle(event, now, outcome, text)
        if turn.phase is not before:
            turn.active = now
        for asks in asked:
            if asks is Asks.Check:
                self._check(request, turn, now)
                continue
            if asks is Asks.Goal:
                turn.goal = self._next_number(request, turn)
            self._asks.append(Ask(asks, turn.goal, turn.cell, (turn.axis,)))
        if turn.ended:
            self.cells[turn.cell].owing.discard(turn.goal)

    def _answer(
        self, number: int, event: Event, now: float, outcome: Outcome | None = None
    ) -> None:
        request, turn = self._turns.get(number, (None, None))
        if request is not None and turn is not None and turn.goal == number:
            self.cells[turn.cell].heard = now
            self._handle(request, turn, event, now, outcome)
            self._advance(now)

    def _check(self, request: Request, turn: Turn, now: float) -> None:
        """Ask the cells of an axis, and of what it requires, for what is homed now."""
        turn.checks.clear()
        turn.answers.clear()
        turn.awaited = {turn.cell, *map(cell_of, self.line.requires.get(turn.axis, ()))}
        self._repeat(request, turn, now)

    def _repeat(self, request: Request, turn: Turn, now: float) -> None:
        """Ask the cells of a check that have not answered."""
        number = self._next_number(request, turn)
        turn.checks.add(number)
        turn.again = now + UNANSWERED
        axes = [turn.axis, *self.line.requires.get(turn.axis, ())]
        for cell in sorted(turn.awaited):
            of_cell = tuple(axis for axis in axes if cell_of(axis) == cell)
            self._asks.append(Ask(Asks.Check, number, cell, of_cell))

    def _judge(self, request: Request, turn: Turn, now: float) -> None:
        """Decide from the answers to a check whether an axis may home."""
        required = self.line.requires.get(turn.axis, ())
        verdict = judge(turn.axis, required, turn.answers, request.force)
        turn.skipped = verdict.skipped
        if verdict.lock is not None:
            turn.doubt, turn.again = verdict.lock, now + LOCKED
        elif verdict.outcome is not None:
            self._handle(request, turn, Event.Over, now, verdict.outcome)
        else:
            self._handle(request, turn, Event.Holds, now)

    def _watch(self, request: Request, turn: Turn, silent: set[str], now: float) -> None:
        """Let time pass for a turn."""
        if turn.phase in UNDER_WAY and turn.cell in silent:
            self._handle(request, turn, Event.Lost, now)
        elif turn.phase is Phase.Checking and silent & turn.awaited:
            lost = ', '.join(sorted(silent & turn.awaited))
            text = f'cell {lost} is silent; nothing was started'
            self._handle(request, turn, Event.Lost, now, text=text)
        elif turn.phase is Phase.Checking and now >= turn.again:
            if turn.doubt is not None and now - turn.since > INSIST:
                self._handle(request, turn, Event.Over, now, turn.doubt)
            elif turn.awaited:
                self._repeat(request, turn, now)
            else:
                self._check(request, turn, now)
        elif turn.phase in UNDER_WAY and now - turn.active > SILENT:
            seen = self.cells[turn.cell].seen.get(turn.axis)
            if seen is None or seen.idle:
                self._handle(request, turn, Event.Silent, now)
        if turn.late(now):
            self._handle(request, turn, Event.Late, now, text=self._late_text(turn))

    def _late_text(self, turn: Turn) -> str:
        """Say what is known of an axis whose cell or goal does not answer."""
        if turn.phase is Phase.Checking:
            nodes = ', '.join(self.cells[cell].node for cell in sorted(turn.awaited))
            return f'{nodes} does not answer; is it started, and within reach?'
        seen = self.cells[turn.cell].seen.get(turn.axis)
        state = 'no state of it was seen' if seen is None else f'its last state: {seen.words}'
        return f'waited in vain for {turn.waits}; {state}'

    def _advance(self, now: float) -> None:
        """Let failures have their consequences, and turns begin that are due."""
        again = True
        while again:
            again = False
            for request in self.requests:
                for turn, reason in request.to_stop():
                    self._handle(request, turn, Event.Cancel, now, text=reason)
                    again = True
                for turn in request.due:
                    if self._busy < self.line.at_once and not self._must_wait(turn.axis):
                        self._begin(request, turn, now)
                        again = True
        for preview in self._previews:
            while axis := preview.next():
                self._number += 1
                preview.asked(self._number, now)
                self._asks.append(Ask(Asks.Check, self._number, cell_of(axis), (axis,)))

    def _begin(self, request: Request, turn: Turn, now: float) -> None:
        """Begin a turn, unless a home of an earlier step is lost."""
        undone = [why for axis in request.earlier if (why := self.cells.holds(axis, now))]
        if undone:
            text = f'{turn.axis}: an earlier step does not hold any more: {undone[0]}'
            lost = Outcome(Error.PrerequisiteMissing, text)
            self._handle(request, turn, Event.Over, now, lost)
        else:
            self._handle(request, turn, Event.Due, now)

    @property
    def _homing(self) -> list[str]:
        """The axes that have their turn now."""
        turns = [turn for request in self.requests for turn in request.turns]
        return [turn.axis for turn in turns if turn.phase in BUSY]

    @property
    def _busy(self) -> int:
        return len(self._homing)

    def _must_wait(self, axis: str) -> bool:
        """Return whether an axis that it requires, or one that requires it, has its turn now."""
        requires, homing = self.line.requires, self._homing
        return any(
            one in requires.get(axis, ()) or axis in requires.get(one, ()) for one in homing
        )

    def _cancel_stray(self, number: int, turn: Turn | None) -> None:
        """Cancel a goal that nobody waits for."""
        axis = turn.axis if turn is not None else self._strays.axis(number)
        if axis:
            self._asks.append(Ask(Asks.Cancel, number, cell_of(axis), (axis,)))

    def _ended(self) -> list[Request | Preview]:
        """Return the requests that have ended, and keep of them only which goals they sent."""
        ended: list[Request | Preview] = [one for one in self.requests if one.done]
        if ended:
            past: dict[int, str] = {}
            for number, (request, turn) in list(self._turns.items()):
                if request.done:
                    del self._turns[number]
                    past[number] = turn.axis
            self._strays.remember(past)
        ended += [one for one in self._previews if one.done]
        self.requests = [one for one in self.requests if not one.done]
        self._previews = [one for one in self._previews if not one.done]
        return ended
