# SPDX-License-Identifier: Apache-2.0
"""Whole runs: the core against the simulated plant, for every type and both directions."""

import math
from itertools import pairwise

import pytest
from core_rig import (
    END,
    END_TYPES,
    EXTERNAL_AHEAD,
    EXTERNAL_BEHIND,
    HARDWARE_LIMIT_TYPES,
    HS,
    HS_OFF_TYPES,
    HS_ON_TYPES,
    INDEX_TYPES,
    LIMIT_AHEAD,
    LIMIT_BEHIND,
    LIMIT_TYPES,
    NEAR_AHEAD,
    NEAR_BEHIND,
    OFFSET,
    PITCH,
    RELEASE_TYPES,
    REVERSING,
    TRUE_HOME,
    TYPES,
    assert_homed,
    both_ways,
    bouncing,
    error_of,
    furthest,
    grouped,
    home_of,
    injected,
    on_side,
    path,
    rig,
    spoilt,
    target_of,
    thinned,
    with_another_flag,
)

from homing_node.core.machine import Machine
from homing_node.plant.layout import SwitchLayout
from homing_node.procedures.events import Event
from homing_node.procedures.states import Error, HomeType, Input
from homing_node.procedures.tables import PROCEDURES
from homing_node.rehearsal.link import Transport

BOTH_WAYS = both_ways
SEARCHING_TYPES = pytest.mark.parametrize('home_type', TRUE_HOME, ids=str)
#: Those whose next run finds the same place, not the next pulse.
REPEATING_TYPES = pytest.mark.parametrize(
    'home_type', [t for t in TRUE_HOME if t not in ('ZPulse', 'TouchProbe')], ids=str
)
REVERSING_TYPES = pytest.mark.parametrize('home_type', REVERSING, ids=str)
ON_SWITCH_TYPES = pytest.mark.parametrize('home_type', HS_ON_TYPES, ids=str)
OFF_SWITCH_TYPES = pytest.mark.parametrize('home_type', HS_OFF_TYPES, ids=str)
NOT_HARDWARE_LIMIT_TYPES = [t for t in LIMIT_TYPES if t not in HARDWARE_LIMIT_TYPES]
ON_LIMIT_TYPES = pytest.mark.parametrize('home_type', LIMIT_TYPES, ids=str)

REVERSAL = 'HSFallingEdgeSearchReverse'
AT_START = 'HSClearReverse'


def reversed_in(course):
    """Return whether a limit ahead turned the axis in a run."""
    return any(event is Event.LIMIT_AHEAD for _, event in course.arrows)


@pytest.fixture(scope='module', autouse=True)
def arrows_taken():
    """Collect (home type, step, event) of every arrow that any run of this file takes."""
    taken = set()
    advance = Machine._advance

    def noting(machine, event, cause):
        known = len(machine.arrows)
        advance(machine, event, cause)
        taken.update((machine.procedure.home_type, *arrow) for arrow in machine.arrows[known:])

    Machine._advance = noting
    yield taken
    Machine._advance = advance


# -- the home position, from everywhere (sections 3 to 5) -----------------------------------------


@BOTH_WAYS
@SEARCHING_TYPES
def test_from_before(home_type, direction):
    assert_homed(rig(home_type).home(direction), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@REVERSING_TYPES
@grouped(
    'start',
    [0.0021, 0.0599, 0.06, 0.0601, 0.063, 0.0659, 0.066, 0.0661, 0.08, 0.0899, 0.09, 0.0901, 0.1],
)
def test_home_switch_types_from_anywhere(home_type, direction, start):
    course = rig(home_type).home(direction, start)
    assert_homed(course, TRUE_HOME[home_type], direction)
    on_hs, beyond = 0.06 <= start <= 0.066, start > 0.066
    clears = on_hs and home_type not in HS_OFF_TYPES
    assert reversed_in(course) == beyond
    if clears:
        assert path(course)[0] == AT_START
    if start >= 0.09:
        assert path(course)[0] == REVERSAL
        assert furthest(course, direction) <= start + 1e-9


@BOTH_WAYS
def test_what_follows_a_home_switch_that_is_on_at_start(direction):
    second = rig('HSHS').home(direction, 0.063)
    assert path(second) == ['HSClearReverse', 'SecondHSSearch', 'HomeShift']
    probe = rig('HSTouchProbe').home(direction, 0.063)
    assert path(probe) == ['HSClearReverse', 'TouchProbeSearch', 'HomeShift']
    once = rig('HS').home(direction, 0.063)
    assert path(once) == ['HSClearReverse', 'HSSearch', 'HomeShift']


@BOTH_WAYS
@grouped(
    'home_type, start',
    [
        (home_type, start)
        for home_type in LIMIT_TYPES
        for start in (0.0021, 0.0799, 0.08, 0.085, 0.0851, 0.0899, 0.09, 0.095)
        if start < 0.09 or home_type in HARDWARE_LIMIT_TYPES
    ],
)  # else beyond a normal limit
def test_limit_types_from_anywhere(home_type, direction, start):
    one = rig(home_type)
    course = one.home(direction, start)
    assert_homed(course, TRUE_HOME[home_type], direction)
    on_limit = start >= target_of(one)[1]
    assert (path(course)[0] == 'LSFallingEdgeSearchReverse') == on_limit


@BOTH_WAYS
@pytest.mark.parametrize('home_type', [t for t in TRUE_HOME if 'Detection' not in t], ids=str)
def test_the_limit_behind_may_be_on_at_start(home_type, direction):
    one = rig(home_type)
    if home_type is HomeType.ZPulse:
        one = one.built(index_offset=0.0533, index_pitch=0.2)
    assert_homed(one.home(direction, 0.0), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@REPEATING_TYPES
def test_homing_again_from_the_edge_itself(home_type, direction):
    """Without a shift the axis rests exactly on the edge, where the level is undefined."""
    made = rig(home_type).rehearsal(direction)
    for _ in range(4):
        assert_homed(made.home(), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@REPEATING_TYPES
@grouped('away', [-1e-9, 0.0, 1e-9, 1e-5])
def test_starting_around_the_home_position(home_type, direction, away):
    one = rig(home_type)
    if home_type is HomeType.MechanicalEndDetection:
        away = -abs(away)
    assert_homed(one.home(direction, TRUE_HOME[home_type] + away), TRUE_HOME[home_type], direction)


@BOTH_WAYS
def test_an_axis_on_a_pulse_goes_to_the_next(direction):
    made = rig('ZPulse').rehearsal(direction)
    for k in (5, 6, 7):
        assert_homed(made.home(), OFFSET + k * PITCH, direction)


# -- narrow flags and momentary limits (section 7) ------------------------------------------------


@BOTH_WAYS
@ON_SWITCH_TYPES
@grouped('width', [1e-5, 3e-4, 0.002])
@grouped('start', [0.05, 0.0601, 0.075])
def test_a_flag_that_the_axis_overruns(home_type, direction, width, start):
    one = rig(home_type).switched(**{HS: SwitchLayout(0.06, 0.06 + width)})
    assert_homed(one.home(direction, start), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@OFF_SWITCH_TYPES
@grouped('start', [0.05, 0.0605, 0.075])
def test_a_narrow_flag_of_which_the_far_edge_counts(home_type, direction, start):
    one = rig(home_type).switched(**{HS: SwitchLayout(0.06, 0.062)})
    home = {'HSOffZPulse': 0.0633, 'HSOffReverseZPulse': 0.0533}.get(home_type, 0.062)
    assert_homed(one.home(direction, start), home, direction)


@BOTH_WAYS
@ON_LIMIT_TYPES
@grouped('width', [1e-5, 3e-4, 0.002])
def test_a_momentary_limit_as_the_reference(home_type, direction, width):
    one = rig(home_type)
    name, low = target_of(one)
    course = one.switched(**{name: SwitchLayout(low, low + width)}).home(direction)
    assert_homed(course, TRUE_HOME[home_type], direction)


@BOTH_WAYS
@REVERSING_TYPES
@grouped('width', [1e-5, 3e-4, 0.002])
def test_a_momentary_limit_reverses(home_type, direction, width):
    one = rig(home_type).switched(**{LIMIT_AHEAD: SwitchLayout(0.09, 0.09 + width)})
    course = one.home(direction, 0.08)
    assert REVERSAL in path(course)
    assert_homed(course, TRUE_HOME[home_type], direction)


@BOTH_WAYS
def test_a_momentary_limit_that_was_overrun_still_blocks_the_home_shift(direction):
    """The home switch is at the limit; its overrun passes the limit, which is off again."""
    one = rig('HS', home_shift_distance=0.02).switched(
        **{LIMIT_AHEAD: SwitchLayout(0.061, 0.0612)}
    )
    course = one.home(direction)
    assert error_of(course) is Error.LSTriggered
    assert furthest(course, direction) < 0.07


@BOTH_WAYS
@pytest.mark.parametrize('home_type', [*REVERSING, *LIMIT_TYPES], ids=str)
@pytest.mark.parametrize('width', [0.002, 0.006])
def test_a_bounce_at_the_far_end_of_a_flag_that_is_overrun(home_type, direction, width):
    """Neither is it where the axis came in, nor does it move that place."""
    one = rig(home_type)
    name, low = (HS, 0.06) if home_type in REVERSING else target_of(one)
    one = one.switched(**{name: SwitchLayout(low, low + width)}).but(
        homing_velocity_fast_acc=2, homing_velocity_fast_dec=2
    )  # it overruns by 10 mm
    far = low + width
    made = spoilt(
        one,
        lambda happening: (
            bouncing()(happening)
            if abs(happening.position * direction - far) < 1e-6
            else (happening,)
        ),
        direction,
    )
    home = {
        'HSOff': far,
        'HSOffReverse': far,
        'HSOffZPulse': OFFSET + math.ceil((far - OFFSET) / PITCH) * PITCH,
        'HSOffReverseZPulse': OFFSET + math.floor((far - OFFSET) / PITCH) * PITCH,
    }
    assert_homed(made.home(), home.get(home_type, TRUE_HOME[home_type]), direction)


@BOTH_WAYS
def test_a_flag_narrower_than_a_bounce_is_left_where_it_was_entered(direction):
    """0.9 mm: less than what 5 ms of bouncing take at the fast velocity."""
    one = (
        rig('HSReverseZPulse', index_margin=0.0, switch_stamp_error=0.0005)
        .switched(**{HS: SwitchLayout(0.0601, 0.061)})
        .built(index_pitch=0.0004, index_offset=0.0001)
    )
    made = spoilt(
        one,
        lambda happening: (
            bouncing(0.0002)(happening)
            if abs(happening.position * direction - 0.061) < 1e-6
            else (happening,)
        ),
        direction,
    )
    assert_homed(made.home(), 0.0597, direction)


# -- the reversal (section 5) ---------------------------------------------------------------------


@BOTH_WAYS
@REVERSING_TYPES
def test_the_reversal(home_type, direction):
    one = rig(home_type, homing_reverse_distance=0.012)
    course = one.home(direction, 0.08)
    assert path(course)[1] == REVERSAL
    assert path(course)[2] == path(course)[0]
    assert_homed(course, TRUE_HOME[home_type], direction)
    reversing = [s.position * direction for s in course.samples if s.state == REVERSAL]
    assert min(reversing) == pytest.approx(0.048, abs=1e-5)


@BOTH_WAYS
@pytest.mark.parametrize('distance', [0.0, 0.001, 0.004, 0.02])
def test_the_homing_reverse_distance_counts_from_the_edge(direction, distance):
    """Where stopping takes longer than the distance, the axis goes on at once."""
    course = rig('HSHS', homing_reverse_distance=distance).home(direction)
    lowest = min(
        s.position * direction
        for s in course.samples
        if s.state in ('HSClearReverse', 'SecondHSSearch')
    )
    assert lowest <= 0.06 - distance + 1e-5
    assert lowest >= 0.06 - max(distance, 0.009) - 1e-5
    assert_homed(course, 0.06, direction)


@BOTH_WAYS
@pytest.mark.parametrize('immediate', [False, True])
@pytest.mark.parametrize('home_type', [REVERSING[0], HomeType.LS], ids=str)
def test_immediate_stop(home_type, direction, immediate):
    course = rig(home_type, immediate_stop_at_ls=immediate).home(direction, 0.08)
    assert_homed(course, TRUE_HOME[home_type], direction)
    overrun = furthest(course, direction) - 0.09
    assert (overrun < 0.2 * 0.012) == immediate
    frozen = [
        s
        for s, t in zip(course.samples, course.samples[1:], strict=False)
        if abs(s.velocity) > 0.15 and abs(t.velocity) < 0.05
    ]
    assert bool(frozen) == immediate


@BOTH_WAYS
def test_an_immediate_stop_is_over_once_the_axis_has_turned(direction):
    """The message of the near limit, which rose first, comes after the turn."""
    one = rig('HS', immediate_stop_at_ls=True, near_ls_type='Dec').switched(
        **{NEAR_AHEAD: SwitchLayout(0.0899, 1.0)}
    )
    made, near, held = one.rehearsal(direction, 0.07), on_side(NEAR_AHEAD, direction), []
    report = made._report
    made._report = lambda h: held.append(h) if h.input == near else report(h)
    assert made.axis.home(made.time) is None
    while made.axis.profile.velocity > -0.15:
        made.cycle()
    made._report = report
    for happening in held:
        made.axis.switch(Input(near), happening.time, happening.value, made.time)
    turned = len(made.course.samples)
    made.finish(60.0)
    speeds = [s.velocity for s in made.course.samples[turned - 1 :]]
    assert max(abs(b - a) for a, b in pairwise(speeds)) < 0.05
    assert_homed(made.course, TRUE_HOME['HS'], direction)


@BOTH_WAYS
@REVERSING_TYPES
def test_immediate_stop_with_a_pause_stays_where_it_stopped(home_type, direction):
    made = rig(home_type, immediate_stop_at_ls=True, pause_mode=True).rehearsal(direction, 0.08)
    made.axis.home(0.0)
    while not made.axis.paused:
        made.cycle()
    at = made.plant.position
    for _ in range(100):
        position, velocity, _ = made.cycle()
    assert abs(position - at) < 0.002
    assert velocity == 0.0


@BOTH_WAYS
@REVERSING_TYPES
def test_one_reversal_only(home_type, direction):
    """The home switch is beyond the limit: found going away, never going toward."""
    one = rig(home_type).switched(**{HS: SwitchLayout(0.0915, 0.097)})
    course = one.home(direction)
    assert error_of(course) is Error.LSTriggered
    assert 'second time' in course.outcome.message
    assert path(course).count(REVERSAL) == 1


@BOTH_WAYS
def test_a_second_limit_ends_the_run_whatever_its_type(direction):
    one = rig('HS', ls_type='None').switched(**{HS: SwitchLayout(0.0915, 0.097)})
    course = one.home(direction)
    assert error_of(course) is Error.LSTriggered
    assert 'second time' in course.outcome.message


@BOTH_WAYS
def test_a_second_limit_does_what_its_type_says(direction):
    """The first one was the reversal; the axis has left it since."""
    one = rig('HS', ls_type='ServoOff', homing_reverse_distance=0.02).switched(
        **{HS: SwitchLayout(0.0915, 0.097)}
    )
    made = one.rehearsal(direction)
    course = made.home()
    assert error_of(course) is Error.LSTriggered
    assert 'second time' in course.outcome.message
    assert not made.axis.servo_on
    last = course.samples[-1]
    assert direction * last.position < 0.091
    assert direction * last.velocity > 0.19


@BOTH_WAYS
@REVERSING_TYPES
@pytest.mark.parametrize(('flag', 'pair'), [(NEAR_AHEAD, 'near'), (EXTERNAL_AHEAD, 'external')])
def test_near_and_external_limits_reverse_too(home_type, direction, flag, pair):
    one = rig(home_type, **{f'{pair}_ls_type': 'ServoOff'}).switched(
        **{flag: SwitchLayout(0.08, 1.0)}
    )
    course = one.home(direction, 0.075)
    assert path(course)[1] == REVERSAL
    assert furthest(course, direction) < 0.0901
    assert_homed(course, TRUE_HOME[home_type], direction)


@BOTH_WAYS
@pytest.mark.parametrize('starts', [0.08, 0.095], ids=['limit met', 'limit on'])
def test_the_reversal_is_bounded(direction, starts):
    one = rig('HS', max_ls_reverse_distance=0.02).switched(**{HS: SwitchLayout(0.06, 0.061)})
    course = one.home(direction, starts)
    assert error_of(course) is Error.MaxLSRevDistanceTraveled
    assert course.outcome.message == (
        'axis x: the home switch did not fall within 0.02 m (max_ls_reverse_distance) in '
        'HSFallingEdgeSearchReverse; is the home switch between the limits?'
    )


@BOTH_WAYS
def test_without_an_own_bound_the_reversal_has_the_search_bound(direction):
    one = rig('HS', max_search_distance=0.03)
    course = one.home(direction, 0.095)
    assert error_of(course) is Error.MaxLSRevDistanceTraveled
    assert 'within 0.03 m (max_search_distance)' in course.outcome.message


@BOTH_WAYS
@REVERSING_TYPES
def test_the_reversal_ends_at_the_limit_behind(home_type, direction):
    one = rig(home_type).switched(**{HS: SwitchLayout(0.2, 0.3)})
    course = one.home(direction)
    assert error_of(course) is Error.LSTriggered
    assert path(course)[-1] == REVERSAL
    assert 'behind' in course.outcome.message
    assert min(s.position * direction for s in course.samples) > 0.002 - 0.006


@BOTH_WAYS
@pytest.mark.parametrize('home_type', ['HSHS', 'HSTouchProbe'])
def test_a_limit_ahead_during_the_second_pass_reverses(home_type, direction):
    """The home switch, or the probe, is not found again."""
    one = rig(home_type).built(touch_probe=None)
    made = one.rehearsal(direction, 0.063)
    second = 'SecondHSSearch' if home_type == 'HSHS' else 'TouchProbeSearch'
    hs = made.plant._switches
    made.axis.home(0.0)
    while made.axis.state != second:
        made.cycle()
    hs[:] = [switch for switch in hs if switch.name != HS]
    made.plant._find_quiet()
    course = made.finish()
    assert REVERSAL in path(course)
    assert error_of(course) is Error.LSTriggered


@BOTH_WAYS
@pytest.mark.parametrize('home_type', ['HSZPulse', 'HSOffZPulse'])
def test_a_limit_ahead_before_the_pulse_reverses(home_type, direction):
    """Then the pulse is not there either: the second limit ends the run."""
    course = rig(home_type).built(index_offset=0.0, index_pitch=0.2).home(direction)
    assert path(course)[1] == REVERSAL
    assert error_of(course) is Error.LSTriggered


@BOTH_WAYS
def test_the_pulse_after_the_reversal_counts(direction):
    """One just before the edge, whose next is beyond the limit, would not."""
    one = rig('HSZPulse').built(index_offset=0.061, index_pitch=0.2)
    course = one.home(direction, 0.08)
    assert_homed(course, 0.061, direction)


# -- clearing (section 4) -------------------------------------------------------------------------


@BOTH_WAYS
@ON_SWITCH_TYPES
def test_clearing_the_home_switch_is_bounded(home_type, direction):
    one = rig(home_type, max_hs_on_at_start_reverse_distance=0.01).switched(
        **{HS: SwitchLayout(0.04, 0.066)}
    )
    course = one.home(direction, 0.063)
    assert error_of(course) is Error.MaxHSOnAtStartRevDistanceTraveled
    assert 'within 0.01 m (max_hs_on_at_start_reverse_distance)' in course.outcome.message


@BOTH_WAYS
def test_without_an_own_bound_clearing_has_the_search_bound(direction):
    one = rig('HS', max_search_distance=0.01).switched(**{HS: SwitchLayout(0.04, 0.066)})
    course = one.home(direction, 0.063)
    assert error_of(course) is Error.SearchDistanceExceeded
    assert 'max_search_distance' in course.outcome.message


@BOTH_WAYS
@ON_LIMIT_TYPES
def test_clearing_the_target_limit_is_bounded(home_type, direction):
    one = rig(home_type, max_ls_reverse_distance=0.01)
    one = one.switched(**{target_of(one)[0]: SwitchLayout(0.04, 1.0)})
    course = one.home(direction, 0.07)
    assert error_of(course) is Error.MaxLSRevDistanceTraveled
    assert path(course) == ['LSFallingEdgeSearchReverse']


@BOTH_WAYS
@REVERSING_TYPES
@grouped('start', [0.05, 0.063, 0.08])
def test_a_second_flag_within_the_reverse_distance_is_cleared_too(home_type, direction, start):
    """The switch is on again at the end of the distance: clearing goes on."""
    made = rig(home_type, homing_reverse_distance=0.008).rehearsal(direction, start)
    low, high = sorted((direction * 0.0490, direction * 0.0545))
    course = with_another_flag(made, HS, low, high).home()
    homes = {TRUE_HOME[home_type], 0.0490, 0.0545, 0.0433, 0.0533, 0.0633}
    assert min(abs(home_of(course, direction) - home) for home in homes) < 0.0005


@BOTH_WAYS
@ON_LIMIT_TYPES
def test_a_second_flag_of_the_target_limit_is_cleared_too(home_type, direction):
    one = rig(home_type, homing_reverse_distance=0.012)
    name, edge = target_of(one)
    made = one.rehearsal(direction, edge + 0.001)
    low, high = sorted((direction * (edge - 0.010), direction * (edge - 0.008)))
    course = with_another_flag(made, on_side(name, direction), low, high).home()
    homes = {TRUE_HOME[home_type] - 0.01, edge - 0.01, 0.0633, 0.0733, 0.0833}
    assert min(abs(home_of(course, direction) - home) for home in homes) < 0.0005


@BOTH_WAYS
def test_a_home_switch_that_is_on_again_before_the_second_pass(direction):
    """The overrun of the clearing meets another flag."""
    made = rig('HSHS').rehearsal(direction)
    low, high = sorted((direction * 0.0560, direction * 0.0575))
    course = with_another_flag(made, HS, low, high).home()
    assert path(course).count(AT_START) >= 2


@BOTH_WAYS
@pytest.mark.parametrize('home_type', LIMIT_TYPES[9:], ids=str)
def test_a_target_limit_that_is_on_again_before_the_second_pass(home_type, direction):
    """The overrun of the clearing meets another flag."""
    one = rig(home_type)
    name, at = target_of(one)
    low, high = sorted((direction * (at - 0.0040), direction * (at - 0.0025)))
    made = with_another_flag(one.rehearsal(direction), on_side(name, direction), low, high)
    course = made.home()
    assert any(event is Event.LS_ON for _, event in course.arrows)


@BOTH_WAYS
@ON_LIMIT_TYPES
def test_a_target_limit_that_bounces_while_it_is_cleared(home_type, direction):
    one = rig(home_type)
    made = spoilt(one, bouncing(0.002, 2), direction, target_of(one)[1] + 0.0005)
    assert_homed(made.home(), TRUE_HOME[home_type], direction)


# -- limits that are not the procedure's (section 6) ----------------------------------------------

ACTIONS = ['ServoOff', 'DecServoOff', 'Dec', 'SlowDecServoOff', 'SlowDec']


@BOTH_WAYS
@pytest.mark.parametrize('ls_type', ACTIONS)
@pytest.mark.parametrize('home_type', ['ZPulse', 'TouchProbe'])
def test_ls_types(home_type, direction, ls_type):
    one = rig(home_type, ls_type=ls_type, homing_velocity_slow=0.2).built(
        index_pitch=0.0, touch_probe=None
    )
    made = one.rehearsal(direction)
    course = made.home()
    assert error_of(course) is Error.LSTriggered
    assert 'positive' in course.outcome.message or direction < 0
    assert made.axis.servo_on == ('ServoOff' not in ls_type)
    beyond = furthest(course, direction) - 0.09
    if ls_type == 'ServoOff':
        assert beyond < 0.0011
        assert abs(course.samples[-1].velocity) > 0.19
    else:
        hardest = max(abs(s.acceleration) for s in course.samples[-30:])
        dec = 4.0 if 'Slow' in ls_type else 8.0
        assert hardest <= dec * (1 + 1e-9)
        assert hardest > 0.75 * dec
        assert course.samples[-1].velocity == 0.0
        assert 0.2**2 / 2 / dec < beyond < 0.2**2 / 2 / dec + 0.2 * (dec / 500 + 0.006)


@BOTH_WAYS
def test_a_limit_without_a_type_is_passed(direction):
    one = rig('ZPulse', ls_type='None').built(index_offset=0.095, index_pitch=0.2)
    assert_homed(one.home(direction), 0.095, direction)


@BOTH_WAYS
def test_a_search_toward_a_limit_without_a_type_that_is_on_is_begun(direction):
    assert_homed(rig('ZPulse', ls_type='None').home(direction, 0.091), 0.0933, direction)


@BOTH_WAYS
@pytest.mark.parametrize('second', ['ServoOff', 'Dec', 'DecServoOff'])
def test_a_stronger_limit_takes_over(direction, second):
    one = rig(
        'ZPulse',
        near_ls_type='SlowDec',
        external_ls_type=second,
        ls_slow_dec=2,
        homing_velocity_slow=0.2,
    ).built(index_pitch=0.0)
    one = one.switched(
        **{NEAR_AHEAD: SwitchLayout(0.08, 1.0), EXTERNAL_AHEAD: SwitchLayout(0.084, 1.0)}
    )
    made = one.rehearsal(direction)
    course = made.home()
    assert error_of(course) is Error.LSTriggered
    assert 'near' in course.outcome.message
    assert made.axis.servo_on == (second == 'Dec')
    if second == 'ServoOff':
        assert furthest(course, direction) < 0.0851
    else:
        assert furthest(course, direction) < 0.088


@BOTH_WAYS
def test_a_weaker_limit_does_not(direction):
    one = rig(
        'ZPulse',
        near_ls_type='Dec',
        external_ls_type='SlowDec',
        ls_slow_dec=1,
        homing_velocity_slow=0.2,
    ).built(index_pitch=0.0)
    one = one.switched(
        **{NEAR_AHEAD: SwitchLayout(0.08, 1.0), EXTERNAL_AHEAD: SwitchLayout(0.081, 1.0)}
    )
    assert furthest(one.home(direction), direction) < 0.086


@BOTH_WAYS
def test_a_gentler_limit_does_not_soften_a_cancel(direction):
    made = (
        rig('ZPulse', ls_type='SlowDec', ls_slow_dec=0.5, homing_velocity_slow=0.2)
        .built(index_pitch=0.0)
        .rehearsal(direction)
    )
    made.axis.home(0.0)
    while direction * made.plant.position < 0.089:
        made.cycle()
    made.axis.cancel()
    course = made.finish()
    assert error_of(course) is Error.Canceled
    assert furthest(course, direction) < 0.096


@BOTH_WAYS
@pytest.mark.parametrize('home_type', TYPES[14:17], ids=str)
def test_a_motion_into_a_limit_that_is_on_is_not_started(home_type, direction):
    one = rig(home_type, home_shift_distance=0.01)
    course = one.home(direction, 0.095)
    assert error_of(course) is Error.LSTriggered
    assert 'not started' in course.outcome.message
    assert course.samples == []


@BOTH_WAYS
@pytest.mark.parametrize('home_type', NOT_HARDWARE_LIMIT_TYPES, ids=str)
def test_the_hardware_limit_ends_near_and_external_types(home_type, direction):
    one = rig(home_type)
    course = one.switched(**{target_of(one)[0]: SwitchLayout(0.2, 1.0)}).home(direction)
    assert error_of(course) is Error.LSTriggered


@BOTH_WAYS
@ON_LIMIT_TYPES
def test_the_other_limits_ahead_are_ignored(home_type, direction):
    """Whatever is neither the reference nor a hardware limit."""
    one = rig(home_type, near_ls_type='ServoOff', external_ls_type='ServoOff')
    others = {NEAR_AHEAD, EXTERNAL_AHEAD} - {target_of(one)[0]}
    one = one.switched(**{name: SwitchLayout(0.06, 1.0) for name in others})
    assert_homed(one.home(direction), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@pytest.mark.parametrize('home_type', [t for t in TRUE_HOME if 'Detection' not in t], ids=str)
def test_swapped_limits_end_the_run(home_type, direction):
    """The input behind is the one that the axis meets going toward."""
    one = rig(home_type).built(index_pitch=0.0, touch_probe=None)
    switches = dict(one.layout.switches)
    switches[LIMIT_AHEAD], switches[LIMIT_BEHIND] = (
        switches[LIMIT_BEHIND],
        SwitchLayout(0.055, 1.0),
    )
    course = one.built(switches=switches).home(direction)
    assert error_of(course) is Error.LSTriggered
    assert 'swapped' in course.outcome.message


@BOTH_WAYS
@pytest.mark.parametrize('home_type', [t for t in TYPES if t != 'CurrentPos'], ids=str)
def test_both_limits_on(home_type, direction):
    one = rig(home_type).switched(
        **{LIMIT_BEHIND: SwitchLayout(-1, 1), LIMIT_AHEAD: SwitchLayout(-1, 1)}
    )
    course = one.home(direction)
    assert error_of(course) is Error.LimitsBothOn
    assert course.samples == []


@BOTH_WAYS
@pytest.mark.parametrize(
    'types',
    [
        {'ls_type': 'ServoOff'},
        {'ls_type': 'SlowDec', 'ls_dec': 2.0, 'ls_slow_dec': 1.0, 'external_ls_type': 'ServoOff'},
    ],
    ids=['hardware', 'external'],
)
def test_a_limit_acts_though_the_one_behind_is_stuck_on(types, direction):
    one = rig('ZPulse', homing_velocity_slow=0.2, **types).built(index_pitch=0.0)
    made = one.switched(
        **{LIMIT_BEHIND: SwitchLayout(-1, 1), EXTERNAL_AHEAD: SwitchLayout(0.092, 1)}
    ).rehearsal(direction, 0.03)
    course = made.home(limit=60.0)
    assert error_of(course) is Error.LimitsBothOn
    assert not made.axis.servo_on
    beyond = 0.090 if types['ls_type'] == 'ServoOff' else 0.092
    assert furthest(course, direction) == pytest.approx(beyond, abs=0.001)


@BOTH_WAYS
@pytest.mark.parametrize(
    ('pair', 'both'),
    [('near', (NEAR_AHEAD, NEAR_BEHIND)), ('external', (EXTERNAL_AHEAD, EXTERNAL_BEHIND))],
)
def test_both_near_or_external_limits_on(direction, pair, both):
    one = rig('HS', **{f'{pair}_ls_type': 'Dec'}).switched(
        **dict.fromkeys(both, SwitchLayout(-1, 1))
    )
    assert error_of(one.home(direction)) is Error.LimitsBothOn


@BOTH_WAYS
@pytest.mark.parametrize(
    ('start', 'state', 'inputs'),
    [(0.03, 'HSSearch', [LIMIT_AHEAD, LIMIT_BEHIND]), (0.1, REVERSAL, [LIMIT_BEHIND])],
)
def test_both_limits_on_during_a_run(direction, start, state, inputs):
    made = rig('HS').rehearsal(direction, start)
    course = injected(made, state, {on_side(one, direction): True for one in inputs}, after=3)
    assert error_of(course) is Error.LimitsBothOn
    assert course.samples[-1].velocity == 0.0


def test_current_position_asks_no_limit():
    one = rig('CurrentPos').switched(
        **{LIMIT_BEHIND: SwitchLayout(-1, 1), LIMIT_AHEAD: SwitchLayout(-1, 1)}
    )
    assert_homed(one.home(), 0.05)


@BOTH_WAYS
@pytest.mark.parametrize('everywhere', [False, True])
def test_all_ls_during_homing(direction, everywhere):
    """A near limit in the middle that rises while the axis leaves it at its other end."""
    one = rig('MechanicalEndDetectionHS', all_ls_during_homing=everywhere, near_ls_type='Dec')
    one = one.switched(**{NEAR_AHEAD: SwitchLayout(0.075, 0.08)}).but(
        mechanical_end_detection_ignore_ls=False
    )
    made = one.rehearsal(direction, 0.09)
    course = made.home()
    if everywhere:
        assert error_of(course) is Error.LSTriggered
        assert path(course)[-1] == REVERSAL
    else:
        assert_homed(course, 0.07, direction)


@BOTH_WAYS
@REVERSING_TYPES
def test_all_ls_during_homing_leaves_the_reversal_alone(home_type, direction):
    """A momentary limit rises again on the way back."""
    one = rig(home_type, all_ls_during_homing=True).switched(
        **{LIMIT_AHEAD: SwitchLayout(0.09, 0.0905)}
    )
    assert_homed(one.home(direction, 0.08), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@REVERSING_TYPES
def test_a_bounce_of_the_limit_behind_that_is_left_is_no_hit(home_type, direction):
    made = spoilt(rig(home_type), bouncing(), direction, 0.0)
    assert_homed(made.home(), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@SEARCHING_TYPES
def test_reversed_limit_inputs(home_type, direction):
    """`ls_direction: Reverse` with the inputs wired the other way around."""
    one = rig(home_type)
    swap = {
        name: (
            name.replace('positive', 'negative')
            if 'positive' in name
            else name.replace('negative', 'positive')
        )
        for name in one.layout.switches
    }
    wired = [swap.get(str(name), name) for name in one.values['switches']]
    swapped = {swap[name]: flag for name, flag in one.layout.switches.items()}
    course = (
        one.built(switches=swapped).but(switches=wired, ls_direction='Reverse').home(direction)
    )
    assert_homed(course, TRUE_HOME[home_type], direction)


# -- the edge, the shift and the pulses (sections 3 and 7) ----------------------------------------


@BOTH_WAYS
@pytest.mark.parametrize(
    ('home_type', 'shift', 'reads'),
    [
        (home_type, shift, reads)
        for home_type in TRUE_HOME
        for shift, reads in ((0.0, 0.0), (-0.012, 1.5), (0.004, -0.25))
        if shift <= 0.0 or not (home_type in LIMIT_TYPES or 'Detection' in home_type)
    ],
)
def test_home_shift_and_home_position(home_type, direction, shift, reads):
    one = rig(home_type, home_shift_distance=shift, home_position=reads)
    made = one.rehearsal(direction)
    outcome = made.home().outcome
    raw = direction * outcome.home_position_raw
    assert raw == pytest.approx(TRUE_HOME[home_type], abs=outcome.uncertainty + 1e-9)
    assert outcome.home_offset == pytest.approx(
        outcome.home_position_raw + direction * shift - reads, abs=1e-12
    )
    at_rest = made.axis.position
    assert at_rest == pytest.approx(reads, abs=2e-6)
    assert made.plant.position == pytest.approx(direction * (raw + shift), abs=2e-6)


@BOTH_WAYS
def test_current_position_moves_only_to_shift(direction):
    made = rig('CurrentPos').rehearsal(direction)
    assert_homed(made.home(), 0.05, direction)
    assert made.course.samples == []
    assert made.axis.position == pytest.approx(0.25)
    made = rig('CurrentPos', home_shift_distance=-0.01).rehearsal(direction)
    assert_homed(made.home(), 0.05, direction)
    assert direction * made.plant.position == pytest.approx(0.04)


@BOTH_WAYS
@pytest.mark.parametrize(
    ('shift', 'error'),
    [(0.04, Error.LSTriggered), (-0.07, Error.LSTriggered), (0.02, Error.NoError)],
)
def test_a_limit_ends_the_home_shift(direction, shift, error):
    course = rig('HS', home_shift_distance=shift).home(direction)
    assert error_of(course) is error
    assert path(course)[-1] == 'HomeShift'


@BOTH_WAYS
@pytest.mark.parametrize('count', [0, 1, 2, 4])
@pytest.mark.parametrize('home_type', [t for t in TYPES if 'ZPulse' in t], ids=str)
def test_the_nth_pulse(home_type, direction, count):
    one = rig(home_type, multiple_z_pulse=count, z_pulse_distance_check=0.004).built(
        index_pitch=0.004, index_offset=0.0013
    )
    if 'HS' in home_type:  # leave room before the limit
        one = one.switched(**{HS: SwitchLayout(0.050, 0.056)})
    course = one.home(direction, 0.045)
    edge = {
        'HSZPulse': 0.050,
        'HSReverseZPulse': 0.050,
        'HSOffZPulse': 0.056,
        'HSOffReverseZPulse': 0.056,
        'LSReverseZPulse': 0.09,
        'NearLSReverseZPulse': 0.08,
        'ExternalLSReverseZPulse': 0.085,
        'ZPulse': 0.045,
        'MechanicalEndDetectionReverseZPulse': END,
    }[home_type]
    pulses = [0.0013 + 0.004 * k for k in range(30)]
    if 'Reverse' in home_type:
        pulses = [p for p in reversed(pulses) if p < edge]
    else:
        pulses = [p for p in pulses if p > edge]
    assert_homed(course, pulses[max(count, 1) - 1], direction)


@BOTH_WAYS
@pytest.mark.parametrize(
    ('expected', 'tolerance', 'error'),
    [
        (0.0, 0.05, Error.NoError),
        (0.01, 0.05, Error.NoError),
        (0.0104, 0.05, Error.NoError),
        (0.0111, 0.05, Error.ZPulseDistanceCheckError),
        (0.0111, 0.2, Error.NoError),
        (0.02, 0.05, Error.ZPulseDistanceCheckError),
    ],
)
def test_the_distance_of_the_pulses(direction, expected, tolerance, error):
    course = rig(
        'ZPulse',
        multiple_z_pulse=2,
        z_pulse_distance_check=expected,
        z_pulse_distance_tolerance=tolerance,
    ).home(direction)
    assert error_of(course) is error
    if error:
        assert 'z_pulse_distance_check' in course.outcome.message or error is Error.NoError


@BOTH_WAYS
@pytest.mark.parametrize(
    ('bound', 'error'),
    [(0.0, Error.NoError), (0.0034, Error.NoError), (0.003, Error.ZPulseNotFound)],
)
def test_the_distance_to_the_pulse_is_bounded(direction, bound, error):
    course = rig('HSZPulse', max_z_pulse_distance=bound).home(direction)
    assert error_of(course) is error


@BOTH_WAYS
@grouped('apart', [-2e-4, -1e-6, 1e-6, 2e-4])
@grouped('latch_delay', [0.0, 0.001, 0.002, 0.004, 0.01])
@grouped('switch_delay', [0.0, 0.003, 0.01])
def test_a_pulse_at_the_edge_is_decided_by_its_position(
    direction, apart, latch_delay, switch_delay
):
    """However the messages overtake each other."""
    one = (
        rig('HSZPulse')
        .built(index_offset=0.06 + apart)
        .but(Transport(latch_delay=latch_delay, switch_delay=switch_delay))
    )
    nearest = 0.06 + apart if apart > 0 else 0.07 + apart
    assert_homed(one.home(direction), nearest, direction)


@BOTH_WAYS
@grouped('latch_delay', [0.0, 0.005, 0.015])
def test_a_pulse_passed_in_the_overrun_does_not_count(direction, latch_delay):
    one = rig('HSReverseZPulse').built(index_offset=0.0602).but(Transport(latch_delay=latch_delay))
    assert_homed(one.home(direction), 0.0502, direction)


@BOTH_WAYS
@grouped('hysteresis', [0.0, 1e-5, 5e-4])
@SEARCHING_TYPES
def test_hysteresis(home_type, direction, hysteresis):
    one = rig(home_type)
    flags = {
        name: SwitchLayout(f.on_from, f.on_to, hysteresis)
        for name, f in one.layout.switches.items()
    }
    home = TRUE_HOME[home_type]
    if home_type is HomeType.HSOff:
        home += hysteresis
    if home_type in ('MechanicalEndDetectionHS', 'MechanicalEndDetectionLS', *RELEASE_TYPES):
        home -= hysteresis
    assert_homed(one.switched(**flags).home(direction), home, direction)


#: Types and starts before, on and beyond the home switch.
FROM_THREE_PLACES = pytest.mark.parametrize(
    ('home_type', 'start'),
    [
        (home_type, start)
        for home_type in TRUE_HOME
        for start in (0.05, 0.063, 0.08)
        if start < 0.06 or home_type in REVERSING
    ],
)


@BOTH_WAYS
@FROM_THREE_PLACES
def test_polarity_of_every_input(home_type, direction, start):
    one = rig(home_type)
    inverted = {
        name: SwitchLayout(f.on_from, f.on_to, inverted=True)
        for name, f in one.layout.switches.items()
    }
    names = {
        HS: 'invert_hs_polarity',
        LIMIT_AHEAD: 'invert_positive_ls_polarity',
        LIMIT_BEHIND: 'invert_negative_ls_polarity',
        NEAR_AHEAD: 'invert_near_positive_ls_polarity',
        EXTERNAL_AHEAD: 'invert_external_positive_ls_polarity',
    }
    flags = {names[name]: True for name in inverted}
    course = one.switched(**inverted).but(**flags).home(direction, start)
    plain = rig(home_type).home(direction, start)
    assert course.samples == plain.samples
    assert course.outcome == plain.outcome


@BOTH_WAYS
@SEARCHING_TYPES
@pytest.mark.parametrize('debounce', [0.0, 0.01])
def test_contact_bounce(home_type, direction, debounce):
    """With and without a debounce the first edge is the reference."""
    made = spoilt(rig(home_type, switch_debounce=debounce), bouncing(0.0002), direction)
    assert_homed(made.home(), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@grouped('start', [0.05, 0.063, 0.08])
@REVERSING_TYPES
def test_contact_bounce_from_everywhere(home_type, direction, start):
    made = spoilt(rig(home_type), bouncing(0.0003), direction, start)
    assert_homed(made.home(), TRUE_HOME[home_type], direction)


@BOTH_WAYS
@pytest.mark.parametrize('home_type', ['HS', 'HSHS', 'HSReverseZPulse', 'LS'])
@pytest.mark.parametrize('feedback_rate', [50.0, 1000.0])
@grouped('delay', [0.002, 0.01])
@grouped('start', [0.0101, 0.0613, 0.0632, 0.0852])
@pytest.mark.parametrize('every', thinned([0.0005, 0.0012], 2))
def test_bounces_that_come_when_their_edge_has_turned_the_axis(
    home_type, direction, feedback_rate, delay, start, every
):
    """They lie before the turn, or before the one before it."""
    for velocity in (0.05, 0.2):
        one = rig(home_type, homing_velocity_fast=velocity).but(
            Transport(feedback_rate=feedback_rate, feedback_delay=delay, switch_delay=delay)
        )
        made = spoilt(one, bouncing(every, times=2), direction, start)
        assert_homed(made.home(), TRUE_HOME[HomeType(home_type)], direction)


@BOTH_WAYS
@SEARCHING_TYPES
def test_a_debounce_costs_no_accuracy(home_type, direction):
    transport = Transport(feedback_rate=1000.0)
    one = rig(home_type, switch_debounce=0.02).but(transport)
    if home_type in REVERSING:
        one = one.switched(**{HS: SwitchLayout(0.06, 0.074)})
    course = one.home(direction)
    home = TRUE_HOME[home_type]
    if home_type in HS_OFF_TYPES:
        home = {'HSOffZPulse': 0.0833, 'HSOffReverseZPulse': 0.0733}.get(home_type, 0.074)
    assert_homed(course, home, direction)
    plain = one.but(switch_debounce=0.0).home(direction).outcome
    assert course.outcome.uncertainty <= 1.01 * plain.uncertainty + 1e-9


@BOTH_WAYS
@SEARCHING_TYPES
@grouped(
    'transport',
    [
        Transport(feedback_delay=0.03),
        Transport(switch_delay=0.03),
        Transport(latch_delay=0.03),
        Transport(jitter=0.02, seed=1),
        Transport(100.0, 50.0, 0.01, 0.01, 0.01, 0.005),
        Transport(1000.0, 100.0),
    ],
)
def test_messages_on_the_way(home_type, direction, transport):
    one = rig(
        home_type, following_error=0.05, wrong_direction_distance=0.02, homing_velocity_fast=0.1
    ).but(transport)
    course = one.home(direction)
    assert_homed(course, TRUE_HOME[home_type], direction, more=1e-6)
    open_time = max(1.0 / transport.feedback_rate, 0.002)  # 0.002 s: switch_stamp_error
    assert course.outcome.uncertainty <= 1.2 * 0.1 * open_time


@BOTH_WAYS
def test_an_axis_does_not_go_on_until_late_feedback_shows_the_edge(direction):
    """It stops for the reference as soon as that is told, though it is not yet known where."""
    one = rig('HS', wrong_direction_distance=0.02)
    late = one.but(Transport(feedback_delay=0.04)).home(direction)
    assert furthest(late, direction) < furthest(one.home(direction), direction) + 0.001
    assert_homed(late, 0.06, direction)


@BOTH_WAYS
def test_open_loop_homing_takes_the_command(direction):
    one = rig('HS', open_loop_homing=True, max_jerk=5000).built(lag=0.02)
    course = one.home(direction)
    closed = rig('HS', max_jerk=5000).built(lag=0.02).home(direction)
    ahead = home_of(course, direction) - home_of(closed, direction)
    assert ahead == pytest.approx(0.2 * 0.022, abs=0.2 * 0.005)


@BOTH_WAYS
def test_open_loop_homing_of_an_axis_without_a_lag_is_as_good(direction):
    """The command has the time at which the axis is there, not that at which it was sent."""
    course = rig('HS', open_loop_homing=True).home(direction)
    assert home_of(course, direction) == pytest.approx(0.06, abs=1e-4)


@BOTH_WAYS
@SEARCHING_TYPES
def test_open_loop_homing_homes_every_type(home_type, direction):
    course = rig(home_type, open_loop_homing=True).home(direction)
    assert error_of(course) is Error.NoError
    assert home_of(course, direction) == pytest.approx(TRUE_HOME[home_type], abs=0.002)


@BOTH_WAYS
@pytest.mark.parametrize('latency', [0.0, 0.01])
def test_the_drivers_own_latency_is_taken_off(direction, latency):
    made = spoilt(
        rig('HS', switch_latency=latency),
        lambda one: (one._replace(time=one.time + 0.01),),
        direction,
    )
    late = home_of(made.home(), direction) - 0.06
    assert late == pytest.approx(0.2 * (0.01 - latency), abs=1e-5)


# -- both at once, and out of order (section 5 and 7) ---------------------------------------------


@BOTH_WAYS
@grouped('apart', [-1e-4, 0.0, 1e-4])
@grouped('late', [0.0, 0.002, 0.01])
@pytest.mark.parametrize('which', [HS, LIMIT_AHEAD])
def test_the_earlier_edge_decides_however_late_it_arrives(direction, apart, late, which):
    """The limit rises `apart` after the home switch; one of the messages is late."""
    one = rig('HS').switched(
        **{HS: SwitchLayout(0.06, 0.08), LIMIT_AHEAD: SwitchLayout(0.06 + apart, 1.0)}
    )
    made = one.rehearsal(direction)
    late_input = on_side(which, direction)
    send = made._send
    made._send = lambda topic, due, deliver: send(
        topic, due + (late if topic == late_input else 0.0), deliver
    )
    course = made.home()
    if apart > 0.0:
        assert_homed(course, 0.06, direction)
    else:
        assert error_of(course) is Error.LSTriggered


# -- errors (sections 8 and 9) --------------------------------------------------------------------


@BOTH_WAYS
@SEARCHING_TYPES
def test_every_search_is_bounded(home_type, direction):
    """Nothing is ever found: no switch, no pulse, no end."""
    one = rig(home_type, max_search_distance=0.02).built(
        index_pitch=0.0, touch_probe=None, hard_stops=(-9.0, 9.0)
    )
    switches = {name: SwitchLayout(5.0, 6.0) for name in one.layout.switches}
    course = one.switched(**switches).home(direction)
    assert error_of(course) is Error.SearchDistanceExceeded
    assert f'within 0.02 m (max_search_distance) in {path(course)[0]}' in course.outcome.message
    assert furthest(course, direction) < 0.05 + 0.02 + 0.2**2 / 2 / 8 + 0.01
    assert course.samples[-1].velocity == 0.0


@BOTH_WAYS
@pytest.mark.parametrize('home_type', [t for t in INDEX_TYPES if 'Reverse' in t], ids=str)
def test_the_reverse_search_is_bounded(home_type, direction):
    one = rig(home_type, max_search_distance=0.06, travel=0.5).built(
        index_pitch=0.0, hard_stops=(-9.0, END if 'Detection' in home_type else 9.0)
    )
    one = one.switched(**{LIMIT_BEHIND: SwitchLayout(-9.0, -5.0)})
    course = one.home(direction)
    assert error_of(course) is Error.SearchDistanceExceeded
    assert 'no Z-pulse came' in course.outcome.message


@BOTH_WAYS
def test_a_run_is_bounded_in_time(direction):
    course = rig('HS', timeout=0.1).home(direction, 0.01)
    assert error_of(course) is Error.Timeout
    assert course.outcome.message == ('axis x: not ended within 0.1 s (timeout) in HSSearch')
    assert course.duration < 0.2


@BOTH_WAYS
def test_an_edge_that_is_not_repeated(direction):
    """Noise was taken for the home switch in the first pass."""
    made = rig('HSHS', edge_tolerance=0.001).rehearsal(direction, 0.03)
    made.axis.home(0.0)
    while direction * made.plant.position < 0.05:
        made.cycle()
    made.axis.switch(Input(HS), made.time, True)
    while made.axis.state != 'HSClearReverse' or made.axis.machine.step.phase:
        made.cycle()
    while direction * made.plant.position > 0.045:
        made.cycle()
    made.axis.switch(Input(HS), made.time, False)
    course = made.finish()
    assert error_of(course) is Error.EdgeNotRepeated
    assert 'edge_tolerance' in course.outcome.message


# -- mechanical ends ------------------------------------------------------------------------------


@BOTH_WAYS
@pytest.mark.parametrize('duration', [0.0, 0.1])
def test_the_mechanical_end_must_last(direction, duration):
    quick = rig('MechanicalEndDetection', mechanical_end_detection_time=0.0).home(direction)
    course = rig('MechanicalEndDetection', mechanical_end_detection_time=duration).home(direction)
    assert_homed(course, END, direction)
    assert course.duration - quick.duration == pytest.approx(duration * (1 + 0.05 / 0.2), abs=0.03)


@BOTH_WAYS
@pytest.mark.parametrize(('start', 'warned'), [(END, True), (END - 0.01, False)])
def test_an_axis_that_begins_at_its_end_is_homed_with_a_warning(start, warned, direction):
    """A drive that is off looks the same: nothing has moved."""
    course = rig('MechanicalEndDetection').home(direction, start=start)
    assert_homed(course, END, direction)
    assert any('began at its end' in text for text in course.outcome.warnings) == warned


@BOTH_WAYS
@pytest.mark.parametrize('home_type', END_TYPES, ids=str)
def test_the_command_may_come_back_from_far_behind_the_end(home_type, direction):
    """It went on for the time of the detection, further than following_error."""
    one = rig(home_type, mechanical_end_detection_time=1.0)
    assert one.parameters().following_error_limit < 0.05
    assert_homed(one.home(direction), TRUE_HOME[home_type], direction, more=1e-6)


@BOTH_WAYS
def test_a_limit_before_the_mechanical_end(direction):
    one = rig('MechanicalEndDetectionLS')
    assert_homed(one.home(direction), 0.09, direction)
    course = one.but(mechanical_end_detection_ignore_ls=False).home(direction)
    assert error_of(course) is Error.LSTriggered


@BOTH_WAYS
@pytest.mark.parametrize(
    ('home_type', 'flag'),
    [('MechanicalEndDetectionHS', HS), ('MechanicalEndDetectionLS', LIMIT_AHEAD)],
)
def test_an_edge_that_rises_after_the_mechanical_end(home_type, flag, direction):
    one = rig(home_type).switched(**{flag: SwitchLayout(0.08, 0.085)})
    assert_homed(one.home(direction, 0.09), 0.085, direction)


# -- turns ----------------------------------------------------------------------------------------


@BOTH_WAYS
@grouped('start', [0.05 - i * 1e-4 for i in range(8)])
def test_without_a_reverse_distance_no_cycle_is_lost_at_the_turn(direction, start):
    """The cycle that sees the edge turns, wherever between two samples of feedback that was."""
    made = rig('HSHS').rehearsal(direction, start)
    made.axis.home(0.0)
    phases = set()
    while made.axis.running:
        made.cycle()
        if made.axis.running:
            phases.add(made.axis.machine.step.phase)
    assert_homed(made.finish(), TRUE_HOME[HomeType.HSHS], direction)
    assert 'further' not in phases


# -- pauses ---------------------------------------------------------------------------------------


@BOTH_WAYS
@FROM_THREE_PLACES
def test_pause_mode(home_type, direction, start):
    """A pause before each reversal; the home is the same."""
    one = rig(home_type, pause_mode=True)
    made = one.rehearsal(direction, start)
    made.axis.home(0.0)
    pauses, at_rest = 0, 0
    while made.axis.running:
        _, velocity, _ = made.cycle()
        at_rest = at_rest + 1 if made.axis.paused and velocity == 0.0 else 0
        if at_rest > 5:
            made.axis.resume()
            pauses += 1
    course = made.finish()
    assert_homed(course, TRUE_HOME[home_type], direction)
    assert pauses >= 1
    turns = [
        s
        for s, t in zip(course.samples, course.samples[1:], strict=False)
        if s.velocity * t.velocity < 0.0
    ]
    assert turns == []


# -- repeated passes ------------------------------------------------------------------------------


#: The home types with a slow pass, and the state and phase in which it is made.
SLOW_PASSES = {
    'HSHS': ('SecondHSSearch', ''),
    'HSTouchProbe': ('TouchProbeSearch', ''),
    'HSReverse': ('HSFallingEdgeSearchReverse', 'slow'),
    'HSOffReverse': ('SecondHSSearch', 'reverse'),
    **dict.fromkeys(RELEASE_TYPES[1:], ('LSFallingEdgeSearchReverse', 'slow')),
    **dict.fromkeys(LIMIT_TYPES[9:], ('LSSearch', 'second')),
}


def test_every_type_with_a_slow_pass_can_repeat_it():
    repeating = {t for t, one in PROCEDURES.items() if Event.REPEAT in one.events}
    assert repeating == set(SLOW_PASSES)


@pytest.mark.parametrize('home_type', SLOW_PASSES)
@pytest.mark.parametrize('repeat', [1, 2, 5])
def test_passes_are_repeated_from_the_same_side(home_type, repeat):
    one = rig(home_type, repeat=repeat)
    course = one.home(start=0.055)
    assert home_of(course) == pytest.approx(TRUE_HOME[HomeType(home_type)], abs=1e-6)
    taken = [step for step, event in course.arrows if event is not Event.DONE]
    assert taken.count(SLOW_PASSES[home_type]) == repeat
    assert course.outcome.passes == repeat
    assert course.outcome.passes_range <= 1e-6


# -- coverage -------------------------------------------------------------------------------------


def test_every_arrow_was_taken(request, arrows_taken):
    """Every arrow of every table was taken by some run of this file."""
    chosen = request.config.option.keyword or any('::' in a for a in request.config.args)
    if chosen:
        pytest.skip('needs all tests of this file')
    every = {
        (home_type, step, event)
        for home_type, procedure in PROCEDURES.items()
        for step, row in procedure.rows.items()
        for event in row.on
    }
    missed = sorted(
        f'{home_type}: {step} -- {event}' for home_type, step, event in every - arrows_taken
    )
    assert not missed, '\n'.join(['not taken:', *missed])
