# SPDX-License-Identifier: Apache-2.0
"""`homing doctor` and a running system, between real processes."""

import json
import os
import subprocess
import sys

import pytest
import ros_harness as ros
from test_diagnosis import JTC
from test_node_controllers import REMAP, TOPIC, Controller

COMMAND = 'import sys; from homing_node.cli import main; sys.exit(main())'
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


def doctor(world, *arguments):
    """Run the command; return its exit status, its output and its errors."""
    done = subprocess.run(
        [sys.executable, '-c', COMMAND, 'doctor', *arguments],
        env={**os.environ, 'ROS_DOMAIN_ID': str(world.domain.number)},
        capture_output=True,
        text=True,
        timeout=60.0,
    )
    return done.returncode, done.stdout, done.stderr


def found(world, *arguments):
    """Return the exit status and the findings of the node in its namespace, by their word."""
    status, out, err = doctor(
        world, '--node', '/cell/homing_node', '--json', '--listen', '2', *arguments
    )
    assert not err, err
    report = json.loads(out)
    assert report['node'] == '/cell/homing_node'
    return status, {(one['axis'], one['check']): one for one in report['findings']}


@pytest.mark.long
def test_a_node_that_is_not_there(world):
    status, out, err = doctor(world)
    assert status == 2 and out == ''
    assert 'there is no homing node /homing_node' in err
    assert 'homing doctor --node /cell/homing_node' in err


def test_what_is_missing_is_found(world):
    status, findings = found(world)
    assert status == 1
    assert TOPIC in findings['', 'no-controller']['what']
    # The plant stands in another namespace, but for one switch.
    assert ('x', 'no-publisher') in findings
    what = [one['what'] for one in findings.values() if one['check'] == 'no-publisher']
    assert not any('/x/home_switch' in one for one in what)
    assert not any(check.startswith('feedback') for _, check in findings), findings


def test_the_parameters_of_the_controller_are_read(world):
    wrong = {**JTC, 'allow_partial_joints_goal': False, 'constraints.y_joint.trajectory': 0.0002}
    controller = Controller(world, wrong)
    try:
        world.client.until(lambda: world.client.node.count_subscribers(TOPIC), what='controller')
        status, findings = found(world)
    finally:
        controller.close()
    assert status == 1
    assert findings['', 'partial-joints']['right'] is True
    assert findings['y', 'path-tolerance']['value'] == 0.0002
    assert ('', 'no-controller') not in findings


@pytest.mark.long
def test_the_controller_manager_is_asked(world):
    pytest.importorskip('controller_manager_msgs')
    controller = Controller(
        world,
        JTC,
        manager={'update_rate': 500, 'enforce_command_limits': True},
        state='inactive',
    )
    try:
        world.client.until(lambda: world.client.node.count_subscribers(TOPIC), what='controller')
        status, findings = found(world)
    finally:
        controller.close()
    assert status == 1
    assert '/axes_controller is inactive' in findings['', 'controller-inactive']['what']
    assert '/controller_manager' in findings['', 'enforce-limits']['what']


@pytest.mark.long
def test_nothing_is_changed(world):
    """The doctor publishes nothing and sets nothing: the node hears of no request."""
    before = world.client.get('x.homing_velocity_fast', 'y.homing_velocity_fast')
    states = world.client.record_states('x')
    found(world)
    assert world.client.get('x.homing_velocity_fast', 'y.homing_velocity_fast') == before
    assert {heard.message.state for heard in states} <= {'Idle'}
