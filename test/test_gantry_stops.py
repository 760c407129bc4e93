# SPDX-License-Identifier: Apache-2.0
"""How a gantry stops, and what is left afterwards: no step, and no run that adds up to another."""

from dataclasses import replace
from itertools import pairwise

import pytest
from core_rig import LIMIT_AHEAD
from gantry_rig import PERIOD, STEP, Gantry, SideRig

from homing_node.core.gantry.trip import LASTS
from homing_node.parameters.definition import InvalidParameters
from homing_node.procedures.states import Direction, Error, Input

SERVO = ['home_switch', LIMIT_AHEAD, 'negative_limit_switch', 'servo_enabled']
SIDES = pytest.mark.parametrize('side', [0, 1])


def commands(gantry):
    """Return the newest command of each side, in the toward frame."""
    return [gantry.axis.profile.position, *(one.command for one in gantry.axis.followers)]


def trip(gantry, side):
    """Let the drive of a side trip: it holds its side no more, and obeys no command."""
    gantry.plants[side].servo(False)
    gantry.deaf.add(side)
    gantry.drives[side].enable(False)


def wait(gantry, cycles=60):
    """Let some cycles pass."""
    for _ in range(cycles):
        gantry.cycle()


def switch_on(gantry):
    """Switch all servos on again."""
    gantry.deaf.clear()
    for drive, plant in zip(gantry.drives, gantry.plants, strict=True):
        plant.servo(True)
        drive.enable(True)
    gantry.axis.set_servo(True)
    wait(gantry)


# --------------------------------------------------------------------------------- after a trip


@SIDES
@pytest.mark.parametrize(
    ('state', 'cycles'),
    [('HSSearch', 15), ('SecondHSSearch', 12), ('Squaring', 15), ('HomeShift', 2)],
)
def test_the_run_after_a_trip_begins_without_a_step(state, cycles, side):
    """Each side begins where it is, also the one whose drive has tripped."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001)), switches=SERVO)
    gantry.until(state, cycles)
    trip(gantry, side)
    assert gantry.finish().error is Error.ServoOff
    switch_on(gantry)
    places = [plant.position for plant in gantry.plants]
    gantry.samples.clear()
    assert gantry.axis.home(gantry.time) is None
    while not gantry.samples:
        gantry.cycle()
    first = [position for position, _, _ in gantry.samples[0].commands]
    assert first == pytest.approx(places, abs=2e-5)


@SIDES
def test_the_command_comes_back_to_a_side_that_has_tripped(side):
    gantry = Gantry('HSHS', switches=SERVO)
    gantry.until('HSSearch', 15)
    trip(gantry, side)
    assert gantry.finish().error is Error.ServoOff
    places = [gantry.plants[n].position for n in (0, 1)]
    assert abs(places[0] - places[1]) > 0.001  # the other one came to rest on its path
    assert commands(gantry) == pytest.approx(places, abs=1e-5)


@SIDES
def test_a_limit_that_switches_the_servos_off_at_once(side):
    """The commands of all sides come back to where the sides stand."""
    gantry = Gantry(
        'HSHS',
        ls_type='SeparatePositiveLSNegativeLS',
        positive_ls_type='Dec',
        negative_ls_type='ServoOff',
        start=0.065,
        homing_reverse_distance=0.03,
    )
    gantry.until('HSClearReverse', 12)
    for plant in gantry.plants:
        plant.servo(False)
    gantry.deaf |= {0, 1}
    gantry.drives[side].switch(
        Input.NEGATIVE_LIMIT_SWITCH, gantry.time, signal=True, arrival=gantry.time
    )
    gantry.cycle()
    assert not gantry.axis.running and not gantry.axis.servo_on
    assert gantry.axis.returning and gantry.axis.followers[0].returning
    wait(gantry)
    places = [plant.position for plant in gantry.plants]
    assert commands(gantry) == pytest.approx(places, abs=1e-5)


@SIDES
def test_a_trip_at_rest_switches_all_servos_off(side):
    """As in a run; a drive that was never on does not."""
    gantry = Gantry('HSHS', switches=SERVO)
    gantry.axis.followers[0].readings.servo_enabled = None
    gantry.axis.followers[0].enable(False)
    gantry.axis.followers[0].enable(False)
    assert gantry.axis.servo_on
    gantry.axis.followers[0].enable(True)
    assert gantry.home().error is Error.NoError
    gantry.drives[side].enable(False)
    assert not gantry.axis.homed
    for _ in range(round(LASTS / PERIOD)):
        assert gantry.axis.servo_on
        gantry.cycle()
    for _ in range(2):
        gantry.cycle()
    assert not gantry.axis.servo_on
    assert gantry.axis.refusal(gantry.time).error is Error.ServoOff


@SIDES
def test_what_a_publisher_has_kept_of_the_servo_is_no_trip(side):
    """A node that starts gets it nearly at once: the drive is on again, the home is lost."""
    gantry = Gantry('HSHS', switches=SERVO)
    assert gantry.home().error is Error.NoError
    for enabled in (True, False, False, True):
        gantry.drives[side].enable(enabled)
        for _ in range(20):
            gantry.cycle()
    for _ in range(60):
        gantry.cycle()
    assert gantry.axis.servo_on and not gantry.axis.homed
    assert gantry.home().error is Error.NoError


# ------------------------------------------------------------------------------------- the stop


@SIDES
def test_after_a_following_error_each_side_stops_from_where_it_is(side):
    gantry = Gantry('HSHS', following_error=0.003, max_skew=0.02, start=0.0)
    gantry.until('HSSearch', 30)
    gantry.deaf.add(side)
    while not gantry.axis.machine.ending.stopping:
        gantry.cycle()
    assert gantry.axis.error is Error.FollowingError
    assert gantry.samples[-1].physical[side] == pytest.approx(
        gantry.samples[-1].commands[side][0], abs=0.0002
    )
    assert gantry.finish().error is Error.FollowingError
    assert abs(gantry.samples[-1].commands[side][0] - gantry.physical(side)) < 0.0002


def test_all_sides_stop_with_the_weakest_deceleration_after_a_following_error():
    weak = SideRig(own={'ls_dec': 1.0})
    gantry = Gantry('HSHS', (SideRig(), weak), following_error=0.003, max_skew=0.02, start=0.0)
    gantry.until('HSSearch', 30)
    gantry.deaf.add(1)
    gantry.finish()
    stop = [one.commands[0] for one in gantry.samples if one.commands[0][2] < -1e-6]
    assert max(-acceleration for _, _, acceleration in stop) <= 1.0 + 1e-9


def test_an_emergency_stop_after_a_cancel_is_heeded_by_a_follower_that_moves_alone():
    def time_to_rest(emergency):
        gantry = Gantry(
            'HSHS',
            (SideRig(), SideRig(skew=0.0019)),
            homing_velocity_slow_dec=0.2,
            homing_velocity_slow_acc=0.2,
            max_jerk=100,
        )
        gantry.until('Squaring')
        while abs(gantry.samples[-1].commands[1][1]) < 0.015:
            gantry.cycle()
        gantry.axis.cancel()
        gantry.cycle()
        if emergency:
            gantry.axis.set_emergency_stop(True)
        begun = gantry.time
        while abs(gantry.samples[-1].commands[1][1]) > 0.0:
            gantry.cycle()
        for one, other in pairwise(gantry.samples):
            (p, v, _), (q, w, _) = one.commands[1], other.commands[1]
            assert abs(q - p - 0.5 * (v + w) * PERIOD) < 1e-5
        return gantry.time - begun

    assert time_to_rest(emergency=True) < 0.6 * time_to_rest(emergency=False)


@pytest.mark.parametrize('after', [1, 3])
def test_simulated_time_that_is_set_back_while_the_followers_settle(after):
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0005, lag=0.02)))
    gantry.time, gantry._steps = 500.0, round(500 / STEP)
    gantry.start_node()
    wait(gantry)
    assert gantry.axis.home(gantry.time) is None
    while after:
        gantry.cycle()
        after -= gantry.axis.machine.finished
    gantry.time, gantry._steps = 1.0, round(1 / STEP)
    for plant in gantry.plants:
        plant.time = 1.0
    gantry._messages.clear()
    gantry._last.clear()
    gantry.axis.stop(Error.CycleLate, 'simulated time was set back')
    gantry.axis.time_jumped_back(gantry.time)
    for drive, plant in zip(gantry.drives, gantry.plants, strict=True):
        drive.feedback(gantry.time, plant.position)
    assert gantry.finish(5.0).error is Error.SkewTooLarge  # so it had ended; the lag is too large


# ------------------------------------------------------------------------------- the directions


@pytest.mark.parametrize('turned', ['y', 'y.y2'])
def test_a_gantry_keeps_its_directions(turned):
    """With another one a side would be driven against the others."""
    gantry = Gantry('HSHS')
    assert gantry.home().error is Error.NoError
    parameters = {name: drive.parameters for name, drive in gantry.axis.drives.items()}
    parameters[turned] = replace(parameters[turned], home_direction=Direction.Negative)
    with pytest.raises(InvalidParameters, match=f'{turned}.home_direction: Negative'):
        gantry.axis.configure(parameters['y'], {'y.y2': parameters['y.y2']})
    assert gantry.axis.homed
    follower = gantry.axis.followers[0]
    assert gantry.axis.homed_position_of(follower) == pytest.approx(gantry.axis.position, abs=1e-6)
    assert gantry.home().error is Error.NoError
    assert gantry.worst < 1e-4


# -------------------------------------------------------------------------------- repeated runs


@pytest.mark.parametrize('changes', [{}, {'following_error': 0.0015, 'max_skew': 0.004}])
def test_repeated_runs_do_not_add_up(changes):
    """One side is deaf: the second run is refused or ends at once, until the servo was off."""
    gantry = Gantry('HSHS', start=0.0, **changes)

    def lose():
        if gantry.axis.running and gantry.axis.profile.velocity > 0.05:
            gantry.deaf.add(1)

    gantry.on_cycle = lose
    for _ in range(5):
        gantry.deaf.clear()
        assert gantry.home().error in (Error.SkewTooLarge, Error.FollowingError)
    limit = gantry.parameters.max_skew
    assert limit < abs(gantry.skews[0]) < limit + 0.0055  # as after one run: it stops from 0.2 m/s
    assert 'switch its servo off and on' in gantry.axis.refusal(gantry.time).message
    gantry.axis.set_servo(False)
    gantry.axis.set_servo(True)
    assert gantry.axis.refusal(gantry.time) is None


def test_a_run_after_a_canceled_squaring_move_has_a_skew_of_its_own():
    """The references were found: the move alone was toward square."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0019)))
    gantry.until('Squaring', 15)
    gantry.axis.cancel()
    assert gantry.finish().error is Error.Canceled
    assert 0.0 < gantry.skews[0] < 0.0018
    assert gantry.home().error is Error.NoError
    assert gantry.axis.largest_skew < 1e-4


# ------------------------------------------------------------------------------------ at the end


def go_deaf(gantry, side, how):
    """Let a side stay behind, or its feedback, shortly before the command comes to rest."""
    machine = gantry.axis.machine
    while abs(gantry.axis.profile.position - machine.reference.position) > 0.0004:
        gantry.cycle()
        assert gantry.axis.state == 'HomeShift', gantry.axis.outcome
    if how == 'drive':
        gantry.deaf.add(side)
    elif how == 'encoder':
        gantry.freeze(side)
    else:
        gantry.drives[side].feedback = lambda *_: None
        gantry._messages.clear()


@SIDES
@pytest.mark.parametrize('skew', [0.001, 0.0])
@pytest.mark.parametrize(
    ('how', 'error'),
    [
        ('drive', Error.NotSquare),
        ('encoder', Error.NotSquare),
        ('no feedback', Error.FeedbackStale),
    ],
)
def test_a_side_that_stays_behind_in_the_last_move_is_not_homed(how, error, skew, side):
    """It is behind by less than `settling_tolerance`, but the gantry is out of square."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=skew)))
    gantry.until('Proving' if skew else 'SecondHSSearch')
    while gantry.axis.state != 'HomeShift' or gantry.axis.profile.velocity >= 0.0:
        gantry.cycle()
    go_deaf(gantry, side, how)
    outcome = gantry.finish()
    assert outcome.error is error, outcome.message
    named = 'y' if side == 0 and error is Error.FeedbackStale else 'y.y2'
    assert named in outcome.message
    assert not gantry.axis.homed


@SIDES
@pytest.mark.parametrize('timeout', [0.2, 5.0])
def test_feedback_that_ends_with_the_last_move_is_not_homed(side, timeout):
    """Where the side is now is not known, also where `feedback_timeout` would wait longer."""
    gantry = Gantry('HSHS', feedback_timeout=timeout)
    gantry.until('SecondHSSearch')
    while not gantry.axis.machine.finished:
        gantry.cycle()
    gantry.drives[side].feedback = lambda *_: None
    outcome = gantry.finish()
    assert outcome.error is Error.FeedbackStale, outcome.message
    assert not gantry.axis.homed


def test_a_stiff_gantry_tells_how_square_it_rests():
    """It is not forced; a side that stays behind is told, not judged."""
    gantry = Gantry('HSHS', square=False)
    gantry.until('SecondHSSearch')
    while gantry.axis.state != 'HomeShift' or gantry.axis.profile.velocity >= 0.0:
        gantry.cycle()
    go_deaf(gantry, 1, 'drive')
    outcome = gantry.finish()
    assert outcome.error is Error.NoError
    assert outcome.members[1].squareness == pytest.approx(-gantry.skews[0], abs=1e-6)
    assert abs(gantry.skews[0]) > 0.0002
