# SPDX-License-Identifier: Apache-2.0
"""The points that tell a controller what comes: true to the plan, few, and at rest in the end."""

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.core.announcement import NS, Announcer, Course, announcement, least_horizon
from homing_node.core.path import state_at
from homing_node.core.phase import Dynamics
from homing_node.core.profile import Profile
from homing_node.plant.controller import Point, between

PERIOD, LEAD, HORIZON = 0.004, 0.008, 0.02
FAST = Dynamics(0.05, 0.5, 0.5)


def profile(cycles=0, jerk=10.0, order=lambda p: p.seek(0.05, FAST)):
    one = Profile(PERIOD, jerk, 0.3, LEAD)
    order(one)
    for _ in range(cycles + 1):
        one.update()
    return one


def told(*profiles, horizon=HORIZON, sign=1.0):
    """Return the courses of some profiles, and the times and the states of their points."""
    courses = [Course(*one.announce(horizon), sign) for one in profiles]
    times, rows = announcement(courses, PERIOD, horizon)
    return courses, (times, [list(zip(*row, strict=True)) for row in rows])


def test_the_points_stand_at_the_period_from_the_present():
    _, (times, _) = told(profile(100))
    assert times[:6] == [round(k * PERIOD * NS) for k in range(6)]


def test_the_present_is_the_command_of_the_cycle_and_the_newest_lies_ahead():
    one = profile(100)
    _, (times, rows) = told(one)
    newest = times.index(round((PERIOD + LEAD) * NS))
    assert rows[newest][0] == pytest.approx((one.position, one.velocity, one.acceleration))


def test_no_point_lies_before_the_run_begins():
    """The controller joins what it held to the first point."""
    _, (times, rows) = told(profile())
    assert times[0] == round(LEAD * NS)
    assert rows[0][0] == (0.3, 0.0, 0.0)


def test_an_axis_that_joins_another_rests_until_it_moves():
    _, (times, rows) = told(profile(100), profile())
    assert times[0] == 0
    assert rows[0][1] == rows[2][1] == (0.3, 0.0, 0.0)


def test_the_sign_turns_everything():
    one = profile(20)
    _, (_, rows) = told(one)
    _, (_, mirrored) = told(one, sign=-1.0)
    assert mirrored == [[(-p, -v, -a) for p, v, a in row] for row in rows]


ORDERS = st.one_of(
    st.builds(
        lambda v, s: lambda p: p.seek(s * v, FAST._replace(velocity=v)),
        st.floats(0.001, 0.5),
        st.sampled_from([1, -1]),
    ),
    st.builds(lambda d: lambda p: p.move(0.3 + d, FAST), st.floats(-0.1, 0.1)),
    st.just(lambda p: p.stop()),
    st.builds(lambda a: lambda p: p.stop(a), st.floats(0.1, 5.0)),
    st.just(lambda p: p.brake_harder(2.0)),
)


@given(
    st.lists(st.tuples(ORDERS, st.integers(1, 60)), min_size=1, max_size=4),
    st.floats(1.0, 500.0),
    st.sampled_from([0.02, 0.05]),
)
def test_quintics_through_the_points_are_the_path(orders, jerk, horizon):
    """Within 1 % of the limits and 1 µm; the last point is at rest."""
    one = Profile(PERIOD, jerk, 0.3, LEAD)
    for order, cycles in orders:
        order(one)
        for _ in range(cycles):
            one.update()
    (course,), (times, rows) = told(one, horizon=horizon)
    assert all(later > earlier for earlier, later in pairwise(times))
    assert rows[-1][0][1:] == (0.0, 0.0)
    points = [Point(t, *((x,) for x in row[0])) for t, row in zip(times, rows, strict=True)]
    for a, b in pairwise(points):
        for part in (0.25, 0.5, 0.75):
            time = a.time + round((b.time - a.time) * part)
            sampled = between(a.time, a, b.time, b, time)
            p, v, acc = state_at(course.path, course.present + time / NS)
            assert abs(sampled.positions[0] - p) <= 1e-6
            assert abs(sampled.velocities[0] - v) <= 1e-4
            assert abs(sampled.accelerations[0] - acc) <= max(jerk * 4e-5, 0.005)


def test_the_stop_brakes_with_the_deceleration_in_use():
    _, (times, rows) = told(profile(200, order=lambda p: p.seek(0.5, Dynamics(0.5, 2.0, 1.0))))
    hardest = min(row[0][2] for row in rows)
    assert hardest == pytest.approx(-1.0)
    assert (times[-1] / NS - HORIZON) == pytest.approx(0.5 / 1.0 + 1.0 / 10.0)


def test_a_stop_that_is_under_way_is_the_stop():
    one = profile(100)
    one.stop(5.0)
    one.update()
    _course, (_, rows) = told(one)
    assert rows[-1][0][0] == pytest.approx(one.stopping_position(5.0))


def test_the_stop_of_a_steady_speed_is_computed_once():
    one = profile(100)
    told(one)
    tail = one._tail
    one.update()
    told(one)
    assert one._tail is tail


@given(st.integers(1, 100), st.integers(1, 4))
def test_a_later_plan_leaves_the_announced_one_slowly(cycles, later):
    """By no more than j d^3 / 3, d from the newest command on."""
    one = profile(cycles)
    (course,), (times, _) = told(one)
    newest = LEAD + PERIOD
    one.seek(-0.05, FAST)
    for _ in range(later):
        one.update()
    (other,), _ = told(one)
    for time in times:
        d = time / NS - newest
        if not later * PERIOD <= time / NS <= HORIZON:
            continue
        before = state_at(course.path, course.present + time / NS)[0]
        after = state_at(other.path, other.present + time / NS - later * PERIOD)[0]
        assert abs(after - before) <= 10.0 * max(d, 0.0) ** 3 / 3.0 + 1e-12


@pytest.mark.parametrize('elapsed', [0.004, 0.011, 0.05, 1.0])
def test_after_missed_cycles_the_command_is_what_the_controller_has_come_to(elapsed):
    one = profile(100)
    (course,), _ = told(one)
    time = course.present + PERIOD + LEAD + elapsed
    one.skip(elapsed)
    assert (one.position, one.velocity, one.acceleration) == pytest.approx(
        state_at(course.path, time)
    )
    for _ in range(200):
        one.update()
    assert one.velocity == pytest.approx(0.05)


LATE_ORDERS = {
    'cancel': (lambda p: p.stop(), 0.0),
    'limit': (lambda p: p.brake_harder(2.0), 0.05),
    'turn, then stop': (lambda p: (p.seek(-0.05, FAST), p.stop(1.0)), 0.0),
    'move': (lambda p: p.move(0.2, FAST), 0.0),
}


@pytest.mark.parametrize('elapsed', [0.004, 0.05, 1.0])
@pytest.mark.parametrize(('order', 'velocity'), LATE_ORDERS.values(), ids=LATE_ORDERS)
def test_an_order_before_missed_cycles_acts_after_them(order, velocity, elapsed):
    """A service has stopped the axis, say, and the next cycle comes late."""
    one = profile(100)
    (course,), _ = told(one)
    order(one)
    time = course.present + PERIOD + LEAD + elapsed
    one.skip(elapsed)
    before = one.position, one.velocity, one.acceleration
    assert before == pytest.approx(state_at(course.path, time))
    for _ in range(2000):
        one.update()
        assert abs(one.acceleration - before[2]) <= 10.0 * PERIOD * 1.001
        assert abs(one.velocity - before[1]) <= 2.0 * PERIOD * 1.001
        before = one.position, one.velocity, one.acceleration
    assert one.velocity == pytest.approx(velocity)


def test_an_order_of_an_earlier_cycle_is_not_repeated():
    one = profile(100)
    one.stop()
    one.update()
    told(one)
    one.seek(-0.05, FAST)
    one.update()
    told(one)
    one.skip(0.004)
    assert one.velocity < 0.05
    for _ in range(100):
        one.update()
    assert one.velocity == pytest.approx(-0.05)


def test_a_plan_that_was_not_announced_waits():
    one = profile(100)
    position = one.position
    one.skip(1.0)
    assert one.position == position


@pytest.mark.parametrize(
    ('order', 'velocity'),
    [
        (lambda p: p.seek(0.05, FAST), 0.05),
        (lambda p: p.move(0.4, FAST), 0.0),
        (lambda p: p.seek(-0.05, FAST), -0.05),
    ],
    ids=['search', 'move', 'turning'],
)
def test_after_a_pause_single_setpoints_begin_from_rest(order, velocity):
    """The axis has stood still; to go on at full speed would be a step of its velocity."""
    one = Profile(PERIOD, 10.0, 0.3)
    one.seek(0.05, FAST)
    for _ in range(60):
        one.update()
    order(one)
    one.update()
    position = one.position
    assert one.velocity > 0.04
    one.skip(0.1)
    assert (one.position, one.velocity, one.acceleration) == (position, 0.0, 0.0)
    before = one.acceleration
    for _ in range(800):
        one.update()
        assert abs(one.acceleration - before) <= 10.0 * PERIOD * 1.001
        before = one.acceleration
    assert one.velocity == pytest.approx(velocity, abs=1e-9)
    if not velocity:
        assert one.position == pytest.approx(0.4)


def test_after_a_pause_a_stop_of_single_setpoints_is_over():
    one = Profile(PERIOD, 10.0, 0.3)
    one.seek(0.05, FAST)
    for _ in range(60):
        one.update()
    one.stop()
    one.update()
    position = one.position
    one.skip(0.1)
    one.update()
    assert (one.position, one.velocity, one.done) == (position, 0.0, True)


@pytest.mark.parametrize('elapsed', [0.004, 0.01])
def test_after_a_late_setpoint_single_setpoints_go_on(elapsed):
    one = Profile(PERIOD, 10.0, 0.3)
    one.seek(0.05, FAST)
    for _ in range(60):
        one.update()
    position = one.position
    one.skip(elapsed)
    assert (one.position, one.velocity) == (position, 0.05)
    one.update()
    assert one.position == pytest.approx(position + 0.05 * PERIOD)


@pytest.mark.parametrize('lead', [0.0, LEAD])
def test_freezing_stops_at_the_present(lead):
    one = Profile(PERIOD, 10.0, 0.3, lead)
    one.seek(0.05, FAST)
    for _ in range(100):
        one.update()
    present = one.position - 0.05 * lead
    assert one.present == pytest.approx(present)
    one.freeze()
    one.update()
    assert one.position == pytest.approx(present)
    _, (_times, rows) = told(one)
    assert all(row[0] == (pytest.approx(present), 0.0, 0.0) for row in rows)


def test_a_stop_can_begin_where_the_axis_is():
    one = profile(100)
    at = one.present - 0.02
    one.stop_from(at, 0.01, 0.5)
    one.update()
    _, (times, rows) = told(one)
    present = times.index(0)
    assert rows[present][0] == (pytest.approx(at), pytest.approx(0.01), pytest.approx(0.0))
    assert rows[-1][0][0] - at == pytest.approx(0.01 * math.sqrt(0.01 / 10.0))
    assert rows[-1][0][1:] == (0.0, 0.0)


def test_the_least_horizon_reaches_two_messages_further():
    assert least_horizon(PERIOD, LEAD) == pytest.approx(LEAD + 3 * PERIOD)


@settings(max_examples=max(1, settings.default.max_examples // 6))
@given(
    st.lists(
        st.tuples(ORDERS, st.integers(0, 40), st.sampled_from([1.0, -1.0]), st.floats(-9.0, 9.0)),
        min_size=1,
        max_size=3,
    )
)
def test_an_announcer_finds_the_points_that_the_plans_have(axes):
    """Each cycle of some axes: while they speed up, keep their velocities, turn and rest."""
    announcer = Announcer(PERIOD, HORIZON)
    profiles = [Profile(PERIOD, 10.0, 0.3, LEAD) for _ in axes]
    for cycle in range(80):
        for one, (order, at, *_) in zip(profiles, axes, strict=True):
            if cycle == at:
                order(one)
            one.update()
        courses = [
            Course(*one.announce(HORIZON), sign, offset)
            for one, (_, _, sign, offset) in zip(profiles, axes, strict=True)
        ]
        times, rows = announcer.points(courses)
        expected_times, expected = announcement(courses, PERIOD, HORIZON)
        assert times == pytest.approx(expected_times, abs=1)  # ns
        assert len(rows) == len(expected)
        for row, right in zip(rows, expected, strict=True):
            for values, those in zip(row, right, strict=True):
                assert list(values) == pytest.approx(
                    list(those), abs=3e-8
                )  # a jerk of 10 for some ns


def test_an_announcer_computes_the_shape_of_a_steady_message_once():
    announcer, one = Announcer(PERIOD, HORIZON), profile(100)
    first = announcer.points([Course(*one.announce(HORIZON))])
    one.update()
    second = announcer.points([Course(*one.announce(HORIZON))])
    assert second.times is first.times
    for a, b in zip(first.rows, second.rows, strict=True):
        assert b.velocities is a.velocities
        assert b.positions[0] - a.positions[0] == pytest.approx(0.05 * PERIOD)


def test_an_announcer_tells_axes_apart_that_move_alike_in_opposite_directions():
    announcer, one = Announcer(PERIOD, HORIZON), profile(100)
    for sign in (1.0, -1.0):
        courses = [Course(*one.announce(HORIZON), sign)]
        _, rows = announcer.points(courses)
        assert [row.velocities[0] for row in rows[:3]] == pytest.approx([sign * 0.05] * 3)


def test_an_axis_that_speeds_up_is_not_steady():
    speeding, steady = (Course(*profile(cycles).announce(HORIZON)) for cycles in (18, 100))
    assert speeding.pieces[-1].time < speeding.present  # one piece covers the horizon
    assert not speeding.steady
    assert steady.steady
