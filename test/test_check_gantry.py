# SPDX-License-Identifier: Apache-2.0
"""What `homing check` finds about the sides of a gantry."""

from dataclasses import dataclass, field
from typing import Any

import pytest

from homing_node.check import Severity, check
from homing_node.check.finding import Finding
from homing_node.parameters.configuration import Configuration, configuration
from homing_node.plant.layout import AxisLayout
from homing_node.plant.layout_reader import layouts_from

ERROR, WARNING, INFO = Severity.error, Severity.warning, Severity.info
HS, AHEAD, BEHIND = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'

LEADER = {
    'joint': 'y1_joint',
    'home_type': 'HSHS',
    'travel': 0.2,
    'homing_velocity_fast': 0.05,
    'homing_velocity_fast_acc': 0.5,
    'homing_velocity_fast_dec': 0.5,
    'homing_velocity_slow': 0.005,
    'homing_reverse_distance': 0.002,
    'max_jerk': 100.0,
    'followers': ['y2'],
    'max_skew': 0.002,
    'switches': [HS, AHEAD, BEHIND],
}
LAYOUT = {
    'hard_stops': [0.0, 0.2],
    HS: [0.15, 0.16],
    AHEAD: [0.185, 0.2],
    BEHIND: [0.0, 0.01],
    'start': 0.1,
    'lag': 0.005,
    'followers': ['y2'],
}
#: The encoder of the follower shows 0.01 m more where the gantry is square.
SIDE = {'stiffness': 1e5, 'square_at': 0.01}
Z = {
    'home_type': 'HSZPulse',
    'switches': [HS, AHEAD, BEHIND, 'z_pulse'],
    'homing_velocity_fast': 0.02,
}
INDEX = {'index_pitch': 0.01, 'index_offset': 0.005}


def built(
    leader: dict[str, Any] | None = None,
    follower: dict[str, Any] | None = None,
    layout: dict[str, Any] | None = None,
    side: dict[str, Any] | None = None,
) -> tuple[Configuration, dict[str, AxisLayout]]:
    """Return a gantry and its layout; what is given replaces what the good one has."""
    values: dict[str, Any] = {'axes': ['y']}
    values |= {f'y.{name}': value for name, value in {**LEADER, **(leader or {})}.items()}
    values |= {f'y.y2.{name}': value for name, value in (follower or {}).items()}
    places: dict[str, Any] = {**LAYOUT, **(layout or {})}
    if 'y2' in places['followers']:
        places |= {f'y2.{name}': value for name, value in {**SIDE, **(side or {})}.items()}
    return configuration(values), layouts_from({'y': places})


def found(
    leader: dict[str, Any] | None = None,
    follower: dict[str, Any] | None = None,
    layout: dict[str, Any] | None = None,
    side: dict[str, Any] | None = None,
) -> list[Finding]:
    """Return the findings about a gantry."""
    return check(*built(leader, follower, layout, side))


@dataclass
class Case:
    """What is changed in the good gantry, and the finding that it must have then."""

    check: str
    severity: Severity
    axis: str = 'y.y2'
    leader: dict[str, Any] = field(default_factory=dict)
    follower: dict[str, Any] = field(default_factory=dict)
    layout: dict[str, Any] = field(default_factory=dict)
    side: dict[str, Any] = field(default_factory=dict)
    right: Any = None
    words: str = ''


CASES = [
    Case('racking', INFO, words='0.0048 m out of square, 480 N'),
    Case('racking', INFO, side={'stiffness': 2e5}, words='960 N'),
    Case('racking', INFO, leader={'max_skew': 0.001}, words='0.0038 m out of square, 380 N'),
    Case('racking', INFO, side={'delay': 0.02}, words='0.0058 m'),
    Case('racking', INFO, leader={'ls_dec': 2.0}, words='0.00443 m'),
    Case('switch-offset', WARNING, follower={'switch_offset': 0.0003}, right=0.0),
    Case(
        'switch-offset',
        WARNING,
        side={HS: [0.1605, 0.17]},
        right=0.0005,
        words='homing leaves the gantry 0.0005 m out of square',
    ),
    Case(
        'switch-offset',
        WARNING,
        leader={'square': False},
        side={HS: [0.1605, 0.17]},
        right=0.0005,
        words='the squareness that is reported is off',
    ),
    Case(
        'switch-offset',
        ERROR,
        side={HS: [0.155, 0.165]},
        right=-0.005,
        words='ends with FollowerSwitchMissing or SkewTooLarge',
    ),
    Case(
        'switch-offset',
        WARNING,
        follower={'home_direction': 'Negative', 'switches': [HS]},
        side={'mirrored': True, HS: [-0.17, -0.1605], 'inverted': []},
        right=0.0005,
    ),
    Case(
        'side-index',
        ERROR,
        leader=Z,
        layout=INDEX,
        side={HS: [0.1755, 0.18]},
        words='about 2 x 0.01 m, the distance',
    ),
    Case('side-direction', ERROR, follower={'home_direction': 'Negative'}, right='Positive'),
    Case('side-direction', ERROR, side={'mirrored': True}, right='Negative'),
    Case(
        'side-without-reference',
        INFO,
        follower={'switches': [AHEAD, BEHIND]},
        right=f'with {HS}',
        words='has no home_switch to home on',
    ),
    Case(
        'side-without-reference',
        INFO,
        follower={'gantry_homing_use_slave_hs': False},
        right='true',
        words='gantry_homing_use_slave_hs is false',
    ),
    Case(
        'side-without-reference',
        INFO,
        leader={'home_type': 'LS'},
        follower={'gantry_homing_use_slave_ls': False},
        right='true',
        words='has no positive_limit_switch',
    ),
    Case('start-racked', WARNING, 'y', side={'start': 0.113}, words='0.003 m out of square'),
    Case('skew-in-motion', ERROR, 'y', side={'delay': 0.05}, right=0.02, words='0.0025 m'),
    Case('side-missing', WARNING, 'y', layout={'followers': []}, words='no follower y.y2'),
    Case(
        'side-missing',
        WARNING,
        'y',
        layout={'followers': ['y2', 'y3'], 'y3.stiffness': 1e5},
        words='y.y3',
    ),
    Case('polarity', ERROR, side={'inverted': [HS]}, right=True),
    Case('fitted-unwired', WARNING, follower={'switches': [HS, BEHIND]}, right=f'with {AHEAD}'),
]


@pytest.mark.parametrize('case', CASES, ids=[f'{n}-{case.check}' for n, case in enumerate(CASES)])
def test_finding(case):
    findings = found(case.leader, case.follower, case.layout, case.side)
    [one] = [
        each
        for each in findings
        if each.check == case.check and each.axis == case.axis and case.words in each.text
    ]
    assert one.severity is case.severity
    if isinstance(case.right, float):
        assert one.right == pytest.approx(case.right)
    else:
        assert one.right == case.right


def test_the_good_gantry_has_one_finding_how_far_it_can_rack():
    assert [(one.axis, one.check) for one in found()] == [('y.y2', 'racking')]


def test_a_limit_switch_of_one_side_guards_both():
    findings = found(follower={'switches': [HS]}, side={AHEAD: [9.0, 9.0], BEHIND: [9.0, 9.0]})
    assert not {one.check for one in findings} & {'end-unguarded', 'limit-without-action'}


def test_the_place_of_the_switches_says_nothing_while_a_side_is_the_wrong_way_round():
    findings = found(follower={'home_direction': 'Negative'})
    assert [one.check for one in findings if one.severity is ERROR] == ['side-direction']


def test_what_is_true_of_both_sides_is_told_once():
    findings = found(leader={'ls_dec': 0.4})
    assert [one.axis for one in findings if one.check == 'soft-ls-dec'] == ['y']


def test_without_a_layout_only_what_the_parameters_say_is_found():
    values = {f'y.{name}': value for name, value in LEADER.items()}
    follower = {'y.y2.gantry_homing_use_slave_hs': False}
    findings = check(configuration({'axes': ['y'], **values, **follower}))
    assert [one.check for one in findings] == ['side-without-reference']


def test_a_type_that_homes_on_the_index_is_square_by_the_index():
    """Where the switches are does not count, as long as they arm the pulses of one turn."""
    good = found(Z, layout=INDEX, side={HS: [0.161, 0.17]})
    assert 'switch-offset' not in {one.check for one in good}
    moved = found(Z, layout=INDEX, side={'index_offset': 0.0153})
    [one] = [each for each in moved if each.check == 'switch-offset']
    assert one.right == pytest.approx(0.0003)
