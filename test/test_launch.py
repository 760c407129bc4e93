# SPDX-License-Identifier: Apache-2.0
"""Launch files: what they start with which arguments, by a stand-in where `launch` is missing."""

import importlib.util
import os
from pathlib import Path

import pytest
import yaml
from launch_stand_in import launched

from homing_node.parameters.line import line
from homing_node.parameters.yaml_file import read

ROOT = Path(__file__).resolve().parent.parent
FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
DEMO, HOMED, HOMING, LINE = (
    ROOT / 'launch' / f'{name}.launch.py' for name in ('demo', 'homed_machine', 'homing', 'line')
)
SETUP = (ROOT / 'setup.py').read_text()
CONFIG = {'config': str(ROOT / 'config' / 'one_axis.yaml')}
TRANSPORTS = 'FASTDDS_BUILTIN_TRANSPORTS'
PROFILES = ('FASTDDS_DEFAULT_PROFILES_FILE', 'FASTRTPS_DEFAULT_PROFILES_FILE')

#: A value of each argument that is not its default.
OTHERS = {
    'config': '/tmp/axes.yaml',
    'plant': '/tmp/machine.yaml',
    'namespace': 'cell',
    'setpoint_interface': 'position',
    'setpoint_topic': '/axes_controller/commands',
    'use_sim_time': 'true',
    'simulated': 'true',
    'line': '/tmp/line.yaml',
    'cells': 'cell7',
    'log_level': 'debug',
}

each_file = pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)


@pytest.fixture(autouse=True)
def nothing_chosen(monkeypatch):
    """Remove the user's choice of transports."""
    for name in (TRANSPORTS, *PROFILES):
        monkeypatch.delenv(name, raising=False)


def commands(context):
    """Return what is started, with the parameters themselves in place of temporary files."""

    def shown(word):
        generated = 'launch_params' in word
        return yaml.safe_load(Path(word).read_text()) if generated else word

    return [(s.executable, [shown(word) for word in s.arguments]) for s in context.started]


def test_there_are_launch_files():
    assert FILES == [DEMO, HOMED, HOMING, LINE]


@each_file
def test_executables_and_files_exist(path, tmp_path):
    started = launched(path, tmp_path, **CONFIG).started
    assert started
    for process in started:
        assert process.package == 'homing_node'
        assert f"'{process.executable}':" in SETUP
        assert all(Path(file).is_file() for file in process.option('--params-file'))


@each_file
def test_every_argument_has_a_text_and_an_effect(path, tmp_path):
    plain = launched(path, tmp_path, **CONFIG)
    assert set(plain.declared) <= set(OTHERS)
    for name, argument in plain.declared.items():
        assert argument.description
        # The simulated axes are not started by default.
        given = {**CONFIG, 'simulated': 'true'} if name == 'plant' and path == HOMED else CONFIG
        other = 'false' if name == 'simulated' and path == LINE else OTHERS[name]
        changed = launched(path, tmp_path, **{**given, name: other})
        assert commands(changed) != commands(launched(path, tmp_path, **given)), name


def test_demo_runs_as_it_stands(tmp_path):
    node, plant = launched(DEMO, tmp_path).started
    assert node.option('--params-file') == [str(ROOT / 'config' / 'demo.yaml')]
    assert plant.option('--params-file') == [str(ROOT / 'config' / 'simulated_axes.yaml')]


def test_a_homed_machine_has_its_relay(tmp_path):
    node, relay = launched(HOMED, tmp_path).started
    assert relay.executable == 'homed_axes'
    config = [str(ROOT / 'config' / 'homed_machine.yaml')]
    assert node.option('--params-file') == relay.option('--params-file') == config
    assert '~/setpoints:=axes_controller/joint_trajectory' in node.option('-r')
    *_, plant = launched(HOMED, tmp_path, simulated='true', namespace='cell').started
    assert plant.executable == 'simulated_axes'
    own = yaml.safe_load(Path(plant.option('--params-file')[-1]).read_text())
    assert own == {'/**': {'ros__parameters': {'controller': 'axes_controller'}}}
    assert plant.option('-r') == ['__ns:=/cell']


def test_a_line_has_a_coordinator_and_a_machine_in_each_cell(tmp_path):
    coordinator, *cells = launched(LINE, tmp_path).started
    assert coordinator.executable == 'homing_coordinator'
    (file,) = coordinator.option('--params-file')
    nodes = line(read(file, '/homing_coordinator').values).nodes
    own = {
        cell: [one.executable for one in cells if one.option('-r') == [f'__ns:=/{cell}']]
        for cell in nodes
    }
    both = ['homing_node', 'simulated_axes']
    assert own == {'cell1': both, 'cell2': both}
    node, plant = cells[:2]
    _, more = node.option('--params-file')
    layout = {'layout': plant.option('--params-file')[0]}
    assert yaml.safe_load(Path(more).read_text()) == {'/**': {'ros__parameters': layout}}
    node, *_ = launched(LINE, tmp_path, simulated='false').started[1:]
    assert len(node.option('--params-file')) == 1
    assert launched(LINE, tmp_path, cells='').started == [coordinator]


def test_homing_needs_a_configuration(tmp_path):
    with pytest.raises(RuntimeError, match='config is required'):
        launched(HOMING, tmp_path)


@pytest.mark.parametrize('namespace', ['cell', '/cell', 'hall/cell'])
def test_the_plant_of_the_demo_follows_the_namespace(tmp_path, namespace):
    for process in launched(DEMO, tmp_path, namespace=namespace).started:
        assert process.option('-r') == [f'__ns:=/{namespace.strip("/")}']


def test_the_plant_of_the_demo_follows_the_setpoints(tmp_path):
    arguments = {'setpoint_topic': '/axes/cmd', 'setpoint_interface': 'position'}
    node, plant = launched(DEMO, tmp_path, **arguments).started
    assert '~/position_commands:=/axes/cmd' in node.option('-r')
    assert 'homing_node/position_commands:=/axes/cmd' in plant.option('-r')
    for process in node, plant:
        parameters = yaml.safe_load(Path(process.option('--params-file')[-1]).read_text())
        assert parameters == {'/**': {'ros__parameters': {'setpoint_interface': 'position'}}}


@pytest.mark.parametrize('path', [DEMO, HOMING], ids=lambda path: path.name)
def test_what_is_not_given_stays_as_the_parameter_file_says(path, tmp_path):
    for process in launched(path, tmp_path, **CONFIG).started:
        assert len(process.option('--params-file')) == 1
        assert process.option('-r') == []


@pytest.mark.parametrize('path', [DEMO, HOMING], ids=lambda path: path.name)
@pytest.mark.parametrize('name', ['setpoint_interface', 'use_sim_time'])
def test_a_value_that_does_not_exist_is_refused(path, name, tmp_path):
    with pytest.raises(RuntimeError, match='is none of'):
        launched(path, tmp_path, **CONFIG, **{name: 'maybe'})


@each_file
def test_shared_memory_is_avoided_and_the_range_is_not_touched(path, tmp_path):
    assert launched(path, tmp_path, **CONFIG).environment == {TRANSPORTS: 'UDPv4'}
    assert TRANSPORTS not in os.environ


@each_file
@pytest.mark.parametrize('name', [TRANSPORTS, *PROFILES])
def test_the_transports_that_the_user_chose_stay(path, name, tmp_path, monkeypatch):
    monkeypatch.setenv(name, 'DEFAULT')
    assert launched(path, tmp_path, **CONFIG).environment == {}


@each_file
def test_loads(path, tmp_path):
    reason = 'launch comes with a ROS installation, not from PyPI'
    launch = pytest.importorskip('launch', reason=reason)
    pytest.importorskip('launch_ros', reason=reason)
    spec = importlib.util.spec_from_file_location(path.name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    description = module.generate_launch_description()
    assert isinstance(description, launch.LaunchDescription)
    declared = launched(path, tmp_path, **CONFIG).declared
    assert {a.name for a in description.get_launch_arguments()} >= set(declared) - {'use_sim_time'}
