# SPDX-License-Identifier: Apache-2.0
"""The plant alone: no ROS, no clock."""

from math import exp, inf, nan
from operator import itemgetter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_node.course import Happening
from homing_node.parameters.definition import InvalidParameters
from homing_node.plant.layout import SWITCHES, AxisLayout, SwitchLayout, mirrored
from homing_node.plant.layout_reader import layouts_from
from homing_node.plant.simulated_axis import SimulatedAxis

HOME = 'home_switch'
POSITIVE = 'positive_limit_switch'
NEGATIVE = 'negative_limit_switch'


def axis(start=0.0, stops=(-10.0, 10.0), **kwargs):
    switches = kwargs.pop('switches', {})
    return SimulatedAxis(AxisLayout(stops, switches, start=start, **kwargs))


def go(simulated, *positions, over=1.0):
    """Go from one position to the next, in one step each; return what happened, without times."""
    found = []
    for position in positions:
        simulated.follow(position, over)
        found += [(h.input, h.value, h.position) for h in simulated.step(over)]
    return found


# -- switches -------------------------------------------------------------------------------------


def test_switch_changes_at_its_thresholds_both_ways():
    simulated = axis(switches={HOME: SwitchLayout(2.0, 3.0)})
    assert go(simulated, 2.5) == [(HOME, True, 2.0)]
    assert go(simulated, 4.0) == [(HOME, False, 3.0)]
    assert go(simulated, 2.5) == [(HOME, True, 3.0)]
    assert go(simulated, 0.0) == [(HOME, False, 2.0)]


def test_switch_leaves_later_by_its_hysteresis():
    simulated = axis(switches={HOME: SwitchLayout(2.0, 3.0, hysteresis=0.25)})
    assert go(simulated, 1.875) == []
    assert go(simulated, 2.5) == [(HOME, True, 2.0)]
    assert go(simulated, 3.125, 2.5, 1.875, 2.5) == []
    assert go(simulated, 3.5) == [(HOME, False, 3.25)]
    assert go(simulated, 3.125) == []
    assert go(simulated, 1.0) == [(HOME, True, 3.0), (HOME, False, 1.75)]


def test_switch_passed_within_one_step_shows_both_edges():
    simulated = axis(switches={HOME: SwitchLayout(2.0, 2.0)})
    assert go(simulated, 5.0) == [(HOME, True, 2.0), (HOME, False, 2.0)]
    assert go(simulated, 0.0) == [(HOME, True, 2.0), (HOME, False, 2.0)]


def test_step_that_ends_on_a_threshold_neither_doubles_nor_loses_an_edge():
    simulated = axis(switches={HOME: SwitchLayout(2.0, 3.0)})
    assert go(simulated, 2.0) == [(HOME, True, 2.0)]
    assert go(simulated, 2.0) == []
    assert go(simulated, 1.0) == [(HOME, False, 2.0)]
    assert go(simulated, 2.0, 3.0) == [(HOME, True, 2.0)]  # both ends belong to the flag
    assert go(simulated, 3.0) == []
    assert go(simulated, 3.5) == [(HOME, False, 3.0)]
    assert go(simulated, 3.0) == [(HOME, True, 3.0)]


def test_inverted_switch_has_inverted_levels():
    switches = {
        HOME: SwitchLayout(2.0, 3.0, inverted=True),
        POSITIVE: SwitchLayout(0.0, 1.0, inverted=True),
        NEGATIVE: SwitchLayout(0.0, 1.0),
    }
    simulated = axis(switches=switches)
    assert simulated.levels() == {HOME: True, POSITIVE: False, NEGATIVE: True}
    assert go(simulated, 2.5) == [
        (POSITIVE, True, 1.0),
        (NEGATIVE, False, 1.0),
        (HOME, False, 2.0),
    ]
    assert simulated.levels() == {HOME: False, POSITIVE: True, NEGATIVE: False}


# -- latches --------------------------------------------------------------------------------------


def test_index_marks_of_a_step_come_in_the_order_of_travel():
    simulated = axis(index_pitch=0.5, index_offset=0.25)
    up = [('z_pulse', mark, mark) for mark in (0.25, 0.75, 1.25)]
    assert go(simulated, 1.5) == up
    assert go(simulated, 0.0) == up[::-1]
    assert go(simulated, -0.5) == [('z_pulse', -0.25, -0.25)]


@pytest.mark.parametrize(
    'layout, name',
    [({'index_pitch': 0.5}, 'z_pulse'), ({'touch_probe': 1.0}, 'touch_probe')],
)
def test_mark_is_latched_by_the_motion_that_comes_to_it(layout, name):
    latch = [(name, 1.0, 1.0)]
    simulated = axis(start=0.75, **layout)
    assert go(simulated, 1.0) == latch
    assert go(simulated, 1.0) == []
    assert go(simulated, 1.25) == []  # goes on
    assert go(simulated, 0.75) == latch  # crosses it
    assert go(simulated, 1.0) == latch
    assert go(simulated, 0.75) == []  # turned on it
    assert go(axis(start=1.0, **layout), 1.25, 0.75) == latch


@pytest.mark.parametrize('start', [k / 10 + 0.037 for k in range(-30, 30)])
def test_index_finds_its_next_marks_though_the_pitch_is_not_exact(start):
    up, down = (axis(start, index_pitch=0.1, index_offset=0.037) for _ in range(2))
    marks = [h[1] for h in go(down, start - 0.15)] + [h[1] for h in go(up, start + 0.15)]
    at_start = any(mark == start for mark in (0.037 + k * 0.1 for k in range(-40, 40)))
    assert len(marks) == (2 if at_start else 3)
    assert start not in marks


# -- drive ----------------------------------------------------------------------------------------


def test_happenings_have_the_time_at_which_the_feedback_was_there():
    simulated = axis(index_pitch=1.0, index_offset=0.25, switches={HOME: SwitchLayout(1.0, 9.0)})
    simulated.step(3.0)
    simulated.follow(2.0, 8.0)
    assert simulated.step(4.0) == [
        Happening(4.0, 'z_pulse', 0.25, 0.25),
        Happening(7.0, HOME, True, 1.0),
    ]
    assert simulated.step(4.0) == [Happening(8.0, 'z_pulse', 1.25, 1.25)]
    assert simulated.time == 11.0


def test_drive_interpolates_to_the_setpoint_from_where_the_command_is():
    simulated = axis()
    simulated.follow(1.0, 0.004)
    for _ in range(3):
        simulated.step(0.001)
    assert simulated.command == pytest.approx(0.75)
    simulated.follow(0.0, 0.003)
    simulated.step(0.001)
    assert simulated.position == pytest.approx(0.5)
    simulated.step(0.1)
    assert simulated.position == simulated.command == 0.0
    simulated.follow(2.0)
    assert simulated.command == 2.0
    simulated.step(0.001)
    assert simulated.position == 2.0


def test_lag_is_that_of_a_first_order_system():
    simulated = axis(lag=0.005)
    simulated.follow(1.0)
    for _ in range(7):
        simulated.step(0.001)
    assert simulated.position == pytest.approx(1.0 - exp(-7 / 5), abs=1e-14)


def test_lag_on_a_ramp_does_not_depend_on_the_steps():
    one, many = axis(lag=0.005), axis(lag=0.005)
    for simulated in (one, many):
        simulated.follow(1.0, 0.010)
    one.step(0.004)
    # Solution of lag · y' + y = u for u = 100 t, y(0) = 0.
    assert one.position == pytest.approx(100 * (0.004 - 0.005 * (1 - exp(-4 / 5))), abs=1e-14)
    one.step(0.011)
    for _ in range(15):
        many.step(0.001)
    assert many.position == pytest.approx(one.position, abs=1e-14)
    assert many.command == one.command == 1.0


def test_hard_stops_hold_the_axis_while_the_command_goes_on():
    simulated = axis(stops=(-1.0, 1.0), switches={POSITIVE: SwitchLayout(0.5, inf)})
    assert go(simulated, 3.0) == [(POSITIVE, True, 0.5)]
    assert (simulated.position, simulated.command) == (1.0, 3.0)
    assert go(simulated, 4.0) == []
    assert go(simulated, -2.0) == [(POSITIVE, False, 0.5)]
    assert simulated.position == -1.0
    with pytest.raises(ValueError, match='hard stops'):
        SimulatedAxis(AxisLayout((-1.0, 1.0), {}), position=1.5)


def steps(simulated, count):
    for _ in range(count):
        simulated.step(0.001)


def moving(velocity):
    """Return an axis that was told to go 5 mm at 50 mm/s, a setpoint every 4 ms."""
    simulated = axis(command_timeout=0.1, stop_dec=1.0)
    for cycle in range(1, 26):
        simulated.follow(0.0002 * cycle, 0.004, velocity)
        steps(simulated, 4)
    return simulated


@pytest.mark.parametrize('velocity', [None, 0.05], ids=['positions', 'velocities'])
def test_a_drive_without_setpoints_keeps_its_velocity_then_stops(velocity):
    simulated = moving(velocity)
    steps(simulated, 99)
    assert simulated.position == pytest.approx(0.005 + 0.05 * 0.099)
    assert simulated.enabled
    steps(simulated, 60)
    assert simulated.timed_out
    assert not simulated.enabled
    rest = simulated.position
    assert rest == pytest.approx(0.005 + 0.05 * 0.1 + 0.05**2 / 2.0, abs=0.0001)
    simulated.follow(1.0, 0.004, 0.05)
    simulated.step(1.0)
    assert simulated.position == rest
    simulated.servo(True)  # off and on again, of which it heard the latter
    simulated.follow(rest + 0.001, 0.004, 0.0)
    simulated.step(1.0)
    assert simulated.position == rest + 0.001


def test_a_drive_does_not_keep_the_speed_with_which_it_came_to_a_late_setpoint():
    simulated = moving(0.05)
    steps(simulated, 50)
    simulated.follow(0.0052, 0.004, 0.05)  # where it was long ago: it goes back there
    steps(simulated, 4)
    assert simulated.position == pytest.approx(0.0052)
    steps(simulated, 50)
    assert simulated.position == pytest.approx(0.0052 + 0.05 * 0.050)


def test_servo_off_holds_the_axis_and_forgets_the_command():
    simulated = axis(lag=0.005)
    simulated.follow(1.0, 0.1)
    simulated.step(0.05)
    held = simulated.position
    simulated.servo(False)
    simulated.follow(2.0)
    simulated.step(0.05)
    simulated.servo(True)
    simulated.step(0.05)
    assert simulated.position == simulated.command == held
    simulated.follow(held + 1.0)
    simulated.step(1.0)
    assert simulated.position == pytest.approx(held + 1.0)


# -- whatever the layout --------------------------------------------------------------------------

# A coarse grid of binary fractions: hits on thresholds are frequent, and positions are exact.
grid = st.integers(-32, 32).map(lambda k: k / 8)


@st.composite
def layouts(draw, **fixed):
    switches = {}
    for name in draw(st.sets(st.sampled_from(SWITCHES), max_size=4)):
        on_from, on_to = sorted((draw(grid), draw(grid)))
        hysteresis = draw(st.sampled_from([0.0, 0.125, 0.5]))
        switches[name] = SwitchLayout(on_from, on_to, hysteresis, draw(st.booleans()))
    values = {
        'index_pitch': draw(st.sampled_from([0.0, 0.25, 1.5])),
        'index_offset': draw(grid),
        'touch_probe': draw(st.none() | grid),
        'lag': draw(st.sampled_from([0.0, 0.5])),
        'start': draw(grid),
    }
    return AxisLayout((-5.0, 5.0), switches, **(values | fixed))


moves = st.lists(
    st.tuples(st.integers(-48, 48).map(lambda k: k / 8), st.sampled_from([0.0, 0.5, 1.0, 2.0])),
    max_size=12,
)


@given(layouts(), moves)
def test_mirrored_plant_has_the_mirrored_happenings(layout, moves):
    other = {
        name: name.replace('positive', '+')
        .replace('negative', 'positive')
        .replace('+', 'negative')
        for name in SWITCHES
    }
    plant, mirror = SimulatedAxis(layout), SimulatedAxis(mirrored(layout))
    assert mirrored(mirrored(layout)) == layout
    for position, over in moves:
        plant.follow(position, over)
        mirror.follow(-position, over)
        expected = [
            (h.time, other.get(h.input, h.input), h.value, -h.position)
            if isinstance(h.value, bool)
            else (h.time, h.input, -h.value, -h.position)
            for h in plant.step(1.0)
        ]
        assert sorted(mirror.step(1.0)) == sorted(expected)
        assert mirror.position == -plant.position
        assert mirror.levels() == {other[k]: level for k, level in plant.levels().items()}


@given(layouts(lag=0.0), st.lists(grid, min_size=1, max_size=6), st.integers(1, 24))
def test_happenings_do_not_depend_on_how_a_way_is_cut_into_steps(layout, ways, cuts):
    whole, cut = SimulatedAxis(layout), SimulatedAxis(layout)
    for end in ways:
        expected = go(whole, end)
        begin = cut.position
        way = sorted({begin + round(8 * (end - begin) * k / cuts) / 8 for k in range(1, cuts)})
        found = go(cut, *(way if end > begin else way[::-1]), end)
        # At one position the order of different inputs is free.
        assert sorted(found, key=itemgetter(0)) == sorted(expected, key=itemgetter(0))
        assert cut.levels() == whole.levels()


@given(layouts(), moves)
def test_happenings_agree_with_levels_positions_and_times(layout, moves):
    plant = SimulatedAxis(layout)
    marks = [layout.index_offset + k * layout.index_pitch for k in range(-60, 61)]
    for position, over in moves:
        plant.follow(position, over)
        start, before, levels = plant.time, plant.position, plant.levels()
        happenings = plant.step(1.0)
        after = plant.position
        low, high = min(before, after), max(before, after)
        last = start
        for h in happenings:
            assert last <= h.time <= plant.time
            assert before + (after - before) * (h.time - start) == pytest.approx(h.position)
            last = h.time
            if isinstance(h.value, bool):
                assert levels[h.input] is not h.value
                levels[h.input] = h.value
            else:
                assert h.value == h.position
        assert plant.levels() == levels
        for name, switch in layout.switches.items():
            if levels[name] is not switch.inverted:
                assert after >= switch.on_from - switch.hysteresis
                assert after <= switch.on_to + switch.hysteresis
            else:
                assert not switch.on_from <= after <= switch.on_to
        if layout.index_pitch:
            come_to = [m for m in marks if low <= m <= high and m != before]
            found = [h.value for h in happenings if h.input == 'z_pulse']
            assert found == (come_to if after > before else come_to[::-1])


# -- layouts from YAML ----------------------------------------------------------------------------


def test_layouts_are_read_from_a_mapping():
    mapping = {
        'x': {
            'hard_stops': [-1, 2.5],
            'home_switch': [1, 2],
            'home_switch_hysteresis': 0.125,
            'positive_limit_switch': [2, inf],
            'inverted': ['positive_limit_switch'],
            'index_pitch': 1,
            'index_offset': 0.5,
            'touch_probe': 0,
            'lag': 0.005,
            'start': 1,
        },
        'rotary': {'hard_stops': (0.0, 1.0)},
    }
    assert layouts_from(mapping) == {
        'x': AxisLayout(
            hard_stops=(-1.0, 2.5),
            switches={
                HOME: SwitchLayout(1.0, 2.0, 0.125),
                POSITIVE: SwitchLayout(2.0, inf, inverted=True),
            },
            index_pitch=1.0,
            index_offset=0.5,
            touch_probe=0.0,
            lag=0.005,
            start=1.0,
        ),
        'rotary': AxisLayout((0.0, 1.0), {}),
    }


def test_all_faults_of_layouts_are_reported_at_once():
    mapping = {
        'x': {
            'hard_stops': [-1.0, 1.0],
            'home_switch': [0.2, 0.1],
            'home_switch_hysteresis': -0.001,
            'positive_limit_switch': [1.0],
            'negative_limit_switch': 'left',
            'near_positive_limit_switch_hysteresis': 0.1,
            'inverted': ['external_positive_limit_switch', 'z_pulse'],
            'index_pitch': '0.01',
            'lag': True,
            'touch_probe': nan,
            'start': 3,
            'home_swich': [0.1, 0.2],
        },
        'y': {'hard_stops': [1, 1], 'start': 1, 'inverted': 'home_switch'},
        'z': {},
        'w': 3,
    }
    with pytest.raises(InvalidParameters) as caught:
        layouts_from(mapping)
    assert caught.value.faults == (
        'x.home_switch: 0.2 m or rad must be <= 0.1 m or rad, where it ends',
        'x.home_switch_hysteresis: -0.001 m or rad must be >= 0 and <= 1e+06 m or rad',
        'x.positive_limit_switch: [1.0] is not a pair [from, to] of numbers (m or rad)',
        "x.negative_limit_switch: 'left' is not a pair [from, to] of numbers (m or rad)",
        "x.inverted: 'z_pulse' is none of " + ', '.join(SWITCHES),
        "x.index_pitch: '0.01' is not a number (m or rad)",
        'x.lag: True is not a number (s)',
        'x.touch_probe: nan m or rad must be >= -1e+06 and <= 1e+06 m or rad',
        "x.home_swich: no such parameter; did you mean 'home_switch'?",
        'x.near_positive_limit_switch_hysteresis: near_positive_limit_switch is not given',
        'x.start: 3.0 m or rad must be within hard_stops, [-1.0, 1.0]',
        "y.inverted: 'home_switch' is not a list of inputs",
        'y.hard_stops: both are 1.0 m or rad, which leaves no travel',
        'z.hard_stops: required, but not set (the lower and the upper end, m or rad)',
        'w: 3 is not a mapping of keys to values',
    )


def test_a_switch_that_is_not_given_is_not_inverted():
    with pytest.raises(InvalidParameters, match=r'x\.inverted: home_switch is not given'):
        layouts_from({'x': {'hard_stops': [0, 1], 'inverted': ['home_switch']}})
