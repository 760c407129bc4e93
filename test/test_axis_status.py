# SPDX-License-Identifier: Apache-2.0
"""What plots need of an axis: its command, its following error, the levels of its inputs."""

from dataclasses import replace

import pytest
from core_rig import DIRECTIONS, HS, LIMIT_BEHIND, rig

from homing_node.core.axis import Axis
from homing_node.parameters.axis import axis_parameters
from homing_node.procedures.states import Input


def in_the_search(lag, direction, **transport):
    """Return a rehearsal whose axis goes to the switch at its fast velocity."""
    one = rig('HS', homing_velocity_fast=0.05).built(lag=lag, start=0.0)
    made = one.but(replace(one.transport, **transport)).rehearsal(direction)
    for _ in range(5):
        made.cycle()
    assert made.axis.home(made.time) is None
    for _ in range(100):
        made.cycle()
    assert abs(made.axis.profile.velocity) == pytest.approx(0.05)
    return made


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_command_and_following_error_without_a_lag(direction):
    made = in_the_search(0.0, direction)
    axis = made.axis
    assert axis.command == pytest.approx(direction * axis.profile.position, abs=1e-12)
    assert axis.following_error == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize('direction', DIRECTIONS)
@pytest.mark.parametrize('delay', [0.0, 0.03])
def test_the_following_error_is_that_of_the_drive_and_not_of_late_messages(delay, direction):
    made = in_the_search(0.02, direction, feedback_delay=delay)
    assert made.axis.following_error == pytest.approx(direction * 0.05 * 0.02, rel=0.05)


def test_with_a_lead_the_command_is_the_present_one():
    axis = Axis('x', rig('HS', homing_velocity_fast=0.05).parameters(), 0.004, lead=0.048)
    axis.feedback(0.0, 0.0)
    for name in (HS, LIMIT_BEHIND, 'positive_limit_switch'):
        axis.switch(Input(name), 0.0, False)
    assert axis.home(0.001) is None
    told = []
    for cycle in range(1, 100):
        now = 0.004 * cycle
        newest = axis.update(now)
        told.append((now + 0.048 + 0.004, newest[0]))
        then = [position for due, position in told if due <= now + 0.004 + 1e-9]
        present = then[-1] if then else 0.0
        assert axis.command == pytest.approx(present, abs=1e-9)
        axis.feedback(now + 0.002, present)
    assert present > 0.005


def test_without_a_run_the_command_is_the_position():
    axis = Axis('x', rig('HS').parameters(-1), 0.004)
    axis.feedback(1.0, 0.5)
    assert (axis.command, axis.following_error) == (0.5, 0.0)


def test_levels_are_after_polarity_and_in_the_order_of_switches():
    wired = [LIMIT_BEHIND, 'z_pulse', HS, 'servo_enabled']
    p = axis_parameters(
        {'home_type': 'HSZPulse', 'travel': 1, 'switches': wired, 'invert_hs_polarity': True}
    )
    axis = Axis('x', p, 0.004)
    assert axis.levels == [(Input(name), None) for name in wired]
    axis.switch(Input.HOME_SWITCH, 1.0, False)
    axis.switch(Input(LIMIT_BEHIND), 1.0, False)
    axis.enable(True)
    assert [level for _, level in axis.levels] == [False, None, True, True]
