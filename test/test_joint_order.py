# SPDX-License-Identifier: Apache-2.0
"""Holding the axes before a run, to see that each joint gets its own position."""

from types import SimpleNamespace

import pytest

from homing_node.core.position_array import OtherJoint, Slot
from homing_node.parameters.axis import axis_parameters
from homing_node.procedures.states import Error
from homing_node.ros.joint_order import JointOrder

PERIOD = 0.004
P = axis_parameters({'home_type': 'HS', 'travel': 0.2}, 'x')


def axis(position):
    return SimpleNamespace(
        raw_position=position, hold_position=position + 0.25, parameters=P, powered=True
    )


@pytest.fixture
def axes():
    return {'x': axis(0.05), 'y': axis(0.1)}


@pytest.fixture
def order(axes):
    return JointOrder([Slot(f'{name}_joint', name, axes[name]) for name in axes], PERIOD)


def held_cycles(order):
    cycles = 0
    while order.cycle(moving=False):
        cycles += 1
    return cycles


def test_nothing_is_held_unless_a_run_asks(order):
    assert held_cycles(order) == 0
    assert order.wrong is None


def test_axes_that_stay_are_held_for_a_while_then_a_run_may_begin(order):
    assert order.missing.error is Error.NoController
    assert order.held == {'x_joint': 0.3, 'y_joint': 0.35}
    assert held_cycles(order) == 50  # 0.2 s
    assert order.missing is None
    assert order.wrong is None


def test_what_was_held_does_not_follow_the_feedback(order, axes):
    assert order.missing
    axes['x'].hold_position = axes['x'].raw_position = 0.0501
    assert order.cycle(moving=False)
    assert order.held['x_joint'] == 0.3  # as it was when the hold began


def test_an_axis_whose_servo_is_off_is_held_where_it_comes_to_rest(order, axes):
    """A run whose drive went off ends while the axis still coasts: that is no wrong order."""
    assert order.missing
    assert order.cycle(moving=True) is False
    axes['x'].powered = False
    axes['x'].raw_position, axes['x'].hold_position = 0.06, 0.31
    assert not order.cycle(moving=False)
    axes['x'].powered = True
    assert not order.cycle(moving=False)
    assert order.wrong is None
    assert order.held['x_joint'] == 0.31


def test_an_axis_that_moves_is_named(order, axes):
    assert order.missing
    assert order.cycle(moving=False)
    axes['y'].raw_position = 0.09  # 5 % of its travel
    assert not order.cycle(moving=False)
    assert order.wrong.error is Error.NoController
    assert order.wrong.final
    assert 'axis y moved by 0.01' in order.wrong.message
    assert 'in the order x_joint, y_joint' in order.wrong.message


def test_a_joint_that_no_axis_homes_is_held_and_watched_too(axes):
    other = OtherJoint('q', 0.1)
    other.feedback(0.7, 0.0)
    order = JointOrder([Slot('q', '', other), Slot('x_joint', 'x', axes['x'])], PERIOD)
    assert order.missing
    assert order.held == {'q': 0.7, 'x_joint': 0.3}
    assert order.cycle(moving=False)
    other.feedback(0.69, 0.004)
    assert not order.cycle(moving=False)
    assert 'joint q moved by 0.01' in order.wrong.message


def test_the_next_group_of_a_sequence_is_not_held_again(order, axes):
    """The axes have moved meanwhile: that is no sign of another order."""
    assert order.missing
    held_cycles(order)
    for _ in range(1000):
        order.cycle(moving=True)
    axes['y'].raw_position += 0.05
    assert not order.cycle(moving=False)
    assert order.missing is None
    assert order.wrong is None


def test_a_later_run_asks_anew(order):
    assert order.missing
    held_cycles(order)
    order.cycle(moving=True)
    for _ in range(400):
        order.cycle(moving=False)
    assert order.missing is not None


def test_an_old_agreement_and_an_old_failure_do_not_count(order, axes):
    assert order.missing
    axes['y'].raw_position = 0.0
    for _ in range(400):
        order.cycle(moving=False)
    assert order.wrong is None
    assert order.missing is not None
