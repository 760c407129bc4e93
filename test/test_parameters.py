# SPDX-License-Identifier: Apache-2.0
"""Parameters: their defaults, their bounds, and what is said of a bad one."""

import dataclasses
import math

import pytest
from core_rig import grouped
from hypothesis import given
from hypothesis import strategies as st

from homing_node.parameters.axis import DEFINITIONS, AxisParameters, axis_parameters, switch_inputs
from homing_node.parameters.definition import REQUIRED, InvalidParameters
from homing_node.procedures.motions import Pace, Way
from homing_node.procedures.states import (
    LIMIT_SWITCHES,
    Direction,
    HomeType,
    Input,
    LimitPair,
    LSType,
)
from homing_node.procedures.tables import PROCEDURES

LEAST = {'home_type': 'HS', 'travel': 0.4}


def built(**changes):
    return axis_parameters({**LEAST, **changes})


def faults(axis='', **changes):
    with pytest.raises(InvalidParameters) as caught:
        axis_parameters({**LEAST, **changes}, axis)
    return caught.value.faults


def fault(**changes):
    found = faults(**changes)
    assert len(found) == 1, found
    return found[0]


# -- the table of the specification -------------------------------------------------------------

DEFAULTS = {
    'joint': '',
    'unit': 'm',
    'home_type': REQUIRED,
    'home_direction': 'Positive',
    'travel': REQUIRED,
    'homing_velocity_fast': 0.05,
    'homing_velocity_fast_acc': 0.5,
    'homing_velocity_fast_dec': 0.5,
    'homing_velocity_slow': 0.005,
    'homing_velocity_slow_acc': 0.5,
    'homing_velocity_slow_dec': 0.5,
    'homing_reverse_distance': 0.0,
    'home_shift_velocity': 0.0,
    'home_shift_acc': 0.5,
    'home_shift_dec': 0.5,
    'home_shift_distance': 0.0,
    'home_position': 0.0,
    'max_jerk': 10.0,
    'invert_hs_polarity': False,
    'invert_positive_ls_polarity': False,
    'invert_negative_ls_polarity': False,
    'invert_near_positive_ls_polarity': False,
    'invert_near_negative_ls_polarity': False,
    'invert_external_positive_ls_polarity': False,
    'invert_external_negative_ls_polarity': False,
    'multiple_z_pulse': 0,
    'z_pulse_distance_check': 0.0,
    'z_pulse_distance_tolerance': 0.05,
    'max_z_pulse_distance': 0.0,
    'max_hs_on_at_start_reverse_distance': 0.0,
    'max_ls_reverse_distance': 0.0,
    'max_search_distance': 0.0,
    'timeout': 0.0,
    'immediate_stop_at_ls': False,
    'open_loop_homing': False,
    'pause_mode': False,
    'limit_reversal': True,
    'ls_type': 'Dec',
    'positive_ls_type': 'None',
    'negative_ls_type': 'None',
    'ls_dec': 1.0,
    'ls_slow_dec': 0.5,
    'all_ls_during_homing': False,
    'ls_direction': 'Normal',
    'near_ls_type': 'None',
    'near_positive_ls_type': 'None',
    'near_negative_ls_type': 'None',
    'external_ls_type': 'None',
    'external_positive_ls_type': 'None',
    'external_negative_ls_type': 'None',
    'mechanical_end_detection_pos_diff': 0.0,
    'mechanical_end_detection_time': 0.0,
    'mechanical_end_detection_ignore_ls': False,
    'mechanical_end_detection_first_torque_limit': 0.0,
    'mechanical_end_detection_second_torque_limit': 0.0,
    'switches': ('home_switch', 'positive_limit_switch', 'negative_limit_switch'),
    'switch_debounce': 0.0,
    'switch_timeout': 0.0,
    'switch_latency': 0.0,
    'feedback_timeout': 0.2,
    'following_error': 0.0,
    'wrong_direction_distance': 0.0,
    'edge_tolerance': 0.0,
    'clear_home_done_on_servo_off': True,
    'clear_home_done_on_comm_stop': True,
    'encoder': 'incremental',
    'encoder_turn': 0.0,
    'brake': False,
    'home_change_warn': 0.0,
    'home_change_limit': 0.0,
    'restore': 'never',
    'restore_tolerance': 1e-4,
    'rehome': False,
    'rehome_velocity': 0.0,
    'rehome_margin': 0.0,
    # beyond the table: accuracy
    'z_pulse_arm_delay': 0.0,
    'index_margin': 0.1,
    'index_margin_action': 'Warn',
    'repeat': 1,
    'repeat_tolerance': 0.0,
    'switch_stamp_error': 0.002,
    'feedback_clock': 'auto',
    'switch_clock': 'auto',
    'wrap': 0.0,
    'wrap_setpoints': False,
    'rest_timeout': 1.0,
    # the hand-over
    'apply': 'none',
    'apply_service': '',
    'apply_type': '',
    'apply_request': '',
    'apply_timeout': 2.0,
    'apply_tolerance': 0.0,
    'switch_controllers': (),
    'travel_min': 0.0,
    'travel_max': 0.0,
    # the gantry
    'followers': (),
    'max_skew': 0.0,
    'square_tolerance': 0.00005,
    'square': True,
    'switch_offset': 0.0,
    'gantry_homing_use_slave_hs': True,
    'gantry_homing_use_slave_ls': True,
    'gantry_homing_use_slave_z_pulse': True,
    'gantry_homing_use_slave_touch_probe': True,
    'gantry_homing_use_slave_mechanical_end': False,
    'gantry_homing_retain_sync_offset': False,
}
RATIOS = ('z_pulse_distance_tolerance', 'index_margin')
REALS = [name for name, definition in DEFINITIONS.items() if definition.kind is float]
SIGNED = (
    'home_shift_distance',
    'home_position',
    'travel_min',
    'travel_max',
    'switch_offset',
)
POSITIVE = [name for name in REALS if DEFINITIONS[name].least > 0.0]


def test_every_parameter_stands_in_the_table():
    assert set(DEFINITIONS) == set(DEFAULTS)


@grouped('name', DEFAULTS)
def test_default(name):
    assert DEFINITIONS[name].default == DEFAULTS[name]
    if DEFAULTS[name] is not REQUIRED:
        assert getattr(built(), name) == DEFAULTS[name]


@grouped('name', DEFINITIONS)
def test_every_parameter_is_explained(name):
    definition = DEFINITIONS[name]
    assert definition.name == name
    assert definition.text
    assert definition.kind is not float or definition.unit or name in RATIOS


@grouped('name', POSITIVE)
def test_what_must_be_positive(name):
    definition = DEFINITIONS[name]
    said = f' {definition.unit} must be >= {definition.minimum:g} and <= {definition.maximum:g}'
    assert fault(**{name: 0.0}) == f'{name}: 0.0{said} {definition.unit}'
    assert fault(**{name: -1.0}).startswith(f'{name}: -1.0')


def test_which_must_be_positive():
    assert set(POSITIVE) == {
        'travel',
        'max_jerk',
        'ls_dec',
        'ls_slow_dec',
        'feedback_timeout',
        'apply_timeout',
        'homing_velocity_fast',
        'homing_velocity_slow',
        *(name for name in REALS if name.endswith(('_acc', '_dec'))),
    }


@grouped('name', [n for n in REALS if n not in SIGNED and n not in POSITIVE])
def test_what_must_not_be_negative(name):
    assert getattr(built(**{name: 0}), name) == 0.0
    assert '>= ' in fault(**{name: -1e-9})


@grouped('name', REALS)
@pytest.mark.parametrize('value', [1e-300, 1e300])
def test_no_parameter_has_a_value_that_no_machine_has(name, value):
    definition = DEFINITIONS[name]
    if value < 1 and definition.minimum <= 0.0:
        return  # a position, a fraction: as good as 0
    found = fault(**{name: value})
    assert found.startswith(f'{name}: {value!r}')
    assert found.endswith(f'{definition.bounds} {definition.unit}'.rstrip())


def test_zero_stands_for_none_or_computed():
    assert fault(following_error=1e-300) == (
        'following_error: 1e-300 m must be 0 or >= 1e-09 and <= 100000 m'
    )
    assert built(following_error=0).following_error_limit > 0.0


def test_a_ramp_and_a_move_end():
    assert fault(homing_velocity_fast=0.2, homing_velocity_fast_dec=1e-4) == (
        'homing_velocity_fast_dec: with 0.0001 m/s^2 and max_jerk, 10 m/s^3, the ramp to 0.2 m/s '
        'takes 2e+03 s, it must be <= 1000 s'
    )
    assert fault(home_shift_velocity=1e-5, home_shift_distance=-0.1) == (
        'home_shift_distance: 0.1 m at 1e-05 m/s takes 1e+04 s, it must be <= 3600 s'
    )


def test_messages_of_a_rotary_axis_say_rad():
    assert fault(unit='rad', homing_velocity_slow=0.06) == (
        'homing_velocity_slow: 0.06 rad/s must be <= homing_velocity_fast, 0.05 rad/s'
    )
    assert fault(unit='rad', max_jerk=0) == (
        'max_jerk: 0.0 rad/s^3 must be >= 0.001 and <= 1e+09 rad/s^3'
    )
    assert fault(unit='rad', travel='long') == "travel: 'long' is not a number (rad)"
    assert fault(unit='deg') == "unit: 'deg' is none of m, rad"


@grouped('name', SIGNED)
def test_what_may_be_negative(name):
    low = {'travel_min': -0.2} if name == 'travel_max' else {}
    assert getattr(built(**{**low, name: -0.1}), name) == -0.1


def test_tolerance_is_relative():
    assert fault(z_pulse_distance_tolerance=1.5) == (
        'z_pulse_distance_tolerance: 1.5 must be >= 0 and <= 1'
    )


@grouped('name', REALS)
@pytest.mark.parametrize('value', [math.nan, math.inf, -math.inf], ids=str)
def test_reals_are_finite(name, value):
    found = fault(**{name: value})
    assert found.startswith(f'{name}: {value}')
    assert f'must be {DEFINITIONS[name].bounds}' in found


@grouped('name', REALS)
@pytest.mark.parametrize('value', [True, False, '0.1', None, [0.1]], ids=repr)
def test_reals_are_numbers(name, value):
    found = fault(**{name: value})
    assert found.startswith(f'{name}: {value!r} is not a number')
    assert not DEFINITIONS[name].unit or f'({DEFINITIONS[name].unit})' in found


@grouped('name', REALS)
def test_integers_are_accepted_for_reals(name):
    whole = 0 if DEFINITIONS[name].maximum < 1 else 1
    value = DEFINITIONS[name].convert(whole)
    assert value == whole
    assert isinstance(value, float)


@pytest.mark.parametrize('value', [1.0, 1.5, True, '1', -1, 2**62])
def test_a_count_is_a_whole_number(value):
    assert fault(multiple_z_pulse=value).startswith(f'multiple_z_pulse: {value!r}')
    assert built(multiple_z_pulse=3).multiple_z_pulse == 3


@pytest.mark.parametrize('value', [0, 1, 'true', 'False', None])
def test_a_flag_is_true_or_false(value):
    assert fault(pause_mode=value) == f'pause_mode: {value!r} is not true or false'


@pytest.mark.parametrize('value', [0, None, True])
def test_a_joint_is_a_string(value):
    assert fault(joint=value) == f'joint: {value!r} is not a string'


@pytest.mark.parametrize(
    ('name', 'value', 'meant'),
    [
        ('home_type', 'HSZpulse', 'HSZPulse'),
        ('home_type', 'hs', 'HS'),
        ('home_direction', 'positive', 'Positive'),
        ('ls_type', 'dec', 'Dec'),
        ('ls_direction', 'Reversed', 'Reverse'),
    ],
)
def test_a_misspelt_word_is_refused_with_what_may_be_meant(name, value, meant):
    found = fault(**{name: value})
    assert found.startswith(f'{name}: {value!r} is none of ')
    assert found.endswith(f'did you mean {meant!r}?')


@pytest.mark.parametrize('value', [None, 3.5, True, ''])
def test_a_word_is_a_string(value):
    assert fault(home_type=value).startswith(f'home_type: {value!r} is none of HS, HSZPulse')


@pytest.mark.parametrize(
    ('value', 'said'),
    [
        ('home_switch', "'home_switch' is not a list of inputs"),
        (3, '3 is not a list of inputs'),
        (['home_switch', 'home_swich'], "did you mean 'home_switch'?"),
        (['home_switch', 3], '3 is none of home_switch'),
        (['home_switch', ['x']], "['x'] is none of home_switch"),
        (['home_switch', 'home_switch'], 'an input is listed twice'),
    ],
)
def test_a_bad_list_of_switches(value, said):
    found = fault(switches=value)
    assert found.startswith('switches: ')
    assert said in found


@pytest.mark.parametrize(
    ('name', 'meant'),
    [('home_tpye', 'home_type'), ('max_jerc', 'max_jerk'), ('ls_types', 'ls_type')],
)
def test_an_unknown_name_is_refused_with_what_may_be_meant(name, meant):
    assert fault(**{name: 1}) == f'{name}: no such parameter; did you mean {meant!r}?'


def test_what_is_required():
    with pytest.raises(InvalidParameters) as caught:
        axis_parameters({})
    assert caught.value.faults == (
        'home_type: required, but not set (how the axis homes)',
        'travel: required, but not set (mechanical travel of the axis, m)',
    )


def test_all_faults_at_once_with_the_axis():
    found = faults('x', travel=-1, max_jerk='fast', pauze_mode=True, home_type='H')
    assert len(found) == 4
    assert all(one.startswith('x.') for one in found)
    with pytest.raises(InvalidParameters, match=r'x\.travel.*\nx\.max_jerk'):
        axis_parameters({'home_type': 'HS', 'travel': 0, 'max_jerk': 0}, 'x')


def test_parameters_cannot_be_changed():
    with pytest.raises(dataclasses.FrozenInstanceError):
        built().travel = 2.0


# -- what must agree ----------------------------------------------------------------------------

ALL = [str(i) for i in Input]
CROSS = [
    (
        {'homing_velocity_slow': 0.06},
        'homing_velocity_slow: 0.06 m/s must be <= homing_velocity_fast, 0.05 m/s',
    ),
    ({'homing_reverse_distance': 0.4}, 'homing_reverse_distance: 0.4 m must be < travel, 0.4 m'),
    ({'max_search_distance': 0.81}, 'max_search_distance: 0.81 m must be <= 2 x travel, 0.8 m'),
    (
        {'max_ls_reverse_distance': 0.45},
        'max_ls_reverse_distance: 0.45 m must be <= max_search_distance, 0.44 m',
    ),
    (
        {'max_hs_on_at_start_reverse_distance': 0.3, 'max_search_distance': 0.2},
        'max_hs_on_at_start_reverse_distance: 0.3 m must be <= max_search_distance, 0.2 m',
    ),
    ({'home_shift_distance': -0.5}, 'home_shift_distance: -0.5 m must be within +-travel, 0.4 m'),
    (
        {'repeat': 2},
        'repeat: 2 must be 1 for HS, which has no slow pass over a switch or probe '
        '(HSHS, HSTouchProbe, HSReverse, HSOffReverse, LSOff, NearLSOff, ExternalLSOff, LSLS, '
        'NearLSNearLS, ExternalLSExternalLS do)',
    ),
    (
        {'home_type': 'LS', 'home_shift_distance': 0.01},
        'home_shift_distance: 0.01 m must be <= 0 m for LS '
        '(it would move on into the limit switch)',
    ),
    (
        {
            'home_type': 'MechanicalEndDetection',
            'mechanical_end_detection_pos_diff': 0.001,
            'home_shift_distance': 0.01,
        },
        'home_shift_distance: 0.01 m must be <= 0 m for MechanicalEndDetection '
        '(it would move on into the mechanical end)',
    ),
    (
        {
            'home_type': 'ZPulse',
            'switches': ['z_pulse'],
            'max_z_pulse_distance': 0.01,
            'z_pulse_arm_delay': 0.01,
        },
        'max_z_pulse_distance: 0.01 m must be > z_pulse_arm_delay, 0.01 m (0: no such bound)',
    ),
    ({'switches': ['positive_limit_switch']}, 'switches: home_switch is missing; HS needs it'),
    ({'home_type': 'HSZPulse'}, 'switches: z_pulse is missing; HSZPulse needs it'),
    ({'home_type': 'TouchProbe'}, 'switches: touch_probe is missing; TouchProbe needs it'),
    (
        {'home_type': 'LS', 'switches': ['negative_limit_switch']},
        'switches: positive_limit_switch is missing; LS with home_direction Positive needs it',
    ),
    (
        {'home_type': 'LS', 'home_direction': 'Negative', 'switches': ['positive_limit_switch']},
        'switches: negative_limit_switch is missing; LS with home_direction Negative needs it',
    ),
    (
        {'home_type': 'LS', 'ls_direction': 'Reverse', 'switches': ['positive_limit_switch']},
        'switches: negative_limit_switch is missing; LS with home_direction Positive needs it',
    ),
    (
        {'home_type': 'NearLS', 'near_ls_type': 'Dec'},
        'switches: near_positive_limit_switch is missing; NearLS with home_direction Positive '
        'needs it',
    ),
    (
        {'home_type': 'NearLS', 'switches': ALL},
        'near_ls_type: near_positive_limit_switch is disabled (None); NearLS needs it',
    ),
    (
        {'home_type': 'ExternalLS', 'switches': ALL},
        'external_ls_type: external_positive_limit_switch is disabled (None); ExternalLS needs it',
    ),
    (
        {'home_type': 'MechanicalEndDetection'},
        'mechanical_end_detection_pos_diff: 0 m must be > 0 m to detect the mechanical end',
    ),
    (
        {
            'home_type': 'MechanicalEndDetectionLS',
            'mechanical_end_detection_pos_diff': 0.001,
            'switches': [],
        },
        'switches: positive_limit_switch is missing; MechanicalEndDetectionLS with home_direction '
        'Positive needs it',
    ),
    (
        {'ls_type': 'SeparatePositiveLSNegativeLS', 'positive_ls_type': 'Dec'},
        'negative_ls_type: required, but not set (ls_type is SeparatePositiveLSNegativeLS)',
    ),
    (
        {'near_positive_ls_type': 'SeparatePositiveLSNegativeLS'},
        'near_positive_ls_type: must be an action, not SeparatePositiveLSNegativeLS',
    ),
]


@pytest.mark.parametrize(('changes', 'said'), CROSS, ids=[said[:50] for _, said in CROSS])
def test_what_must_agree(changes, said):
    assert fault(**changes) == said


def test_all_cross_checks_are_reported_at_once():
    found = faults(
        homing_velocity_slow=1, homing_reverse_distance=1, switches=[], max_search_distance=1
    )
    assert len(found) == 4


def test_a_near_limit_of_one_side_may_be_disabled():
    built(
        home_type='NearLS',
        switches=ALL,
        near_ls_type='SeparatePositiveLSNegativeLS',
        near_positive_ls_type='Dec',
        near_negative_ls_type='None',
    )


@pytest.mark.parametrize('home_type', HomeType, ids=str)
@pytest.mark.parametrize('home_direction', ['Positive', 'Negative'])
def test_every_type_can_be_set_up(home_type, home_direction):
    made = built(
        home_type=str(home_type),
        home_direction=home_direction,
        switches=ALL,
        near_ls_type='Dec',
        external_ls_type='Dec',
        mechanical_end_detection_pos_diff=0.001,
    )
    assert made.procedure is PROCEDURES[home_type]
    assert made.run_timeout > made.search_distance / made.homing_velocity_fast * (
        home_type is not HomeType.CurrentPos
    )


# -- what follows from them ---------------------------------------------------------------------


def test_computed_bounds():
    made = built()
    assert made.search_distance == pytest.approx(0.44)
    assert made.following_error_limit == pytest.approx(0.0035)  # 0.05 s at 0.05 m/s and 1 mm
    assert made.following_error_at(-0.01) == pytest.approx(0.0015)
    assert made.settling_tolerance == 0.001
    assert built(travel=0.05).settling_tolerance == pytest.approx(0.0005)
    assert built(travel=3.0, unit='rad').settling_tolerance == pytest.approx(0.03)
    assert made.wrong_direction_limit == pytest.approx(0.004)
    assert made.edge_agreement == pytest.approx(0.00025)
    made = built(
        max_search_distance=0.3,
        following_error=0.1,
        wrong_direction_distance=0.2,
        edge_tolerance=0.3,
        timeout=7,
    )
    assert (
        made.search_distance,
        made.following_error_limit,
        made.wrong_direction_limit,
        made.edge_agreement,
        made.run_timeout,
    ) == (0.3, 0.1, 0.2, 0.3, 7.0)


def test_the_computed_timeout():
    """Every motion of HS twice, + 50 %: 3 searches, 2 reverse distances, a stop, the shift."""
    half = dict.fromkeys(
        (
            'homing_velocity_fast',
            'homing_velocity_fast_acc',
            'homing_velocity_fast_dec',
            'home_shift_velocity',
            'home_shift_acc',
            'home_shift_dec',
        ),
        0.5,
    )
    made = built(
        travel=1,
        max_search_distance=2,
        homing_reverse_distance=0.5,
        home_shift_distance=-0.5,
        max_jerk=1,
        **half,
    )
    ramps = 1 + 1 + 2 * 1  # of each: up, down, and twice the jerk of both
    needed = 3 * (4 + ramps) + 2 * (1 + ramps) + ramps + (3 + ramps)
    assert made.run_timeout == pytest.approx(1.5 * (2 * needed + 0.5))


def test_a_pass_more_is_every_motion_once_more():
    one, two, three = (built(home_type='HSHS', repeat=n).run_timeout for n in (1, 2, 3))
    assert two - one == pytest.approx(three - two)
    assert two - one == pytest.approx((one - 1.5 * 0.5) / 2)


def test_the_time_of_a_mechanical_end_is_part_of_the_timeout():
    end = {'home_type': 'MechanicalEndDetection', 'mechanical_end_detection_pos_diff': 0.001}
    more = built(**end, mechanical_end_detection_time=2).run_timeout - built(**end).run_timeout
    assert more == pytest.approx(1.5 * 2)


def test_paces():
    made = built(homing_velocity_fast_dec=0.7, home_shift_acc=0.2)
    assert made.pace(Pace.FAST) == (0.05, 0.5, 0.7)
    assert made.pace(Pace.SLOW) == (0.005, 0.5, 0.5)
    assert made.pace(Pace.SHIFT) == (0.05, 0.2, 0.5)
    assert built(homing_velocity_fast=0.005).pace(Pace.SHIFT)[0] == 0.005
    assert built(home_shift_velocity=0.2).pace(Pace.SHIFT)[0] == 0.2


@pytest.mark.parametrize(
    ('home', 'ls', 'ahead'),
    [
        ('Positive', 'Normal', 'positive'),
        ('Negative', 'Normal', 'negative'),
        ('Positive', 'Reverse', 'negative'),
        ('Negative', 'Reverse', 'positive'),
    ],
)
@pytest.mark.parametrize('pair', LimitPair, ids=str)
def test_which_input_is_ahead(home, ls, ahead, pair):
    made = built(home_direction=home, ls_direction=ls)
    behind = 'negative' if ahead == 'positive' else 'positive'
    assert f'{ahead}_limit_switch' in made.limit_switch(pair, Way.TOWARD)
    assert f'{behind}_limit_switch' in made.limit_switch(pair, Way.AWAY)


INVERSIONS = {
    'home_switch': 'invert_hs_polarity',
    **{
        str(i): f'invert_{i.value.removesuffix("_limit_switch")}_ls_polarity'
        for i in LIMIT_SWITCHES
    },
}


@pytest.mark.parametrize('switch', Input, ids=str)
def test_polarity(switch):
    assert not built().inverted(switch)
    for inverted, name in INVERSIONS.items():
        assert built(**{name: True}).inverted(switch) == (switch == inverted)


def test_wired_and_enabled_inputs():
    assert set(built(switches=ALL).inputs) == {
        i for i in Input if not i.value.startswith(('near_', 'external_'))
    }
    assert set(built(switches=ALL, near_ls_type='Dec', external_ls_type='SlowDec').inputs) == set(
        Input
    )
    assert switch_inputs(built(switches=ALL).inputs) == (
        Input.HOME_SWITCH,
        Input.POSITIVE_LIMIT_SWITCH,
        Input.NEGATIVE_LIMIT_SWITCH,
    )


def test_actions_of_a_pair():
    made = built(
        ls_type='SeparatePositiveLSNegativeLS',
        positive_ls_type='SlowDec',
        negative_ls_type='ServoOff',
    )
    assert made.ls_types(LimitPair.HARDWARE) == (LSType.SlowDec, LSType.ServoOff)
    assert built().ls_types(LimitPair.HARDWARE) == (LSType.Dec, LSType.Dec)
    assert built().ls_types(LimitPair.NEAR) == (LSType.none, LSType.none)


def test_direction_signs():
    assert (Direction.Positive.sign, Direction.Negative.sign) == (1.0, -1.0)


@given(
    st.dictionaries(
        st.sampled_from(sorted(DEFINITIONS)) | st.text(max_size=5),
        st.none()
        | st.booleans()
        | st.integers(-5, 5)
        | st.floats()
        | st.text(max_size=5)
        | st.lists(st.sampled_from(ALL) | st.integers(), max_size=3),
        max_size=8,
    )
)
def test_any_values_are_accepted_or_refused_with_faults(values):
    try:
        made = axis_parameters(values)
    except InvalidParameters as error:
        assert error.faults
        assert all(':' in one for one in error.faults)
    else:
        assert isinstance(made, AxisParameters)
        assert made.cross_check() == []
