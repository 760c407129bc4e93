# SPDX-License-Identifier: Apache-2.0
"""All parameters of the node: names, values, faults."""

import pytest

from homing_node.language.expression import Source
from homing_node.parameters.axis import DEFINITIONS
from homing_node.parameters.configuration import (
    AXIS_DEFINITIONS,
    check_axis_values,
    check_node_value,
    configuration,
    home_sequence,
)
from homing_node.parameters.connections import Connections
from homing_node.parameters.definition import InvalidParameters
from homing_node.parameters.node_fields import NODE_DEFINITIONS, RESERVED, SetpointInterface
from homing_node.procedures.states import HomeType, Input

QOS = 'qos_overrides./homing_node/x/home_switch.subscription'
AXIS = {'home_type': 'HS', 'travel': 0.2}


def flat(**changes):
    """Return the parameters of one axis `x`; `__` stands for the point, None leaves one out."""
    values = {'axes': ['x'], 'x.home_type': 'HS', 'x.travel': 0.2}
    values.update({name.replace('__', '.'): value for name, value in changes.items()})
    return {name: value for name, value in values.items() if value is not None}


def faults(values):
    with pytest.raises(InvalidParameters) as caught:
        configuration(values)
    return caught.value.faults


def test_defaults():
    checked = configuration(flat())
    assert checked.update_rate == 250.0
    assert checked.cycle_timeout == 0.2
    assert checked.setpoint_interface is SetpointInterface.trajectory
    assert checked.home_sequence == (('x',),)
    assert checked.axes['x'].home_type is HomeType.HS
    assert checked.joints == {'x': 'x'}
    assert checked.connections == {'x': Connections()}


def test_everything_set():
    checked = configuration(
        {
            'axes': ['z', 'a_1'],
            'update_rate': 500,
            'cycle_timeout': 1,
            'setpoint_interface': 'position',
            'home_sequence': ['a_1', 'z'],
            'z.home_type': 'HSHS',
            'z.travel': 1,
            'z.joint': 'joint_z',
            'z.topics.home_switch': '/io/z',
            'a_1.home_type': 'LS',
            'a_1.travel': 0.5,
        }
    )
    assert list(checked.axes) == ['z', 'a_1']
    assert checked.update_rate == 500.0
    assert isinstance(checked.update_rate, float)
    assert isinstance(checked.axes['z'].travel, float)
    assert checked.setpoint_interface is SetpointInterface.position
    assert checked.home_sequence == (('a_1',), ('z',))
    assert checked.joints == {'z': 'joint_z', 'a_1': 'a_1'}
    assert checked.position_joints == ('joint_z', 'a_1')
    assert checked.connections['z'].sources == {Input.HOME_SWITCH: Source('/io/z')}
    assert checked.connections['a_1'] == Connections()


def test_the_joints_of_an_array_of_positions():
    assert configuration(flat()).position_joints == ('x',)
    joints = ['other', 'joint_x']
    checked = configuration(flat(x__joint='joint_x', position_joints=joints))
    assert checked.position_joints == ('other', 'joint_x')


@pytest.mark.parametrize('interface', SetpointInterface)
def test_only_a_trajectory_tells_the_plan_ahead(interface):
    lead = configuration(flat(setpoint_interface=str(interface), setpoint_lead=0.1)).lead
    assert lead == (0.1 if interface is SetpointInterface.trajectory else 0.0)


def test_what_every_ros_node_has_is_no_fault():
    configuration(
        {
            **flat(),
            'use_sim_time': True,
            'start_type_description_service': False,
            f'{QOS}.durability': 'transient_local',
            f'{QOS}.reliability': 'BEST_EFFORT',
            f'{QOS}.history': 'keep_last',
            f'{QOS}.depth': 5,
        }
    )


@pytest.mark.parametrize(
    ('name', 'value', 'parts'),
    [
        ('use_sim_time', 5, ['use_sim_time: 5', 'true or false']),
        (
            f'{QOS}.durablity',
            'transient_local',
            [f"{QOS}.durablity: 'durablity'", "did you mean 'durability'"],
        ),
        (
            f'{QOS}.durability',
            'transient-local',
            [f"{QOS}.durability: 'transient-local'", "did you mean 'transient_local'"],
        ),
        (f'{QOS}.reliability', True, [f'{QOS}.reliability: True', 'best_effort']),
        (f'{QOS}.depth', 'ten', [f"{QOS}.depth: 'ten' is not an integer"]),
        (f'{QOS}.depth', 0, [f'{QOS}.depth: 0', '>= 1']),
        (
            QOS.replace('subscription', 'subscriber') + '.depth',
            1,
            ['/x/home_switch.subscriber.depth: ', '<subscription|publisher>'],
        ),
        ('qos_overrides.depth', 1, ['qos_overrides.depth: ', '<policy>']),
    ],
)
def test_a_fault_of_what_every_ros_node_has(name, value, parts):
    (fault,) = faults({**flat(), name: value})
    for part in parts:
        assert part in fault


def test_an_axis_that_is_named_twice_has_its_faults_told_once():
    found = faults({**flat(), 'axes': ['x', 'x'], 'x.travel': -1.0})
    assert sum('x.travel' in fault for fault in found) == 1


@pytest.mark.parametrize(
    ('changes', 'parts'),
    [
        ({'axes': None}, ['axes: required']),
        ({'axes': []}, ['axes: no axis is named']),
        ({'axes': 'x'}, ['axes', 'quote']),
        ({'axes': [True]}, ['axes', 'quote']),
        ({'axes': 5}, ['axes: 5', 'list of strings']),
        ({'axes': ['x', 'x']}, ['axes', 'twice']),
        ({'axes': ['2x']}, ["'2x'", 'a letter']),
        ({'axes': ['x-1']}, ["'x-1'"]),
        ({'axes': ['']}, ["''"]),
        ({'x__travel': None}, ['x.travel: required', 'm']),
        ({'x__home_type': None}, ['x.home_type: required']),
        ({'x__travel': 0}, ['x.travel: 0.0 m', '>= 1e-06 and <= 100000 m']),
        (
            {'x__homing_velocity_fst': 0.1},
            ['x.homing_velocity_fst', "did you mean 'homing_velocity_fast'"],
        ),
        ({'x__topics__home_swich': '/a'}, ['x.topics.home_swich']),
        ({'x__topics__home_switch': 5}, ['x.topics.home_switch', 'a string']),
        ({'x__topics__home_switch': 'a b'}, ['x.topics.home_switch', "'a b'"]),
        ({'x__topics__home_switch': '/a//b'}, ['x.topics.home_switch', "'/a//b'"]),
        ({'x__topics__home_switch': '/1'}, ['x.topics.home_switch', "'/1'"]),
        ({'x__homing_velocity_slow': 0.1}, ['x.homing_velocity_slow', '0.1 m/s', '0.05 m/s']),
        (
            {'z__travel': 1.0, 'z__max_jerk': 1.0},
            ["z: 'z' is none of the axes x: add it to axes, or delete its parameters"],
        ),
        ({'update_rat': 250.0}, ['update_rat', "did you mean 'update_rate'"]),
        ({'update_rate': 0.5}, ['update_rate: 0.5 Hz must be >= 1']),
        ({'update_rate': 1e4}, ['update_rate', '<= 2000 Hz']),
        ({'update_rate': True}, ['update_rate', 'a number']),
        ({'cycle_timeout': 0.0}, ['cycle_timeout', '>= 0.001 and <= 60 s']),
        (
            {'setpoint_interface': 'velocity'},
            ['setpoint_interface', "'velocity'", 'trajectory, position'],
        ),
        (
            {'position_joints': ['q']},
            ["position_joints: 'x', the joint of axis x, is missing in q"],
        ),
        (
            {'x__joint': 'x_joint', 'position_joints': ['x']},
            ["position_joints: 'x_joint', the joint of axis x, is missing in x"],
        ),
        ({'position_joints': ['x', 'q', 'q']}, ["position_joints: 'q' stands there twice"]),
        ({'position_joints': ['x', '']}, ['position_joints: a joint has no name']),
        ({'position_joints': 'x'}, ['position_joints', 'list of strings']),
        ({'setpoint_lead': 0.2}, ['setpoint_lead: 0.2 s must be >= 0 and <= 0.1 s']),
        ({'setpoint_lead': -0.001}, ['setpoint_lead: -0.001 s must be >= 0 and <= 0.1 s']),
        ({'home_sequence': ['x, q']}, ['home_sequence', "'q'"]),
        ({'home_sequence': ['x', 'x']}, ['home_sequence', 'twice']),
        ({'home_sequence': 'x'}, ['home_sequence', 'list of strings']),
        ({'home_sequence': True}, ['home_sequence: True', 'list of strings']),
        ({'home_sequence': 5.0}, ['home_sequence: 5.0', 'list of strings']),
    ],
)
def test_a_fault(changes, parts):
    found = faults(flat(**changes))
    assert any(all(part in fault for part in parts) for fault in found), found


@pytest.mark.parametrize('name', sorted(RESERVED))
def test_names_of_the_node_are_no_axes(name):
    found = faults({'axes': [name], f'{name}.home_type': 'HS', f'{name}.travel': 1.0})
    assert any(repr(name) in fault for fault in found)


def test_all_faults_at_once():
    found = faults(
        {
            **flat(update_rate=-1.0, x__travel=-1.0, x__foo=1, x__home_type='ABC', bar=2),
            'home_sequence': ['q'],
        }
    )
    for part in ('update_rate', 'x.travel', 'x.foo', "'ABC'", 'bar', "'q'"):
        assert sum(part in fault for fault in found) == 1, found


def test_two_axes_with_one_joint():
    found = faults(
        {
            'axes': ['a', 'b'],
            **{f'{axis}.{name}': value for axis in 'ab' for name, value in AXIS.items()},
            'b.joint': 'a',
        }
    )
    assert found == ("b.joint: 'a' is already the joint of axis a",)


def test_home_sequence():
    assert home_sequence([], ['x', 'y']) == (('x',), ('y',))
    assert home_sequence(['z', 'x, y'], ['x', 'y', 'z']) == (('z',), ('x', 'y'))
    assert home_sequence([' z ,x'], ['x', 'y', 'z']) == (('z', 'x'),)
    with pytest.raises(ValueError, match="'' is none"):
        home_sequence(['x,'], ['x'])


def test_values_of_an_axis_taken_together():
    assert check_axis_values('x', AXIS) == ()
    assert check_axis_values('x', {**AXIS, 'topics.home_switch': '/a'}) == ()
    (fault,) = check_axis_values('x', {**AXIS, 'homing_velocity_slow': 1.0})
    assert fault.startswith('x.homing_velocity_slow: 1 m/s')


def test_an_axis_that_is_not_in_axes_is_told_in_one_line():
    assert faults(flat(z__travel=1.0, z__home_type='HS', z__max_jerk=1.0)) == (
        "z: 'z' is none of the axes x: add it to axes, or delete its parameters",
    )


def test_a_value_of_the_node():
    check_node_value('cycle_timeout', 1, ['x'])
    check_node_value('home_sequence', ['x'], ['x'])
    with pytest.raises(ValueError, match='home_sequence'):
        check_node_value('home_sequence', ['z'], ['x'])
    with pytest.raises(ValueError, match=r'cycle_timeout: -1\.0 s must be >= 0\.001'):
        check_node_value('cycle_timeout', -1, ['x'])


def test_every_parameter_is_described():
    for name, definition in {**NODE_DEFINITIONS, **AXIS_DEFINITIONS}.items():
        assert definition.name == name
        assert definition.text
    assert set(DEFINITIONS) < set(AXIS_DEFINITIONS)
    received = [*Input, 'feedback', 'temperature']
    outputs = ['servo_on', 'torque_limit', 'arm_latch']
    assert set(AXIS_DEFINITIONS) - set(DEFINITIONS) == {
        *(f'{kind}.{name}' for kind in ('topics', 'types') for name in received),
        *(f'commands.{name}' for name in [*outputs, 'no_torque_limit']),
        *(f'services.{name}{end}' for name in outputs for end in ('', '_true', '_false')),
    }
