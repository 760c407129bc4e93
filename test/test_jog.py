# SPDX-License-Identifier: Apache-2.0
"""A jog: by a distance, with every bound and stop of a homing run; it changes no home."""

import re
from dataclasses import replace
from itertools import pairwise

import pytest
from core_rig import (
    AHEAD,
    BEHIND,
    DIRECTIONS,
    HOME,
    HS,
    LIMIT_AHEAD,
    LIMIT_BEHIND,
    TRAVEL,
    bouncing,
    on_side,
    path,
    rig,
    spoilt,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.core.jog import DEADMAN_TIME, Jog
from homing_node.procedures.states import Error, Input, State

FAST = 0.2


def moved(made, distance, velocity=0.1, limit=30.0):
    """Jog; return the course and how far the axis went."""
    start = made.plant.position
    course = made.jog(Jog(distance, velocity), limit)
    return course, made.plant.position - start


def moving(made, distance, velocity=0.1, deadman=False):
    """Start a jog, and return once the axis has its velocity."""
    for _ in range(5):
        made.cycle()
    assert made.axis.jog(made.time, Jog(distance, velocity, deadman)) is None
    while abs(made.axis.profile.velocity) < 0.99 * velocity:
        made.axis.deadman(made.time, True)
        made.cycle()
    return made


def ending(made, **continuing):
    """Let a jog end; return how it has."""
    course = made.finish(30.0)
    assert made.axis.profile.velocity == 0.0
    return course.outcome


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('way', [1, -1])
def test_a_jog_goes_its_distance_and_tells_what_it_meets(way, direction):
    made = rig('HS').rehearsal(direction, start=0.05 if way > 0 else 0.075)
    course, distance = moved(made, way * direction * 0.03)
    assert course.outcome.error is Error.NoError and path(course) == ['Jogging']
    assert distance == pytest.approx(way * direction * 0.03, abs=1e-6)
    assert course.outcome.jogged.distance == pytest.approx(distance, abs=1e-9)
    first, second = course.outcome.jogged.edges
    low, high = direction * HOME.on_from, direction * HOME.on_to
    if way < 0:
        low, high = high, low
    for edge, place, level in ((first, low, True), (second, high, False)):
        assert (edge.input, edge.level) == (Input.HOME_SWITCH, level)
        assert abs(edge.position - place) <= edge.uncertainty
        assert edge.velocity == pytest.approx(way * direction * 0.1, rel=0.01)
    assert first.time < second.time


@settings(max_examples=20)
@given(
    distance=st.floats(1e-6, 0.035) | st.floats(-0.045, -1e-6),
    velocity=st.floats(0.004, FAST),
    direction=st.sampled_from(DIRECTIONS),
    lag=st.sampled_from([0.0, 0.02]),
)
def test_setpoints_keep_to_the_velocity_asked_for_and_to_the_limits_of_the_axis(
    distance, velocity, direction, lag
):
    made = rig('HS').built(lag=lag).rehearsal(direction)
    course, gone = moved(made, direction * distance, velocity)
    assert course.outcome.error is Error.NoError, course.outcome.message
    assert gone == pytest.approx(direction * distance, abs=1e-4)
    p, period = made.axis.parameters, made.period
    samples = course.samples
    assert all(abs(one.velocity) <= velocity * (1 + 1e-6) for one in samples)
    for a, b in pairwise(samples):
        middle = 0.5 * (a.velocity + b.velocity) * period
        assert abs(b.position - a.position - middle) <= p.max_jerk * period**3 + 1e-9
        assert abs(b.acceleration - a.acceleration) <= p.max_jerk * period * (1 + 1e-6) + 1e-6
    assert samples[-1].velocity == 0.0


def test_a_jog_changes_no_home():
    made = rig('HS').rehearsal()
    made.home()
    before = made.axis.outcome
    course, _ = moved(made, -0.01)
    axis = made.axis
    assert course.outcome.error is Error.NoError
    assert axis.homed and axis.outcome == before and axis.home_source == 'run'
    assert axis.position == pytest.approx(0.25 - 0.01, abs=1e-4)
    assert (axis.history.runs, axis.history.homed) == (1, 1)
    course, _ = moved(made, 0.08)
    assert course.outcome.error is axis.error is Error.LSTriggered
    assert axis.homed and axis.outcome.home_offset == before.home_offset
    assert made.home().outcome.error is Error.NoError


def test_a_jog_makes_no_home():
    made = rig('HS').rehearsal()
    moved(made, -0.01)
    assert not made.axis.homed


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize(
    ('distance', 'limit', 'place'),
    [(0.09, LIMIT_AHEAD, AHEAD.on_from), (-0.09, LIMIT_BEHIND, BEHIND.on_to)],
)
def test_a_limit_stops_a_jog_and_lets_one_away_from_it_go(direction, distance, limit, place):
    made = rig('HS').rehearsal(direction)
    course, _ = moved(made, direction * distance)
    name = Input(on_side(limit, direction)).text
    assert course.outcome.error is Error.LSTriggered and f'the {name} (' in course.outcome.message
    behind = abs(made.plant.position - direction * place)
    assert behind < 0.1**2 / (2 * 8) + 0.1 * 0.03  # ls_dec, and the ramps of the jerk
    met = [one for one in course.outcome.jogged.edges if one.input == on_side(limit, direction)]
    assert len(met) == 1 and abs(met[0].position - direction * place) <= met[0].uncertainty
    stays, gone = moved(made, direction * distance / 9)
    assert stays.outcome.error is Error.LSTriggered and gone == 0.0 and not stays.samples
    assert f'the {name} ' in stays.outcome.message and 'is not started' in stays.outcome.message
    leaves, gone = moved(made, -direction * distance / 9)
    assert leaves.outcome.error is Error.NoError
    assert gone == pytest.approx(-direction * distance / 9, abs=1e-6)


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('distance', [0.09, -0.09])
def test_swapped_limits_stop_a_jog(direction, distance):
    one = rig('HS').switched(**{LIMIT_AHEAD: BEHIND, LIMIT_BEHIND: AHEAD})
    made = one.rehearsal(direction)
    course, gone = moved(made, direction * distance)
    assert course.outcome.error is Error.LSTriggered
    assert abs(gone) < 0.055


@pytest.mark.parametrize('limit', [LIMIT_AHEAD, LIMIT_BEHIND])
def test_a_limit_may_bounce_as_the_axis_leaves_it(limit):
    start, way = (0.0902, -1) if limit == LIMIT_AHEAD else (0.0018, 1)
    made = spoilt(rig('HS'), bouncing(), start=start)
    course, gone = moved(made, way * 0.02)
    assert course.outcome.error is Error.NoError, course.outcome.message
    assert gone == pytest.approx(way * 0.02, abs=1e-6)


def test_both_limits_on_refuse_a_jog():
    made = rig('HS').switched(**{LIMIT_AHEAD: AHEAD, LIMIT_BEHIND: AHEAD}).rehearsal(start=0.095)
    course, gone = moved(made, -0.01)
    assert course.outcome.error is Error.LimitsBothOn and gone == 0.0


@pytest.mark.parametrize(
    ('jog', 'said'),
    [
        (Jog(0.0, 0.1), 'distance: 0 must be a number other than 0'),
        (Jog(float('nan'), 0.1), 'distance: nan must be a number other than 0'),
        (Jog(-0.2, 0.1), 'distance: -0.2 m must be within +-travel, 0.1 m'),
        (Jog(0.01, 0.0), 'velocity: 0 must be > 0 m/s'),
        (Jog(0.01, float('inf')), 'velocity: inf must be > 0 m/s'),
        (Jog(0.01, 0.3), 'velocity: 0.3 m/s must be <= homing_velocity_fast, 0.2 m/s'),
        (Jog(0.01, 1e-7), 'velocity: 1e-07 m/s must be >= 2.78e-06 m/s, so that'),
    ],
)
@pytest.mark.parametrize('unit', ['m', 'rad'])
def test_what_is_refused(jog, said, unit):
    made = rig('HS', unit=unit).rehearsal()
    course, gone = moved(made, *jog[:2])
    assert course.outcome.error is Error.InvalidParameter and gone == 0.0
    assert (said if unit == 'm' else re.sub(r'\bm\b', 'rad', said)) in course.outcome.message


def test_a_jog_in_a_run_is_refused_and_a_run_in_a_jog():
    made = moving(rig('HS').rehearsal(), -0.04)
    assert made.axis.state is State.Jogging
    assert made.axis.home(made.time).error is Error.Busy
    assert made.axis.jog(made.time, Jog(0.01, 0.1)).error is Error.Busy


def stale(made):
    made._send_feedback = lambda *_: None


def jam(made):
    made.plant._high = made.plant.position


STOPS = {
    'cancel': (lambda made: made.axis.cancel(), Error.Canceled),
    'emergency stop': (lambda made: made.axis.set_emergency_stop(True), Error.EmergencyStop),
    'servo': (lambda made: made.axis.set_servo(False), Error.ServoOff),
    'stale feedback': (stale, Error.FeedbackStale),
    'jammed': (jam, Error.FollowingError),
    'late': (lambda made: made.axis.cycle_was_late(made.time + 1.0, 'late'), Error.CycleLate),
    'deadman': (lambda made: made.axis.deadman(made.time, False), Error.Canceled),
    'switch lost': (
        lambda made: made.axis.stop(Error.SwitchStale, 'it is gone'),
        Error.SwitchStale,
    ),
}


@pytest.mark.parametrize('what', STOPS)
def test_every_stop_of_a_run_stops_a_jog(what):
    act, error = STOPS[what]
    made = moving(rig('HS').rehearsal(), 0.03, deadman=what == 'deadman')
    at, began = made.plant.position, made.time
    act(made)
    while made.axis.running and made.time < began + 2.0:
        made.cycle()
    outcome = made.axis.ended
    assert outcome.error is error, outcome
    assert outcome.message.startswith('axis x: ') and 'Jogging' in outcome.message
    assert made.axis.error is error and not made.axis.running
    stopping = 0.1**2 / (2 * 5) + 0.1 * (0.02 if what != 'stale feedback' else 0.25)
    assert abs(made.plant.position - at) < stopping


def test_the_deadman_must_be_held_all_the_way():
    made = moving(rig('HS').rehearsal(), 0.03, velocity=0.02, deadman=True)
    held = made.time
    made.axis.deadman(held, True)
    while made.axis.error is Error.NoError:
        made.cycle()
    assert made.time - held == pytest.approx(DEADMAN_TIME, abs=2 * made.period)
    assert 'the deadman was not held for 0.3 s' in ending(made).message
    made.axis.deadman(made.time, True)  # too late: nothing moves again
    made.cycle()
    assert not made.axis.running


def test_a_jog_without_a_deadman_needs_none_and_the_next_run_neither():
    made = rig('HS').rehearsal()
    course, _ = moved(made, 0.005, velocity=0.01)
    assert course.duration > DEADMAN_TIME and course.outcome.error is Error.NoError
    made = moving(rig('HS').rehearsal(), -0.01, deadman=True)
    made.axis.deadman(made.time, False)
    ending(made)
    assert made.home().outcome.error is Error.NoError


def test_pulses_are_latched_on_the_way():
    made = rig('ZPulse').rehearsal(start=0.05)
    assert moving(made, 0.03).axis.arm_latch
    pulses = ending(made).jogged.edges
    assert [one.input for one in pulses] == [Input.Z_PULSE] * 3
    assert [one.position for one in pulses] == pytest.approx([0.0533, 0.0633, 0.0733], abs=1e-9)
    assert all(one.level and one.uncertainty > 0.0 for one in pulses)


@pytest.mark.parametrize('rate', [50.0, 200.0])
@settings(max_examples=10)
@given(velocity=st.floats(0.02, 0.2), start=st.floats(0.03, 0.055), seed=st.integers(0, 99))
def test_edges_of_a_polled_switch_are_within_their_uncertainty(rate, velocity, start, seed):
    one = rig('HS')
    transport = replace(one.transport, poll_rate=rate, seed=seed, period_jitter=0.1)
    made = one.but(transport).rehearsal(start=start)
    course, _ = moved(made, 0.085 - start, velocity)
    rises, *_ = [e for e in course.outcome.jogged.edges if e.input == HS]
    assert abs(rises.position - HOME.on_from) <= rises.uncertainty + 1e-9
    assert rises.uncertainty < TRAVEL
