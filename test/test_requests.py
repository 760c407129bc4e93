# SPDX-License-Identifier: Apache-2.0
"""Requests of a service of any type: the text with its values, the message, and the answer."""

import pytest
from homing_interfaces.srv import SetPosition
from rcl_interfaces.msg import ParameterValue
from rcl_interfaces.msg import SetParametersResult as One
from rcl_interfaces.srv import SetParameters
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from homing_node.parameters.applying import VALUES, filled
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.definition import InvalidParameters
from homing_node.ros import requests

GIVEN = {**dict.fromkeys(VALUES, 0.25), 'home_offset': -1e-7, 'axis': 'x', 'joint': 'x_joint'}


@pytest.mark.parametrize(
    ('text', 'fields'),
    [
        ('', {}),
        ('{position: {position}}', {'position': 0.25}),
        ('{data: {-position}}', {'data': -0.25}),
        ('{data: { position * 1e6 }, n: {position/2}}', {'data': 250000.0, 'n': 0.125}),
        ('a: {home_offset}\nb: "{axis}.home_offset"', {'a': -1e-7, 'b': 'x.home_offset'}),
        ('{name: {joint}, index: 0x607C}', {'name': 'x_joint', 'index': 0x607C}),
    ],
)
def test_values_take_their_places(text, fields):
    assert filled(text, GIVEN) == fields


@pytest.mark.parametrize('value', [0.1, 1 / 3, -1e-17, 12345678.9, 1e22, 5e-324])
def test_a_value_keeps_every_bit(value):
    assert filled('{data: {position}}', {**GIVEN, 'position': value}) == {'data': value}


@pytest.mark.parametrize(
    ('text', 'why'),
    [
        ('{data: {homeoffset}}', "none of position, .* did you mean 'home_offset'"),
        ('{data: {axis * 2}}', 'is a text'),
        ('{data: {position / 0}}', 'the factor is 0'),
        ('[{position}]', 'not a mapping'),
        ('{data: [}', 'not YAML'),
        ('{3: {position}}', 'not a mapping'),
    ],
)
def test_a_bad_text_is_refused_with_the_reason(text, why):
    with pytest.raises(ValueError, match=why):
        filled(text, GIVEN)
    values = {'home_type': 'HS', 'travel': 0.5, 'apply': 'service'}
    service = {'apply_service': '/s', 'apply_type': 'a/srv/B', 'apply_request': text}
    with pytest.raises(InvalidParameters, match=f'x.apply_request: .*{why}'):
        axis_parameters({**values, **service}, 'x')


def test_messages_are_filled_by_the_types_of_their_fields():
    request = requests.filled(SetPosition.Request(), {'position': 1})
    assert request.position == 1.0
    value = {'type': 3, 'double_value': 0.5}
    listed = {'parameters': [{'name': 'x.home_offset', 'value': value}]}
    (one,) = requests.filled(SetParameters.Request(), listed).parameters
    assert (one.name, one.value.type, one.value.double_value) == ('x.home_offset', 3, 0.5)
    message = requests.filled(
        JointState(), {'position': [1, 2], 'header': {'stamp': {'sec': 2.4}}}
    )
    assert list(message.position) == [1.0, 2.0]
    assert message.header.stamp.sec == 2
    # an unsigned field takes a negative count as a drive's object does
    assert requests.filled(ParameterValue(), {'type': -1}).type == 255


@pytest.mark.parametrize(
    ('fields', 'why'),
    [
        ({'positon': 1.0}, 'positon: no such field; there are position'),
        ({'position': 'a'}, "position: 'a' does not fit double"),
        ({'position': True}, 'does not fit double'),
        ({'position': [1.0]}, 'does not fit double'),
    ],
)
def test_what_does_not_fit_is_named(fields, why):
    with pytest.raises(ValueError, match=why):
        requests.filled(SetPosition.Request(), fields)
    for wrong in ({'data': 1}, {'data': 'yes'}):
        with pytest.raises(ValueError, match='does not fit boolean'):
            requests.filled(SetBool.Request(), wrong)
    for wrong in ({'type': 256}, {'type': -129}, {'integer_value': 2**63}):
        with pytest.raises(ValueError, match='does not fit'):
            requests.filled(ParameterValue(), wrong)


def test_types_are_found_by_their_names():
    assert requests.service_type('std_srvs/srv/Trigger') is Trigger
    for name in ('std_srvs/srv/Nothing', 'nothing/srv/Trigger', 'std_srvs'):
        with pytest.raises(ValueError, match='is no type of a service that is installed here'):
            requests.service_type(name)


@pytest.mark.parametrize(
    ('answer', 'says'),
    [
        (Trigger.Response(success=True), (True, '')),
        (Trigger.Response(success=False, message='it moves'), (False, 'it moves')),
        (SetParameters.Response(results=[One(successful=True)]), (True, '')),
        (
            SetParameters.Response(
                results=[One(successful=True), One(successful=False, reason='no')]
            ),
            (False, 'no'),
        ),
        (SetParameters.Response(), (True, '')),
        (JointState(), (True, '')),
    ],
)
def test_what_an_answer_says(answer, says):
    assert requests.verdict(answer) == says


def test_what_contradicts_itself_is_refused():
    plain = {'home_type': 'HS', 'travel': 0.5}
    for values, text in (
        ({'apply': 'service'}, 'apply_service: required, but not set (apply is service)'),
        ({'apply': 'service', 'apply_service': '/s'}, 'apply_type: required, but not set'),
        ({'apply_service': '/s'}, "apply_service: '/s' has no effect with apply: none"),
        ({'apply': 'relay', 'apply_type': 'a/srv/B'}, 'has no effect with apply: relay'),
        ({'apply': 'service', 'apply_type': 'Trigger'}, "'Trigger' is not a type of a service"),
        ({'apply': 'service', 'rehome': True}, 'rehome: True cannot be with apply: service'),
        ({'apply': 'service', 'restore': 'trust'}, 'restore: trust cannot be with apply'),
        ({'travel_min': 0.2}, 'travel_min: 0.2 m must be <= travel_max, 0 m'),
        ({'switch_controllers': ['a', 'a']}, 'a name is empty or stands twice'),
    ):
        with pytest.raises(InvalidParameters) as raised:
            axis_parameters({**plain, **values}, 'x')
        assert any(text in fault for fault in raised.value.faults), raised.value.faults
    assert axis_parameters({**plain, 'apply': 'relay', 'apply_service': 'other'}).apply == 'relay'
