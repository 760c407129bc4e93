# SPDX-License-Identifier: Apache-2.0
"""Turning points, and the rules that bound a motion."""

import pytest
from core_rig import rig

from homing_node.core.travel import Leg, Rules
from homing_node.procedures.motions import Way
from homing_node.procedures.states import Error

BOTH_WAYS = pytest.mark.parametrize('way', [Way.TOWARD, Way.AWAY])


def broken(leg, command, feedback, **changes):
    """Return the error of the rule that a leg of the first search breaks, None: none."""
    parameters = rig('HS', **changes).parameters()
    rules = Rules(parameters, 0.0)
    rules.enter(parameters.procedure.rows[parameters.procedure.first], 0.0, 0.0)
    fault = rules.broken(leg, lambda _: command, feedback, 0.0, 0.0)
    return fault and fault.error


@BOTH_WAYS
def test_what_the_feedback_has_traveled_counts_from_its_own_turning_point(way):
    leg = Leg(way, 0.0, 0.0, since=0.0)
    leg.update(way * -0.01, 0.0)
    leg.update(way * 0.01, way * 0.01)
    assert leg.traveled == pytest.approx(0.02)
    assert leg.gone == pytest.approx(0.01)


@BOTH_WAYS
@pytest.mark.parametrize('ahead', [0.004, -0.004])
def test_the_following_error_has_no_sign(way, ahead):
    """An axis that runs away is as wrong as one that stays behind."""
    leg = Leg(way, 0.0, 0.0, since=0.0)
    leg.update(way * 0.01 + ahead, way * 0.01)
    command, feedback = way * 0.01, way * 0.01 + ahead
    assert broken(leg, command, feedback, following_error=0.005) is None
    assert broken(leg, command, feedback, following_error=0.003) is Error.FollowingError


def test_a_feedback_is_compared_with_the_commands_since_its_time():
    """A message that is late is no following error."""
    parameters = rig('HS', following_error=0.001).parameters()
    rules = Rules(parameters, 0.0)
    rules.enter(parameters.procedure.rows[parameters.procedure.first], 0.0, 0.0)
    leg = Leg(Way.TOWARD, 0.0, 0.0, since=0.0)

    def error_at(age):
        fault = rules.broken(leg, lambda ago: 0.01 - 0.05 * ago, 0.006, 0.0, 0.0, age)
        return fault and fault.error

    assert error_at(0.05) is Error.FollowingError
    assert error_at(0.07) is None
    assert error_at(0.2) is None  # 6 mm before it: a stamp that is not true


@BOTH_WAYS
@pytest.mark.parametrize(('gone', 'error'), [(0.0099, None), (0.01, Error.WrongDirection)])
def test_the_way_is_judged_once_the_command_has_gone_its_distance(way, gone, error):
    leg = Leg(way, 0.0, 0.0, since=0.0)
    leg.update(way * -0.006, way * gone)
    assert broken(leg, way * gone, way * -0.006, wrong_direction_distance=0.01) is error


@BOTH_WAYS
def test_a_feedback_beside_the_command_has_not_gone_the_wrong_way(way):
    leg = Leg(way, way * -0.01, 0.0, since=0.0)
    leg.update(way * -0.005, way * 0.005)
    assert broken(leg, way * 0.005, way * -0.005, wrong_direction_distance=0.004) is None


@pytest.mark.parametrize('jerk', [10.0, 500.0])
def test_a_command_that_stops_softly_behind_a_mechanical_end_is_no_following_error(jerk):
    one = rig('MechanicalEndDetectionReverseZPulse', max_jerk=jerk, following_error=0)
    one = one.but(mechanical_end_detection_pos_diff=0.001, homing_velocity_slow=0.065)
    course = one.built(lag=0.004).home()
    assert course.outcome.success, course.outcome.message
