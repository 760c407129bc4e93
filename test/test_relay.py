# SPDX-License-Identifier: Apache-2.0
"""The relay without a graph: what it knows, what it lets through, every bit of what it turns."""

import math
import struct
from functools import cache
from itertools import pairwise, product

import pytest
from builtin_interfaces.msg import Duration
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.definition import Interval, InvalidParameters
from homing_node.plant.controller import NS, Message, Point, TrajectoryController, between
from homing_node.relay.joint_states import JointStates
from homing_node.relay.known_home import TABLE, Knowledge, KnownHome, News
from homing_node.relay.soft_limits import Knot, beyond
from homing_node.relay.trajectories import offsets_of, refusal, to_homed, to_raw
from homing_node.ros.relay.settings import settings_from

PLAIN = {'home_type': 'HS', 'travel': 0.5, 'apply': 'relay'}
OFFSETS = (0.1, -1.0 / 3.0, 1e-9)


@cache
def parameters_of(name, **values):
    return axis_parameters({**PLAIN, 'joint': f'{name}_joint', **values})


def known(name='x', offset=None, **values):
    axis = KnownHome(name, parameters_of(name, **values))
    if offset is not None:
        axis.said(True, True, '', '', offset)
    return axis


def by_joint(*axes):
    return {axis.joint: axis for axis in axes}


# -- what is known ------------------------------------------------------------------------------

#: Each news, as the relay gets it; the offset of the n-th news is n.
GIVE = {
    News.Told: lambda axis, n: axis.told(float(n)),
    News.SaysHomed: lambda axis, n: axis.said(True, True, '', '', float(n)),
    News.SaysHoming: lambda axis, n: axis.said(False, False, '', '', 0.0),
    News.SaysNothing: lambda axis, n: axis.said(False, True, '', '', 0.0),
    News.SaysFailed: lambda axis, n: axis.said(False, True, 'Timeout', 'too long', 0.0),
    News.Seen: lambda axis, n: axis.new_publisher(),
}


def test_the_table_is_closed():
    assert set(TABLE) == set(Knowledge)
    assert set(GIVE) == set(News)


@pytest.mark.parametrize('first', News)
def test_all_news_in_all_orders(first):
    """Every course of five news: the axis may move only by a home that nothing has taken away."""
    for rest in product(News, repeat=4):
        axis, home, homing, here = known(), None, False, False
        for n, news in enumerate((first, *rest)):
            GIVE[news](axis, n)
            if news is News.SaysHoming:
                home, homing, here = None, True, False
            elif news is News.SaysFailed:
                home, homing, here = None, False, False
            elif news is News.SaysHomed and not here:
                home, homing = n, False
            elif news is News.Told:
                home, here = (home if homing else n), False
            elif news is News.Seen and (home is not None or axis.knowledge is Knowledge.LostHere):
                home, homing, here = None, False, True
            elif news is News.SaysNothing:
                homing = False
            assert (axis.refusal == '') == (home is not None), (first, rest, n)
            if home is not None:
                assert axis.offset == home
            elif axis.offset is not None:
                assert axis.knowledge is Knowledge.Told


def test_the_reasons():
    axis = known()
    assert axis.refusal == 'axis x is not homed'
    GIVE[News.SaysHoming](axis, 0)
    assert axis.refusal == 'axis x is homing'
    GIVE[News.SaysFailed](axis, 0)
    assert axis.refusal == 'axis x is not homed: Timeout: too long'
    GIVE[News.SaysHomed](axis, 3)
    axis.feedback(0.0, 0.1, 0.0)
    axis.feedback(0.002, 0.4, 0.002)
    assert axis.refusal.startswith('axis x has lost its home: its feedback jumped by 0.3')


@pytest.mark.parametrize('keeps', [False, True])
def test_feedback_that_stops_or_has_another_publisher(keeps):
    for lose in (lambda axis: axis.check_age(1.0), lambda axis: axis.new_publisher()):
        axis = known(offset=0.1, clear_home_done_on_comm_stop=not keeps)
        axis.feedback(0.0, 0.1, 0.9)
        axis.check_age(1.0)
        assert axis.refusal == ''
        axis.feedback(0.002, 0.1, 0.5)
        lose(axis)
        assert bool(axis.refusal) != keeps


def test_a_relay_that_starts_waits_for_its_first_feedback():
    axis = known(offset=0.1)
    axis.check_age(1000.0)
    assert axis.refusal == ''
    axis.feedback(0.0, 0.1, 1000.0)
    axis.check_age(1000.1)
    assert axis.refusal == ''
    axis.check_age(1001.0)
    assert 'no feedback came for 0.2 s (feedback_timeout)' in axis.refusal


# -- joint states -------------------------------------------------------------------------------


def message_of(names, positions, velocities=(), efforts=(), frame='', stamp=(7, 8)):
    message = JointState(name=list(names), position=positions, velocity=velocities, effort=efforts)
    message.header.frame_id = frame
    message.header.stamp.sec, message.header.stamp.nanosec = stamp
    return message


def bits(values):
    return [struct.pack('<d', value) for value in values]


NUMBERS = st.floats(allow_nan=False, allow_infinity=False, width=64)


@settings(max_examples=60)
@given(st.data())
def test_every_bit_of_a_joint_state(data):
    """Ours is the double minus the offset, all else as it was; the unknown is left out."""
    count = data.draw(st.integers(1, 6))
    names = data.draw(
        st.lists(
            st.text('ab_ä7', min_size=1, max_size=9), min_size=count, max_size=count, unique=True
        )
    )
    rows = [
        data.draw(st.lists(NUMBERS, min_size=n, max_size=n))
        for n in (data.draw(st.sampled_from([0, count])) for _ in range(3))
    ]
    frame = data.draw(st.text('mapé', max_size=7))
    kinds = data.draw(
        st.lists(st.sampled_from(['other', 'unknown', 'homed']), min_size=count, max_size=count)
    )
    axes = {}
    for n, (name, kind) in enumerate(zip(names, kinds, strict=True)):
        if kind != 'other':
            axes[name] = known(offset=OFFSETS[n % 3] if kind == 'homed' else None)
            axes[name].joint = name
    relay = JointStates(axes)
    given_ = message_of(names, *rows, frame=frame)
    raw = serialize_message(given_)
    for _ in range(2):  # the second time by the layout that is known
        turned = relay.turn(raw, 0.0)
        kept = [n for n in range(count) if kinds[n] != 'unknown' or not rows[0]]
        if not kept:
            assert turned is None
            continue
        read = deserialize_message(turned, JointState)
        assert read.header == given_.header
        assert read.name == [names[n] for n in kept]
        assert bits(read.velocity) == bits(rows[1][n] for n in kept if rows[1])
        assert bits(read.effort) == bits(rows[2][n] for n in kept if rows[2])
        wanted = [
            rows[0][n] - axes[names[n]].offset if kinds[n] == 'homed' else rows[0][n]
            for n in kept
            if rows[0]
        ]
        assert bits(read.position) == bits(wanted)
        for axis in axes.values():  # the next one would be a jump
            axis.feedback = lambda *_: None


def test_a_special_value_of_another_joint_passes():
    relay = JointStates(by_joint(known(offset=0.25)))
    given_ = message_of(['wheel', 'x_joint'], [math.nan, 0.5], [-0.0, math.inf])
    read = deserialize_message(relay.turn(serialize_message(given_), 0.0), JointState)
    assert bits(read.position) == bits([math.nan, 0.25])
    assert bits(read.velocity) == bits([-0.0, math.inf])


def test_broken_bytes_are_dropped():
    relay = JointStates(by_joint(known(offset=0.25)))
    raw = serialize_message(message_of(['x_joint', 'b'], [0.5, 0.6], [1.0, 2.0]))
    for cut in range(len(raw)):
        turned = relay.turn(raw[:cut], 0.0)
        assert turned is None or cut >= len(raw) - 4, cut  # rclpy ends with 4 bytes of nothing
    assert relay.turn(serialize_message(message_of(['x_joint', 'b'], [0.5])), 0.0) is None
    assert relay.turn(raw, 0.0) is not None


def test_another_byte_order_is_made_plain():
    relay = JointStates(by_joint(known(offset=0.25)), lambda data: plain)
    plain = serialize_message(message_of(['x_joint'], [0.5]))
    turned = relay.turn(b'\x00\x00' + plain[2:], 0.0)
    assert deserialize_message(turned, JointState).position[0] == 0.25


def test_a_publisher_that_restarts_counts_anew():
    axis, wheel = known(offset=0.25), ['wheel']
    relay = JointStates(by_joint(axis))
    ours = serialize_message(message_of(['x_joint'], [0.5]))
    others = serialize_message(message_of(wheel, [0.5]))
    for number in (100, 101, 99, 102):  # out of order, by one
        relay.turn(ours, 0.0, number)
    for number in (5000, 1):  # another publisher restarts, of joints that are not ours
        relay.turn(others, 0.0, number)
    assert axis.refusal == ''
    relay.turn(ours, 0.0, 1)
    assert 'the publisher of its feedback has changed' in axis.refusal


# -- soft limits --------------------------------------------------------------------------------

SMALL = st.floats(-0.2, 0.2)


@given(
    st.lists(
        st.tuples(st.floats(0.05, 2.0), SMALL, st.floats(-1, 1), st.floats(-5, 5)),
        min_size=2,
        max_size=4,
    ),
    st.sampled_from([1, 2, 3]),
)
def test_a_course_is_judged_between_its_points_too(rows, orders):
    """The controller's own curve, sampled, is beyond the limits where it is said to be."""
    limits = Interval(-0.2, 0.2)
    time, points, knots = 0.0, [], []
    for step, *values in rows:
        time += step
        filled = [*values[:orders], None, None][:3]
        knots.append(Knot(time, *filled))
        points.append(
            Point(
                round(time * NS),
                (values[0],),
                (values[1],) if orders > 1 else (),
                (values[2],) if orders > 2 else (),
            )
        )
    furthest = 0.0
    for one, other in pairwise(points):
        for i in range(101):
            at = one.time + (other.time - one.time) * i // 100
            point = between(one.time, one, other.time, other, at)
            furthest = max(furthest, abs(point.positions[0]))
    found = beyond(knots, limits)
    if found is None:
        assert furthest <= 0.2 + 1e-6
    else:
        assert abs(found) > 0.2
        assert furthest > 0.2 - 1e-2  # sampled coarsely
    if furthest > 0.2 + 1e-6:
        assert found is not None


# -- trajectories -------------------------------------------------------------------------------


def trajectory(positions, times=None, names=('x_joint',), **more):
    times = times or range(1, len(positions) + 1)
    return JointTrajectory(
        joint_names=list(names),
        points=[
            JointTrajectoryPoint(
                positions=[p] if isinstance(p, float) else list(p),
                time_from_start=Duration(sec=int(t), nanosec=int(t % 1 * 1e9)),
                **more,
            )
            for p, t in zip(positions, times, strict=True)
        ],
    )


def test_what_is_refused():
    axis = known(offset=0.1, travel_min=-0.05, travel_max=0.3)
    axis.feedback(0.0, 0.1, 0.0)
    axes = by_joint(axis)
    assert refusal(trajectory([0.1, 0.3]), axes) == ''
    assert refusal(trajectory([]), axes) == ''  # the controller's own affair
    why = refusal(trajectory([0.1, 0.31]), axes)
    assert why.startswith('axis x: it would go to 0.31 m, beyond its soft limits -0.05 to 0.3 m')
    assert 'no position' in refusal(trajectory([()]), axes)
    assert 'not finite' in refusal(trajectory([math.nan]), axes)
    over = trajectory([0.29, 0.29], velocities=[0.2])
    over.points[1].velocities = [-0.2]
    assert 'beyond its soft limits' in refusal(over, axes)
    assert refusal(trajectory([9.0], names=['other']), axes) == ''
    assert refusal(trajectory([0.1]), by_joint(known())) == 'axis x is not homed'


def test_a_point_at_a_soft_limit_may_be_rounded():
    """0.1 + 0.2 is no motion beyond 0.3, nor is a course that stays there for long."""
    axes = by_joint(known(offset=0.0, travel_min=0.0, travel_max=0.3))
    assert refusal(trajectory([0.1 + 0.2]), axes) == ''
    assert 'beyond' in refusal(trajectory([0.3 + 1e-8]), axes)
    stays = trajectory([0.3] * 3, velocities=[1e-17], accelerations=[1e-16])
    assert refusal(stays, axes) == ''


def test_a_point_with_more_positions_than_joints():
    """Not cut to what fits: the controller would play what nobody meant."""
    axes = by_joint(known(offset=0.1))
    message = trajectory([(0.1, 0.2)])
    why = 'axis x: point 0 has 2 positions for 1 joints'
    assert to_raw(message, axes) == why
    assert list(message.points[0].positions) == [0.1, 0.2]


@pytest.mark.parametrize('limit', ['travel_max', 'travel_min'])
@pytest.mark.parametrize('accelerations', [[], [0.0]])
def test_a_moving_axis_overshoots_the_first_point(limit, accelerations):
    """The controller begins at the velocity that the axis has: its curve goes on for a while."""
    sign = 1 if limit == 'travel_max' else -1
    axis = known(offset=0.0, **{'travel_min': -0.3, 'travel_max': 0.3, limit: sign * 0.3})
    slow = trajectory([sign * 0.29], [10], velocities=[0.0], accelerations=accelerations)
    for number in range(101):
        axis.feedback(number * 0.002, sign * 0.2 * number * 0.002, number * 0.002)
    assert axis.velocity == pytest.approx(sign * 0.2)
    assert 'beyond its soft limits' in refusal(slow, by_joint(axis))
    assert refusal(trajectory([sign * 0.29], [10]), by_joint(axis)) == ''  # a line
    place = axis.raw
    for number in range(101, 300):  # it rests, its encoder shows a count of noise
        axis.feedback(number * 0.002, place + number % 2 * 1e-6, number * 0.002)
    assert axis.velocity == 0.0
    assert refusal(slow, by_joint(axis)) == ''


def test_a_jump_of_the_feedback_is_no_velocity():
    axis = known(offset=0.0, wrap=1.0)
    for number in range(200):  # 1 m/s, over the end of a turn
        axis.feedback(number * 0.002, (0.7 + number * 0.002) % 1.0, number * 0.002)
    assert axis.velocity == pytest.approx(1.0)
    axis.feedback(0.402, 0.5, 0.402)
    assert 'jumped' in axis.refusal
    assert axis.velocity == 0.0


def test_an_axis_beyond_a_soft_limit_may_come_back():
    axis = known(offset=0.0, travel_min=0.0, travel_max=0.3)
    axis.feedback(0.0, 0.4, 0.0)
    assert refusal(trajectory([0.25]), by_joint(axis)) == ''
    assert refusal(trajectory([0.35]), by_joint(axis))
    back = trajectory([0.2], velocities=[5.0])  # a detour on the way
    assert 'beyond' in refusal(back, by_joint(axis))


@settings(max_examples=30)
@given(st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=4), st.sampled_from(OFFSETS))
def test_behind_the_relay_the_command_is_bit_equal(places, offset):
    """A controller makes the same of a homed trajectory behind the relay as of the raw one."""
    axes = by_joint(known('x', offset), known('y', -offset))
    names = ['y_joint', 'wheel', 'x_joint']
    offsets = [-offset, 0.0, offset]
    homed = [(p, 2 * p, -p) for p in places]
    raw = [tuple(h + o if o else h for h, o in zip(row, offsets, strict=True)) for row in homed]
    more = {'velocities': [0.0] * 3, 'accelerations': [0.0] * 3}
    assert offsets_of(names, axes) == offsets
    shifted = trajectory(homed, names=names, **more)
    assert to_raw(shifted, axes) == ''
    assert shifted == trajectory(raw, names=names, **more)

    def commands(message):
        controller = TrajectoryController(names, 500.0)
        controller.activate([0.0] * 3)
        points = tuple(
            Point(
                p.time_from_start.sec * NS,
                tuple(p.positions),
                tuple(p.velocities),
                tuple(p.accelerations),
            )
            for p in message.points
        )
        controller.update(0, [0.0] * 3)
        assert controller.receive(Message(0, tuple(message.joint_names), points), 0)
        for n in range(1, 500 * (len(points) + 1), 11):
            yield controller.update(n * 2_000_000, [0.0] * 3)

    direct = trajectory(raw, names=names, **more)
    assert list(commands(shifted)) == list(commands(direct))


def test_feedback_comes_back_homed():
    axis = known('x', 0.1)
    names, axes = ['x_joint', 'wheel'], by_joint(axis)
    point = JointTrajectoryPoint(positions=[0.5, 0.7], velocities=[1.0, 2.0])
    empty = JointTrajectoryPoint()
    assert to_homed([point, empty], names, axes)
    assert list(point.positions) == [0.5 - 0.1, 0.7]
    assert list(point.velocities) == [1.0, 2.0]
    assert list(empty.positions) == []


def test_without_a_home_nothing_is_shifted():
    """Positions of one kind never pass for those of the other."""
    axes = by_joint(known('x', 0.1), known('y'))
    names = ['x_joint', 'y_joint']
    homed = trajectory([(0.1, 0.2)], names=names)
    assert to_raw(homed, axes) == 'axis y is not homed'
    assert homed == trajectory([(0.1, 0.2)], names=names)
    point = JointTrajectoryPoint(positions=[0.5, 0.7])
    assert not to_homed([point], names, axes)
    assert list(point.positions) == [0.5, 0.7]
    assert offsets_of(names, axes) is None


# -- parameters ---------------------------------------------------------------------------------


def test_one_file_serves_the_node_and_the_relay():
    values = {
        'axes': ['x'],
        'update_rate': 250.0,
        'x.home_type': 'HS',
        'x.travel': 0.4,
        'x.apply': 'relay',
        'x.home_offset': 0.25,
        'controllers': ['axes_controller'],
    }
    read = settings_from(values)
    assert read.controllers == ('axes_controller',)
    assert read.homes == {'x': 0.25}
    assert read.homing_node == 'homing_node'
    for wrong, text in (
        ({'x.home_offset': 'a'}, "x.home_offset: 'a' is not a number"),
        ({'controllers': ['a b']}, "'a b' is not the name of a node"),
        ({'x.travel_min': 1.0}, 'x.travel_min: 1 m must be <= travel_max, 0 m'),
        ({'nonsense': 1}, 'nonsense: no such parameter'),
        ({'axes': []}, 'axes: no axis is named'),
    ):
        with pytest.raises(InvalidParameters) as raised:
            settings_from({**values, **wrong})
        assert any(text in fault for fault in raised.value.faults), raised.value.faults
