# SPDX-License-Identifier: Apache-2.0
"""What is published by time: by turns, each axis as often as the others."""

import itertools
import math
import queue
import random
import threading
from collections import Counter
from types import SimpleNamespace

import pytest
from core_rig import rig
from homing_interfaces.msg import AxisState

from homing_node.core.axis import Axis
from homing_node.core.outcome import Outcome
from homing_node.parameters.connections import Output
from homing_node.procedures.states import Error, Input
from homing_node.ros import reports
from homing_node.ros.reports import LINGER, STATES_AT_ONCE, Publishers, Reports


class Watched:
    """Reports about some axes that home, without a graph: what is published is kept."""

    def __init__(self, number, period=0.004):
        self.axes = {f'a{i}': Axis(f'a{i}', rig('HS').parameters(), 0.004) for i in range(number)}
        for axis in self.axes.values():
            for switch in axis.parameters.inputs:
                axis.switch(switch, 0.0, False)
            axis.feedback(0.0, 0.05)
            assert axis.home(0.0) is None
        self.published = []
        self.reports = Reports(
            self.axes,
            {name: name for name in self.axes},
            Publishers(
                states=dict.fromkeys(self.axes, self.publisher('states')),
                outputs={
                    axis: {output: self.publisher(str(output)) for output in Output}
                    for axis in self.axes
                },
                joint_states=self.publisher('joint_states'),
                diagnostics=self.publisher('diagnostics'),
            ),
            lambda: 0,
            threading.Lock(),
            'homing_node',
            SimpleNamespace(
                **{level: self.logger(level) for level in ('info', 'warning', 'error')}
            ),
            period=period,
        )

    def publisher(self, kind):
        return SimpleNamespace(publish=lambda message: self.published.append((kind, message)))

    def logger(self, level):
        return lambda text: self.published.append(('log', (level, text)))

    def publish(self, until):
        """Publish until a condition is true."""
        self.reports.run(lambda: until(self.of('states')))

    def of(self, kind):
        return [message for published, message in self.published if published == kind]


def test_homed_positions_are_published_no_more_often_than_they_are_new():
    for period, pause in ((0.004, 0.02), (0.1, 0.1)):
        watched = Watched(1, period)
        watched.axes['a0'].homed = True
        assert watched.reports._joint_states() == pause


def end(axis, outcome):
    """End a run."""
    axis.machine, axis.outcome = None, outcome
    axis.history.add(outcome.error, outcome.home_position_raw)


@pytest.mark.parametrize('number', [1, STATES_AT_ONCE, 2 * STATES_AT_ONCE + 3])
def test_all_axes_that_home_are_told_of_in_turn(number):
    watched = Watched(number)
    watched.publish(lambda states: len(states) >= 3 * number)
    told = [message.axis for message in watched.of('states')]
    for turn in range(3):
        assert sorted(told[turn * number : (turn + 1) * number]) == sorted(watched.axes)


def test_axes_that_rest_are_told_of_a_tenth_as_often():
    watched = Watched(3)
    watched.axes['a1'].machine = None
    watched.publish(lambda states: Counter(one.axis for one in states)['a1'] >= 2)
    told = Counter(message.axis for message in watched.of('states'))
    assert told['a1'] == 2
    assert 3 * told['a1'] < told['a0'] < 12


@pytest.mark.parametrize(('states', 'pause'), [(0, 0.0), (1, LINGER)])
def test_the_node_stays_until_its_last_report_is_there(monkeypatch, states, pause):
    watched, slept = Watched(1), []
    monkeypatch.setattr(
        reports, 'time', SimpleNamespace(monotonic=lambda: 5.0, sleep=slept.append)
    )
    watched.publish(lambda told: len(told) >= states)
    assert slept == [pytest.approx(pause)]


def test_what_changes_is_told_at_once_and_once():
    watched = Watched(1)
    (axis,) = watched.axes.values()
    watched.reports.report(axis)
    watched.reports.report(axis)
    axis.set_servo(False)
    watched.reports.report(axis)
    watched.reports.report(axis)
    watched.reports.run(lambda: True)
    assert [message.error for message in watched.of('states')] == ['NoError', 'ServoOff']
    assert watched.of('servo_on') == [True, False]
    assert watched.of('torque_limit') == [0.0]
    assert watched.of('arm_latch') == [False]


def test_another_home_is_a_change():
    """A run of CurrentPos begins and ends within one cycle."""
    watched = Watched(1)
    (axis,) = watched.axes.values()
    for position in (1.0, 2.0):
        end(axis, Outcome(Error.NoError, '', position, position))
        axis.homed = True
        watched.reports.report(axis)
    watched.reports.run(lambda: True)
    assert [message.home_offset for message in watched.of('states')] == [1.0, 2.0]


@pytest.mark.parametrize(
    ('outcome', 'level', 'text'),
    [
        (
            Outcome(Error.NoError, '', 0.25, 0.25, 1e-5),
            'info',
            'axis a0: Homed: home_position_raw=0.250000000 m ± 10 µm home_offset=0.250000000 m '
            'uncertainty=1e-05 m',
        ),
        (Outcome(Error.Canceled, 'axis a0: canceled'), 'warning', 'Canceled: axis a0: canceled'),
        (
            Outcome(Error.LSTriggered, 'axis a0: a limit', warnings=('it bounced',)),
            'error',
            'LSTriggered: axis a0: a limit | warning: it bounced',
        ),
    ],
)
def test_the_end_of_a_run_is_logged_once(outcome, level, text):
    watched = Watched(1)
    (axis,) = watched.axes.values()
    axis.outcome = Outcome(Error.NoError)  # a run begins
    watched.reports.report(axis)
    end(axis, outcome)
    watched.reports.report(axis)
    axis.set_servo(False)
    watched.reports.report(axis)
    watched.reports.run(lambda: True)
    assert watched.of('log') == [(level, text)]


def test_a_run_that_ends_as_the_last_one_is_logged_too():
    watched = Watched(1)
    (axis,) = watched.axes.values()
    for _ in range(2):
        end(axis, Outcome(Error.NoError, '', 1.0, 1.0))
        assert watched.reports.report(axis)  # else its request would not be answered
        assert not watched.reports.report(axis)
    watched.reports.run(lambda: True)
    assert len(watched.of('log')) == 2


def test_what_comes_by_time_always_comes(monkeypatch):
    """However short the wait is: that of queue.SimpleQueue may never end (Python up to 3.12)."""
    clock, jitter = itertools.count(), random.Random(0)
    monkeypatch.setattr(
        reports,
        'time',
        SimpleNamespace(
            monotonic=lambda: 4e-7 * next(clock) + jitter.uniform(0.0, 3e-6), sleep=lambda _: None
        ),
    )
    monkeypatch.setattr(reports, 'STATE_PERIOD', math.inf)
    monkeypatch.setattr(reports, 'DIAGNOSTICS_PERIOD', 1.1e-6)
    monkeypatch.setattr(reports.messages, 'diagnostics', lambda *_: None)
    watched = Watched(0)
    told = threading.Thread(
        target=watched.reports.run, args=[lambda: len(watched.published) >= 30000], daemon=True
    )
    told.start()
    told.join(20.0)
    assert not told.is_alive()


class Turns:
    """A clock that only waiting moves, and reports that note when they come."""

    def __init__(self, monkeypatch):
        self.now, self.times = 0.0, []
        monkeypatch.setattr(
            reports,
            'time',
            SimpleNamespace(monotonic=lambda: self.now, sleep=lambda _: None),
        )
        monkeypatch.setattr(reports.messages, 'diagnostics', lambda *_: self.note())
        self.held_up = 0.0
        self.watched = Watched(0)
        self.watched.reports._queue = self

    def note(self):
        self.times.append(self.now)
        self.now += self.held_up
        self.held_up = 0.0

    def get(self, timeout):
        self.now += timeout
        raise queue.Empty

    def get_nowait(self):
        raise queue.Empty

    def put(self, item):
        pass

    @staticmethod
    def empty():
        return True

    def run(self, times):
        self.watched.reports.run(lambda: len(self.times) >= times)


def test_a_late_report_is_timed_anew(monkeypatch):
    """It does not catch up in a burst."""
    turns = Turns(monkeypatch)
    turns.run(3)
    turns.held_up = 5.5
    turns.run(len(turns.times) + 4)
    pauses = [later - earlier for earlier, later in itertools.pairwise(turns.times[3:])]
    assert pauses[0] >= 5.5
    assert pauses[1:] == pytest.approx([1.0] * len(pauses[1:]))


def test_what_is_afterwards_comes_behind_what_was_queued():
    watched = Watched(1)
    (axis,) = watched.axes.values()
    end(axis, Outcome(Error.NoError, '', 1.0, 1.0))
    watched.reports.report(axis)
    watched.reports.afterwards(
        lambda argument: watched.published.append(('answer', argument)), 'x'
    )
    assert watched.published == []
    watched.reports.run(lambda: True)
    kinds = [kind for kind, _ in watched.published]
    assert kinds.index('states') < kinds.index('answer')
    watched.reports.afterwards(lambda argument: watched.published.append(('late', argument)), 'x')
    assert watched.of('late') == ['x']


def test_what_is_afterwards_comes_though_publishing_breaks():
    watched, given = Watched(1), []

    def broken(_):
        raise OSError('the network is gone')

    watched.reports.afterwards(broken, 'first')
    watched.reports.afterwards(given.append, 'second')
    with pytest.raises(OSError, match='gone'):
        watched.reports.run(lambda: False)
    assert given == ['second']
    watched.reports.afterwards(given.append, 'third')
    assert given == ['second', 'third']


def test_a_new_level_of_an_axis_at_rest_is_told_at_once(monkeypatch):
    watched = Watched(2)
    for axis in watched.axes.values():
        end(axis, Outcome(Error.NoError))
    resting = watched.axes['a1']
    resting.switch(Input.HOME_SWITCH, 1.0, True)
    watched.reports._changed_levels()
    watched.reports._changed_levels()
    (told,) = [watched.reports._queue.get_nowait()[1]]
    assert watched.reports._queue.empty()
    assert dict(zip(told.inputs, told.levels, strict=True))['home_switch'] == AxisState.LEVEL_ON


def test_the_loss_of_a_home_at_rest_is_logged_once():
    watched = Watched(1)
    axis = watched.axes['a0']
    end(axis, Outcome(Error.NoError, 'Homed', home_position_raw=0.1))
    axis.homed = True
    watched.reports.report(axis)
    axis.homed, axis.outcome = False, axis.outcome._replace(error=Error.HomeLost, message='gone')
    watched.reports.report(axis)
    watched.reports.report(axis)
    watched.publish(lambda states: True)
    assert watched.of('log')[-1] == ('warning', 'gone')
    assert len(watched.of('log')) == 2
