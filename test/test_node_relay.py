# SPDX-License-Identifier: Apache-2.0
"""The relay as a process in front of two controllers; the test plays the machine around it.

It publishes the feedback and the states of the axes, and serves the actions of both controllers.
"""

import struct

import pytest
import ros_harness as ros
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from homing_interfaces.msg import AxisState
from rcl_interfaces.srv import SetParameters
from rclpy.action import ActionClient, ActionServer, CancelResponse
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.task import Future
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

pytestmark = pytest.mark.long

ARM, LIFT = 'arm_controller', 'lift_controller'
#: The axes, each with its home; and a joint that no axis of the relay is.
HOMES = {'x': 0.1, 'y': -1.0 / 3.0}
FOREIGN = 'gripper'
AXIS = {
    'home_type': 'CurrentPos',
    'travel': 1.0,
    'apply': 'relay',
    'travel_min': -0.4,
    'travel_max': 0.4,
    'feedback_timeout': 60.0,
}


class Controller:
    """The action of a controller; the test says how each goal ends."""

    def __init__(self, client, name):
        self._client, self.goals, self._over = client, [], []
        self._server = ActionServer(
            client.node,
            FollowJointTrajectory,
            f'/{name}/follow_joint_trajectory',
            self._execute,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )

    async def _execute(self, goal):
        over = Future(executor=self._client.node.executor)
        self.goals.append(goal)
        self._over.append(over)
        return await over

    def end(self, how, **result):
        """End the newest goal by `succeed`, `abort` or `canceled`."""
        getattr(self.goals[-1], how)()
        self._over[-1].set_result(FollowJointTrajectory.Result(**result))

    @property
    def trajectory(self):
        return self.goals[-1].request.trajectory


class Machine:
    """The relay with both controllers, the feedback, and what the homing node says."""

    def __init__(self, folder):
        self.folder, self.domain = folder, ros.Domain()
        self.client = ros.Client(self.domain)
        node = self.client.node
        self.controllers = {name: Controller(self.client, name) for name in (ARM, LIFT)}
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.states = {
            axis: node.create_publisher(AxisState, f'/homing_node/{axis}/state', latched)
            for axis in HOMES
        }
        self.joints = node.create_publisher(JointState, '/joint_states', 10)
        parameters = {'axes': [*HOMES], 'controllers': [ARM, LIFT]}
        parameters |= {axis: {**AXIS, 'joint': f'{axis}_joint'} for axis in HOMES}
        self.relay = ros.Process('homed_axes', folder, self.domain, parameters)
        self.client.watch(self.relay)
        self.homed = self.client.record(JointState, '/homed_axes/joint_states')
        for axis in HOMES:
            self.say(axis)
        self.actions = {
            name: ActionClient(
                node, FollowJointTrajectory, f'/homed_axes/{name}/follow_joint_trajectory'
            )
            for name in (ARM, LIFT)
        }
        self.client.until(lambda: all(one.server_is_ready() for one in self.actions.values()))
        self.raw = [0.1, 0.25, HOMES['y']]  # of x, the gripper and y
        self.client.until(lambda: self.publish() or len(self.homed) > 3)

    def publish(self):
        stamp = self.client.node.get_clock().now().to_msg()
        message = JointState(name=['x_joint', FOREIGN, 'y_joint'], position=self.raw)
        message.header.stamp = stamp
        self.joints.publish(message)

    def say(self, axis, homed=True, **more):
        more = {'state': 'Idle', 'error': 'NoError', **more}
        self.states[axis].publish(AxisState(homed=homed, home_offset=HOMES[axis], **more))

    def send(self, name, joints, positions, **more):
        """Send a goal; return its handle, and the list that gets its feedback."""
        heard = []
        goal = FollowJointTrajectory.Goal(trajectory=trajectory(joints, positions), **more)
        future = self.actions[name].send_goal_async(
            goal, feedback_callback=lambda message: heard.append(message.feedback)
        )
        return self.client.answer(future), heard

    def result(self, handle):
        answer = self.client.answer(handle.get_result_async())
        return answer.status, answer.result.error_string

    def close(self):
        self.client.watch()
        status, output = self.relay.close(), self.relay.output
        self.client.close()
        self.domain.release()
        assert status == 0, output
        assert 'Traceback' not in output, output


def trajectory(joints, positions):
    point = JointTrajectoryPoint(
        positions=positions, velocities=[0.0] * len(joints), time_from_start=Duration(sec=2)
    )
    return JointTrajectory(joint_names=joints, points=[point])


@pytest.fixture(scope='module')
def machine(tmp_path_factory):
    machine = Machine(tmp_path_factory.mktemp('relay'))
    yield machine
    machine.close()


def same(one, other):
    return struct.pack('d', one) == struct.pack('d', other)


def test_each_controller_has_its_own_goals(machine):
    arm, lift = machine.controllers[ARM], machine.controllers[LIFT]
    tolerances = [JointTolerance(name='x_joint', position=0.002, velocity=-1.0)]
    first, heard = machine.send(
        ARM,
        [FOREIGN, 'x_joint'],
        [0.7, 0.2],
        path_tolerance=tolerances,
        goal_time_tolerance=Duration(sec=3),
    )
    second, _ = machine.send(LIFT, ['y_joint'], [0.05])
    machine.client.until(lambda: arm.goals and lift.goals)
    ours = arm.trajectory.points[0].positions
    assert same(ours[0], 0.7)  # of another, to the last bit
    assert same(ours[1], 0.2 + HOMES['x'])
    assert same(lift.trajectory.points[0].positions[0], 0.05 + HOMES['y'])
    assert arm.goals[-1].request.path_tolerance == tolerances
    assert arm.goals[-1].request.goal_time_tolerance.sec == 3
    feedback = FollowJointTrajectory.Feedback(joint_names=['x_joint', FOREIGN])
    feedback.actual.positions, feedback.error.positions = [0.15, 0.5], [0.01, 0.02]
    machine.client.until(lambda: arm.goals[-1].publish_feedback(feedback) or heard)
    assert same(heard[0].actual.positions[0], 0.15 - HOMES['x'])
    assert same(heard[0].actual.positions[1], 0.5)
    assert list(heard[0].error.positions) == [0.01, 0.02]
    lift.end('abort', error_code=-4, error_string='path tolerance of y_joint')
    assert machine.result(second) == (GoalStatus.STATUS_ABORTED, 'path tolerance of y_joint')
    arm.end('succeed')
    assert machine.result(first) == (GoalStatus.STATUS_SUCCEEDED, '')


def test_other_joints_pass(machine):
    machine.homed.clear()
    machine.client.until(lambda: machine.publish() or machine.homed)
    message = machine.homed[-1].message
    assert list(message.name) == ['x_joint', FOREIGN, 'y_joint']
    wanted = [0.1 - HOMES['x'], 0.25, HOMES['y'] - HOMES['y']]
    assert all(map(same, message.position, wanted))


def test_a_lost_home_ends_the_goals_of_its_axis_only(machine):
    arm, lift = machine.controllers[ARM], machine.controllers[LIFT]
    count = len(arm.goals), len(lift.goals)
    first, _ = machine.send(ARM, ['x_joint'], [0.2])
    second, _ = machine.send(LIFT, ['y_joint', FOREIGN], [0.05, 0.3])
    machine.client.until(lambda: (len(arm.goals), len(lift.goals)) == (count[0] + 1, count[1] + 1))
    machine.say('y', homed=False, error='HomeLost', message='axis y: the feedback jumped')
    status, why = machine.result(second)
    assert status == GoalStatus.STATUS_ABORTED
    assert why == 'axis y is not homed: HomeLost: axis y: the feedback jumped'
    machine.client.until(lambda: lift.goals[-1].is_cancel_requested)
    lift.end('canceled')
    assert not arm.goals[-1].is_cancel_requested
    third, _ = machine.send(LIFT, ['y_joint'], [0.0])
    assert machine.result(third) == (status, why)
    fourth, _ = machine.send(LIFT, [FOREIGN], [0.5])  # not ours: nobody's home is needed
    machine.client.until(lambda: len(lift.goals) == count[1] + 2)
    lift.end('succeed')
    assert machine.result(fourth)[0] == GoalStatus.STATUS_SUCCEEDED
    machine.client.answer(first.cancel_goal_async())
    machine.client.until(lambda: arm.goals[-1].is_cancel_requested)
    arm.end('canceled')
    assert machine.result(first)[0] == GoalStatus.STATUS_CANCELED
    machine.say('y')
    machine.client.until(
        lambda: 'axis y is homed' in machine.relay.output.rpartition('HomeLost')[2]
    )


@pytest.mark.parametrize(
    ('joints', 'positions', 'why'),
    [
        (['x_joint'], [0.41], 'it would go to 0.41 m, beyond its soft limits -0.4 to 0.4 m'),
        (['x_joint'], [float('nan')], 'point 0: a value of joint x_joint is not finite'),
        (['x_joint'], [0.1, 0.2], 'point 0 has 2 positions for 1 joints'),
        (['x_joint'], [], 'point 0 has no position for joint x_joint'),
    ],
    ids=['limits', 'nan', 'too many', 'none'],
)
def test_what_is_refused(machine, joints, positions, why):
    count = len(machine.controllers[ARM].goals)
    handle, _ = machine.send(ARM, joints, positions)
    status, said = machine.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert said.startswith(f'axis x: {why}')
    assert len(machine.controllers[ARM].goals) == count


def test_a_goal_waits_for_the_word_on_a_home_that_is_handed_over(machine):
    """The client may know that the axis is homed a little before the relay does."""
    arm = machine.controllers[ARM]
    count = len(arm.goals)
    machine.say('x', homed=False, state='Homing')
    machine.client.until(lambda: 'axis x is homing' in machine.relay.output)
    home = Parameter('x.home_offset', value=HOMES['x']).to_parameter_msg()
    (told,) = machine.client.ask(
        SetParameters, '/homed_axes/set_parameters', parameters=[home]
    ).results
    assert told.successful, told.reason
    early, _ = machine.send(ARM, ['x_joint'], [0.2])
    assert machine.result(early) == (
        GoalStatus.STATUS_ABORTED,
        'axis x is homing: its home is being handed over',
    )
    assert len(arm.goals) == count
    soon, _ = machine.send(ARM, ['x_joint'], [0.2])
    machine.say('x')
    machine.client.until(lambda: len(arm.goals) == count + 1)
    arm.end('succeed')
    assert machine.result(soon)[0] == GoalStatus.STATUS_SUCCEEDED
