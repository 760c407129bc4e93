# SPDX-License-Identifier: Apache-2.0
"""Latched positions: which one is the reference."""

import pytest
from core_rig import rig

from homing_node.core.latches import Latches
from homing_node.procedures.events import Event
from homing_node.procedures.motions import Way
from homing_node.procedures.states import Error, Input

BOTH_WAYS = pytest.mark.parametrize('way', [Way.TOWARD, Way.AWAY])
PULSE = Input.Z_PULSE
PROBE = Input.TOUCH_PROBE


def latched(source, *positions, home_type='HSZPulse', **changes):
    """Return the latches of an axis that has passed positions."""
    one = Latches(rig(home_type, **changes).parameters())
    for position in positions:
        one.add(source, position)
    return one


def test_two_pulses_with_a_turn_between_them_are_no_pitch():
    one = latched(PULSE, 0.01)
    one.forget()
    one.add(PULSE, 0.0105)
    assert one.pitch is None
    one.add(PULSE, 0.0205)
    assert one.pitch == pytest.approx(0.01)


@BOTH_WAYS
def test_a_pulse_exactly_at_the_origin_lies_not_beyond_it(way):
    one = latched(PULSE, way * 0.01)
    assert one.found([Event.Z_PULSE], way * 0.01, way, way * 0.02) is None
    event, mark = one.found([Event.Z_PULSE], way * 0.0099, way, way * 0.02)
    assert event is Event.Z_PULSE
    assert mark.position == way * 0.01


@BOTH_WAYS
def test_the_distance_to_the_next_pulse_counts_from_the_last_one(way):
    one = latched(PULSE, way * 0.01, way * 0.02, multiple_z_pulse=3, max_z_pulse_distance=0.011)
    assert one.found([Event.Z_PULSE], 0.0, way, way * 0.0309) is None
    assert one.found([Event.Z_PULSE], 0.0, way, way * 0.0311).error is Error.ZPulseNotFound


@BOTH_WAYS
@pytest.mark.parametrize(
    'change',
    [{'multiple_z_pulse': 3}, {'z_pulse_arm_delay': 0.05}, {'max_z_pulse_distance': 0.005}],
)
def test_what_is_set_for_pulses_does_not_concern_the_probe(way, change):
    one = latched(PROBE, home_type='HSTouchProbe', **change)
    assert one.found([Event.TOUCH_PROBE], 0.0, way, way * 0.009) is None
    one.add(PROBE, way * 0.01)
    one.add(PROBE, way * 0.012)
    event, mark = one.found([Event.TOUCH_PROBE], 0.0, way, way * 0.02)
    assert event is Event.TOUCH_PROBE
    assert mark.position == way * 0.01
