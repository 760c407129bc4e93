# SPDX-License-Identifier: Apache-2.0
"""The hash of everything that moves the origin of an axis."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping

from ..parameters.axis import AxisParameters

#: What moves no origin: how fast, how far at most, how long, and what becomes of the result. A
#: parameter that is not named here is part of the hash.
NO_ORIGIN = frozenset(
    {
        'travel',
        'travel_min',
        'travel_max',
        'apply_timeout',
        'apply_tolerance',
        'switch_controllers',
        'homing_velocity_fast',
        'homing_velocity_fast_acc',
        'homing_velocity_fast_dec',
        'homing_velocity_slow',
        'homing_velocity_slow_acc',
        'homing_velocity_slow_dec',
        'homing_reverse_distance',
        'home_shift_velocity',
        'home_shift_acc',
        'home_shift_dec',
        'max_jerk',
        'z_pulse_distance_check',
        'z_pulse_distance_tolerance',
        'max_z_pulse_distance',
        'index_margin',
        'index_margin_action',
        'max_hs_on_at_start_reverse_distance',
        'max_ls_reverse_distance',
        'max_search_distance',
        'timeout',
        'immediate_stop_at_ls',
        'pause_mode',
        'limit_reversal',
        'ls_type',
        'positive_ls_type',
        'negative_ls_type',
        'ls_dec',
        'ls_slow_dec',
        'all_ls_during_homing',
        'near_ls_type',
        'near_positive_ls_type',
        'near_negative_ls_type',
        'external_ls_type',
        'external_positive_ls_type',
        'external_negative_ls_type',
        # The home of a gantry is that of its leader.
        'followers',
        'max_skew',
        'square_tolerance',
        'square',
        'switch_offset',
        'gantry_homing_use_slave_hs',
        'gantry_homing_use_slave_ls',
        'gantry_homing_use_slave_z_pulse',
        'gantry_homing_use_slave_touch_probe',
        'gantry_homing_use_slave_mechanical_end',
        'gantry_homing_retain_sync_offset',
        'switch_debounce',
        'switch_timeout',
        'switch_stamp_error',
        'feedback_timeout',
        'rest_timeout',
        'following_error',
        'wrong_direction_distance',
        'edge_tolerance',
        'repeat',
        'repeat_tolerance',
        'wrap_setpoints',
        'clear_home_done_on_servo_off',
        'clear_home_done_on_comm_stop',
        'brake',
        'home_change_warn',
        'home_change_limit',
        'restore',
        'restore_tolerance',
        'rehome',
        'rehome_velocity',
        'rehome_margin',
    }
)


def configuration_hash(parameters: AxisParameters, joint: str, topics: Mapping[str, str]) -> str:
    """Return the hash of all that says where home is.

    Args:
        parameters: The parameters of the axis.
        joint: Its joint.
        topics: The sources of its inputs, as far as the user names them.
    """
    values: dict[str, object] = {
        field.name: str(value)
        if not isinstance(value := getattr(parameters, field.name), tuple)
        else sorted(map(str, value))
        for field in dataclasses.fields(parameters)
        if field.name not in NO_ORIGIN
    }
    values['joint'] = joint
    values['topics'] = {str(name): topic for name, topic in sorted(topics.items()) if topic}
    text = json.dumps(values, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
