# SPDX-License-Identifier: Apache-2.0
"""The closed forms of stops and turns: what ruckig computes."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.check.stopping import (
    fastest,
    reaction_distance,
    stopping_distance,
    turning_distance,
)
from homing_node.core.phase import Dynamics
from homing_node.core.profile import Profile

PERIOD = 0.001
VELOCITY = st.floats(0.002, 0.5)
RATE = st.floats(0.2, 10.0)
JERK = st.floats(5.0, 1000.0)


def cruising(pace, jerk):
    """Return a profile that has just reached its velocity."""
    profile = Profile(PERIOD, jerk)
    profile.seek(pace.velocity, pace)
    while not profile.done:
        profile.update()
    return profile


@settings(max_examples=50, deadline=None)
@given(VELOCITY, RATE, JERK)
def test_a_stop_goes_as_far_as_the_profile_s(velocity, deceleration, jerk):
    profile = cruising(Dynamics(velocity, 5.0, deceleration), jerk)
    expected = profile.stopping_position(deceleration) - profile.position
    assert stopping_distance(velocity, deceleration, jerk) == pytest.approx(expected, rel=1e-6)


@settings(max_examples=50, deadline=None)
@given(VELOCITY, st.floats(0.05, 1.0), RATE, RATE, RATE, JERK)
def test_a_turn_goes_as_far_as_the_profile_s(velocity, part, acc, dec, back_acc, jerk):
    profile = cruising(Dynamics(velocity, acc, dec), jerk)
    begin = furthest = profile.position
    profile.seek(-part * velocity, Dynamics(part * velocity, back_acc, 1.0))
    while profile.velocity >= 0.0:
        profile.update()
        furthest = max(furthest, profile.position)
    found = turning_distance(velocity, part * velocity, acc, dec, jerk, back_acc)
    between_cycles = min(acc, dec) * PERIOD**2
    assert furthest - begin == pytest.approx(found, rel=1e-6, abs=between_cycles)


@settings(max_examples=30, deadline=None)
@given(VELOCITY, RATE, JERK, st.floats(0.0, 0.03))
def test_no_moment_of_the_acceleration_goes_further(velocity, acceleration, jerk, delay):
    """Whenever a limit is met and answered a delay later: the bound holds, and is nearly met."""
    profile = Profile(PERIOD, jerk)
    profile.seek(velocity, Dynamics(velocity, acceleration, 1.0))
    path = [0.0]
    ends = [profile.stopping_position(1.0)]
    cycles = after = int(delay / PERIOD)
    while not profile.done or after > 0:
        after -= profile.done
        profile.update()
        path.append(profile.position)
        ends.append(profile.stopping_position(1.0))
    furthest = max(end - path[max(0, n - cycles)] for n, end in enumerate(ends))
    bound = reaction_distance(velocity, acceleration, jerk, cycles * PERIOD) + stopping_distance(
        velocity, 1.0, jerk
    )
    assert furthest <= bound * (1 + 1e-6) + 1e-12
    assert furthest >= 0.7 * bound - 2 * velocity * PERIOD


def test_the_fastest_velocity_that_fits():
    velocity = fastest(lambda v: stopping_distance(v, 0.5, 100.0), 0.002, 1.0)
    assert stopping_distance(velocity, 0.5, 100.0) == pytest.approx(0.002)
    assert fastest(lambda v: 2.0, 1.0, 1.0) == pytest.approx(0.0, abs=1e-15)
    assert fastest(lambda v: v, 1.0, 0.25) == pytest.approx(0.25)
