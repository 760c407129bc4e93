# SPDX-License-Identifier: Apache-2.0
"""What `homing check` finds about the sides of a gantry."""

import json
from dataclasses import dataclass, field
from math import inf
from typing import Any

import pytest

from homing_node.check import Severity, check
from homing_node.check.finding import Finding
from homing_node.check.gantry import Gantry
from homing_node.check.side_faults import finding_of, rehearsed
from homing_node.cli import main
from homing_node.core.outcome import Outcome
from homing_node.course import Course
from homing_node.parameters.configuration import Configuration, configuration
from homing_node.plant.layout import AxisLayout
from homing_node.plant.layout_reader import layouts_from
from homing_node.plant.timing import Timing
from homing_node.procedures.states import Error, Input
from homing_node.rehearsal.gantry import GantryRehearsal
from homing_node.rehearsal.link import Transport
from homing_node.rehearsal.side_faults import FaultTrial, SideFault

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
    Case(
        'skew-index',
        ERROR,
        'y',
        leader={**Z, 'z_pulse_distance_check': 0.004},
        right=0.0018,
        words='half the distance of the Z-pulses or more (0.004 m)',
    ),
    Case(
        'skew-index',
        ERROR,
        'y',
        leader=Z,
        layout={'index_pitch': 0.0039, 'index_offset': 0.001},
        side={'index_pitch': 0.0041, 'index_offset': 0.011},
        right=0.0017,
        words='(0.0039 m)',
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


def test_the_node_refuses_a_skew_of_half_a_turn():
    """It checks without a layout, at the start and with each value that is set."""
    values = {f'y.{name}': value for name, value in {**LEADER, **Z}.items()}
    for pitch, refused in (0.004, True), (0.0041, False), (0.0, False):
        after = {'axes': ['y'], **values, 'y.z_pulse_distance_check': pitch}
        found = {one.check for one in check(configuration(after)) if one.severity is ERROR}
        assert found == ({'skew-index'} if refused else set())
    for unused in {'home_type': 'HSHS'}, {'gantry_homing_use_slave_z_pulse': False}:
        after |= {'y.z_pulse_distance_check': 0.004}
        after |= {f'y.{name}': value for name, value in unused.items()}
        assert 'skew-index' not in {one.check for one in check(configuration(after))}


def test_a_type_that_homes_on_the_index_is_square_by_the_index():
    """Where the switches are does not count, as long as they arm the pulses of one turn."""
    good = found(Z, layout=INDEX, side={HS: [0.161, 0.17]})
    assert 'switch-offset' not in {one.check for one in good}
    moved = found(Z, layout=INDEX, side={'index_offset': 0.0153})
    [one] = [each for each in moved if each.check == 'switch-offset']
    assert one.right == pytest.approx(0.0003)


# -- rehearsed faults -----------------------------------------------------------------------------


def faults(leader=None, follower=None, layout=None, side=None):
    """Return what the rehearsed faults of a gantry end with, by (side, check)."""
    checked, layouts = built(leader, follower, layout, side)
    findings = rehearsed(checked, layouts, Timing())
    return {(one.axis, one.check): (one.severity, one.what) for one in findings}


@pytest.mark.parametrize(
    'home_type, direction',
    [('HSHS', 'Positive'), ('HSOff', 'Negative'), ('LS', 'Positive'), ('LS', 'Negative')],
)
def test_a_fault_of_a_switch_of_one_side_never_homes_the_gantry(home_type, direction):
    values = {'home_type': home_type, 'home_direction': direction}
    start = {'start': STARTS[direction, home_type == 'LS']}
    found = faults(values, layout=start)
    assert set(found) == {
        (side, f'side-{fault}')
        for side in ('y', 'y.y2')
        for fault in ('dead', 'stuck', 'swapped')
        if (side, fault) != ('y', 'swapped')
    }
    for (side, word), (severity, what) in found.items():
        assert severity is INFO, what
        assert ' homes ' not in what
        if word != 'side-swapped':
            assert f'ends with {EXPECTED[home_type, word]}' in what
            assert f'of {side} ' in what
            assert 'leaves the gantry 0 m out of square; a spring bore at most 0 N' in what


#: Before the switch that the type homes on, by the direction and by whether that is a limit.
STARTS = {
    ('Positive', False): 0.14,
    ('Negative', False): 0.165,
    ('Positive', True): 0.17,
    ('Negative', True): 0.03,
}
EXPECTED = {
    ('HSHS', 'side-dead'): 'FollowerSwitchMissing',
    ('HSHS', 'side-stuck'): 'FollowerSwitchMissing',
    ('HSOff', 'side-dead'): 'FollowerSwitchMissing',
    ('HSOff', 'side-stuck'): 'FollowerSwitchMissing',
    ('LS', 'side-dead'): 'FollowerSwitchMissing',
    ('LS', 'side-stuck'): 'FollowerSwitchMissing',
}


def test_swapped_cables_rack_a_gantry_by_no_more_than_max_skew():
    [what] = [
        what
        for (_, word), (_, what) in faults(layout={'start': 0.14}).items()
        if word == 'side-swapped'
    ]
    assert 'leaves the gantry 0.002 m out of square' in what
    assert '200 N' in what  # 1e5 N/m


def test_a_run_that_fails_without_a_fault_is_told_instead():
    found = faults(side={HS: [0.155, 0.165]})
    assert list(found) == [('y', 'gantry-run')]
    assert found['y', 'gantry-run'][0] is WARNING
    assert 'FollowerSwitchMissing' in found['y', 'gantry-run'][1]


@pytest.mark.parametrize(
    'layout, side',
    [({HS: None}, {HS: None}), ({}, {AHEAD: None}), ({'followers': []}, {})],
)
def test_a_layout_that_lacks_something_is_not_rehearsed(layout, side):
    checked, _ = built()
    places = {name: value for name, value in {**LAYOUT, **layout}.items() if value is not None}
    if places['followers']:
        places |= {f'y2.{name}': value for name, value in {**SIDE, **side}.items()}
    assert rehearsed(checked, layouts_from({'y': places}), Timing()) == []


@pytest.mark.parametrize('left, severity', [(0.0003, ERROR), (0.00005, INFO)])
def test_a_gantry_that_is_wrongly_taken_for_square_is_an_error(left, severity):
    homed = Outcome(Error.NoError)
    trial = FaultTrial('y.y2', Input.HOME_SWITCH, SideFault.dead, Course(outcome=homed), 3.0, left)
    assert finding_of('y', trial, 0.0001).severity is severity
    assert finding_of('y', trial, inf).severity is INFO
    failed = trial._replace(course=Course(outcome=homed._replace(error=Error.NotSquare)))
    assert finding_of('y', failed, 0.0001).severity is INFO


def test_the_command_prints_what_is_rehearsed(tmp_path, capsys):
    config, layout = tmp_path / 'axes.yaml', tmp_path / 'layout.yaml'
    parameters = {'axes': ['y'], 'y': LEADER}
    config.write_text(json.dumps({'homing_node': {'ros__parameters': parameters}}))
    layout.write_text(json.dumps({'y': {**LAYOUT, 'start': 0.14}, 'y.y2': SIDE}))
    assert main(['check', str(config), '--layout', str(layout), '--axis', 'y']) == 0
    printed = capsys.readouterr().out
    for word in ('racking', 'side-dead', 'side-stuck', 'side-swapped'):
        assert f'info: axis y.y2: {word}: ' in printed


# -- how far the sides rack -----------------------------------------------------------------------


@pytest.mark.parametrize('jammed', ['y', 'y.y2'])
@pytest.mark.parametrize(
    'velocity, jerk, ls_dec, delay, stiffness',
    [(0.02, 500.0, 8.0, 0.03, 0.0), (0.05, 40.0, 2.0, 0.01, 1e4), (0.2, 500.0, 8.0, 0.0, 1e5)],
)
def test_a_gantry_with_a_side_that_stands_racks_as_far_as_the_check_says(
    velocity, jerk, ls_dec, delay, stiffness, jammed
):
    values = {
        'homing_velocity_fast': velocity,
        'homing_velocity_fast_acc': 4.0,
        'max_jerk': jerk,
        'ls_dec': ls_dec,
    }
    checked, layouts = built(values, layout={'lag': 0.0}, side={'stiffness': stiffness})
    leader, followers, layout = checked.axes['y'], checked.followers['y'], layouts['y']
    made = GantryRehearsal('y', leader, followers, layout, Transport(250.0, 500.0, delay))
    link = made if jammed == 'y' else made.links[jammed]
    link.plant = Jammed(link.plant, at=0.12 if jammed == 'y' else 0.13)
    course = made.home()
    assert course.outcome.error is Error.SkewTooLarge
    timing = Timing(feedback_rate=500.0, latency=delay)
    gantry = Gantry('y', leader, followers, layout, timing)
    most = gantry.most_skew(velocity, layout.followers['y.y2'])
    assert 0.85 * most < course.largest_skew < most + 1e-9
    assert course.largest_force <= stiffness * (most + 1e-9)


class Jammed:
    """A side of a gantry that obeys no more from a position on."""

    def __init__(self, side, at):
        self._side, self._at = side, at

    def __getattr__(self, name):
        return getattr(self._side, name)

    def follow(self, position, over):
        if self._side.position < self._at:
            self._side.follow(position, over)
