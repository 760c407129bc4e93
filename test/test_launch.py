# SPDX-License-Identifier: Apache-2.0
"""Launch files: what they name exists; where `launch` is installed, they load."""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
FILES = sorted((ROOT / 'launch').glob('*.launch.py'))
SETUP = (ROOT / 'setup.py').read_text()

each_file = pytest.mark.parametrize('path', FILES, ids=lambda path: path.name)


def calls(path, name):
    """Yield the calls of a function in a file."""
    for node in ast.walk(ast.parse(path.read_text(), path.name)):
        if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == name:
            yield node


def declared(path):
    return {call.args[0].value for call in calls(path, 'DeclareLaunchArgument')}


def keyword(call, name):
    return next(k.value.value for k in call.keywords if k.arg == name)


def test_there_are_launch_files():
    assert {path.name for path in FILES} == {'homing.launch.py', 'demo.launch.py'}


@each_file
def test_compiles(path):
    compile(path.read_text(), path, 'exec')


@each_file
def test_arguments_are_declared_with_a_text_and_used(path):
    used = {call.args[0].value for call in calls(path, 'LaunchConfiguration')}
    assert used == declared(path)
    assert all(keyword(call, 'description') for call in calls(path, 'DeclareLaunchArgument'))


@each_file
def test_executables_exist(path):
    nodes = list(calls(path, 'Node'))
    assert nodes
    for node in nodes:
        assert keyword(node, 'package') == 'homing_node'
        assert f"'{keyword(node, 'executable')}':" in SETUP


@each_file
def test_files_exist(path):
    named = re.findall(r"share, '(\w+)', '([\w.]+)'", path.read_text())
    assert named or path.name == 'homing.launch.py'
    for folder, name in named:
        assert (ROOT / folder / name).is_file()


def test_demo_passes_arguments_that_homing_takes():
    demo, homing = ROOT / 'launch' / 'demo.launch.py', ROOT / 'launch' / 'homing.launch.py'
    (include,) = calls(demo, 'IncludeLaunchDescription')
    passed = next(k.value for k in include.keywords if k.arg == 'launch_arguments')
    assert {key.value for key in passed.func.value.keys} <= declared(homing)


@each_file
def test_loads(path):
    reason = 'launch comes with a ROS installation, not from PyPI'
    launch = pytest.importorskip('launch', reason=reason)
    pytest.importorskip('launch_ros', reason=reason)
    spec = importlib.util.spec_from_file_location(path.name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    description = module.generate_launch_description()
    assert isinstance(description, launch.LaunchDescription)
    assert {a.name for a in description.get_launch_arguments()} >= declared(path)
