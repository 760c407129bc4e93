# SPDX-License-Identifier: Apache-2.0
"""What an axis is connected to, as parameters; and which subscription fits the publishers."""

import pytest

from homing_node.diagnosis.facts import Endpoint
from homing_node.parameters.connections import Calls, Command, Output, connections
from homing_node.ros.adapting import Asked, adapted, mismatch

BOOL, WORD = 'std_msgs/msg/Bool', 'std_msgs/msg/UInt16'


def test_connections_are_read():
    found, faults = connections(
        {
            'topics.home_switch': '/io#data[3]',
            'topics.feedback': '/d#j/position',
            'types.home_switch': 'std_msgs/Int8MultiArray',
            'commands.servo_on': '/c/commands#EL2008/d_output.1',
            'services.arm_latch_true': '/x/arm',
            'services.arm_latch_false': '/x/disarm',
            'services.servo_on': '~/power',
            'topics.z_pulse': '',
            'home_type': 'HS',
        }
    )
    assert not faults
    assert str(found.source('x', 'home_switch')) == '/io#data[3]'
    assert str(found.source('x', 'z_pulse')) == '~/x/z_pulse'
    assert found.types == {'home_switch': 'std_msgs/msg/Int8MultiArray'}
    assert found.commands == {Output.SERVO_ON: Command('/c/commands', 'EL2008', 'd_output.1')}
    assert found.calls == {
        Output.SERVO_ON: Calls(set='~/power'),
        Output.ARM_LATCH: Calls(true='/x/arm', false='/x/disarm'),
    }


@pytest.mark.parametrize(
    ('name', 'value', 'wrong'),
    [
        ('topics.home_switch', '/a b#data', "'/a b' is not the name of a topic"),
        ('topics.home_switch', '#data', "'' is not the name of a topic"),
        ('topics.home_switch', '/a#data[', "'data[': an index, or a field"),
        ('topics.home_switch', '/a#x/y @ x/z', 'home_switch has no latches'),
        ('topics.feedback', '/a#data & 4', 'data & 0x04 is on or off, feedback is a position'),
        ('topics.z_pulse', '/a#data == 4 @ n', 'is on or off, z_pulse is a position'),
        ('topics.home_switch', 5, '5 is not a string'),
        ('types.home_switch', 'Bool', "'Bool' is not the name of a message type"),
        ('types.feedback', 'std_msgs.Bool', 'such as std_msgs/msg/Bool'),
        ('commands.servo_on', '/c/commands', "is not a topic, '#' and group/interface"),
        ('commands.servo_on', '/c#data[2]', "is not a topic, '#' and group/interface"),
        ('commands.servo_on', '/c#a/b & 1', "is not a topic, '#' and group/interface"),
        ('commands.servo_on', '/c#a/', 'the name of an interface is expected'),
        ('commands.torque_limit', '/c#a/b', 'commands.no_torque_limit: required'),
        ('services.servo_on', '/a b', 'is not the name of a service'),
        ('services.servo', '/a', None),
    ],
)
def test_connections_that_are_wrong(name, value, wrong):
    _, faults = connections({name: value}, 'x')
    if wrong is None:  # a name of something else
        assert faults == []
        return
    (fault,) = faults
    assert fault.startswith('x.')
    assert wrong in fault


def offer(kind=BOOL, reliable=True, latched=False, definition='a'):
    return Endpoint('/driver', kind, reliable, latched, definition)


@pytest.mark.parametrize(
    ('offers', 'asked'),
    [
        ([offer()], Asked(BOOL)),
        ([offer(reliable=False)], Asked(BOOL, reliable=False)),
        ([offer(latched=True)], Asked(BOOL, latched=True)),
        ([offer(latched=True), offer()], Asked(BOOL)),
        ([offer(reliable=False), offer()], Asked(BOOL, reliable=False)),
        ([offer(WORD)], Asked(WORD)),
        ([offer(WORD, reliable=False), offer()], Asked(BOOL)),
    ],
)
def test_the_subscription_that_fits(offers, asked):
    assert adapted(offers, Asked(BOOL), told=False, reliable=True) == asked


def test_feedback_may_be_lost():
    assert not adapted([offer()], Asked(BOOL), told=False, reliable=False).reliable


def test_types_that_do_not_fit():
    told = adapted([offer(WORD)], Asked(BOOL), told=True, reliable=True)
    assert told == (
        '/driver publishes std_msgs/msg/UInt16, and not std_msgs/msg/Bool, which the parameter in '
        'types says'
    )
    two = adapted([offer(WORD), offer(BOOL)], Asked(''), told=False, reliable=True)
    assert 'which type is it? tell it in types' in two


@pytest.mark.parametrize(
    ('one', 'own', 'why'),
    [
        (offer(), offer(), ''),
        (offer(reliable=False), offer(reliable=False), ''),
        (offer(latched=True), offer(), ''),
        (offer(reliable=False), offer(), 'offers best_effort, volatile, and the node asks for'),
        (offer(), offer(latched=True), 'asks for reliable, transient_local (qos_overrides)'),
        (offer(definition='b'), offer(), 'with other fields than the one that is installed here'),
        (offer(definition=''), offer(), ''),
        (offer(WORD, reliable=False), offer(), ''),
    ],
)
def test_what_does_not_reach_the_node(one, own, why):
    found = mismatch([one], own)
    assert why in found
    assert bool(found) == bool(why)
