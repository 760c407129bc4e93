# SPDX-License-Identifier: Apache-2.0
"""Runs that know where the switch was: quicker, as exact, and ordinary where something is else."""

import pytest
from core_rig import (
    AHEAD,
    DIRECTIONS,
    HOME,
    LIMIT_TYPES,
    TYPES,
    Spoilt,
    assert_homed,
    error_of,
    furthest,
    home_of,
    introduce_again,
    rig,
    target_of,
)

from homing_node.plant.layout import SwitchLayout
from homing_node.procedures.events import Event
from homing_node.procedures.states import Error, HomeType, Input
from homing_node.procedures.tables import PROCEDURES

QUICK_TYPES = [t for t in TYPES if PROCEDURES[t].quick]
FAST = {'rehome': True, 'rehome_velocity': 0.5}
taken = set()


def quick(one, remembered, direction=1, start=None, verify=False):
    """Home once more on a machine where things may have moved."""
    made = one.rehearsal(direction, start)
    made.axis.remembered = remembered
    for _ in range(5):
        made.cycle()
    assert made.axis.home(made.time) is None
    kind = made.axis.kind
    course = made.finish(60.0)
    taken.update((one.home_type, *arrow) for arrow in course.arrows)
    return course, str(kind)


def steps(course):
    return [str(step) for step, _ in course.arrows]


def shifted(one, by):
    """Return the machine whose home switch (or target limit) was moved."""
    if one.home_type in LIMIT_TYPES:
        name, _ = target_of(one)
        return one.switched(**{name: SwitchLayout(one.layout.switches[name].on_from + by, 1.0)})
    return one.switched(home_switch=SwitchLayout(HOME.on_from + by, HOME.on_to + by))


@pytest.fixture(scope='module')
def cold():
    """The cold run of each type and direction: its course, and what it remembers."""
    found = {}
    for home_type in QUICK_TYPES:
        for direction in DIRECTIONS:
            made = rig(home_type, **FAST).rehearsal(direction, 0.01)
            course = made.home(limit=60.0)
            found[home_type, direction] = course, made.axis.remembered
    return found


def test_which_types_know_a_quick_way():
    without = {t for t in TYPES if not PROCEDURES[t].quick}
    assert without == {HomeType.CurrentPos, HomeType.ZPulse, HomeType.TouchProbe, *TYPES[17:21]}


@pytest.mark.parametrize('home_type', QUICK_TYPES)
def test_a_quick_run_finds_the_same_home_from_everywhere(home_type, cold):
    for direction in DIRECTIONS:
        course, remembered = cold[home_type, direction]
        for start in (0.01, 0.0592, 0.062, 0.1) if direction > 0 else (0.03, 0.07):
            if home_type in LIMIT_TYPES and start > 0.07:
                start = target_of(rig(home_type))[1] - 0.0005
            again, kind = quick(rig(home_type, **FAST), remembered, direction, start)
            assert kind == 'rehome'
            assert home_of(again, direction) == pytest.approx(home_of(course, direction), abs=1e-6)
            assert again.outcome.uncertainty <= 1.1 * course.outcome.uncertainty


@pytest.mark.parametrize('home_type', QUICK_TYPES)
@pytest.mark.parametrize('by', [-0.005, 0.003])
def test_a_switch_that_has_moved_is_found_where_it_is(home_type, by, cold):
    """Toward the axis it is met too early; further away the slow pass goes on."""
    true = shifted(rig(home_type), by).home(start=0.02)
    for start in (0.02, 0.075):
        course, _ = quick(shifted(rig(home_type, **FAST), by), cold[home_type, 1][1], 1, start)
        assert_homed(course, home_of(true), more=true.outcome.uncertainty)
        turned = AHEAD.on_from + 0.006  # a limit ahead turns the axis
        assert furthest(course) <= max(furthest(true) + 1e-3, start, turned)


@pytest.mark.parametrize('by', [-0.003, -0.0006, 0.0006])
def test_a_switch_that_has_moved_a_little_is_found_where_it_is(by, cold):
    course, _ = quick(shifted(rig('HSHS', **FAST), by), cold[HomeType.HSHS, 1][1], 1, 0.02)
    assert_homed(course, HOME.on_from + by)


@pytest.mark.parametrize('home_type', ['HSHS', 'LSLS'])
def test_only_the_slow_pass_is_taken(home_type, cold):
    course, remembered = cold[HomeType(home_type), 1]
    again, _ = quick(rig(home_type, **FAST), remembered, 1, 0.01)
    assert len(steps(again)) == 4 and 'quick' in steps(again)[0]
    assert again.duration < 0.6 * course.duration


def test_a_pass_elsewhere_is_a_coarse_one_and_a_second_one_follows(cold):
    moved = shifted(rig('HSHS', **FAST), 0.0006)  # a fifth of edge_tolerance is 0.2 mm
    course, _ = quick(moved, cold[HomeType.HSHS, 1][1], 1, 0.01)
    assert steps(course).count('SecondHSSearch') == 2
    assert_homed(course, HOME.on_from + 0.0006)


def test_a_flag_that_is_left_on_is_cleared_or_a_named_error(cold):
    longer = rig('HSHS', **FAST).switched(home_switch=SwitchLayout(0.03, 0.066))
    for start in (0.01, 0.05):
        course, _ = quick(longer, cold[HomeType.HSHS, 1][1], 1, start)
        assert_homed(course, 0.03)
    stuck = rig('HSHS', **FAST).switched(home_switch=SwitchLayout(-1.0, 1.0))
    course, _ = quick(stuck, cold[HomeType.HSHS, 1][1], 1, 0.05)
    assert error_of(course) in (Error.LSTriggered, Error.SearchDistanceExceeded)


class Hand(Spoilt):
    """A hand on the home switch once the axis has passed a place, for 20 ms."""

    place = 0.0
    pressed = None

    def cycle(self):
        """Press and release between two cycles."""
        if self.pressed is None and self.plant.position > self.place:
            self.pressed = self.time
            self.axis.switch(Input.HOME_SWITCH, self.time, True)
        elif self.pressed and self.time - self.pressed > 0.02:
            self.axis.switch(Input.HOME_SWITCH, self.time, False)
            self.pressed = 0.0
        return super().cycle()


@pytest.mark.parametrize('place', [0.02, 0.045, 0.0585, 0.0591, 0.0595, 0.0599])
def test_a_hand_on_the_switch_gives_no_wrong_home(place, cold):
    made = rig('HSHS', **FAST).rehearsal(1, 0.01)
    made.__class__ = Hand
    made.place = place
    made.axis.remembered = cold[HomeType.HSHS, 1][1]
    course = made.home(limit=60.0)
    assert made.pressed == 0.0
    if course.outcome.success:
        assert_homed(course, HOME.on_from)
    else:
        assert error_of(course) in (Error.EdgeNotRepeated, Error.LSTriggered)
    assert furthest(course) < AHEAD.on_from


def test_a_limit_on_the_way_turns_the_axis_once(cold):
    nearer = rig('HSHS', **FAST).switched(positive_limit_switch=SwitchLayout(0.04, 1.0))
    course, _ = quick(nearer, cold[HomeType.HSHS, 1][1], 1, 0.01)
    assert not course.outcome.success
    one = rig('HSHS', **FAST)
    far = cold[HomeType.HSHS, 1][1]._replace(approach=0.095, home=0.095)  # wrong by 35 mm
    course, _ = quick(one.switched(home_switch=SwitchLayout(0.02, 0.026)), far, 1, 0.03)
    assert_homed(course, 0.02)
    assert steps(course)[:2] == ['HSSearch (quick)', 'HSFallingEdgeSearchReverse']


def test_what_is_remembered_and_when_not():
    one = rig('HSHS', **FAST)
    made = one.rehearsal()
    assert made.axis.remembered is None
    assert made.home(limit=60.0).outcome.success
    remembered = made.axis.remembered
    assert remembered.home == made.axis.outcome.home_position_raw
    assert remembered.approach == pytest.approx(0.06, abs=1e-5)
    ordinary, kind = quick(rig('HSHS'), remembered)
    assert kind == 'home' and steps(ordinary)[0] == 'HSSearch'  # rehome: false
    _, kind = quick(one, remembered._replace(approach=5.0))
    assert kind == 'home'
    made.axis.time_jumped_back(0.0)
    assert made.axis.remembered is None and not made.axis.homed
    made = one.rehearsal()
    made.home(limit=60.0)
    made.axis.configure(rig('HSReverse', **FAST).parameters())
    assert made.axis.remembered is None


def test_every_arrow_of_the_quick_ways_was_taken():
    """The limit ahead and the switch on at entry are those of the ordinary runs."""
    met = (Event.HS_RISES, Event.HS_FALLS, Event.LS_RISES, Event.DONE)
    for home_type in QUICK_TYPES:
        for step, row in PROCEDURES[home_type].quick.items():
            for event in row.on:
                if event in met:
                    assert (home_type, step, event) in taken, (home_type, step, event)


# -- verify ---------------------------------------------------------------------------------------


def verify(made):
    for _ in range(300):
        made.cycle()
    refusal = made.axis.home(made.time, verify=True)
    assert refusal is None, refusal
    assert made.axis.homed  # all the while
    return made.finish(60.0)


def moved_after_homing(one, by, direction=1):
    """Return an axis that has homed, and whose switch has moved since."""
    made = one.rehearsal(direction, 0.02)
    assert made.home(limit=60.0).outcome.success
    other = shifted(one, by).rehearsal(direction, direction * made.plant.position)
    other.plant.time = made.plant.time
    made.plant = other.plant
    introduce_again(made)
    return made


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize(
    'home_type', ['HS', 'HSHS', 'HSOff', 'HSReverse', 'LSOff', 'NearLSNearLS']
)
def test_verify_tells_the_difference_and_keeps_the_home(home_type, direction):
    by = 0.0002
    made = moved_after_homing(rig(home_type), by, direction)
    before = made.axis.outcome
    verify(made)
    outcome = made.axis.outcome
    assert outcome.success and made.axis.homed
    assert outcome.verified * direction == pytest.approx(by, abs=outcome.verified_uncertainty)
    assert outcome.home_offset == before.home_offset
    assert outcome.home_position_raw == before.home_position_raw
    assert made.axis.home_source == 'run'


def test_verify_finds_that_home_has_moved():
    made = moved_after_homing(rig('HSHS'), 0.004)
    verify(made)
    outcome = made.axis.outcome
    assert outcome.error is Error.HomeMoved and not made.axis.homed
    assert 'the home was found +4 mm' in outcome.message and 'edge_tolerance' in outcome.message
    accepted = made.axis.accept()
    assert accepted.home_position_raw == pytest.approx(0.064, abs=1e-4)
    assert made.axis.homed and made.axis.outcome.success
    assert made.axis.accept() is None


def test_verify_takes_home_change_limit():
    made = moved_after_homing(rig('HSHS', home_change_limit=1e-4), 0.0002)
    verify(made)
    assert made.axis.outcome.error is Error.HomeMoved
    assert '100 µm (home_change_limit)' in made.axis.outcome.message
    assert made.axis.home(made.time, verify=True).error is Error.NotHomed


def test_a_canceled_verify_leaves_the_home_and_another_failure_does_not():
    for fail, homed in (('cancel', True), ('emergency', False)):
        made = rig('HSHS').rehearsal()
        made.home(limit=60.0)
        before = made.axis.outcome
        for _ in range(300):
            made.cycle()
        assert made.axis.home(made.time, verify=True) is None
        for _ in range(20):
            made.cycle()
        if fail == 'cancel':
            made.axis.cancel()
        else:
            made.axis.set_emergency_stop(True)
        made.finish(60.0)
        assert made.axis.homed is homed
        if homed:
            assert made.axis.error is Error.Canceled
            assert made.axis.outcome.home_offset == before.home_offset


@pytest.mark.parametrize('home_type', ['CurrentPos', 'ZPulse'])
def test_what_cannot_be_verified(home_type):
    made = rig(home_type).rehearsal()
    assert made.home(limit=60.0).outcome.success
    for _ in range(300):
        made.cycle()
    refusal = made.axis.home(made.time, verify=True)
    assert refusal.error is Error.InvalidParameter
    assert refusal.message == f'axis x: {home_type} cannot be verified'


def test_a_restored_home_is_verified_by_the_first_request():
    home = rig('HSHS').home().outcome
    for restore, kind in (('verify', 'verify'), ('trust', 'home')):
        made = rig('HSHS', restore=restore).rehearsal(1, 0.02)
        for _ in range(100):
            made.cycle()
        made.axis.restore(home)
        assert made.axis.homed and made.axis.home_source == 'restored'
        assert made.axis.position == pytest.approx(0.02 - home.home_offset)
        assert made.axis.home(made.time) is None
        assert str(made.axis.kind) == kind
        made.finish(60.0)
        assert made.axis.home_source == ('verified' if kind == 'verify' else 'run')
        assert (made.axis.outcome.verified is None) == (kind == 'home')
        made.cycle()
        assert made.axis.wants_verify is False
