# SPDX-License-Identifier: Apache-2.0
"""What each limit switch means to a run."""

from itertools import product

import pytest
from core_rig import LIMIT_TYPES, QUICK, TYPES, rig

from homing_node.core.limits import (
    RESPONSES,
    Action,
    Limit,
    LimitSwitches,
    Response,
    Rise,
    limits_of,
    ls_action,
    response_to,
    situation_of,
)
from homing_node.core.signals import Edge, Switch
from homing_node.parameters.axis import axis_parameters
from homing_node.procedures.motions import Way
from homing_node.procedures.states import LIMIT_SWITCHES, Input, LimitPair, LSType, Role

ACTIONS = {
    LSType.none: None,
    LSType.ServoOff: Action(None, True),
    LSType.DecServoOff: Action(8.0, True),
    LSType.Dec: Action(8.0),
    LSType.SlowDecServoOff: Action(4.0, True),
    LSType.SlowDec: Action(4.0),
}


@pytest.mark.parametrize('ls_type', ACTIONS, ids=str)
def test_actions(ls_type):
    assert ls_action(ls_type, rig('HS').parameters()) == ACTIONS[ls_type]


def all_wired(home_type='ZPulse', **changes):
    return axis_parameters(
        {
            **QUICK,
            'home_type': home_type,
            'near_ls_type': 'SlowDec',
            'external_ls_type': 'ServoOff',
            'switches': ['home_switch', 'z_pulse', 'touch_probe', *map(str, LIMIT_SWITCHES)],
            'mechanical_end_detection_pos_diff': 0.001,
            **changes,
        }
    )


@pytest.mark.parametrize('ls_direction', ['Normal', 'Reverse'])
@pytest.mark.parametrize('home_direction', ['Positive', 'Negative'])
def test_which_end_a_limit_guards(home_direction, ls_direction):
    limits = limits_of(all_wired(home_direction=home_direction, ls_direction=ls_direction))
    positive_is_ahead = (home_direction == 'Positive') == (ls_direction == 'Normal')
    for switch, limit in limits.items():
        assert limit.input is switch
        positive = 'positive' in switch
        assert limit.way is (Way.TOWARD if positive == positive_is_ahead else Way.AWAY)
        assert ('ahead' in limit.name) == (limit.way is Way.TOWARD)


@pytest.mark.parametrize('home_type', TYPES, ids=str)
def test_a_limit_behind_is_always_normal(home_type):
    limits = limits_of(all_wired(home_type))
    assert len(limits) == 6
    assert {one.role for one in limits.values() if one.way is Way.AWAY} == {Role.NORMAL}


@pytest.mark.parametrize('home_type', TYPES, ids=str)
def test_a_limit_ahead_has_the_types_role(home_type):
    parameters = all_wired(home_type)
    for limit in limits_of(parameters).values():
        if limit.way is Way.TOWARD:
            assert limit.role is parameters.procedure.limits_ahead[limit.pair]


@pytest.mark.parametrize('home_type', TYPES, ids=str)
def test_ignoring_limits_concerns_only_those_ahead_of_a_mechanical_end(home_type):
    ignoring = limits_of(all_wired(home_type, mechanical_end_detection_ignore_ls=True))
    usual = limits_of(all_wired(home_type))
    for switch, limit in ignoring.items():
        if home_type.value.startswith('Mechanical') and limit.way is Way.TOWARD:
            assert limit.role is Role.IGNORED
        else:
            assert limit == usual[switch]


def test_separate_actions():
    limits = limits_of(
        all_wired(
            ls_type='SeparatePositiveLSNegativeLS',
            positive_ls_type='ServoOff',
            negative_ls_type='SlowDec',
        )
    )
    assert limits[Input.POSITIVE_LIMIT_SWITCH].action == Action(None, True)
    assert limits[Input.NEGATIVE_LIMIT_SWITCH].action == Action(4.0)


@pytest.mark.parametrize('pair', [LimitPair.NEAR, LimitPair.EXTERNAL], ids=str)
def test_a_near_or_external_limit_without_a_type_is_disabled(pair):
    limits = limits_of(all_wired(**{f'{pair}_ls_type': 'None'}))
    assert pair not in {limit.pair for limit in limits.values()}


def test_one_near_limit_of_a_pair():
    limits = limits_of(
        all_wired(
            near_ls_type='SeparatePositiveLSNegativeLS',
            near_positive_ls_type='Dec',
            near_negative_ls_type='None',
        )
    )
    assert Input.NEAR_POSITIVE_LIMIT_SWITCH in limits
    assert Input.NEAR_NEGATIVE_LIMIT_SWITCH not in limits


def test_a_hardware_limit_without_a_type_still_steers():
    limit = limits_of(all_wired('HS', ls_type='None'))[Input.POSITIVE_LIMIT_SWITCH]
    assert limit.role is Role.REVERSAL
    assert limit.action is None


def test_a_limit_that_is_not_wired_means_nothing():
    assert set(limits_of(all_wired(switches=['z_pulse', 'positive_limit_switch']))) == {
        Input.POSITIVE_LIMIT_SWITCH
    }


@pytest.mark.parametrize('home_type', LIMIT_TYPES, ids=str)
def test_limit_types_have_one_reference(home_type):
    roles = [limit.role for limit in limits_of(all_wired(home_type)).values()]
    assert roles.count(Role.REFERENCE) == 1


@pytest.mark.parametrize(
    ('home_type', 'switch', 'way'),
    [
        ('HS', 'positive_limit_switch', Way.TOWARD),
        ('ZPulse', 'positive_limit_switch', Way.TOWARD),
        ('HS', 'negative_limit_switch', Way.AWAY),
    ],
)
def test_a_momentary_limit_is_remembered_until_the_axis_is_back(home_type, switch, way):
    """It rose at 0.09 m and is off again."""
    parameters = all_wired(home_type)
    limits = LimitSwitches(parameters, {i: Switch(i) for i in limits_of(parameters)})
    edge = Edge(Input(switch), 1.0, True)
    edge.position, edge.way = way * 0.09, way
    limits.remember(edge)
    for home in (False, True):
        blocks = home or limits.get(edge.input).role is Role.NORMAL
        assert (limits.blocking(way, home, way * 0.091) is not None) == blocks
        assert limits.blocking(way, home, way * 0.089) is None
    reverses = limits.get(edge.input).role is Role.REVERSAL
    assert limits.reversing(way * 0.091) == reverses
    assert not limits.reversing(way * 0.089)


# -- what the rise of a limit does (sections 5 and 6) ---------------------------------------------

DEC = Action(8.0)
LIMITS = [
    Limit(Input.POSITIVE_LIMIT_SWITCH, LimitPair.HARDWARE, Way.TOWARD, role, action)
    for role in Role
    for action in (DEC, None)
] + [
    Limit(Input.NEGATIVE_LIMIT_SWITCH, LimitPair.HARDWARE, Way.AWAY, Role.NORMAL, action)
    for action in (DEC, None)
]
RISES = [
    Rise(velocity, heading, *flags)
    for velocity in (-0.1, 0.0, 0.1)
    for heading in Way
    for flags in product((False, True), repeat=8)
]


def response_by_the_rules(limit, rise):
    """Return what the sentences of sections 5 and 6 and the types that home on a fall say."""
    normal, ahead = limit.role is Role.NORMAL, limit.way is Way.TOWARD
    moves_into = rise.velocity * limit.way > 0.0
    acts = moves_into or (normal and rise.velocity != 0.0 and rise.all_ls)
    if limit.role is Role.IGNORED:
        return Response.IGNORE
    if rise.stopping:
        return Response.ACT if acts and limit.action else Response.IGNORE
    if rise.awaited:
        return Response.ARROW
    if not ahead and rise.velocity > 0.0:
        return Response.IGNORE if rise.just_left else Response.FAIL_SWAPPED
    if ahead and moves_into and rise.braking:
        brakes = limit.action and not rise.turned_by_it
        return Response.BRAKE_HARDER if brakes else Response.IGNORE
    if not acts and rise.heading is not limit.way:
        return Response.IGNORE
    if ahead and rise.to_home and limit.role is Role.REFERENCE and rise.at_its_edge:
        return Response.IGNORE
    if ahead and rise.to_home and not normal:
        return Response.FAIL_ALWAYS
    return Response.FAIL if limit.action else Response.IGNORE


def possible(limit, rise):
    """Return whether the machine can ask this; a limit behind is no row's arrow."""
    return limit.way is Way.TOWARD or not rise.awaited


@pytest.mark.parametrize('limit', LIMITS, ids=lambda one: f'{one.way.name} {one.role}')
def test_the_table_says_what_the_rules_say(limit):
    for rise in RISES:
        if possible(limit, rise):
            assert response_to(limit, rise) is response_by_the_rules(limit, rise), rise


def test_every_cell_of_the_table_is_used():
    used = {
        (limit.way, situation_of(limit, rise), limit.role)
        for limit in LIMITS
        for rise in RISES
        if limit.role is not Role.IGNORED and possible(limit, rise)
    }
    assert used == RESPONSES.keys()
    assert set(RESPONSES.values()) == set(Response)
