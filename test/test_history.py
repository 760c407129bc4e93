# SPDX-License-Identifier: Apache-2.0
"""What an axis remembers of its runs."""

import statistics

import pytest
from core_rig import TRUE_HOME, rig

from homing_node.core.history import REMEMBERED, History
from homing_node.procedures.states import Error


def test_runs_are_counted_by_how_they_ended():
    history = History()
    for error in (Error.NoError, Error.Canceled, Error.NoError, Error.LSTriggered):
        history.add(error, 0.1)
    assert history.runs == 4
    assert history.homed == 2
    assert history.ended[Error.Canceled] == 1


def test_the_spread_is_that_of_the_homes():
    history = History()
    assert history.range == history.deviation == 0.0
    homes = [0.1, 0.1001, 0.0999]
    for home in homes:
        history.add(Error.NoError, home)
        history.add(Error.Timeout, 5.0)  # no home
    assert history.range == pytest.approx(0.0002)
    assert history.deviation == pytest.approx(statistics.pstdev(homes))
    history.forget_homes()
    assert history.range == 0.0
    assert history.runs == 6


def test_the_memory_is_bounded():
    history = History()
    for i in range(3 * REMEMBERED):
        history.add(Error.NoError, float(i))
    assert len(history.homes) == REMEMBERED
    assert history.range == REMEMBERED - 1


def test_an_axis_remembers_its_runs():
    made = rig('HSHS').rehearsal()
    for _ in range(3):
        made.home(limit=60.0)
    made.axis.set_emergency_stop(True)
    made.home(limit=60.0)  # refused: no run
    assert made.axis.history.runs == made.axis.history.homed == 3
    assert list(made.axis.history.homes) == pytest.approx([TRUE_HOME['HSHS']] * 3, abs=1e-6)
    made.axis.configure(rig('HS').parameters())
    assert made.axis.history.range == 0.0


def test_the_torque_limit_follows_the_search_of_the_mechanical_end():
    made = rig(
        'MechanicalEndDetectionHS',
        mechanical_end_detection_first_torque_limit=40,
        mechanical_end_detection_second_torque_limit=10,
    ).rehearsal()
    assert made.axis.torque_limit == 0.0
    made.axis.home(made.time)
    seen = []
    while made.axis.running:
        made.cycle()
        if not seen or seen[-1] != made.axis.torque_limit:
            seen.append(made.axis.torque_limit)
    assert made.axis.outcome.success
    assert seen == [40.0, 10.0, 0.0]


def test_without_a_second_torque_limit_the_first_one_stays():
    made = rig(
        'MechanicalEndDetection', mechanical_end_detection_first_torque_limit=40
    ).rehearsal()
    made.axis.home(made.time)
    seen = set()
    while made.axis.running:
        seen.add(made.axis.torque_limit)
        made.cycle()
    assert seen == {40.0}
    assert made.axis.torque_limit == 0.0
