# SPDX-License-Identifier: Apache-2.0
"""One axis: what it refuses, what ends a run, and what it tells."""

import dataclasses
import math
from itertools import pairwise

import pytest
from core_rig import (
    DIRECTIONS,
    HS,
    LIMIT_AHEAD,
    LIMIT_BEHIND,
    TRUE_HOME,
    error_of,
    furthest,
    home_of,
    rig,
)

from homing_node.core.axis import Axis
from homing_node.core.settling import SETTLE_TIMEOUT
from homing_node.parameters.axis import AxisParameters
from homing_node.plant.layout import SwitchLayout
from homing_node.procedures.states import Error, HomeType, Input, State
from homing_node.rehearsal.link import Transport

BOTH_WAYS = pytest.mark.parametrize('direction', DIRECTIONS, ids=['positive', 'negative'])
PERIOD = 0.004


def axis(fed=True, **changes):
    """Return an axis with fresh inputs at time 0."""
    made = Axis('x', rig('HS', **changes).parameters(), PERIOD)
    if fed:
        for switch in (HS, 'positive_limit_switch', LIMIT_BEHIND):
            made.switch(Input(switch), 0.0, False)
        made.feedback(-0.002, 0.05)
        made.feedback(0.0, 0.05)
    return made


def underway(direction=1, home_type='HS', cycles=15, **changes):
    """Return a rehearsal that has been homing for some cycles."""
    made = rig(home_type, **changes).rehearsal(direction, 0.02)
    made.cycle()
    assert made.axis.home(made.time) is None
    for _ in range(cycles):
        made.cycle()
    assert made.axis.running
    return made


def assert_at_rest(made, cycles=50):
    """Assert that nothing moves any more."""
    assert not made.axis.running
    assert made.axis.state is State.Idle
    assert [made.cycle() for _ in range(cycles)] == [None] * cycles


def decelerations(course, before):
    return [abs(s.acceleration) for s in course.samples[before:]]


# -- refusals -----------------------------------------------------------------------------------


def refused(made, now=0.0):
    outcome = made.home(now)
    assert outcome is not None
    assert not outcome.success
    assert outcome.message.startswith('axis x: ')
    assert made.update(now) is None
    return outcome


def test_busy():
    made = underway()
    outcome = made.axis.home(made.time)
    assert outcome.error is Error.Busy
    assert outcome.message == 'axis x: homing is in progress (HSSearch)'
    assert made.finish().outcome.success


def test_emergency_stop_refuses():
    made = axis()
    made.set_emergency_stop(True)
    assert refused(made).error is Error.EmergencyStop
    made.set_emergency_stop(False)
    assert made.update(0.0) is None
    assert made.home(0.0) is None


def test_servo_off_refuses():
    made = axis()
    made.set_servo(False)
    assert refused(made).error is Error.ServoOff
    made.set_servo(True)
    assert made.home(0.0) is None


def test_bad_parameters_refuse():
    made = axis()
    made.configure(dataclasses.replace(made.parameters, homing_velocity_slow=1.0))
    outcome = refused(made)
    assert outcome.error is Error.InvalidParameter
    assert 'homing_velocity_slow: 1 m/s' in outcome.message


def test_feedback_is_needed():
    made = axis(fed=False)
    outcome = refused(made)
    assert outcome.error is Error.FeedbackStale
    assert "no feedback yet for joint 'x'" in outcome.message


def test_feedback_must_be_fresh():
    outcome = refused(axis(), now=0.25)
    assert outcome.error is Error.FeedbackStale
    assert outcome.message == (
        'axis x: the feedback is 0.250 s old, more than 0.2 s (feedback_timeout)'
    )


def test_an_age_counts_from_the_arrival():
    """A message may be long on its way: here 0.15 s."""
    made = axis(switch_timeout=0.1)
    for switch in (HS, LIMIT_AHEAD, LIMIT_BEHIND):
        made.switch(Input(switch), 0.05, False, arrival=0.2)
    made.feedback(0.05, 0.05, arrival=0.2)
    assert made.home(0.28) is None


def test_every_wired_level_must_be_known():
    made = axis(fed=False)
    made.feedback(0.0, 0.05)
    made.switch(Input.HOME_SWITCH, 0.0, False)
    outcome = refused(made)
    assert outcome.error is Error.SwitchUnknown
    assert 'positive_limit_switch' in outcome.message
    assert 'negative_limit_switch' in outcome.message
    assert 'home_switch' not in outcome.message


def test_a_periodic_switch_must_be_fresh():
    made = axis(switch_timeout=0.1)
    assert refused(made, now=0.15).error is Error.SwitchStale


def test_the_drives_servo_must_be_known_and_on():
    made = axis()
    wired = [*made.parameters.switches, Input.SERVO_ENABLED]
    made.configure(dataclasses.replace(made.parameters, switches=tuple(wired)))
    assert refused(made).error is Error.SwitchUnknown
    made.enable(False)
    assert refused(made).error is Error.ServoOff
    made.enable(True)
    assert made.home(0.0) is None


def test_an_input_that_is_not_wired_is_ignored():
    made = axis()
    made.switch(Input.NEAR_POSITIVE_LIMIT_SWITCH, 0.0, True)
    made.latch(Input.Z_PULSE, 0.05)
    made.enable(False)
    assert made.home(0.0) is None
    made.latch(Input.Z_PULSE, 0.05)
    made.switch(Input.EXTERNAL_POSITIVE_LIMIT_SWITCH, 0.0, True)
    assert made.running


# -- cancel -------------------------------------------------------------------------------------


@BOTH_WAYS
def test_cancel_stops_with_the_active_profile(direction):
    made = underway(direction, homing_velocity_fast_dec=3)
    before = len(made.course.samples)
    made.axis.cancel()
    assert made.axis.state is State.Cancel
    assert made.axis.error is Error.Canceled
    course = made.finish()
    assert error_of(course) is Error.Canceled
    assert course.outcome.message == 'axis x: canceled in HSSearch'
    assert max(decelerations(course, before)) == pytest.approx(3.0, rel=0.2)
    assert course.samples[-1].velocity == 0.0
    assert {s.state for s in course.samples[before:]} <= {State.Cancel, State.Idle}
    assert not made.axis.homed
    assert_at_rest(made)


def test_cancel_of_an_idle_axis_does_nothing():
    made = axis()
    made.cancel()
    assert made.outcome.error is Error.NoError
    assert made.home(0.0) is None


def test_cancel_at_once():
    """Before the first setpoint: nothing moves."""
    made = axis()
    made.home(0.0)
    made.cancel()
    assert made.update(0.0) is None
    assert not made.running
    assert made.outcome.error is Error.Canceled


def test_a_second_cancel_changes_nothing():
    made = underway()
    made.axis.cancel()
    made.cycle()
    made.axis.cancel()
    made.axis.stop(Error.CycleLate, 'late')
    assert error_of(made.finish()) is Error.Canceled


def test_cancel_of_a_pause():
    made = underway(pause_mode=True, cycles=1)
    while not made.axis.paused:
        made.cycle()
    made.axis.cancel()
    assert not made.axis.paused
    assert error_of(made.finish()) is Error.Canceled
    assert_at_rest(made)


def test_cancel_while_the_axis_settles():
    made = rig('HS').built(lag=0.05).rehearsal()
    made.axis.home(0.0)
    while not made.axis.machine.finished:
        made.cycle()
    made.axis.cancel()
    assert error_of(made.finish()) is Error.Canceled
    assert not made.axis.homed


@BOTH_WAYS
@pytest.mark.parametrize('lag', [0.0, 0.005, 0.02])
def test_a_stop_has_ended_when_the_axis_rests_not_when_the_command_does(lag, direction):
    made = rig('HS').built(lag=lag).rehearsal(direction, 0.02)
    made.axis.home(made.time)
    for _ in range(20):
        made.cycle()
    made.axis.cancel()
    course = made.finish()
    rest = made.plant.position
    assert_at_rest(made)
    assert made.plant.position == pytest.approx(rest, abs=1e-5)
    assert course.samples[-1].velocity == 0.0


def test_without_feedback_no_stop_waits_for_it():
    made = underway(following_error=1.0)
    made.axis.feedback = lambda *_: None
    course = made.finish()
    assert error_of(course) is Error.FeedbackStale
    resting = [sample for sample in course.samples if sample.velocity == 0.0]
    assert resting[-1].time - resting[0].time < 0.01


def test_a_run_that_fails_tells_its_warnings_too():
    made = underway()
    made.axis.warn('that clock is behind')
    made.axis.stop(Error.CycleLate, 'late')
    assert made.finish().outcome.warnings == ('that clock is behind',)


def test_homing_again_after_a_cancel():
    made = underway()
    made.axis.cancel()
    made.finish()
    assert made.home().outcome.success
    assert made.axis.homed


# -- emergency stop, servo off, faults ----------------------------------------------------------


@BOTH_WAYS
@pytest.mark.parametrize(
    ('stop', 'error'),
    [
        (lambda axis: axis.set_emergency_stop(True), Error.EmergencyStop),
        (lambda axis: axis.stop(Error.CycleLate, 'the cycle was late'), Error.CycleLate),
        (lambda axis: axis.stop(Error.SwitchStale, 'its publisher is gone'), Error.SwitchStale),
    ],
    ids=['emergency stop', 'late cycle', 'publisher gone'],
)
def test_a_fault_stops_with_ls_dec(direction, stop, error):
    made = underway(direction, ls_dec=10)
    before = len(made.course.samples)
    stop(made.axis)
    assert made.axis.state is State.HSSearch
    course = made.finish()
    assert error_of(course) is error
    assert max(decelerations(course, before)) == pytest.approx(10.0, rel=0.2)
    assert not made.axis.homed
    assert_at_rest(made)


def test_after_an_emergency_stop_nothing_moves_by_itself():
    made = underway()
    made.axis.set_emergency_stop(True)
    made.finish()
    made.axis.set_emergency_stop(False)
    assert_at_rest(made)


def test_a_fault_during_a_cancel_brakes_harder():
    made = underway(ls_dec=20, homing_velocity_fast_dec=1)
    made.axis.cancel()
    made.cycle()
    made.axis.set_emergency_stop(True)
    course = made.finish()
    assert error_of(course) is Error.Canceled
    assert max(s.acceleration for s in course.samples) <= 20
    assert min(s.acceleration for s in course.samples) < -8


@BOTH_WAYS
@pytest.mark.parametrize('home_type', ['HSHS', 'LS', 'ZPulse'])
@pytest.mark.parametrize('ls_type', ['Dec', 'ServoOff'])
def test_the_limit_that_a_search_waits_for_acts_on_a_cancel(home_type, ls_type, direction):
    """What would have been the reversal or the reference is a limit for an axis that stops."""
    one = rig(
        home_type,
        ls_type=ls_type,
        homing_velocity_slow=0.2,
        homing_velocity_slow_dec=0.2,
        homing_velocity_fast_dec=0.2,
        multiple_z_pulse=100,
    ).switched(**{LIMIT_AHEAD: SwitchLayout(0.04, 1.0)})
    made = one.rehearsal(direction, 0.01)
    made.axis.home(made.time)
    while made.plant.position * direction < 0.039:
        made.cycle()
    made.axis.cancel()
    course = made.finish()
    assert error_of(course) is Error.Canceled
    assert furthest(course, direction) < 0.04 + 0.006
    assert made.axis.servo_on == (ls_type != 'ServoOff')


def test_a_gentler_fault_does_not_soften_a_cancel():
    made = underway(ls_dec=0.1)
    made.axis.cancel()
    made.axis.set_emergency_stop(True)
    course = made.finish()
    assert course.samples[-1].time - made.course.samples[15].time < 0.3


@pytest.mark.parametrize('drive', [False, True], ids=['ours', "the drive's"])
def test_servo_off_ends_the_setpoints(drive):
    one = rig('HS')
    one = one.but(switches=[*one.values['switches'], 'servo_enabled'])
    made = one.rehearsal(1, 0.02)
    made.axis.enable(True)
    assert made.home().outcome.success
    assert made.axis.home(made.time) is None
    for _ in range(15):
        made.cycle()
    if drive:
        made.axis.enable(False)
    else:
        made.axis.set_servo(False)
    assert made.cycle() is None
    assert not made.axis.running
    assert made.axis.outcome.error is Error.ServoOff
    assert made.axis.servo_on == drive
    assert_at_rest(made)
    assert made.axis.home(made.time).error is Error.ServoOff


def test_after_servo_off_the_command_starts_at_the_feedback():
    """Not where it was when the servo went off: the axis may have been behind it."""
    made = underway(cycles=30)
    lagging = made.plant.position - 0.003
    made.axis.set_servo(False)
    made.cycle()
    made.axis.set_servo(True)
    made._send_feedback = lambda time, position: made.axis.feedback(time, lagging)
    for _ in range(50):  # as long as it takes to know that the axis rests
        made.cycle()
    assert made.axis.home(made.time) is None
    position, _, _ = made.axis.update(made.time)
    assert position == pytest.approx(lagging, abs=1e-4)


def rest_beside(made):
    """Let an axis rest a little beside its last command, as one without power does."""
    beside = made.plant.position + 5e-6
    made._send_feedback = lambda time, position: made.axis.feedback(time, beside)
    made.cycle()
    return beside


@pytest.mark.parametrize('drive', [False, True], ids=['ours', "the drive's"])
def test_after_servo_off_at_rest_the_command_starts_at_the_feedback(drive):
    one = rig('HS')
    made = one.but(switches=[*one.values['switches'], 'servo_enabled']).rehearsal()
    made.axis.enable(True)
    made.home()
    switch_servo = made.axis.enable if drive else made.axis.set_servo
    switch_servo(False)
    switch_servo(True)
    beside = rest_beside(made)
    assert made.axis.hold_position == beside


def test_after_a_limit_has_switched_the_servo_off_the_command_starts_at_the_feedback():
    """Also where the axis was stopped before that."""
    made = (
        rig('ZPulse', ls_type='DecServoOff', homing_velocity_slow=0.2)
        .built(index_pitch=0.0)
        .rehearsal()
    )
    assert error_of(made.home()) is Error.LSTriggered
    made.axis.set_servo(True)
    beside = rest_beside(made)
    assert made.axis.hold_position == beside


@pytest.mark.parametrize('keeps', [False, True])
@pytest.mark.parametrize('drive', [False, True])
def test_homed_and_servo_off(keeps, drive):
    one = rig('HS', clear_home_done_on_servo_off=not keeps)
    one = one.but(switches=[*one.values['switches'], 'servo_enabled'])
    made = one.rehearsal()
    made.axis.enable(True)
    made.home()
    if drive:
        made.axis.enable(False)
    else:
        made.axis.set_servo(False)
    assert made.axis.homed == keeps


# -- feedback -----------------------------------------------------------------------------------


@BOTH_WAYS
def test_lost_feedback_ends_a_run(direction):
    made = underway(direction, following_error=0.1)
    made._send_feedback = lambda time, position: None
    course = made.finish()
    assert error_of(course) is Error.FeedbackStale
    assert 'feedback_timeout' in course.outcome.message
    assert course.samples[-1].velocity == 0.0
    assert not made.axis.homed


@pytest.mark.parametrize('keeps', [False, True])
def test_homed_and_lost_feedback(keeps):
    made = rig('HS', clear_home_done_on_comm_stop=not keeps).rehearsal()
    made.home()
    made._send_feedback = lambda time, position: None
    for _ in range(60):
        made.cycle()
    assert made.axis.homed == keeps


@BOTH_WAYS
def test_frozen_feedback_is_a_following_error(direction):
    made = underway(direction, following_error=0.005)
    frozen = made.plant.position
    made._send_feedback = lambda time, position: made.axis.feedback(time, frozen)
    course = made.finish()
    assert error_of(course) is Error.FollowingError
    assert 'more than 0.005 m (following_error) in HSSearch' in course.outcome.message


def test_the_following_error_is_what_a_drive_can_lag():
    """0.05 s at 0.2 m/s and 1 mm; the message says what a slower drive needs."""
    blocked = rig('HS', following_error=0.0, travel=0.2).built(hard_stops=(-0.05, 0.03))
    message = blocked.home(1, 0.02).outcome.message
    assert 'more than 0.011 m' in message
    assert 'lags by 0.057 s or more at 0.2 m/s needs following_error: 0.023 or more' in message
    slow = rig('HSHS', following_error=0.0).built(lag=0.08)
    assert error_of(slow.home(1, 0.02)) is Error.FollowingError
    assert slow.but(following_error=0.023).home(1, 0.02).outcome.success


@pytest.mark.parametrize('lead', [0.0, 0.008, 0.1])
def test_the_following_error_does_not_count_the_lead(lead):
    """The newest command is ahead of the drive by the lead; the default is for the drive alone."""
    parameters = rig('HS', following_error=0.0, travel=1.0, wrong_direction_distance=0.1)
    axis = Axis('x', parameters.parameters(), PERIOD, lead)
    for switch in axis.parameters.inputs:
        axis.switch(switch, 0.0, False)
    lag, path = round(0.048 / PERIOD), [0.1]
    for cycle in range(60):
        now = cycle * PERIOD
        axis.feedback(now, path[max(0, len(path) - 1 - lag)])
        if cycle == 5:
            assert axis.home(now) is None
        axis.update(now)
        if axis.profile.velocity:
            path.append(axis.profile.present)
    assert axis.running
    assert axis.error is Error.NoError
    assert axis.profile.present - axis.position > 0.0095  # 0.011 is allowed


@BOTH_WAYS
def test_feedback_that_arrives_late_is_no_following_error(direction):
    """On a loaded machine: the axis follows, its messages are late by up to 80 ms."""
    late = Transport(feedback_delay=0.02, jitter=0.06)
    one = rig('HSHS', following_error=0.0).but(late).built(lag=0.02)
    assert one.home(direction).outcome.success


@BOTH_WAYS
def test_the_following_error_counts_the_age_of_a_staircase(direction):
    """A driver that reads the position at 20 Hz: the axis follows, its readings are old."""
    one = rig('HSHS', following_error=0.0).but(Transport(read_rate=20.0)).built(lag=0.02)
    assert one.home(direction).outcome.success


@BOTH_WAYS
def test_an_axis_that_jams_after_its_edge_is_not_homed(direction):
    """The edge is right, but the axis does not come to the place that shall read home."""
    one = rig('HS', home_shift_distance=0.006, following_error=0.02)
    made = one.built(hard_stops=(-0.05, 0.063)).rehearsal(direction)
    course = made.home()
    assert error_of(course) is Error.FollowingError
    assert 'at rest, more than 0.001 m' in course.outcome.message
    assert not made.axis.homed


@BOTH_WAYS
@pytest.mark.parametrize('shift', [0.0, 0.004])
def test_an_axis_that_never_moves_is_not_homed(direction, shift):
    """The drive is off, and somebody closes the home switch by hand."""
    made = rig('HS', following_error=0.02, home_shift_distance=shift).rehearsal(direction, 0.02)
    start = made.plant.position
    made._send_feedback = lambda time, position: made.axis.feedback(time, start)
    made.cycle()
    assert made.axis.home(made.time) is None
    while made.axis.running:
        made.cycle()
        if abs(abs(made.axis.profile.present) - abs(start)) > 0.003:
            made.axis.switch(Input.HOME_SWITCH, made.time, True)
    assert made.axis.error is Error.FollowingError, made.axis.outcome
    assert not made.axis.homed


@BOTH_WAYS
def test_an_inverted_encoder_is_a_wrong_direction(direction):
    made = rig('HS', following_error=0.05).rehearsal(direction, 0.02)
    start = made.plant.position
    made._send_feedback = lambda time, position: made.axis.feedback(time, 2 * start - position)
    course = made.home()
    assert error_of(course) is Error.WrongDirection
    assert 'wrong_direction_distance' in course.outcome.message
    assert abs(course.samples[-1].position - start) < 0.015


@BOTH_WAYS
@pytest.mark.parametrize('lag', [0.01, 0.03])
def test_a_lagging_axis_is_not_a_wrong_direction(direction, lag):
    one = rig('HSHS', wrong_direction_distance=0.0005, following_error=0.05).built(lag=lag)
    assert one.home(direction).outcome.success


def test_a_late_feedback_is_not_a_wrong_direction():
    one = rig('HSHS', wrong_direction_distance=0.0005, following_error=0.05)
    assert one.but(Transport(feedback_delay=0.04)).home().outcome.success


def test_a_stale_switch_ends_a_run():
    made = underway(switch_timeout=0.1)
    course = made.finish()
    assert error_of(course) is Error.SwitchStale
    assert 'switch_timeout' in course.outcome.message


@pytest.mark.parametrize('rate', [50.0, 500.0])
@pytest.mark.parametrize('delay', [0.0, 0.05])
@pytest.mark.parametrize('lag', [0.0, 0.02])
def test_a_run_ends_when_the_feedback_has_settled(rate, delay, lag):
    one = (
        rig('HS', following_error=0.05)
        .built(lag=lag)
        .but(Transport(feedback_rate=rate, feedback_delay=delay))
    )
    made = one.rehearsal()
    course = made.home()
    assert course.outcome.success
    assert abs(made.plant.position - course.samples[-1].position) < 1e-5
    rest = [s for s in course.samples if s.velocity == 0.0 and s.state == State.HomeShift]
    assert len(rest) * PERIOD < SETTLE_TIMEOUT


@BOTH_WAYS
def test_every_run_waits_until_the_feedback_has_settled(direction):
    made = (
        rig('HS', homing_reverse_distance=0.045, homing_velocity_fast=0.1)
        .built(lag=0.02)
        .rehearsal(direction)
    )
    for _ in range(2):
        course = made.home()
        assert abs(made.plant.position - course.samples[-1].position) < 1e-5


def test_settling_takes_half_a_second_at_most():
    made = rig('HS').rehearsal()
    noise = iter(range(10**6))
    made._send_feedback = lambda time, position: made.axis.feedback(
        time, position + 1e-5 * (next(noise) % 2)
    )
    course = made.home()
    assert course.outcome.success
    rest = [s for s in course.samples[-200:] if s.velocity == 0.0 and s.state == State.HomeShift]
    assert len(rest) * PERIOD == pytest.approx(SETTLE_TIMEOUT, abs=0.05)


@BOTH_WAYS
@pytest.mark.parametrize('home_type', ['HS', 'HSOff', 'HSHS', 'LS', 'HSReverseZPulse'])
def test_noise_and_a_coarse_encoder(home_type, direction):
    """Counts of 0.1 mm and a noise of one of them: equal neighbours, steps the wrong way."""
    made = rig(home_type, edge_tolerance=0.002).rehearsal(direction)
    steps = iter(range(10**6))

    def coarse(time, position):
        noise = (0, 1, 0, 0, -1, 0, 1)[next(steps) % 7]
        made.axis.feedback(time, (round(position / 1e-4) + noise) * 1e-4)

    made._send_feedback = coarse
    found = home_of(made.home(), direction)
    assert found == pytest.approx(TRUE_HOME[home_type], abs=4e-4)


# -- setpoints ----------------------------------------------------------------------------------


def test_no_setpoint_without_a_run():
    made = axis()
    assert [made.update(i * PERIOD) for i in range(10)] == [None] * 10


def test_the_first_setpoint_is_where_the_axis_is():
    made = axis()
    made.home(0.0)
    position, _, _ = made.update(0.0)
    assert abs(position - 0.05) < 1e-4


def test_the_next_run_begins_at_the_last_command():
    """The axis rests a little beside it: no step."""
    made = rig('HS').rehearsal()
    last = made.home().samples[-1].position
    rest_beside(made)
    assert made.axis.hold_position == last


def test_the_current_position_is_not_the_last_command():
    """It is where the axis rests; nor does a run without a motion send what one before it did."""
    made = rig('HS').rehearsal()
    made.home()
    made.axis.configure(rig('CurrentPos').parameters())
    beside = rest_beside(made)
    assert made.axis.hold_position == beside
    course = made.home()
    assert home_of(course) == beside
    assert course.samples == []


def test_an_axis_that_was_moved_begins_where_it_is():
    made = rig('HS').rehearsal()
    made.home()
    made._send_feedback = lambda time, position: made.axis.feedback(time, 0.03)
    made.cycle()
    assert made.axis.hold_position == 0.03


def test_an_axis_that_did_not_follow_begins_where_it_is():
    made = underway(following_error=0.005)
    frozen = made.plant.position
    made._send_feedback = lambda time, position: made.axis.feedback(time, frozen)
    made.finish()
    assert made.axis.hold_position == frozen


@BOTH_WAYS
def test_a_late_cycle_delays_the_motion(direction):
    """Time passes without cycles; the next setpoint is one period further, no more."""
    made = underway(direction)
    before, _, _ = made.cycle()
    late = made.time + 0.05
    made.axis.feedback(late, before)
    position, _, _ = made.axis.update(late)
    assert abs(position - before) <= 0.2 * PERIOD * 1.001


# -- homed --------------------------------------------------------------------------------------


@BOTH_WAYS
def test_homed_coordinates(direction):
    made = rig('HS', home_position=2.5).rehearsal(direction)
    assert made.axis.position == made.axis.raw_position == direction * 0.05
    made.home()
    assert made.axis.homed
    assert made.axis.position == pytest.approx(2.5, abs=1e-6)
    assert made.axis.raw_position == pytest.approx(direction * 0.06, abs=1e-6)


def test_homed_ends_with_the_next_start():
    made = rig('HS').rehearsal()
    made.home()
    made.axis.home(made.time)
    assert not made.axis.homed
    assert made.axis.error is Error.NoError
    made.axis.cancel()
    made.finish()
    assert not made.axis.homed
    assert made.axis.error is Error.Canceled
    assert made.axis.message == made.axis.outcome.message


@BOTH_WAYS
def test_the_captured_edge_is_told_as_soon_as_it_is_taken(direction):
    made = rig('HS').rehearsal(direction)
    made.axis.home(made.time)
    while made.axis.state is not State.HomeShift:
        assert made.axis.home_position_raw == 0.0
        made.cycle()
    assert not made.axis.homed
    assert made.axis.home_position_raw == pytest.approx(0.06 * direction, abs=1e-3)
    made.finish()
    assert made.axis.home_position_raw == made.axis.outcome.home_position_raw


def test_a_refused_request_leaves_the_home():
    made = rig('HS').rehearsal()
    made.home()
    made.axis.set_emergency_stop(True)
    assert made.axis.home(made.time).error is Error.EmergencyStop
    assert made.axis.homed


def test_bounces_from_before_a_run_are_not_told():
    made = rig('HS', switch_debounce=0.002).rehearsal()
    for i in range(30):
        made.axis.switch(Input(HS), 0.001 + i * 1e-4, i % 2 == 0)
    assert made.home().outcome.warnings == ()


# -- the torque limit ---------------------------------------------------------------------------

TORQUES = {
    'mechanical_end_detection_first_torque_limit': 40,
    'mechanical_end_detection_second_torque_limit': 10,
}


def torque_limits(made):
    """Home; return the home states with their torque limits, in order."""
    made.axis.home(made.time)
    seen = []
    while made.axis.running:
        made.cycle()
        now = (str(made.axis.state), made.axis.torque_limit)
        if now not in seen[-1:]:
            seen.append(now)
    return seen


@BOTH_WAYS
def test_the_second_torque_limit_holds_from_the_touch_of_the_end(direction):
    """Already while the end is detected."""
    made = rig('MechanicalEndDetection', mechanical_end_detection_time=0.1, **TORQUES).rehearsal(
        direction
    )
    assert torque_limits(made) == [
        ('MechanicalEndDetection', 40.0),
        ('MechanicalEndDetection', 10.0),
        ('HomeShift', 10.0),
        ('Idle', 0.0),
    ]


def test_without_a_second_torque_limit_the_first_one_stays():
    one = rig('MechanicalEndDetection', mechanical_end_detection_first_torque_limit=40)
    assert torque_limits(one.rehearsal()) == [
        ('MechanicalEndDetection', 40.0),
        ('HomeShift', 40.0),
        ('Idle', 0.0),
    ]


def test_no_torque_limit_without_a_mechanical_end():
    assert torque_limits(rig('HS', **TORQUES).rehearsal()) == [
        ('HSSearch', 0.0),
        ('HomeShift', 0.0),
        ('Idle', 0.0),
    ]


# -- configuration ------------------------------------------------------------------------------


def test_new_parameters_keep_what_is_known():
    made = axis()
    made.configure(rig('HS', homing_velocity_fast=0.1).parameters())
    assert made.readings.unknown_inputs == ()
    made.configure(rig('HS', invert_hs_polarity=True).parameters())
    assert made.readings.unknown_inputs == ()
    assert made.readings.switches[Input.HOME_SWITCH].level is True


def test_a_run_keeps_its_parameters():
    made = rig('HS').rehearsal()
    made.axis.home(made.time)
    made.cycle()
    profile = made.axis.profile
    with pytest.raises(RuntimeError, match='axis x is homing'):
        made.axis.configure(rig('HS', homing_velocity_fast=0.1).parameters())
    assert made.axis.profile is profile
    made.finish()
    assert made.axis.homed


def test_a_new_direction_turns_the_feedback():
    made = rig('HS').rehearsal()
    made.home()
    raw = made.axis.raw_position
    made.axis.configure(
        dataclasses.replace(
            made.axis.parameters,
            home_type=HomeType.CurrentPos,
            home_direction=AxisParameters(home_type=HomeType.HS, travel=1.0).home_direction,
        )
    )
    assert made.axis.raw_position == raw
    made.axis.configure(rig('CurrentPos').parameters(-1))
    assert made.axis.raw_position == raw
    assert made.home().outcome.home_position_raw == raw


# -- pauses -------------------------------------------------------------------------------------


def test_a_pause_is_not_counted_as_time():
    made = underway(pause_mode=True, timeout=1.0, home_type='HSHS')
    while made.axis.running:
        made.cycle()
        if made.axis.paused:
            for _ in range(500):
                made.cycle()
            assert made.axis.running
            made.axis.resume()
    assert made.axis.outcome.success


@BOTH_WAYS
@pytest.mark.parametrize('canceled', [math.inf, 0.0605, 0.062], ids=['never', 'before', 'after'])
def test_a_cancel_is_no_gentler_than_the_braking_for_a_limit(direction, canceled):
    """The axis brakes behind its edge at 0.06; the limit that rises then wants it harder."""
    one = rig('HS', homing_velocity_fast_dec=0.5, homing_velocity_fast_acc=5.0, ls_dec=8.0)
    made = one.switched(**{LIMIT_AHEAD: SwitchLayout(0.061, 1.0)}).rehearsal(direction, 0.03)
    assert made.axis.home(made.time) is None
    while made.axis.running:
        made.cycle()
        if direction * made.plant.position > canceled:
            made.axis.cancel()
    assert made.axis.outcome.success == math.isinf(canceled)
    assert furthest(made.course, direction) == pytest.approx(0.0656, abs=2e-4)


def test_time_that_is_set_back():
    """The run that is on stops; nothing waits for times that come once more."""
    made = axis(switch_debounce=0.01)
    position, time = 0.05, 0.0

    def cycles(count):
        nonlocal position, time
        for _ in range(count):
            time += PERIOD
            made.feedback(time, position)
            setpoint = made.update(time)
            position = setpoint[0] if setpoint else position

    assert made.home(time) is None
    cycles(20)
    made.switch(HS, time, True)  # not confirmed yet
    time -= 5.0
    made.stop(Error.CycleLate, 'set back')
    made.time_jumped_back(time)
    _, velocity, _ = made.update(time)
    assert velocity > 0.0
    for _ in range(100):  # also while the feedback settles
        cycles(2)
        time -= 1.0
        made.time_jumped_back(time)
    cycles(10)
    assert not made.running
    assert made.outcome.error is Error.CycleLate
    made.switch(HS, time, False)
    cycles(200)  # longer than any polling leaves: it is published on change
    assert made.home(time) is None
    cycles(20)
    made.switch(HS, time, True)
    edge = position
    cycles(300)
    assert made.homed
    assert made.outcome.home_position_raw == pytest.approx(edge, abs=0.2 * PERIOD)

    made.time_jumped_back(time - 5.0)
    assert not made.homed
    assert refused(made, time - 5.0).error is Error.FeedbackStale
    assert made.position == pytest.approx(position)


def test_a_periodic_switch_is_as_old_as_the_step_back():
    made = axis(switch_timeout=0.1)
    time = 60.0
    for switch in (HS, 'positive_limit_switch', LIMIT_BEHIND):
        made.switch(Input(switch), time, False)
    time -= 50.0
    made.time_jumped_back(time)
    made.feedback(time, 0.05)
    assert made.refusal(time) is None
    time += 0.15
    made.feedback(time, 0.05)
    assert refused(made, time).error is Error.SwitchStale


@pytest.mark.parametrize(
    'since, error',
    [(-0.01, Error.NoError), (0.01, Error.CycleLate)],
    ids=['before the run', 'in the run'],
)
def test_a_hold_up_ends_the_runs_that_missed_a_cycle(since, error):
    made = underway()
    made.axis.cycle_was_late(made.time + since, 'a cycle was late')
    assert made.finish().outcome.error is error


def test_continue_without_a_pause_does_nothing():
    made = underway()
    made.axis.resume()
    assert made.finish().outcome.success
    made.axis.resume()
    assert_at_rest(made)


def test_continue_while_the_axis_still_brakes():
    made = underway(pause_mode=True, home_type='HSHS')
    while made.axis.running:
        made.cycle()
        made.axis.resume()
    assert made.axis.outcome.success


def test_lost_feedback_ends_a_pause():
    made = underway(pause_mode=True)
    while not made.axis.paused:
        made.cycle()
    made._send_feedback = lambda time, position: None
    assert error_of(made.finish()) is Error.FeedbackStale


def test_an_axis_with_two_sources_of_its_joint_is_refused():
    """Case 4: a joint_state_publisher repeats the joint at 0 beside the real driver."""
    made = axis()
    for n in range(100):
        made.feedback(1.0 + 0.01 * n, 0.05)
        if n % 5 == 0:
            made.feedback(1.003 + 0.01 * n, 0.0)
    refusal = refused(made, 2.0)
    assert refusal.error is Error.PublisherConflict
    for part in ("joint 'x'", ' 0 m', '0.05 m', 'second node publish it'):
        assert part in refusal.message, refusal.message


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_a_second_source_in_a_run_stops_the_axis_where_it_is(direction):
    """The stop goes on from the command, not from the place that the second source names."""
    running = underway(direction)
    before = running.course.samples[-1]
    running.axis.feedback(running.time + 0.0001, before.feedback - direction * 0.08)
    course = running.finish()
    assert course.outcome.error is Error.PublisherConflict
    assert abs(course.samples[-1].position - before.position) < 0.02
    steps = [b.position - a.position for a, b in pairwise(course.samples)]
    assert max(map(abs, steps)) <= 0.2 * running.period * 1.01
