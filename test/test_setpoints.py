# SPDX-License-Identifier: Apache-2.0
"""The messages of each setpoint interface, without a graph."""

from itertools import pairwise

import pytest
from core_rig import rig
from gantry_rig import Gantry, SideRig
from rclpy.serialization import deserialize_message, serialize_message
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from homing_node.core.announcement import Course, announcement
from homing_node.core.axis import Axis
from homing_node.core.phase import Dynamics
from homing_node.core.profile import Profile
from homing_node.parameters.configuration import configuration
from homing_node.parameters.definition import InvalidParameters
from homing_node.parameters.node_fields import SetpointInterface
from homing_node.plant.controller import NS, Message, Point, TrajectoryController
from homing_node.procedures.states import Error, Input
from homing_node.ros.serialized import TrajectoryWriter
from homing_node.ros.setpoints import (
    INTERFACES,
    DofSetpoints,
    MultiDOFCommand,
    PositionSetpoints,
    TrajectorySetpoints,
)
from homing_node.ros.simulated.controller import ForwardedPositions
from homing_node.ros.timebase import TimeBase

PERIOD, LEAD = 0.004, 0.008

by_name = pytest.mark.skipif(MultiDOFCommand is None, reason='control_msgs is not installed')


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
    """Two axes at 0.05 m and what publishes their setpoints; ``node``: parameters of the node."""

    def __init__(self, interface, serialized=True, node=None, **values):
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
            self.axes, checked(interface, serialized, **(node or {})), self.timebase, self._create
        )
        self.timebase.relate()

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
        pytest.param('dof', (MultiDOFCommand, '~/dof_commands'), marks=by_name),
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
    for one, other in zip(unstamped.points, stamped.points, strict=True):
        assert one.positions == pytest.approx(other.positions, abs=1e-12)
        assert one.time_from_start == other.time_from_start


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


#: Velocities of eight axes, and the largest message that they make, bytes (performance.md).
EIGHT = [([0.05] * 8, 2600), ([0.02 * (k + 1) for k in range(8)], 9000)]


@pytest.mark.parametrize(('velocities', 'largest'), EIGHT, ids=['alike', 'all different'])
def test_the_size_of_a_message_of_eight_axes_is_bounded(velocities, largest):
    """At 250 Hz: while they speed up, cruise, turn and stop."""
    names = [f'axis_{k}_joint' for k in range(8)]
    profiles = [Profile(PERIOD, 10.0 + k, lead=LEAD) for k in range(8)]
    if len(set(velocities)) == 1:
        profiles = [Profile(PERIOD, 10.0, lead=LEAD) for _ in range(8)]
    writer, sizes = TrajectoryWriter(), []
    for cycle in range(400):
        for k, (one, velocity) in enumerate(zip(profiles, velocities, strict=True)):
            pace = Dynamics(velocity, 0.5, 0.5)
            at = cycle - (k if len(set(velocities)) > 1 else 0)
            if at == 0:
                one.seek(velocity, pace)
            elif at == 150:
                one.seek(-velocity, pace)
            elif at == 300:
                one.stop()
            one.update()
        courses = [Course(*one.announce(0.02)) for one in profiles]
        times, rows = announcement(courses, PERIOD, 0.02)
        sizes.append(len(writer.write(names, 1, times, rows)))
    assert 0.9 * largest < max(sizes) <= largest


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


def test_no_array_with_an_old_position():
    """It would be a step for an axis that has moved meanwhile."""
    cell = Cell(PositionSetpoints)
    cell.now += 0.15
    cell.axes['y'].feedback(cell.now, 0.05)
    cell.now += 0.15
    cell.timebase.relate()
    refusal = cell.setpoints.unready()
    assert refusal.error is Error.FeedbackStale
    assert refusal.message.startswith('axis x: the feedback is 0.300 s old')


@pytest.fixture(params=[PositionSetpoints, pytest.param(DofSetpoints, marks=by_name)])
def array(request):
    """Return a cell whose controller has a joint more, in an order of its own."""
    return Cell(request.param, node={'position_joints': ['y', 'other', 'joint_x']})


def positions(cell):
    message = cell.published[-1]
    return list(message.data if isinstance(message, Float64MultiArray) else message.values)


def test_the_array_has_the_order_and_the_length_of_the_controller(array):
    array.setpoints.others['other'].feedback(0.7, array.now)
    array.home('x')
    for _ in range(20):
        moving = array.cycle()
    assert positions(array) == [0.05, 0.7, moving['x'][0]]
    array.setpoints.others['other'].feedback(0.69, array.now)  # it sinks
    array.cycle()
    assert positions(array)[1] == 0.7


def test_another_joint_is_held_where_it_is_when_a_run_begins(array):
    for position in (0.7, 0.6):
        array.setpoints.others['other'].feedback(position, array.now)
        array.home('x')
        array.cycle()
        assert positions(array)[1] == position
        array.axes['x'].stop(Error.SwitchStale, 'because')
        while array.axes['x'].running:
            array.cycle()
        array.cycle()


def test_no_run_without_the_feedback_of_another_joint(array):
    refusal = array.setpoints.unready()
    assert refusal.error is Error.FeedbackStale
    assert refusal.message == "no feedback yet for joint 'other' (position_joints)"
    array.setpoints.others['other'].feedback(0.7, array.now - 0.3)
    assert "of joint 'other' (position_joints) is 0.300 s old" in array.setpoints.unready().message
    array.setpoints.others['other'].feedback(0.7, array.now)
    assert array.setpoints.unready() is None


def test_all_joints_of_the_controller_are_told_to_stay(array):
    held = {'joint_x': 1.0, 'y': 2.0, 'other': 3.0}
    array.published.append(array.setpoints.hold(held))
    assert positions(array) == [2.0, 3.0, 1.0]


@by_name
def test_a_position_and_a_velocity_by_name():
    cell = Cell(DofSetpoints)
    cell.home('x')
    for _ in range(20):
        moving = cell.cycle()
    message = cell.published[-1]
    assert message.dof_names == ['joint_x', 'y']
    assert list(message.values) == [moving['x'][0], 0.05]
    assert list(message.values_dot) == [moving['x'][1], 0.0]
    assert message.values_dot[0] > 0.0
    again = deserialize_message(serialize_message(message), MultiDOFCommand)
    assert again == message


def test_without_control_msgs_a_command_by_name_is_refused(monkeypatch):
    monkeypatch.setattr('homing_node.ros.setpoints.MultiDOFCommand', None)
    with pytest.raises(InvalidParameters, match='setpoint_interface: dof needs the package contr'):
        Cell(DofSetpoints)


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


# -- the servo goes off while the axis moves ------------------------------------------------------


class Played:
    """A cell whose trajectories go to the model of joint_trajectory_controller at 500 Hz."""

    RATE = 500

    def __init__(self, speed):
        self.cell = Cell(
            TrajectorySetpoints,
            homing_velocity_fast=speed,
            switches=(Input.HOME_SWITCH, Input.SERVO_ENABLED),
        )
        self.controller = TrajectoryController(['joint_x', 'y'], self.RATE)
        self.controller.activate([0.05, 0.05])
        self.commands = []  # of joint_x

    def cycle(self, position):
        """Run a cycle and the two updates of the controller after it; return the last command."""
        cell, count = self.cell, len(self.cell.published)
        cell.cycle(x=position)
        now = round(cell.now * NS)
        if len(cell.published) > count:
            read = deserialize_message(cell.published[-1], JointTrajectory)
            stamp = read.header.stamp
            points = [
                Point(
                    p.time_from_start.sec * NS + p.time_from_start.nanosec,
                    tuple(p.positions),
                    tuple(p.velocities),
                    tuple(p.accelerations),
                )
                for p in read.points
            ]
            told = Message(stamp.sec * NS + stamp.nanosec, tuple(read.joint_names), tuple(points))
            assert self.controller.receive(told, now), self.controller.refused
        for update in range(2):
            command = self.controller.update(now + update * NS // self.RATE, [0.05, 0.05])
            if command is not None:
                self.commands.append(command.positions[0])
        return self.commands[-1]


@pytest.mark.parametrize('switch', [servo_service, drive])
@pytest.mark.parametrize('behind', [0.0, 0.002], ids=['follows', 'blocked'])
@pytest.mark.parametrize('speed', [0.05, 0.5])
def test_when_the_servo_goes_off_the_controller_ends_where_the_axis_is(speed, behind, switch):
    """Not where the stop would have ended that it was told: that is 2.6 mm, or 0.15 m, further."""
    played = Played(speed)
    played.cell.home('x')
    axis = played.cell.axes['x']
    place = 0.05
    at_speed = 0
    while at_speed < 5:
        place = played.cycle(place) - behind
        at_speed += axis.profile.done and axis.profile.velocity == speed
    switch(axis, False)
    count = len(played.cell.published)
    for _ in range(60):
        played.cycle(place)
    assert axis.outcome.error is Error.ServoOff
    assert len(played.cell.published) == count + 1
    first = deserialize_message(played.cell.published[-1], JointTrajectory).points[0]
    assert first.velocities[0] == pytest.approx(speed)
    steps = [b - a for a, b in pairwise(played.commands)]
    assert max(map(abs, steps)) <= 1.01 * (speed + behind / 0.02) / Played.RATE
    bends = [b - a for a, b in pairwise(steps)]
    assert max(map(abs, bends)) <= 1.01 * max(5.0, speed / 0.02) / Played.RATE**2
    assert played.commands[-50:] == [pytest.approx(place, abs=1e-9)] * 50  # within 0.14 s


def test_the_return_of_one_axis_goes_on_while_another_moves():
    """The controller stops a joint that the next message lacks."""
    played = Played(0.05)
    axis, place = played.cell.axes['x'], 0.05
    for name in 'xy':
        played.cell.home(name)
    for _ in range(100):
        place = played.cycle(place)
    place -= 0.002
    axis.set_servo(False)
    for _ in range(60):
        played.cycle(place)
    assert played.cell.axes['y'].running
    assert played.commands[-1] == pytest.approx(place, abs=1e-9)
    last = deserialize_message(played.cell.published[-1], JointTrajectory)
    assert last.joint_names == ['y']


def test_a_run_begins_without_a_step_as_soon_as_the_servo_is_back():
    played = Played(0.05)
    played.cell.home('x')
    axis, place = played.cell.axes['x'], 0.05
    for _ in range(100):
        place = played.cycle(place)
    axis.set_servo(False)
    played.cycle(place)
    assert axis.returning
    axis.set_servo(True)
    while axis.home(played.cell.now) is not None:  # until it is known to rest
        played.cycle(place)
    assert not axis.returning
    begin = len(played.commands)
    for _ in range(100):
        place = played.cycle(place)
    assert axis.running
    steps = [abs(b - a) for a, b in pairwise(played.commands[begin - 10 :])]
    assert max(steps) <= 1.01 * 0.05 / Played.RATE


def test_the_controller_keeps_its_stop_where_the_axis_is_not_known():
    played = Played(0.05)
    played.cell.home('x')
    axis, place = played.cell.axes['x'], 0.05
    for _ in range(100):
        place = played.cycle(place)
    count = len(played.cell.published)
    played.cell.now += 0.3  # no feedback
    axis.set_servo(False)
    axis.update(played.cell.now)
    assert played.cell.setpoints.message({}, played.cell.now) is None
    assert len(played.cell.published) == count


def test_the_last_positions_are_where_the_axis_is():
    """A forward controller holds its last value: no jump where the servo comes back."""
    cell = Cell(PositionSetpoints, switches=(Input.HOME_SWITCH, Input.SERVO_ENABLED))
    cell.home('x')
    for _ in range(100):
        moving = cell.cycle()
    blocked = moving['x'][0] - 0.003
    cell.axes['x'].enable(False)
    count = len(cell.published)
    for _ in range(3):
        cell.cycle(x=blocked)
    assert len(cell.published) == count + 1
    assert cell.commands() == [blocked, 0.05]


def test_an_array_has_both_sides_of_a_gantry():
    """Each follower is a joint of the array, in the order of the controller; at rest, too."""
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001, zero=0.3)))
    settings = configuration(
        {
            'axes': ['y'],
            'setpoint_interface': 'position',
            'position_joints': ['y2_joint', 'y1'],
            'y.joint': 'y1',
            'y.home_type': 'HSHS',
            'y.travel': 0.1,
            'y.followers': ['y2'],
            'y.max_skew': 0.002,
            'y.y2.joint': 'y2_joint',
        }
    )
    timebase = TimeBase(lambda: 0)
    setpoints = PositionSetpoints(gantry.axis.drives, settings, timebase, lambda *_: None)
    assert setpoints.others == {}
    seen = []

    def publish():
        if gantry.samples and gantry.axis.running:
            leader, follower = gantry.samples[-1].commands
            message = setpoints.message({'y': leader, 'y.y2': follower}, 0.0)
            assert list(message.data) == [follower[0], leader[0]]
            seen.append(message)

    gantry.on_cycle = publish
    assert gantry.home().success
    assert len(seen) > 100
    assert setpoints.message({}, 0.0) is None
    assert list(setpoints.hold({'y1': 1.0, 'y2_joint': 2.0}).data) == [2.0, 1.0]


def test_a_position_that_is_forwarded_anew_has_no_velocity():
    """A drive that comes on would go on with it, and stop by itself when nothing follows."""
    controller = ForwardedPositions(['x'], 500.0, 0.002)
    assert controller.take(Float64MultiArray(data=[0.1]), 0) == ''
    assert controller.update(0) == {'x': (0.1, 0.0)}
    assert controller.update(1) == {}
    controller.repeat('x')
    assert controller.update(2) == {'x': (0.1, 0.0)}
    assert controller.take(Float64MultiArray(data=[0.2]), 3) == ''
    assert controller.update(3) == {'x': (0.2, None)}  # as far as it went
