# SPDX-License-Identifier: Apache-2.0
"""The tables: closed, bounded, reachable, and what the manual's page says."""

import re

import pytest
from core_rig import (
    EXTERNAL_LIMIT_TYPES,
    HARDWARE_LIMIT_TYPES,
    HS_OFF_TYPES,
    LIMIT_TYPES,
    NEAR_LIMIT_TYPES,
    REVERSING,
    TRUE_HOME,
    TYPES,
    grouped,
    path,
    rig,
)

from homing_node.procedures.events import CONDITIONS, Event
from homing_node.procedures.fragments import (
    compose,
    home_switch_clear,
    home_switch_initially_on,
    limit_switch_during_homing,
)
from homing_node.procedures.motions import AWAY_FAST, TOWARD_FAST, Bound, Kind, Pace, Way
from homing_node.procedures.procedure import Row
from homing_node.procedures.states import HomeType, Input, LimitPair, Role, State
from homing_node.procedures.steps import HOME_SHIFT, HOMED, HS_SEARCH, Step
from homing_node.procedures.tables import PROCEDURES

EVERY_TYPE = pytest.mark.parametrize('home_type', TYPES, ids=str)
ROWS = [
    (procedure, step, row)
    for procedure in PROCEDURES.values()
    for step, row in procedure.rows.items()
]
EVERY_ROW = grouped('procedure, step, row', ROWS)


def reached_from(step, rows):
    """Return every step that arrows lead to from a step, itself included."""
    found, new = set(), {step}
    while new:
        found |= new
        new = {to for one in new if one in rows for to in rows[one].on.values()} - found
    return found


def test_all_29_types_have_a_table():
    assert list(PROCEDURES) != []
    assert set(PROCEDURES) == set(HomeType)
    assert len(PROCEDURES) == 29


@EVERY_ROW
def test_every_arrow_is_labelled_and_leads_to_a_row(procedure, step, row):
    assert row.on
    for event, to in row.on.items():
        assert isinstance(event, Event)
        assert to == HOMED or to in procedure.rows


@EVERY_TYPE
def test_every_row_is_reached(home_type):
    procedure = PROCEDURES[home_type]
    assert reached_from(procedure.first, procedure.rows) == {*procedure.rows, HOMED}


@EVERY_ROW
def test_every_row_reaches_the_end(procedure, step, row):
    assert HOMED in reached_from(step, procedure.rows)


@EVERY_ROW
def test_every_row_is_plain_data(procedure, step, row):
    assert isinstance(step.state, State)
    assert isinstance(row.motion.kind, Kind)
    assert isinstance(row.motion.pace, Pace)
    assert isinstance(row.bound, Bound)


@EVERY_ROW
def test_only_the_reference_leads_to_the_home_shift(procedure, step, row):
    for event, to in row.on.items():
        if to == HOME_SHIFT:
            assert event not in CONDITIONS


@EVERY_ROW
def test_searches_wait_for_an_event_and_moves_for_their_end(procedure, step, row):
    searching = row.motion.kind is Kind.SEARCH
    assert searching != (Event.DONE in row.on)
    assert (row.motion.way is not Way.NONE) == (row.motion.kind in (Kind.SEARCH, Kind.FURTHER))


def test_compose_refuses_a_step_that_stands_twice():
    with pytest.raises(ValueError, match='HSSearch stands in two fragments'):
        compose({HS_SEARCH: Row(TOWARD_FAST, {})}, {HS_SEARCH: Row(AWAY_FAST, {})})


def test_tables_cannot_be_changed():
    with pytest.raises(TypeError):
        PROCEDURES[HomeType.HS].rows[HS_SEARCH] = None


def test_a_step_prints_its_state_and_phase():
    assert str(Step(State.HSClearReverse)) == 'HSClearReverse'
    assert str(Step(State.HSClearReverse, 'further')) == 'HSClearReverse (further)'


# ------------------------------------------------------------------------- spec, section 6 and 4

HARDWARE, NEAR, EXTERNAL = LimitPair.HARDWARE, LimitPair.NEAR, LimitPair.EXTERNAL
NORMAL, IGNORED, REFERENCE = Role.NORMAL, Role.IGNORED, Role.REFERENCE
#: What the hardware, the near and the external limit ahead mean.
ROLES = {
    **dict.fromkeys(REVERSING, (Role.REVERSAL, Role.REVERSAL, Role.REVERSAL)),
    **dict.fromkeys(HARDWARE_LIMIT_TYPES, (REFERENCE, IGNORED, IGNORED)),
    **dict.fromkeys(NEAR_LIMIT_TYPES, (NORMAL, REFERENCE, IGNORED)),
    **dict.fromkeys(EXTERNAL_LIMIT_TYPES, (NORMAL, IGNORED, REFERENCE)),
}


@EVERY_TYPE
def test_what_a_limit_ahead_means(home_type):
    roles = ROLES.get(home_type, (NORMAL, NORMAL, NORMAL))
    assert PROCEDURES[home_type].limits_ahead == dict(zip(LimitPair, roles, strict=True))


@EVERY_TYPE
def test_only_home_switch_types_know_the_reversal(home_type):
    events = PROCEDURES[home_type].events
    assert (Event.LIMIT_AHEAD in events) == (home_type in REVERSING)


@EVERY_TYPE
def test_every_toward_search_of_a_home_switch_type_can_reverse(home_type):
    if home_type in REVERSING:
        for row in PROCEDURES[home_type].rows.values():
            search = row.motion.kind is Kind.SEARCH and row.motion.way is Way.TOWARD
            assert (Event.LIMIT_AHEAD in row.on) == search


@EVERY_TYPE
def test_hs_off_types_start_on_the_switch_as_off_it(home_type):
    first = PROCEDURES[home_type].rows[PROCEDURES[home_type].first]
    assert (Event.HS_ON in first.on) == (home_type in REVERSING and home_type not in HS_OFF_TYPES)


@EVERY_TYPE
def test_limit_types_clear_their_limit_first(home_type):
    first = PROCEDURES[home_type].rows[PROCEDURES[home_type].first]
    assert (Event.LS_ON in first.on) == (home_type in LIMIT_TYPES)


@EVERY_TYPE
def test_the_words_number_the_steps_and_name_every_state_of_the_table(home_type):
    procedure = PROCEDURES[home_type]
    numbers = [line[:3] for line in procedure.words.splitlines() if line[:1].isdigit()]
    assert numbers == [f'{i}. ' for i in range(1, len(numbers) + 1)]
    assert numbers
    assert procedure.home
    turns = home_type in REVERSING
    own = home_type is HomeType.HSReverse
    reversal = {State.HSFallingEdgeSearchReverse} if turns and not own else set()
    named = {state for state in State if f'{state}' in re.split(r'\W+', procedure.words)}
    assert named - {State.Idle} == {step.state for step in procedure.rows} - reversal
    assert ('the reversal' in ' '.join(procedure.words.split())) == turns


def test_shared_fragments():
    """The manual's pages, each bounded by the parameter that it names."""
    for fragment, bound in (
        (limit_switch_during_homing(HS_SEARCH), Bound.LS_REVERSE),
        (home_switch_initially_on(HS_SEARCH), Bound.HS_ON_AT_START),
        (home_switch_clear(HS_SEARCH), Bound.SEARCH),
    ):
        clear, further = fragment
        assert fragment[clear].on == {Event.HS_FALLS: further}
        assert fragment[further].on == {Event.HS_ON: clear, Event.DONE: HS_SEARCH}
        assert fragment[clear].bound is bound  # the distance further is its own bound


# ------------------------------------------------------------------------------- spec, section 3

PATHS = {
    HomeType.HS: 'HSSearch',
    HomeType.HSHS: 'HSSearch HSClearReverse SecondHSSearch',
    HomeType.HSZPulse: 'HSAndZPulseSearch',
    HomeType.HSReverseZPulse: 'HSSearch ZPulseSearchReverse',
    HomeType.HSTouchProbe: 'HSSearch HSClearReverse TouchProbeSearch',
    HomeType.HSOff: 'HSOffSearch',
    HomeType.HSOffZPulse: 'HSOffAndZPulseSearch',
    HomeType.HSOffReverseZPulse: 'HSOffSearch ZPulseSearchReverse',
    HomeType.HSReverse: 'HSSearch HSFallingEdgeSearchReverse',
    HomeType.HSOffReverse: 'HSOffSearch SecondHSSearch',
    **dict.fromkeys(LIMIT_TYPES[:6:2], 'LSSearch'),
    **dict.fromkeys(LIMIT_TYPES[1:6:2], 'LSSearch ZPulseSearchReverse'),
    **dict.fromkeys(LIMIT_TYPES[6:9], 'LSSearch LSFallingEdgeSearchReverse'),
    **dict.fromkeys(LIMIT_TYPES[9:], 'LSSearch LSFallingEdgeSearchReverse LSSearch'),
    HomeType.ZPulse: 'ZPulseSearch',
    HomeType.TouchProbe: 'TouchProbeSearch',
    HomeType.MechanicalEndDetection: 'MechanicalEndDetection',
    HomeType.MechanicalEndDetectionHS: 'MechanicalEndDetection HSFallingEdgeSearchReverse',
    HomeType.MechanicalEndDetectionLS: 'MechanicalEndDetection LSFallingEdgeSearchReverse',
    HomeType.MechanicalEndDetectionReverseZPulse: 'MechanicalEndDetection ZPulseSearchReverse',
}
INPUTS = {
    HomeType.HS: {'home_switch'},
    HomeType.HSHS: {'home_switch'},
    HomeType.HSZPulse: {'home_switch', 'z_pulse'},
    HomeType.HSReverseZPulse: {'home_switch', 'z_pulse'},
    HomeType.HSTouchProbe: {'home_switch', 'touch_probe'},
    HomeType.HSOff: {'home_switch'},
    HomeType.HSOffZPulse: {'home_switch', 'z_pulse'},
    HomeType.HSOffReverseZPulse: {'home_switch', 'z_pulse'},
    HomeType.HSReverse: {'home_switch'},
    HomeType.HSOffReverse: {'home_switch'},
    HomeType.LSReverseZPulse: {'z_pulse'},
    HomeType.NearLSReverseZPulse: {'z_pulse'},
    HomeType.ExternalLSReverseZPulse: {'z_pulse'},
    HomeType.ZPulse: {'z_pulse'},
    HomeType.TouchProbe: {'touch_probe'},
    HomeType.MechanicalEndDetectionHS: {'home_switch'},
    HomeType.MechanicalEndDetectionReverseZPulse: {'z_pulse'},
}
TARGETS = {
    **dict.fromkeys(HARDWARE_LIMIT_TYPES, HARDWARE),
    **dict.fromkeys(NEAR_LIMIT_TYPES, NEAR),
    **dict.fromkeys(EXTERNAL_LIMIT_TYPES, EXTERNAL),
    HomeType.MechanicalEndDetectionLS: HARDWARE,
}


@pytest.mark.parametrize('home_type', TRUE_HOME, ids=str)
def test_normal_path(home_type):
    assert path(rig(home_type).home()) == [*PATHS[home_type].split(), 'HomeShift']


@EVERY_TYPE
def test_inputs_that_a_type_needs(home_type):
    procedure = PROCEDURES[home_type]
    assert procedure.inputs == {Input(name) for name in INPUTS.get(home_type, ())}
    assert procedure.target is TARGETS.get(home_type)


FAST_SEARCHES = {
    State.HSSearch,
    State.HSOffSearch,
    State.LSSearch,
    State.HSClearReverse,
    State.HSFallingEdgeSearchReverse,
    State.LSFallingEdgeSearchReverse,
}
SLOW_SEARCHES = {
    State.SecondHSSearch,
    State.TouchProbeSearch,
    State.ZPulseSearch,
    State.ZPulseSearchReverse,
    State.MechanicalEndDetection,
}


#: A row of a fast search's state that is slow.
SLOW_PHASES = {'armed', 'slow', 'second'}


@EVERY_ROW
def test_which_searches_are_slow(procedure, step, row):
    if row.motion.kind is not Kind.SEARCH:
        return
    after_the_end = State.MechanicalEndDetection in {s.state for s in procedure.rows}
    if step.state in SLOW_SEARCHES or step.phase in SLOW_PHASES or after_the_end:
        assert row.motion.pace is Pace.SLOW
    else:
        assert step.state in FAST_SEARCHES | {State.HSAndZPulseSearch, State.HSOffAndZPulseSearch}
        assert row.motion.pace is Pace.FAST
