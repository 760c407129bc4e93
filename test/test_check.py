# SPDX-License-Identifier: Apache-2.0
"""Every finding: a configuration and a layout that have it, and that the good one has not."""

import re
from dataclasses import dataclass, field, replace
from math import inf, isfinite, nan
from typing import Any

import pytest
from core_rig import thinned
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.check import Severity, check, check_axis, errors
from homing_node.check.finding import down, up
from homing_node.check.overruns import Overruns
from homing_node.check.rehearsed_time import too_short
from homing_node.check.run_bounds import RunBounds
from homing_node.check.stopping import stopping_distance
from homing_node.parameters.axis import DEFINITIONS, axis_parameters
from homing_node.parameters.configuration import configuration
from homing_node.plant.geometry import Geometry, true_home
from homing_node.plant.layout import AxisLayout, SwitchLayout, mirrored
from homing_node.plant.timing import Timing
from homing_node.procedures.motions import Way
from homing_node.procedures.states import HomeType, Input
from homing_node.rehearsal.examples import EXAMPLES
from homing_node.rehearsal.sweep import rehearse_from, transport_of

ERROR, WARNING, INFO = Severity.error, Severity.warning, Severity.info
HS, AHEAD, BEHIND = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'
NEAR = 'near_positive_limit_switch'

VALUES = {
    'home_type': 'HSHS',
    'travel': 0.2,
    'homing_velocity_fast': 0.05,
    'homing_velocity_fast_acc': 0.5,
    'homing_velocity_fast_dec': 0.5,
    'homing_velocity_slow': 0.005,
    'homing_reverse_distance': 0.002,
    'max_jerk': 100.0,
}
FLAGS = {
    HS: SwitchLayout(0.15, 0.16, 0.0001),
    AHEAD: SwitchLayout(0.185, inf),
    BEHIND: SwitchLayout(-inf, 0.01),
}
LAYOUT = AxisLayout((0.0, 0.2), FLAGS, index_pitch=0.01, index_offset=0.004, lag=0.005, start=0.1)
CONFIGURATION = configuration({'axes': ['x'], **{f'x.{k}': v for k, v in VALUES.items()}})
BOTH = [AHEAD, BEHIND]
Z = [HS, AHEAD, BEHIND, 'z_pulse']
PROBE = [HS, AHEAD, BEHIND, 'touch_probe']
END = {
    'home_type': 'MechanicalEndDetection',
    'mechanical_end_detection_pos_diff': 0.002,
    'mechanical_end_detection_first_torque_limit': 30.0,
    'switches': [BEHIND],
}
#: The external limit switch is the reference; the one behind it switches the servo off.
SERVO_OFF = {
    'home_type': 'ExternalLS',
    'external_ls_type': 'Dec',
    'ls_type': 'ServoOff',
    'switches': [*BOTH, 'external_positive_limit_switch'],
}
SERVO_OFF_FLAGS = {'external_positive_limit_switch': SwitchLayout(0.184, inf)}


@dataclass
class Case:
    """What is changed in the good axis, and the one finding that it must have then.

    ``flags`` replaces flags (None: not fitted), ``layout`` other fields; False: no layout at all.
    """

    check: str
    severity: Severity
    values: dict[str, Any] = field(default_factory=dict)
    flags: dict[str, SwitchLayout | None] = field(default_factory=dict)
    layout: dict[str, Any] | bool = field(default_factory=dict)
    timing: Timing = field(default_factory=Timing)
    right: Any = None
    words: str = ''

    def built(self, direction=1):
        """Return the parameters and the layout."""
        values = {**VALUES, **self.values}
        parameters = axis_parameters(values)
        if self.layout is False:
            return parameters, None
        assert isinstance(self.layout, dict)
        flags = {name: flag for name, flag in {**FLAGS, **self.flags}.items() if flag}
        layout = LAYOUT._replace(switches=flags, **self.layout)
        if direction < 0:
            parameters = axis_parameters({**mirrored_values(values), 'home_direction': 'Negative'})
            layout = mirrored(layout)
        return parameters, layout

    def found(self, direction=1):
        return check_axis('x', *self.built(direction), self.timing)


def mirrored_values(values):
    def other(text):
        if 'positive' in text:
            return text.replace('positive', 'negative')
        return text.replace('negative', 'positive')

    changed = {other(name): value for name, value in values.items()}
    if 'switches' in changed:
        changed['switches'] = [other(name) for name in changed['switches']]
    return changed


WITHOUT = [  # no layout is needed
    Case('wired-unused', INFO, {'home_type': 'LS'}, right='without home_switch'),
    Case('wired-unused', INFO, {'switches': Z}, right='without z_pulse'),
    Case('limit-disabled', WARNING, {'switches': [HS, *BOTH, NEAR]}, right='Dec'),
    Case('limit-not-wired', WARNING, {'near_ls_type': 'Dec'}),
    Case(
        'end-unguarded',
        INFO,
        {'switches': [HS, BEHIND]},
        layout=False,
        right=f'with {AHEAD}',
        words='ahead',
    ),
    Case(
        'end-unguarded',
        INFO,
        {'switches': [HS, AHEAD]},
        layout=False,
        right=f'with {BEHIND}',
        words='behind',
    ),
    Case('limit-without-action', WARNING, {'ls_type': 'None'}, layout=False, words='behind'),
    Case(
        'limit-without-action',
        WARNING,
        {'ls_type': 'None', 'home_type': 'TouchProbe', 'switches': PROBE},
        layout=False,
        words='ahead',
    ),
    Case(
        'stop-longer-than-travel', ERROR, {'homing_velocity_fast': 0.6}, layout=False, right=0.44
    ),
    Case(
        'stop-longer-than-travel',
        ERROR,
        {'homing_velocity_fast': 60},
        words='in mm/s?',
        right=0.11,
    ),
    Case('jerk-decides', INFO, {'max_jerk': 4.0}, words='ls_dec', right=20.0),
    Case(
        'parameter-unused', INFO, {'home_type': 'HS', 'homing_velocity_slow': 0.002}, right=0.005
    ),
    Case('travel', WARNING, {'travel': 800}, layout=False, words='in mm?', right=0.8),
    Case('soft-ls-dec', WARNING, {'ls_dec': 0.4}, right=0.5),
    Case('hard-ls-slow-dec', WARNING, {'ls_slow_dec': 1.5}, right=1.0),
    Case('search-bound', WARNING, {'max_search_distance': 0.15}, layout=False, right=0.22),
    Case('ls-reverse-bound', WARNING, {'max_ls_reverse_distance': 0.002}, layout=False, right=0.2),
    Case('timeout', WARNING, {'timeout': 3.9}, layout=False, right=0.0),
    Case('parameter-unused', INFO, {'multiple_z_pulse': 2}, words='uses no Z-pulse'),
    Case(
        'parameter-unused',
        INFO,
        {'home_type': 'HSZPulse', 'switches': Z, 'z_pulse_distance_check': 0.01},
        words='only one',
    ),
    Case(
        'z-pulse-bound',
        ERROR,
        {
            'home_type': 'HSZPulse',
            'switches': Z,
            'z_pulse_distance_check': 0.02,
            'multiple_z_pulse': 2,
            'max_z_pulse_distance': 0.015,
        },
        layout=False,
        right=0.024,
    ),
    Case(
        'z-pulse-count',
        ERROR,
        {
            'home_type': 'HSZPulse',
            'switches': Z,
            'z_pulse_distance_check': 0.02,
            'multiple_z_pulse': 30,
        },
        layout=False,
        right=12.0,
    ),
    Case('end-following-error', ERROR, {**END, 'mechanical_end_detection_time': 6.0}, right=0.039),
    Case('end-torque', WARNING, {**END, 'mechanical_end_detection_first_torque_limit': 0.0}),
    Case('end-behind-limit', WARNING, {**END, 'switches': BOTH}, layout=False, right=True),
    Case(
        'feedback-timeout',
        ERROR,
        {'feedback_timeout': 0.01},
        timing=Timing(feedback_rate=100.0),
        right=0.05,
    ),
    Case(
        'feedback-timeout',
        WARNING,
        {'feedback_timeout': 0.015},
        timing=Timing(feedback_rate=100.0),
        right=0.05,
    ),
    Case('accuracy', WARNING, timing=Timing(feedback_rate=100.0, accuracy=1e-6), right=0.0005),
    Case('second-pass-fast', INFO, {'homing_velocity_slow': 0.05}, right=0.005),
    Case(
        'run-up',
        WARNING,
        {'homing_velocity_slow': 0.05, 'homing_velocity_slow_acc': 0.3},
        right=0.0042,
    ),
]

WITH = [
    Case('hard-stop', WARNING, layout={'switch_rate': 5.0}, words='goes on by 0.0122 m'),
    Case(
        'index-margin',
        WARNING,
        {'home_type': 'HSZPulse', 'switches': Z},
        layout={'switch_rate': 5.0},
        words='read 5 times a second',
    ),
    Case('accuracy', INFO, layout={'switch_rate': 0.0}, words='within 1e-05 m'),
    Case('accuracy', INFO, layout={'switch_rate': 50.0}, words='within 6e-05 m'),
    Case('accuracy', WARNING, layout={'switch_rate': 5.0}, words='0.00051 m', right=0.00098),
    Case('fitted-unwired', WARNING, {'switches': [HS, AHEAD]}, right=f'with {BEHIND}'),
    Case('fitted-unwired', INFO, right='with z_pulse'),
    Case('place-unknown', INFO, flags={BEHIND: None}, words=BEHIND),
    Case('place-unknown', WARNING, flags={HS: None}, words=HS),
    Case(
        'place-unknown',
        WARNING,
        {'home_type': 'HSZPulse', 'switches': Z},
        layout={'index_pitch': 0.0},
        words='z_pulse',
    ),
    Case('polarity', ERROR, flags={HS: SwitchLayout(0.15, 0.16, 0.0, True)}, right=True),
    Case('polarity', ERROR, {'invert_positive_ls_polarity': True}, right=False),
    Case('travel', WARNING, {'travel': 0.3}, right=0.2),
    Case('limits-swapped', ERROR, {'ls_direction': 'Reverse'}, right='Normal'),
    Case(
        'limits-swapped',
        ERROR,
        flags={AHEAD: SwitchLayout(-inf, 0.01), BEHIND: SwitchLayout(0.185, inf)},
        right='Reverse',
    ),
    Case(
        'limits-swapped',
        ERROR,
        {'switches': [HS, AHEAD]},
        flags={AHEAD: SwitchLayout(-inf, 0.01)},
        right='Reverse',
    ),
    Case('limits-overlap', ERROR, flags={BEHIND: SwitchLayout(-inf, 0.19)}),
    Case('limit-beyond-stop', ERROR, flags={AHEAD: SwitchLayout(0.21, inf)}),
    Case('limit-momentary', WARNING, flags={AHEAD: SwitchLayout(0.185, 0.197)}, right=0.2),
    Case('home-switch-place', ERROR, flags={HS: SwitchLayout(0.186, 0.19)}, words='ahead'),
    Case('home-switch-place', ERROR, flags={HS: SwitchLayout(0.005, 0.02)}, words='behind'),
    Case(
        'home-switch-place',
        ERROR,
        {'home_type': 'HSOff'},
        flags={HS: SwitchLayout(0.17, 0.185)},
        words='ahead',
    ),
    Case(
        'home-switch-place',
        ERROR,
        {**END, 'home_type': 'MechanicalEndDetectionHS', 'switches': [HS, BEHIND]},
        flags={HS: SwitchLayout(0.21, 0.22), AHEAD: None},
        words='hard stop ahead',
    ),
    Case('direction', INFO, flags={HS: SwitchLayout(0.05, 0.06)}, right='Negative'),
    Case('direction', WARNING, flags={HS: SwitchLayout(0.015, 0.02)}, right='Negative'),
    Case('shift-into-stop', ERROR, {'home_shift_distance': 0.06}, right=0.047),
    Case('shift-into-limit', ERROR, {'home_shift_distance': 0.04}, right=0.033, words=AHEAD),
    Case('shift-into-limit', ERROR, {'home_shift_distance': -0.145}, right=-0.13, words=BEHIND),
    Case(
        'shift-into-limit',
        ERROR,
        {'home_type': 'TouchProbe', 'switches': [*BOTH, 'touch_probe']},
        flags={BEHIND: SwitchLayout(-inf, 0.03)},
        layout={'touch_probe': 0.02},
        right=0.011,
        words=BEHIND,
    ),
    Case(
        'shift-into-limit',
        WARNING,
        {'home_shift_distance': 0.035},
        right=0.033,
        words='0 m beyond',
    ),
    Case(
        'shift-from-anywhere',
        WARNING,
        {'home_type': 'CurrentPos', 'switches': BOTH, 'home_shift_distance': -0.05},
        words=BEHIND,
    ),
    Case(
        'shift-from-anywhere',
        WARNING,
        {'home_type': 'ZPulse', 'switches': [*BOTH, 'z_pulse'], 'home_shift_distance': 0.02},
        words=AHEAD,
    ),
    Case(
        'hard-stop',
        ERROR,
        {
            'home_type': 'CurrentPos',
            'switches': BOTH,
            'home_shift_distance': -0.05,
            'home_shift_velocity': 0.2,
            'max_jerk': 10.0,
        },
        words='behind',
    ),
    Case(
        'end-unguarded',
        ERROR,
        {'home_type': 'CurrentPos', 'switches': [BEHIND], 'home_shift_distance': 0.05},
        flags={AHEAD: None},
        right=f'with {AHEAD}',
    ),
    Case(
        'home-switch-place',
        ERROR,
        {**END, 'home_type': 'MechanicalEndDetectionHS', 'switches': [HS, BEHIND]},
        flags={HS: SwitchLayout(0.005, 0.009), AHEAD: None},
        words='limit switch behind',
    ),
    Case('hard-stop', ERROR, {'homing_velocity_fast': 0.15}, right=0.11, words='ahead'),
    Case(
        'hard-stop',
        WARNING,
        {'ls_dec': 0.1, 'homing_velocity_fast_dec': 0.1},
        words='misses its switch',
    ),
    Case(
        'hard-stop',
        ERROR,
        {'switches': [HS, AHEAD], 'homing_velocity_fast': 0.1, 'homing_velocity_fast_acc': 0.3},
        flags={HS: SwitchLayout(0.015, 0.025), BEHIND: None},
        words='behind',
    ),
    Case(
        'next-tier',
        WARNING,
        {**SERVO_OFF, 'homing_velocity_fast_dec': 0.05},
        flags=SERVO_OFF_FLAGS,
        words='it then brakes with ls_dec',
    ),
    Case(
        'next-tier',
        WARNING,
        {
            'home_type': 'TouchProbe',
            'switches': [*BOTH, NEAR, 'touch_probe'],
            'near_ls_type': 'SlowDec',
            'ls_type': 'ServoOff',
            'homing_velocity_slow': 0.05,
        },
        flags={NEAR: SwitchLayout(0.184, inf)},
        layout={'touch_probe': 0.1},
        words='that one switches the servo off',
    ),
    Case(
        'hard-stop',
        ERROR,
        {
            'home_type': 'TouchProbe',
            'switches': [*BOTH, 'touch_probe'],
            'ls_dec': 0.05,
            'homing_velocity_slow': 0.05,
            'homing_velocity_slow_dec': 0.05,
        },
        flags={HS: None},
        layout={'touch_probe': 0.184},
        words='after the touch probe',
    ),
    Case(
        'hard-stop',
        ERROR,
        {'switches': [HS, BEHIND]},
        flags={AHEAD: None, HS: SwitchLayout(0.199, 0.21)},
        words='home switch rises',
    ),
    Case(
        'end-unguarded',
        ERROR,
        {'switches': [HS, BEHIND]},
        flags={AHEAD: None},
        right=f'with {AHEAD}',
    ),
    Case(
        'end-unguarded',
        ERROR,
        {'home_type': 'ZPulse', 'switches': ['z_pulse']},
        flags={AHEAD: None, BEHIND: None},
        words='ahead',
    ),
    Case(
        'end-unguarded',
        WARNING,
        {'switches': [HS, BEHIND]},
        flags={AHEAD: None, HS: SwitchLayout(0.15, inf)},
        words='ahead',
    ),
    Case('end-unguarded', WARNING, {'ls_type': 'None'}, right='Dec', words='behind'),
    Case('quick-way', WARNING, {'rehome': True, 'rehome_velocity': 0.25}, words='ahead'),
    Case('coasting', WARNING, {'ls_type': 'ServoOff'}, right='DecServoOff', words=BEHIND),
    Case(
        'next-tier',
        WARNING,
        {'home_type': 'NearLS', 'switches': [*BOTH, NEAR], 'near_ls_type': 'Dec'},
        flags={NEAR: SwitchLayout(0.183, inf)},
        words=AHEAD,
    ),
    Case('next-tier', WARNING, flags={HS: SwitchLayout(0.183, 0.184)}, words='home switch rises'),
    Case('reverse-into-limit', ERROR, {'homing_reverse_distance': 0.15}, right=0.13),
    Case(
        'reverse-into-limit',
        ERROR,
        {'homing_velocity_fast': 0.09},
        flags={HS: SwitchLayout(0.015, 0.06)},
        words='home switch falls',
    ),
    Case(
        'reverse-into-limit',
        ERROR,
        {
            'homing_velocity_fast': 0.09,
            'homing_velocity_fast_acc': 0.3,
            'homing_velocity_fast_dec': 1.0,
        },
        flags={HS: SwitchLayout(0.02, 0.06)},
        words='home switch falls',
    ),
    Case(
        'reverse-into-limit',
        ERROR,
        {'home_type': 'HSReverseZPulse', 'switches': Z, 'homing_velocity_slow': 0.05},
        layout={'index_offset': 0.001},
        flags={BEHIND: SwitchLayout(-inf, 0.1405)},
        words='after the Z-pulse',
    ),
    Case('end-behind-limit', ERROR, {**END, 'switches': BOTH}, right=True),
    Case(
        'flag-debounce',
        ERROR,
        {'switch_debounce': 0.01},
        flags={HS: SwitchLayout(0.15, 0.1503)},
        right=0.003,
    ),
    Case(
        'flag-debounce',
        ERROR,
        {'switch_debounce': 0.01},
        flags={AHEAD: SwitchLayout(0.185, 0.1853)},
        words=AHEAD,
    ),
    Case(
        'flag-bounce',
        ERROR,
        {'home_type': 'HSOff'},
        flags={HS: SwitchLayout(0.15, 0.1502)},
        words='5 ms x homing_velocity_fast',
    ),
    Case('flag-narrow', INFO, flags={HS: SwitchLayout(0.15, 0.152)}),
    Case('ls-reverse-bound', ERROR, {'max_ls_reverse_distance': 0.036}, right=0.053),
    Case('ls-reverse-bound', WARNING, {'max_ls_reverse_distance': 0.045}, right=0.053),
    Case(
        'ls-reverse-bound',
        WARNING,
        {'home_type': 'LS', 'max_ls_reverse_distance': 0.01},
        right=0.016,
    ),
    Case(
        'ls-reverse-bound',
        ERROR,
        {'home_type': 'LSOff', 'switches': BOTH, 'max_ls_reverse_distance': 0.002},
        right=0.016,
        words='every run',
    ),
    Case('hs-reverse-bound', ERROR, {'max_hs_on_at_start_reverse_distance': 0.01}, right=0.011),
    Case('reversal-off', WARNING, {'limit_reversal': False}, right=True, words='0.025 m'),
    Case('search-bound', ERROR, {'max_search_distance': 0.13}, right=0.16),
    Case('search-bound', WARNING, {'max_search_distance': 0.145}, right=0.16),
    Case(
        'search-bound',
        ERROR,
        {'max_search_distance': 0.12},
        flags={HS: SwitchLayout(0.03, 0.04)},
        right=0.16,
        words='from beyond the home switch',
    ),
    Case(
        'search-bound',
        WARNING,
        {**END, 'max_search_distance': 0.201},
        right=0.22,
        words='0.202 m',
    ),
    Case('timeout', ERROR, {'timeout': 2.7}, right=0.0, words='the far end'),
    Case(
        'timeout',
        ERROR,
        {
            'timeout': 3.1,
            'homing_velocity_slow': 0.004,
            'home_shift_distance': -0.01,
            'home_shift_velocity': 0.02,
        },
        right=0.0,
    ),
    Case(
        'timeout',
        ERROR,
        {'timeout': 1.0},
        flags={HS: SwitchLayout(0.02, 0.03)},
        words='beyond the home switch',
    ),
    Case('timeout', ERROR, {'timeout': 3.5, 'repeat': 3}),
    Case(
        'timeout',
        ERROR,
        {
            'home_type': 'LSReverseZPulse',
            'switches': [*BOTH, 'z_pulse'],
            'timeout': 3.6,
            'homing_velocity_slow': 0.001,
        },
    ),
    Case(
        'flag-debounce',
        WARNING,
        {'switch_debounce': 0.01},
        flags={BEHIND: SwitchLayout(0.0097, 0.01)},
        words=BEHIND,
    ),
    Case(
        'z-pulse-check',
        ERROR,
        {
            'home_type': 'HSZPulse',
            'switches': Z,
            'z_pulse_distance_check': 0.02,
            'multiple_z_pulse': 2,
        },
        right=0.01,
    ),
    Case(
        'z-pulse-bound',
        ERROR,
        {'home_type': 'HSZPulse', 'switches': Z, 'max_z_pulse_distance': 0.003},
        right=0.012,
    ),
    Case(
        'z-pulse-bound',
        WARNING,
        {'home_type': 'HSZPulse', 'switches': Z, 'max_z_pulse_distance': 0.009},
        right=0.012,
    ),
    Case(  # the first pulse comes soon enough, the second does not
        'z-pulse-bound',
        ERROR,
        {
            'home_type': 'HSZPulse',
            'switches': Z,
            'multiple_z_pulse': 2,
            'max_z_pulse_distance': 0.009,
        },
        right=0.012,
    ),
    Case('index-ambiguous', WARNING, {'home_type': 'ZPulse', 'switches': [*BOTH, 'z_pulse']}),
    Case(
        'index-margin',
        WARNING,
        {'home_type': 'HSZPulse', 'switches': Z},
        layout={'index_offset': 0.0005},
        right=0.0055,
        words='by 0.0045 m toward negative',
    ),
    Case(
        'index-margin',
        WARNING,
        {'home_type': 'HSReverseZPulse', 'switches': Z},
        layout={'index_offset': 0.0003},
        right=0.0046,
        words='by 0.0046 m toward negative',
    ),
    Case(
        'index-margin',
        ERROR,
        {'home_type': 'HSZPulse', 'switches': Z, 'index_margin_action': 'Fail'},
        layout={'index_offset': 0.0005},
    ),
    Case(
        'index-margin',
        WARNING,
        {
            **END,
            'home_type': 'MechanicalEndDetectionReverseZPulse',
            'index_margin_action': 'Fail',
            'switches': [BEHIND, 'z_pulse'],
        },
        flags={AHEAD: None},
        layout={'index_offset': 0.0095},
    ),
    Case(
        'index-margin',
        INFO,
        {'home_type': 'HSZPulse', 'switches': Z, 'index_margin_action': 'None'},
        layout={'index_offset': 0.0005},
    ),
    Case(
        'index-margin',
        WARNING,
        {'home_type': 'HSZPulse', 'switches': Z, 'z_pulse_arm_delay': 0.0038},
        right=0.009,
    ),
    Case('drive-timeout', WARNING, layout={'command_timeout': 0.01}, right=0.012),
    Case(
        'index-unreachable',
        ERROR,
        {'home_type': 'HSZPulse', 'switches': Z, 'multiple_z_pulse': 5},
        words='pulse 5',
    ),
    Case(
        'index-unreachable',
        ERROR,
        {'home_type': 'HSOffZPulse', 'switches': [HS, BEHIND, 'z_pulse']},
        flags={AHEAD: None},
        layout={'index_pitch': 0.1},
        words='hard stop',
    ),
    Case(
        'probe-passed',
        WARNING,
        {'home_type': 'TouchProbe', 'switches': PROBE},
        layout={'touch_probe': 0.1},
        right='HSTouchProbe',
    ),
    Case(
        'probe-passed',
        WARNING,
        {'home_type': 'TouchProbe', 'switches': [*BOTH, 'touch_probe']},
        layout={'touch_probe': 0.1},
    ),
    Case(
        'end-unguarded',
        ERROR,
        {'home_type': 'TouchProbe', 'switches': ['touch_probe']},
        flags={AHEAD: None, BEHIND: None},
        layout={'touch_probe': 0.05},
        words='ahead',
    ),
    Case(
        'probe-unreachable',
        ERROR,
        {'home_type': 'TouchProbe', 'switches': PROBE},
        layout={'touch_probe': 0.19},
    ),
    Case(
        'probe-unreachable',
        ERROR,
        {'home_type': 'HSTouchProbe', 'switches': PROBE},
        layout={'touch_probe': 0.145},
        right=0.0054,
    ),
    Case(
        'probe-unreachable',
        WARNING,
        {'home_type': 'HSTouchProbe', 'switches': PROBE, 'homing_reverse_distance': 0.0},
        layout={'touch_probe': 0.1485},
        right=0.0016,
    ),
    Case(
        'repeat-off-switch',
        ERROR,
        {
            'home_type': 'HSTouchProbe',
            'switches': PROBE,
            'homing_reverse_distance': 0.01,
            'repeat': 2,
        },
        layout={'touch_probe': 0.147},
        right=1.0,
    ),
    Case(
        'repeat-off-switch',
        WARNING,
        {'home_type': 'HSTouchProbe', 'switches': PROBE, 'repeat': 2},
        layout={'touch_probe': 0.14992},
        right=1.0,
    ),
    Case('following-error', ERROR, {'following_error': 0.00004}),
    Case('following-error', WARNING, {'following_error': 0.0004}),
    Case('wrong-direction', WARNING, {'wrong_direction_distance': 0.0002}, right=0.0005),
    Case('open-loop', WARNING, {'open_loop_homing': True}, right=False),
    Case(
        'end-too-early',
        ERROR,
        {**END, 'mechanical_end_detection_pos_diff': 0.00002},
        flags={AHEAD: None},
    ),
    Case(
        'end-too-early',
        WARNING,
        {**END, 'mechanical_end_detection_pos_diff': 0.0001},
        flags={AHEAD: None},
    ),
]


def matching(case, found):
    return [one for one in found if one.check == case.check and case.words in one.text]


@pytest.mark.parametrize(
    'case',
    [
        pytest.param(case, id=f'{case.check}-{case.severity}-{n}')
        for n, case in enumerate(WITHOUT + WITH)
    ],
)
def test_finding(case):
    found = matching(case, case.found())
    assert found, [one.text for one in case.found()]
    severities = list(Severity)
    worst = min(found, key=lambda one: severities.index(one.severity))
    assert worst.severity is case.severity, worst.text
    assert worst.what and worst.why and worst.text.startswith('axis x: ')
    if case.right is not None:
        assert (
            pytest.approx(case.right) == worst.right
            if isinstance(case.right, float)
            else case.right in [one.right for one in found]
        )


@pytest.mark.parametrize(
    'case',
    [
        pytest.param(case, id=f'{case.check}-{case.severity}-{n}')
        for n, case in enumerate(WITH)
        if 'ls_direction' not in case.values
    ],
)
def test_finding_in_the_mirror(case):
    ahead = [
        (one.severity, one.check, one.value if isinstance(one.value, float) else None)
        for one in case.found()
    ]
    mirror = [
        (one.severity, one.check, one.value if isinstance(one.value, float) else None)
        for one in case.found(-1)
    ]
    assert [each[:2] for each in ahead] == [each[:2] for each in mirror]
    for (_, name, value), (_, _, other) in zip(ahead, mirror, strict=True):
        if value is not None and name not in (
            'limit-beyond-stop',
            'home-switch-place',
            'probe-unreachable',
            'shift-into-limit',
        ):
            assert other == pytest.approx(value, abs=1e-9), name


@pytest.mark.parametrize('home_type', ['LSOff', 'LSLS'])
def test_the_edge_of_a_limit_is_no_place_for_a_shift_away_from_it(home_type):
    """A run rests at the edge that is its home, with the limit on or off."""
    case = Case('shift-into-limit', WARNING, {'home_type': home_type, 'switches': BOTH})
    assert matching(case, case.found()) == []


@pytest.mark.parametrize(('timeout', 'late'), [(5.2, True), (7.5, False)])
def test_a_timeout_is_rehearsed_where_it_cannot_be_computed(timeout, late):
    """The overrun of the fast pass, taken slowly, is the greatest part of the run."""
    p, layout = Case('timeout', ERROR, {'homing_velocity_slow': 0.001}).built()
    axes = CONFIGURATION._replace(axes={'x': replace(p, timeout=timeout)})
    assert 'timeout' not in {one.check for one in check(axes, {'x': layout})}
    found = [*too_short(axes, {'x': layout}, [])]
    assert [one.check for one in found] == ['timeout'] * late
    if late:
        assert 'from the far end' in found[0].text
        assert [*too_short(axes, {'x': layout}, found)] == []


def test_the_hysteresis_is_part_of_the_run_up():
    """The second pass begins behind the edge where the switch falls."""
    values = {'homing_velocity_slow': 0.05, 'homing_velocity_slow_acc': 0.3}
    narrow = Case('run-up', WARNING, values, {HS: SwitchLayout(0.15, 0.16)})
    wide = replace(narrow, flags={HS: SwitchLayout(0.15, 0.16, 0.003)})
    (found,) = matching(narrow, narrow.found())
    assert 'begins 0.00263 m before' in found.text
    assert not matching(wide, wide.found())


def test_an_absurd_velocity_is_one_finding():
    for layout in ({}, False):
        case = Case('', ERROR, {'homing_velocity_fast': 60}, layout=layout)
        found = [one.check for one in case.found() if one.severity is not INFO]
        assert found == ['stop-longer-than-travel']


def test_swapped_limits_are_one_finding():
    case = Case('', ERROR, {'ls_direction': 'Reverse'})
    assert [one.check for one in case.found()] == ['limits-swapped', 'fitted-unwired']


def test_the_default_jerk_is_told_once():
    for values in ({'max_jerk': 10.0}, {'max_jerk': 10.0, 'homing_velocity_fast': 0.02}):
        found = Case('', INFO, values, layout=False).found()
        assert [one.check for one in found] == ['jerk-decides']


def test_findings_of_a_rotary_axis_say_rad():
    case = Case('', ERROR, {'unit': 'rad', 'homing_velocity_fast': 0.3, 'max_jerk': 4.0})
    found = [one for one in case.found() if one.check != 'fitted-unwired']
    assert found
    for one in found:
        assert not re.search(r'\dm?\d* m\b', one.text) and ' m/s' not in one.text, one.text
        assert not one.unit.startswith('m')
    assert any(one.text.endswith(' rad/s') for one in found)


def test_a_topic_of_an_input_that_is_not_wired():
    axis = {f'x.{name}': value for name, value in VALUES.items()}
    wired = {**axis, 'x.switches': [HS, *BOTH], f'x.topics.{HS}': '/hs'}
    assert check(configuration({'axes': ['x'], **wired})) == []
    (one,) = check(configuration({'axes': ['x'], **wired, 'x.topics.z_pulse': '/z'}))
    assert (one.severity, one.check, one.remedy) == (
        WARNING,
        'topic-unread',
        'switches: with z_pulse',
    )
    assert '/z' in one.what
    typed = {**axis, 'x.switches': [HS, *BOTH], 'x.types.touch_probe': 'std_msgs/Float64'}
    assert 'types.touch_probe is std_msgs/msg/Float64' in check_values(typed)[0].what


def check_values(values):
    return check(configuration({'axes': ['x'], **values}))


def test_what_is_written_for_inputs():
    """A latch that has no counter, and a bit that two inputs read."""
    base = {f'x.{name}': value for name, value in VALUES.items()}
    base['x.switches'] = [HS, *BOTH]
    index = {
        **base,
        'x.home_type': 'HSZPulse',
        'x.switches': [HS, *BOTH, 'z_pulse'],
        'x.topics.z_pulse': '/g#i/position',
    }
    (found,) = [one for one in check_values(index) if one.check == 'latch-without-counter']
    assert (found.severity, found.parameter) == (WARNING, 'topics.z_pulse')
    for good in ('/g#i/position @ i/count', '/z'):
        assert not [
            one
            for one in check_values({**index, 'x.topics.z_pulse': good})
            if one.check == 'latch-without-counter'
        ]

    def shared(home, limit):
        topics = {f'x.topics.{HS}': home, f'x.topics.{BOTH[0]}': limit}
        return [one.check for one in check_values({**base, **topics})]

    assert shared('/w#data & 6', '/w#data & 4') == ['bits-shared']
    assert shared('/w#data', '/w#data & 4') == ['bits-shared']
    assert shared('/w#data & 2', '/w#data & 4') == []
    assert shared('/w#data & 6', '/v#data & 4') == []
    assert 'home-is-limit' in shared('/w#data&4', '/w#data & 0x04')


def test_the_good_axis_has_no_finding_but_the_index_that_it_does_not_use():
    case = Case('fitted-unwired', INFO)
    assert [one.check for one in case.found()] == ['fitted-unwired']
    assert check_axis('x', axis_parameters(VALUES)) == []


@pytest.mark.parametrize(
    'case',
    [
        case
        for case in WITH + WITHOUT
        if isinstance(case.right, float | bool)
        and case.layout is not False
        and case.check not in ('limit-momentary', 'drive-timeout')
    ],
)
def test_what_is_called_right_is_right(case):
    """With the value that a finding asks for, the finding is gone, or no longer that bad."""
    found = matching(case, case.found())[0]
    assert found.parameter.split(' ')[0] in DEFINITIONS, found.parameter
    value = found.right
    if DEFINITIONS[found.parameter].kind is int:
        value = int(value)
    again = replace(case, values={**case.values, found.parameter: value})
    left = [
        one
        for one in matching(case, again.found())
        if one.parameter == found.parameter
        and one.severity is found.severity
        and one.what.split(' ')[0] == found.what.split()[0]
    ]
    assert not left, left[0].text


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize(
    'case',
    [
        # Its hysteresis keeps it on for long enough.
        Case(
            'flag-debounce',
            ERROR,
            {'switch_debounce': 0.02, 'homing_velocity_fast': 0.04},
            flags={HS: SwitchLayout(0.15, 0.1505, 0.001)},
        ),
        # The axis overruns the home switch by more than the probe is before it.
        Case(
            'probe-unreachable',
            ERROR,
            {'home_type': 'HSTouchProbe', 'switches': PROBE, 'homing_reverse_distance': 0.0},
            layout={'touch_probe': 0.1485},
        ),
        # Beyond the limit switch ahead a run does not begin on the home switch.
        Case(
            'hs-reverse-bound',
            ERROR,
            {'max_hs_on_at_start_reverse_distance': 0.037},
            flags={HS: SwitchLayout(0.15, 0.2)},
        ),
        # The home switch is on up to the hard stop: nobody comes to the limit switch.
        Case(
            'ls-reverse-bound',
            ERROR,
            {
                'home_type': 'HS',
                'homing_velocity_fast': 0.09,
                'homing_velocity_fast_acc': 0.2,
                'homing_velocity_fast_dec': 0.2,
                'max_ls_reverse_distance': 0.04,
            },
            flags={HS: SwitchLayout(0.162, 0.3)},
        ),
    ],
    ids=lambda case: case.check,
)
def test_what_homes_is_no_error(case, direction):
    assert not [one.text for one in matching(case, case.found(direction)) if one.severity is ERROR]
    parameters, layout = case.built(direction)
    for start in (0.1, 0.1499, 0.155, 0.184, 0.1999):
        trial = rehearse_from(parameters, layout, transport_of(Timing()), direction * start)
        assert trial.success and abs(trial.off) < 1e-5


@pytest.mark.parametrize('case', WITHOUT + WITH, ids=lambda case: case.check)
def test_what_is_called_right_can_be_written_into_the_file(case):
    for one in case.found():
        if one.right is not None and one.parameter in DEFINITIONS and one.parameter != 'switches':
            kind = DEFINITIONS[one.parameter].kind
            right = int(one.right) if kind is int else one.right
            names = filter(None, (one.parameter, one.also))
            axis_parameters({**VALUES, **case.values, **dict.fromkeys(names, right)})


@pytest.mark.parametrize(
    'case, remedy',
    [
        (
            Case(
                'hard-stop',
                ERROR,
                {'homing_velocity_slow': 0.03},
                flags={AHEAD: SwitchLayout(0.1996, inf)},
            ),
            'homing_velocity_fast and homing_velocity_slow: 0.012 m/s',
        ),
        (
            Case(
                'ls-reverse-bound',
                WARNING,
                {'max_ls_reverse_distance': 0.045, 'max_search_distance': 0.15},
                flags={HS: SwitchLayout(0.05, 0.06)},
                words='from where',
            ),
            'max_ls_reverse_distance and max_search_distance: 0.16 m',
        ),
        (
            Case(
                'hard-stop',
                ERROR,
                {'switches': [HS, AHEAD], 'homing_reverse_distance': 0.03},
                flags={HS: SwitchLayout(0.02, 0.03), BEHIND: None},
                words='behind',
            ),
            'homing_reverse_distance: 0.02 m',
        ),
        (
            Case(
                'index-ambiguous', WARNING, {'home_type': 'ZPulse', 'switches': [*BOTH, 'z_pulse']}
            ),
            '',
        ),
        (Case('search-bound', ERROR, {'travel': 0.06, 'homing_velocity_fast': 0.02}), ''),
    ],
)
def test_remedy(case, remedy):
    assert [one.remedy for one in matching(case, case.found())][:1] == [remedy]


@pytest.mark.parametrize('home_type', HomeType)
def test_examples_have_no_error(home_type):
    example = EXAMPLES[home_type]
    axes = {'x': example.parameters}
    for found in (check(axes, {'x': example.layout}), check(axes)):
        assert [one.text for one in errors(found)] == []


@pytest.mark.parametrize('home_type', HomeType)
def test_geometry_knows_where_home_is(home_type):
    example = EXAMPLES[home_type]
    for run in example.runs:
        outcome = example.rehearse(run).outcome
        home = true_home(Geometry(example.parameters, example.layout), run.start)
        assert outcome.success
        assert outcome.home_position_raw == pytest.approx(home, abs=1e-6)


@pytest.mark.parametrize('home_type', HomeType)
def test_no_run_takes_less_than_the_least_time(home_type):
    """From off the switches; of ZPulse it is not known where the pulse is."""
    example = EXAMPLES[home_type]
    bounds = RunBounds('x', example.parameters, example.layout, Timing())
    for run in example.runs:
        if any(
            flag.on_from <= run.start <= flag.on_to for flag in example.layout.switches.values()
        ):
            continue
        least, took = bounds.least_time(run.start), example.rehearse(run).duration
        assert least < took
        assert least > 0.4 * took or home_type is HomeType.ZPulse


# ------------------------------------------------------ what is said of hard stops is what happens

GRID = [
    pytest.param(
        *(home_type, velocity, latency),
        marks=[] if (velocity, latency) == (0.05, 0.008) else [pytest.mark.long],
    )
    for home_type in ('HS', 'HSHS', 'HSOff', 'LS', 'LSReverseZPulse', 'TouchProbe')
    for velocity in (0.02, 0.05, 0.1)
    for latency in (0.0, 0.008)
]


def axis_of(home_type, velocity):
    example = EXAMPLES[HomeType(home_type)]
    slow = velocity if home_type == 'TouchProbe' else 0.01
    return replace(
        example.parameters, homing_velocity_fast=velocity, homing_velocity_slow=slow, max_jerk=20.0
    ), example.layout


@pytest.mark.parametrize('home_type, velocity, latency', GRID)
def test_the_rehearsal_hits_the_hard_stop_ahead_where_the_check_says_so(
    home_type, velocity, latency
):
    parameters, layout = axis_of(home_type, velocity)
    timing = Timing(latency=latency)
    limit = layout.switches[AHEAD].on_from
    ends = Overruns('x', parameters, layout._replace(hard_stops=(0.0, inf)), timing)
    _, row = ends.searches[0]
    stop = next(one for one in ends.limit_stops(row) if one.limit.input == AHEAD)
    overrun = stop.overrun(velocity)
    _, acceleration, _ = parameters.pace(row.motion.pace)
    ramp = stopping_distance(velocity, acceleration, parameters.max_jerk)
    first = 0.0872 if home_type == 'TouchProbe' else 0.0812
    starts = [max(first, limit - ramp * (0.4 + 0.1 * n)) for n in range(8)]
    for part, hits in ((0.85, True), (1.01, False)):
        built = layout._replace(hard_stops=(0.0, limit + part * overrun))
        if home_type == 'TouchProbe':
            built = built._replace(touch_probe=0.087)
        said = [
            one
            for one in check_axis('x', parameters, built, timing)
            if one.check == 'hard-stop' and 'ahead' in one.what
        ]
        hit = [
            rehearse_from(parameters, built, transport_of(timing), start).hits is not None
            for start in starts
        ]
        assert bool(said) is hits
        assert any(hit) is hits, (overrun, part)


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize(
    'values, flags, places',
    [
        ({**SERVO_OFF, 'homing_velocity_fast_dec': 0.05}, SERVO_OFF_FLAGS, {}),
        (
            {
                'home_type': 'TouchProbe',
                'switches': [*BOTH, 'touch_probe'],
                'ls_type': 'ServoOff',
                'homing_velocity_slow': 0.05,
                'homing_velocity_slow_dec': 0.05,
            },
            {},
            {'touch_probe': 0.184},
        ),
    ],
)
def test_a_limit_that_would_switch_the_servo_off_stops_an_axis_that_already_brakes(
    values, flags, places, direction
):
    case = Case('hard-stop', ERROR, values, flags, places)
    assert not matching(case, case.found(direction))
    trial = rehearse_from(*case.built(direction), transport_of(Timing()), direction * 0.1)
    assert trial.success


@pytest.mark.parametrize('home_type', ['MechanicalEndDetectionReverseZPulse', 'CurrentPos'])
def test_a_limit_without_an_action_does_not_bar_the_final_move(home_type):
    values = {**END, 'home_type': home_type, 'ls_type': 'None', 'switches': [*BOTH, 'z_pulse']}
    case = Case('shift-into-limit', ERROR, values)
    assert not matching(case, case.found(1))


@pytest.mark.parametrize('direction', [1, -1])
def test_a_limit_that_brakes_harder_than_the_turn_holds_the_axis(direction):
    case = Case(
        'hard-stop',
        ERROR,
        {
            'near_ls_type': 'SlowDec',
            'homing_velocity_fast': 0.1,
            'homing_velocity_fast_acc': 0.2,
            'homing_velocity_fast_dec': 0.2,
            'ls_dec': 2.0,
            'switches': [HS, *BOTH, NEAR],
        },
        flags={NEAR: SwitchLayout(0.183, inf)},
    )
    assert not matching(case, case.found(direction))
    for start in (0.162, 0.165, 0.17):
        trial = rehearse_from(*case.built(direction), transport_of(Timing()), direction * start)
        assert trial.success


@pytest.mark.parametrize('velocity', [0.02, 0.05, 0.1])
@pytest.mark.parametrize('latency', [0.0, 0.008])
def test_the_rehearsal_hits_the_hard_stop_behind_where_the_check_says_so(velocity, latency):
    parameters, layout = axis_of('HS', velocity)
    timing = Timing(latency=latency)
    limit = layout.switches[BEHIND].on_to
    ends = Overruns('x', parameters, layout._replace(hard_stops=(-inf, 0.12)), timing)
    row = next(row for _, row in ends.searches if row.motion.way is Way.AWAY)
    overrun = next(ends.limit_stops(row)).overrun(velocity)
    stuck = {**layout.switches, HS: SwitchLayout(-1.0, 0.08)}  # the home switch never falls
    stuck[BEHIND] = SwitchLayout(-1.0, limit)
    for part, hits in ((0.75, True), (1.01, False)):
        built = layout._replace(hard_stops=(limit - part * overrun, 0.12))
        said = [
            one
            for one in check_axis('x', parameters, built, timing)
            if one.check == 'hard-stop' and 'behind' in one.what
        ]
        starts = [0.07 + 0.0005 * n for n in range(4)]
        hit = [
            rehearse_from(
                parameters, built._replace(switches=stuck), transport_of(timing), start
            ).hits
            is not None
            for start in starts
        ]
        assert bool(said) is hits
        assert any(hit) is hits, (overrun, part)


@pytest.mark.parametrize('direction', [1, pytest.param(-1, marks=pytest.mark.long)])
@pytest.mark.parametrize('reverse', thinned([0.003, 0.0, 0.03], 3))
@pytest.mark.parametrize(
    'acceleration, deceleration, feedback_rate',
    [(0.3, 1.0, None), (1.0, 0.3, None), (0.3, 1.0, 25.0)],
)
def test_the_way_off_the_home_switch_ends_at_the_hard_stop_where_the_check_says_so(
    acceleration, deceleration, reverse, direction, feedback_rate
):
    """Without a limit switch behind: the axis stops, or turns more gently than it stops.

    It waits for the feedback beyond the edge before it does either.
    """
    timing = Timing(feedback_rate=feedback_rate)
    parameters = axis_parameters(
        {
            **VALUES,
            'homing_velocity_fast': 0.1,
            'homing_velocity_fast_acc': acceleration,
            'homing_velocity_fast_dec': deceleration,
            'homing_reverse_distance': reverse,
            'home_direction': 'Positive' if direction > 0 else 'Negative',
            'switches': [HS, AHEAD if direction > 0 else BEHIND],
        }
    )

    def built(stop):
        layout = AxisLayout(
            (stop, 0.2), {HS: SwitchLayout(0.08, 0.1), AHEAD: SwitchLayout(0.17, inf)}, start=0.1
        )
        return layout if direction > 0 else mirrored(layout)

    ends = Overruns('x', parameters, built(-inf), timing)
    step, row = next(each for each in ends.searches if each[1].motion.way is Way.AWAY)
    overrun = next(ends.event_stops(step, row)).overrun(0.1)
    for part, hits in ((0.8, True), (1.01, False)):
        layout = built(0.08 - part * overrun)
        said = [
            one
            for one in check_axis('x', parameters, layout, timing)
            if one.check == 'hard-stop' and 'behind' in one.what
        ]
        hit = [
            rehearse_from(
                parameters, layout, transport_of(timing), direction * (0.1125 + 0.0021 * n)
            ).hits
            is not None
            for n in range(8)
        ]
        assert bool(said) is hits
        assert any(hit) is hits, (overrun, part)


@pytest.mark.parametrize(
    'case',
    [
        case
        for case in WITH
        if case.check
        in (
            'home-switch-place',
            'ls-reverse-bound',
            'limits-overlap',
            'shift-into-limit',
            'reverse-into-limit',
            'search-bound',
            'z-pulse-bound',
            'z-pulse-check',
            'index-unreachable',
            'following-error',
            'index-margin',
            'end-behind-limit',
            'timeout',
            'flag-debounce',
            'hs-reverse-bound',
            'probe-unreachable',
            'repeat-off-switch',
            'hard-stop',
            'end-unguarded',
        )
        and case.severity is ERROR
    ],
    ids=lambda case: f'{case.check}-{case.words}',
)
def test_where_an_error_is_found_a_run_fails(case):
    """From some start, that is: or it homes where home is not."""
    parameters, layout = case.built()
    trials = (
        rehearse_from(parameters, layout, transport_of(Timing()), start)
        for start in (0.0002, 0.1998, 0.1, 0.1549, 0.1595, 0.1605, 0.175, 0.184, 0.03)
    )
    assert any(not trial.success or (trial.off and abs(trial.off) > 1e-4) for trial in trials)


@pytest.mark.parametrize(
    ('bound', 'error'),
    [
        ('max_hs_on_at_start_reverse_distance', 'MaxHSOnAtStartRevDistanceTraveled'),
        ('max_search_distance', 'SearchDistanceExceeded'),
    ],
)
def test_a_finding_names_the_error_that_a_run_ends_with(bound, error):
    case = next(case for case in WITH if case.check == 'hs-reverse-bound')
    parameters, layout = case.built()
    parameters = replace(
        parameters,
        **{'max_hs_on_at_start_reverse_distance': 0.0, 'max_search_distance': 0.0, bound: 0.01},
    )
    texts = [
        one.text for one in check_axis('x', parameters, layout) if one.check == 'hs-reverse-bound'
    ]
    assert [error in text for text in texts] == [True]


# -------------------------------------------------------------------------------------- in general


def test_a_configuration_brings_its_update_rate():
    values = {
        'axes': ['x'],
        'update_rate': 10.0,
        'cycle_timeout': 0.15,
        **{f'x.{name}': value for name, value in VALUES.items()},
    }
    found = check(configuration(values), {'x': LAYOUT._replace(hard_stops=(0.0, 0.19))})
    assert {'cycle-timeout', 'hard-stop'} <= {one.check for one in found}
    assert '112 ms' not in next(one.text for one in found if one.check == 'hard-stop')
    assert '118 ms' in next(one.text for one in found if one.check == 'hard-stop')


def test_an_axis_that_the_layout_does_not_have():
    axes = {'x': axis_parameters(VALUES), 'y': axis_parameters(VALUES)}
    found = check(axes, {'x': LAYOUT})
    (missing,) = [one for one in found if one.check == 'layout-missing']
    assert (missing.axis, missing.severity) == ('y', WARNING)
    assert 'the layout has no axis y, only x' in missing.what
    assert 'y: {hard_stops: [from, to]}' in missing.why
    assert [one.axis for one in check(axes)] == []


def test_the_worst_comes_first_axis_by_axis():
    bad = axis_parameters({**VALUES, 'travel': 0.3, 'homing_velocity_fast': 0.15})
    found = check({'y': bad, 'x': bad}, {'x': LAYOUT, 'y': LAYOUT})
    order = list(Severity)
    for axis in ('x', 'y'):
        ranks = [order.index(one.severity) for one in found if one.axis == axis]
        assert ranks == sorted(ranks) and ranks[0] == 0
    assert [one.axis for one in found] == sorted((one.axis for one in found), reverse=True)


def test_unknown_places_are_no_errors():
    nowhere = AxisLayout((-inf, inf), {}, index_pitch=0.01, index_offset=nan)
    for example in EXAMPLES.values():
        assert errors(check_axis('x', example.parameters, nowhere)) == []


def test_plain_values_for_json():
    case = next(case for case in WITH if case.check == 'limit-beyond-stop')
    found = matching(case, case.found())[0].as_dict()
    assert found['severity'] == 'error' and found['axis'] == 'x'
    assert all(isinstance(value, str | float | int | bool | None) for value in found.values())
    assert all(isfinite(value) for value in found.values() if isinstance(value, float))


@pytest.mark.parametrize(
    'number, below, above',
    [
        (0.0456, 0.045, 0.046),
        (0.05, 0.05, 0.05),
        (0.0, 0.0, 0.0),
        (123.0, 120.0, 130.0),
        (inf, inf, inf),
    ],
)
def test_rounding_to_what_one_would_write(number, below, above):
    assert (down(number), up(number)) == (below, above)


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from(HomeType),
    st.booleans(),
    st.lists(st.floats(-0.1, 0.3), min_size=8, max_size=8),
    st.floats(0.001, 1.0),
    st.floats(0.0, 0.02),
    st.one_of(st.just(nan), st.floats(-1, 1)),
)
def test_any_layout_is_judged(home_type, known, ends, velocity, debounce, offset):
    example = EXAMPLES[home_type]
    parameters = replace(
        example.parameters,
        homing_velocity_fast=velocity,
        homing_velocity_slow=velocity / 3,
        switch_debounce=debounce,
    )
    flags = {
        name: SwitchLayout(*sorted(ends[2 * n : 2 * n + 2]))
        for n, name in enumerate((HS, AHEAD, BEHIND))
    }
    stops = tuple(sorted((ends[6], ends[7] + 1e-6))) if known else (-inf, inf)
    layout = AxisLayout(stops, flags, index_pitch=0.02, index_offset=offset, lag=0.01)
    for found in check_axis('x', parameters, layout):
        assert found.text and found.severity in Severity
        assert found.as_dict()


@pytest.mark.parametrize('value', thinned([1e-300, 1e-9, 1e300, 1e9], 2))
@pytest.mark.parametrize('home_type', thinned(HomeType, 3))
def test_absurd_parameters_are_judged_too(home_type, value):
    example = EXAMPLES[home_type]
    rates = [name for name, definition in DEFINITIONS.items() if definition.unit.startswith('m/s')]
    for names in [*([name] for name in rates), rates]:
        parameters = replace(example.parameters, **dict.fromkeys(names, value))
        for layout in (example.layout, None):
            assert all(one.text for one in check_axis('x', parameters, layout))


def test_every_input_can_be_placed():
    flags = {
        str(name): SwitchLayout(0.1, 0.2)
        for name in Input
        if str(name) not in ('z_pulse', 'touch_probe', 'servo_enabled')
    }
    found = check_axis('x', axis_parameters(VALUES), LAYOUT._replace(switches=flags))
    assert errors(found)
