# SPDX-License-Identifier: Apache-2.0
"""What the squaring and the proving pass do not accept: no wrong home, no way without an end."""

import pytest
from core_rig import HS, LIMIT_AHEAD, rig
from gantry_rig import Gantry, SideRig

from homing_node.core.gantry.edges import Captures
from homing_node.core.signals import Edge
from homing_node.plant.layout import SwitchLayout
from homing_node.procedures.motions import Way
from homing_node.procedures.states import Error, Input

SIDES = pytest.mark.parametrize('side', [0, 1])


def with_flag(home_type, width, hysteresis):
    """Return the flags of the rig with another home switch."""
    flags = dict(rig(home_type).layout.switches)
    return {**flags, HS: SwitchLayout(0.06, 0.06 + width, hysteresis=hysteresis)}


# ----------------------------------------------------------------------------- the way back ends


@SIDES
@pytest.mark.parametrize('home_type', ['LS', 'LSLS', 'LSOff', 'HSHS', 'HSReverse', 'HSOffReverse'])
def test_a_switch_that_keeps_its_level_after_the_squaring(home_type, side):
    """The way back is short, and the proving pass does not begin."""
    switch = Input(HS if home_type.startswith('HS') else LIMIT_AHEAD)
    gantry = Gantry(home_type, (SideRig(), SideRig(skew=0.0012)))
    gantry.until('Squaring', 10)
    places = len(gantry.samples)
    reference = gantry.axis.machine.reference.position
    gantry.on_message = lambda n, source, time, level: (n, source) != (side, switch)
    outcome = gantry.finish()
    assert outcome.error is Error.FollowerSwitchMissing
    assert f'of {"y.y2" if side else "y"} did not' in outcome.message
    for sample in gantry.samples[places:]:  # two tries, and where the first pass came to rest
        assert abs(sample.physical[0] - reference) < 2 * 0.002 + 0.0065


def test_a_switch_with_a_wide_hysteresis_gets_a_longer_way():
    flags = with_flag('HSHS', 0.006, 0.0045)
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.0012)), built={'switches': flags})
    outcome = gantry.home()
    assert outcome.error is Error.NoError, outcome.message


def test_a_flag_that_was_overrun_is_no_place_before_it():
    """The rise at its far end, on the way back, is none of the reference: go back further."""
    gantry = Gantry(
        'HS',
        (SideRig(), SideRig(skew=0.0006)),
        built={'switches': with_flag('HS', 0.003, 0.0015)},
        max_skew=0.001,
        homing_reverse_distance=0.0005,
    )
    outcome = gantry.home()
    assert outcome.error is Error.NoError, outcome.message
    assert max(sample.physical[0] for sample in gantry.samples) < 0.075


def edge(time, way, *, rises):
    """Return an edge whose way of travel is known."""
    found = Edge(Input.HOME_SWITCH, time, rises)
    found.way = way
    return found


def test_a_rise_that_is_awaited_shows_who_is_missing_whatever_the_level():
    captures = Captures(Input.HOME_SWITCH, {'y': False, 'y2': True}, 'y')
    assert captures.level
    captures.add('y', edge(1.0, Way.TOWARD, rises=True))
    first = captures.pending(rises=True)
    assert first is not None and first[1:] == ('y', ['y2'])


def test_which_sides_are_before_their_reference():
    captures = Captures(Input.HOME_SWITCH, {'y': True, 'y2': True}, 'y')
    assert captures.not_before(rises=True, way=Way.TOWARD) == ['y', 'y2']
    captures.add('y', edge(1.0, Way.AWAY, rises=False))
    assert captures.not_before(rises=True, way=Way.TOWARD) == ['y2']
    captures.add('y', edge(2.0, Way.AWAY, rises=True))  # a far end
    assert captures.not_before(rises=True, way=Way.TOWARD) == ['y', 'y2']
    captures.add('y', edge(3.0, Way.TOWARD, rises=False))
    captures.add('y', edge(4.0, Way.TOWARD, rises=True))  # captured, as it dithers at the edge
    assert captures.not_before(rises=True, way=Way.TOWARD) == ['y2']


def test_the_level_of_sides_that_moved_alone_is_that_of_the_group_where_they_agree():
    captures = Captures(Input.HOME_SWITCH, {'y': True, 'y2': True}, 'y')
    captures.note('y', edge(1.0, Way.AWAY, rises=False))
    assert captures.level
    captures.note('y2', edge(1.0, Way.AWAY, rises=False))
    assert not captures.level


# ------------------------------------------------------------------------------ no wrong home


@pytest.mark.parametrize('home_type', ['HSOff', 'HS'])
def test_switch_messages_that_are_late_and_untold(home_type):
    """The fast pass is off by more than the slow one: that is no home."""
    gantry = Gantry(home_type, (SideRig(), SideRig(skew=0.0012)))
    straight = gantry.switch
    gantry.switch = lambda n, source, time, level: straight(n, source, time + 0.02, level)
    assert gantry.home().error is Error.EdgeNotRepeated


def test_a_pulse_that_is_more_than_half_a_pitch_away_is_of_another_turn():
    """It is not squared by a pitch."""
    gantry = Gantry(
        'HSZPulse',
        (SideRig(), SideRig(wrong_offset=0.0003, skew=0.0008)),
        built={'index_offset': 0.0001, 'index_pitch': 0.002},
        z_pulse_distance_check=0.002,
        max_skew=0.0009,
    )
    assert gantry.home().error is Error.IndexAmbiguous
    assert gantry.skews[0] == pytest.approx(0.0008, abs=1e-6)


def test_pulses_closer_than_twice_max_skew_do_not_square_a_gantry():
    gantry = Gantry(
        'HSZPulse',
        (SideRig(), SideRig(skew=0.0004)),
        built={'index_offset': 0.0001, 'index_pitch': 0.002},
        z_pulse_distance_check=0.002,
    )
    outcome = gantry.home()
    assert outcome.error is Error.IndexAmbiguous
    assert 'max_skew is 0.002 m' in outcome.message or 'max_skew is 2 mm' in outcome.message
    assert 'Squaring' not in gantry.states


def test_the_message_of_a_limit_names_the_side_before_the_hint():
    gantry = Gantry('HSHS', start=0.062)
    gantry.until('HSClearReverse', 3)
    gantry.switch(1, Input.NEGATIVE_LIMIT_SWITCH, gantry.time, level=True)
    message = gantry.finish().message
    assert 'the limit switch of y.y2' in message
    assert 'the limit switch of y.y2' not in message.partition('; ')[2]


def test_the_hint_at_a_home_switch_that_is_never_off_names_its_side():
    """It is on on that side only; the limit behind ends the run."""
    stuck = SideRig(stuck={'home_switch': True})
    outcome = Gantry('HSHS', (SideRig(), stuck), start=0.001, max_skew=0.02).home()
    assert outcome.error is Error.LSTriggered
    assert 'the home switch of y.y2 was on at the start and never fell' in outcome.message
