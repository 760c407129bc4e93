# SPDX-License-Identifier: Apache-2.0
"""The language of inputs: what is written, what fits a type, and what messages then say."""

import random
import struct
from math import floor, inf, nan

import pytest

from homing_node.language.cdr import MOST_ELEMENTS
from homing_node.language.expression import BadExpression, parse
from homing_node.language.layout import layout_of
from homing_node.language.reader import NOT_MINE, Broken, Missing, Reader
from homing_node.language.resolve import bind

#: The fields of the types that drivers publish, as ROS tells them.
TYPES = {
    'builtin_interfaces/Time': {'sec': 'int32', 'nanosec': 'uint32'},
    'std_msgs/Header': {'stamp': 'builtin_interfaces/Time', 'frame_id': 'string'},
    'std_msgs/Bool': {'data': 'boolean'},
    'std_msgs/UInt16': {'data': 'uint16'},
    'std_msgs/Int8': {'data': 'int8'},
    'std_msgs/String': {'data': 'string'},
    'std_msgs/MultiArrayDimension': {'label': 'string', 'size': 'uint32', 'stride': 'uint32'},
    'std_msgs/MultiArrayLayout': {
        'dim': 'sequence<std_msgs/MultiArrayDimension>',
        'data_offset': 'uint32',
    },
    'std_msgs/Int32MultiArray': {
        'layout': 'std_msgs/MultiArrayLayout',
        'data': 'sequence<int32>',
    },
    'control_msgs/InterfaceValue': {
        'interface_names': 'sequence<string>',
        'values': 'sequence<double>',
    },
    'control_msgs/DynamicInterfaceGroupValues': {
        'header': 'std_msgs/Header',
        'interface_groups': 'sequence<string>',
        'interface_values': 'sequence<control_msgs/InterfaceValue>',
    },
    'control_msgs/DynamicJointState': {
        'header': 'std_msgs/Header',
        'joint_names': 'sequence<string>',
        'interface_values': 'sequence<control_msgs/InterfaceValue>',
    },
    'sensor_msgs/JointState': {
        'header': 'std_msgs/Header',
        'name': 'sequence<string>',
        'position': 'sequence<double>',
        'velocity': 'sequence<double>',
        'effort': 'sequence<double>',
    },
    'ur_msgs/Digital': {'pin': 'uint8', 'state': 'boolean'},
    'ur_msgs/Analog': {'pin': 'uint8', 'domain': 'uint8', 'state': 'float'},
    'ur_msgs/IOStates': {
        'digital_in_states': 'sequence<ur_msgs/Digital>',
        'digital_out_states': 'sequence<ur_msgs/Digital>',
        'flag_states': 'sequence<ur_msgs/Digital>',
        'analog_in_states': 'sequence<ur_msgs/Analog>',
        'analog_out_states': 'sequence<ur_msgs/Analog>',
    },
    'canopen_interfaces/COData': {'index': 'uint16', 'subindex': 'uint8', 'data': 'uint32'},
    'plc/Report': {
        'header': 'std_msgs/Header',
        'names': 'sequence<string>',
        'kinds': 'sequence<string, 8>',
        'values': 'sequence<double>',
    },
    'drive/Empty': {},
    'drive/Latch': {'position': 'double', 'count': 'uint8'},
    'drive/State': {
        'nothing': 'drive/Empty',
        'ids': 'int16[3]',
        'index': 'drive/Latch',
        'levels': 'boolean[3]',
        'name': 'string<8>',
        'status': 'uint16',
    },
    'drive/Wide': {'name': 'wstring', 'level': 'boolean'},
}

CODES = {
    'boolean': '?', 'uint8': 'B', 'int8': 'b', 'uint16': 'H', 'int16': 'h', 'uint32': 'I',
    'int32': 'i', 'float': 'f', 'double': 'd',
}  # fmt: skip


def layout(kind):
    return layout_of(kind, TYPES.__getitem__)


class Written:
    """A message that is written by hand, byte by byte; alignment leaves bytes of anything."""

    def __init__(self, order, seed=0):
        self.data = bytearray(b'\0\1\0\0' if order == '<' else b'\0\0\0\0')
        self._order, self._random = order, random.Random(seed)

    def number(self, code, value):
        while (len(self.data) - 4) % struct.calcsize(code):
            self.data.append(self._random.randrange(256))
        self.data += struct.pack(self._order + code, value)

    def write(self, kind, value):
        if kind in CODES:
            self.number(CODES[kind], value)
        elif kind.startswith('string'):
            text = value.encode() + b'\0'
            self.number('I', len(text))
            self.data += text
        elif kind.startswith('sequence'):
            self.number('I', len(value))
            for one in value:
                self.write(kind[9:-1].partition(',')[0], one)
        elif kind.endswith(']'):
            for one in value:
                self.write(kind.partition('[')[0], one)
        elif not TYPES[kind]:
            self.data += b'\0'
        else:
            for field, one in zip(TYPES[kind].values(), value, strict=True):
                self.write(field, one)


def message(kind, *fields, order='<', seed=0):
    written = Written(order, seed)
    written.write(kind, fields)
    return bytes(written.data)


def header(stamp=0.0):
    return (floor(stamp), round(stamp % 1 * 1e9)), 'frame'


def reader(kind, *expressions):
    return Reader(layout(kind), [bind(parse(f'/t{one}'), layout(kind)) for one in expressions])


def said(kind, expression, data):
    """Return what a message says of one input."""
    return reader(kind, expression).read(data).values[0]


REPORT = [header(), ['p', 'p', 'q'], ['r', 'b', 'b'], [1.5, 2.5, 3.5]]
DRIVE = [(), [1, -2, 3], (0.5, 7), [0, 1, 0], 'abc', 9]
GROUPS = 'control_msgs/DynamicInterfaceGroupValues'
STATES = 'ur_msgs/IOStates'


def groups(names, values, stamp=5.25, **how):
    return message(GROUPS, header(stamp), names, values, **how)


def pins(*pairs):
    return [list(pairs), [(1, True)], [], [], []]


# -- what is written ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('text', 'canonical'),
    [
        ('/io/din3', '/io/din3'),
        ('/io/din3#data', '/io/din3'),
        ('/g#EL1008/d_input.3', '/g#EL1008/d_input.3'),
        ('/g# EL1008 / d_input.3 ', '/g#EL1008/d_input.3'),
        ("/g#'rack 1/EL1008'/d_input.3", "/g#'rack 1/EL1008'/d_input.3"),
        ('/g#rack/EL1008/d_input.3', "/g#'rack/EL1008'/d_input.3"),
        ('/g#x/"it\'s"', '/g#x/"it\'s"'),
        ('/d#data&4', '/d#data & 0x04'),
        ('/d#data & 0b100', '/d#data & 0x04'),
        ('/d#data & 0x6f==0x27', '/d#data & 0x6F == 0x27'),
        ('/p#data[ 3 ]', '/p#data[3]'),
        ('/u#digital_in_states[pin = 3].state', '/u#digital_in_states[pin=3].state'),
        ('/c#data[index=0x60FD, subindex=0] & 0x04', '/c#data[index=0x60FD,subindex=0] & 0x04'),
        ("/n#values[names='a]b'].x", "/n#values[names='a]b'].x"),
        ('/l#index.position@index.count', '/l#index.position @ index.count'),
        ('/l#a/pos @ a/status & 4', '/l#a/pos @ a/status & 0x04'),
    ],
)
def test_what_is_written(text, canonical):
    assert str(parse(text)) == canonical
    assert parse(canonical).expression == parse(text).expression


@pytest.mark.parametrize(
    ('expression', 'wrong'),
    [
        ('', 'the name of a field is expected at the end'),
        ('1', "the name of a field is expected before '1'"),
        ('a b', "'&', '==' or '@' is expected before 'b'"),
        ('data[3', "']' is expected at the end"),
        ('data[]', 'an index, or a field and its value such as pin=3, is expected'),
        ('data[-1]', 'the index -1 must be >= 0'),
        ('data[pin]', "'=' and a value are expected behind pin before ']'"),
        ('data[pin=]', "the value of pin is expected before ']'"),
        ('data[0x]', "'0x' is no integer"),
        ("data[name='a]", "the quote ' is not closed"),
        ('data[1][2]', "is expected before '[2]'"),
        ('data &', 'a mask, such as 0x04, is expected at the end'),
        ('data & x', "a mask, such as 0x04, is expected before 'x'"),
        ('data & 0', 'the mask 0 must be > 0'),
        ('data & 0x6F == 0x80', '0x80 has bits that the mask 0x6f has not'),
        ('data == ', 'a number is expected at the end'),
        ('data = 3', "is expected before '= 3'"),
        ('data.', 'the name of a field is expected at the end'),
        ('a @', 'the name of a field is expected at the end'),
        ('a @ b @ c', "is expected before '@ c'"),
        ('/x', "the name of a group is expected before '/x'"),
        ('x/', 'the name of an interface is expected at the end'),
        ('a#b', "is expected before '#b'"),
    ],
)
def test_what_is_written_wrongly(expression, wrong):
    with pytest.raises(BadExpression) as caught:
        parse(f'/t#{expression}')
    assert wrong in str(caught.value)
    assert str(caught.value).startswith(repr(expression.strip()))


# -- what fits a type -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('kind', 'expression', 'wrong'),
    [
        (STATES, '', 'ur_msgs/IOStates has no field data: write what is the input behind a'),
        (STATES, '#digital_in_states', 'is an array: which element? digital_in_states[0], say'),
        (STATES, '#digital_in_states[0]', 'which field? pin (uint8), state (boolean)'),
        (STATES, '#digital_in_state[0].state', 'did you mean digital_in_states?'),
        (
            STATES,
            '#digital_in_state[0].state',
            'it has digital_in_states (sequence<',
        ),
        (STATES, '#digital_in_states[0].stat', 'ur_msgs/Digital has no field stat; it has pin'),
        (STATES, '#digital_in_states[pn=3].state', 'ur_msgs/Digital has no field pn; it has pin'),
        (STATES, '#digital_in_states[pin=x].state', 'pin=x: pin is an integer (uint8)'),
        (STATES, '#digital_in_states[pin=256].state', 'pin=256: pin (uint8) is 0 to 255'),
        (
            STATES,
            '#analog_in_states[state=1].pin',
            'state (float) is neither an integer nor a text',
        ),
        (STATES, '#digital_in_states[pin=3].state.x', 'state (boolean) has no fields, so no x'),
        (STATES, '#EL1008/d_input.3', 'has no groups or joints by name, so no EL1008/d_input.3'),
        ('std_msgs/String', '', 'data is text, a number is expected'),
        ('std_msgs/String', '#data & 1', 'data is text, a number is expected'),
        ('std_msgs/UInt16', '#data[0]', 'data (uint16) is no array, so no data[0]'),
        ('std_msgs/UInt16', '#data & 0x10000', 'has bits beyond data (uint16)'),
        ('std_msgs/Bool', '#data & 2', 'has bits beyond data (boolean)'),
        ('drive/State', '#ids[3]', 'ids (int16[3]) has the elements 0 to 2, not 3'),
        ('drive/State', '#status[ids=3]', 'ids is an array, but status is none'),
        ('drive/Wide', '#level', 'name (wstring) of drive/Wide cannot be read'),
        ('sensor_msgs/JointState', '#x/angle', "has no 'angle' of 'x', only position, velocity"),
        ('plc/Report', '#x/y', 'no groups or joints by name'),
    ],
)
def test_what_does_not_fit_the_type(kind, expression, wrong):
    with pytest.raises(BadExpression) as caught:
        bind(parse(f'/t{expression}'), layout(kind))
    assert wrong in str(caught.value)


def test_a_type_that_is_not_installed():
    with pytest.raises(BadExpression, match='the type no/msg/Such is not installed here: no/Such'):
        layout('no/msg/Such')


# -- what is said ---------------------------------------------------------------------------------


@pytest.mark.parametrize('order', '<>')
@pytest.mark.parametrize(
    ('kind', 'fields', 'expression', 'value'),
    [
        ('std_msgs/Bool', [True], '', 1),
        ('std_msgs/UInt16', [0x0104], '#data & 0x04', 4),
        ('std_msgs/UInt16', [0x0227], '#data & 0x6F == 0x27', True),
        ('std_msgs/UInt16', [0x0207], '#data & 0x6F == 0x27', False),
        ('std_msgs/UInt16', [3], '#data == 3', True),
        ('std_msgs/Int8', [-1], '#data & 0x80', 0x80),
        ('std_msgs/Int32MultiArray', [([('n', 1, 1)], 0), [5, 6, -7]], '#data[2]', -7),
        ('std_msgs/Int32MultiArray', [([], 0), [5, 6, -7]], '#data[1]', 6),
        (STATES, pins((2, False), (3, True)), '#digital_in_states[pin=3].state', 1),
        (STATES, pins((3, False), (2, True)), '#digital_in_states[pin=3].state', 0),
        (STATES, [[], [], [], [(9, 1, 2.5)], []], '#analog_in_states[pin=9].state', 2.5),
        ('canopen_interfaces/COData', [0x60FD, 0, 4], '#data[index=0x60FD,subindex=0] & 4', 4),
        ('canopen_interfaces/COData', [0x6041, 0, 4], '#data[index=0x60FD] & 4', NOT_MINE),
        ('canopen_interfaces/COData', [0x60FD, 1, 4], '#data[index=0x60FD,subindex=0]', NOT_MINE),
        ('sensor_msgs/JointState', [header(), ['a', 'b'], [1.0, 2.0], [], []], '#b/position', 2.0),
        ('sensor_msgs/JointState', [header(), ['a'], [], [], [3.0]], '#effort[name=a]', 3.0),
        ('plc/Report', REPORT, '#values[names=q]', 3.5),
        ('plc/Report', REPORT, '#values[names=p,kinds=b]', 2.5),
        ('drive/State', DRIVE, '#ids[1]', -2),
        ('drive/State', DRIVE, '#levels[1]', 1),
        ('drive/State', DRIVE, '#levels[ids=-2]', 1),
        ('drive/State', DRIVE, '#status', 9),
        ('drive/State', DRIVE, '#status[name=abc]', 9),
        ('drive/State', [*DRIVE[:-2], 'ab', 9], '#status[name=abc]', NOT_MINE),
    ],
)  # fmt: skip
def test_what_a_message_says(kind, fields, expression, value, order):
    data = message(kind, *fields, order=order)
    assert said(kind, expression, data) == value


GPIO = groups(['EL1008', 'x'], [(['d_input.3', 'd_input.4'], [1.0, 0.0]), (['word'], [5.0])])


@pytest.mark.parametrize(
    ('expression', 'value'),
    [
        ('#EL1008/d_input.3', 1.0),
        ('#EL1008/d_input.4', 0.0),
        ('#x/word & 0x04', 4),
        ('#x/word & 0x02', 0),
        ("#interface_values[interface_groups=x].values[interface_names='word']", 5.0),
        ('#interface_values[1].values[0]', 5.0),
    ],
)
def test_groups(expression, value):
    assert said(GROUPS, expression, GPIO) == value


@pytest.mark.parametrize(
    ('expression', 'data', 'why'),
    [
        ('#EL1/d', GPIO, 'no element of interface_values has interface_groups='),
        ('#EL1/d', GPIO, 'there are EL1008, x'),
        ('#x/d', GPIO, 'there are word'),
        ('#interface_values[2].values[0]', GPIO, 'interface_values has 2 elements, none at 2'),
        ('#x/w', groups(['x', 'x'], [(['w'], [1.0]), (['w'], [1.0])]), '2 elements of interface'),
        ('#x/w', groups(['x'], [(['w', 'w'], [1.0, 0.0])]), '2 elements of values have'),
        ('#x/w', groups(['x'], [(['v', 'w'], [1.0])]), 'values has 1 elements, none at 1'),
        ('#x/w', groups(['x'], []), 'interface_values has 0 elements, none at 0'),
        ('#x/w', groups([], []), 'there are none'),
        ('#x/w', groups(['x'], [(['w'], [nan])]), 'it is nan'),
        ('#x/w', groups(['x'], [(['w'], [-inf])]), 'it is -inf'),
        ('#x/w & 1', groups(['x'], [(['w'], [0.5])]), '0.5 has no bits'),
        ('#x/w & 1', groups(['x'], [(['w'], [nan])]), 'it is nan'),
        ('#x/w', groups([f'g{i}' for i in range(20)], []), 'g11, ...'),
    ],
)
def test_what_a_message_does_not_say(expression, data, why):
    found = said(GROUPS, expression, data)
    assert isinstance(found, Missing)
    assert why in found.text


def test_a_key_that_stands_nowhere_or_twice():
    def state(*pairs):
        return said(STATES, '#digital_in_states[pin=3].state', message(STATES, *pins(*pairs)))

    assert state((3, True), (4, False)) == 1
    assert 'there are 2, 4' in state((2, True), (4, False)).text
    assert '2 elements of digital_in_states have pin=3' in state((3, True), (3, False)).text


def test_the_stamp_is_the_header_s():
    read = reader(GROUPS, '#x/word').read
    assert read(groups(['x'], [(['word'], [1.0])], 7.5)).stamp == 7_500_000_000
    assert read(groups(['x'], [(['word'], [1.0])], -1.5)).stamp == -1_500_000_000
    assert reader('std_msgs/Bool', '').read(message('std_msgs/Bool', True)).stamp == 0


def test_a_latch_and_its_counter():
    read = reader('drive/State', '#index.position @ index.count', '#levels[0]').read
    reading = read(message('drive/State', (), [1, 2, 3], (0.125, 7), [1, 0, 0], '', 0))
    assert (reading.values, reading.counters) == ([0.125, 1], [7, None])


# -- message to message ---------------------------------------------------------------------------


def gpio(order, level, stamp, seed=0, byte_order='<'):
    """Return a message with groups in an order, and the level of one interface."""
    values = {'a': (['v'], [7.0]), 'b': (['v', 'w'], [0.0, level]), 'c': ([], [])}
    return groups(list(order), [values[one] for one in order], stamp, order=byte_order, seed=seed)


def test_messages_of_many_shapes_in_any_order():
    """Groups in another order, arrays that grow and shrink, both byte orders, any alignment."""
    read = reader(GROUPS, '#b/w', '#a/v').read
    choice = random.Random(1)
    for number in range(400):
        order = choice.sample('abc', choice.randint(1, 3))
        level = float(choice.randint(0, 1))
        data = gpio(order, level, number, number, choice.choice('<>'))
        w, v = read(data).values
        assert w == level if 'b' in order else isinstance(w, Missing)
        assert v == 7.0 if 'a' in order else isinstance(v, Missing)


def test_a_message_that_says_the_same_is_known():
    reads = reader(GROUPS, '#b/w')
    assert not reads.read(gpio('ab', 0.0, 1)).same
    for seed in (1, 1, 9):  # the same bytes, and others between what is aligned
        reading = reads.read(gpio('ab', 0.0, 2.5, seed))
        assert reading == (2_500_000_000, [0.0], [None], True)
    assert reads.read(gpio('ab', 1.0, 4)) == (4_000_000_000, [1.0], [None], False)
    assert reads.read(gpio('ba', 1.0, 5)).same
    assert not reads.read(gpio('ba', 0.0, 5)).same
    assert reads.read(gpio('ba', 0.0, 6, 0, '>')) == (6_000_000_000, [0.0], [None], True)
    assert reads.read(gpio('ba', 0.0, 7, 0, '>')) == (7_000_000_000, [0.0], [None], True)
    reads.forget()
    assert not reads.read(gpio('ba', 0.0, 8, 0, '>')).same


def test_a_message_without_a_stamp_that_says_the_same_is_known():
    reads = reader('std_msgs/UInt16', '#data & 4')
    assert [reads.read(message('std_msgs/UInt16', value)).same for value in (4, 4, 5, 1, 1)] == [
        False,
        True,
        False,
        False,
        True,
    ]
    with pytest.raises(Broken):
        reads.read(message('std_msgs/UInt16', 1)[:-1])


def test_a_broken_message_says_nothing():
    reads = reader(GROUPS, '#b/w')
    data = gpio('ab', 1.0, 1)
    for length in range(len(data)):
        with pytest.raises(Broken):
            reads.read(data[:length])
    for _ in range(3):
        assert reads.read(data).values == [1.0]
    for length in range(len(data)):  # nor when its texts are known
        with pytest.raises(Broken):
            reads.read(data[:length])


@pytest.mark.parametrize('seed', range(4))
def test_a_megabyte_of_nonsense_is_given_up_soon(seed, monkeypatch):
    """Whatever the bytes claim, no more elements are walked than a message may have."""
    noise = random.Random(seed)
    nonsense = {
        0: noise.randbytes(1 << 20),
        1: bytes(1 << 20),
        2: b'\xff' * (1 << 20),
        3: struct.pack('<iII4xI', 0, 0, 1, 1 << 18) + bytes(1 << 20),
    }[seed]
    for expression in ('#b/w', '#interface_values[3].values[2]'):
        try:
            values = reader(GROUPS, expression).read(b'\0\1\0\0' + nonsense).values
        except Broken:
            continue
        assert isinstance(values[0], Missing)


def test_the_walk_is_bounded():
    names = [''] * (MOST_ELEMENTS + 1)
    with pytest.raises(Broken, match='more than 8192 elements'):
        reader(GROUPS, '#b/w').read(groups(names, []))


def test_other_encodings_are_refused():
    with pytest.raises(Broken, match='the encoding 0007 is not plain CDR'):
        reader('std_msgs/Bool', '').read(b'\0\7\0\0\1')
