# SPDX-License-Identifier: Apache-2.0
"""`homing doctor` and a running system, between real processes."""

import json

import pytest
import ros_harness as ros
from test_diagnosis import JTC
from test_node_controllers import REMAP, TOPIC, Controller

from homing_node.cli import main

AXES = {'x': {'joint': 'x_joint'}, 'y': {'joint': 'y_joint'}}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    with ros.World(
        tmp_path_factory.mktemp('doctor'),
        ros.node_parameters(AXES),
        ros.plant_parameters({name: dict(values) for name, values in AXES.items()}),
        node='/cell/homing_node',
        arguments=[*REMAP[1:], '-r', '__ns:=/cell', '-r', 'joint_states:=/joint_states'],
        plant_arguments=['-r', '/homing_node/x/home_switch:=/cell/homing_node/x/home_switch'],
    ) as world:
        yield world


@pytest.fixture
def doctor(world, monkeypatch, capsys):
    """Return what runs the command: its exit status, its output and its errors."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(world.domain.number))

    def run(*arguments):
        status = main(['doctor', *arguments])
        return status, *capsys.readouterr()

    return run


def found(doctor, *arguments):
    """Return the exit status and the findings of the node in its namespace, by their word."""
    status, out, err = doctor('--node', '/cell/homing_node', '--json', '--listen', '1', *arguments)
    assert not err, err
    report = json.loads(out)
    assert report['node'] == '/cell/homing_node'
    return status, {(one['axis'], one['check']): one for one in report['findings']}


@pytest.mark.long
def test_a_node_that_is_not_there(doctor):
    status, out, err = doctor()
    assert status == 2 and out == ''
    assert 'there is no homing node /homing_node' in err
    assert 'homing doctor --node /cell/homing_node' in err


def test_what_is_missing_is_found(doctor):
    status, findings = found(doctor)
    assert status == 1
    assert TOPIC in findings['', 'no-controller']['what']
    # The plant stands in another namespace, but for one switch.
    assert ('x', 'no-publisher') in findings
    what = [one['what'] for one in findings.values() if one['check'] == 'no-publisher']
    assert not any('/x/home_switch' in one for one in what)
    assert not any(check.startswith('feedback') for _, check in findings), findings


def test_the_parameters_of_the_controller_are_read(world, doctor):
    wrong = {**JTC, 'allow_partial_joints_goal': False, 'constraints.y_joint.trajectory': 0.0002}
    controller = Controller(world, wrong)
    try:
        world.client.until(lambda: world.client.node.count_subscribers(TOPIC), what='controller')
        status, findings = found(doctor)
    finally:
        controller.close()
    assert status == 1
    assert findings['', 'partial-joints']['right'] is True
    assert findings['y', 'path-tolerance']['value'] == 0.0002
    assert ('', 'no-controller') not in findings


@pytest.mark.long
def test_the_controller_manager_is_asked(world, doctor):
    pytest.importorskip('controller_manager_msgs')
    controller = Controller(
        world,
        JTC,
        manager={'update_rate': 500, 'enforce_command_limits': True},
        state='inactive',
    )
    try:
        world.client.until(lambda: world.client.node.count_subscribers(TOPIC), what='controller')
        status, findings = found(doctor)
    finally:
        controller.close()
    assert status == 1
    assert '/axes_controller is inactive' in findings['', 'controller-inactive']['what']
    assert '/controller_manager' in findings['', 'enforce-limits']['what']


@pytest.mark.long
def test_nothing_is_changed(world, doctor):
    """The doctor publishes nothing and sets nothing: the node hears of no request."""
    before = world.client.get('x.homing_velocity_fast', 'y.homing_velocity_fast')
    states = world.client.record_states('x')
    found(doctor)
    assert world.client.get('x.homing_velocity_fast', 'y.homing_velocity_fast') == before
    assert {heard.message.state for heard in states} <= {'Idle'}
