# SPDX-License-Identifier: Apache-2.0
"""The models of the controllers: the rules that were read in the sources of ros2_controllers."""

from math import nan

import pytest

from homing_node.plant.controller import (
    NS,
    RECOMMENDED,
    ForwardController,
    JtcParameters,
    Message,
    Point,
    TrajectoryController,
)

T = NS // 500
NOW = 10 * NS


def controller(parameters=RECOMMENDED, joints=('x',), at=(0.0,)):
    one = TrajectoryController(joints, 500.0, parameters)
    one.activate(at)
    one.update(NOW - T, at)
    return one


def point(time, position, velocity=0.0, acceleration=0.0):
    return Point(time, (position,), (velocity,), (acceleration,))


def moving(stamp=0, end=0.05, joints=('x',)):
    return Message(stamp, joints, (point(0, 0.0, 0.05), point(20 * T, 40 * T / NS * 0.025, end)))


def test_an_active_controller_holds_where_it_was_activated():
    one = controller(at=(0.3,))
    assert one.update(NOW, (0.4,)).positions == (0.3,)


def test_an_inactive_controller_hears_nothing():
    one = TrajectoryController(('x',), 500.0)
    assert not one.receive(moving(), NOW)
    assert one.update(NOW, (0.0,)) is None


@pytest.mark.parametrize(
    ('message', 'parameters', 'why'),
    [
        (moving(), JtcParameters(), 'velocity'),
        (moving(end=0.0), JtcParameters(), ''),
        (moving(), JtcParameters(allow_nonzero_velocity_at_trajectory_end=True), ''),
        (moving(NOW - 21 * T, 0.0), RECOMMENDED, 'past'),
        (moving(NOW - 19 * T, 0.0), RECOMMENDED, ''),
        (moving(end=0.0, joints=('q',)), RECOMMENDED, 'unknown'),
        (Message(0, ('x',), ()), RECOMMENDED, 'empty'),
        (Message(0, ('x',), (point(T, 0.0), point(T, 0.0))), RECOMMENDED, 'increasing'),
        (Message(0, ('x',), (Point(0, (0.0, 1.0)),)), RECOMMENDED, 'mismatch'),
    ],
)
def test_refusals(message, parameters, why):
    one = controller(parameters)
    assert one.receive(message, NOW) is (not why)
    assert why in one.refused


def test_some_of_the_joints_are_taken_only_where_that_is_allowed():
    two = controller(JtcParameters(), ('x', 'y'), (0.0, 0.7))
    assert not two.receive(moving(end=0.0), NOW)
    two = controller(RECOMMENDED, ('x', 'y'), (0.0, 0.7))
    assert two.receive(moving(end=0.0), NOW)
    assert two.update(NOW, (0.0, 0.6)).positions[1] == 0.7  # at its command, not its feedback


def test_a_stamped_message_is_sampled_a_period_ahead_of_the_update():
    one = controller(JtcParameters(allow_nonzero_velocity_at_trajectory_end=True))
    steady = Message(NOW, ('x',), (point(0, 1.0, 0.05), point(NS // 10, 1.005, 0.05)))
    assert one.receive(steady, NOW)
    assert one.update(NOW, (0.0,)).positions == pytest.approx((1.0 + 0.05 * T / NS,))
    assert one.update(NOW + T, (0.0,)).positions == pytest.approx((1.0 + 0.1 * T / NS,))


def test_a_message_without_a_stamp_starts_at_the_next_update():
    one = controller()
    one.receive(moving(0, 0.0), NOW + T // 3)
    assert one.update(NOW + T, (0.0,)).velocities == pytest.approx((0.05,), rel=0.05)


def test_the_bridge_to_a_first_point_begins_a_period_too_early():
    """The last command is of a period later than its time says (since PR #1306)."""
    one = controller()
    one.receive(moving(NOW + 4 * T, 0.0), NOW)
    one.update(NOW, (0.0,))
    assert one._anchor[0] == NOW - T


def test_without_interpolate_from_desired_state_the_anchor_is_the_measured_state():
    one = controller(RECOMMENDED._replace(interpolate_from_desired_state=False))
    one.receive(Message(0, ('x',), (point(4 * T, 0.1),)), NOW)
    assert one.update(NOW, (0.05,)).positions[0] > 0.05


def test_the_last_point_is_held_with_its_velocity():
    one = controller(JtcParameters(allow_nonzero_velocity_at_trajectory_end=True))
    one.receive(moving(NOW), NOW)
    for k in range(100):
        command = one.update(NOW + k * T, (0.0,))
    assert command.positions == moving().points[-1].positions
    assert command.velocities == (0.05,)


def test_a_violated_tolerance_holds_where_the_axis_is_until_the_next_message():
    one = controller(RECOMMENDED._replace(tolerance=0.001))
    one.receive(moving(NOW, 0.0), NOW)
    one.update(NOW, (0.0,))
    assert one.update(NOW + T, (-0.01,)) is None
    assert one.update(NOW + 2 * T, (-0.01,)).positions == (-0.01,)


def test_a_controller_that_comes_back_holds_its_last_command():
    one = controller()
    one.receive(moving(NOW, 0.0), NOW)
    last = one.update(NOW, (0.0,)).positions
    one.deactivate()
    one.activate((5.0,))
    assert one.update(NOW + 50 * T, (5.0,)).positions == last
    one.unload()
    one.activate((5.0,))
    assert one.update(NOW + 99 * T, (5.0,)).positions == (5.0,)


def test_positions_alone_are_joined_by_lines_and_points_by_nothing_if_so_asked():
    ends = Message(NOW, ('x',), (Point(0, (0.0,)), Point(10 * T, (1.0,))))
    one = controller()
    one.receive(ends, NOW)
    assert one.update(NOW, (0.0,)).positions == pytest.approx((0.1,))
    one = controller(RECOMMENDED._replace(interpolation_method='none'))
    one.receive(ends, NOW)
    assert one.update(NOW, (0.0,)).positions == (1.0,)


def test_a_forward_controller_is_a_staircase_that_a_wrong_length_deactivates():
    one = ForwardController(('x', 'y'), 500.0)
    one.activate()
    one.receive((1.0, 2.0))
    assert one.update() == (1.0, 2.0)
    assert not one.receive((nan, 3.0))
    assert one.update() == (1.0, 2.0)
    one.receive((1.0,))
    assert one.update() is None
    assert not one.active
    assert one.command == (1.0, 2.0)
