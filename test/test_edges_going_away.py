# SPDX-License-Identifier: Apache-2.0
"""Machines that home on the slow way back, and flags that are shorter than a bounce may be."""

from dataclasses import replace

import pytest
from core_rig import (
    DIRECTIONS,
    HS,
    HS_OFF_TYPES,
    LIMIT_AHEAD,
    TRUE_HOME,
    assert_homed,
    error_of,
    home_of,
    on_side,
    rig,
)

from homing_node.check import Severity, check
from homing_node.parameters.axis import axis_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.procedures.states import Error, HomeType, Input
from homing_node.rehearsal.link import Transport
from homing_node.rehearsal.run import Rehearsal, rehearse

LOW, HIGH = -10.0, 10.0

#: A router whose switches are beyond the travel, and which homes where they release.
ROUTER = {
    'home_type': 'HSReverse',
    'homing_velocity_fast': 0.024,
    'homing_velocity_fast_acc': 0.75,
    'homing_velocity_fast_dec': 0.75,
    'homing_velocity_slow': 0.00025,
    'homing_velocity_slow_acc': 0.75,
    'homing_velocity_slow_dec': 0.75,
    'homing_reverse_distance': 0.0005,
    'home_shift_distance': -0.002,
    'home_shift_velocity': 0.07,
    'switches': ['home_switch'],
    'max_jerk': 1000.0,
}
#: axis: (parameters, hard stops, home switch, start, where the switch releases)
ROUTER_AXES = {
    'x': (
        {'home_direction': 'Negative', 'travel': 0.702, 'home_position': 0.001},
        (-0.005, 0.702),
        (LOW, -0.001),
        0.3,
        -0.0009,
    ),
    'y': (
        {'home_direction': 'Negative', 'travel': 0.802, 'home_position': 0.001},
        (-0.005, 0.802),
        (LOW, -0.001),
        0.3,
        -0.0009,
    ),
    'z': (
        {'home_direction': 'Positive', 'travel': 0.116, 'home_position': -0.001},
        (-0.115, 0.005),
        (0.001, HIGH),
        -0.05,
        0.0009,
    ),
}


@pytest.mark.parametrize('axis', ROUTER_AXES)
def test_a_router_homes_where_its_switch_releases(axis):
    own, stops, flag, start, release = ROUTER_AXES[axis]
    parameters = axis_parameters({**ROUTER, **own})
    flags = {HS: SwitchLayout(*flag, 0.0001)}
    course = rehearse(parameters, AxisLayout(stops, flags, lag=0.002, start=start))
    assert course.outcome.success, course.outcome.message
    assert abs(course.outcome.home_position_raw - release) <= course.outcome.uncertainty + 1e-9
    reads = course.samples[-1].position - course.outcome.home_offset
    assert reads == pytest.approx(own['home_position'], abs=1e-6)


#: What leaves open where a limit released, or an old feedback: the estimates of its rise and of
#: its fall differ.
UNSURE = {
    'read 20 times a second': (Transport(poll_rate=20.0), (4, 7)),
    'read 50 times a second': (Transport(poll_rate=50.0), (0, 5, 9)),
    'an old feedback': (Transport(feedback_rate=50.0, feedback_delay=0.02), (3, 7)),
}


@pytest.mark.parametrize(('transport', 'seeds'), UNSURE.values(), ids=UNSURE)
def test_a_limit_is_no_obstacle_to_the_home_at_its_own_edge(transport, seeds):
    """Wherever between two readings the limit has released."""
    for seed in seeds:
        course = rig('LSOff').but(replace(transport, seed=seed)).home(start=0.05 + 0.00137 * seed)
        assert_homed(course, TRUE_HOME[HomeType.LSOff])


def test_the_limit_of_home_may_rise_as_far_before_home_as_that_is_uncertain():
    """Read 20 times a second on the way back at 0.1 m/s: home is known to some mm."""
    transport = Transport(
        poll_rate=20.0, feedback_rate=100.0, feedback_delay=0.01, stamp_error=0.002, seed=47
    )
    course = rig('LSOff', homing_velocity_slow=0.1).but(transport).home(start=0.0341)
    assert_homed(course, TRUE_HOME[HomeType.LSOff])


class SpringsBack(Rehearsal):
    """A rehearsal of an axis that springs back as soon as it stops."""

    def _send_feedback(self, time, position):
        before, self.before = getattr(self, 'before', position), position
        super()._send_feedback(time, position + 0.0003 * (position > before))


def test_a_limit_is_not_driven_into_where_home_may_be_as_well():
    """The stamps leave open where the axis was: home seems to lie where it was at the furthest."""
    made = rig('LS').but(Transport(header_offset=-0.1)).rehearsal()
    made.__class__ = SpringsBack
    course = made.home(limit=60.0)
    assert_homed(course, TRUE_HOME[HomeType.LS])
    rests = course.samples[-1].position
    assert rests == max(sample.position for sample in course.samples) < home_of(course)


SLIDE = AxisLayout(
    (-0.004, 0.065),
    {
        'negative_limit_switch': SwitchLayout(LOW, 0.0, 0.0005),
        'positive_limit_switch': SwitchLayout(0.061, HIGH),
    },
    lag=0.01,
    start=0.03,
)


@pytest.mark.parametrize('home_type', ['LSOff', 17, 'CiA402 17'])
@pytest.mark.parametrize('start', [-0.002, 0.0, 0.0004, 0.03, 0.062])
def test_a_slide_homes_where_its_limit_switch_releases(home_type, start):
    parameters = axis_parameters(
        {
            'home_type': home_type,
            'home_direction': 'Negative',
            'travel': 0.061,
            'homing_velocity_fast': 0.02,
            'homing_velocity_fast_acc': 0.1,
            'homing_velocity_fast_dec': 0.1,
            'homing_velocity_slow': 0.004,
            'homing_velocity_slow_acc': 0.1,
            'homing_velocity_slow_dec': 0.1,
            'home_shift_distance': -0.001,
            'timeout': 60,
            'switches': ['positive_limit_switch', 'negative_limit_switch'],
        }
    )
    course = rehearse(parameters, SLIDE, position=start)
    assert course.outcome.success, course.outcome.message
    assert abs(course.outcome.home_position_raw - 0.0005) <= course.outcome.uncertainty + 1e-9


# -- HSOff types on a short flag ------------------------------------------------------------------

FLAG = AxisLayout(
    (-0.1, 1.1),
    {
        HS: SwitchLayout(0.5, 0.502, 0.0001),
        'negative_limit_switch': SwitchLayout(LOW, 0.0),
        'positive_limit_switch': SwitchLayout(1.0, HIGH),
    },
    lag=0.004,
    start=0.2,
)


def short_flag(**changes):
    return axis_parameters(
        {
            'home_type': 'HSOff',
            'travel': 1.2,
            'homing_velocity_fast': 0.5,
            'homing_velocity_fast_acc': 5,
            'homing_velocity_fast_dec': 5,
            'homing_velocity_slow': 0.01,
            'homing_reverse_distance': 0.002,
            'ls_dec': 10,
            'max_jerk': 500,
            **changes,
        }
    )


@pytest.mark.parametrize('start', [0.05, 0.2, 0.4995, 0.501, 0.6, 0.97])
def test_a_flag_of_2_mm_at_500_mm_a_second_is_found_with_a_debounce(start):
    parameters = short_flag(switch_debounce=0.001)
    course = rehearse(parameters, FLAG, position=start)
    assert course.outcome.success, course.outcome.message
    assert abs(course.outcome.home_position_raw - 0.5021) <= course.outcome.uncertainty + 1e-9


def test_without_a_debounce_the_error_says_what_became_of_the_flag():
    course = rehearse(short_flag(), FLAG)
    assert course.outcome.error is Error.LSTriggered
    assert course.outcome.message.endswith(
        'the home switch fell 0.0021 m behind its rise, which was taken for a bounce (within '
        '0.0025 m, 5 ms x homing_velocity_fast); set switch_debounce, or a lower '
        'homing_velocity_fast'
    )


def test_the_check_says_it_before_anything_moves():
    found = {one.check: one for one in check({'x': short_flag()}, {'x': FLAG})}
    assert found['flag-bounce'].severity is Severity.error
    assert found['flag-bounce'].parameter == 'switch_debounce'
    better = short_flag(switch_debounce=found['flag-bounce'].right)
    assert 'flag-bounce' not in {one.check for one in check({'x': better}, {'x': FLAG})}
    assert rehearse(better, FLAG).outcome.success


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('home_type', HS_OFF_TYPES, ids=str)
@pytest.mark.parametrize('width', [0.0004, 0.0008])
def test_every_hs_off_type_finds_a_flag_that_lasts_longer_than_the_debounce(
    home_type, direction, width
):
    one = rig(home_type, switch_debounce=0.001).switched(**{HS: SwitchLayout(0.06, 0.06 + width)})
    course = one.home(direction)
    assert course.outcome.success, course.outcome.message
    if 'ZPulse' not in home_type:
        assert home_of(course, direction) == pytest.approx(0.06 + width, abs=5e-4)


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_a_bounce_shorter_than_the_debounce_is_no_flag(direction):
    """The contact opens for 2 ms behind its rise; the flag goes on."""
    made = rig('HSOff', switch_debounce=0.005).rehearsal(direction)
    axis, told = made.axis, []
    switch = axis.switch

    def bouncing(name, time, signal, *rest):
        switch(name, time, signal, *rest)
        if name == HS and signal and not told:
            told.append(time)
            switch(name, time + 0.001, False, *rest)
            switch(name, time + 0.003, True, *rest)

    axis.switch = bouncing
    course = made.home()
    assert home_of(course, direction) == pytest.approx(0.066, abs=5e-4)
    assert isinstance(made, Rehearsal)
    assert error_of(course) is Error.NoError


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('home_type', ['HSReverse', 'HSOffReverse', 'LSOff', 'LSLS'])
def test_a_wide_hysteresis_is_no_disagreement_of_the_passes(home_type, direction):
    """The edges of a flag's end lie 5 mm apart, five times edge_tolerance."""
    one = rig(home_type)
    flags = {name: flag._replace(hysteresis=0.005) for name, flag in one.layout.switches.items()}
    home = {'HSReverse': 0.055, 'HSOffReverse': 0.066, 'LSOff': 0.085, 'LSLS': 0.090}[home_type]
    course = one.switched(**flags).home(direction)
    assert abs(home_of(course, direction) - home) <= course.outcome.uncertainty + 1e-9


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_a_second_pass_over_a_limit_that_disagrees_is_no_home(direction):
    """Noise on the limit switch was taken for it in the first pass."""
    made = rig('LSLS', edge_tolerance=0.001).rehearsal(direction, 0.03)
    limit = Input(on_side(LIMIT_AHEAD, direction))
    made.axis.home(0.0)
    while direction * made.plant.position < 0.05:
        made.cycle()
    made.axis.switch(limit, made.time, True)
    while made.axis.state != 'LSFallingEdgeSearchReverse':
        made.cycle()
    while direction * made.plant.position > 0.045:
        made.cycle()
    made.axis.switch(limit, made.time, False)
    course = made.finish()
    assert course.outcome.error is Error.EdgeNotRepeated
    assert 'the second pass found the' in course.outcome.message
