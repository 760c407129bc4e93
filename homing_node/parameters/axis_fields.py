# SPDX-License-Identifier: Apache-2.0
"""The parameters of an axis: a new parameter is one new field here.

ROS descriptors, the YAML loader, the checks and the reference page all derive from these fields.
The names are the names of the WMX3 manual in snake_case. Units: m or rad, s.
"""

from dataclasses import dataclass

from ..procedures.states import (
    Apply,
    Direction,
    Encoder,
    FeedbackClock,
    HomeType,
    IndexMarginAction,
    Input,
    LSDirection,
    LSType,
    Restore,
)
from . import fields
from .units import Unit


@dataclass(frozen=True, kw_only=True, slots=True)
class AxisFields:
    """The values of all parameters of one axis, in SI units (m or rad, s)."""

    home_type: HomeType = fields.home_type('how the axis homes')
    home_direction: Direction = fields.parameter(
        Direction, Direction.Positive, 'homing direction in raw coordinates'
    )
    joint: str = fields.parameter(
        str, '', "joint in joint_states and in the setpoints ('': the axis's name)"
    )
    unit: Unit = fields.parameter(
        Unit, Unit.m, 'unit of positions: m for a linear axis, rad for a rotary one'
    )
    travel: float = fields.travel('mechanical travel of the axis')

    homing_velocity_fast: float = fields.velocity(
        0.05, 'velocity of switch searches and reversals'
    )
    homing_velocity_fast_acc: float = fields.acceleration(0.5, 'acceleration of the fast profile')
    homing_velocity_fast_dec: float = fields.acceleration(0.5, 'deceleration of the fast profile')
    homing_velocity_slow: float = fields.velocity(
        0.005, 'velocity at which a reference is taken after a coarse pass or on a latch'
    )
    homing_velocity_slow_acc: float = fields.acceleration(0.5, 'acceleration of the slow profile')
    homing_velocity_slow_dec: float = fields.acceleration(0.5, 'deceleration of the slow profile')
    homing_reverse_distance: float = fields.distance(
        0.0, 'further away after a switch was cleared'
    )
    home_shift_velocity: float = fields.velocity(
        0.0, 'velocity of the final move (0: homing_velocity_fast)', or_zero=True
    )
    home_shift_acc: float = fields.acceleration(0.5, 'acceleration of the final move')
    home_shift_dec: float = fields.acceleration(0.5, 'deceleration of the final move')
    home_shift_distance: float = fields.position(
        0.0, 'final move past the home position, along the homing direction'
    )
    home_position: float = fields.position(0.0, 'what the axis reads at the end of the final move')
    max_jerk: float = fields.jerk(10.0, 'jerk of every profile')

    invert_hs_polarity: bool = fields.inversion('home switch')
    invert_positive_ls_polarity: bool = fields.inversion('positive limit switch')
    invert_negative_ls_polarity: bool = fields.inversion('negative limit switch')
    invert_near_positive_ls_polarity: bool = fields.inversion('near positive limit switch')
    invert_near_negative_ls_polarity: bool = fields.inversion('near negative limit switch')
    invert_external_positive_ls_polarity: bool = fields.inversion('external positive limit switch')
    invert_external_negative_ls_polarity: bool = fields.inversion('external negative limit switch')

    multiple_z_pulse: int = fields.count(
        0, 'take the n-th Z-pulse (0 and 1: the first)', 0, 1_000_000
    )
    z_pulse_distance_check: float = fields.distance(
        0.0, 'expected distance between Z-pulses (0: not checked)'
    )
    z_pulse_distance_tolerance: float = fields.fraction(
        0.05, 'relative tolerance of z_pulse_distance_check', 1.0
    )
    max_z_pulse_distance: float = fields.distance(
        0.0, 'bound from the arming edge to the Z-pulse (0: only the search bound)'
    )

    z_pulse_arm_delay: float = fields.distance(
        0.0, 'how far beyond the arming edge a Z-pulse must lie to count'
    )
    index_margin: float = fields.fraction(
        0.1, 'least distance of the arming edge from a Z-pulse, as a fraction of the pitch', 0.5
    )
    index_margin_action: IndexMarginAction = fields.parameter(
        IndexMarginAction, IndexMarginAction.Warn, 'what to do below index_margin'
    )

    max_hs_on_at_start_reverse_distance: float = fields.distance(
        0.0, 'bound for clearing a home switch that is on at start (0: only the search bound)'
    )
    max_ls_reverse_distance: float = fields.distance(
        0.0, 'bound for the reversal from a limit switch (0: only the search bound)'
    )
    max_search_distance: float = fields.distance(0.0, 'bound of any one search (0: 1.1 x travel)')
    timeout: float = fields.duration(
        0.0, 'bound of a whole run (0: computed from the bounds and speeds, + 50 %)', 0.1
    )

    immediate_stop_at_ls: bool = fields.flag(
        False, 'where a limit is the reversal or the reference, the command freezes at its edge'
    )
    open_loop_homing: bool = fields.flag(
        False, 'take the commanded instead of the feedback position at switch edges'
    )
    pause_mode: bool = fields.flag(False, 'pause before each reversal until `continue`')

    limit_reversal: bool = fields.flag(
        True,
        'home switch types: a limit ahead turns the axis (false: its LS Type ends the run; '
        'false unless set for the CiA 402 methods 3 to 6 and 19 to 22)',
    )
    ls_type: LSType = fields.ls_type(LSType.Dec, 'action of the hardware limit switches')
    positive_ls_type: LSType = fields.separate_ls_type('positive')
    negative_ls_type: LSType = fields.separate_ls_type('negative')
    ls_dec: float = fields.acceleration(1.0, 'deceleration at limits, faults and emergency stop')
    ls_slow_dec: float = fields.acceleration(0.5, 'deceleration of the SlowDec actions')
    all_ls_during_homing: bool = fields.flag(
        False, 'limit switches act whatever the direction of motion'
    )
    ls_direction: LSDirection = fields.parameter(
        LSDirection, LSDirection.Normal, 'Reverse swaps the positive and negative limit inputs'
    )
    near_ls_type: LSType = fields.ls_type(LSType.none, 'action of the near limit switches')
    near_positive_ls_type: LSType = fields.separate_ls_type('near positive')
    near_negative_ls_type: LSType = fields.separate_ls_type('near negative')
    external_ls_type: LSType = fields.ls_type(LSType.none, 'action of the external limit switches')
    external_positive_ls_type: LSType = fields.separate_ls_type('external positive')
    external_negative_ls_type: LSType = fields.separate_ls_type('external negative')

    mechanical_end_detection_pos_diff: float = fields.distance(
        0.0, 'command minus feedback that means the mechanical end'
    )
    mechanical_end_detection_time: float = fields.duration(0.0, 'how long it must be exceeded')
    mechanical_end_detection_ignore_ls: bool = fields.flag(
        False, 'limit switches ahead are ignored while searching the mechanical end'
    )
    mechanical_end_detection_first_torque_limit: float = fields.torque(
        'torque limit while searching the end (0: none)'
    )
    mechanical_end_detection_second_torque_limit: float = fields.torque(
        'torque limit once the end was touched (0: the first)'
    )

    switches: tuple[Input, ...] = fields.parameter(
        tuple,
        (Input.HOME_SWITCH, Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH),
        'the inputs that are wired',
    )
    switch_debounce: float = fields.duration(0.0, 'how long a level must last to be believed')
    switch_timeout: float = fields.duration(
        0.0, 'largest age of a periodically published switch (0: published on change only)', 0.001
    )
    switch_latency: float = fields.duration(
        0.0, "the switch driver's own delay before publishing, taken off the edge's time"
    )
    switch_stamp_error: float = fields.duration(
        0.002, "how far a switch's stamp may be from its edge; for `uncertainty`"
    )
    feedback_timeout: float = fields.duration(
        0.2, 'largest age of the feedback', 0.001, or_zero=False
    )
    feedback_clock: FeedbackClock = fields.parameter(
        FeedbackClock,
        FeedbackClock.auto,
        'sampling time of the feedback: the header stamp, the arrival (the time of sending), '
        'or auto (the stamp; if it is more than 0.01 s from the sending, both are possible)',
    )
    switch_clock: FeedbackClock = fields.parameter(
        FeedbackClock,
        FeedbackClock.auto,
        'sampling time of a switch whose messages have a header: as feedback_clock',
    )
    wrap: float = fields.distance(
        0.0, 'the feedback is published modulo this distance, 6.283185 for a turn (0: it is not)'
    )
    wrap_setpoints: bool = fields.flag(
        False, 'setpoints are published in the range of the feedback, modulo wrap'
    )
    rest_timeout: float = fields.duration(
        1.0, 'how long a request waits for an axis that moves to come to rest'
    )

    following_error: float = fields.distance(
        0.0,
        'largest |command - feedback| (0: 0.05 s x velocity of the motion + 1 % of travel, '
        'of a linear axis at most 0.001 m)',
    )
    wrong_direction_distance: float = fields.distance(
        0.0,
        'commanded distance after which the feedback must not go the other way (0: 1 % of travel)',
    )
    edge_tolerance: float = fields.distance(
        0.0, 'how far the second pass may be from the first (0: homing_velocity_fast x 0.005 s)'
    )

    repeat: int = fields.count(
        1, 'number of slow passes over the reference; home is their mean', 1, 100
    )
    repeat_tolerance: float = fields.distance(
        0.0, 'largest spread of the passes (0: edge_tolerance)'
    )

    clear_home_done_on_servo_off: bool = fields.flag(
        True, 'servo off: the axis is no longer homed'
    )
    clear_home_done_on_comm_stop: bool = fields.flag(
        True, 'feedback lost: the axis is no longer homed'
    )

    encoder: Encoder = fields.parameter(
        Encoder,
        Encoder.incremental,
        'what the feedback still knows after the drive was off: nothing, its place in a turn, or '
        'all',
    )
    encoder_turn: float = fields.distance(
        0.0, 'travel of a turn of a single_turn encoder (0: not known)'
    )
    brake: bool = fields.flag(False, 'a brake holds the axis while the drive is off')
    home_change_warn: float = fields.distance(
        0.0, 'a home that has moved further is a warning (0: only by statistics)'
    )
    home_change_limit: float = fields.distance(
        0.0, 'a home that has moved further is not taken: HomeMoved (0: no limit)'
    )
    restore: Restore = fields.parameter(
        Restore,
        Restore.never,
        'take the home over from before a restart of the node; verify: the first request '
        'verifies it',
    )
    restore_tolerance: float = fields.distance(
        1e-4, 'how far the axis may have moved meanwhile, for a home to be taken over'
    )
    rehome: bool = fields.flag(
        False, 'where the switch is known, go to rehome_margin before it at rehome_velocity'
    )
    rehome_velocity: float = fields.velocity(
        0.0, 'velocity of that way, and of verify (0: homing_velocity_fast)', or_zero=True
    )
    rehome_margin: float = fields.distance(
        0.0,
        'how far before the remembered switch it ends (0: 1 % of travel, of a linear axis at most '
        '0.001 m)',
    )

    apply: Apply = fields.parameter(
        Apply,
        Apply.none,
        'how the rest of the machine gets the home: not at all, by a service of the driver, or by '
        'the relay homed_axes',
    )
    apply_service: str = fields.parameter(
        str,
        '',
        'apply service: the service that takes the home; apply relay: the node of the relay '
        "('': homed_axes)",
    )
    apply_type: str = fields.parameter(
        str, '', 'type of apply_service, such as homing_interfaces/srv/SetPosition'
    )
    apply_request: str = fields.parameter(
        str, '', 'request to apply_service, YAML with {position}, {home_offset} and others'
    )
    apply_timeout: float = fields.duration(
        2.0, 'bound of each step of the hand-over', 0.01, or_zero=False
    )
    apply_tolerance: float = fields.distance(
        0.0, 'how far from the homed position the feedback may be afterwards (0: 1e-4 x travel)'
    )
    switch_controllers: tuple[str, ...] = fields.names(
        'controllers that must be active before a run, and are inactive while the home is applied'
    )
    travel_min: float = fields.position(
        0.0, 'soft limit of the relay, homed (equal to travel_max: no soft limits)'
    )
    travel_max: float = fields.position(
        0.0, 'soft limit of the relay, homed (equal to travel_min: no soft limits)'
    )

    followers: tuple[str, ...] = fields.names(
        'the other drives of a gantry, which move with this axis'
    )
    max_skew: float = fields.distance(
        0.0, 'largest skew of a gantry; required with followers (0: no gantry)'
    )
    square_tolerance: float = fields.distance(
        0.00005, 'squareness of a gantry below which it makes no squaring move'
    )
    square: bool = fields.flag(
        True, 'square the gantry (false: a stiff one; its squareness is only reported)'
    )
    switch_offset: float = fields.position(
        0.0,
        "of a follower: where its reference is when the gantry is square, less the leader's, in "
        "the leader's coordinates",
    )
    gantry_homing_use_slave_hs: bool = fields.flag(
        True, 'a follower with a home switch homes on it, too'
    )
    gantry_homing_use_slave_ls: bool = fields.flag(
        True, 'a follower with the limit switch that the type homes on homes on it, too'
    )
    gantry_homing_use_slave_z_pulse: bool = fields.flag(
        True, 'a follower with a Z-pulse homes on it, too'
    )
    gantry_homing_use_slave_touch_probe: bool = fields.flag(
        True, 'a follower with a touch probe homes on it, too'
    )
    gantry_homing_use_slave_mechanical_end: bool = fields.flag(
        False, 'a follower homes on its mechanical end, too (not there yet: true is refused)'
    )
    gantry_homing_retain_sync_offset: bool = fields.flag(
        False, 'keep the offsets of the followers as they are at the start: no squaring move'
    )
