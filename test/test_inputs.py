# SPDX-License-Identifier: Apache-2.0
"""The node's inputs without a graph: a list stands for the middleware."""

import itertools
import math
import time
from contextlib import nullcontext

import pytest
from builtin_interfaces.msg import Time
from core_rig import rig
from hypothesis import given, settings
from hypothesis import strategies as st
from input_rig import Clock, Graph
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64

from homing_node.core.axis import Axis
from homing_node.parameters.connections import Connections
from homing_node.procedures.states import Error, Input
from homing_node.ros.inputs import Inputs
from homing_node.ros.joint_feedback import MANY_LISTS
from homing_node.ros.polling import MOST_AT_ONCE
from homing_node.ros.timebase import TimeBase


class Cell:
    """An axis that homes, behind the node's own inputs, without a graph."""

    PERIOD = 0.004

    def __init__(self, home_type, header_age=None, **changes):
        self.header_age = header_age
        self.axis = Axis('x', rig(home_type, **changes).parameters(), self.PERIOD)
        self.graph = Graph()
        self.topics = self.graph.topics
        self.clock = Clock()
        self.inputs = Inputs(
            {'x': self.axis}, {'x': 'x'}, self.clock, self.graph, self._late_cycle, nullcontext()
        )
        self.inputs.wire('x', Connections())
        self.last = None
        for source in self.axis.parameters.inputs:
            if 'switch' in source:
                self.say(source, Bool(data=False))
        self.say('joint_states', self.feedback(0.05))
        self.cycle()
        assert self.axis.home(self.clock.now) is None

    def feedback(self, position):
        """Return a message of the joint; its header is as old as the cell says, s."""
        message = JointState(name=['x'], position=[position])
        if self.header_age is not None:
            seconds = self.clock.now - self.header_age
            message.header.stamp.sec = int(seconds)
            message.header.stamp.nanosec = round((seconds % 1.0) * 1e9)
        return message

    @staticmethod
    def _late_cycle(late):
        return f'held up for {late:g} s' if late > 0.2 else ''

    def say(self, topic, message, stamp=0.0, age=0.0):
        """Put a message where the next cycle finds it; times relative to now, s."""
        now = self.clock.now
        if topic in self.topics:
            self.topics[topic].waiting.append(
                (
                    serialize_message(message),
                    {
                        'source_timestamp': round((now + stamp) * 1e9),
                        'received_timestamp': round((now - age) * 1e9),
                    },
                )
            )

    def cycle(self):
        self.clock.now += self.PERIOD
        self.inputs.poll()
        setpoint = self.axis.update(self.clock.now)
        if setpoint is None:
            self.last = None
            return
        assert all(map(math.isfinite, setpoint))
        position, velocity, _ = setpoint
        assert abs(velocity) <= 0.2 * (1 + 1e-6)
        if self.last is not None and self.axis.error is not Error.FollowingError:
            assert abs(position - self.last) <= 0.2 * self.PERIOD * (1 + 1e-6) + 1e-9
        self.last = position


@pytest.mark.parametrize(('position', 'warned'), [(0.05, True), (math.nan, False)])
def test_a_doubt_is_told_of_what_was_taken(position, warned):
    cell = Cell('HS')
    cell.say('joint_states', JointState(name=['x'], position=[position]), stamp=0.5)
    cell.cycle()
    assert bool(cell.axis.machine.warnings) is warned


@pytest.mark.parametrize(
    ('feedback_clock', 'late', 'doubt'),
    [('auto', 0.05, 0.05), ('stamp', 0.1, 0.0), ('arrival', 0.0, 0.0)],
)
def test_the_parameter_says_which_time_of_a_header_counts(feedback_clock, late, doubt):
    """Case 3: the header is 0.1 s behind the sending of the same message."""
    cell = Cell('HS', 0.1, feedback_clock=feedback_clock)
    taken = []
    cell.axis.feedback = lambda *sample: taken.append(sample)
    cell.say('joint_states', cell.feedback(0.05))
    sent = cell.clock.now
    cell.cycle()
    ((at, _, _, doubted),) = taken
    assert sent - at == pytest.approx(late, abs=1e-6)
    assert doubted == pytest.approx(doubt, abs=1e-6)


def test_an_edge_in_simulated_time_is_no_better_than_its_cycle():
    cell = Cell('HS')
    cell.clock.simulated = True
    taken = []
    cell.axis.switch = lambda *edge: taken.append(edge)
    cell.say('home_switch', Bool(data=True))
    cell.cycle()
    ((source, at, level, arrival, doubt),) = taken
    assert (source, at, level, arrival) == (Input.HOME_SWITCH, cell.clock.now, True, at)
    assert doubt == 2 * cell.PERIOD


@pytest.mark.parametrize(
    'elapsed, error, text',
    [
        (0.1, None, 'came 1.000 s late, more than 0.2 s (feedback_timeout)'),
        (1.0, Error.CycleLate, 'held up for 1 s'),
    ],
    ids=['late', 'held up'],
)
@pytest.mark.parametrize(
    'topic, message, stale',
    [
        ('joint_states', JointState(name=['x'], position=[0.05]), Error.FeedbackStale),
        ('home_switch', Bool(), Error.SwitchStale),
    ],
    ids=['feedback', 'switch'],
)
def test_a_message_is_not_to_blame_for_our_own_hold_up(
    topic, message, stale, elapsed, error, text
):
    cell = Cell('HS')
    cell.clock.now += 1.1
    cell.clock.elapsed = elapsed  # since the cycle began
    cell.say(topic, message, stamp=-1.0)
    while cell.axis.running:
        cell.cycle()
    assert cell.axis.outcome.error is (error or stale)
    assert text in cell.axis.outcome.message


ANY = st.floats(allow_nan=True, allow_infinity=True)
NEAR = st.floats(0.0, 0.1)
TIMES = st.sampled_from([0.0, 0.0, -0.001, -0.05, -0.3, -3600.0, 0.5, 3600.0, 1e9])
AGES = st.sampled_from([0.0, 0.0, 0.001, 0.1, 10.0])
NAMES = st.sampled_from(['x', 'x', 'y', '', 'é' * 50])
STAMPS = st.builds(
    Time,
    sec=st.sampled_from([0, 0, 999, 1000, -5, 2**31 - 1, -(2**31)]),
    nanosec=st.sampled_from([0, 1, 999_999_999, 2**32 - 1]),
)


@st.composite
def joint_states(draw):
    message = JointState(
        name=draw(st.lists(NAMES, max_size=4)),
        position=draw(st.lists(ANY | NEAR, max_size=6)),
        velocity=draw(st.lists(ANY, max_size=2)),
    )
    message.header.stamp = draw(STAMPS)
    return message


EVENTS = st.one_of(
    st.tuples(st.just('joint_states'), joint_states()),
    st.tuples(
        st.sampled_from([i.value for i in Input if 'switch' in i]),
        st.booleans().map(lambda level: Bool(data=level)),
    ),
    st.tuples(
        st.sampled_from(['z_pulse', 'touch_probe']),
        (ANY | NEAR).map(lambda value: Float64(data=value)),
    ),
    st.tuples(
        st.just('emergency_stop'),
        st.sampled_from([False, False, False, True]).map(lambda level: Bool(data=level)),
    ),
    st.tuples(st.just(''), st.integers(1, 20)),
)


@settings(
    max_examples=settings.default.max_examples
    * (1 if settings.default.max_examples <= 200 else 10)
)
@given(
    home_type=st.sampled_from(['HSHS', 'HSZPulse', 'TouchProbe', 'LS']),
    events=st.lists(st.tuples(EVENTS, TIMES, AGES), max_size=25),
)
def test_any_messages_in_any_order(home_type, events):
    """No message makes a step, raises, or keeps the axis moving."""
    cell = Cell(home_type)
    feedback = itertools.count()
    for (topic, message), stamp, age in events:
        if topic:
            cell.say(topic, message, stamp, age)
            cell.cycle()
            continue
        for _ in range(message):
            next(feedback)
            position = 0.05 if cell.last is None else cell.last
            cell.say('joint_states', JointState(name=['x'], position=[position]))
            cell.cycle()
    for _ in range(round(3.0 / cell.PERIOD)):
        if not cell.axis.running:
            break
        cell.cycle()  # no feedback any more
    assert not cell.axis.running
    cell.cycle()
    assert cell.last is None


def test_the_arrival_of_a_switch_is_the_middleware_s():
    """Not the poll's: a bounce must not seem longer, or a clock further behind, than it is."""
    cell = Cell('HS')
    taken = []
    cell.axis.switch = lambda *edge: taken.append(edge)
    cell.say('home_switch', Bool(data=True), stamp=-0.003, age=0.002)
    sent = cell.clock.now
    cell.cycle()
    ((_, time_of_edge, _, arrival, doubt),) = taken
    assert arrival == pytest.approx(sent - 0.002, abs=1e-6)
    assert time_of_edge == pytest.approx(sent - 0.003, abs=1e-6)
    assert doubt == 0.0


@pytest.mark.parametrize('topic', ['home_switch', 'emergency_stop', 'joint_states'])
def test_a_flooded_topic_does_not_hold_the_cycle(topic):
    cell = Cell('HS')
    flood = {
        'home_switch': Bool(data=False),
        'emergency_stop': Bool(data=False),
        'joint_states': JointState(name=['x'], position=[0.05]),
    }[topic]
    for _ in range(3 * MOST_AT_ONCE):
        cell.say(topic, flood)
    cell.inputs.poll()
    assert len(cell.topics[topic].waiting) in (2 * MOST_AT_ONCE - 1, 2 * MOST_AT_ONCE)
    for _ in range(2):
        cell.inputs.poll()
    assert cell.topics[topic].waiting == []


@pytest.mark.parametrize('known', [False, True])
def test_a_changed_polarity_keeps_the_subscription(known):
    cell = Cell('HS')
    cell.axis.stop(Error.Canceled, 'enough')
    while cell.axis.running:
        cell.say('joint_states', JointState(name=['x'], position=[cell.last or 0.05]))
        cell.cycle()
    before = dict(cell.topics)
    cell.axis.configure(rig('HS', invert_hs_polarity=known).parameters())
    cell.inputs.wire('x', Connections())
    assert cell.topics == before
    assert cell.inputs.missing('x') == []
    refusal = cell.axis.refusal(cell.clock.now)
    assert refusal is None, refusal


# -- whose joints come together -------------------------------------------------------------------


class Fed:
    """Axes that rest, fed by one publisher."""

    def __init__(self, clock=None, **timeouts):
        self.axes = {
            name: Axis(name, rig('HS', feedback_timeout=timeout).parameters(), 0.004)
            for name, timeout in timeouts.items()
        }
        self.clock = clock or Clock()
        self.graph = Graph()
        self.topics = self.graph.topics
        self.inputs = Inputs(
            self.axes,
            {name: name for name in self.axes},
            self.clock,
            self.graph,
            lambda _: '',
            nullcontext(),
        )
        for name in self.axes:
            self.inputs.wire(name, Connections())

    def say(self, age=0.0, later=0.004, **positions):
        """Let one message come; return the axes that took its stamp, and those its arrival."""
        self.clock.now += later
        now = round(self.clock.now * 1e9)
        stamp = now - round(age * 1e9)
        self.topics['joint_states'].waiting.append(
            (
                serialize_message(JointState(name=list(positions), position=positions.values())),
                {'source_timestamp': stamp, 'received_timestamp': now},
            )
        )
        self.inputs.poll()
        tracks = {name: axis.readings.track for name, axis in self.axes.items()}
        return (
            ''.join(name for name, track in tracks.items() if track.time == stamp * 1e-9),
            ''.join(name for name, track in tracks.items() if track.time == now * 1e-9),
        )

    def timeout(self, name, timeout):
        self.axes[name].configure(rig('HS', feedback_timeout=timeout).parameters())
        self.inputs.wire(name, Connections())


def test_joints_come_in_any_order_and_company():
    fed = Fed(x=0.1, y=0.1, z=0.1)
    fed.say(y=1.0, other=9.0, x=2.0)
    fed.say(z=3.0)
    fed.say(x=math.nan, z=4.0)
    assert [axis.position for axis in fed.axes.values()] == [2.0, 1.0, 4.0]


def test_a_stamp_is_too_old_for_the_axis_that_says_so():
    fed = Fed(x=0.1, y=0.02, z=0.1)
    assert fed.say(0.001, x=0.0, y=0.0, z=0.0) == ('xyz', '')
    assert fed.say(0.05, later=0.1, x=0.0, y=0.0, z=0.0) == ('xz', 'y')


def test_a_changed_timeout_counts_for_its_axis():
    fed = Fed(x=0.1, y=0.1)
    assert fed.say(0.001, x=0.0, y=0.0) == ('xy', '')
    fed.timeout('y', 0.02)
    assert fed.say(0.05, later=0.1, x=0.0, y=0.0) == ('x', 'y')
    fed.timeout('y', 0.1)
    assert fed.say(0.05, later=0.1, x=0.0, y=0.0) == ('xy', '')


def test_a_changed_timeout_does_not_make_a_doubted_clock_good():
    fed = Fed(x=0.1, y=0.1)
    fed.say(x=0.0, y=0.0)
    for _ in range(10):  # it was set back by 30 ms
        taken = fed.say(0.03, x=0.0, y=0.0)
    assert taken == ('', 'xy')
    fed.timeout('y', 0.5)
    assert fed.say(0.03, x=0.0, y=0.0) == ('', 'xy')
    assert fed.say(0.004, x=0.0, y=0.0) == ('xy', '')  # back at nearly the age that it had


def test_a_message_too_late_stops_its_axes_whatever_list_it_comes_in():
    fed = Fed(x=0.1, y=0.1)
    for _ in range(10):
        fed.say(0.001, x=0.0, y=0.0)
    stopped = []
    for name, axis in fed.axes.items():
        axis.stop = lambda error, _, name=name: stopped.append((name, str(error)))
    fed.say(0.3, later=0.4, x=0.0)
    assert stopped == [('x', 'FeedbackStale')]
    fed.say(0.001, x=0.0, y=0.0)
    fed.say(0.3, later=0.4, x=0.0, y=math.nan)
    assert stopped[1:] == [('x', 'FeedbackStale'), ('y', 'FeedbackStale')]


def test_lists_of_joints_without_end_are_not_kept():
    fed = Fed(x=0.1)
    for number in range(3 * MANY_LISTS):
        assert fed.say(x=0.0, **{f'other_{number}': 0.0}) == ('x', 'x')
    assert len(fed.inputs.joint_feedback.lists) <= MANY_LISTS


# -- the clocks of the computer -------------------------------------------------------------------


class Computer:
    """The clocks of a computer, and one axis whose messages they stamp."""

    def __init__(self, monkeypatch):
        self.monotonic, self.system = 1000.0, 1.7e9
        monkeypatch.setattr(time, 'monotonic', lambda: self.monotonic)
        monkeypatch.setattr(time, 'time_ns', lambda: round(self.system * 1e9))
        self.fed = Fed(TimeBase(), x=0.1)
        self.axis = self.fed.axes['x']

    def pass_time(self, seconds):
        self.monotonic += seconds
        self.system += seconds

    def say(self, topic, message):
        stamp = round(self.system * 1e9)
        self.fed.topics[topic].waiting.append(
            (serialize_message(message), {'source_timestamp': stamp, 'received_timestamp': stamp})
        )

    def move(self, position):
        self.say('joint_states', JointState(name=['x'], position=[position]))

    def poll(self, meanwhile=lambda: None):
        """Poll; something happens when it has just begun."""
        clock, relate = self.fed.clock, self.fed.clock.relate

        def begin():
            relate()
            clock.relate = relate
            meanwhile()

        clock.relate = begin
        self.fed.inputs.poll()


@pytest.mark.parametrize('step', [3600.0, 0.3, -0.3, -3600.0])
@pytest.mark.parametrize('begun', [False, True], ids=['before the poll', 'within it'])
@pytest.mark.parametrize('told', [False, True], ids=['then a message', 'after a message'])
def test_the_system_clock_steps(monkeypatch, step, begun, told):
    """Feedback is no later than it was taken, and what follows is believed."""
    computer = Computer(monkeypatch)

    def happen():
        if told:
            computer.move(1.0)
        computer.system += step
        if not told:
            computer.move(1.0)

    if begun:
        computer.poll(happen)
    else:
        happen()
        computer.poll()
    assert computer.axis.readings.arrival <= computer.monotonic
    for position in range(2, 5):
        computer.pass_time(0.002)
        computer.move(position)
        computer.poll()
    assert computer.axis.position == 4.0
    assert computer.axis.readings.arrival == pytest.approx(computer.monotonic, abs=1e-6)


@pytest.mark.parametrize(
    'topic, message',
    [('joint_states', JointState(name=['x'], position=[1.0])), ('home_switch', Bool(data=True))],
    ids=['feedback', 'switch'],
)
def test_a_message_that_comes_in_a_poll_that_takes_long_is_believed(monkeypatch, topic, message):
    computer, taken = Computer(monkeypatch), []
    computer.axis.feedback = computer.axis.switch = lambda *told: taken.append(told)

    def happen():
        computer.pass_time(0.005)
        computer.say(topic, message)

    computer.poll(happen)
    ((*_, arrival, doubt),) = taken
    assert arrival == pytest.approx(computer.monotonic, abs=1e-6)
    assert doubt == 0.0
