# SPDX-License-Identifier: Apache-2.0
"""The package uses only what others offer in public, so that it runs on the ROS that users have.

Each rule names a place as `file:line: what`; the last test breaks every rule once.
"""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / 'homing_node'
FILES = sorted(PACKAGE.rglob('*.py'))
#: The public methods and fields of a NamedTuple begin with an underscore.
NAMED_TUPLE = {'_asdict', '_field_defaults', '_fields', '_make', '_replace'}
#: Functions that take the name of an attribute.
BY_NAME = {'getattr', 'setattr', 'hasattr', 'delattr', 'attrgetter', 'methodcaller'}
#: How the names of the variables begin by which a user sets up ROS and its middleware.
VARIABLES = ('ROS_', 'RMW_', 'RCL_', 'FASTDDS_', 'FASTRTPS_', 'CYCLONEDDS_', 'ZENOH_', 'AMENT_')
#: Methods that change a mapping; of `os.environ` none may be called.
CHANGES = {'update', 'setdefault', 'pop', 'popitem', 'clear'}


def is_private(name):
    return name.startswith('_') and not name.endswith('__') and name not in NAMED_TUPLE


def defined_by(node):
    """Return the private names that a class defines, and the names of its bases."""
    names = set()
    for part in ast.walk(node):
        if isinstance(part, ast.FunctionDef | ast.AsyncFunctionDef):
            names.add(part.name)
        elif isinstance(part, ast.Attribute) and isinstance(part.ctx, ast.Store):
            if getattr(part.value, 'id', '') in ('self', 'cls'):
                names.add(part.attr)
        elif isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
            names.add(part.id)
        elif isinstance(part, ast.Constant) and isinstance(part.value, str):
            names.add(part.value)  # in __slots__
    bases = {getattr(base, 'id', getattr(base, 'attr', '')) for base in node.bases}
    return {name for name in names if is_private(name)}, bases


def classes_of(tree):
    """Return class → (private names, bases) of all classes in a module."""
    return {
        node.name: defined_by(node) for node in ast.walk(tree) if isinstance(node, ast.ClassDef)
    }


def own_names(name, classes):
    """Return the private names of a class of ours, those of its bases of ours included."""
    if name not in classes:
        return set()
    names, bases = classes[name]
    return names.union(*(own_names(base, classes) for base in bases))


class Rules(ast.NodeVisitor):
    """Collects the places of one module that break a rule."""

    def __init__(self, classes, here):
        self.classes = classes
        self.here = here  # the classes of this module
        self.typed = {}  # arguments of the functions around the place → their class, if of here
        self.owned = [set()]  # the private names of the classes around the place
        self.found = []

    def broken(self, node, what):
        self.found.append(f'{node.lineno}: {what}')

    def visit_ClassDef(self, node):
        self.owned.append(self.owned[-1] | own_names(node.name, self.classes))
        self.generic_visit(node)
        self.owned.pop()

    def visit_FunctionDef(self, node):
        before = self.typed
        self.typed = dict(before)
        for argument in node.args.args:
            kind = getattr(argument.annotation, 'id', getattr(argument.annotation, 'value', ''))
            if kind in self.here:
                self.typed[argument.arg] = kind
        self.generic_visit(node)
        self.typed = before

    def visit_Attribute(self, node):
        if is_private(node.attr) and node.attr not in self._ours(node):
            self.broken(node, f'{ast.unparse(node)} is private to another class')
        if node.attr in ('environb', 'putenv', 'unsetenv'):
            self.broken(node, f'{ast.unparse(node)} can change the environment')
        if node.attr in CHANGES and ast.unparse(node.value).endswith('environ'):
            self.broken(node, f'{ast.unparse(node)} changes the environment')
        self.generic_visit(node)

    def _ours(self, node):
        """Return the private names that the owner of an attribute may use here."""
        owner = getattr(node.value, 'id', '')
        owner = self.typed.get(owner, owner if owner in self.here else '')
        return self.owned[-1] | own_names(owner, self.classes)

    def visit_Subscript(self, node):
        if not isinstance(node.ctx, ast.Load):
            key = getattr(node.slice, 'value', '')
            variable = isinstance(key, str) and key.startswith(VARIABLES)
            if variable or ast.unparse(node.value).endswith('environ'):
                self.broken(node, f'{ast.unparse(node)} changes the environment')
        self.generic_visit(node)

    def visit_Call(self, node):
        function = getattr(node.func, 'id', getattr(node.func, 'attr', ''))
        for argument in node.args:
            name = getattr(argument, 'value', '')
            if function in BY_NAME and isinstance(name, str) and is_private(name):
                self.broken(node, f'{ast.unparse(node)} is private to another class')
        self.generic_visit(node)

    def visit_Import(self, node):
        for alias in node.names:
            self._imported(node, alias.name)

    def visit_ImportFrom(self, node):
        for alias in node.names:
            if not node.level:
                self._imported(node, f'{node.module}.{alias.name}')

    def _imported(self, node, name):
        parts = name.split('.')
        if name != '__future__.annotations' and any(map(is_private, parts)):
            self.broken(node, f'{name} is private')
        if parts[0] in ('ctypes', '_ctypes', 'cffi'):
            self.broken(node, f'{name} goes around the public interface')
        if parts[:2] == ['rclpy', 'impl'] or 'rclpy_implementation' in parts:
            self.broken(node, f'{name} is the inside of rclpy')

    def visit_Name(self, node):
        if node.id in ('rclpy_implementation', '_rclpy'):
            self.broken(node, f'{node.id} is the inside of rclpy')


def broken_rules(tree, here, classes):
    rules = Rules({**classes, **here}, set(here))  # its own come first
    rules.visit(tree)
    return rules.found


def rules_broken_by(source):
    tree = ast.parse(source)
    return broken_rules(tree, classes_of(tree), {})


def test_only_public_interfaces_are_used():
    trees = {path: ast.parse(path.read_text()) for path in FILES}
    here = {path: classes_of(tree) for path, tree in trees.items()}
    everywhere = {name: one for classes in here.values() for name, one in classes.items()}
    for path, tree in trees.items():
        assert broken_rules(tree, here[path], everywhere) == [], path


def test_raw_messages_are_taken_in_one_place():
    """`handle.take_message` is public by name, but no page of rclpy describes it."""
    assert len([path.name for path in FILES if '.take_message(' in path.read_text()]) <= 1


BROKEN = {
    'private attribute': 'executor._tasks',
    'of a module': 'rclpy._rclpy_pybind11.RCLError',
    'of a base that is not ours': (
        'class Ours(Node):\n    def f(self):\n        return self._parameter_overrides'
    ),
    'of an object of another class of ours': (
        'class One:\n    def __init__(self):\n        self._x = 1\n'
        'class Two:\n    def f(self, one):\n        return one._x'
    ),
    'set from outside': 'node._clock = None',
    'by name': "getattr(executor, '_tasks')",
    'by attrgetter': "attrgetter('_tasks')",
    'implementation': 'from rclpy.impl.implementation_singleton import rclpy_implementation',
    'whole of it': 'import rclpy.impl.rcutils_logger',
    'private module': 'from rclpy._rclpy_pybind11 import Node',
    'ctypes': 'import ctypes',
    'part of ctypes': 'from ctypes import CDLL',
    'environment': "os.environ['ROS_DOMAIN_ID'] = '1'",
    'any variable': "os.environ['HOME'] = '/'",
    'environment by another name': "environment['FASTDDS_BUILTIN_TRANSPORTS'] = 'UDPv4'",
    'deleted': "del os.environ['RMW_IMPLEMENTATION']",
    'updated': "os.environ.update(ROS_DOMAIN_ID='1')",
    'default': "environ.setdefault('ROS_DOMAIN_ID', '1')",
    'putenv': "os.putenv('ROS_DOMAIN_ID', '1')",
}


@pytest.mark.parametrize('name', BROKEN)
def test_a_broken_rule_is_found(name):
    assert len(rules_broken_by(BROKEN[name])) >= 1


ALLOWED = {
    'own': (
        'class Own:\n    def __init__(self):\n        self._x = 1\n'
        '    def __eq__(self, other):\n        return self._x == other._x'
    ),
    'own base': (
        'class Base:\n    def _f(self): ...\nclass Own(Base):\n    def g(self):\n'
        '        return self._f()'
    ),
    'own class by its name': ('class Own:\n    def _f(self): ...\nTABLE = {1: Own._f}'),
    'argument of a class of the same module': (
        "class Own:\n    def _f(self): ...\ndef wrap(self: 'Own'):\n    return self._f()"
    ),
    'slots': ("class Own:\n    __slots__ = ('_x',)\n    def f(self):\n        return self._x"),
    'named tuple': 'layout._replace(start=0.1)',
    'dunder': 'kind.__name__',
    'environment read': "os.environ.get('ROS_STATIC_PEERS') or os.environ['HOME']",
    'another mapping': "values['x'] = 1",
    'public': 'subscription.handle.take_message(kind, False)',
}


@pytest.mark.parametrize('name', ALLOWED)
def test_what_is_public_or_our_own_is_allowed(name):
    assert rules_broken_by(ALLOWED[name]) == []
