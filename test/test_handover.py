# SPDX-License-Identifier: Apache-2.0
"""The hand-over of a home: every fault at every step.

The driver has coordinates of its own.

``Cell`` is what surrounds a hand-over: a driver whose feedback is its encoder less an offset, a
controller manager, a relay. Whatever goes wrong, one of three things must be true at the end: the
axis is homed and its feedback shows the home; or it is not homed and nothing has changed; or it is
not homed and its controllers are inactive.
"""

from itertools import product

import pytest
from core_rig import grouped, rig

from homing_node.core.handover import Handover, Plan, may_begin
from homing_node.core.handover_steps import ENDS, TABLE, UNDO, Asks, Event, Step
from homing_node.core.outcome import Outcome
from homing_node.procedures.states import Error

PERIOD, TIMEOUT, TOLERANCE = 0.01, 0.5, 1e-5
ENCODER = 0.340_123
FOUND = Outcome(Error.NoError, '', home_position_raw=0.3, home_offset=0.25, uncertainty=1e-6)

#: How the machine answers what a step asks: as it should, or not.
GOOD, NO, SILENT, LIES, LATE = 'good', 'no', 'silent', 'lies', 'late'


STEPS = (Step.Rest, Step.Deactivate, Step.Settle, Step.Apply, Step.See, Step.Activate)


class Cell:
    """A hand-over and all that it talks to; ``faults``: how each kind of question is answered."""

    def __init__(self, faults=(), controllers=('axes',), shifts=True, applied=0.0, offset=0.0):
        self.faults = dict(faults)
        self.offset = offset  # what the driver takes off
        self.relayed = None  # the offset that the relay was told
        self.active = True
        self.jump = 0.0  # what the feedback is off all of a sudden
        self.alive = True
        self.pushed = 0.0  # how far a controller moves the axis when it becomes active
        self.now, self._sampled, self._asked, self._owed = 0.0, 0.0, 0, []
        self.calls = []
        self._seen = ENCODER - offset
        self.handover = Handover(
            Plan(
                'x',
                FOUND._replace(home_offset=FOUND.home_offset - offset),
                controllers,
                TIMEOUT,
                TOLERANCE,
                10 * TOLERANCE,
                shifts,
                applied,
            )
        )

    @property
    def raw(self):
        return ENCODER - self.offset + self.jump + self.pushed

    def cycle(self, rests=True, free=True):
        self.now += PERIOD
        if self.alive:
            self._sampled, self._seen = self.now, self.raw
        one = self.handover
        one.update(self.now, self._seen, self._sampled, rests, free)
        if (
            one.step is Step.See
            and not one.plan.shifts
            and self.alive
            and self.relayed is not None
        ):
            one.shown(self.raw - self.relayed, self._sampled)
        self._obey()

    def _obey(self):
        question = self.handover.question
        for owed in [one for one in self._owed if one[0] <= self.now]:
            self._owed.remove(owed)
            self.handover.answer(*owed[1:])
        if question is None or question.number == self._asked:
            return
        self._asked = question.number
        if question.asks is Asks.Look:
            return
        fault = self.faults.get(question.asks, GOOD)
        if question.asks is Asks.Call:
            self.calls.append(question.values)
        if fault in (GOOD, LATE):
            self._do(question)
        if fault != SILENT:
            due = self.now + (2 * TIMEOUT if fault == LATE else 0.05)
            self._owed.append((due, question.number, fault != NO, 'no, sir'))

    def _do(self, question):
        if question.asks is Asks.Activate:
            self.active = True
        elif question.asks is Asks.Deactivate:
            self.active = False
        elif self.handover.plan.shifts:
            self.offset = question.values['home_offset']
        else:
            self.relayed = question.values['home_offset']

    def run(self, at=None, then=lambda cell: None, cycles=2000):
        """Run to the end; ``then`` happens once when the step ``at`` is reached."""
        for _ in range(cycles):
            if self.handover.step == at:
                then(self)
                at = None
            if self.handover.outcome is not None:
                return self.handover.outcome
            self.cycle()
        raise AssertionError(f'still in {self.handover.step}')

    def assert_safe(self, outcome):
        """Check that nothing is homed that is not, and that no stale command can move the axis."""
        truth = ENCODER - FOUND.home_offset  # where the axis is, homed
        if outcome.success:
            shown = self.raw - outcome.home_offset
            assert shown == pytest.approx(truth, abs=TOLERANCE)
            assert self.active or not self.handover.plan.controllers
            if self.handover.plan.shifts:
                assert outcome.home_offset == 0.0
        elif self.handover.plan.shifts and abs(self.offset - self.handover.plan.applied) > 1e-12:
            assert not self.active or not self.handover.plan.controllers
        if not outcome.success and not self.active:
            assert 'left inactive' in outcome.message


@pytest.mark.parametrize('shifts', [True, False])
@pytest.mark.parametrize('controllers', [(), ('axes', 'others')])
def test_all_is_well(shifts, controllers):
    cell = Cell(controllers=controllers, shifts=shifts)
    outcome = cell.run()
    cell.assert_safe(outcome)
    assert outcome.success
    (values,) = cell.calls
    assert values['home_offset'] == values['home_offset_change'] == FOUND.home_offset
    assert values['position'] == ENCODER - FOUND.home_offset
    assert values['raw_position'] == ENCODER
    assert values['home_position_raw'] == FOUND.home_position_raw
    if shifts:
        assert outcome.home_position_raw == FOUND.home_position_raw - FOUND.home_offset
        assert outcome.applied == FOUND.home_offset
    else:
        assert outcome == FOUND


def test_the_order_of_the_steps():
    cell, steps = Cell(), []
    while cell.handover.outcome is None:
        if cell.handover.step not in steps:
            steps.append(cell.handover.step)
        cell.cycle()
    assert steps == list(STEPS)


@pytest.mark.parametrize('shifts', [True, False])
@pytest.mark.parametrize('controllers', [(), ('axes',)])
@grouped('answers', product([GOOD, NO, SILENT, LIES, LATE], repeat=3))
def test_every_answer_to_every_question(answers, controllers, shifts):
    asked = (Asks.Deactivate, Asks.Call, Asks.Activate)
    cell = Cell(dict(zip(asked, answers, strict=True)), controllers, shifts)
    if controllers and answers[0] in (LIES, SILENT):
        cell.faults[Asks.Deactivate] = SILENT  # that it has not happened, its shell finds out
    if controllers and answers[2] in (LIES, SILENT):
        cell.faults[Asks.Activate] = SILENT
    outcome = cell.run()
    cell.assert_safe(outcome)
    wrong = [
        one
        for one, answer in zip(asked, answers, strict=True)
        if answer != GOOD and (controllers or one is Asks.Call)
    ]
    assert outcome.success == (not wrong)
    if wrong:
        assert outcome.error is Error.HandoverFailed
        step = {Asks.Deactivate: 'deactivate', Asks.Call: 'apply', Asks.Activate: 'activate'}
        first = step[wrong[0]]
        if wrong[0] is Asks.Call and answers[1] == LIES:
            first = 'see'
        assert f'step {first}: ' in outcome.message
    assert cell.now < 8 * TIMEOUT
    # What comes after the end changes nothing.
    for number in range(10):
        cell.handover.answer(number, True)
    assert cell.handover.outcome == outcome


def _restart(cell):
    cell.offset = cell.jump = 0.0
    cell.handover.stop(Error.HandoverFailed, 'the publisher has changed')


def _die(cell):
    cell.alive = False


def _manager_dies(cell):
    cell.faults.update({Asks.Deactivate: SILENT, Asks.Activate: SILENT})


def _driver_stops_answering(cell):
    cell.faults[Asks.Call] = SILENT
    cell.alive = False


HAPPENINGS = {
    'the driver restarts': _restart,
    'the driver dies': _driver_stops_answering,
    'the manager dies': _manager_dies,
    'the emergency stop': lambda cell: cell.handover.stop(Error.EmergencyStop, 'emergency stop'),
    'canceled': lambda cell: cell.handover.cancel(),
    'the axis moves': lambda cell: setattr(cell, 'pushed', 0.001),
}


#: Without controllers the steps that switch them take no time.
PLACES = [
    (at, controllers)
    for at in STEPS
    for controllers in ((), ('axes',))
    if controllers or at not in (Step.Deactivate, Step.Activate)
]


@pytest.mark.parametrize('shifts', [True, False])
@pytest.mark.parametrize('what', HAPPENINGS)
@pytest.mark.parametrize(('at', 'controllers'), PLACES)
def test_every_fault_at_every_step(at, controllers, what, shifts):
    cell = Cell(controllers=controllers, shifts=shifts)
    outcome = cell.run(at, HAPPENINGS[what])
    early = at in (Step.Rest, Step.Deactivate, Step.Settle)
    if what == 'the axis moves':
        if outcome.success:  # it moved before it was told where it is, or the feedback moves too
            moved = ENCODER + 0.001 - FOUND.home_offset
            assert cell.raw - outcome.home_offset == pytest.approx(moved, abs=TOLERANCE)
        else:
            assert not early
    elif what == 'the driver restarts':
        assert not outcome.success
        assert not cell.active or not controllers or at is Step.Rest
    else:
        cell.assert_safe(outcome)
    if what == 'canceled':
        assert outcome.success == (not early)
        assert cell.active
        assert outcome.error is (Error.Canceled if early else Error.NoError)
    if what == 'the emergency stop':
        assert outcome.error is Error.EmergencyStop


def test_nothing_is_activated_while_the_coordinates_are_in_doubt():
    for fault in (SILENT, LIES, LATE):
        cell = Cell({Asks.Call: fault})
        outcome = cell.run()
        assert not outcome.success
        assert not cell.active
        assert outcome.message.endswith('left inactive, or perhaps so: axes')


def test_a_refusal_puts_the_controllers_back():
    cell = Cell({Asks.Call: NO})
    outcome = cell.run()
    assert cell.active
    assert outcome.message == 'axis x: step apply: no, sir'


def test_a_service_that_says_no_and_does_it():
    cell = Cell({Asks.Call: SILENT})
    while cell.handover.step is not Step.Apply or cell.handover.question is None:
        cell.cycle()
    cell.offset = FOUND.home_offset
    cell.cycle()
    cell.handover.answer(cell.handover.question.number, False, 'no')
    outcome = cell.run()
    assert not cell.active
    assert 'but the feedback has changed' in outcome.message
    assert cell.handover.applied == FOUND.home_offset


def test_a_late_change_is_not_taken_for_the_home():
    """The service does what it should a little off; the difference is said, or it is an error."""
    for off, good in ((0.5 * TOLERANCE, True), (2 * TOLERANCE, False)):
        cell = Cell()
        cell._do = lambda question, cell=cell, off=off: (
            Cell._do(cell, question),
            setattr(cell, 'jump', off if question.asks is Asks.Call else cell.jump),
        )
        outcome = cell.run()
        assert outcome.success == good
        if good:
            assert outcome.uncertainty == pytest.approx(FOUND.uncertainty + off)
        else:
            assert 'step see' in outcome.message


def test_a_controller_that_moves_the_axis_is_deactivated_again():
    cell = Cell()
    do = cell._do

    def activate(question):
        do(question)
        if question.asks is Asks.Activate:
            cell.pushed = 0.25  # it holds the command that it had in the old coordinates
            cell.faults[Asks.Activate] = SILENT

    cell._do = activate
    cell.faults[Asks.Activate] = LATE
    outcome = cell.run()
    assert not cell.active
    assert 'step activate: the axis moved' in outcome.message


def test_homed_again_replaces():
    """The second hand-over names the whole offset, and the change; the driver takes the former."""
    cell = Cell(applied=0.25, offset=0.2501)
    plan = cell.handover.plan
    cell.offset = plan.applied  # what the first hand-over has left
    cell.run()
    (values,) = cell.calls
    assert values['home_offset'] == pytest.approx(plan.applied + plan.found.home_offset)
    assert values['home_offset_change'] == plan.found.home_offset
    assert cell.offset == values['home_offset']


def test_one_at_a_time_and_only_at_rest():
    one, other = Cell().handover, Cell().handover
    assert may_begin(one, [other], moving=False)
    assert not may_begin(one, [other], moving=True)
    other.update(0.0, 0.0, 0.0, True, True)
    assert other.step is Step.Deactivate
    assert not may_begin(one, [other], moving=False)
    assert may_begin(Cell(controllers=(), shifts=False).handover, [other], moving=True)


def test_it_waits_for_others_as_long_as_they_take():
    cell = Cell()
    for _ in range(1000):
        cell.cycle(free=False)
    assert cell.handover.step is Step.Rest
    for _ in range(100):
        cell.cycle(rests=False)
    assert 'step rest: waited 0.5 s' in cell.handover.outcome.message


def test_the_table_is_closed_and_every_event_has_its_place():
    assert set(TABLE) == set(Step) - set(ENDS)
    for step, row in TABLE.items():
        assert set(row.after.values()) <= set(Step)
        if row.asks is not Asks.Look and row.asks is not None:
            assert {Event.Yes, Event.No, Event.Late} <= set(row.after), step
        assert Event.Late in row.after, step
    # Nothing goes back to a step before it: no hand-over is endless.
    order = [*STEPS, *UNDO, *ENDS]
    for step, row in TABLE.items():
        assert all(order.index(after) > order.index(step) for after in row.after.values())


# -- the axis -----------------------------------------------------------------------------------


def homed_axis(**values):
    """Return a rehearsal whose axis has homed and waits for the hand-over."""
    made = (
        rig('HS')
        .but(apply='service', apply_service='/s', apply_type='a/srv/B', **values)
        .rehearsal()
    )
    axis = made.axis
    axis.hands_over = True
    made.axis.home(made.time)
    for _ in range(5000):
        made.cycle()
        if axis.handover is not None:
            break
    return made, axis


def test_a_run_ends_with_its_hand_over():
    made, axis = homed_axis()
    assert axis.running
    assert not axis.moving
    assert not axis.homed
    assert axis.state == 'HomeShift'
    assert axis.message.endswith('hand-over, step rest')
    assert axis.refusal(made.time).error is Error.Busy
    axis.free = True
    for _ in range(1000):
        made.cycle()
        if axis.handover.question is not None and axis.handover.step is Step.Apply:
            break
    values = axis.handover.question.values
    axis.handover.answer(axis.handover.question.number, True)
    shift, send = values['home_offset'], axis.feedback
    axis.feedback = lambda time, position, *more: send(time, position - shift, *more)
    for _ in range(1000):
        made.cycle()
        if not axis.running:
            break
    assert axis.homed
    assert axis.outcome.home_offset == 0.0
    assert axis.applied == shift
    assert axis.position == axis.raw_position == pytest.approx(values['position'], abs=1e-5)
    # The driver restarts: the feedback is in its own coordinates again.
    axis.feedback = send
    for _ in range(3):
        made.cycle()
    assert not axis.homed
    assert axis.error is Error.HomeLost
    assert 'the home is lost: the feedback jumped by' in axis.message
    assert axis.applied == 0.0


@pytest.mark.parametrize('keeps', [False, True])
def test_a_new_publisher_of_the_feedback_loses_the_home(keeps):
    made = rig('HS', clear_home_done_on_comm_stop=not keeps).rehearsal()
    made.home()
    assert made.axis.homed
    made.axis.feedback_source_changed()
    assert made.axis.homed == keeps
    assert (made.axis.error is Error.HomeLost) == (not keeps)


def test_a_hand_over_that_fails_leaves_the_axis_not_homed():
    made, axis = homed_axis(apply_timeout=0.3)
    axis.free = True
    for _ in range(2000):
        made.cycle()
        if not axis.running:
            break
    assert not axis.homed
    assert axis.outcome.error is Error.HandoverFailed
    assert 'step apply: waited 0.3 s (apply_timeout)' in axis.outcome.message
    assert axis.history.runs == 1
    axis.home(made.time)  # the next run begins where the axis is
    assert axis.running


def test_without_a_shell_nothing_is_handed_over():
    made = rig('HS').but(apply='relay').rehearsal()
    made.home()
    assert made.axis.homed


def test_a_home_that_is_verified_is_not_handed_over_again():
    made = rig('HS').but(apply='relay').rehearsal()
    made.home()
    made.axis.hands_over = True
    for _ in range(100):
        made.cycle()
    assert made.axis.home(made.time, verify=True) is None
    for _ in range(5000):
        made.cycle()
        assert made.axis.handover is None
        if not made.axis.running:
            break
    assert made.axis.homed
    assert made.axis.outcome.verified is not None


def test_a_home_that_was_accepted_is_handed_over():
    made = rig('HS').but(apply='relay').rehearsal()
    made.home()
    axis, found = made.axis, made.axis.outcome
    axis.hands_over, axis.homed, axis._unaccepted = True, False, found
    assert axis.accept() == found
    assert axis.handover.plan.found == found
    assert not axis.homed
