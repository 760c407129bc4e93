# SPDX-License-Identifier: Apache-2.0
"""Inputs of any message type, without a graph: many of one topic, what is not said, latches."""

import math
import random
from collections import Counter
from contextlib import nullcontext
from dataclasses import replace

import pytest
from core_rig import rig
from input_rig import Clock, Graph
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState, Temperature
from std_msgs.msg import Bool, Float64, Int32MultiArray, UInt16

from homing_node.core.axis import Axis
from homing_node.diagnosis.facts import Endpoint
from homing_node.parameters.connections import connections
from homing_node.parameters.definition import InvalidParameters
from homing_node.procedures.states import Error, Input
from homing_node.ros import feeds
from homing_node.ros.inputs import Inputs

JOINT_STATE = 'sensor_msgs/msg/JointState'
HOME, PLUS, MINUS = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'


class Cell:
    """Axes that are wired as parameters say; the messages of a topic are put into it."""

    PERIOD = 0.004

    def __init__(self, axes, home_type='HS', **changes):
        self.axes = {
            name: Axis(name, rig(home_type, **changes).parameters(), self.PERIOD) for name in axes
        }
        self.graph, self.clock = Graph(), Clock()
        self.inputs = Inputs(
            self.axes,
            {name: name for name in axes},
            self.clock,
            self.graph,
            lambda _: '',
            nullcontext(),
        )
        for name, values in axes.items():
            self.wire(name, **values)

    def wire(self, name, **values):
        given = {key.replace('__', '.'): value for key, value in values.items()}
        found, faults = connections(given)
        assert not faults
        self.inputs.wire(name, found)

    def offer(self, topic, kind, node='/driver', **how):
        self.graph.offered[topic] = [Endpoint(node, kind, **how)]
        self.look()

    def look(self):
        self.inputs.watch()
        self.inputs.look()

    def say(self, topic, message, stamp=0.0):
        """Put a message, or bytes, into a topic; ``stamp`` from now, s."""
        data = message if isinstance(message, bytes) else serialize_message(message)
        now = self.clock.now
        self.graph.topics[topic.rpartition('/')[2]].waiting.append(
            (
                data,
                {
                    'source_timestamp': round((now + stamp) * 1e9),
                    'received_timestamp': round(now * 1e9),
                },
            )
        )

    def poll(self, later=0.004):
        self.clock.now += later
        self.inputs.poll()

    def start(self, name='x', position=0.05):
        """Let an axis rest long enough, and home it."""
        for _ in range(60):
            self.say('joint_states', JointState(name=list(self.axes), position=[position]))
            self.poll()
        assert self.inputs.missing(name) == []
        refusal = self.axes[name].home(self.clock.now)
        assert refusal is None, refusal

    def missing(self, name='x'):
        return '; '.join(one.message for one in self.inputs.missing(name))

    def conflict(self, name='x'):
        return self.inputs.conflict(name, lambda topic: ['/driver'])


def words(topic='/io/word', **more):
    return {
        f'topics__{HOME}': f'{topic}#data & 4',
        f'topics__{PLUS}': f'{topic}#data & 2',
        f'topics__{MINUS}': f'{topic}#data & 1',
        **more,
    }


def test_one_topic_has_one_subscription_for_all_axes():
    cell = Cell({'x': words(), 'y': words()})
    assert 'word' not in cell.graph.topics
    cell.offer('/io/word', 'std_msgs/msg/UInt16')
    assert cell.graph.topics['word'].msg_type is UInt16
    made = cell.graph.topics['word']
    cell.say('word', UInt16(data=6))
    cell.poll()
    for axis in cell.axes.values():
        levels = {name: switch.level for name, switch in axis.readings.switches.items()}
        assert levels == {HOME: True, PLUS: True, MINUS: False}
    cell.wire('y', **words('/io/other'))
    assert cell.graph.topics['word'] is made
    assert made not in cell.graph.destroyed
    cell.wire('x', **words('/io/other'))
    assert made in cell.graph.destroyed


@pytest.mark.parametrize('headers', [False, True])
def test_a_message_that_repeats_counts_as_one_that_is_new(headers):
    """What is noted of messages that say the same is what would be noted of each of them."""
    taken = {}
    for same in (True, False):
        source = f'/io/s#{"limit/position" if headers else "data"}'
        topics = {f'topics__{name}': source for name in (HOME, PLUS, MINUS)}
        cell = Cell({'x': topics})
        cell.offer('/io/s', JOINT_STATE if headers else 'std_msgs/msg/UInt16')
        for number in range(50):
            if not same:
                next(iter(cell.inputs._feeds.values()))._reader.forget()
            if headers:
                message = JointState(name=['limit'], position=[float(number >= 40)])
                seconds = cell.clock.now - 0.001
                message.header.stamp.sec = int(seconds)
                message.header.stamp.nanosec = round(seconds % 1 * 1e9)
            else:
                message = UInt16(data=int(number >= 40))
            cell.say('s', message)
            edges = []
            cell.axes['x']._take = edges.append
            cell.poll(0.02)
            if edges:
                taken[same] = [(one.input, one.opening) for one in edges]
    assert len(taken[True]) == 3
    assert taken[True] == taken[False]
    opening = taken[True][0][1]
    assert opening.gap == pytest.approx(0.02)  # polled: the edge lies between two messages


@pytest.mark.parametrize('seed', range(6))
def test_switches_in_step_hear_what_each_would_hear_alone(seed, monkeypatch):
    """After some messages that repeat, switches share their times; it must change nothing."""
    choice = random.Random(seed)
    script = []
    for _ in range(25):
        quiet = [(choice.choice([0.002, 0.004, 0.05]), None)] * choice.randint(0, 12)
        script += [*quiet, (choice.choice([0.0, 0.002, 0.3]), choice.randrange(8))]
    heard, shared = [], Counter()
    for long in (3, math.inf):
        monkeypatch.setattr(feeds, 'LONG', long)
        latency = {'switch_latency': 0.01, 'switch_stamp_error': 0.002}
        cell = Cell({'x': words(), 'y': words(), 'z': words()})
        cell.axes['z'].configure(replace(cell.axes['z'].parameters, **latency))
        cell.wire('z', **words())
        cell.offer('/io/word', 'std_msgs/msg/UInt16')
        switches = [one for axis in cell.axes.values() for one in axis.readings.switches.values()]
        edges, word = [], 0
        for axis in cell.axes.values():
            axis._take = edges.append
        noted = []
        for number, (later, new) in enumerate(script):
            word = word if new is None else new
            cell.say('word', UInt16(data=word))
            cell.poll(later)
            if number == 60:
                cell.wire('y', **words(types__home_switch='std_msgs/msg/UInt16'))
            noted.append([(one.level, one.seen, one.messages.copy()) for one in switches])
            shared[long] += len(switches) - len({id(one.messages) for one in switches})
        heard.append((noted, [(one.input, one.rises, one.opening) for one in edges]))
    assert shared[3] > 100
    assert shared[math.inf] == 0
    assert heard[0][1] == heard[1][1]
    for ours, alone in zip(heard[0][0], heard[1][0], strict=True):
        for (level, seen, times), (its_level, its_seen, its_times) in zip(
            ours, alone, strict=True
        ):
            assert (level, seen) == (its_level, its_seen)
            assert times.is_as(its_times)


def test_a_switch_in_step_that_is_no_longer_said_grows_old(monkeypatch):
    monkeypatch.setattr(feeds, 'LONG', 3)
    cell = array_cell()
    for _ in range(6):
        cell.say('p', pins(0, 0, 0))
        cell.poll()
    switches = cell.axes['x'].readings.switches
    assert len({id(one.messages) for one in switches.values()}) == 1
    said = cell.clock.now
    cell.say('p', pins(0, 0))
    cell.poll(0.1)
    seen = {name: one.seen for name, one in switches.items()}
    assert seen == {HOME: said, PLUS: said, MINUS: pytest.approx(said - 0.004)}
    assert len({id(one.messages) for one in switches.values()}) == 3


def test_a_switch_has_the_time_of_its_header():
    cell = Cell({'x': {f'topics__{HOME}': '/io/s#limit/position'}}, switches=(Input.HOME_SWITCH,))
    cell.offer('/io/s', JOINT_STATE)
    taken = []
    cell.axes['x'].switch = lambda *edge: taken.append(edge)
    message = JointState(name=['limit'], position=[1.0])
    message.header.stamp.sec, message.header.stamp.nanosec = 999, 997_000_000
    cell.say('s', message)
    cell.poll()
    ((source, time, level, _, doubt),) = taken
    assert (source, level, doubt) == (HOME, True, 0.0)
    assert time == pytest.approx(999.997)


@pytest.mark.parametrize(('clock', 'doubted'), [('auto', True), ('stamp', False)])
def test_switch_clock_says_what_a_header_is(clock, doubted):
    """A header that is 0.1 s behind the sending: both readings are possible, or one is chosen."""
    cell = Cell(
        {'x': {f'topics__{HOME}': '/io/s#limit/position'}},
        switches=(Input.HOME_SWITCH,),
        switch_clock=clock,
    )
    cell.offer('/io/s', JOINT_STATE)
    taken = []
    cell.axes['x'].switch = lambda *edge: taken.append(edge)
    message = JointState(name=['limit'], position=[1.0])
    message.header.stamp.sec, message.header.stamp.nanosec = 999, 900_000_000
    cell.say('s', message)
    cell.poll()
    ((_, time, _, _, doubt),) = taken
    assert (doubt > 0.04) is doubted
    assert abs(time - 999.9) <= doubt + 1e-6


# -- what is not said -----------------------------------------------------------------------------


def pins(*levels):
    return Int32MultiArray(data=levels)


def array_cell():
    topics = {f'topics__{name}': f'/io/p#data[{i}]' for i, name in enumerate((HOME, PLUS, MINUS))}
    cell = Cell({'x': topics})
    cell.offer('/io/p', 'std_msgs/msg/Int32MultiArray')
    return cell


@pytest.mark.parametrize(
    ('message', 'named'),
    [
        (pins(0), '): data has 1 elements, none at '),
        (pins(), '): data has 0 elements, none at '),
        (b'\0\1\0\0' + b'\7' * (1 << 20), 'the message is no std_msgs/msg/Int32MultiArray: '),
        (b'', 'the message is no std_msgs/msg/Int32MultiArray: '),
    ],
)
def test_what_is_not_said_ends_a_run_and_refuses_the_next(message, named):
    cell = array_cell()
    cell.say('p', pins(0, 0, 0))
    cell.start()
    cell.say('p', message)
    cell.poll()
    axis = cell.axes['x']
    assert axis.machine.ending.error is Error.SwitchUnknown
    assert named in axis.machine.ending.message
    assert named in cell.missing()
    cell.say('p', pins(0, 0, 0))
    cell.poll()
    assert 'data has' not in cell.missing() and 'no std' not in cell.missing()


def test_messages_behind_a_broken_one_wait_for_the_next_cycle():
    """Nonsense costs a cycle the walk through one message, however many wait."""
    cell = array_cell()
    for _ in range(5):
        cell.say('p', b'\0\1\0\0')
    waiting = cell.graph.topics['p'].waiting
    for left in (4, 3):
        cell.poll()
        assert len(waiting) == left


def test_nan_is_unknown_and_never_off():
    cell = Cell({'x': {f'topics__{HOME}': '/io/s#l/position'}}, switches=(Input.HOME_SWITCH,))
    cell.offer('/io/s', JOINT_STATE)
    cell.say('s', JointState(name=['l'], position=[math.nan]))
    cell.poll()
    assert cell.axes['x'].readings.switches[Input.HOME_SWITCH].level is None
    assert 'home_switch (/io/s#l/position): it is nan' in cell.missing()
    cell.say('s', JointState(name=['l'], position=[0.5]))
    cell.poll()
    assert cell.axes['x'].readings.switches[Input.HOME_SWITCH].level is True
    assert 'home_switch' not in cell.missing()


# -- latches, servo, feedback ---------------------------------------------------------------------


def test_a_latch_is_new_when_its_counter_has_changed():
    wired = {'topics__z_pulse': '/io/l#i/position @ i/effort'}
    cell = Cell({'x': wired}, 'ZPulse', switches=(Input.Z_PULSE,))
    cell.offer('/io/l', JOINT_STATE)
    assert 'no message yet from z_pulse' in cell.missing()
    taken = []
    cell.axes['x'].latch = lambda *latch: taken.append(latch)

    def latch(position, count):
        cell.say('l', JointState(name=['i'], position=[position], effort=[count]))
        cell.poll()

    latch(0.1, 7.0)  # the last one of the time before
    assert 'z_pulse' not in cell.missing()
    latch(0.1, 7.0)
    latch(math.nan, 7.0)  # nothing new
    assert taken == []
    latch(0.2, 8.0)
    latch(0.2, 8.0)
    latch(0.3, 0.0)  # a counter that begins again, or a toggle
    assert taken == [('z_pulse', 0.2), ('z_pulse', 0.3)]
    latch(math.nan, 1.0)
    assert 'it is nan' in cell.missing()
    latch(0.4, math.nan)
    assert 'its counter: it is nan' in cell.missing()
    latch(0.5, 3.0)
    assert len(taken) == 2  # where the counter stands was not known
    latch(0.6, 4.0)
    assert taken[2:] == [('z_pulse', 0.6)]


def test_without_a_counter_each_message_is_a_latch():
    wired = {'topics__z_pulse': '/io/w#data'}
    cell = Cell({'x': wired}, 'ZPulse', switches=(Input.Z_PULSE,))
    cell.offer('/io/w', 'std_msgs/msg/UInt16')
    taken = []
    cell.axes['x'].latch = lambda *latch: taken.append(latch)
    for _ in range(3):
        cell.say('w', UInt16(data=5))
    cell.poll()
    assert taken == 3 * [('z_pulse', 5.0)]


def test_a_latch_that_was_kept_from_before_is_none():
    cell = Cell({'x': {'topics__z_pulse': '/io/z'}}, 'ZPulse', switches=(Input.Z_PULSE,))
    taken = []
    cell.axes['x'].latch = lambda *latch: taken.append(latch)
    cell.say('z', Float64(data=0.1), stamp=-0.5)
    cell.poll()
    cell.say('z', Float64(data=0.2))
    cell.poll()
    assert taken == [('z_pulse', 0.2)]


def test_the_feedback_may_come_from_any_message():
    cell = Cell({'x': {'topics__feedback': '/d/s#x/effort'}, 'y': {}})
    cell.offer('/d/s', JOINT_STATE)
    cell.say('s', JointState(name=['x'], position=[9.0], effort=[0.25]))
    cell.say('joint_states', JointState(name=['x', 'y'], position=[9.0, 0.5]))
    cell.poll()
    assert [axis.position for axis in cell.axes.values()] == [0.25, 0.5]
    cell.say('s', JointState(name=['x'], effort=[math.nan]))
    cell.poll()
    assert cell.axes['x'].position == 0.25


@pytest.mark.parametrize(('publishers', 'ends'), [(1, True), (2, False)])
def test_feedback_that_is_not_there_ends_a_run_unless_others_publish_it(publishers, ends):
    cell = Cell(
        {'x': {'topics__feedback': '/d/s#x/position', f'topics__{HOME}': '/io/h'}},
        switches=(Input.HOME_SWITCH,),
    )
    cell.offer('/d/s', JOINT_STATE)
    cell.graph.topics['s'].publishers = publishers
    cell.inputs.watch()
    cell.say('h', Bool(data=False))
    for _ in range(60):
        cell.say('s', JointState(name=['x'], position=[0.05]))
        cell.poll()
    assert cell.axes['x'].home(cell.clock.now) is None
    cell.say('s', JointState(name=['other'], position=[0.05]))
    cell.poll()
    ending = cell.axes['x'].machine.ending
    assert (ending.error is Error.FeedbackStale) is ends
    assert ('no element of position has' in ending.message) is ends


def test_feedback_alone_needs_no_joint_states():
    cell = Cell({'x': {'topics__feedback': '/d/s#x/effort'}})
    assert 'joint_states' not in cell.graph.topics


# -- types and QoS --------------------------------------------------------------------------------


def test_a_told_type_is_subscribed_to_at_once_and_refuses_what_does_not_fit():
    told = {f'types__{name}': 'std_msgs/UInt16' for name in (HOME, PLUS, MINUS)}
    cell = Cell({'x': words(**told)})
    assert cell.graph.topics['word'].msg_type is UInt16
    before = cell.graph.topics['word']
    with pytest.raises(InvalidParameters) as caught:
        cell.wire('x', **{**words(**told), f'topics__{HOME}': '/io/word#dat & 4'})
    assert 'x.topics.home_switch: std_msgs/UInt16 has no field dat; it has data (uint16)' in str(
        caught.value
    )
    assert cell.graph.topics['word'] is before
    with pytest.raises(InvalidParameters, match='std_msgs/msg/Bool and of std_msgs/msg/UInt16'):
        cell.wire('x', **words(**{**told, f'types__{HOME}': 'std_msgs/Bool'}))
    with pytest.raises(InvalidParameters, match='not installed here: there is no package no_msgs'):
        cell.wire('x', **{f'topics__{HOME}': '/a#b', f'types__{HOME}': 'no_msgs/Such'})


@pytest.mark.parametrize(
    ('kind', 'named'),
    [
        ('std_msgs/msg/String', ': data is text, a number is expected'),
        ('no_msgs/msg/Such', 'is not installed here: there is no package no_msgs'),
        ('std_msgs/msg/NoSuch', 'the package std_msgs has no message NoSuch'),
    ],
)
def test_a_type_that_does_not_fit_refuses_a_run(kind, named):
    cell = Cell({'x': words()})
    cell.offer('/io/word', kind)
    refusal = cell.conflict()
    assert refusal.error is Error.InvalidParameter
    assert named in refusal.message


def test_a_plain_topic_takes_the_type_of_its_publisher():
    cell = Cell({'x': {f'topics__{HOME}': '/io/h'}}, switches=(Input.HOME_SWITCH,))
    assert cell.graph.topics['h'].msg_type is Bool
    cell.graph.topics['h'].publishers = 0
    cell.offer('/io/h', 'std_msgs/msg/UInt16', reliable=False)
    made = cell.graph.topics['h']
    assert made.msg_type is UInt16
    assert made.profile.reliability.name == 'BEST_EFFORT'
    cell.say('h', UInt16(data=1))
    cell.poll()
    assert cell.axes['x'].readings.is_on(Input.HOME_SWITCH)


def test_a_new_subscription_misses_nothing():
    """Of a publisher that keeps what it said; what has come by the old one is read before."""
    cell = Cell({'x': {f'topics__{HOME}': '/io/h'}}, switches=(Input.HOME_SWITCH,))
    old = cell.graph.topics['h']
    cell.say('h', Bool(data=True))
    cell.offer('/io/h', 'std_msgs/msg/Bool', latched=True)
    made = cell.graph.topics['h']
    assert made is not old and old in cell.graph.destroyed
    assert made.profile.durability.name == 'TRANSIENT_LOCAL'
    assert cell.axes['x'].readings.is_on(Input.HOME_SWITCH)
    cell.look()
    assert cell.graph.topics['h'] is made


def test_overrides_that_do_not_fit_name_both_sides():
    cell = Cell({'x': {f'topics__{HOME}': '/io/h'}}, switches=(Input.HOME_SWITCH,))
    cell.graph.topics['h'].publishers = 0
    cell.graph.own['/io/h'] = Endpoint('/homing_node', 'std_msgs/msg/Bool', reliable=True)
    cell.offer('/io/h', 'std_msgs/msg/Bool', reliable=False)
    refusal = cell.conflict()
    assert refusal.error is Error.SwitchUnknown
    assert '/driver offers best_effort, volatile' in refusal.message
    assert 'the node asks for reliable, volatile (qos_overrides)' in refusal.message


def test_nothing_is_subscribed_anew_while_an_axis_needs_it():
    cell = Cell({'x': {f'topics__{HOME}': '/io/h'}}, switches=(Input.HOME_SWITCH,))
    made = cell.graph.topics['h']
    cell.say('h', Bool(data=False))
    cell.start()
    cell.offer('/io/h', 'std_msgs/msg/Bool', latched=True)
    assert cell.graph.topics['h'] is made


def test_what_is_heard_is_subscribed_anew_only_while_every_axis_rests():
    """To make a subscription takes some ms: the setpoints of a run would be late."""
    cell = Cell({name: {f'topics__{HOME}': f'/io/{name}'} for name in 'xy'}, switches=(HOME,))
    made = cell.graph.topics['y']
    for name in 'xy':
        cell.say(name, Bool(data=False))
    cell.start('x')
    cell.offer('/io/y', 'std_msgs/msg/Bool', latched=True)
    assert cell.graph.topics['y'] is made
    cell.axes['x'].abort(Error.Canceled, 'enough')
    cell.look()
    assert cell.graph.topics['y'] is not made


def test_a_second_publisher_that_does_not_match_is_noticed():
    """The subscription asks for what the first one keeps; the second one keeps nothing."""
    cell = Cell({'x': {f'topics__{HOME}': '/io/h'}}, switches=(Input.HOME_SWITCH,))
    cell.offer('/io/h', 'std_msgs/msg/Bool', latched=True)
    assert cell.graph.topics['h'].profile.durability.name == 'TRANSIENT_LOCAL'
    cell.graph.offered['/io/h'].append(Endpoint('/other', 'std_msgs/msg/Bool'))
    assert cell.conflict().error is Error.PublisherConflict
    cell.look()
    assert cell.graph.topics['h'].profile.durability.name == 'VOLATILE'
    assert cell.conflict().error is Error.PublisherConflict
    cell.graph.offered['/io/h'].pop()
    assert cell.conflict() is None


def test_what_was_kept_from_before_is_no_sign_of_polling():
    """A publisher repeats what it kept for each new subscription; the edge stays sharp."""
    cell = Cell({'x': {f'topics__{HOME}': '/io/h'}}, switches=(Input.HOME_SWITCH,))
    for level in (False, True, False):  # on change: the switch proves it
        cell.say('h', Bool(data=level))
        cell.poll(2.0)
    cell.offer('/io/h', 'std_msgs/msg/Bool', latched=True)
    for age in (6.0, 4.0, 2.0, 2.0, 2.0):
        cell.say('h', Bool(data=False), stamp=-age)
        cell.poll(0.0001)
    assert 'home_switch' not in cell.missing()
    edges = []
    cell.axes['x']._take = edges.append
    cell.poll(0.05)
    cell.say('h', Bool(data=True))
    cell.poll()
    (edge,) = edges
    assert edge.opening.gap == 0.0


@pytest.mark.parametrize(
    ('written', 'message'),
    [
        ('/room', Temperature(temperature=21.5)),
        ('/room#data', Float64(data=21.5)),
        ('/room#thermometer/position', JointState(name=['thermometer'], position=[21.5])),
    ],
    ids=['its own type', 'a number', 'a joint'],
)
def test_a_temperature_is_noted_and_no_run_needs_it(written, message):
    cell = Cell({'x': {'topics__temperature': written}})
    for topic in (HOME, PLUS, MINUS):
        cell.offer(f'/homing_node/x/{topic}', 'std_msgs/msg/Bool')
        cell.say(topic, Bool())
    axis = cell.axes['x']
    cell.start()  # no thermometer is there, and nobody minds
    kind = type(message)
    cell.offer('/room', f'{kind.__module__.split(".")[0]}/msg/{kind.__name__}')
    assert axis.temperature is None
    axis.cancel()
    while axis.running:
        cell.poll()
        axis.update(cell.clock.now)
    cell.look()
    cell.say('room', message)
    cell.poll()
    assert axis.temperature == 21.5
    assert cell.conflict() is None
    cell.graph.offered['/room'] = []
    cell.graph.topics['room'].publishers = 0
    cell.look()
    assert axis.temperature is None


def test_publishers_are_counted_of_one_topic_at_a_time():
    """In a graph of many nodes to count publishers takes so long that a cycle would be late."""
    names = [f'a{number}' for number in range(5)]
    cell = Cell({name: {f'topics__{HOME}': f'/io/{name}'} for name in names}, switches=(HOME,))
    counted, count = [], cell.graph.count
    cell.graph.count = lambda topic: counted.append(topic) or count(topic)
    for _ in range(2 * len(names) + 2):
        before = len(counted)
        cell.inputs.watch()
        assert len(counted) - before <= 1
    assert sorted(counted) == sorted(2 * [f'/io/{name}' for name in names])
