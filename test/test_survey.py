# SPDX-License-Identifier: Apache-2.0
"""What a survey makes of its passes: places, delays, doubts, what was not seen, a layout file."""

from dataclasses import replace
from math import inf

import pytest
from hypothesis import given
from hypothesis import strategies as st

from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.units import Unit
from homing_node.plant import layout_file
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.plant.simulated_axis import SimulatedAxis
from homing_node.procedures.states import Error, Input, LSDirection
from homing_node.survey.edges import Kind, fit
from homing_node.survey.index import Marks, marks_of
from homing_node.survey.judgement import Survey, judge
from homing_node.survey.passes import Pass, SeenEdge, lag_of
from homing_node.survey.plan import Plan
from homing_node.survey.report import layout_text

HS, UP, DOWN = Input.HOME_SWITCH, Input.POSITIVE_LIMIT_SWITCH, Input.NEGATIVE_LIMIT_SWITCH
ENDS = (0.0, 0.2)
VELOCITIES = (-0.02, 0.01, -0.01, 0.02)
WIRED = axis_parameters(
    {
        'home_type': 'HSZPulse',
        'travel': 0.2,
        'switches': [str(one) for one in (HS, UP, DOWN, Input.Z_PULSE, Input.TOUCH_PROBE)],
    }
)
OFF = dict.fromkeys((HS, UP, DOWN), False)


def places(flag):
    """Return where the level of a switch changes: place, way of the motion, level then."""
    low, high, hysteresis = flag
    return [
        (low, 1, True),
        (high + hysteresis, 1, False),
        (high, -1, True),
        (low - hysteresis, -1, False),
    ]


def passes(flags, delay=0.0, pulses=(), off=lambda: 0.0, doubt=1e-5):
    """Return passes over flags in both ways at two velocities; limits stop none of them."""
    made = []
    for velocity in VELOCITIES:
        way = 1 if velocity > 0.0 else -1
        edges = [
            SeenEdge(name, level, place + velocity * delay + off(), doubt, velocity)
            for name, flag in flags.items()
            for place, of_way, level in places(flag)
            if of_way == way and ENDS[0] < place < ENDS[1]
        ]
        edges += [SeenEdge(Input.Z_PULSE, True, pulse, 1e-6, velocity) for pulse in pulses]
        edges.sort(key=lambda one: one.position * way)
        made.append(Pass(*ENDS[::way], velocity, tuple(edges), behind=(0.004 * abs(velocity),)))
    return made


GOOD = {HS: (0.1, 0.12, 2e-4), UP: (0.19, inf, 1e-4), DOWN: (-inf, 0.01, 0.0)}


# ---------------------------------------------------------------------------------------- the fit


@given(
    delay=st.floats(0.0, 0.05),
    low=st.floats(0.02, 0.1),
    width=st.floats(0.001, 0.05),
    hysteresis=st.floats(0.0, 0.005),
    seed=st.randoms(),
)
def test_whatever_the_delay_the_truth_is_in_its_range(delay, low, width, hysteresis, seed):
    flag = (low, low + width, hysteresis)
    made = passes({HS: flag}, delay, off=lambda: seed.uniform(-1e-5, 1e-5))
    found = fit([edge for one in made for edge in one.edges])
    assert found.spread == 1.0
    assert found.delay.low - 1e-9 <= delay <= found.delay.high + 1e-9
    for place, way, level in places(flag):
        known = found.places[Kind(level, way)]
        assert known.low - 1e-9 <= place <= known.high + 1e-9
        assert known.half < 6e-5


def test_edges_that_do_not_repeat_are_less_exact_than_they_say():
    edges = [SeenEdge(HS, True, 0.1 + off, 1e-5, 0.01) for off in (0.0, 6e-5)]
    found = fit(edges)
    assert found.spread == pytest.approx(3.0)
    known = found.places[Kind(True, 1)]
    assert known.low <= 0.1 + 3e-5 and known.high >= 0.1 + 3e-5 - 0.1 * 0.01


@pytest.mark.parametrize(
    'positions, expected',
    [
        ([], None),
        ([0.01, 0.01], 0.01),
        ([0.013, 0.023, 0.0230001, 0.043], Marks(0.01, 0.003, 0.0, 0.0, 3)),
        ([-0.017, -0.007], Marks(0.01, 0.003, 0.0, 0.0, 2)),
    ],
)
def test_the_marks_of_an_index(positions, expected):
    found = marks_of([SeenEdge(Input.Z_PULSE, True, one, 1e-6, 0.01) for one in positions])
    if isinstance(expected, Marks):
        assert found[:2] == pytest.approx(expected[:2], abs=1e-6) and found.seen == expected.seen
        assert 0.0 < found.pitch_half <= 2e-6 and 0.0 < found.offset_half <= 1e-6
    else:
        assert found == expected


def test_marks_that_are_not_evenly_spaced():
    pulses = [SeenEdge(Input.Z_PULSE, True, one, 1e-6, 0.01) for one in (0.01, 0.02, 0.0345)]
    with pytest.raises(ValueError, match='not evenly spaced'):
        marks_of(pulses)


# ---------------------------------------------------------------------------------- the judgement


def test_a_good_machine():
    found = judge(WIRED, passes(GOOD, pulses=[0.013, 0.023, 0.033]), OFF)
    assert found.doubts == []
    flags = found.layout.switches
    assert flags[HS] == pytest.approx((0.1, 0.12, 2e-4, False), abs=2.1e-5)
    assert flags[UP].on_to == inf and flags[DOWN].on_from == -inf
    assert (flags[UP].on_from, flags[DOWN].on_to) == pytest.approx((0.19, 0.01), abs=2.1e-5)
    assert found.layout.index_pitch == pytest.approx(0.01, abs=1e-6)
    assert found.layout.lag == pytest.approx(0.004)
    assert [text.partition(':')[0] for text in found.unseen] == [
        'the touch probe',
        'the lower hard stop',
        'the upper hard stop',
    ]
    assert f'the driver of {HS} publishes 0 to 2 ms after the edge' in found.seen
    assert found.advice == {}


def test_the_edges_of_a_late_driver_are_put_right_and_its_delay_is_told():
    found = judge(WIRED, passes(GOOD, delay=0.02), OFF)
    assert found.layout.switches[HS][:3] == pytest.approx((0.1, 0.12, 2e-4), abs=1e-4)
    assert any(text.startswith('set switch_latency: 0.02 (it is 0 s)') for text in found.seen)
    assert f'the driver of {HS} publishes 18 to 22 ms after the edge' in found.seen
    assert found.advice == {'switch_latency': 0.02, 'switch_stamp_error': 0.004}
    assert found.exact[f'{HS}[0]'] < 1e-4
    taken_off = replace(WIRED, switch_latency=0.02)
    found = judge(taken_off, passes(GOOD, delay=-0.02), OFF)
    assert found.advice['switch_latency'] == 0.001


def test_a_switch_that_reads_the_wrong_way_round():
    turned = [
        one._replace(edges=tuple(edge._replace(level=not edge.level) for edge in one.edges))
        for one in passes({HS: GOOD[HS]})
    ]
    found = judge(WIRED, turned, OFF | {HS: True})
    (doubt,) = found.doubts
    assert (doubt.parameter, doubt.value) == ('invert_hs_polarity', True)
    assert 'off between 0.09' in doubt.text and found.layout.switches[HS].inverted
    assert found.layout.switches[HS].on_from == pytest.approx(0.1, abs=2.1e-5)


def test_a_limit_that_is_on_all_the_way():
    found = judge(WIRED, passes({HS: GOOD[HS]}), OFF | {UP: True})
    (doubt,) = found.doubts
    assert (doubt.parameter, doubt.value) == ('invert_positive_ls_polarity', True)
    assert 'on all the way between 0 and 0.2 m' in doubt.text
    assert any(text.startswith(f'{DOWN}: it stayed off between') for text in found.unseen)


@pytest.mark.parametrize('reverse', [False, True])
def test_limits_that_are_swapped(reverse):
    p = WIRED if not reverse else replace(WIRED, ls_direction=LSDirection.Reverse)
    swapped = {UP: GOOD[DOWN], DOWN: GOOD[UP]}
    first, second = (GOOD, swapped) if reverse else (swapped, GOOD)
    doubts = judge(p, passes(first), OFF).doubts
    value = LSDirection.Normal if reverse else LSDirection.Reverse
    assert {(one.parameter, one.value) for one in doubts} == {('ls_direction', value)}
    assert judge(p, passes(second), OFF).doubts == []


def test_a_home_switch_that_reaches_to_the_end_of_the_axis():
    for flag, low, high in (((0.15, inf, 0.0), 0.15, inf), ((-inf, 0.05, 0.0), -inf, 0.05)):
        found = judge(WIRED, passes({**GOOD, HS: flag}), OFF)
        assert found.doubts == []
        assert found.layout.switches[HS][:2] == pytest.approx((low, high), abs=2.1e-5)


def test_a_switch_with_two_flags_is_no_flag():
    made = passes({HS: GOOD[HS]})
    second = passes({HS: (0.05, 0.06, 2e-4)})
    both = [a._replace(edges=a.edges + b.edges) for a, b in zip(made, second, strict=True)]
    found = judge(WIRED, both, OFF)
    assert [one.input for one in found.doubts] == [HS] and 'two flags' in found.doubts[0].text
    assert HS not in found.layout.switches


def test_a_flag_that_was_met_on_one_way_only():
    one_way = [one for one in passes({HS: GOOD[HS]}) if one.velocity > 0.0]
    found = judge(WIRED, one_way, OFF)
    assert any(text.startswith(f'the hysteresis of {HS}') for text in found.unseen)
    assert found.layout.switches[HS][:2] == pytest.approx((0.1, 0.1202), abs=1e-4)


def test_a_survey_that_a_fault_ends():
    (one,) = passes({HS: GOOD[HS]})[1:2]
    ended = one._replace(end=0.11, error=Error.FollowingError, message='the axis stays behind')
    found = judge(WIRED, [ended._replace(edges=ended.edges[:1])], OFF | {UP: None})
    assert found.unseen[0].startswith('what is beyond 0.11 m: the survey ended there')
    assert f'{UP}: no message of it has come' in ' '.join(found.unseen)
    assert found.layout.switches[HS].on_to == inf


def test_the_lag_and_the_overrun():
    made = [Pass(0.0, 0.1, 0.02, behind=(2e-4,)), Pass(0.1, 0.0, -0.01, behind=(1e-4, 1.1e-4))]
    assert lag_of(made) == pytest.approx(0.01)
    assert lag_of([]) is None
    rise = SeenEdge(UP, True, 0.19, 1e-5, 0.02)
    stopped = Pass(0.0, 0.1905, 0.02, (rise,), Error.LSTriggered)
    assert stopped.overrun == pytest.approx(5e-4) and made[0].overrun is None
    found = judge(WIRED, [stopped], OFF)
    assert 'from 0.02 m/s the axis stops within 500 µm behind a limit switch' in found.seen


# ------------------------------------------------------------------------------------------- plan


def run(plan, low, high):
    """Make the moves of a plan on an axis with a limit at either end; return where they end."""
    position, ends = 0.0, []
    while (move := plan.next()) is not None:
        goal = position + move.distance
        end = min(max(goal, low), high)
        error = Error.NoError if end == goal else Error.LSTriggered
        way = 1 if move.distance > 0.0 else -1
        plan.add(Pass(position, end, way * move.velocity, error=error))
        position = end
        ends.append((round(end, 9), move.velocity))
    return ends


def test_a_survey_goes_both_ways_at_two_velocities_and_back():
    assert run(Plan(0.0, 0.1, 0.02, 1.0), -0.5, 0.5) == [
        (0.1, 0.02),
        (-0.1, 0.02),
        (0.1, 0.01),
        (-0.1, 0.01),
        (0.1, 0.02),
        (0.0, 0.02),
    ]
    assert run(Plan(0.0, 0.1, 0.02, 1.0), -0.05, 0.03) == [
        (0.03, 0.02),
        (-0.05, 0.02),
        (0.03, 0.01),
        (-0.05, 0.01),
        (0.03, 0.02),
        (0.0, 0.02),
    ]


def test_no_motion_is_longer_than_it_may_be():
    plan = Plan(0.0, 0.1, 0.02, 0.15)
    ends = run(plan, -0.5, 0.5)
    assert max(abs(one.end - one.begin) for one in plan.passes) <= 0.15
    assert [end for end, _ in ends][:4] == [0.1, -0.05, -0.1, 0.05]


def test_a_survey_ends_with_a_fault():
    plan = Plan(0.0, 0.1, 0.02, 1.0)
    plan.add(Pass(0.0, 0.05, 0.02, error=Error.FollowingError))
    assert plan.next() is None and plan.failure is plan.passes[0]


@pytest.mark.parametrize('bad', [{'within': 0.0}, {'velocity': -1.0}, {'travel': inf}])
def test_numbers_that_make_no_survey(bad):
    values = {'within': 0.1, 'velocity': 0.02, 'travel': 1.0, **bad}
    with pytest.raises(ValueError, match=f'{next(iter(bad))}: .* must be > 0'):
        Plan(0.0, **values)


# ------------------------------------------------------------------------------------------- file


def test_the_layout_file_can_be_read(tmp_path):
    found = judge(WIRED, passes(GOOD, pulses=[0.013, 0.023]), OFF, {HS: 100.0, UP: 0.0})
    found.layout = found.layout._replace(hard_stops=(-0.001, inf))
    text = layout_text('y', found, Unit.m, ['surveyed'])
    assert text.startswith("# surveyed\n'y':\n  hard_stops: [-0.001, null]\n")
    assert '  home_switch: [0.09999, 0.12001]  # ± 20 µm, ± 20 µm\n' in text
    assert '  # Not seen:\n  # - the touch probe: ' in text
    path = tmp_path / 'machine.yaml'
    path.write_text(text)
    read = layout_file.load(path).layouts['y']
    assert read.switch_rate == 100.0 and read.hard_stops == (-0.001, inf)
    for name in (HS, UP, DOWN):
        assert read.switches[name] == pytest.approx(found.layout.switches[name], abs=1e-9)
    for key in ('index_pitch', 'index_offset', 'lag', 'start'):
        assert getattr(read, key) == pytest.approx(getattr(found.layout, key), abs=1e-9)


def test_a_layout_file_says_which_switches_are_normally_closed(tmp_path):
    flags = {str(HS): SwitchLayout(0.1, 0.12, 0.0, True), str(UP): SwitchLayout(0.19, inf)}
    text = layout_text('x', Survey(AxisLayout((-inf, inf), flags)), Unit.rad)
    assert '  inverted: [home_switch]\n' in text
    path = tmp_path / 'machine.yaml'
    path.write_text(text)
    assert layout_file.load(path).layouts['x'].switches == flags


def test_how_late_a_driver_may_be_is_said_where_it_is_not_known():
    """At these velocities edges of 20 µm leave 8 ms open: more than switch_stamp_error covers."""
    found = judge(WIRED, passes(GOOD, doubt=2e-5), OFF)
    assert found.latest == pytest.approx(0.004, abs=2e-4) and not found.advice
    assert any(f'switch_stamp_error: {found.latest:g} covers it' in one for one in found.unseen)
    covered = judge(replace(WIRED, switch_stamp_error=found.latest), passes(GOOD, doubt=2e-5), OFF)
    assert covered.latest == 0.0 and not any('drivers are later' in one for one in covered.unseen)


def test_a_limit_that_stayed_off_is_in_the_file(tmp_path):
    """And a rehearsal takes it as off; a home switch that was not seen is not there at all."""
    parameters = replace(WIRED, invert_positive_ls_polarity=True)
    found = judge(parameters, passes({DOWN: GOOD[DOWN]}), OFF)
    path = tmp_path / 'x.yaml'
    path.write_text(layout_text('x', found, Unit.m))
    layout = layout_file.load(path).layouts['x']
    assert layout.stays_off == {UP: SwitchLayout(inf, inf, inverted=True)}
    assert set(layout.switches) == {DOWN}
    assert SimulatedAxis(layout).levels() == {UP: True, DOWN: False}
