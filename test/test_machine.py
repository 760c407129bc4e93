# SPDX-License-Identifier: Apache-2.0
"""The rules that hold in every row, one by one: the machine with switches set by hand."""

import pytest
from core_rig import (
    DIRECTIONS,
    HOME,
    HS,
    LIMIT_AHEAD,
    LIMIT_BEHIND,
    NEAR_AHEAD,
    error_of,
    furthest,
    rig,
)

from homing_node.core.machine import Machine
from homing_node.core.outcome import Failure
from homing_node.core.profile import Profile
from homing_node.core.signals import Edge, Switch
from homing_node.plant.layout import SwitchLayout
from homing_node.procedures.events import Event
from homing_node.procedures.states import Error, Input, State
from homing_node.procedures.steps import (
    HOME_SHIFT,
    HOME_SHIFT_MOVE,
    HS_CLEAR_REVERSE,
    HS_CLEAR_REVERSE_AT_START,
    HS_CLEAR_REVERSE_FURTHER,
    HS_FALLING_EDGE_SEARCH_REVERSE,
    HS_OFF_SEARCH,
    HS_SEARCH,
    LS_FALLING_EDGE_SEARCH_REVERSE,
    LS_SEARCH,
    MECHANICAL_END_DETECTION,
    SECOND_HS_SEARCH,
    Z_PULSE_SEARCH_REVERSE,
    Z_PULSE_SEARCH_REVERSE_ARMED,
)

PERIOD = 0.004


class Hand:
    """A machine whose axis follows at once, and whose switches are set by hand."""

    def __init__(self, home_type, on=(), start=0.05, near=False, **changes):
        one = rig(home_type, **changes)
        if near:
            one = one.switched(**{NEAR_AHEAD: SwitchLayout(0.0, 0.1)}).but(near_ls_type='Dec')
        parameters = one.parameters()
        self.profile = Profile(PERIOD, parameters.max_jerk, start)
        self.switches = {Input(name): Switch(Input(name)) for name in one.layout.switches}
        for name, switch in self.switches.items():
            switch.level = name in on
        self.now = 0.0
        self.machine = Machine(parameters, self.profile, self.switches, self.now, start)
        self.machine.begin()

    def run(self, cycles=20, feedback=None):
        for _ in range(cycles):
            self.profile.update()
            self.now += PERIOD
            at = self.profile.position if feedback is None else feedback(self.profile.position)
            self.machine.update(self.now, at)
        return self

    def edge(self, name, rises, way=None, position=None, time=None, level=None):
        """Set a level (another one than the edge's, where it has changed since), hand it over."""
        edge = Edge(Input(name), self.now if time is None else time, rises)
        edge.position = self.profile.position if position is None else position
        edge.way = (1 if self.profile.velocity > 0 else -1) if way is None else way
        edge.resolved = True
        self.switches[edge.input].level = rises if level is None else level
        if edge.input is not Input.HOME_SWITCH:
            (self.machine.limit_rises if rises else self.machine.limit_falls)(edge.input)
        self.machine.edge(edge)
        return self

    @property
    def step(self):
        return self.machine.step

    @property
    def error(self):
        return self.machine.ending.error


# -- where it begins ----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('home_type', 'on', 'step'),
    [
        ('HS', (), HS_SEARCH),
        ('HS', (HS,), HS_CLEAR_REVERSE_AT_START),
        ('HS', (LIMIT_AHEAD,), HS_FALLING_EDGE_SEARCH_REVERSE),
        ('HS', (HS, LIMIT_AHEAD), HS_FALLING_EDGE_SEARCH_REVERSE),
        ('HS', (LIMIT_BEHIND,), HS_SEARCH),
        ('HSOff', (HS,), HS_OFF_SEARCH),
        ('HSOff', (HS, LIMIT_AHEAD), HS_FALLING_EDGE_SEARCH_REVERSE),
        ('LS', (), LS_SEARCH),
        ('LS', (LIMIT_AHEAD,), LS_FALLING_EDGE_SEARCH_REVERSE),
        ('NearLS', (LIMIT_BEHIND,), LS_SEARCH),
        ('NearLS', (LIMIT_AHEAD, NEAR_AHEAD), LS_FALLING_EDGE_SEARCH_REVERSE),
    ],
)
def test_the_first_row(home_type, on, step):
    hand = Hand(home_type, on)
    assert hand.step == step
    assert hand.error is Error.NoError


@pytest.mark.parametrize(
    ('home_type', 'on', 'error'),
    [
        ('HS', (LIMIT_AHEAD, LIMIT_BEHIND), Error.LimitsBothOn),
        ('HS', (HS, LIMIT_BEHIND), Error.LSTriggered),  # clearing would go into the limit behind
        ('LS', (LIMIT_AHEAD, LIMIT_BEHIND), Error.LimitsBothOn),
        ('NearLS', (LIMIT_AHEAD,), Error.LSTriggered),
        ('ZPulse', (LIMIT_AHEAD,), Error.LSTriggered),
    ],
)
def test_what_is_not_begun(home_type, on, error):
    hand = Hand(home_type, on)
    assert hand.error is error
    hand.run(1)
    assert hand.machine.finished
    assert hand.profile.position == 0.05


# -- which edges count --------------------------------------------------------------------------


def test_an_edge_of_the_other_way_does_not_count():
    hand = Hand('HSHS').run()
    hand.edge(HS, True).edge(HS, False)  # the overrun past a narrow flag
    assert hand.step == HS_CLEAR_REVERSE
    hand.run(40).edge(HS, True).edge(HS, False)  # back over it
    assert hand.step == HS_CLEAR_REVERSE_FURTHER


def test_a_fall_beyond_the_rise_is_the_flags_far_end():
    hand = Hand('HSHS').run().edge(HS, True, position=0.06)
    hand.edge(HS, False, way=-1, position=0.0615)
    assert hand.step == HS_CLEAR_REVERSE
    hand.edge(HS, False, way=-1, position=0.0605)
    assert hand.step == HS_CLEAR_REVERSE_FURTHER


def test_a_bounce_at_a_far_end_with_hysteresis_is_not_where_the_axis_came_in():
    hand = Hand('HSHS').run().edge(HS, True, position=0.06).edge(HS, False, position=0.068)
    hand.run(40).edge(HS, True, position=0.0655).edge(HS, False, position=0.0654)
    assert hand.step == HS_CLEAR_REVERSE


def test_a_fall_right_behind_the_rise_is_a_bounce():
    hand = Hand('HSOff').run().edge(HS, True, position=0.06)
    hand.edge(HS, False, position=0.0605).edge(HS, True, position=0.0606)
    assert hand.step == HS_OFF_SEARCH
    hand.edge(HS, False, position=0.066)
    assert hand.step == HOME_SHIFT
    assert hand.machine.reference.position == 0.066


def test_a_bounce_from_before_the_axis_moved_is_no_end_of_the_flag():
    """The axis rests on the flag, close to its far end, and the contact bounces."""
    hand = Hand('HSOff', on=(HS,)).edge(HS, False, way=0).edge(HS, True, way=0)
    hand.run().edge(HS, False, position=0.0502)
    assert hand.step == HOME_SHIFT
    assert hand.machine.reference.position == 0.0502


def test_the_tolerance_of_the_second_pass_is_not_the_reach_of_a_bounce():
    hand = Hand('HSOff', edge_tolerance=0.05).run().edge(HS, True, position=0.06)
    hand.edge(HS, False, position=0.066)
    assert hand.step == HOME_SHIFT


def test_a_switch_that_is_on_though_no_rise_counted_is_cleared():
    hand = Hand('HS').run(1).edge(HS, True, way=-1)
    assert hand.step == HS_CLEAR_REVERSE_AT_START


def test_a_switch_whose_rise_did_not_count_is_not_cleared_once_it_is_off_again():
    hand = Hand('HS').run(1).edge(HS, True, way=-1, level=False)
    assert hand.step == HS_SEARCH


def test_an_edge_from_before_the_axis_moved_is_no_home():
    hand = Hand('HS').run(1).edge(HS, True, way=0)
    assert hand.step == HS_CLEAR_REVERSE_AT_START


def test_a_switch_that_is_on_when_the_second_pass_begins_is_cleared():
    hand = Hand('HSHS').run().edge(HS, True).run(60).edge(HS, False).run(1)
    assert hand.step == SECOND_HS_SEARCH
    hand.edge(HS, True, way=-1)
    assert hand.step == HS_CLEAR_REVERSE


def test_the_limit_that_arms_a_reverse_search_must_fall_going_away():
    hand = Hand('LSReverseZPulse').run().edge(LIMIT_AHEAD, True)
    hand.edge(LIMIT_AHEAD, False)
    assert hand.step == Z_PULSE_SEARCH_REVERSE
    hand.run(40).edge(LIMIT_AHEAD, True).edge(LIMIT_AHEAD, False)
    assert hand.step == Z_PULSE_SEARCH_REVERSE_ARMED


# -- an earlier edge that arrives later ---------------------------------------------------------


@pytest.mark.parametrize(
    ('limit_time', 'step'),
    [
        (0.07, HS_FALLING_EDGE_SEARCH_REVERSE),
        (0.08, HS_FALLING_EDGE_SEARCH_REVERSE),
        (0.09, HOME_SHIFT),
    ],
)
@pytest.mark.parametrize('limit_first', [False, True])
def test_the_earlier_edge_decides_the_limit_if_equal(limit_time, step, limit_first):
    hand = Hand('HS').run()
    edges = [(HS, 0.08), (LIMIT_AHEAD, limit_time)]
    for name, time in reversed(edges) if limit_first else edges:
        hand.edge(name, True, way=1, time=time)
    assert hand.step == step
    assert hand.error is Error.NoError


def test_a_decision_that_was_undone_leaves_the_reversal_unused():
    hand = Hand('HSHS').run()
    hand.edge(LIMIT_AHEAD, True, way=1, time=0.09).edge(HS, True, way=1, time=0.08)
    assert hand.step == HS_CLEAR_REVERSE
    hand.run(80).edge(LIMIT_AHEAD, False).edge(HS, False).run(40)
    assert hand.step == SECOND_HS_SEARCH
    hand.edge(LIMIT_AHEAD, True)
    assert hand.step == HS_FALLING_EDGE_SEARCH_REVERSE
    assert hand.error is Error.NoError


def test_a_reversal_that_was_undone_leaves_the_first_pass():
    hand = Hand('HSHS', edge_tolerance=0.001).run().edge(HS, True, position=0.06).run(60)
    hand.edge(HS, False, position=0.0599).run(60)
    assert hand.step == SECOND_HS_SEARCH
    hand.edge(LIMIT_AHEAD, True)
    hand.edge(HS, True, way=1, position=0.07, time=hand.now - 0.01)
    assert hand.step == HOME_SHIFT
    hand.run(100)
    assert hand.error is Error.EdgeNotRepeated


def test_an_arrow_that_was_undone_leaves_no_reference():
    """Nor an arrow: the run shows only the reversal."""
    hand = Hand('HS').run().edge(HS, True, time=0.08)
    assert hand.machine.reference is not None
    hand.edge(LIMIT_AHEAD, True, way=1, time=0.07)
    assert hand.step == HS_FALLING_EDGE_SEARCH_REVERSE
    assert hand.machine.reference is None
    assert hand.machine.arrows == [(HS_SEARCH, Event.LIMIT_AHEAD)]


def test_a_reversal_that_was_undone_leaves_the_passes_as_they_were():
    hand = Hand('HSHS', repeat=3).run().edge(HS, True, position=0.06).run(60)
    hand.edge(HS, False, position=0.06).run(60).edge(HS, True, position=0.06).run(60)
    hand.edge(HS, False, position=0.06).run(60)
    assert hand.step == SECOND_HS_SEARCH
    hand.edge(LIMIT_AHEAD, True)
    assert hand.machine.passes.fine == []
    hand.edge(HS, True, way=1, position=0.06, time=hand.now - 0.01)
    assert hand.step == HS_CLEAR_REVERSE
    assert len(hand.machine.passes.fine) == 2
    assert hand.machine.arrows[-1] == (SECOND_HS_SEARCH, Event.REPEAT)


def test_an_earlier_edge_that_does_not_count_undoes_nothing():
    hand = Hand('HS').run().edge(HS, True, time=0.08)
    hand.edge(LIMIT_AHEAD, True, way=-1, time=0.07)
    assert hand.step == HOME_SHIFT


def test_once_the_axis_is_at_rest_nothing_is_undone():
    hand = Hand('HS').run().edge(HS, True, time=0.08).run(60)
    assert hand.machine.finished
    hand.edge(LIMIT_AHEAD, True, way=1, time=0.07)
    assert hand.step != HS_FALLING_EDGE_SEARCH_REVERSE


# -- limits -------------------------------------------------------------------------------------


def test_a_limit_ahead_while_it_brakes_for_the_reference_ends_nothing():
    hand = Hand('HS', ls_dec=50).run().edge(HS, True).run(1)
    soft = Hand('HS', ls_dec=50).run().edge(HS, True).run(1)
    hand.edge(LIMIT_AHEAD, True)
    assert hand.step == HOME_SHIFT
    assert hand.error is Error.NoError
    furthest = []
    for one in (hand, soft):
        one.run(6)
        furthest.append(one.profile.position)
    assert furthest[0] < furthest[1]


def test_unless_the_home_shift_goes_on_toward_it():
    hand = Hand('HS', home_shift_distance=0.02).run().edge(HS, True).run(1)
    hand.edge(LIMIT_AHEAD, True)
    assert hand.error is Error.NoError
    hand.run(20)
    assert hand.error is Error.LSTriggered


def furthest_past_a_limit(home_type, gap, ls_type='Dec', **flags):
    """Return how far an axis goes past the limit that it meets in the overrun of its reference."""
    one = rig(home_type, homing_velocity_fast_dec=0.5, ls_type=ls_type).switched(
        **{LIMIT_AHEAD: SwitchLayout(0.06 + gap, 1.0), **flags}
    )
    course = one.home(start=0.03)
    assert course.outcome.success, course.outcome.message
    return furthest(course) - 0.06 - gap


def test_a_limit_that_rises_in_the_same_cycle_as_the_reference_brakes_as_hard():
    flag = {HS: SwitchLayout(0.06, 1.0)}
    together, apart = (furthest_past_a_limit('HS', gap, **flag) for gap in (1e-5, 1e-3))
    assert together < apart + 0.001  # a cycle of travel
    assert together < 0.006


def test_a_limit_that_switches_off_brakes_the_overrun_like_a_fault():
    """The home stays good, so the servo stays on; but nothing is softer than ServoOff."""
    flag = {NEAR_AHEAD: SwitchLayout(0.06, 1.0)}
    off, dec, slow = (
        furthest_past_a_limit('NearLS', 0.002, ls_type, **flag)
        for ls_type in ('ServoOff', 'Dec', 'SlowDec')
    )
    assert off == dec < slow < 0.012


@pytest.mark.parametrize('on', [True, False], ids=['on', 'rising'])
@pytest.mark.parametrize(
    ('home_type', 'start', 'shift', 'flag'),
    [
        ('CurrentPos', 0.05, 0.01, {LIMIT_AHEAD: SwitchLayout(0.055, 1.0)}),
        ('HS', 0.05, -0.02, {LIMIT_BEHIND: SwitchLayout(-1.0, 0.045)}),
    ],
)
def test_a_normal_limit_without_an_action_does_not_bar_the_home_shift(
    home_type, start, shift, flag, on
):
    one = rig(home_type, home_shift_distance=shift, ls_type='None').switched(**flag)
    if on and home_type == 'CurrentPos':
        start = 0.06
    assert error_of(one.home(start=start)) is Error.NoError
    assert error_of(one.but(ls_type='Dec').home(start=start)) is Error.LSTriggered


def test_a_reversal_without_an_action_bars_the_home_shift():
    hand = Hand('HS', ls_type='None', home_shift_distance=0.03).run().edge(HS, True)
    while hand.step != HOME_SHIFT_MOVE:
        hand.run(1)
    hand.run(10).edge(LIMIT_AHEAD, True)
    assert hand.error is Error.LSTriggered


def test_the_reference_does_not_brake_its_own_overrun():
    """Its bounces neither."""
    soft, hard = (Hand('LS', ls_dec=dec).run() for dec in (1, 50))
    for one in (soft, hard):
        one.edge(LIMIT_AHEAD, True).run(1)
        one.edge(LIMIT_AHEAD, False).edge(LIMIT_AHEAD, True).run(20)
    assert hard.profile.position == soft.profile.position


def test_a_limit_ahead_while_it_turns_ends_nothing():
    hand = Hand('HSHS').run().edge(HS, True).run(1).edge(LIMIT_AHEAD, True)
    assert hand.step == HS_CLEAR_REVERSE
    assert hand.error is Error.NoError


def test_a_normal_limit_that_rises_while_the_axis_turns_to_it():
    """Nothing goes into it yet, but would."""
    hand = Hand('NearLS', on=(NEAR_AHEAD,)).run(60).edge(NEAR_AHEAD, False)
    while hand.step != LS_SEARCH:
        hand.run(1)
    assert hand.profile.velocity < 0.0
    hand.edge(LIMIT_AHEAD, True, way=-1)
    assert hand.error is Error.LSTriggered


def test_a_limit_behind_that_rises_while_it_moves_toward_may_be_swapped():
    hand = Hand('HS').run().edge(LIMIT_BEHIND, True)
    assert hand.error is Error.LSTriggered
    assert 'swapped' in hand.machine.ending.message


def test_a_swapped_limit_does_what_its_type_says():
    hand = Hand('HS', ls_type='ServoOff').run().edge(LIMIT_BEHIND, True)
    assert hand.machine.ending.silent
    assert hand.machine.ending.servo_off


def test_a_limit_that_an_axis_leaves_does_not_act_on_its_stop():
    hand = Hand('HS', ls_type='ServoOff').run()
    hand.machine.cancel()
    hand.edge(LIMIT_BEHIND, True)
    assert not hand.machine.ending.silent
    assert not hand.machine.ending.servo_off


@pytest.mark.parametrize('home_type', ['HS', 'LS'])
def test_both_limits_on_whatever_the_second_one_means(home_type):
    hand = Hand(home_type, on=(LIMIT_BEHIND,)).run(3).edge(LIMIT_AHEAD, True)
    assert hand.error is Error.LimitsBothOn


def test_a_limit_behind_that_is_left_may_bounce():
    hand = Hand('HS', on=(LIMIT_BEHIND,)).run(3)
    hand.edge(LIMIT_BEHIND, False).edge(LIMIT_BEHIND, True).edge(LIMIT_BEHIND, False)
    assert hand.error is Error.NoError
    hand.run(20).edge(LIMIT_BEHIND, True)
    assert hand.error is Error.LSTriggered


def test_the_first_error_stays():
    hand = Hand('HS').run()
    hand.machine.fail(Failure(Error.CycleLate, 'late'))
    hand.machine.fail(Failure(Error.EmergencyStop, 'emergency stop'))
    hand.machine.cancel()
    assert hand.error is Error.CycleLate
    assert hand.machine.ending.message == 'late in HSSearch'
    assert hand.machine.state is State.HSSearch


def test_a_harder_stop_that_follows_leaves_the_servo_to_be_switched_off():
    hand = Hand('ZPulse', ls_type='SlowDecServoOff', homing_velocity_slow=0.2).run()
    hand.edge(LIMIT_AHEAD, True).run(1)
    hand.machine.fail(Failure(Error.EmergencyStop, 'emergency stop'))
    assert hand.machine.ending.servo_off


# -- bounds, and what is told -------------------------------------------------------------------


def test_the_search_bound_counts_from_the_turning_point():
    hand = Hand('HSHS', max_search_distance=0.03).run(24).edge(HS, True)
    gone = hand.machine.traveled
    assert gone[1] == 0.03
    hand.run(1000)
    assert hand.error is Error.SearchDistanceExceeded
    turning_point = 0.05 + 0.0001
    assert hand.profile.position < turning_point


@pytest.mark.parametrize('following', [lambda at: at, lambda at: 0.05 + 2.0 * (at - 0.05)])
def test_command_and_feedback_are_both_bounded(following):
    """An axis that goes twice as far as it is told is stopped by its feedback."""
    hand = Hand('HS', max_search_distance=0.02, following_error=1).run(60, following)
    assert hand.error is Error.SearchDistanceExceeded
    assert following(hand.profile.position) < 0.05 + 0.02 + 0.02


def test_arrows_are_remembered():
    hand = Hand('HS').run().edge(HS, True).run(80)
    assert hand.machine.finished
    assert [event for _, event in hand.machine.arrows] == [Event.HS_RISES, Event.DONE, Event.DONE]


def test_a_pulse_that_was_latched_before_the_turn_is_forgotten():
    hand = Hand('HSReverseZPulse').run()
    hand.machine.latch(Input.Z_PULSE, 0.0401)
    hand.edge(HS, True).run(1)
    hand.machine.latch(Input.Z_PULSE, 0.0402)  # its message was late
    hand.run(40).edge(HS, False).run(1)
    assert hand.step == Z_PULSE_SEARCH_REVERSE_ARMED
    hand.machine.latch(Input.Z_PULSE, 0.0400)
    hand.run(120)
    assert hand.machine.reference.position == 0.0400


def test_a_pulse_counts_from_the_turning_point_not_from_where_the_end_was_detected():
    """The end yields a little more, and the pulse lies in between."""
    hand = Hand('MechanicalEndDetectionReverseZPulse')
    while hand.step == MECHANICAL_END_DETECTION:
        hand.run(1, lambda at: min(at, 0.052))
    hand.run(10, lambda at: 0.0525)
    hand.machine.latch(Input.Z_PULSE, 0.0522)
    hand.run(120, lambda at: min(at, 0.0525))
    assert hand.machine.reference.position == 0.0522


def test_the_passes_begin_anew_after_the_reversal():
    hand = Hand('HSHS', repeat=2).run().edge(HS, True, position=0.06).run(60)
    hand.edge(HS, False, position=0.06).run(60).edge(HS, True, position=0.06)
    assert len(hand.machine.passes.fine) == 1
    hand.run(60).edge(HS, False, position=0.06).run(60).edge(LIMIT_AHEAD, True)
    assert hand.step == HS_FALLING_EDGE_SEARCH_REVERSE
    assert hand.machine.passes.fine == []
    assert hand.machine.passes.coarse is None


def test_a_pause_holds_before_the_turn_and_continues():
    hand = Hand('HSHS', pause_mode=True).run().edge(HS, True)
    assert hand.machine.paused
    hand.run(40)
    assert hand.profile.velocity == 0.0
    hand.machine.resume()
    assert not hand.machine.paused
    hand.run(2)
    assert hand.profile.velocity < 0.0


def test_a_limit_that_rises_during_a_pause_brakes_harder_and_ends_nothing():
    hand, soft = (Hand('HSHS', pause_mode=True, ls_dec=50).run().edge(HS, True) for _ in range(2))
    hand.edge(LIMIT_AHEAD, True)
    assert hand.machine.paused
    assert hand.error is Error.NoError
    for one in (hand, soft):
        one.run(40)
    assert hand.profile.velocity == 0.0
    assert hand.profile.position < soft.profile.position - 0.0009
    hand.machine.resume()
    hand.run(5)
    assert hand.profile.velocity < 0.0


def test_a_normal_limit_that_rises_while_the_axis_rests_in_a_pause_ends_nothing():
    hand = Hand('NearLSReverseZPulse', pause_mode=True).run().edge(NEAR_AHEAD, True).run(60)
    assert hand.machine.paused
    hand.edge(LIMIT_AHEAD, True, way=1)
    assert hand.error is Error.NoError


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('home_type', ['HS', 'HSHS', 'HSZPulse'])
def test_a_home_switch_that_is_never_off_is_named(direction, home_type):
    """Case 21: a normally closed home switch, and `invert_hs_polarity` is forgotten."""
    closed = rig(home_type).switched(home_switch=HOME._replace(inverted=True))
    outcome = closed.home(direction, 0.05).outcome
    assert outcome.error is Error.LSTriggered
    assert 'home switch was on at the start and never fell' in outcome.message
    assert 'invert_hs_polarity' in outcome.message


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_a_home_switch_that_fell_once_is_not_named(direction):
    outcome = rig('HS').but(max_ls_reverse_distance=0.005).home(direction, 0.085).outcome
    assert outcome.error is Error.MaxLSRevDistanceTraveled
    assert 'invert_hs_polarity' not in outcome.message
