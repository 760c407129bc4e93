# SPDX-License-Identifier: Apache-2.0
"""Inputs as real machines give them: polled, of another clock, moved by others, wrapped."""

import math

import pytest
from core_rig import DIRECTIONS, END, HOME, TRUE_HOME, assert_homed, error_of, home_of, rig

from homing_node.core.signals import FINEST
from homing_node.procedures.states import Error, FeedbackClock
from homing_node.rehearsal.link import Transport

BOTH_WAYS = pytest.mark.parametrize('direction', DIRECTIONS, ids=['positive', 'negative'])
SLOWLY = {'homing_velocity_fast': 0.05, 'homing_velocity_slow': 0.05}

# -- a switch that is polled --------------------------------------------------------------------


@BOTH_WAYS
@pytest.mark.parametrize('seed', range(6))
def test_two_passes_over_a_switch_that_is_polled_at_50_hz(direction, seed):
    one = rig('HSHS', homing_velocity_fast=0.1, homing_velocity_slow=0.01)
    course = one.but(Transport(poll_rate=50.0, seed=seed)).home(direction)
    assert_homed(course, TRUE_HOME['HSHS'], direction)
    assert course.outcome.uncertainty == pytest.approx(0.01 * (0.01 + 0.002), rel=0.1)


@BOTH_WAYS
@pytest.mark.parametrize('seed', range(6))
def test_a_switch_that_is_polled_at_5_hz_is_told(direction, seed):
    one = rig('HS', **SLOWLY).but(Transport(poll_rate=5.0, seed=seed))
    one = one.switched(home_switch=HOME._replace(on_to=0.085))
    course = one.home(direction, start=0.03)
    assert_homed(course, TRUE_HOME['HS'], direction)
    assert course.outcome.uncertainty == pytest.approx(0.05 * (0.1 + 0.002), rel=0.1)
    (warning,) = course.outcome.warnings
    assert 'home switch is read about 5 times a second' in warning
    assert 'at 0.05 m/s' in warning
    assert 'at 0.005 m/s it would be known 10 times better' in warning


def test_the_stamp_error_that_the_user_gives_is_never_capped():
    outcome = rig('HS', **SLOWLY, switch_stamp_error=0.2).home(start=0.03).outcome
    assert outcome.uncertainty >= 0.05 * 0.2


@pytest.mark.parametrize('heartbeat', [0.1, 0.5])
def test_a_heartbeat_is_not_taken_for_polling(heartbeat):
    """At least the second pass is as exact as without it, unless the next repeat was due."""
    exact = 0
    for seed in range(8):
        transport = Transport(heartbeat=heartbeat, seed=seed)
        one = rig('HSHS', **SLOWLY, homing_reverse_distance=0.01).but(transport)
        course = one.home(start=0.03)
        assert_homed(course, TRUE_HOME['HSHS'])
        exact += course.outcome.uncertainty < 0.05 * 0.003
    assert exact >= 5


# -- feedback of another clock, or read rarely --------------------------------------------------


@BOTH_WAYS
def test_a_header_that_is_behind_is_covered_and_told(direction):
    one = rig('HS', **SLOWLY).but(Transport(header_offset=-0.1))
    course = one.home(direction, start=0.03)
    assert_homed(course, TRUE_HOME['HS'], direction)
    assert 0.0005 < course.outcome.uncertainty <= 0.05 * (0.05 + 0.002) * 1.05
    assert any('0.100 s behind' in warning for warning in course.outcome.warnings)


def test_the_user_settles_which_clock_is_right():
    one = rig('HS', **SLOWLY, feedback_clock=FeedbackClock.arrival)
    course = one.but(Transport(header_offset=-0.1)).home(start=0.03)
    assert home_of(course) == pytest.approx(TRUE_HOME['HS'], abs=1e-6)
    assert course.outcome.warnings == ()


@BOTH_WAYS
@pytest.mark.parametrize('rate', [20.0, 50.0, 130.0])
def test_a_feedback_that_is_published_faster_than_it_is_read(direction, rate):
    one = rig('HSHS', **SLOWLY).but(Transport(read_rate=rate))
    course = one.home(direction)
    assert_homed(course, TRUE_HOME['HSHS'], direction)
    assert course.outcome.uncertainty <= 0.05 / rate + 0.05 * 0.004  # a reading; the stamps


# -- an axis that moves, or does not ------------------------------------------------------------


def jogged(made, velocity, seconds):
    """Move the axis without the node."""
    start, position = made.time, made.plant.position
    while made.time < start + seconds:
        made.plant.follow(position + velocity * (made.time + made.period - start), made.period)
        made.cycle()


@BOTH_WAYS
def test_an_axis_that_something_else_moves_is_refused(direction):
    made = rig('HS').rehearsal(direction, 0.01)
    jogged(made, direction * 0.1, 0.3)
    refusal = made.axis.home(made.time)
    assert refusal.error is Error.AxisMoving
    assert 'moves at 0.1 m/s' in refusal.message
    for _ in range(60):
        made.cycle()
    assert made.axis.home(made.time) is None


def test_a_feedback_that_jumps_between_two_places_starts_nothing():
    made = rig('HS').rehearsal(1, 0.05)
    for n in range(100):
        made.cycle()
        if n % 12 == 0:
            made.axis.feedback(made.time + 0.0001, 0.0)
    refusal = made.axis.home(made.time)
    assert refusal.error in (Error.AxisMoving, Error.PublisherConflict)


@pytest.mark.parametrize('count', [1e-5, 1e-4])
def test_the_noise_of_a_count_is_no_motion(count):
    made = rig('HS').rehearsal(1, 0.05)
    noise = iter(range(10**6))
    made._send_feedback = lambda time, position: made.axis.feedback(
        time, position + count * (next(noise) * 7 % 3 % 2)
    )
    for _ in range(60):
        made.cycle()
    assert made.axis.home(made.time) is None


@BOTH_WAYS
def test_a_drive_that_lags_is_no_mechanical_end(direction):
    """Its feedback stays further behind than the end's distance, but it moves on."""
    one = rig('MechanicalEndDetection', mechanical_end_detection_pos_diff=0.001).built(lag=0.05)
    course = one.home(direction)
    assert_homed(course, END, direction)
    assert FINEST < course.outcome.uncertainty < 1e-3


# -- open loop ----------------------------------------------------------------------------------


@BOTH_WAYS
def test_open_loop_compares_the_edge_and_the_pulse_in_the_feedback(direction):
    """The command is 3.6 mm ahead of the feedback: beyond the pulse that is 3.3 mm behind."""
    one = rig('HSZPulse', open_loop_homing=True, homing_velocity_slow=0.2, index_margin=0.0)
    course = one.built(lag=0.018).home(direction, start=0.02)
    assert_homed(course, TRUE_HOME['HSZPulse'], direction)
    assert course.outcome.uncertainty > FINEST


def test_open_loop_on_an_edge_counts_the_lag_as_uncertain():
    course = rig('HS', open_loop_homing=True).built(lag=0.018).home(start=0.02)
    assert home_of(course) == pytest.approx(TRUE_HOME['HS'] + 0.2 * 0.018, abs=1e-4)
    assert_homed(course, TRUE_HOME['HS'])


@BOTH_WAYS
@pytest.mark.parametrize('home_type', ['HS', 'HSHS', 'HSReverse', 'HSOffReverse', 'LS'])
def test_open_loop_waits_for_late_feedback_to_know_the_lag(home_type, direction):
    """The command covers an edge before the feedback does, which is 20 ms late."""
    one = rig(home_type, open_loop_homing=True, switch_stamp_error=1e-5, following_error=0.05)
    one = one.but(Transport(feedback_delay=0.02)).built(lag=0.02)
    assert_homed(one.home(direction), TRUE_HOME[home_type], direction)


# -- a joint that is published modulo a turn ----------------------------------------------------

TURN = 2.0 * math.pi


def wrapped(position):
    return (position + math.pi) % TURN - math.pi


def turning(**changes):
    """Return a rotary axis that passes the end of the driver's range on its way to the switch."""
    one = rig('HS', travel=10.0, unit='rad', following_error=0.5, **changes)
    flag = HOME._replace(on_from=3.6, on_to=4.2)
    ends = {
        'positive_limit_switch': HOME._replace(on_from=9.0, on_to=99.0),
        'negative_limit_switch': HOME._replace(on_from=-99.0, on_to=-1.0),
    }
    speeds = {'homing_velocity_fast': 2.0, 'homing_velocity_slow': 0.5}
    one = one.switched(home_switch=flag, **ends).built(hard_stops=(-2.0, 10.0))
    made = one.but(**speeds).rehearsal(1, 2.5)
    made._send_feedback = lambda time, position: made.axis.feedback(time, wrapped(position))
    return made


def test_a_wrapped_joint_homes_and_says_which_turn():
    made = turning(wrap=TURN)
    course = made.home()
    assert home_of(course) == pytest.approx(3.6, abs=1e-4)
    assert made.axis.raw_position == pytest.approx(3.6, abs=1e-3)


def test_wrapped_setpoints_stay_in_the_range_of_the_driver():
    made = turning(wrap=TURN, wrap_setpoints=True)
    sent = []
    follow = made._command

    def command(position):
        sent.append(position)
        follow(position + TURN * round((made.plant.position - position) / TURN))

    made._command = command
    assert home_of(made.home()) == pytest.approx(3.6, abs=1e-4)
    assert min(sent) < -2.0
    assert all(-math.pi <= position < math.pi for position in sent[100:])


def test_a_jump_of_a_turn_ends_the_run_and_names_the_parameter():
    course = turning().home()
    assert error_of(course) is Error.FollowingError
    assert '(wrap)' in course.outcome.message
