# SPDX-License-Identifier: Apache-2.0
"""The messages of each setpoint interface, without a graph."""

import pytest
from core_rig import rig
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from homing_node.core.axis import Axis
from homing_node.parameters.configuration import SetpointInterface, configuration
from homing_node.procedures.states import Error, Input
from homing_node.ros.setpoints import INTERFACES, PositionSetpoints, TrajectorySetpoints
from homing_node.ros.timebase import TimeBase

PERIOD, LEAD = 0.004, 0.008


def checked(interface, serialized=True, **values):
    """Return the configuration of two axes."""
    name = next(name for name, one in INTERFACES.items() if one is interface)
    given = {
        'axes': ['x', 'y'],
        'setpoint_interface': name,
        'serialized': serialized,
        'x.joint': 'joint_x',
        **{f'{axis}.home_type': 'HS' for axis in 'xy'},
        **{f'{axis}.travel': 1.0 for axis in 'xy'},
        **{f'{axis}.homing_velocity_fast': 0.05 for axis in 'xy'},
        **values,
    }
    return configuration(given)


class Cell:
    """Two axes at 0.05 m and what publishes their setpoints."""

    def __init__(self, interface, serialized=True, **values):
        parameters = rig('HS', **values).parameters()
        lead = LEAD if interface is TrajectorySetpoints else 0.0
        self.axes = {name: Axis(name, parameters, PERIOD, lead) for name in 'xy'}
        self.now = 1.0
        for axis in self.axes.values():
            for switch in axis.parameters.inputs:
                axis.switch(switch, 0.0, False)
            axis.enable(True)
            axis.feedback(self.now, 0.05)
        self.created, self.published = [], []
        self.places = dict.fromkeys(self.axes, 0.05)
        self.timebase = TimeBase(lambda: round(self.now * 1e9))
        self.interface = interface
        self.setpoints = interface(
            self.axes, checked(interface, serialized), self.timebase, self._create
        )

    def _create(self, kind, topic):
        self.created.append((kind, topic))
        return self

    def publish(self, message):
        self.published.append(message)

    def home(self, name):
        assert self.axes[name].home(self.now) is None

    def cycle(self, **feedback):
        """Run a cycle; the feedback follows the last command unless it is given."""
        self.now += PERIOD
        moving = {}
        for name, axis in self.axes.items():
            axis.feedback(self.now, feedback.get(name, self.places[name]))
            setpoint = axis.update(self.now)
            if setpoint is not None:
                moving[name] = setpoint
                self.places[name] = setpoint[0]
        message = self.setpoints.message(moving, self.now)
        if message is not None:
            self.setpoints.publish(message)
        return moving

    def commands(self):
        return list(self.published[-1].data)


@pytest.mark.parametrize(
    ('interface', 'created'),
    [
        ('trajectory', (JointTrajectory, '~/setpoints')),
        ('position', (Float64MultiArray, '~/position_commands')),
    ],
)
def test_only_the_topic_of_the_interface_is_advertised(interface, created):
    cell = Cell(INTERFACES[SetpointInterface(interface)])
    assert cell.created == [created]


def test_each_interface_has_a_class():
    assert set(INTERFACES) == set(SetpointInterface)


@pytest.mark.parametrize('serialized', [True, False])
def test_a_trajectory_has_the_joints_that_move(serialized):
    cell = Cell(TrajectorySetpoints, serialized)
    cell.cycle()
    assert cell.published == []
    cell.home('x')
    moving = cell.cycle()
    (message,) = cell.published
    data = message if serialized else serialize_message(message)
    read = deserialize_message(data, JointTrajectory)
    assert read.joint_names == ['joint_x']
    assert read.header.stamp.sec * 10**9 + read.header.stamp.nanosec == pytest.approx(
        (cell.now + LEAD) * 1e9  # where the run begins
    )
    first, newest = read.points[:2]
    assert (first.positions[0], first.velocities[0]) == (0.05, 0.0)
    assert first.time_from_start.nanosec == 0
    assert newest.time_from_start.nanosec == 4_000_000
    assert (newest.positions[0], newest.velocities[0], newest.accelerations[0]) == pytest.approx(
        moving['x']
    )
    assert read.points[-1].velocities[0] == read.points[-1].accelerations[0] == 0.0
    assert cell.setpoints.unready() is None


def test_a_trajectory_starts_at_its_present_or_when_it_arrives():
    cell = Cell(TrajectorySetpoints)
    zero = TrajectorySetpoints(
        cell.axes,
        checked(TrajectorySetpoints, setpoint_stamp='zero'),
        cell.timebase,
        cell._create,
    )
    cell.home('x')
    for _ in range(20):
        moving = cell.cycle()
    stamped = deserialize_message(cell.published[-1], JointTrajectory)
    assert stamped.header.stamp.nanosec == pytest.approx(cell.now % 1.0 * 1e9)
    assert stamped.points[0].time_from_start.nanosec == 0
    unstamped = deserialize_message(zero.message(moving, cell.now), JointTrajectory)
    assert (unstamped.header.stamp.sec, unstamped.header.stamp.nanosec) == (0, 0)
    assert unstamped.points == stamped.points


def test_nothing_is_told_of_an_axis_whose_feedback_is_lost():
    """The controller knows how to stop."""
    cell = Cell(TrajectorySetpoints)
    cell.home('x')
    for _ in range(60):
        cell.cycle()
    count = len(cell.published)
    axis = cell.axes['x']
    for _ in range(60):
        cell.now += PERIOD
        assert cell.setpoints.message({}, cell.now) is None
    assert axis.update(cell.now) is None
    assert axis.outcome.error is Error.FeedbackStale
    assert len(cell.published) == count


def test_an_axis_that_does_not_follow_stops_where_it_is():
    cell = Cell(TrajectorySetpoints)
    cell.home('x')
    axis = cell.axes['x']
    for _ in range(500):
        cell.cycle(x=0.05)
        if not axis.running:
            break
    assert axis.outcome.error in (Error.FollowingError, Error.WrongDirection)
    message = deserialize_message(cell.published[-1], JointTrajectory)
    assert [p.positions[0] for p in message.points] == pytest.approx([0.05] * len(message.points))


def test_positions_of_all_axes_in_their_order():
    cell = Cell(PositionSetpoints)
    cell.cycle()
    assert cell.published == []
    cell.home('y')
    moving = cell.cycle(x=0.07)
    assert cell.commands() == [0.07, moving['y'][0]]
    cell.cycle(x=0.071)  # an axis at rest keeps its command: it must not sink
    assert cell.commands()[0] == 0.07


def test_no_array_without_the_feedback_of_each_axis():
    cell = Cell(PositionSetpoints)
    assert cell.setpoints.unready() is None
    cell.axes['x'] = Axis('x', cell.axes['y'].parameters, PERIOD)
    cell.setpoints = PositionSetpoints(
        cell.axes, checked(PositionSetpoints), cell.timebase, cell._create
    )
    refusal = cell.setpoints.unready()
    assert refusal.error is Error.FeedbackStale
    assert 'axis x' in refusal.message


def servo_service(axis, on):
    axis.set_servo(on)


def drive(axis, on):
    axis.enable(on)


@pytest.mark.parametrize('switch', [servo_service, drive])
def test_an_axis_that_comes_back_on_is_held_where_it_is(switch):
    """It has sunk 15 mm; its old command would be a step of as much."""
    wired = (Input.HOME_SWITCH, Input.SERVO_ENABLED)
    cell = Cell(PositionSetpoints, switches=wired)
    cell.home('x')
    cell.home('y')
    for _ in range(100):
        moving = cell.cycle()
    last = moving['x'][0]
    switch(cell.axes['x'], False)
    cell.cycle(x=last - 0.001)
    for sunk in (0.005, 0.010, 0.015):
        assert 'x' not in cell.cycle(x=last - sunk)
        assert cell.commands()[0] == last - sunk  # off: the command follows the axis
    switch(cell.axes['x'], True)
    cell.cycle(x=last - 0.0151)
    held = cell.commands()[0]
    assert held == last - 0.0151
    cell.cycle(x=last - 0.0152)
    assert cell.axes['y'].running
    assert cell.commands()[0] == held  # on: it is held


def test_the_command_of_an_ended_run_is_forgotten():
    cell = Cell(PositionSetpoints)
    cell.home('x')
    cell.home('y')
    for _ in range(20):
        moving = cell.cycle()
    cell.axes['x'].stop(Error.SwitchStale, 'because')
    while cell.axes['x'].running:
        moving = cell.cycle()
    moved = moving['x'][0] - 0.012  # something has moved it meanwhile
    cell.cycle(x=moved)
    assert cell.axes['y'].running
    assert cell.commands()[0] == moved


def test_a_command_is_not_kept_from_one_run_to_the_next():
    cell = Cell(PositionSetpoints)
    cell.home('y')
    cell.cycle(x=0.07)
    cell.axes['y'].stop(Error.SwitchStale, 'because')
    while cell.axes['y'].running:
        cell.cycle(x=0.07)
    cell.cycle(x=0.07)
    cell.home('y')
    cell.cycle(x=0.06)
    assert cell.commands()[0] == 0.06


def test_an_axis_at_rest_whose_servo_was_off():
    cell = Cell(PositionSetpoints)
    cell.home('y')
    cell.cycle(x=0.07)
    cell.axes['x'].set_servo(False)
    cell.cycle(x=0.065)
    cell.axes['x'].set_servo(True)
    cell.cycle(x=0.06)
    assert cell.commands()[0] == 0.06


def test_an_axis_that_rested_before_its_run():
    cell = Cell(PositionSetpoints)
    cell.home('y')
    cell.cycle()
    assert cell.commands()[0] == 0.05
    cell.home('x')
    for _ in range(100):
        moving = cell.cycle()
    cell.axes['x'].stop(Error.SwitchStale, 'because')
    while cell.axes['x'].running:
        moving = cell.cycle() or moving
    cell.cycle()
    assert cell.axes['y'].running
    assert cell.commands()[0] == cell.places['x'] > 0.06
