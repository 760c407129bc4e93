# SPDX-License-Identifier: Apache-2.0
"""The walls of the house: which package may import which, and what the core never touches."""

import ast
import sys
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / 'homing_node'

#: The rooms, from the ground up: each imports only from itself and from rooms above it here.
ROOMS = [
    'version',
    'procedures',
    'language',
    'parameters',
    'core',
    'course',
    'memory',
    'recording',
    'plant',
    'rehearsal',
    'check',
    'survey',
    'convert',
    'diagnosis',
    'relay',
    'coordination',
    'figures',
    'ros',
    'client',
    'cli',
    'start',
]
#: Rooms that have no ROS, no clock, no thread and no I/O.
PURE = [
    'procedures',
    'language',
    'core',
    'course',
    'check',
    'survey',
    'diagnosis',
    'relay',
    'coordination',
]
#: What those may use of the standard library.
PURE_LIBRARY = {
    'collections',
    'copy',
    'dataclasses',
    'difflib',
    'enum',
    'functools',
    'itertools',
    'math',
    're',
    'statistics',
    'struct',
    'types',
    'typing',
}
#: The rooms that know ROS.
ROS_ROOMS = ['ros', 'client']
#: What of the command needs ROS: it is imported when a verb runs, so that the others need none.
ROS_VERBS = {'cli/doctor.py', 'cli/live.py', 'cli/record.py', 'cli/survey.py', 'cli/watch.py'}
#: What the node never needs.
TOOLS = {'rehearsal', 'survey', 'convert', 'figures', 'cli', 'client', 'course'}
ROS = {
    'action_msgs',
    'rclpy',
    'builtin_interfaces',
    'diagnostic_msgs',
    'homing_interfaces',
    'lifecycle_msgs',
    'rcl_interfaces',
    'sensor_msgs',
    'std_msgs',
    'std_srvs',
    'geometry_msgs',
    'trajectory_msgs',
    'visualization_msgs',
    'unique_identifier_msgs',
}
#: Packages of ROS that need not be installed; who imports them does without.
OPTIONAL = {'control_msgs', 'controller_manager_msgs'}
THIRD = {'lz4', 'matplotlib', 'mcap', 'mcap_ros2', 'numpy', 'rich', 'ruckig', 'yaml'}

FILES = [path for path in sorted(PACKAGE.rglob('*.py')) if path != PACKAGE / '__init__.py']
each_room = pytest.mark.parametrize('room', ROOMS)


def room_of(path):
    """Return the package within ours that a file belongs to, or the name of a module on top."""
    return path.relative_to(PACKAGE).parts[0].removesuffix('.py')


def files_of(room):
    return [path for path in FILES if room_of(path) == room]


def nodes_of(tree, within_functions):
    """Yield the nodes of a module; those within functions only where they are wanted."""
    for node in ast.iter_child_nodes(tree):
        yield node
        if within_functions or not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            yield from nodes_of(node, within_functions)


@cache
def imports_of(path, within_functions=True):
    """Return the modules that a file imports: our own by their path, others by their first."""
    own, others = set(), set()
    here = path.relative_to(PACKAGE).parts[:-1]
    for node in nodes_of(ast.parse(path.read_text()), within_functions):
        if isinstance(node, ast.Import):
            others |= {alias.name.partition('.')[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level:
            others.add(node.module.partition('.')[0])
        elif isinstance(node, ast.ImportFrom):
            base = [*here[: len(here) - node.level + 1], *(node.module or '').split('.')]
            base = [part for part in base if part]
            own |= {'/'.join([*base, alias.name]) for alias in node.names}
    return own, others


@cache
def file_of(name):
    """Return the file that an imported name stands in: of a module, or of a package."""
    parts = name.split('/')
    while parts:
        path = PACKAGE.joinpath(*parts)
        if path.with_suffix('.py').is_file():
            return path.with_suffix('.py')
        if (path / '__init__.py').is_file():
            return path / '__init__.py'
        parts.pop()
    raise AssertionError(f'{name} is no module of ours')


@cache
def needed_by(path, within_functions=True):
    """Return all files that a file imports, however far away."""
    found, left = set(), [path]
    while left:
        one = left.pop()
        if one not in found:
            found.add(one)
            own, _ = imports_of(one, within_functions)
            left += [file_of(name) for name in own if '/' in name]
    return found


def test_every_room_is_named():
    assert {room_of(path) for path in FILES} == set(ROOMS)


@each_room
def test_a_room_imports_only_from_rooms_above_it(room):
    above = set(ROOMS[: ROOMS.index(room) + 1])
    for path in files_of(room):
        own, _ = imports_of(path)
        assert {name.split('/')[0] for name in own} <= above, path


@each_room
def test_nothing_imports_in_a_circle(room):
    for path in files_of(room):
        own, _ = imports_of(path)
        for name in own:
            assert path not in needed_by(file_of(name)) or file_of(name) == path, (path, name)


@each_room
def test_who_knows_what(room):
    for path in files_of(room):
        _, others = imports_of(path)
        assert 'ruckig' not in others or path.name == 'phase.py', path
        assert not others & (ROS | OPTIONAL) or room in ROS_ROOMS, path
        assert others <= ROS | OPTIONAL | THIRD | set(sys.stdlib_module_names) - {'homing_node'}
        if room in PURE:
            assert others <= PURE_LIBRARY | {'ruckig'}, path
            tree = ast.parse(path.read_text())
            names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
            assert not names & {'open', 'print', 'exec', 'eval', '__import__'}, path


@pytest.mark.parametrize('room', [room for room in ROOMS if room not in ROS_ROOMS])
def test_only_the_node_and_the_client_need_ros(room):
    """A verb that needs ROS imports it when it runs; the command and the others load without."""
    for path in files_of(room):
        needed = needed_by(path, within_functions=False)
        assert not {room_of(one) for one in needed} & set(ROS_ROOMS), path
        own, _ = imports_of(path)
        late = {room_of(file_of(name)) for name in own if '/' in name} & set(ROS_ROOMS)
        assert bool(late) == (str(path.relative_to(PACKAGE)) in ROS_VERBS), path


def test_the_node_needs_no_tools():
    assert not {room_of(path) for path in needed_by(PACKAGE / 'ros' / 'main.py')} & TOOLS


def test_the_tables_are_plain_data():
    """No lambda, no arithmetic and no comparison stands in a table."""
    tables = [
        node
        for path in sorted((PACKAGE / 'procedures').glob('*.py'))
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and getattr(node.func, 'id', '') == 'Row'
    ]
    assert len(tables) > 20
    for table in tables:
        for node in ast.walk(table):
            assert not isinstance(node, ast.Lambda | ast.BinOp | ast.Compare | ast.IfExp)


@pytest.mark.parametrize('folder', ['homing_node', 'test', 'scripts', 'bench', 'launch'])
def test_every_file_names_its_license(folder):
    paths = sorted((PACKAGE.parent / folder).rglob('*.py'))
    assert paths
    for path in paths:
        assert '# SPDX-License-Identifier: Apache-2.0\n' in path.read_text()[:100], path


@pytest.mark.parametrize(
    'path',
    [p for folder in ('scripts', 'bench') for p in sorted((PACKAGE.parent / folder).glob('*.py'))],
    ids=lambda p: str(p.relative_to(PACKAGE.parent)),
)
def test_scripts_and_benchmarks_import_what_is_there(path):
    """Most of them run by hand only; mypy does not look at them."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module.startswith('homing_node'):
            module = import_module(node.module)
            for alias in node.names:
                if not hasattr(module, alias.name):
                    import_module(f'{node.module}.{alias.name}')
