# SPDX-License-Identifier: Apache-2.0
"""A gantry homes square, and never racks: every type, and every case of doc/gantry.md by name."""

from itertools import pairwise

import pytest
from core_rig import DIRECTIONS, HS, INDEX_TYPES, LIMIT_AHEAD, TRUE_HOME, TYPES, on_side, rig
from gantry_rig import PERIOD, Gantry, SideRig, bouncing
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.parameters.gantry_checks import UNSUPPORTED
from homing_node.procedures.states import Error, HomeType, Input
from homing_node.procedures.tables import PROCEDURES

SUPPORTED = [t for t in TYPES if t not in UNSUPPORTED]
TOLERANCE = 0.00005
#: How much more than max_skew the sides may differ while they stop: v^2 / 2a of the rig, and a
#: cycle and a feedback message at that speed.
STOPPING = 0.2**2 / (2 * 8.0) + 0.2 * 0.012
each_way = pytest.mark.parametrize('direction', DIRECTIONS)


def homed(gantry, outcome=None):
    """Assert that a gantry homes square; return its outcome."""
    outcome = outcome or gantry.home()
    assert outcome.error is Error.NoError, outcome.message
    assert gantry.axis.homed
    for n, member in enumerate(outcome.members[1:]):
        assert abs(gantry.skews[n]) <= TOLERANCE + member.uncertainty + 1e-6
        assert abs(member.squareness) <= TOLERANCE + member.uncertainty + 1e-9
    smooth(gantry)
    return outcome


def failed(gantry, error, outcome=None):
    """Assert that a run ends with an error, all sides at rest; return the message."""
    outcome = outcome or gantry.home()
    assert outcome.error is error, (outcome.error, outcome.message)
    assert not gantry.axis.homed
    if gantry.samples:
        assert all(abs(v) < 1e-9 for _, v, _ in gantry.samples[-1].commands)
    smooth(gantry)
    return outcome.message


def smooth(gantry):
    """Assert that the setpoints of every side are continuous and keep to the limits."""
    for one, other in pairwise(gantry.samples):
        for (p, v, a), (q, w, b) in zip(one.commands, other.commands, strict=True):
            assert abs(q - p - 0.5 * (v + w) * PERIOD) < 1e-5
            assert abs(w) < 0.2 * (1 + 1e-9)
            assert abs(b) < 8.0 * (1 + 1e-9) or abs(b) <= abs(a) + 500 * PERIOD
            assert abs(w - v) <= 8.0 * PERIOD * (1 + 1e-6)


# ------------------------------------------------------------------------------ every home type


@each_way
@pytest.mark.parametrize('home_type', SUPPORTED)
def test_homes_square(home_type, direction):
    """Home is the leader's, the same as without followers."""
    skew = 0.0012 * direction
    side = SideRig(skew=skew, offset=0.0003, zero=0.02)
    gantry = Gantry(home_type, (SideRig(), side), direction)
    outcome = homed(gantry)
    assert outcome.uncertainty < 1e-3
    home = direction * outcome.home_position_raw
    assert abs(home - TRUE_HOME[home_type]) <= outcome.uncertainty + 1e-9
    leader, follower = outcome.members
    assert leader.home_position_raw == pytest.approx(outcome.home_position_raw, abs=1e-9)
    apart = direction * (follower.home_position_raw - 0.02 - leader.home_position_raw)
    assert abs(apart - 0.0003) <= follower.uncertainty + 1e-9
    assert abs(direction * follower.skew + skew) < 2e-4
    assert gantry.states[-5:-1] == ['HomeShift', 'Squaring', 'Proving', 'HomeShift']
    assert gantry.worst <= abs(skew) + 1e-4
    assert gantry.axis.largest_skew < 1e-4


@each_way
def test_the_second_run_finds_the_gantry_square(direction):
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0015)), direction)
    first = homed(gantry)
    second = homed(gantry)
    assert 'Squaring' not in gantry.states
    assert abs(second.home_position_raw - first.home_position_raw) < 1e-6


def test_no_squaring_move_below_the_tolerance():
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.00004)))
    homed(gantry)
    assert 'Squaring' not in gantry.states


def test_three_followers_square_at_once():
    sides = (SideRig(), SideRig(skew=0.0009), SideRig(skew=-0.0006, offset=0.001), SideRig(zero=1))
    gantry = Gantry('HSHS', sides)
    outcome = homed(gantry)
    assert [member.name for member in outcome.members] == ['y', 'y2', 'y3', 'y4']
    moved = [member.skew for member in outcome.members]
    assert moved == pytest.approx([0.0, -0.0009, 0.0006, 0.0], abs=1e-4)


@pytest.mark.parametrize(
    'changes', [{'square': False}, {'gantry_homing_retain_sync_offset': True}]
)
def test_a_stiff_gantry_is_not_squared(changes):
    """Its squareness is only reported: the follower's reference less the leader's."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001)), **changes)
    outcome = gantry.home()
    assert outcome.error is Error.NoError
    assert 'Squaring' not in gantry.states
    assert outcome.members[1].squareness == pytest.approx(-0.001, abs=1e-6)
    assert gantry.skews == pytest.approx([0.001], abs=1e-6)
    ahead = gantry.axis.homed_position_of(gantry.axis.followers[0])
    assert ahead == pytest.approx(gantry.axis.position, abs=1e-6)  # it is not forced later, either


@pytest.mark.parametrize(
    ('side', 'changes'),
    [
        (SideRig(skew=0.001, without=(HS,)), {}),
        (SideRig(skew=0.001), {'gantry_homing_use_slave_hs': False}),
    ],
    ids=['not wired', 'not used'],
)
def test_a_follower_without_a_home_switch_follows(side, changes):
    gantry = Gantry('HSHS', (SideRig(), side), **changes)
    outcome = gantry.home()
    assert outcome.error is Error.NoError
    assert outcome.members[1].home_position_raw == 0.0
    assert gantry.skews == pytest.approx([0.001], abs=1e-6)


def test_the_weakest_member_sets_the_dynamics():
    weak = SideRig(own={'homing_velocity_fast': 0.06, 'homing_velocity_slow': 0.02, 'ls_dec': 3.0})
    gantry = Gantry('HSHS', (SideRig(), weak))
    homed(gantry)
    assert max(abs(v) for one in gantry.samples for _, v, _ in one.commands) <= 0.06 + 1e-9


@each_way
@pytest.mark.parametrize('stiffness', [1e4, 3e6])
def test_racking_force(stiffness, direction):
    """From loose to stiff: no more force than max_skew has, and next to none in the end."""
    gantry = Gantry(
        'HSHS', (SideRig(), SideRig(skew=0.0015, zero=0.1)), direction, stiffness=stiffness
    )
    forces = []
    gantry.on_cycle = lambda: forces.append(max(abs(plant.force) for plant in gantry.plants))
    homed(gantry)
    assert max(forces) <= stiffness * 0.002
    assert forces[-1] <= stiffness * 2.0 * TOLERANCE


# ----------------------------------------------------------------- the nasty cases, each by name


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize('home_type', ['HSHS', 'HSOff', 'LS'])
def test_one_switch_dead(home_type, side):
    switch = LIMIT_AHEAD if home_type.startswith('LS') else HS
    sides = [SideRig(), SideRig()]
    sides[side] = SideRig(stuck={switch: False})
    gantry = Gantry(home_type, sides)
    message = failed(gantry, Error.FollowerSwitchMissing)
    assert f'of {"y.y2" if side else "y"} did not change' in message
    edge = 0.09 if home_type.startswith('LS') else 0.06
    assert max(one.physical[0] for one in gantry.samples) < edge + 0.002 + 0.2 * 0.07 + STOPPING


@pytest.mark.parametrize('home_type', ['HSHS', 'HSOff', 'LS'])
def test_one_switch_stuck_on_at_start(home_type):
    switch = LIMIT_AHEAD if home_type == 'LS' else HS
    gantry = Gantry(home_type, (SideRig(), SideRig(stuck={switch: True})))
    message = failed(gantry, Error.FollowerSwitchMissing)
    assert 'of y.y2 did not fall' in message
    assert abs(gantry.samples[-1].physical[0] - 0.05) < 0.012 + 0.2 * 0.02


@pytest.mark.parametrize('home_type', ['HSHS', 'HSOff', 'HSOffReverse'])
@pytest.mark.parametrize(('start', 'skew'), [(0.062, 0.001), (0.059, 0.0015)])
def test_a_switch_on_at_start_is_cleared_on_all_sides(home_type, start, skew):
    """Also for the types that home where the switch falls: the manual's rule for a gantry."""
    gantry = Gantry(home_type, (SideRig(), SideRig(skew=skew)), start=start)
    homed(gantry)
    assert gantry.states[0] == 'HSClearReverse'


def test_both_on_then_only_one_falls():
    gantry = Gantry('HSHS', start=0.062)
    gantry.on_message = lambda n, source, time, level: (n, source, level) != (1, HS, False)
    assert 'of y.y2 did not change' in failed(gantry, Error.FollowerSwitchMissing)


@pytest.mark.parametrize('skew', [0.001, -0.001])
def test_edges_in_the_opposite_order_after_a_squaring(skew):
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=skew)))
    gantry.until('Squaring')
    by = 0.00003 if skew > 0.0 else -0.00003  # the side that came first comes last now
    gantry.plants[1].move_switch(HS, by)
    outcome = gantry.finish()
    assert outcome.error is Error.NoError, outcome.message
    assert outcome.members[1].squareness == pytest.approx(by, abs=1e-6)


@each_way
@pytest.mark.parametrize('side', [0, 1])
def test_bounce_on_one_side_right_after_the_edge(side, direction):
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0004)), direction)
    bouncing(gantry, side, Input.HOME_SWITCH, [0.0004, 0.001, 0.0025])
    homed(gantry)


@pytest.mark.parametrize('what', ['motors', 'encoders'])
def test_cables_swapped(what):
    """They move together, so only the squaring move shows it: the sign test ends it."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001, zero=-0.001)))
    setattr(gantry, {'motors': 'motor_of', 'encoders': 'encoder_of'}[what], [1, 0])
    message = failed(gantry, Error.NotSquare)
    assert 'swapped' in message and 'in Squaring' in message
    assert gantry.worst < 0.001 + 0.0002


def test_switches_swapped():
    """The first pass is not square by the wrong sign; the proving pass sees it."""
    sides = SideRig(), SideRig(skew=0.0009, zero=-0.0009)
    gantry = Gantry('HSHS', sides, edge_tolerance=0.0002)
    gantry.motor_of, gantry.encoder_of = [1, 0], [1, 0]
    message = failed(gantry, Error.NotSquare)
    assert 'in Proving' in message
    assert gantry.worst < 0.002


@pytest.mark.parametrize('side', [0, 1])
@pytest.mark.parametrize('speed', [0.2, 0.05])
def test_feedback_frozen(side, speed):
    gantry = Gantry('HSHS', homing_velocity_fast=speed, start=0.01)

    def freeze():
        if (
            gantry.axis.running
            and not gantry.frozen
            and gantry.axis.profile.velocity > 0.9 * speed
        ):
            gantry.freeze(side)

    gantry.on_cycle = freeze
    failed(gantry, Error.SkewTooLarge)
    place = abs(gantry.samples[-1].physical[side] - gantry.frozen[side])
    assert place <= 0.002 + STOPPING  # so far would it have racked, had the side stood


@pytest.mark.parametrize('late', [0, 1])
@pytest.mark.parametrize('home_type', ['HS', 'HSHS', 'HSReverse', 'LS', 'HSZPulse'])
def test_messages_of_one_side_late_are_no_skew(home_type, late):
    """At 0.2 m/s, 50 ms are 10 mm, and max_skew is 2 mm: equal times are compared."""
    sides = [SideRig(), SideRig(skew=0.0019)]
    sides[late].delay = 0.05
    gantry = Gantry(home_type, sides)
    homed(gantry)
    assert gantry.axis.largest_skew < 1.5e-4


@each_way
def test_one_index_a_pitch_away(direction):
    """The follower's switch arms just behind the pulse: the next one is of the next turn."""
    side = SideRig(wrong_offset=0.0003)
    pitched = Gantry(
        'HSZPulse',
        (SideRig(), side),
        direction,
        built={'index_offset': 0.0001},
        z_pulse_distance_check=0.01,
    )
    assert '1 x 0.01 m' in failed(pitched, Error.IndexAmbiguous)
    assert pitched.worst < 1e-6  # it did not move by a pitch


def test_one_drive_trips_while_squaring():
    servo = ['home_switch', LIMIT_AHEAD, 'negative_limit_switch', 'servo_enabled']
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001)), switches=servo)
    gantry.until('Squaring', 10)
    gantry.axis.followers[0].enable(False)
    message = failed(gantry, Error.ServoOff, gantry.finish())
    assert 'y.y2' in message
    assert not gantry.axis.servo_on  # servo off means all


@pytest.mark.parametrize('state', ['HSSearch', 'HSClearReverse', 'SecondHSSearch', 'HomeShift'])
@pytest.mark.parametrize('side', [0, 1])
def test_one_drive_trips(state, side):
    servo = ['home_switch', LIMIT_AHEAD, 'negative_limit_switch', 'servo_enabled']
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001)), switches=servo)
    gantry.until(state, 3)
    gantry.drives[side].enable(False)
    failed(gantry, Error.ServoOff, gantry.finish())
    assert not gantry.axis.servo_on


ALL_STATES = ['HSSearch', 'HSClearReverse', 'SecondHSSearch', 'HomeShift', 'Squaring', 'Proving']


@pytest.mark.parametrize('error', [Error.Canceled, Error.EmergencyStop])
@pytest.mark.parametrize('state', ALL_STATES)
def test_cancel_and_emergency_stop(state, error):
    """Also while a follower moves alone: it stops, and nothing moves afterwards."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0015)))
    gantry.until(state, 9)
    if error is Error.Canceled:
        gantry.axis.cancel()
    else:
        gantry.axis.set_emergency_stop(True)
    failed(gantry, error, gantry.finish())
    if state == 'Squaring':  # it was the follower alone that moved, and that has stopped
        assert 0.0 < gantry.skews[0] < 0.0015
    places = [gantry.physical(n) for n in (0, 1)]
    for _ in range(20):
        gantry.cycle()
    assert [gantry.physical(n) for n in (0, 1)] == places
    gantry.axis.set_emergency_stop(False)
    homed(gantry)


def test_a_gantry_springs_back_when_a_servo_goes_off():
    """The home of the group is lost with any servo; the next run squares it again."""
    servo = ['home_switch', LIMIT_AHEAD, 'negative_limit_switch', 'servo_enabled']
    gantry = Gantry(
        'HSHS',
        (SideRig(), SideRig(skew=0.0015)),
        switches=servo,
        clear_home_done_on_servo_off=False,
    )
    homed(gantry)
    gantry.axis.followers[0].enable(False)
    assert not gantry.axis.homed
    assert gantry.axis.outcome.error is Error.ServoOff
    assert 'y.y2' in gantry.axis.outcome.message
    plant = gantry.plants[1]
    plant.follow(plant.position + 0.0012, over=0.05)
    gantry.axis.followers[0].enable(True)
    gantry.axis.set_servo(True)
    outcome = homed(gantry)
    assert outcome.members[1].skew == pytest.approx(-0.0012, abs=1e-4)


@each_way
def test_limit_of_one_side_hit_first_because_of_racking(direction):
    """The limit ahead of either side turns both; a limit behind ends the run of both."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0019)), direction, start=0.07)
    homed(gantry)
    assert 'HSFallingEdgeSearchReverse' in gantry.states
    furthest = max(one.physical[0] for one in gantry.samples)
    assert furthest < 0.09 - 0.0019 + 0.2**2 / (2 * 5) + 0.2 * 0.02

    behind = Gantry('HSHS', (SideRig(), SideRig(skew=-0.0019)), direction, start=0.0050)
    name = Input(on_side('negative_limit_switch', direction))
    behind.until('HSSearch', 3)
    behind.switch(1, name, behind.time, True)
    message = failed(behind, Error.LSTriggered, behind.finish())
    assert 'the limit switch of y.y2' in message


@each_way
def test_follower_inverted_mirrored_mount(direction):
    """Its own home_direction says so: it counts the other way round, with swapped limits."""
    other = 'Negative' if direction > 0 else 'Positive'
    side = SideRig(skew=0.001, offset=0.0003, mirror=True, zero=0.5, own={'home_direction': other})
    gantry = Gantry('HSHS', (SideRig(), side), direction)
    outcome = homed(gantry)
    assert outcome.members[1].skew == pytest.approx(-direction * 0.001, abs=1e-4)
    again = Gantry('HSHS', (SideRig(), side), direction, start=0.07)  # over the limit ahead
    homed(again)


def test_follower_inverted_its_encoder():
    gantry = Gantry('HSHS')
    gantry.inverted.add(1)
    assert 'inverted' in failed(gantry, Error.SkewTooLarge)
    assert gantry.samples[-1].physical[0] - 0.05 < 0.002 + STOPPING


@pytest.mark.parametrize('side', [0, 1])
def test_command_lost_for_one_of_two_controllers(side):
    gantry = Gantry('HSHS', start=0.02)

    def lose():
        if gantry.axis.running and gantry.axis.profile.velocity > 0.19:
            gantry.deaf.add(side)

    gantry.on_cycle = lose
    failed(gantry, Error.SkewTooLarge)
    assert gantry.worst <= 0.002 + STOPPING


@pytest.mark.parametrize('state', ['Squaring', 'Proving'])
def test_node_restart_between_squaring_and_proving(state):
    """The new node knows no home; its run finds the gantry as it stands, and squares it."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0015)))
    gantry.until(state, 8)
    gantry.start_node()
    assert not gantry.axis.homed
    for _ in range(100):
        gantry.cycle()
    homed(gantry)


def test_different_travel_of_the_two_sides():
    """A hard stop of one side before the switch: the other one does not drive on."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(stop=0.055)), start=0.02)
    failed(gantry, Error.SkewTooLarge)
    assert gantry.worst <= 0.002 + STOPPING


def test_two_followers_with_contradicting_errors():
    """Each would be allowed, but not both: they are 3 mm from each other."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0015), SideRig(skew=-0.0015)))
    message = failed(gantry, Error.FollowerSwitchMissing)
    assert 'y.y3' in message and 'y.y2' in message
    gantry = Gantry(
        'HSHS',
        (SideRig(), SideRig(skew=0.0012, offset=0.001), SideRig(skew=-0.0012, offset=-0.001)),
    )
    assert 'not forced' in failed(gantry, Error.SkewTooLarge)
    assert 'Squaring' not in gantry.states


def test_out_of_square_by_more_than_max_skew_is_never_forced():
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.005)))
    failed(gantry, Error.FollowerSwitchMissing)
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0028, offset=0.001)))
    assert 'not forced' in failed(gantry, Error.SkewTooLarge)
    assert 'Squaring' not in gantry.states


def test_a_follower_that_does_not_move_in_the_squaring():
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001)))
    gantry.until('Squaring')
    gantry.deaf.add(1)
    assert 'jammed' in failed(gantry, Error.NotSquare, gantry.finish())


def test_a_limit_that_rises_in_the_squaring_ends_it():
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001)))
    gantry.until('Squaring', 10)
    gantry.switch(1, Input(LIMIT_AHEAD), gantry.time, True)
    assert 'y.y2' in failed(gantry, Error.LSTriggered, gantry.finish())


def test_stale_feedback_of_a_follower_stops_all():
    gantry = Gantry('HSHS', start=0.0, feedback_timeout=0.05)
    gantry.until('HSSearch', 5)
    gantry.drives[1].feedback = lambda *_: None
    gantry._messages.clear()
    message = failed(gantry, Error.FeedbackStale, gantry.finish())
    assert 'y.y2' in message


def test_home_is_lost_with_the_feedback_of_a_follower():
    gantry = Gantry()
    homed(gantry)
    gantry.drives[1].feedback = lambda *_: None
    for _ in range(60):
        gantry.cycle()
    assert not gantry.axis.homed
    assert gantry.axis.outcome.error is Error.FeedbackStale


def test_a_run_waits_for_the_inputs_of_all_sides():
    gantry = Gantry()
    gantry.axis.followers[0].readings.switches[Input.HOME_SWITCH].level = None
    assert gantry.axis.refusal(gantry.time).error is Error.SwitchUnknown
    assert 'y.y2' in gantry.axis.refusal(gantry.time).message
    gantry = Gantry()
    homed(gantry)
    assert gantry.axis.refusal(gantry.time, verify=True).error is Error.InvalidParameter


# -------------------------------------------------------------------------------- by hypothesis


@given(
    home_type=st.sampled_from([HomeType(t) for t in SUPPORTED]),
    direction=st.sampled_from(DIRECTIONS),
    start=st.floats(0.01, 0.085),
    skew=st.floats(-0.002, 0.002),
    offset=st.floats(-0.001, 0.001),
    delay=st.floats(0.0, 0.05),
    late=st.sampled_from([0, 1]),
    lag=st.floats(0.0, 0.004),
    stamp_error=st.sampled_from([0.0, 0.002]),
)
@settings(max_examples=25)
def test_square_or_a_named_error(
    home_type, direction, start, skew, offset, delay, late, lag, stamp_error
):
    """Homed: square within tolerance and uncertainty. Ever: no more skew than is allowed."""
    sides = [SideRig(), SideRig(skew=skew, offset=offset, lag=lag)]
    sides[late].delay = delay
    gantry = Gantry(home_type, sides, direction, start, switch_stamp_error=stamp_error)
    outcome = gantry.home()
    assert gantry.worst <= 0.002 + abs(skew) + STOPPING
    assert gantry.axis.largest_skew <= 0.002 + STOPPING
    smooth(gantry)
    if outcome.error is Error.NoError:
        member = outcome.members[1]
        assert abs(gantry.skews[0]) <= TOLERANCE + member.uncertainty + 1e-6
    else:
        assert outcome.message
        reversing = home_type in INDEX_TYPES or 'HS' not in home_type
        assert reversing or abs(skew) > 0.0015 or start > 0.05 or lag > 0.002, outcome.message


OTHER = {1: 'Negative', -1: 'Positive'}


@given(
    home_type=st.sampled_from(['HSHS', 'HSOff', 'HSReverse', 'HSZPulse', 'HSTouchProbe', 'LS']),
    direction=st.sampled_from(DIRECTIONS),
    start=st.floats(0.02, 0.05),
    followers=st.lists(
        st.tuples(st.floats(-0.00195, 0.00195), st.floats(-0.001, 0.001), st.booleans()),
        min_size=3,
        max_size=3,
    ),
    stiffness=st.sampled_from([0.0, 1e5, 3e6]),
)
@settings(max_examples=12)
def test_three_followers_some_mirrored(home_type, direction, start, followers, stiffness):
    """Skewed by nearly max_skew, each with switches of its own place: square, or refused."""
    sides = [SideRig()]
    for n, (skew, offset, mirror) in enumerate(followers):
        switches = [
            on_side(str(name), -1) for name in rig(home_type).parameters(direction).switches
        ]
        own = {'home_direction': OTHER[direction], 'switches': switches} if mirror else {}
        sides.append(SideRig(skew, offset, zero=0.1 * n, mirror=mirror, own=own))
    gantry = Gantry(home_type, sides, direction, start, stiffness=stiffness)
    forces = [0.0]
    if stiffness:
        gantry.on_cycle = lambda: forces.append(max(abs(one.force) for one in gantry.plants))
    outcome = gantry.home()
    assert gantry.worst <= 0.00195 + 1e-4
    assert max(forces) <= stiffness * 0.0021
    skews = [0.0, *(skew for skew, _, _ in followers)]
    if outcome.error is Error.NoError:
        homed(gantry, outcome)
    else:  # two sides are further from each other than max_skew, so that nothing is forced
        assert outcome.error in (Error.FollowerSwitchMissing, Error.SkewTooLarge), outcome.message
        assert max(skews) - min(skews) > 0.0019


def test_unsupported_types_have_no_gantry():
    assert set(UNSUPPORTED) | set(SUPPORTED) == set(PROCEDURES)
