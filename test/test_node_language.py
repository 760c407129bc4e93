# SPDX-License-Identifier: Apache-2.0
"""Inputs and outputs as drivers have them, between processes: any message, any field, any QoS.

One node homes five axes, each of them wired as one kind of driver does it; the messages come from
the interfaces for tests.
"""

import math
import re
import threading

import pytest
import rclpy
import ros_harness as ros
from canopen_interfaces.msg import COData
from control_msgs.msg import DynamicInterfaceGroupValues, DynamicJointState, InterfaceValue
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool, Float64, String, UInt16
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory
from ur_msgs.msg import Digital, IOStates

LOW, HIGH, HOME = 0.0, 0.08, (0.055, 0.061)
#: Where the index of the axis `latch` is, and the first place of its switch.
PITCH, MARK = 0.01, 0.0035

SWITCHES = ('home_switch', 'positive_limit_switch', 'negative_limit_switch')


def topics(*expressions, **more):
    return {
        **{f'topics.{name}': one for name, one in zip(SWITCHES, expressions, strict=True)},
        **{f'topics.{name}': one for name, one in more.items()},
    }


IO = '/gpio_controller/gpio_states'
PARAMETERS = ros.node_parameters(
    {
        'gpio': {
            **topics(f'{IO}#EL1008/d_input.3', f'{IO}#EL1008/d_input.4', f'{IO}#EL1008/d_input.5'),
            'services.servo_on': '/gpio/power',
        },
        'ur': topics(*(f'/io_states#digital_in_states[pin={pin}].state' for pin in (3, 4, 5))),
        'can': {
            **topics(
                *(f'/can/rpdo#data[index=0x60FD,subindex=0] & {bit}' for bit in (4, 2, 1)),
                servo_enabled='/can/rpdo#data[index=0x6041] & 0x6F == 0x27',
            ),
            'switches': [*SWITCHES, 'servo_enabled'],
            'services.servo_on_true': '/can/enable',
            'services.servo_on_false': '/can/disable',
        },
        'joint': {
            **topics(
                *(f'/dynamic_joint_states#j/{name}' for name in ('home', 'plus', 'minus')),
                feedback='/dynamic_joint_states#j/position',
            ),
            'home_direction': 'Negative',
            'joint': 'j',
            'commands.servo_on': '/gpio_controller/commands#EL2008/d_output.1',
            'commands.torque_limit': '/gpio_controller/commands#j_drive/max_torque',
            'commands.no_torque_limit': 250.0,
        },
        'latch': {
            'home_type': 'HSZPulse',
            **topics(
                '/word#data & 0x04',
                '/word#data & 0x02',
                '/word#data & 0x01',
                z_pulse=f'{IO}#index/position @ index/count',
            ),
            'switches': [*SWITCHES, 'z_pulse'],
            'services.arm_latch': '/latch/arm',
        },
    }
)


class Machine:
    """The drivers of the axes; what they publish follows the positions of the plant."""

    def __init__(self, client, hand):
        self.client, self.hand = client, hand
        self._node = rclpy.create_node(
            'drivers', context=client.context, enable_rosout=False, start_parameter_services=False
        )
        #: What a test changes: applied to each message before it is published.
        self.spoil = {}
        self.latched, self.count, self.operational = 0.0, 7, True
        self._publishers, self._lock = {}, threading.Lock()
        self._before = dict(hand.positions)
        for topic, kind in (
            (IO, DynamicInterfaceGroupValues),
            ('/io_states', IOStates),
            ('/can/rpdo', COData),
            ('/dynamic_joint_states', DynamicJointState),
            ('/word', UInt16),
        ):
            self.announce(topic, kind)
        hand.also = self.publish

    def announce(self, topic, kind, spoil=lambda message: message):
        """Publish a type on a topic, and no other any more."""
        with self._lock:
            if topic in self._publishers:
                self._node.destroy_publisher(self._publishers.pop(topic))
            self._publishers[topic] = self._node.create_publisher(kind, topic, 10)
            self.spoil[topic] = spoil

    def close(self):
        self.hand.also = lambda positions, stamp: None
        self.hand.close()
        self._node.destroy_node()

    def publish(self, positions, stamp):
        before, self._before = self._before, positions
        low, high = sorted((before['latch'], positions['latch']))
        for mark in (MARK + k * PITCH for k in range(9)):
            if low < mark <= high:
                self.latched, self.count = mark, (self.count + 1) % 256
        with self._lock:
            for topic, message in self.messages(positions, stamp):
                self._publishers[topic].publish(self.spoil[topic](message))

    def messages(self, positions, stamp):
        def levels(name):
            at = positions[name]
            return HOME[0] <= at <= HOME[1], at >= HIGH, at <= LOW

        def word(name):
            home, plus, minus = levels(name)
            return 4 * home + 2 * plus + minus

        groups = DynamicInterfaceGroupValues(
            interface_groups=['index', 'EL1008'],
            interface_values=[
                InterfaceValue(
                    interface_names=['position', 'count'],
                    values=[self.latched, float(self.count)],
                ),
                InterfaceValue(
                    interface_names=[f'd_input.{i}' for i in range(1, 9)],
                    values=[0.0, 0.0, *map(float, levels('gpio')), 0.0, 0.0, 0.0],
                ),
            ],
        )
        groups.header.stamp = stamp
        yield IO, groups
        yield (
            '/io_states',
            IOStates(
                digital_in_states=[
                    Digital(pin=i, state=bool((i == 0) or (3 <= i <= 5 and levels('ur')[i - 3])))
                    for i in range(8)
                ]
            ),
        )
        yield '/can/rpdo', COData(index=0x6041, data=0x0627 if self.operational else 0x0610)
        yield '/can/rpdo', COData(index=0x60FD, data=word('can'))
        yield '/can/rpdo', COData(index=0x60FD, subindex=1, data=7)
        joints = DynamicJointState(
            joint_names=['other', 'j'],
            interface_values=[
                InterfaceValue(interface_names=['position'], values=[1.0]),
                InterfaceValue(
                    interface_names=['position', 'home', 'plus', 'minus'],
                    values=[positions['j'], *map(float, levels('j'))],
                ),
            ],
        )
        joints.header.stamp = stamp
        yield '/dynamic_joint_states', joints
        yield '/word', UInt16(data=0x100 + word('latch'))


@pytest.fixture(scope='module')
def cell(tmp_path_factory):
    """Return a node of these five axes, a client, and their machine."""
    with ros.World(tmp_path_factory.mktemp('language'), PARAMETERS) as world:
        names = ('gpio', 'ur', 'can', 'j', 'latch')
        hand = ros.HandPlant(world.client, **dict.fromkeys(names, 0.04))
        machine = Machine(world.client, hand)
        machine.log = lambda: world.node.output
        machine.calls = []

        def serve(kind, service):
            def answer(request, response):
                machine.calls.append((service, getattr(request, 'data', None)))
                response.success = True
                return response

            world.client.node.create_service(kind, service, answer)

        serve(SetBool, '/gpio/power')
        serve(Trigger, '/can/enable')
        serve(Trigger, '/can/disable')
        serve(SetBool, '/latch/arm')
        try:
            yield machine
        finally:
            machine.close()


def numbers(answer):
    assert answer.success, answer.message
    found = dict(re.findall(r'(\w+)=([-+.e\d]+)', answer.message))
    return float(found['home_position_raw']), float(found['uncertainty'])


def test_every_kind_of_message(cell):
    client = cell.client
    armed = client.record(Bool, 'latch/arm_latch', ros.LATCHED)
    answers = client.home('gpio', 'ur', 'can', 'joint', 'latch')
    for axis, edge in (('gpio', HOME[0]), ('ur', HOME[0]), ('can', HOME[0]), ('joint', HOME[1])):
        home, uncertainty = numbers(answers[axis])
        assert abs(home - edge) <= uncertainty
        assert uncertainty < 0.0005, axis  # a busy machine publishes late; test_feeds.py has none
    home, _ = numbers(answers['latch'])
    assert home == pytest.approx(MARK + 6 * PITCH)
    assert [one.message.data for one in armed] == [False, True, False]
    client.until(lambda: len([c for c in cell.calls if c[0] == '/latch/arm']) == 3)
    assert [data for name, data in cell.calls if name == '/latch/arm'] == [False, True, False]


def without(name):
    def spoil(message):
        place = message.interface_groups.index(name)
        del message.interface_groups[place], message.interface_values[place]
        return message

    return spoil


def with_twin(message):
    message.interface_groups.append('EL1008')
    message.interface_values.append(message.interface_values[1])
    return message


def with_nan(message):
    message.interface_values[1].values[2] = math.nan
    return message


def with_fewer_pins(message):
    del message.digital_in_states[4:]
    return message


def with_fewer_values(message):
    del message.interface_values[1].values[2:]
    return message


@pytest.mark.parametrize(
    ('axis', 'topic', 'spoil', 'named'),
    [
        ('gpio', IO, without('EL1008'), 'there are index'),
        ('gpio', IO, with_twin, '2 elements of interface_values have'),
        ('gpio', IO, with_nan, 'd_input.3): it is nan'),
        ('gpio', IO, with_fewer_values, 'values has 2 elements, none at'),
        ('gpio', IO, lambda _: b'\0\1\0\0' + b'\7' * (1 << 20), 'the message is no control_msgs'),
        ('ur', '/io_states', with_fewer_pins, 'there are 0, 1, 2, 3'),
        ('latch', IO, without('index'), 'z_pulse'),
    ],
    ids=['no group', 'twice', 'nan', 'fewer values', 'nonsense', 'fewer pins', 'no latch'],
)
def test_an_input_that_is_not_said_any_more_ends_a_run(cell, axis, topic, spoil, named):
    client = cell.client
    answer = client.start(axis)
    cell.spoil[topic] = spoil
    try:
        ended = client.answer(answer)
        assert ended.message.startswith('SwitchUnknown: axis '), ended.message
        assert named in ended.message
        assert f'({topic}#' in ended.message
        again = client.trigger(f'{axis}/home')
        assert again.message.startswith('SwitchUnknown: axis '), again.message
        assert named in again.message
    finally:
        cell.spoil[topic] = lambda message: message
    client.until(lambda: not client.trigger(f'{axis}/home').message.startswith('SwitchUnknown'))


def test_a_status_word_says_that_the_servo_is_off(cell):
    client = cell.client
    answer = client.start('can')
    cell.operational = False
    ended = client.answer(answer)
    assert ended.message.startswith('ServoOff: '), ended.message
    cell.operational = True


def test_a_driver_that_comes_back_with_another_type(cell):
    client = cell.client
    answer = client.start('ur')
    cell.announce('/io_states', String, lambda _: String(data='text'))
    ended = client.answer(answer)
    assert ended.message.startswith('SwitchStale: axis ur: '), ended.message
    assert 'lost its publisher' in ended.message
    told = client.until(
        lambda: (m := client.trigger('ur/home').message).startswith('InvalidParameter') and m
    )
    assert 'ur.topics.home_switch: std_msgs/String has no field digital_in_states' in told
    assert 'it has data (string)' in told
    cell.announce('/io_states', IOStates, lambda message: message)
    client.until(lambda: not client.trigger('ur/home').message.startswith('InvalidParameter'))
    numbers(client.home('ur')['ur'])


def test_servo_on_as_services_and_as_commands(cell):
    client, calls = cell.client, cell.calls
    commanded = client.record(DynamicInterfaceGroupValues, '/gpio_controller/commands')

    def commands():
        if not commanded:
            return None
        message = commanded[-1].message
        return {
            f'{group}/{name}': value
            for group, one in zip(message.interface_groups, message.interface_values, strict=True)
            for name, value in zip(one.interface_names, one.values, strict=True)
        }

    on = {'EL2008/d_output.1': 1.0, 'j_drive/max_torque': 250.0}
    client.until(lambda: commands() == on)  # who joins late is told again

    def servo_calls():
        return [call for call in calls if call[0] != '/latch/arm']

    on_calls = {('/gpio/power', True), ('/can/enable', None)}
    off_calls = {('/gpio/power', False), ('/can/disable', None)}
    client.until(lambda: on_calls <= set(servo_calls()))
    calls.clear()
    for axis in ('gpio', 'can', 'joint'):
        client.servo(axis, False)
    client.until(lambda: commands() == {**on, 'EL2008/d_output.1': 0.0})
    client.until(lambda: set(servo_calls()) == off_calls)
    for axis in ('gpio', 'can', 'joint'):
        client.servo(axis, True)
    client.until(lambda: commands() == on)
    client.until(lambda: len(servo_calls()) == 4)
    assert set(servo_calls()[2:]) == on_calls


# -- quality of service ------------------------------------------------------------------------


OFFERS = {
    'lossy': QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),
    'kept': QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
}


def test_the_node_hears_whatever_its_publishers_offer(tmp_path):
    """Cases 10 and 11; what a user overrides stays, and is named where it does not fit."""
    wired = {'switches': ['home_switch'], 'home_type': 'HS'}
    parameters = ros.node_parameters(
        {
            'lossy': {**wired, 'topics.home_switch': '/lossy'},
            'kept': {**wired, 'topics.home_switch': '/kept'},
            'strict': {**wired, 'topics.home_switch': '/strict'},
            'number': {**wired, 'topics.home_switch': '/number'},
        },
        qos_overrides={'/strict': {'subscription': {'reliability': 'reliable'}}},
    )
    with ros.World(tmp_path, parameters) as world:
        client, node = world.client, world.client.node
        hand = ros.HandPlant(client, lossy=0.05, kept=0.05, strict=0.05, number=0.05)
        try:
            lossy = node.create_publisher(Bool, '/lossy', OFFERS['lossy'])
            kept = node.create_publisher(Bool, '/kept', OFFERS['kept'])
            node.create_publisher(Bool, '/strict', OFFERS['lossy'])
            number = node.create_publisher(Float64, '/number', OFFERS['kept'])
            stop = node.create_publisher(Bool, 'homing_node/emergency_stop', OFFERS['kept'])
            stop.publish(Bool(data=True))
            kept.publish(Bool(data=False))  # once, before the node listens
            number.publish(Float64(data=0.49))

            def told(axis, word):
                lossy.publish(Bool(data=False))
                message = client.trigger(f'{axis}/home').message
                return message if word in message else ''

            for axis in ('lossy', 'kept', 'number'):
                client.until(lambda axis=axis: told(axis, 'EmergencyStop: '), what=axis)
            refusal = client.until(lambda: told('strict', 'SwitchUnknown: '))
            client.until(lambda: told('strict', 'offers best_effort, volatile'))
            refusal = client.trigger('strict/home').message
            assert '/client offers best_effort, volatile' in refusal
            assert 'the node asks for reliable, volatile (qos_overrides)' in refusal
            stop.publish(Bool(data=False))
            lossy_stop = node.create_publisher(Bool, 'homing_node/emergency_stop', OFFERS['lossy'])
            setpoints = client.record(JointTrajectory, 'setpoints')
            answer = client.start('lossy')
            client.until(lambda: setpoints)
            client.until(
                lambda: lossy_stop.publish(Bool(data=True)) or answer.done(), what='a stop'
            )
            assert answer.result().message.startswith('EmergencyStop: ')
        finally:
            hand.close()
