# SPDX-License-Identifier: Apache-2.0
"""The executables: help, version, files that are given wrongly, Ctrl-C while they load."""

import re
import subprocess
import sys
import weakref
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import pytest

from homing_node import start
from homing_node.parameters.definition import InvalidParameters
from homing_node.ros import process
from homing_node.version import version

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def run(monkeypatch, capsys):
    """Run an executable; return its status, its output and the modules that it has loaded."""

    def run(name, *arguments, main=lambda: 0):
        loaded = []

        def load(module):
            loaded.append(module)
            return SimpleNamespace(main=main)

        monkeypatch.setattr(start, 'import_module', load)
        monkeypatch.setattr(sys, 'argv', [name, *arguments])
        status = getattr(start, name)()
        told = capsys.readouterr()
        return status, told.out, told.err, loaded

    return run


@pytest.mark.parametrize('name', start.NODES)
@pytest.mark.parametrize('option', ['-h', '--help', '--version'])
def test_help_and_version_need_no_ros(name, option, run):
    status, out, err, loaded = run(name, option)
    assert (status, err, loaded) == (0, '', [])
    if option == '--version':
        assert re.fullmatch(rf'{name} \d+\.\d+\.\d+\n', out)
    else:
        assert out.startswith(f'usage: {name} --ros-args --params-file ')


@pytest.mark.parametrize('name', start.NODES)
def test_arguments_of_ros_are_passed_on(name, run):
    arguments = ('--ros-args', '--params-file', 'axes.yaml', '-p', '-h:=1', '--')
    assert run(name, *arguments) == (0, '', '', [start.NODES[name][0]])


def test_a_parameter_file_without_its_option_is_named(run):
    status, _, err, loaded = run('homing_node', 'axes.yaml')
    assert (status, loaded) == (2, [])
    assert err == (
        'homing_node: axes.yaml: give a parameter file so: homing_node --ros-args --params-file '
        'axes.yaml\n'
    )


@pytest.mark.parametrize('name', [*start.NODES, 'homing'])
def test_ctrl_c_while_it_loads_is_no_traceback(name, run):
    def interrupted():
        raise KeyboardInterrupt

    status, out, err, _ = run(name, main=interrupted)
    assert (status, out, err) == (130, '', f'{name}: interrupted\n')


def test_every_executable_starts_here():
    targets = re.findall(r"'(\w+)': 'homing_node\.start:(\w+)'", (ROOT / 'setup.py').read_text())
    assert {name for name, _ in targets} == {*start.NODES, 'homing'}
    assert all(name == function for name, function in targets)


def test_the_module_loads_nothing_that_takes_time():
    names = ('homing_node.', 'rclpy', 'numpy', 'importlib.metadata', 'email', 'socket')
    code = (
        'import sys; before = {*sys.modules}; import homing_node.start; '
        f'print([m for m in sys.modules if m not in before and m.startswith({names})])'
    )
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    assert done.stdout == "['homing_node.start']\n"


def test_without_an_installation_the_version_is_not_known(monkeypatch):
    """A node of sources on a path starts, and its records say so."""

    def missing(name):
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, 'version', missing)
    assert version() == 'unknown'


def test_a_node_that_is_refused_goes_before_its_context(monkeypatch, capsys):
    """One that outlived the interpreter crashed it: the middleware's threads still run."""
    refused, left = [], []

    class Half:
        def __init__(self):
            self.itself = self  # as the parts of a node refer to each other
            refused.append(weakref.ref(self))
            raise InvalidParameters(['x.travel: -1 m must be >= 1e-06'])

    monkeypatch.setattr(process.rclpy, 'shutdown', lambda: left.append(refused[0]()))
    assert process.made('homing_node', Half) is None
    assert left == [None]
    assert 'x.travel: -1 m' in capsys.readouterr().err
