# SPDX-License-Identifier: Apache-2.0
"""The locks that coordinators put on the axes of a node; expected durations."""

import math

from homing_node.core.locks import SILENT, Locks
from homing_node.memory.expected import NEWEST, expected_duration, longest
from homing_node.memory.records import Run
from homing_node.procedures.states import Error


def reason(locks, axis, now=0.0):
    refusal = locks.refusal(axis, now)
    if refusal is None:
        return ''
    assert refusal.error is Error.PrerequisiteMissing
    return refusal.message


def test_an_axis_is_locked_as_long_as_the_coordinator_says_so():
    locks = Locks()
    assert reason(locks, 'y') == ''
    locks.take('1', '/line', {'y': 'cell1/z is not homed'}, 0.0)
    assert reason(locks, 'y') == 'axis y: cell1/z is not homed'
    assert reason(locks, 'x') == ''
    locks.take('1', '/line', {'y': ''}, 1.0)
    assert reason(locks, 'y', 1.0) == ''


def test_a_guarded_axis_stays_locked_when_its_coordinator_dies():
    locks = Locks()
    locks.take('1', '/line', {'y': ''}, 0.0)
    assert reason(locks, 'y', SILENT) == ''
    assert '/line, which knows what it requires, has been silent for 2.1 s' in reason(
        locks, 'y', SILENT + 0.1
    )
    assert reason(locks, 'x', SILENT + 0.1) == ''
    locks.take('2', '/line', {'y': ''}, 9.0)  # it was started again
    assert reason(locks, 'y', 9.0) == ''


def test_a_coordinator_that_has_ended_locks_no_axis_that_another_one_guards():
    locks = Locks()
    locks.take('1', '/second', {'x': '', 'y': 'cell1/z is not homed'}, 0.0)
    locks.take('2', '/line', {'y': ''}, SILENT + 1.0)
    assert reason(locks, 'y', SILENT + 1.0) == ''
    assert reason(locks, 'x', SILENT + 1.0).startswith('axis x: /second, which knows')
    assert '/second' in reason(locks, 'y', 9.0)  # both are silent


def test_every_living_coordinator_must_agree():
    locks = Locks()
    locks.take('1', '/line', {'y': ''}, 0.0)
    locks.take('2', '/other', {'y': 'no'}, 0.0)
    assert reason(locks, 'y') == 'axis y: no'
    locks.take('3', '/line', {'y': 'also no'}, 0.1)  # two of one name, both alive
    locks.take('2', '/other', {'y': ''}, 0.1)
    assert reason(locks, 'y', 0.1) == 'axis y: also no'


def test_a_coordinator_that_was_restarted_takes_the_place_of_the_old_one_at_once():
    locks = Locks()
    locks.take('1', '/line', {'y': ''}, 0.0)
    locks.take('2', '/line', {'y': ''}, SILENT - 0.01)
    assert reason(locks, 'y', SILENT + 0.2) == ''


def test_a_coordinated_node_waits_for_a_coordinator():
    locks = Locks(coordinated=True)
    assert reason(locks, 'x') == 'axis x: no coordinator is heard (coordinated)'
    locks.take('1', '/line', {}, 0.0)
    assert reason(locks, 'x') == ''
    assert 'no coordinator' in reason(locks, 'x', SILENT + 0.1)


def run(duration, kind='home', home=0.1, fast=0.05):
    return Run(1, 0.0, kind, 'NoError', duration, home=home, fast=fast, slow=0.005)


def test_the_expected_duration_is_the_median_of_the_newest_homings_like_this_one():
    runs = [run(100.0)] * 3 + [run(d) for d in (2.0, 3.0, 9.0, 4.0, 5.0)]
    assert len(runs) > NEWEST
    other = [run(50.0, kind='verify'), run(60.0, home=None), run(70.0, fast=0.1)]
    assert expected_duration(runs + other, 0.05, 0.005) == 4.0
    assert math.isnan(expected_duration(runs, 0.06, 0.005))
    assert longest([1.0, 3.0]) == 3.0
    assert math.isnan(longest([1.0, math.nan]))
