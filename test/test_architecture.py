"""The walls of the house: which module may import which, and what the core never touches."""

import ast
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / 'homing_node'

#: The core: no ROS, no clock, no thread, no I/O. Each line imports only from lines above it.
CORE = [
    {'states', 'profile', 'stamps'},
    {'events', 'motions', 'signals', 'history', 'spec', 'outcome'},
    {'procedures', 'qos'},
    {'parameters'},
    {'configuration', 'flags', 'limits', 'mechanical_end', 'travel'},
    {'latches', 'passes'},
    {'machine'},
    {'axis'},
    {'request'},
    {'dispatch'},
]
#: What the core may use of the standard library.
PURE = {
    'collections', 'dataclasses', 'difflib', 'enum', 'functools', 'itertools', 'math', 're',
    'statistics', 'types', 'typing'}
#: The ROS shell: the only modules that know ROS.
SHELL = {'main', 'node', 'configured_node', 'inputs', 'arrivals', 'services', 'reports',
         'convert', 'cdr', 'simulation_node', 'client'}
#: What the node uses besides the core and its own shell.
OF_THE_NODE = {'timebase', 'transport', 'check', 'layout'}
ROS = {'rclpy', 'builtin_interfaces', 'diagnostic_msgs', 'homing_interfaces', 'rcl_interfaces',
       'sensor_msgs', 'std_msgs', 'std_srvs', 'trajectory_msgs'}


def imports_of(path):
    """Return the modules that a file imports: our own by their name, others by their first."""
    own, others = set(), set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            others |= {alias.name.partition('.')[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            others.add(node.module.partition('.')[0])
        elif isinstance(node, ast.ImportFrom):
            inside = path.parent != PACKAGE and node.level == 1  # of a package in the package
            if inside:
                own.add(path.parent.name)
            elif node.module:
                own.add(node.module.partition('.')[0])
            else:
                own |= {alias.name for alias in node.names}
    return own, others


def module_of(path):
    """Return the module, or the package within ours, that a file belongs to."""
    return path.stem if path.parent == PACKAGE else path.parent.name


FILES = [path for path in sorted(PACKAGE.rglob('*.py')) if path.parent != PACKAGE
         or path.stem != '__init__']
IMPORTS = {path: imports_of(path) for path in FILES}
MODULES = {module_of(path) for path in FILES}
each_file = pytest.mark.parametrize('path', FILES, ids=lambda p: str(p.relative_to(PACKAGE)))


def needed_by(module):
    """Return all modules that a module imports, however far away."""
    found, left = set(), [module]
    while left:
        one = left.pop()
        found.add(one)
        left += {name for path, (own, _) in IMPORTS.items() if module_of(path) == one
                 for name in own} - found
    return found


def test_every_named_module_is_there():
    assert {name for layer in CORE for name in layer} | SHELL | OF_THE_NODE <= MODULES


@pytest.mark.parametrize('line', range(len(CORE)), ids=lambda i: '-'.join(sorted(CORE[i])))
def test_the_core_is_built_in_layers(line):
    below = set().union(*CORE[:line])
    for module in CORE[line]:
        own, others = IMPORTS[PACKAGE / f'{module}.py']
        assert own <= below, module
        assert others <= PURE | ({'ruckig'} if module == 'profile' else set()), module


@pytest.mark.parametrize('module', sorted(set().union(*CORE)))
def test_the_core_has_no_clock_and_no_files(module):
    names = {node.id for node in ast.walk(ast.parse((PACKAGE / f'{module}.py').read_text()))
             if isinstance(node, ast.Name)}
    assert not names & {'open', 'print', 'exec', 'eval', '__import__'}


@each_file
def test_who_knows_what(path):
    _, others = IMPORTS[path]
    module = module_of(path)
    assert 'ruckig' not in others or module == 'profile'
    assert not others & ROS or module in SHELL
    ours = {'homing_node'}
    third = {'matplotlib', 'numpy', 'rich', 'ruckig', 'yaml'}
    assert others <= ROS | third | set(sys.stdlib_module_names) - ours


@pytest.mark.parametrize('module', ['cli', 'check', 'rehearsal', 'plot', 'diagram', 'record'])
def test_the_tools_need_no_ros(module):
    assert not needed_by(module) & SHELL


def test_the_node_needs_no_tools():
    core = set().union(*CORE)
    shell = SHELL - {'simulation_node', 'client'}
    assert needed_by('main') <= core | shell | OF_THE_NODE


def test_the_tables_are_plain_data():
    """No lambda, no arithmetic and no comparison stands in a table."""
    tree = ast.parse((PACKAGE / 'procedures.py').read_text())
    tables = [node for node in ast.walk(tree) if isinstance(node, ast.Call)
              and getattr(node.func, 'id', '') == 'Row']
    assert len(tables) > 20
    for table in tables:
        for node in ast.walk(table):
            assert not isinstance(node, ast.Lambda | ast.BinOp | ast.Compare | ast.IfExp)
