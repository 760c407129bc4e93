# SPDX-License-Identifier: Apache-2.0
"""Values from the bytes of messages, against what rclpy makes of the same bytes.

Messages follow each other in one reader, for it remembers names and the message before.
"""

from contextlib import suppress
from math import isfinite

import pytest
from control_msgs.msg import DynamicInterfaceGroupValues, InterfaceValue
from hypothesis import given, settings
from hypothesis import strategies as st
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from ur_msgs.msg import Analog, Digital, IOStates

from homing_node.language.expression import parse
from homing_node.language.reader import Broken, Missing, Reader
from homing_node.language.resolve import bind
from homing_node.ros.message_types import kind_of, layout

NUMBERS = st.sampled_from([0.0, 1.0, 0.25, 3.0, float('nan'), float('inf')])
LABELS = st.sampled_from(['a', 'b', 'of twelve', ''])
NAMES = st.lists(LABELS, max_size=4)
some = settings(max_examples=settings.default.max_examples // 4)


def reader(kind, *expressions):
    messages = layout(kind_of(kind))
    return Reader(messages, [bind(parse(f'/t#{one}'), messages) for one in expressions])


def the_one(names, values, name):
    """Return the value of a name, None where rclpy's message has it nowhere, or twice."""
    found = [number for number, one in enumerate(names) if one == name]
    return values[found[0]] if len(found) == 1 and found[0] < len(values) else None


def agrees(said, value):
    """Return whether what a reader says is a value of rclpy's message."""
    if value is None:
        return isinstance(said, Missing) and not said.unread
    if not isfinite(value):
        return isinstance(said, Missing) and said.unread
    return said == value


@st.composite
def groups(draw):
    names = draw(NAMES)
    blocks = st.lists(st.tuples(NAMES, st.lists(NUMBERS, max_size=4)), max_size=4)
    message = DynamicInterfaceGroupValues(
        interface_groups=names,
        interface_values=[InterfaceValue(interface_names=n, values=v) for n, v in draw(blocks)],
    )
    message.header.frame_id = draw(LABELS)
    message.header.stamp.sec = draw(st.integers(0, 3))
    return message


@some
@given(st.lists(st.one_of(groups(), st.just(None)), min_size=1, max_size=6))
def test_groups(messages):
    """None stands for the message before, once more."""
    wanted = [('a', 'a'), ('a', 'of twelve'), ('b', 'b'), ('', 'a'), ('a', 'b')]
    reads = reader(DynamicInterfaceGroupValues, *(f"'{group}'/'{name}'" for group, name in wanted))
    data = serialize_message(DynamicInterfaceGroupValues())
    before = None
    for message in messages:
        data = data if message is None else serialize_message(message)
        plain = deserialize_message(data, DynamicInterfaceGroupValues)
        reading = reads.read(data)
        assert reading.stamp == plain.header.stamp.sec * 1_000_000_000
        for (group, name), said in zip(wanted, reading.values, strict=True):
            block = the_one(plain.interface_groups, plain.interface_values, group)
            value = block and the_one(block.interface_names, block.values, name)
            assert agrees(said, value), (group, name, plain)
        assert not reading.same or reading.values == before
        before = reading.values


@some
@given(st.lists(st.tuples(NAMES, st.lists(NUMBERS, max_size=5)), min_size=1, max_size=5))
def test_joints(messages):
    reads = reader(JointState, 'a/position', "''/velocity", 'position[2]')
    for names, numbers in messages:
        data = serialize_message(JointState(name=names, position=numbers, velocity=numbers[1:]))
        plain = deserialize_message(data, JointState)
        a, nameless, third = reads.read(data).values
        assert agrees(a, the_one(plain.name, plain.position, 'a'))
        assert agrees(nameless, the_one(plain.name, plain.velocity, ''))
        assert agrees(third, plain.position[2] if len(plain.position) > 2 else None)


@some
@given(
    st.lists(
        st.tuples(st.lists(st.integers(0, 4), max_size=5), st.lists(NUMBERS, max_size=3)),
        min_size=1,
        max_size=4,
    )
)
def test_structures(messages):
    """Elements of bytes alone, and elements that leave bytes between them."""
    reads = reader(IOStates, 'digital_out_states[pin=3].state', 'analog_in_states[1].state')
    for pins, analog in messages:
        message = IOStates(
            digital_in_states=[Digital(pin=9)] * len(analog),
            digital_out_states=[Digital(pin=pin, state=pin > 2) for pin in pins],
            analog_in_states=[Analog(pin=1, domain=2, state=one) for one in analog],
        )
        data = serialize_message(message)
        plain = deserialize_message(data, IOStates)
        digital, second = reads.read(data).values
        pins = [one.pin for one in plain.digital_out_states]
        states = [float(one.state) for one in plain.digital_out_states]
        assert agrees(digital, the_one(pins, states, 3))
        assert agrees(second, analog[1] if len(analog) > 1 else None)


@some
@given(st.binary(max_size=200), groups(), st.integers(0, 400))
def test_nonsense(nonsense, message, at):
    """Bytes that were overwritten say something, or are refused; they raise nothing else."""
    data = bytearray(serialize_message(message))
    data[at : at + len(nonsense)] = nonsense[: max(0, len(data) - at)]
    reads = reader(DynamicInterfaceGroupValues, 'a/b', 'interface_values[1].values[0]')
    reads.read(serialize_message(message))
    for _ in range(2):
        with suppress(Broken):
            reads.read(bytes(data))
    reading = reads.read(serialize_message(message))
    block = the_one(message.interface_groups, message.interface_values, 'a')
    assert agrees(reading.values[0], block and the_one(block.interface_names, block.values, 'b'))


@pytest.mark.parametrize('turn', range(1, 9))
def test_many_groups_of_like_names(turn):
    """More arrays of texts than are remembered, with names that begin alike."""
    names = [f'module_{number}' for number in range(100)]
    reads = reader(DynamicInterfaceGroupValues, *(f'{name}/first' for name in names[:20]))
    for count in range(3):
        order = names[turn * count :] + names[: turn * count]
        blocks = [
            InterfaceValue(
                interface_names=['status', *['x'] * (int(name[7:]) % 10), 'first'],
                values=[9.0, *[8.0] * (int(name[7:]) % 10), float(name[7:]) + count],
            )
            for name in order
        ]
        message = DynamicInterfaceGroupValues(interface_groups=order, interface_values=blocks)
        values = reads.read(serialize_message(message)).values
        assert values == [float(number + count) for number in range(20)]
