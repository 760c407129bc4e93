# SPDX-License-Identifier: Apache-2.0
"""The coordinator without ROS: its table, each answer by name, and cells whose events get lost."""

import math
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_node.coordination.cells import Seen
from homing_node.coordination.coordinator import Coordinator
from homing_node.coordination.health import Level, health
from homing_node.coordination.preview import Preview
from homing_node.coordination.request import Request
from homing_node.coordination.turn import Checked
from homing_node.coordination.turn_table import TABLE, UNDER_WAY, Asks, Event, Phase
from homing_node.core.outcome import Outcome
from homing_node.parameters.definition import InvalidParameters
from homing_node.parameters.line import line
from homing_node.procedures.states import Error

NODES = ['/cell1/homing_node', '/cell2/homing_node']
STEPS = ['cell1/z, cell2/z', 'cell1/x, cell2/y']
REQUIRES = ['cell2/y: cell1/z']
AXES = {'cell1': ['cell1/x', 'cell1/z'], 'cell2': ['cell2/y', 'cell2/z']}
TICK = 0.05


# -- the parameters -------------------------------------------------------------------------------


def faults(**values):
    with pytest.raises(InvalidParameters) as refused:
        line({'nodes': NODES, **values})
    return refused.value.faults


def test_the_parameters_of_a_line():
    read = line({'nodes': NODES, 'steps': STEPS, 'requires': REQUIRES, 'on_failure': 'go_on'})
    assert read.nodes == {'cell1': '/cell1/homing_node', 'cell2': '/cell2/homing_node'}
    assert read.steps == (('cell1/z', 'cell2/z'), ('cell1/x', 'cell2/y'))
    assert read.requires == {'cell2/y': ('cell1/z',)}
    assert (read.at_once, read.on_failure, read.skip_homed) == (8, 'go_on', True)


@pytest.mark.parametrize(
    ('values', 'texts'),
    [
        ({'nodes': []}, ['no node is named']),
        ({'nodes': ['homing_node']}, ["'homing_node' is not the full name of a node"]),
        ({'nodes': ['/homing_node']}, ["'/homing_node' is not the full name of a node"]),
        ({'nodes': ['/a/n', '/a/m']}, ["are both the cell 'a'"]),
        ({'nodes': ['/a/n', '/a/n']}, ["'/a/n' stands there twice"]),
        ({'steps': ['cell1/x', 'cell2/y, cell1/x']}, ['cell1/x stands in two steps, 1 and 2']),
        ({'steps': ['cell1/x, cell1/x']}, ['cell1/x stands twice in step 1']),
        ({'steps': ['cell3/x']}, ["'cell3' is none of the cells cell1, cell2"]),
        ({'steps': ['x']}, ["'x' is not an axis of a cell"]),
        ({'requires': ['cell1/x']}, ["'cell1/x' does not say what the axis needs"]),
        ({'requires': ['cell1/x: cell1/x']}, ['cell1/x requires itself']),
        (
            {'steps': ['cell1/x', 'cell1/z'], 'requires': ['cell1/x: cell1/z']},
            ['cell1/x (step 1) requires cell1/z, which homes in step 2'],
        ),
        (
            {'requires': ['cell1/x: cell1/z', 'cell1/z: cell1/x']},
            ['a circle, in which no axis can be first: cell1/x -> cell1/z -> cell1/x'],
        ),
        ({'at_once': 0}, ['at_once: 0 must be >= 1']),
        ({'on_failure': 'stop'}, ["on_failure: 'stop' is none of stop_all, stop_step, go_on"]),
        ({'step': ['cell1/x']}, ["step: no such parameter; did you mean 'steps'?"]),
        (
            {'at_once': 0, 'steps': ['cell3/x', 'cell1/x', 'cell1/x'], 'use_sim_time': 3},
            ['at_once', "'cell3' is none", 'cell1/x stands in two steps', 'use_sim_time'],
        ),
    ],
)
def test_a_bad_line_is_refused_with_every_fault(values, texts):
    found = '\n'.join(faults(**values))
    for text in texts:
        assert text in found


# -- the table ------------------------------------------------------------------------------------


def test_every_phase_ends_by_itself_and_every_event_counts_somewhere():
    for phase, row in TABLE.items():
        ends = {Event.Late} if math.isfinite(row.patience) else {Event.Silent, Event.Lost}
        if phase not in (Phase.Waiting, Phase.Ended):
            assert ends & set(row.after), phase
        assert all(to.phase in TABLE for to in row.after.values())
    assert {event for row in TABLE.values() for event in row.after} == set(Event)
    reached = {to.phase for row in TABLE.values() for to in row.after.values()}
    assert reached | {Phase.Waiting} == set(Phase)


def test_a_goal_leaves_only_after_a_check_that_holds():
    ways = [
        (p, e) for p, row in TABLE.items() for e, to in row.after.items() if to.phase is Phase.Sent
    ]
    assert ways == [(Phase.Checking, Event.Holds)]
    assert [phase for phase, row in TABLE.items() if row.asks is Asks.Goal] == [Phase.Sent]


# -- cells on whose events a test decides ---------------------------------------------------------


class Rig:
    """A coordinator with cells that answer as they are told; time passes in `run` only."""

    def __init__(self, homed=(), silent=(), auto=True, **values):
        self.core = Coordinator(
            line({'nodes': NODES, 'steps': STEPS, 'requires': REQUIRES, **values})
        )
        self.now = 0.0
        self.homed = set(homed)
        self.moving = set()
        self.silent = set(silent)  # cells that say nothing
        self.locked = {}  # texts of the nodes, by axis
        self.auto = auto  # goals are accepted, and end well after a tick
        self.goals = []  # (number, axis), in order
        self.canceled = []
        self.asked_again = []
        self.ended = []
        for cell, axes in AXES.items():
            self.core.axes(cell, axes)
        self.run(0.1)

    def states(self):
        for cell, axes in AXES.items():
            for axis in axes if cell not in self.silent else ():
                idle = axis not in self.moving
                seen = Seen(axis in self.homed, idle, stamp=self.now)
                self.core.state(axis, seen, self.now)

    def run(self, seconds):
        for _ in range(round(seconds / TICK)):
            self.now += TICK
            self.states()
            self.ended += self.core.tick(self.now)
            self.answer()

    def answer(self):
        """Do what the coordinator asks."""
        while asks := self.core.take_asks():
            for ask in asks:
                if ask.cell in self.silent:
                    continue
                if ask.kind is Asks.Check:
                    seen = {
                        a: Seen(a in self.homed, True) for a in ask.axes if a in AXES[ask.cell]
                    }
                    missing = {a: tuple(self.locked.get(a, ())) for a in ask.axes}
                    self.core.checked(ask.number, ask.cell, Checked(seen, missing, 2.0), self.now)
                elif ask.kind is Asks.Goal:
                    (axis,) = ask.axes
                    self.goals.append((ask.number, axis))
                    if self.auto:
                        self.core.accepted(ask.number, self.now)
                        self.end(axis)
                elif ask.kind is Asks.Cancel:
                    self.canceled.append(ask.axes[0])
                else:
                    self.asked_again.append(ask.axes[0])

    def number(self, axis):
        return next(number for number, name in reversed(self.goals) if name == axis)

    def accept(self, *axes):
        for axis in axes:
            self.moving.add(axis)
            self.homed.discard(axis)
            self.core.accepted(self.number(axis), self.now)

    def end(self, axis, error=Error.NoError):
        self.moving.discard(axis)
        if error is Error.NoError:
            self.homed.add(axis)
        seen = Seen(axis in self.homed, True, stamp=self.now)
        outcome = Outcome(error, f'{axis} ended so')
        self.core.result(self.number(axis), outcome, self.now, seen)

    def home(self, *axes, force=False):
        begun = self.core.home(axes, 'test', self.now, force)
        self.answer()
        return begun

    def started(self):
        return [axis for _, axis in self.goals]


def errors(request):
    return {axis: str(one.error) for axis, one in request.outcomes.items() if not one.success}


def test_the_axes_home_in_steps():
    rig = Rig(auto=False)
    request = rig.home()
    assert rig.started() == ['cell1/z', 'cell2/z']
    rig.accept('cell1/z', 'cell2/z')
    rig.end('cell2/z')
    rig.run(1.0)
    assert rig.started() == ['cell1/z', 'cell2/z']
    rig.end('cell1/z')
    rig.answer()
    assert rig.started()[2:] == ['cell1/x', 'cell2/y']
    rig.accept('cell1/x', 'cell2/y')
    rig.end('cell1/x')
    rig.end('cell2/y')
    rig.run(TICK)
    assert rig.ended == [request]
    assert request.done
    assert not errors(request)


def test_a_state_that_a_result_has_overtaken_undoes_no_step():
    rig = Rig(auto=False)
    rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.run(1.0)
    rig.end('cell1/z')
    rig.core.state('cell1/z', Seen(False, False, stamp=rig.now - 0.1), rig.now)
    rig.end('cell2/z')
    rig.answer()
    assert rig.started()[2:] == ['cell1/x', 'cell2/y']
    # A clock that was set back does not make the coordinator deaf.
    rig.core.state('cell1/z', Seen(False, True, stamp=rig.now - 60.0), rig.now)
    assert rig.core.locks('cell2', rig.now)['cell2/y'] == 'cell1/z is not homed'


def test_at_most_so_many_axes_home_at_once():
    rig = Rig(auto=False, at_once=1)
    rig.home()
    assert rig.started() == ['cell1/z']
    rig.accept('cell1/z')
    rig.run(0.5)
    assert rig.started() == ['cell1/z']
    rig.end('cell1/z')
    rig.answer()
    assert rig.started() == ['cell1/z', 'cell2/z']


def test_what_is_homed_is_left_out_and_forced_again():
    rig = Rig(homed=['cell1/z', 'cell2/y'])
    request = rig.home()
    rig.run(1.0)
    assert rig.started() == ['cell2/z', 'cell1/x']
    assert [t.axis for t in request.turns if t.skipped] == ['cell1/z', 'cell2/y']
    rig.home(force=True)
    rig.run(1.0)
    assert rig.started()[2:] == ['cell1/z', 'cell2/z', 'cell1/x', 'cell2/y']
    other = Rig(homed=['cell1/z'], skip_homed=False)
    other.home('cell1/z')
    assert other.started() == ['cell1/z']


def test_the_same_request_again_homes_what_is_left():
    rig = Rig(auto=False)
    first = rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.end('cell1/z')
    rig.end('cell2/z', Error.LSTriggered)
    rig.run(1.0)
    assert errors(first) == {
        'cell2/z': 'LSTriggered',
        'cell1/x': 'Canceled',
        'cell2/y': 'Canceled',
    }
    rig.auto = True
    again = rig.home()
    rig.run(1.0)
    assert rig.started()[2:] == ['cell2/z', 'cell1/x', 'cell2/y']
    assert again.done
    assert not errors(again)


@pytest.mark.parametrize(
    ('on_failure', 'stops', 'later'),
    [('stop_all', True, []), ('stop_step', True, ['cell1/x']), ('go_on', False, ['cell1/x'])],
)
def test_what_a_failure_stops(on_failure, stops, later):
    rig = Rig(auto=False, on_failure=on_failure)
    request = rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.end('cell1/z', Error.LSTriggered)
    rig.run(0.1)
    assert rig.canceled == (['cell2/z'] if stops else [])
    assert not request.done
    rig.end('cell2/z', Error.Canceled if stops else Error.NoError)
    rig.run(0.1)
    assert rig.started()[2:] == later  # cell2/y requires cell1/z, which is not homed
    for axis in later:
        rig.accept(axis)
        rig.end(axis)
    rig.run(0.1)
    assert request.done
    found = errors(request)
    assert found['cell1/z'] == 'LSTriggered'
    assert found['cell2/y'] == ('Canceled' if on_failure == 'stop_all' else 'PrerequisiteMissing')


@pytest.mark.parametrize('on_failure', ['stop_step', 'go_on'])
def test_nothing_more_starts_after_an_axis_that_does_not_come_to_rest(on_failure):
    """It may still move: what homes beside it stops, and no later step begins."""
    rig = Rig(auto=False, on_failure=on_failure)
    request = rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.core.cancel(['cell1/z'], 'test', rig.now)
    rig.run(9.0)
    assert rig.canceled == ['cell1/z']
    rig.run(2.0)  # it moves on
    assert rig.canceled.count('cell2/z') == 1
    rig.end('cell2/z', Error.Canceled)
    rig.run(1.0)
    assert rig.started() == ['cell1/z', 'cell2/z']
    assert request.done
    assert errors(request) == {
        'cell1/z': 'ResultLost',
        'cell2/z': 'Canceled',
        'cell1/x': 'Canceled',
        'cell2/y': 'Canceled',
    }
    told = request.outcomes['cell1/x'].message
    assert told == 'cell1/x: not started: cell1/z may still move (ResultLost)'


def test_an_axis_whose_prerequisite_is_missing_does_not_start():
    rig = Rig()
    request = rig.home('cell2/y')
    assert rig.started() == []
    assert errors(request) == {'cell2/y': 'PrerequisiteMissing'}
    assert 'requires cell1/z, which is not homed' in request.outcomes['cell2/y'].message
    assert rig.core.locks('cell2', rig.now) == {'cell2/y': 'cell1/z is not homed'}
    rig.homed.add('cell1/z')
    rig.run(0.1)
    assert rig.core.locks('cell2', rig.now) == {'cell2/y': ''}
    assert rig.core.locks('cell1', rig.now) == {}
    rig.home('cell2/y')
    assert rig.started() == ['cell2/y']


def test_an_axis_waits_while_what_it_requires_is_homed_again():
    rig = Rig(homed=['cell1/z'], auto=False)
    again = rig.home('cell1/z', force=True)
    rig.core.accepted(rig.number('cell1/z'), rig.now)  # its state still says that it is homed
    request = rig.home('cell2/y')
    rig.run(0.5)
    assert rig.started() == ['cell1/z']
    assert rig.core.locks('cell2', rig.now) == {'cell2/y': 'cell1/z is homing'}
    rig.end('cell1/z')
    rig.answer()
    assert rig.started() == ['cell1/z', 'cell2/y']
    assert again.done and not request.done


def test_what_an_axis_requires_is_not_homed_again_while_it_homes():
    rig = Rig(homed=['cell1/z'], auto=False)
    rig.home('cell2/y')
    rig.accept('cell2/y')
    rig.home('cell1/z', force=True)
    rig.run(0.5)
    assert rig.started() == ['cell2/y']
    rig.end('cell2/y')
    rig.answer()
    assert rig.started() == ['cell2/y', 'cell1/z']


def test_a_cell_that_restarts_between_steps_undoes_the_step():
    rig = Rig(auto=False, requires=[])
    request = rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.end('cell1/z')
    rig.homed.clear()
    rig.core.restarted('cell1', rig.now)
    rig.run(TICK)
    rig.end('cell2/z')
    rig.run(0.1)
    assert rig.started() == ['cell1/z', 'cell2/z']
    assert request.done
    assert errors(request)['cell1/x'] == 'PrerequisiteMissing'
    assert 'cell1/z is not homed' in request.outcomes['cell1/x'].message


def test_a_cell_that_restarts_while_it_is_asked_is_asked_again():
    rig = Rig(homed=['cell1/z'], auto=False)
    rig.silent.add('cell1')  # its answer is on the way
    rig.home('cell2/y')
    rig.silent.clear()
    rig.homed.clear()
    rig.core.restarted('cell1', rig.now)
    rig.answer()
    assert rig.started() == []
    assert rig.core.home(['cell2/y'], 'test', rig.now).outcomes  # the first one has ended


def test_a_check_that_is_answered_late_counts():
    rig = Rig(auto=False)
    rig.core.home(['cell1/x'], 'test', rig.now)
    (asked,) = rig.core.take_asks()
    rig.silent.add('cell1')
    rig.run(2.0)
    rig.silent.clear()
    answer = Checked({'cell1/x': Seen(False, True)}, {'cell1/x': ()}, 1.0)
    rig.core.checked(asked.number, 'cell1', answer, rig.now)
    rig.answer()
    assert rig.started() == ['cell1/x']


def test_a_cell_that_restarts_in_a_run_is_lost():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.accept('cell1/x')
    rig.core.restarted('cell1', rig.now)
    assert errors(request) == {'cell1/x': 'CellLost'}
    assert 'has restarted' in request.outcomes['cell1/x'].message


def test_a_silent_cell_is_lost_after_a_second_and_the_others_stop():
    rig = Rig(auto=False)
    request = rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.run(0.5)
    rig.silent.add('cell1')
    rig.run(0.9)
    assert not any(turn.ended for turn in request.turns)
    rig.run(0.3)
    assert errors(request)['cell1/z'] == 'CellLost'
    assert rig.canceled == ['cell2/z']
    assert not request.done  # cell2/z does not rest yet
    rig.end('cell2/z', Error.Canceled)
    rig.run(TICK)
    assert request.done


@pytest.mark.parametrize('on_failure', ['stop_all', 'go_on'])
def test_a_goal_that_a_lost_cell_goes_on_with_is_canceled_when_it_is_heard_again(on_failure):
    rig = Rig(auto=False, steps=[], requires=[], on_failure=on_failure)
    request = rig.home('cell1/x', 'cell1/z')
    rig.accept('cell1/x')
    number = rig.number('cell1/x')
    rig.silent.add('cell1')
    rig.run(12.0)
    assert request.done
    assert errors(request)['cell1/x'] == 'CellLost'
    rig.silent.clear()
    rig.canceled.clear()
    for _ in range(50):  # its feedback comes for 2.5 s
        rig.core.under_way(number, rig.now)
        rig.run(TICK)
    assert rig.canceled == ['cell1/x'] * 3  # a cancel may be lost


def test_a_cell_that_was_never_heard_is_lost():
    rig = Rig(silent=['cell1'])
    request = rig.home('cell1/x')
    rig.run(5.2)
    assert errors(request) == {'cell1/x': 'CellLost'}
    assert '/cell1/homing_node does not answer' in request.outcomes['cell1/x'].message


def test_a_coordinator_that_was_held_up_itself_takes_no_cell_for_lost():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.accept('cell1/x')
    rig.now += 30.0
    rig.core.tick(rig.now)
    rig.run(1.0)
    assert not request.done
    rig.end('cell1/x')
    assert not errors(request)


def test_a_result_that_is_lost_is_asked_for_again_and_the_state_tells():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.accept('cell1/x')
    rig.run(1.0)
    rig.moving.clear()
    rig.homed.add('cell1/x')
    rig.run(2.2)
    assert rig.asked_again == ['cell1/x']
    rig.run(2.2)
    assert errors(request) == {'cell1/x': 'ResultLost'}
    assert 'its last state: homed, at rest' in request.outcomes['cell1/x'].message
    other = rig.home('cell1/x')
    assert other.turn_of['cell1/x'].skipped


def test_a_result_that_comes_when_asked_again_counts():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.accept('cell1/x')
    rig.moving.clear()
    rig.run(2.2)
    assert rig.asked_again == ['cell1/x']
    rig.end('cell1/x')
    assert request.done
    assert not errors(request)


def test_a_goal_that_its_cell_does_not_know_is_lost():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.accept('cell1/x')
    rig.core.gone(rig.number('cell1/x'), rig.now)
    assert errors(request) == {'cell1/x': 'ResultLost'}


def test_feedback_shows_that_a_goal_waits_at_its_node():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.core.accepted(rig.number('cell1/x'), rig.now)
    for _ in range(60):
        rig.core.under_way(rig.number('cell1/x'), rig.now)
        rig.run(0.1)
    assert rig.asked_again == []
    assert not request.done


def test_a_cancel_that_races_with_a_result():
    rig = Rig(auto=False)
    request = rig.home()
    rig.accept('cell1/z', 'cell2/z')
    stopped = rig.core.cancel(request.names, 'canceled', rig.now)
    rig.end('cell1/z')  # it was homed already
    rig.end('cell2/z', Error.Canceled)
    rig.run(TICK)
    assert all(turn.ended for turn in stopped)
    assert errors(request) == dict.fromkeys(['cell2/z', 'cell1/x', 'cell2/y'], 'Canceled')


def test_an_acceptance_that_comes_too_late_is_canceled():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.run(5.1)
    assert rig.canceled == ['cell1/x']
    rig.run(2.5)
    assert errors(request) == {'cell1/x': 'ResultLost'}
    assert 'the goal to be accepted' in request.outcomes['cell1/x'].message
    rig.canceled.clear()
    rig.core.accepted(rig.number('cell1/x'), rig.now)
    rig.answer()
    assert rig.canceled == ['cell1/x']


def test_a_cancel_before_the_acceptance_is_repeated_after_it():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.core.cancel(['cell1/x'], 'canceled', rig.now)
    rig.answer()
    rig.accept('cell1/x')
    rig.answer()
    assert rig.canceled == ['cell1/x', 'cell1/x']
    rig.end('cell1/x', Error.Canceled)
    assert errors(request) == {'cell1/x': 'Canceled'}


def test_an_axis_that_does_not_rest_after_a_cancel():
    rig = Rig(auto=False)
    request = rig.home('cell1/x')
    rig.accept('cell1/x')
    rig.core.cancel(['cell1/x'], 'canceled', rig.now)
    rig.run(10.2)
    assert errors(request) == {'cell1/x': 'ResultLost'}
    assert 'still moving' in request.outcomes['cell1/x'].message


def test_names_that_nothing_has():
    rig = Rig()
    for name, error in (
        ('cell3/x', 'UnknownCell'),
        ('cell1/q', 'UnknownAxis'),
        ('x', 'UnknownAxis'),
    ):
        refusal = rig.home(name)
        assert refusal.error == error
        assert repr(name.partition('/')[0])[1:-1] in refusal.message


def test_an_axis_that_turns_out_to_be_none():
    rig = Rig()
    rig.core.cells['cell1'].axes = None  # it has not said what it has
    request = rig.home('cell1/q')
    assert errors(request) == {'cell1/q': 'UnknownAxis'}


def test_an_axis_has_one_request():
    rig = Rig(auto=False)
    rig.home('cell1/x')
    refusal = rig.home('cell1/x', 'cell1/z')
    assert refusal.error is Error.Busy
    assert 'test is homing cell1/x' in refusal.message


def test_two_coordinators_refuse_until_one_is_gone():
    rig = Rig()
    rig.core.claims.take('1234', '/other', rig.now)
    refusal = rig.home()
    assert refusal.error is Error.CoordinatorConflict
    assert '/other' in refusal.message
    rig.run(3.1)
    assert isinstance(rig.home(), Request)


def test_a_lock_that_opens_late_is_waited_for_but_not_for_ever():
    rig = Rig(homed=['cell1/z'], auto=False)
    rig.locked['cell2/y'] = ['PrerequisiteMissing: axis y: cell1/z is not homed']
    rig.home('cell2/y')
    rig.run(1.0)
    assert rig.started() == []
    rig.locked.clear()
    rig.run(0.3)
    assert rig.started() == ['cell2/y']
    other = Rig()
    other.locked['cell1/x'] = ['PrerequisiteMissing: axis x: another coordinator says no']
    request = other.home('cell1/x')
    other.run(3.3)
    assert errors(request) == {'cell1/x': 'PrerequisiteMissing'}
    assert 'another coordinator says no' in request.outcomes['cell1/x'].message


def test_axes_in_no_step_home_last_and_one_by_one():
    rig = Rig(steps=['cell2/z'])
    request = rig.home('cell1/x', 'cell1/z', 'cell2/z')
    assert [[t.axis for t in step] for step in request.steps] == [
        ['cell2/z'],
        ['cell1/x'],
        ['cell1/z'],
    ]
    assert rig.core.cells.names == ['cell2/z']
    assert Rig(steps=[]).core.cells.names == ['cell1/x', 'cell1/z', 'cell2/y', 'cell2/z']


def test_a_coordinator_that_ends_stops_what_it_homes():
    rig = Rig(auto=False)
    request = rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.core.close(rig.now)
    rig.answer()
    assert rig.canceled == ['cell1/z', 'cell2/z']
    assert rig.home('cell1/x').error is Error.Canceled
    rig.end('cell1/z', Error.Canceled)
    rig.end('cell2/z', Error.Canceled)
    rig.run(TICK)
    assert rig.core.idle
    assert set(errors(request).values()) == {'Canceled'}


# -- what it says of itself -----------------------------------------------------------------------


def said(rig, **foreign):
    return {one.name: one for one in health(rig.core, foreign, rig.now)}


def test_the_health_of_a_line():
    rig = Rig(auto=False)
    entry = said(rig)['cell2']
    assert (entry.level, entry.text) == (Level.warn, 'not homed: cell2/y, cell2/z')
    assert entry.values['locked'] == 'cell2/y: cell1/z is not homed'
    assert said(rig)['line'].text == 'nothing homes'
    rig.home()
    rig.accept('cell1/z', 'cell2/z')
    rig.run(0.1)
    found = said(rig)
    assert found['line'].text == 'homing cell1/z, cell2/z'
    assert found['line'].values['waiting'] == 'cell1/x, cell2/y'
    assert found['cell1'].text == 'not homed: cell1/x'
    assert found['cell1'].values['moving'] == 'cell1/z'
    rig.end('cell1/z')
    rig.core.state('cell2/y', Seen(False, True, 'LSTriggered', stamp=rig.now), rig.now)
    found = said(rig)
    assert found['cell1'].values['homed'] == 'cell1/z'
    assert found['cell2'].text == 'not homed: cell2/y (LSTriggered)'
    homed = Rig(homed=['cell1/x', 'cell1/z'])
    assert (said(homed)['cell1'].level, said(homed)['cell1'].text) == (Level.ok, 'homed')


def test_the_health_of_a_cell_that_is_lost_or_another_one():
    rig = Rig(homed=['cell1/x', 'cell1/z'], silent=['cell2'])
    never = said(rig)['cell2']
    assert never.level is Level.error
    assert never.text == 'CellLost: /cell2/homing_node was never heard'
    assert never.values['heard'] == 'never'
    rig.silent.add('cell1')
    rig.run(5.0)
    lost = said(rig)['cell1']
    assert (lost.level, lost.text) == (Level.error, 'CellLost: /cell1/homing_node is silent')
    assert lost.values['heard'] == '5.0 s ago'
    rig.silent.clear()
    rig.core.restarted('cell1', rig.now)
    rig.run(TICK)
    assert said(rig)['cell1'].text == 'it has not said yet which axes it has'
    rig.core.axes('cell1', ['cell1/x'])
    other = said(rig)['cell1']
    assert other.level is Level.error
    assert other.text.startswith('UnknownAxis: cell1/z, which `steps` or `requires` name')
    foreign = said(rig, cell1='it publishes other fields')['cell1']
    assert (foreign.level, foreign.text) == (Level.error, 'it publishes other fields')
    rig.core.claims.take('1234', '/other', rig.now)
    assert said(rig)['line'].text == ('CoordinatorConflict: /other guards cells of this line, too')


def test_a_cell_that_comes_back_with_other_axes():
    rig = Rig(homed=['cell1/x', 'cell1/z'])
    rig.silent.add('cell1')
    rig.run(5.0)
    rig.core.axes('cell1', ['cell1/w', 'cell1/x'])  # it was asked again, for it was lost
    assert rig.home('cell1/z').error is Error.UnknownAxis
    assert rig.home().error is Error.UnknownAxis
    assert rig.core.cells['cell1'].seen.keys() == {'cell1/x'}
    assert rig.core.locks('cell2', rig.now) == {
        'cell2/y': 'cell cell1 is silent, so whether cell1/z is homed is not known'
    }


# -- a dry run ------------------------------------------------------------------------------------


def preview(rig, *axes, force=False, wait=0.1):
    found = rig.core.preview(axes, rig.now, force)
    rig.answer()
    rig.run(wait)
    assert found.done
    assert found in rig.ended
    return found


def test_a_dry_run_says_the_order_the_times_and_what_is_missing():
    rig = Rig(homed=['cell2/z'])
    found = preview(rig)
    assert found.order == [['cell1/z'], ['cell1/x', 'cell2/y']]
    assert found.durations == [2.0, 2.0]
    assert found.missing == []
    assert rig.started() == []
    assert preview(rig, force=True).order[0] == ['cell1/z', 'cell2/z']
    assert preview(Rig(at_once=1)).durations == [4.0, 4.0]


def test_a_dry_run_says_what_would_refuse():
    rig = Rig()
    found = preview(rig, 'cell2/y')
    assert found.missing == [
        'cell2/y: PrerequisiteMissing: it requires cell1/z, which is not homed'
    ]
    assert found.error is Error.PrerequisiteMissing
    rig.locked['cell1/x'] = ['EmergencyStop: axis x: the emergency stop is on']
    assert preview(rig).missing == ['cell1/x: EmergencyStop: axis x: the emergency stop is on']
    unknown = preview(rig, 'cell9/x', 'cell1/z')
    assert unknown.error is Error.UnknownCell
    assert unknown.order == [['cell1/z']]


def test_a_dry_run_of_a_cell_that_does_not_answer():
    rig = Rig(silent=['cell1'])
    found = preview(rig, wait=7.0)
    assert [text for text in found.missing if 'CellLost: /cell1/homing_node' in text]
    assert math.isnan(found.durations[0])
    assert found.error is Error.CellLost
    assert 'how long cell1/z, cell1/x will take is not known' in found.unknown


def test_a_dry_run_does_not_wait_for_a_cell_that_is_known_to_be_silent():
    rig = Rig()
    rig.silent = ['cell1']
    rig.run(4.0)
    found = preview(rig, wait=2 * TICK)
    assert [text for text in found.missing if 'CellLost: /cell1/homing_node' in text]
    assert found.steps == [('cell1/z', 'cell2/z'), ('cell1/x', 'cell2/y')]


def test_a_dry_run_waits_for_a_cell_that_answers_slowly(monkeypatch):
    """Each answer takes 3 s, all of them 6 s: the cell is not given up."""
    monkeypatch.setattr('homing_node.coordination.preview.OPEN', 1)
    axes = [('cell1/z',), ('cell1/x',)]
    asking = Preview(line({'nodes': NODES, 'steps': STEPS}), axes, None, force=False)
    now = 0.0
    for number in range(20):
        if not (axis := asking.next()):
            continue
        asking.asked(number, now)
        for _ in range(30):
            now += 0.1
            asking.tick((), now)
            if asking.next():  # asked for once more
                asking.asked(number, now)
        asking.checked(number, Checked({axis: Seen(False, True)}, {axis: ()}, 2.0), now)
    assert asking.done
    assert asking.missing == []
    assert asking.durations == [2.0, 2.0]


# -- cells whose events are lost, late and doubled ------------------------------------------------


class Storm:
    """Cells behind a bad network, which die and come back; the truth is kept beside."""

    def __init__(self, seed, loss, late, double, deaths, **values):
        self.chance = random.Random(seed)
        self.loss, self.late, self.double, self.deaths = loss, late, double, deaths
        self.core = Coordinator(
            line({'nodes': NODES, 'steps': STEPS, 'requires': REQUIRES, **values})
        )
        self.now, self.on_the_way, self.order = 0.0, [], 0
        self.homed = set()
        self.runs = {}  # axis -> (number, when it ends, how)
        self.results = {}  # by number, as long as the node lives
        self.born = dict.fromkeys(AXES, 0)  # the life of each node; None: it is dead
        self.back = {}
        self.heard = dict.fromkeys(AXES, 0)
        self.truth = {}  # (number of a check, axis) -> (was it homed, when)
        self.starts = []

    def send(self, act, *arguments):
        for _ in range(2 if self.chance.random() < self.double else 1):
            if self.chance.random() >= self.loss:
                delay = self.chance.choice([0.1, 0.4, 2.0]) if self.late else 0.02
                self.on_the_way.append((self.now + delay, act, arguments))

    def step(self):
        self.now += 0.1
        for cell in AXES:
            if self.born[cell] is not None and self.chance.random() < self.deaths:
                self.die(cell)
            elif self.born[cell] is None and self.now > self.back[cell]:
                self.born[cell] = round(self.now * 10)
        for axis, (number, end, error) in list(self.runs.items()):
            if self.now >= end:
                del self.runs[axis]
                self.homed |= {axis} if error is Error.NoError else set()
                self.results[number] = axis, error, Seen(axis in self.homed, True, stamp=self.now)
                self.send(self.result, number, *self.results[number])
        for cell, axes in AXES.items():
            for axis in axes if self.born[cell] is not None else ():
                if axis in self.runs:
                    self.send(self.core.under_way, self.runs[axis][0])
                seen = Seen(axis in self.homed, axis not in self.runs, stamp=self.now)
                self.send(self.state, cell, self.born[cell], axis, seen)
        due = [one for one in self.on_the_way if one[0] <= self.now]
        self.on_the_way = [one for one in self.on_the_way if one[0] > self.now]
        for _, act, arguments in due:
            if act == self.core.under_way:
                arguments = (*arguments, self.now)
            act(*arguments)
        ended = self.core.tick(self.now)
        for ask in self.core.take_asks():
            if ask.kind is Asks.Goal:
                self.look(ask.axes[0])
            self.send(self.take, ask)
        return ended

    def die(self, cell):
        self.born[cell] = None
        self.back[cell] = self.now + self.chance.choice([0.3, 4.0, 30.0])
        for axis in AXES[cell]:
            self.homed.discard(axis)
            self.runs.pop(axis, None)
        self.results = {n: one for n, one in self.results.items() if one[0] not in AXES[cell]}

    def state(self, cell, born, axis, seen):
        if born < self.heard[cell]:
            return  # of a node that is dead: another writer
        if born > self.heard[cell]:
            self.heard[cell] = born
            self.core.restarted(cell, self.now)
        self.core.state(axis, seen, self.now)

    def result(self, number, axis, error, seen):
        self.core.result(number, Outcome(error, axis), self.now, seen)

    def accept(self, number):
        self.core.accepted(number, self.now)

    def gone(self, number):
        self.core.gone(number, self.now)

    def checked(self, number, cell, answer):
        self.core.checked(number, cell, answer, self.now)

    def take(self, ask):
        """Let a node take what it is asked."""
        if self.born[ask.cell] is None:
            return
        axis = ask.axes[0]
        if ask.kind is Asks.Check:
            for one in ask.axes:
                self.truth[ask.number, one] = one in self.homed, self.now
            seen = {a: Seen(a in self.homed, a not in self.runs, stamp=self.now) for a in ask.axes}
            answer = Checked(seen, dict.fromkeys(ask.axes, ()), 1.0)
            self.send(self.checked, ask.number, ask.cell, answer)
        elif ask.kind is Asks.Goal:
            if ask.number in self.results:  # doubled
                return
            self.send(self.accept, ask.number)
            if axis in self.runs:
                seen = Seen(False, False, stamp=self.now)
                self.results[ask.number] = axis, Error.Busy, seen
                self.send(self.result, ask.number, *self.results[ask.number])
            else:
                self.homed.discard(axis)
                error = self.chance.choice([Error.NoError] * 9 + [Error.LSTriggered])
                self.starts.append((axis, self.now))
                self.runs[axis] = ask.number, self.now + self.chance.uniform(0.0, 3.0), error
        elif ask.kind is Asks.Cancel:
            run = self.runs.get(axis)
            if run and run[0] == ask.number:
                self.runs[axis] = ask.number, self.now + 0.3, Error.Canceled
        elif ask.number in self.results:
            self.send(self.result, ask.number, *self.results[ask.number])
        elif not any(ask.number == run[0] for run in self.runs.values()):
            self.send(self.gone, ask.number)

    def look(self, axis):
        """A goal leaves: what its axis requires was homed when its cell said so last."""
        request = self.request
        turn = request.turn_of[axis]
        for required in self.core.line.requires.get(axis, ()):
            said = [self.truth.get((number, required), (False, 0.0)) for number in turn.checks]
            assert any(homed and self.now - when <= 5.0 for homed, when in said)
        busy = [one for one in request.turns if one.phase in UNDER_WAY]
        assert len(busy) <= self.core.line.at_once
        for step in request.steps[: request.begun - 1]:
            assert all(one.ended for one in step)

    def home(self, longest=150.0):
        for _ in range(20):
            self.step()
        request = self.request = self.core.home([], 'test', self.now)
        end = self.now + longest
        while request not in self.step():
            assert self.now < end, [(t.axis, t.phase) for t in request.turns]
        return request


@given(
    seed=st.integers(0, 10**6),
    loss=st.sampled_from([0.0, 0.05, 0.3]),
    late=st.booleans(),
    double=st.sampled_from([0.0, 0.3]),
    deaths=st.sampled_from([0.0, 0.005, 0.03]),
    on_failure=st.sampled_from(['stop_all', 'stop_step', 'go_on']),
    at_once=st.sampled_from([1, 8]),
)
def test_a_request_always_ends_and_no_axis_starts_without_what_it_requires(
    seed, loss, late, double, deaths, on_failure, at_once
):
    storm = Storm(seed, loss, late, double, deaths, on_failure=on_failure, at_once=at_once)
    request = storm.home()
    for axis, outcome in request.outcomes.items():
        assert outcome.success or axis in outcome.message or outcome.error is not Error.NoError
    if not (loss or deaths):  # nothing that was started is left running
        for _ in range(60):
            storm.step()
        assert storm.runs == {}
    if not (loss or deaths or late) and not set(errors(request).values()):
        assert storm.homed == {axis for axes in AXES.values() for axis in axes}
        begun = [axis for axis, _ in storm.starts]
        assert sorted(begun[:2]) == ['cell1/z', 'cell2/z']


def test_a_storm_without_any_trouble_homes_the_line():
    for seed in range(5):
        storm = Storm(seed, 0.0, False, 0.0, 0.0)
        storm.chance.choice = lambda options: options[0]
        assert not errors(storm.home())
