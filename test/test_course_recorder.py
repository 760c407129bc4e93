# SPDX-License-Identifier: Apache-2.0
"""The recorder of courses, fed with messages; no process, no graph."""

from types import SimpleNamespace

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from homing_node.procedures.states import State
from homing_node.ros.course_recorder import CourseRecorder


class Node:
    """Keeps what a node is asked for."""

    def __init__(self):
        self.take, self.destroyed = {}, []

    def create_subscription(self, kind, topic, take, _):
        self.take[topic] = take
        return topic

    def destroy_subscription(self, topic):
        self.destroyed.append(topic)


def info(recorder, seconds):
    return {'source_timestamp': recorder._begun + round(seconds * 1e9)}


def recorder_of(node, followers, state=State.HSSearch):
    return CourseRecorder(
        node, '/homing_node', 'y', 'y1', lambda _: SimpleNamespace(state=str(state)), followers
    )


def setpoint(**positions):
    point = JointTrajectoryPoint(
        positions=list(positions.values()),
        velocities=[0.05] * len(positions),
        accelerations=[0.0] * len(positions),
    )
    return JointTrajectory(joint_names=list(positions), points=[point])


def test_the_sides_of_a_gantry_are_recorded_together():
    node = Node()
    recorder = recorder_of(node, {'y2': 'j2'})
    feedback = JointState(name=['j2', 'x', 'y1'], position=[0.101, 9.0, 0.1])
    node.take['joint_states'](feedback)
    node.take['/homing_node/setpoints'](setpoint(y1=0.11, j2=0.112), info(recorder, 0.5))
    node.take['/homing_node/setpoints'](setpoint(y1=0.12), info(recorder, 0.6))  # not both
    node.take['/homing_node/setpoints'](setpoint(x=9.0, j2=0.122, y1=0.12), info(recorder, 0.7))
    course = recorder.course
    (other,) = course.followers.values()
    assert list(course.followers) == ['y.y2']
    assert [(round(s.time, 6), s.position, s.feedback) for s in course.samples] == [
        (0.5, 0.11, 0.1),
        (0.7, 0.12, 0.1),
    ]
    assert [(round(s.time, 6), s.position, s.feedback) for s in other.samples] == [
        (0.5, 0.112, 0.101),
        (0.7, 0.122, 0.101),
    ]
    assert {s.state for s in (*course.samples, *other.samples)} == {'HSSearch'}
    assert course.skew_of('y.y2') == pytest.approx([0.0, 0.0])


def test_each_side_has_switches_of_its_own():
    node = Node()
    recorder = recorder_of(node, {'y2': 'j2'})
    node.take['joint_states'](JointState(name=['y1', 'j2'], position=[0.1, 0.101]))
    for level in (False, True):
        node.take['/homing_node/y/y2/home_switch'](Bool(data=level), info(recorder, 0.2))
    (found,) = recorder.course.followers['y.y2'].happenings
    assert (found.input, found.value, found.position) == ('home_switch', True, 0.101)
    assert recorder.course.happenings == []
    recorder.close()
    assert set(node.destroyed) == set(node.take)


def test_an_axis_at_rest_is_not_recorded():
    node = Node()
    recorder = recorder_of(node, {}, State.Idle)
    node.take['/homing_node/setpoints'](setpoint(y1=0.1), info(recorder, 0.1))
    assert recorder.course.samples == [] and recorder.course.followers == {}


def test_a_recording_begins_once_all_joints_were_heard():
    """Else its first samples would have no feedback."""
    node = Node()
    recorder = recorder_of(node, {'y2': 'j2'})
    node.take['joint_states'](JointState(name=['y1'], position=[0.1]))
    with pytest.raises(TimeoutError, match='no joint_states of j2 in 0 s'):
        recorder.wait(0.0)
    node.take['joint_states'](JointState(name=['j2'], position=[0.1]))
    recorder.wait(0.0)
