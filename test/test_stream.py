# SPDX-License-Identifier: Apache-2.0
"""What a controller makes of the announced plan, whatever the rates and the arrival."""

from itertools import pairwise, product

import pytest
from core_rig import thinned

from homing_node.core.phase import Dynamics
from homing_node.plant.controller import RECOMMENDED, JtcParameters
from homing_node.rehearsal.stream import COURSES, DURATION, FAST, JERK, Stream, run, worst

STEADY, _ = COURSES['constant speed, then a stop']


def assert_as_planned(found, step, acceleration=0.5):
    seen = worst(found, step)
    assert seen.velocity_error <= 0.01 * FAST.velocity
    assert seen.acceleration <= 1.05 * acceleration
    assert seen.jerk <= 1.05 * JERK


@pytest.mark.parametrize('course', COURSES)
@pytest.mark.parametrize('jitter', [0.0, 0.0003, 0.0015])
@pytest.mark.parametrize(
    ('node', 'controller'), thinned(product([250, 500, 1000], [100, 250, 500, 1000]), 3)
)
def test_the_drive_gets_what_was_planned(node, controller, jitter, course):
    how = Stream(node, controller, jitter, phase=0.37, seed=node + controller)
    orders, hardest = COURSES[course]
    found, _ = run(how, orders, JERK, DURATION)
    assert_as_planned(found, 1.0 / controller, hardest)


@pytest.mark.parametrize('controller', [250, 1000])
def test_one_message_in_ten_is_lost(controller):
    how = Stream(250, controller, 0.0003, lost=0.1, phase=0.4)
    for orders, _ in COURSES.values():
        found, _ = run(how, orders, JERK, DURATION)
        assert worst(found, 1.0 / controller).velocity_error <= 0.01 * FAST.velocity


def test_one_point_a_message_is_not_smooth():
    """What the announcement is for, and that these tests see it."""
    accepting = RECOMMENDED._replace(allow_nonzero_velocity_at_trajectory_end=True)
    how = Stream(250, 1000, 0.0003, one_point=True, lead=0.0, parameters=accepting)
    found, _ = run(how, STEADY, JERK, DURATION)
    off, hardest, jerk = worst(found, 0.001)
    assert off > 0.3 * FAST.velocity
    assert hardest > 10 * 0.5
    assert jerk > 100 * JERK


@pytest.mark.parametrize('controller', [100, 1000])
@pytest.mark.parametrize('speed', [0.05, 0.5])
def test_the_controller_stops_by_itself_when_messages_cease(controller, speed):
    pace = Dynamics(speed, 2.0, 2.0)
    end = 0.6
    how = Stream(250, controller, 0.0003, end=end)
    found, _ = run(how, [(0.01, lambda p: p.seek(speed, pace))], JERK, 1.5)
    after = [one.command for one in found if one.time >= end]
    assert found[-1].command[1:] == (0.0, 0.0)
    # The stop: v^2 / 2a, and half of v a / j for the jerk; the last message is a period old.
    most = speed * how.horizon + speed**2 / (2 * 2.0) + speed * 2.0 / (2 * JERK)
    assert after[-1][0] - after[0][0] <= most + 1e-6
    _, hardest, jerk = worst(found, 1.0 / controller)
    assert hardest <= 2.0 * 1.05
    assert jerk <= JERK * 1.05


@pytest.mark.parametrize('stall', [0.015, 0.1, pytest.param(1.0, marks=pytest.mark.long)])
@pytest.mark.parametrize('begin', [0.05, 0.3, 0.45], ids=['speeding up', 'cruising', 'turning'])
@pytest.mark.parametrize('speed', thinned([0.5, 0.05], 2))
def test_a_stalled_node_goes_on_from_where_the_controller_is(stall, begin, speed):
    pace = Dynamics(speed, 2.0, 2.0)
    orders = [
        (0.01, lambda p: p.seek(speed, pace)),
        (0.44, lambda p: p.seek(-speed, pace)),
        (2.2, lambda p: p.move(0.0, pace)),
    ]
    how = Stream(250, 1000, 0.0003, stall=begin, resume=begin + stall, phase=0.4)
    found, _ = run(how, orders, JERK, 6.0)
    _, hardest, jerk = worst(found, 0.001)
    assert hardest <= 2.0 * 1.05
    assert jerk <= JERK * 1.05
    assert found[-1].command == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('seed', range(5))
def test_a_stall_while_messages_are_lost_makes_no_step(seed):
    """The velocity may be off by a little, where the plan of a lost message was needed."""
    speed, pace = 0.5, Dynamics(0.5, 2.0, 2.0)
    how = Stream(250, 1000, 0.0003, lost=0.1, stall=0.4, resume=0.5, phase=0.4, seed=seed)
    found, _ = run(how, [(0.01, lambda p: p.seek(speed, pace))], JERK, 1.5)
    positions = [one.command[0] for one in found]
    velocities = [(b - a) / 0.001 for a, b in pairwise(positions)]
    assert min(velocities) >= 0.0
    assert max(velocities) <= 1.01 * speed
    assert max(abs(b - a) for a, b in pairwise(velocities)) <= 0.001 * 2.1 + 0.01 * speed


def test_a_search_never_goes_back_after_a_stall():
    how = Stream(250, 1000, stall=0.3, resume=0.4)
    found, _ = run(how, [(0.01, lambda p: p.seek(0.05, FAST))], JERK, 0.8)
    positions = [one.command[0] for one in found]
    assert all(later >= earlier for earlier, later in pairwise(positions))
    assert found[-1].command[1] == pytest.approx(0.05)


def test_without_a_stamp_it_is_smooth_while_messages_come_in_time():
    how = Stream(250, 1000, 0.0, phase=0.0, stamped=False)
    for orders, hardest in COURSES.values():
        found, _ = run(how, orders, JERK, DURATION)
        assert worst(found, 0.001).acceleration <= 1.05 * hardest


def test_the_default_parameters_of_a_controller_refuse_nothing_but_partial_joints():
    how = Stream(250, 500, 0.0003, parameters=JtcParameters(), phase=0.3)
    found, _ = run(how, STEADY, JERK, DURATION)
    assert_as_planned(found[11:], 0.002)


@pytest.mark.parametrize(('node', 'points'), [(250, 11), (500, 15), (1000, 25)])
def test_a_message_is_short(node, points):
    for orders, _ in COURSES.values():
        _, most = run(Stream(node, 1000), orders, JERK, DURATION)
        assert most <= points
