"""Messages and descriptors."""

import math
import struct

import pytest
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Header

from homing_node import convert
from homing_node.axis import Axis, Setpoint
from homing_node.configuration import AXIS_SPECS, NODE_SPECS
from homing_node.outcome import Outcome
from homing_node.parameters import axis_parameters
from homing_node.states import Error, Input


@pytest.fixture
def axis():
    axis = Axis('x', axis_parameters({'home_type': 'HS', 'travel': 1}), 0.004)
    axis.feedback(1.0, 0.5)
    return axis


@pytest.mark.parametrize('spec', [*NODE_SPECS.values(), *AXIS_SPECS.values()],
                         ids=lambda spec: spec.name)
def test_descriptors(spec):
    described = convert.descriptor(spec)
    assert described.dynamic_typing  # integers for real numbers
    assert spec.text in described.description
    if spec.unit:
        assert f'[{spec.unit}]' in described.description
    for choice in spec.choices:
        assert choice in described.additional_constraints
    for bounds in (*described.floating_point_range, *described.integer_range):
        assert bounds.from_value <= bounds.to_value
        assert bounds.step == 0
    if spec.bounds:
        assert spec.bounds in described.additional_constraints
        assert described.floating_point_range or described.integer_range
    assert convert.descriptor(spec, read_only=True).read_only


def test_plain_values():
    assert convert.plain(AXIS_SPECS['switches'].default) == [
        'home_switch', 'positive_limit_switch', 'negative_limit_switch']
    for value in (AXIS_SPECS['ls_type'].default, Input.Z_PULSE):
        assert type(convert.plain(value)) is str
    assert convert.plain(5) == 5
    assert convert.plain(True) is True
    assert convert.plain(None) is None


@pytest.mark.parametrize('nanoseconds', [0, 1, 999_999_999, 1_000_000_000, 1795347884123456789])
def test_stamps(nanoseconds):
    stamp = convert.to_stamp(nanoseconds)
    assert stamp.nanosec < 1_000_000_000
    assert ns(stamp) == nanoseconds


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


@pytest.mark.parametrize(('message', 'expected'), [
    (JointState(name=['a', 'b', 'c', 'd'], position=[1.0, math.nan, math.inf, 2.0]),
     [('a', 1.0), ('d', 2.0)]),
    (JointState(name=['a', 'b'], position=[1.0]), [('a', 1.0)]),
    (JointState(name=['a'], position=[1.0, 2.0]), [('a', 1.0)]),
    (JointState(name=['a'], velocity=[1.0]), []),
    (JointState(), []),
])
def test_positions(message, expected):
    message.header.stamp = Time(sec=3, nanosec=5)
    read = convert.JointStateReader().read(serialize_message(message))
    assert read == (3_000_000_005, expected)


MESSAGES = st.builds(
    lambda frame, names, positions, velocities, sec, nanosec: JointState(
        header=Header(frame_id=frame, stamp=Time(sec=sec, nanosec=nanosec)), name=names,
        position=positions, velocity=velocities),
    st.sampled_from(['', 'base', 'é']), st.lists(st.sampled_from(['x', '', 'joint_1', 'жж'])),
    st.lists(st.floats(allow_nan=False, allow_infinity=False)),
    st.lists(st.floats(), max_size=2), st.integers(-2**31, 2**31 - 1), st.integers(0, 2**32 - 1))


@given(st.lists(MESSAGES, max_size=6), st.floats(0.0, 1.0))
def test_joint_states_are_read_as_rclpy_reads_them(messages, part):
    """Whole ones between broken ones, in any order; of a broken one nothing is made up."""
    reader = convert.JointStateReader()
    for message in messages:
        data = serialize_message(message)
        pairs = zip(message.name, message.position, strict=False)
        expected = ns(message.header.stamp), list(pairs)
        assert reader.read(data) == expected
        assert reader.read(data[:int(part * len(data))]) in (None, expected)
        assert reader.read(data) == expected


def test_a_joint_state_in_the_other_byte_order():
    data = b'\0\0\0\0' + struct.pack('>iIIxxxxI', 3, 5, 1, 1) + struct.pack(
        '>I2s2xI', 2, b'x\0', 1) + struct.pack('>dII', 1.5, 0, 0)
    assert deserialize_message(data, JointState).position[0] == 1.5
    assert convert.JointStateReader().read(data) == (3_000_000_005, [('x', 1.5)])


@pytest.mark.parametrize('message', [Bool(data=True), Bool(data=False), Float64(data=-0.25)])
def test_values(message):
    data = serialize_message(message)
    assert convert.data_of(data, type(message)) == message.data
    assert convert.data_of(data[:3], type(message)) is None


def test_trajectory():
    message = convert.trajectory(1 / 300)
    convert.fill(message, ['c'], [Setpoint(9.0, 9.0, 9.0)])
    convert.fill(message, ['a', 'b'], [Setpoint(1.0, 2.0, 3.0), Setpoint(-1.0, 0.0, 0.0)])
    assert message.joint_names == ['a', 'b']
    (point,) = message.points
    assert list(point.positions) == [1.0, -1.0]
    assert list(point.velocities) == [2.0, 0.0]
    assert list(point.accelerations) == [3.0, 0.0]
    assert (point.time_from_start.sec, point.time_from_start.nanosec) == (0, 3_333_333)
    assert message.header.stamp == Time()
    assert convert.trajectory(1.0).points[0].time_from_start.sec == 1


def test_numbers_are_cast():
    """An integer in a field for real numbers would arrive as another number."""
    assert list(convert.position_commands([1, 2.5]).data) == [1.0, 2.5]
    assert list(convert.joint_states(0, {'a': 1}).position) == [1.0]


def test_home_message():
    homed = Outcome(Error.NoError, '', 0.123456789123, -0.5, 1.23456e-5)
    assert convert.home_message([homed]) == (
        'Homed: home_position_raw=0.123456789123 home_offset=-0.5 uncertainty=1.23e-05')
    failed = Outcome(Error.LSTriggered, 'axis x: …')
    canceled = Outcome(Error.Canceled, 'axis y: …')
    assert convert.home_message([homed, canceled, failed]) == 'LSTriggered: axis x: …'
    assert convert.home_message([homed, canceled]) == 'Canceled: axis y: …'
    assert convert.home_message([homed, homed]).count('home_position_raw=') == 2
    warned = Outcome(Error.LSTriggered, 'axis x: …', warnings=('it bounced',))
    assert convert.home_message([warned]) == 'LSTriggered: axis x: … | warning: it bounced'


def test_axis_state(axis):
    message = convert.axis_state(2_500_000_000, axis)
    assert ns(message.header.stamp) == 2_500_000_000
    assert (message.axis, message.state, message.error) == ('x', 'Idle', 'NoError')
    assert (message.paused, message.homed) == (False, False)
    assert message.position == 0.5
    axis.outcome = Outcome(Error.NoError, '', 0.25, 0.125, 0.001)
    axis.homed = True
    message = convert.axis_state(0, axis)
    assert message.homed
    assert message.position == 0.375
    assert (message.home_position_raw, message.home_offset) == (0.25, 0.125)
    assert message.uncertainty == 0.001


def test_diagnostics(axis):
    def status():
        (found,) = convert.diagnostics(0, 'homing_node', [axis]).status
        return found

    assert (status().level, status().message) == (DiagnosticStatus.WARN, 'not homed')
    assert (status().name, status().hardware_id) == ('homing_node: x', 'x')
    axis.outcome = Outcome(Error.Timeout, 'too long')
    assert (status().level, status().message) == (DiagnosticStatus.ERROR, 'Timeout: too long')
    axis.outcome = Outcome(Error.NoError)
    axis.homed = True
    assert (status().level, status().message) == (DiagnosticStatus.OK, 'homed')
    assert {pair.key: pair.value for pair in status().values}['state'] == 'Idle'
