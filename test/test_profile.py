# SPDX-License-Identifier: Apache-2.0
"""Setpoints: continuous, within their limits, and ending where they should."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_node.core.phase import Dynamics
from homing_node.core.profile import Profile

PERIOD = 0.004
JERK = 50.0
FAST = Dynamics(0.2, 2.0, 3.0)
SLOW = Dynamics(0.05, 1.0, 4.0)


def profile(position=0.0, jerk=JERK):
    return Profile(PERIOD, jerk, position)


def run(one, cycles=10000):
    """Run until it is done; return every (position, velocity, acceleration)."""
    course = [(one.position, one.velocity, one.acceleration)]
    for _ in range(cycles):
        if one.done:
            break
        one.update()
        course.append((one.position, one.velocity, one.acceleration))
    return course


def cycles(one, count):
    course = [(one.position, one.velocity, one.acceleration)]
    for _ in range(count):
        one.update()
        course.append((one.position, one.velocity, one.acceleration))
    return course


def assert_smooth(course, acceleration, jerk=JERK):
    for (p0, v0, a0), (p1, v1, a1) in pairwise(course):
        assert abs(a1) <= acceleration * (1 + 1e-9)
        assert abs(a1 - a0) <= jerk * PERIOD * (1 + 1e-6) + 1e-9
        assert abs(v1 - v0) <= acceleration * PERIOD * (1 + 1e-6) + 1e-9
        assert abs(p1 - p0) <= max(abs(v0), abs(v1)) * PERIOD + acceleration * PERIOD**2


@pytest.mark.parametrize('sign', [1, -1])
def test_a_search_reaches_its_speed_and_keeps_it(sign):
    one = profile()
    one.seek(sign * 0.2, FAST)
    course = run(one)
    assert_smooth(course, FAST.acceleration)
    assert one.velocity == pytest.approx(sign * 0.2)
    assert {round(v, 9) for _, v, _ in cycles(one, 50)} == {sign * 0.2}


@pytest.mark.parametrize('sign', [1, -1])
def test_it_accelerates_and_decelerates_with_its_own_limits(sign):
    one = profile()
    one.seek(sign * 0.2, FAST)
    speeding = cycles(one, 100)
    one.stop()
    stopping = run(one)
    assert max(abs(a) for _, _, a in speeding) == pytest.approx(FAST.acceleration, rel=1e-6)
    assert max(abs(a) for _, _, a in stopping) == pytest.approx(FAST.deceleration, rel=0.1)
    assert_smooth(stopping, FAST.deceleration)
    assert one.velocity == one.acceleration == 0.0


def test_a_reversal_is_one_trajectory_through_zero():
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    one.seek(-0.2, FAST)
    course = run(one)
    assert_smooth(course, min(FAST.acceleration, FAST.deceleration))
    turning = [a for _, v, a in course if abs(v) < 0.05]
    assert all(a == pytest.approx(-FAST.acceleration) for a in turning)


def test_a_reversal_into_a_gentler_pace_brakes_with_the_old_one():
    gentle = Dynamics(0.05, 0.2, 0.2)
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    one.seek(-0.05, gentle)
    course = run(one)
    assert_smooth([c for c in course if c[1] > 0], min(FAST.acceleration, FAST.deceleration))
    assert_smooth([c for c in course if c[1] < 0][1:], gentle.acceleration)
    assert one.velocity == pytest.approx(-0.05)
    assert one.dynamics == gentle


def test_slowing_down_uses_the_pace_that_is_left():
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    one.seek(0.05, SLOW)
    course = run(one)
    assert min(a for _, _, a in course) >= -FAST.deceleration * (1 + 1e-9)
    assert min(a for _, _, a in course) == pytest.approx(-FAST.deceleration, rel=0.15)
    assert one.velocity == pytest.approx(0.05)
    assert one.dynamics == SLOW


def test_while_it_slows_down_the_pace_is_the_one_that_is_left():
    """What a stop would brake with."""
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    one.seek(0.05, SLOW)
    cycles(one, 2)
    assert one.dynamics == FAST


@pytest.mark.parametrize('sign', [1, -1])
def test_a_move_ends_exactly_at_its_target(sign):
    one = profile(0.3)
    one.move(0.3 + sign * 0.1, FAST)
    course = run(one)
    assert_smooth(course, max(FAST.acceleration, FAST.deceleration))
    assert max(abs(v) for _, v, _ in course) <= FAST.velocity * (1 + 1e-9)
    assert one.position == pytest.approx(0.3 + sign * 0.1, abs=1e-12)
    assert one.velocity == 0.0


@pytest.mark.parametrize('sign', [1, -1])
def test_a_move_accelerates_with_one_limit_and_decelerates_with_the_other(sign):
    one = profile()
    one.move(sign * 0.3, FAST)
    accelerations = [sign * a for _, _, a in run(one)]
    assert max(accelerations) == pytest.approx(FAST.acceleration, rel=1e-6)
    assert min(accelerations) == pytest.approx(-FAST.deceleration, rel=0.05)


def test_a_move_to_where_it_rests_is_done():
    one = profile(0.3)
    one.move(0.3, FAST)
    assert one.done


def test_a_move_to_where_it_passes_is_not_done():
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    target = one.position
    one.move(target, FAST)
    assert not one.done
    run(one)
    assert (one.position, one.velocity) == (target, 0.0)


@pytest.mark.parametrize('sign', [1, -1])
def test_a_move_during_a_reversal_is_the_last_that_it_does(sign):
    """The pace that was to take over at rest does not."""
    one = profile()
    one.seek(sign * 0.2, FAST)
    run(one)
    one.seek(-sign * 0.05, Dynamics(0.05, 0.2, 0.2))
    cycles(one, 2)
    one.move(sign * 0.3, FAST)
    run(one)
    assert (one.position, one.velocity) == (sign * 0.3, 0.0)


def test_a_stop_at_rest_is_done():
    one = profile()
    one.stop()
    assert one.done


def test_freezing_stops_at_once():
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    position = one.position
    one.freeze()
    assert one.done
    assert cycles(one, 3)[-1] == (position, 0.0, 0.0)


@given(st.integers(0, 200), st.floats(0.5, 20.0))
def test_a_stop_ends_where_it_was_foretold(ran, deceleration):
    one = profile()
    one.seek(0.2, FAST)
    cycles(one, ran)
    expected = one.stopping_position(deceleration)
    one.stop(deceleration)
    run(one)
    assert one.position == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize('then', [FAST, Dynamics(0.05, 0.2, 0.2)], ids=['same', 'gentler'])
def test_braking_harder_keeps_the_reversal(then):
    """Also where the reversal passes through rest, into a pace that accelerates more gently."""
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    one.seek(-then.velocity, then)
    cycles(one, 2)
    one.brake_harder(10.0)
    course = run(one)
    assert min(a for _, v, a in course if v > 0.0) < -FAST.deceleration
    assert one.velocity == pytest.approx(-then.velocity)


def test_braking_harder_keeps_a_stop():
    one = profile()
    one.seek(0.2, FAST)
    run(one)
    one.stop()
    cycles(one, 2)
    one.brake_harder(10.0)
    course = run(one)
    assert one.velocity == 0.0
    assert min(a for _, _, a in course) < -FAST.deceleration


def test_braking_harder_is_never_softer():
    soft, hard = profile(), profile()
    for one in (soft, hard):
        one.seek(0.2, FAST)
        run(one)
        one.stop()
    soft.brake_harder(0.1)
    assert len(run(soft)) <= len(run(hard)) + 1


DYNAMICS = st.builds(Dynamics, st.floats(0.005, 0.5), st.floats(0.05, 20.0), st.floats(0.05, 20.0))
ORDERS = st.one_of(
    st.tuples(st.just('seek'), DYNAMICS, st.sampled_from([1, -1])),
    st.tuples(st.just('move'), DYNAMICS, st.floats(-0.2, 0.2)),
    st.tuples(st.just('stop'), st.floats(0.05, 20.0)),
    st.tuples(st.just('brake_harder'), st.floats(0.05, 20.0)),
)


@given(
    st.lists(st.tuples(ORDERS, st.integers(0, 60)), min_size=1, max_size=6), st.floats(1.0, 1000.0)
)
def test_any_orders_give_smooth_setpoints_and_a_stop(orders, jerk):
    one = profile(jerk=jerk)
    course, hardest = [(0.0, 0.0, 0.0)], 0.0
    for (verb, *args), count in orders:
        if verb == 'seek':
            pace, sign = args
            one.seek(sign * pace.velocity, pace)
            hardest = max(hardest, pace.acceleration, pace.deceleration)
        elif verb == 'move':
            one.move(args[1], args[0])
            hardest = max(hardest, args[0].acceleration, args[0].deceleration)
        else:
            getattr(one, verb)(*args)
            hardest = max(hardest, args[0])
        hardest = max(hardest, one.dynamics.acceleration, one.dynamics.deceleration)
        course += cycles(one, count)[1:]
    one.stop(1.0)
    course += run(one)[1:]
    assert one.done
    assert one.velocity == one.acceleration == 0.0
    assert_smooth(course, max(hardest, 1.0), jerk)


@pytest.mark.parametrize('sign', [1, -1])
@pytest.mark.parametrize(
    'distance',
    [
        2 * 5**3 / 500**2,  # the acceleration is just reached
        0.2**2 / 5 + 0.2 * 5 / 500,  # the velocity is just reached
    ],
)
def test_moves_where_the_cases_of_a_trajectory_meet(distance, sign):
    one = profile(0.0743, jerk=500.0)
    one.move(0.0743 + sign * distance, Dynamics(0.2, 5.0, 5.0))
    run(one)
    assert one.position == pytest.approx(0.0743 + sign * distance, abs=1e-12)


ROUND = st.sampled_from([0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0])


@given(
    ROUND,
    ROUND,
    ROUND,
    st.sampled_from([10.0, 50.0, 100.0, 500.0]),
    ROUND,
    st.sampled_from([1, -1]),
)
def test_moves_with_round_numbers(velocity, acceleration, deceleration, jerk, distance, sign):
    """What people write; where ruckig's special cases are met exactly."""
    one = profile(jerk=jerk)
    one.move(sign * distance / 100, Dynamics(velocity, acceleration, deceleration))
    run(one, 200_000)
    assert one.position == sign * distance / 100
    assert one.velocity == 0.0
