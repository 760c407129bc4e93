# SPDX-License-Identifier: Apache-2.0
"""Home types by the number of CiA 402: against the plant, with homes from geometry alone.

The table below is the standard's, not ours: which edge, or which index beside it, is home. It is
written in raw positions, and nothing of it is read from the tables of the node.
"""

from math import ceil, floor

import pytest
from core_rig import QUICK, grouped
from hypothesis import given
from hypothesis import strategies as st

from homing_node.cli import main
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.definition import InvalidParameters
from homing_node.plant.layout import AxisLayout, SwitchLayout, mirrored
from homing_node.procedures import cia402
from homing_node.procedures.events import Event
from homing_node.procedures.states import Direction, Error, HomeType
from homing_node.procedures.tables import PROCEDURES
from homing_node.rehearsal.run import Rehearsal

#: The axis, raw: limits at both ends, a momentary home switch, or one that covers an end.
LOW_LIMIT, HIGH_LIMIT = 0.010, 0.090
LEFT, RIGHT = 0.045, 0.053
PITCH, OFFSET, HYSTERESIS = 0.010, 0.0027, 0.0003


def left_of(edge):
    """Return the first index to the left of an edge."""
    return OFFSET + PITCH * (ceil((edge - OFFSET) / PITCH) - 1)


def right_of(edge):
    """Return the first index to the right of an edge."""
    return OFFSET + PITCH * (floor((edge - OFFSET) / PITCH) + 1)


#: Where a switch changes, raw: going on by a flag's left edge (rises, going +; falls, going -)
#: and by its right edge. A switch rises at its place and falls the hysteresis further on.
LEFT_ON, LEFT_OFF = LEFT, LEFT - HYSTERESIS
RIGHT_ON, RIGHT_OFF = RIGHT, RIGHT + HYSTERESIS

#: What the home switch of each method covers.
MOMENTARY, HIGH_END, LOW_END = 'momentary', 'high end', 'low end'
#: method: (what the home switch covers, the home). The standard's table of methods.
STANDARD = {
    1: ('', right_of(LOW_LIMIT + HYSTERESIS)),
    2: ('', left_of(HIGH_LIMIT - HYSTERESIS)),
    3: (HIGH_END, left_of(LEFT_OFF)),
    4: (HIGH_END, right_of(LEFT_ON)),
    5: (LOW_END, right_of(RIGHT_OFF)),
    6: (LOW_END, left_of(RIGHT_ON)),
    7: (MOMENTARY, left_of(LEFT_OFF)),
    8: (MOMENTARY, right_of(LEFT_ON)),
    9: (MOMENTARY, left_of(RIGHT_ON)),
    10: (MOMENTARY, right_of(RIGHT_OFF)),
    11: (MOMENTARY, right_of(RIGHT_OFF)),
    12: (MOMENTARY, left_of(RIGHT_ON)),
    13: (MOMENTARY, right_of(LEFT_ON)),
    14: (MOMENTARY, left_of(LEFT_OFF)),
    17: ('', LOW_LIMIT + HYSTERESIS),
    18: ('', HIGH_LIMIT - HYSTERESIS),
    19: (HIGH_END, LEFT_OFF),
    20: (HIGH_END, LEFT_ON),
    21: (LOW_END, RIGHT_OFF),
    22: (LOW_END, RIGHT_ON),
    23: (MOMENTARY, LEFT_OFF),
    24: (MOMENTARY, LEFT_ON),
    25: (MOMENTARY, RIGHT_ON),
    26: (MOMENTARY, RIGHT_OFF),
    27: (MOMENTARY, RIGHT_OFF),
    28: (MOMENTARY, RIGHT_ON),
    29: (MOMENTARY, LEFT_ON),
    30: (MOMENTARY, LEFT_OFF),
}
#: Every number and its mirror image, which the standard lists as a pair.
MIRRORED = {
    1: 2, 3: 5, 4: 6, 7: 11, 8: 12, 9: 13, 10: 14,
    17: 18, 19: 21, 20: 22, 23: 27, 24: 28, 25: 29, 26: 30, 33: 34,
}  # fmt: skip
FLAGS = {
    MOMENTARY: SwitchLayout(LEFT, RIGHT, HYSTERESIS),
    HIGH_END: SwitchLayout(LEFT, 1.0, HYSTERESIS),
    LOW_END: SwitchLayout(-1.0, RIGHT, HYSTERESIS),
}
LIMITS = {
    'negative_limit_switch': SwitchLayout(-1.0, LOW_LIMIT, HYSTERESIS),
    'positive_limit_switch': SwitchLayout(HIGH_LIMIT, 1.0, HYSTERESIS),
}
EVERYWHERE = [
    0.001, LOW_LIMIT, 0.0101, 0.02, 0.0446, LEFT, 0.0451, 0.049, 0.0529, RIGHT, 0.0534, 0.07,
    0.0899, HIGH_LIMIT, 0.0985,
]  # fmt: skip
ALL_NUMBERS = [*range(1, 15), *range(17, 31), 33, 34, 35, 37]


def axis_of(number, **changes):
    """Return the parameters and the layout for a method."""
    covers = STANDARD.get(number, ('', 0.0))[0]
    flags = dict(LIMITS)
    if covers:
        flags['home_switch'] = FLAGS[covers]
    indexed = number < 15 or number in (33, 34)
    layout = AxisLayout(
        (-0.002, 0.102),
        flags,
        index_pitch=PITCH if indexed else 0.0,
        index_offset=OFFSET,
        lag=0.002,
    )
    switches = [*flags, *(['z_pulse'] if indexed else [])]
    values = {**QUICK, 'home_type': number, 'homing_velocity_slow': 0.02, 'switches': switches}
    return axis_parameters({**values, **changes}), layout


def run(parameters, layout, start):
    return Rehearsal(parameters, layout, position=start).home(60.0)


@grouped('start', EVERYWHERE)
@pytest.mark.parametrize('number', STANDARD)
def test_home_is_at_the_standards_edge_or_index_from_everywhere(number, start):
    parameters, layout = axis_of(number)
    course = run(parameters, layout, start)
    assert course.outcome.error is Error.NoError, course.outcome.message
    home = STANDARD[number][1]
    assert abs(course.outcome.home_position_raw - home) <= course.outcome.uncertainty + 1e-9


@grouped('start', EVERYWHERE)
@pytest.mark.parametrize(('number', 'image'), MIRRORED.items())
def test_the_mirrored_method_homes_at_the_mirrored_place(number, image, start):
    parameters, layout = axis_of(number)
    other = axis_of(image)[0]
    one = run(parameters, layout, start)
    two = run(other, mirrored(layout), -start)
    assert one.outcome.error is two.outcome.error
    if one.outcome.success:
        apart = one.outcome.home_position_raw + two.outcome.home_position_raw
        assert abs(apart) <= one.outcome.uncertainty + two.outcome.uncertainty + 1e-9


@pytest.mark.parametrize('start', [0.02, 0.05, 0.08])
def test_the_next_index(start):
    for number, home in ((33, left_of(start)), (34, right_of(start))):
        course = run(*axis_of(number), start)
        assert course.outcome.home_position_raw == pytest.approx(home, abs=1e-9)


@pytest.mark.parametrize('number', [35, 37])
def test_here(number):
    course = run(*axis_of(number), 0.03)
    assert course.outcome.home_position_raw == pytest.approx(0.03)
    assert all(sample.velocity == 0.0 for sample in course.samples)


@given(
    number=st.sampled_from(list(STANDARD)),
    start=st.floats(-0.001, 0.101),
    edges=st.tuples(st.floats(0.035, 0.045), st.floats(0.004, 0.015)),
    hysteresis=st.floats(0.0, 0.001),
    offset=st.floats(0.0, PITCH),
)
def test_any_geometry(number, start, edges, hysteresis, offset):
    """The same with other flags, hysteresis and indices: the home follows the geometry."""
    left, right = edges[0], edges[0] + edges[1]
    covers = STANDARD[number][0]
    places = {
        MOMENTARY: (left, right),
        HIGH_END: (left, 1.0),
        LOW_END: (-1.0, right),
    }
    flags = {name: flag._replace(hysteresis=hysteresis) for name, flag in LIMITS.items()}
    if covers:
        flags['home_switch'] = SwitchLayout(*places[covers], hysteresis)
    parameters, layout = axis_of(number)
    layout = layout._replace(switches=flags, index_offset=offset)
    course = run(parameters, layout, start)
    assert course.outcome.error is Error.NoError, course.outcome.message
    found, unsure = course.outcome.home_position_raw, course.outcome.uncertainty + 1e-9
    edge = {
        **dict.fromkeys((1, 17), LOW_LIMIT + hysteresis),
        **dict.fromkeys((2, 18), HIGH_LIMIT - hysteresis),
        **dict.fromkeys((3, 7, 14, 19, 23, 30), left - hysteresis),
        **dict.fromkeys((4, 8, 13, 20, 24, 29), left),
        **dict.fromkeys((5, 10, 11, 21, 26, 27), right + hysteresis),
        **dict.fromkeys((6, 9, 12, 22, 25, 28), right),
    }[number]
    if number > 14:
        assert abs(found - edge) <= unsure
        return
    to_the_left = number in (2, 3, 6, 7, 9, 12, 14)
    pulses = [offset + k * PITCH for k in range(-3, 14)]
    beside = [p for p in pulses if (p < edge + 5e-4 if to_the_left else p > edge - 5e-4)]
    nearest = sorted(beside, reverse=to_the_left)[:2]
    assert min(abs(found - pulse) for pulse in nearest) <= 1e-9
    clear = [p for p in nearest if abs(p - edge) > 5e-4]
    if clear == nearest:  # else which pulse comes first is within the edge's uncertainty
        assert abs(found - nearest[0]) <= 1e-9


# -- no limit reversal in the standard ------------------------------------------------------------

NO_REVERSAL = [3, 4, 5, 6, 19, 20, 21, 22]


def beyond_a_gap(number):
    """Return an axis whose home switch ends before the limit, and a start between the two."""
    parameters, layout = axis_of(number)
    toward_high = parameters.home_direction is Direction.Positive
    flags = {**layout.switches, 'home_switch': FLAGS[MOMENTARY]}
    return layout._replace(switches=flags), 0.075 if toward_high else 0.025


@pytest.mark.parametrize('number', NO_REVERSAL)
def test_a_limit_ahead_ends_the_run_where_the_standard_has_no_reversal(number):
    parameters, layout = axis_of(number)
    assert parameters.limit_reversal is False
    layout, start = beyond_a_gap(number)
    course = run(parameters, layout, start)
    assert course.outcome.error is Error.LSTriggered
    assert all(event is not Event.LIMIT_AHEAD for _, event in course.arrows)


@pytest.mark.parametrize('number', NO_REVERSAL)
def test_or_turns_it_where_the_user_says_so(number):
    parameters, layout = axis_of(number, limit_reversal=True)
    layout, start = beyond_a_gap(number)
    course = run(parameters, layout, start)
    assert course.outcome.success
    assert any(event is Event.LIMIT_AHEAD for _, event in course.arrows)


@pytest.mark.parametrize('number', sorted(set(STANDARD) - set(NO_REVERSAL)))
def test_the_others_keep_the_reversal(number):
    assert axis_of(number)[0].limit_reversal


def test_a_name_keeps_the_reversal_unless_it_is_switched_off():
    layout = axis_of(24)[1]
    values = {**QUICK, 'home_type': 'HSHS', 'switches': list(layout.switches)}
    assert axis_parameters(values).limit_reversal
    without = axis_parameters({**values, 'limit_reversal': False})
    assert run(axis_parameters(values), layout, 0.075).outcome.success
    assert run(without, layout, 0.075).outcome.error is Error.LSTriggered


# -- the number as a parameter --------------------------------------------------------------------


def test_every_number_of_the_standard_is_known():
    assert list(cia402.METHODS) == ALL_NUMBERS


@pytest.mark.parametrize('number', ALL_NUMBERS)
def test_a_number_a_string_and_a_name_are_the_same(number):
    by_number = axis_of(number)[0]
    by_string = axis_of(number, home_type=f'CiA402 {number}')[0]
    method = cia402.METHODS[number]
    by_name = axis_of(
        number,
        home_type=str(method.home_type),
        home_direction=str(method.direction or 'Positive'),
        limit_reversal=method.limit_reversal,
    )[0]
    assert by_number == by_string == by_name
    assert by_number.home_type is method.home_type


@pytest.mark.parametrize('number', [n for n in ALL_NUMBERS if n < 35])
def test_a_direction_that_the_number_does_not_imply_is_an_error(number):
    implied = cia402.METHODS[number].direction
    other = next(one for one in Direction if one is not implied)
    axis_of(number, home_direction=str(implied))
    with pytest.raises(InvalidParameters) as caught:
        axis_of(number, home_direction=str(other))
    assert caught.value.faults == (
        f'home_direction: {other} contradicts home_type {number} (CiA402 {number}), which homes '
        f'{implied} ({cia402.METHODS[number].home_type}); leave it out, or set it to {implied}',
    )


@pytest.mark.parametrize('number', [0, 15, 16, 31, 32, 36, 38, -1, 'CiA402 15'])
def test_a_number_without_a_method_is_refused_with_those_that_there_are(number):
    with pytest.raises(InvalidParameters) as caught:
        axis_of(17, home_type=number)
    assert str(caught.value).startswith(
        f'home_type: {number!r} is none of the CiA 402 methods 1 to 14, 17 to 30, 33 to 35 and 37'
    )


def test_every_method_says_how_it_differs():
    for number, method in cia402.METHODS.items():
        silent = method.direction is None or number in (9, 10, 13, 14, 25, 29)
        assert (cia402.NO_REVERSAL in method.differences) == (number in NO_REVERSAL)
        assert silent or method.differences


def test_the_types_list_their_numbers():
    assert cia402.numbers_of(HomeType.LSOff) == (17, 18)
    assert cia402.numbers_of(HomeType.HS) == ()


# -- the commands ---------------------------------------------------------------------------------


def test_homing_types_lists_every_type_with_its_numbers(capsys):
    assert main(['types']) == 0
    lines = capsys.readouterr().out.splitlines()
    for home_type in HomeType:
        (row,) = [line for line in lines if line.split()[:1] == [str(home_type)]]
        numbers = [word for word in row.split()[1:5] if word[0].isdigit()]
        assert [int(word.rstrip('+-')) for word in numbers] == list(cia402.numbers_of(home_type))


@pytest.mark.parametrize('number', ALL_NUMBERS)
def test_homing_explain_tells_a_number(number, capsys):
    assert main(['explain', str(number)]) == 0
    told = capsys.readouterr().out
    method = cia402.METHODS[number]
    assert told.startswith(f'CiA402 {number} = {method.home_type}')
    assert f'Home: {PROCEDURES[method.home_type].home}.' in told
    assert 'stateDiagram-v2' in told
    assert ('ends the run' in told) == (number in NO_REVERSAL)
    assert ('Differences:' in told) == bool(method.differences)
    assert ('home switch' in told) == (STANDARD.get(number, ('',))[0] != '')


def test_homing_explain_tells_a_name(capsys):
    assert main(['explain', 'LSOff', '--no-diagram']) == 0
    told = capsys.readouterr().out
    assert 'CiA 402: 17, 18' in told
    assert 'stateDiagram' not in told


@pytest.mark.parametrize(
    ('text', 'said'),
    [
        ('HSHs', "did you mean 'HSHS'"),
        ('31', 'none of the CiA 402 methods'),
        ('limit', '`homing types` lists them'),
    ],
)
def test_homing_explain_of_what_there_is_not(text, said, capsys):
    assert main(['explain', text]) == 2
    assert said in capsys.readouterr().err
