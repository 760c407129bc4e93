# SPDX-License-Identifier: Apache-2.0
"""The examples for drivers in config/drivers: `homing check` passes, and the expressions fit."""

from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from launch_stand_in import launched

from homing_node.check import check
from homing_node.check.finding import Severity
from homing_node.language.expression import Lookup
from homing_node.language.resolve import bind
from homing_node.parameters.yaml_file import load
from homing_node.ros.message_types import layout

DRIVERS = Path(__file__).resolve().parent.parent / 'config' / 'drivers'
MACHINE = DRIVERS / 'ros2_control'
FILES = [*sorted(DRIVERS.glob('*.yaml')), MACHINE / 'axes.yaml']
each_file = pytest.mark.parametrize('path', FILES, ids=lambda path: path.stem)

#: The type of each topic of the examples, as the driver publishes it.
TYPES = {
    '/gpio_controller/gpio_states': 'control_msgs/msg/DynamicInterfaceGroupValues',
    '/x/rpdo': 'canopen_interfaces/msg/COData',
    '/io_and_status_controller/io_states': 'ur_msgs/msg/IOStates',
    '/board/x_home': 'std_msgs/msg/Int8',
    '/board/x_max': 'std_msgs/msg/Bool',
    '/board/x_min': 'std_msgs/msg/Bool',
    '/board/limit_switch': 'std_msgs/msg/Int32MultiArray',
    '/modbus/inputs': 'std_msgs/msg/UInt16',
}


@each_file
def test_homing_check_passes(path):
    assert [one.text for one in check(load(path)) if one.severity is not Severity.info] == []


@each_file
def test_every_expression_fits_the_type_of_its_topic(path):
    wired = 0
    configured = load(path)
    for axis, parameters in configured.axes.items():
        for name in parameters.inputs:
            source = configured.connections[axis].source(axis, name)
            bind(source, layout(TYPES[source.topic]))
            wired += 1
    assert wired > 2


def interfaces(controllers, kind):
    """Return group/interface of every interface of the gpio_controller."""
    groups = controllers['gpio_controller']['ros__parameters'][f'{kind}_interfaces']
    return {
        f'{group}/{name}'
        for group, listed in groups.items()
        for one in listed
        for name in one['interfaces']
    }


def test_the_files_of_the_machine_name_the_same_things():
    """What axes.yaml reads and commands, the controllers have; what these have, the URDF has."""
    configured = load(MACHINE / 'axes.yaml')
    controllers = yaml.safe_load((MACHINE / 'controllers.yaml').read_text())
    urdf = ElementTree.parse(MACHINE / 'machine.urdf').getroot()
    connections = configured.connections['x']
    read = [
        str(value.place)
        for source in connections.sources.values()
        for value in (source.value, source.counter)
        if value
    ]
    commanded = [str(Lookup(one.group, one.interface)) for one in connections.commands.values()]
    assert len(read) == 5
    assert set(read) <= interfaces(controllers, 'state')
    assert set(commanded) <= interfaces(controllers, 'command')
    for kind in ('state', 'command'):
        there = {
            f'{gpio.get("name")}/{one.get("name")}'
            for gpio in urdf.iter('gpio')
            for one in gpio.iter(f'{kind}_interface')
        }
        assert interfaces(controllers, kind) <= there
    joints = controllers['axes_controller']['ros__parameters']['joints']
    assert joints == [configured.joints['x']]
    assert joints[0] in {joint.get('name') for joint in urdf.iter('joint')}


def test_the_launch_file_starts_the_machine(tmp_path):
    started = launched(MACHINE / 'machine.launch.py', tmp_path).started
    assert [one.executable for one in started] == [
        'robot_state_publisher',
        'ros2_control_node',
        'spawner',
        'homing_node',
    ]
    words = ' '.join(started[-1].arguments)
    assert '~/setpoints:=/axes_controller/joint_trajectory' in words
    assert str(MACHINE / 'axes.yaml') in words
