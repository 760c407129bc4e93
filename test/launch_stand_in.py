# SPDX-License-Identifier: Apache-2.0
"""A small part of `launch` and `launch_ros`, which PyPI does not have: what our files use of them.

`launched` runs a launch file with these classes and returns the processes that it would start,
with their command lines as launch_ros writes them, and the environment variables that it sets.
"""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import NamedTuple
from unittest import mock

import yaml

ROOT = Path(__file__).resolve().parent.parent


class Started(NamedTuple):
    """A process that a launch file starts."""

    package: str
    executable: str
    arguments: list[str]

    def option(self, name):
        """Return the values of an option that can stand more than once."""
        return [
            value
            for word, value in zip(self.arguments, self.arguments[1:], strict=False)
            if word == name
        ]


class Context:
    """What is known while a launch file runs; a user's function of OpaqueFunction gets it."""

    def __init__(self, folder, given):
        self.folder = folder
        self.launch_configurations = dict(given)
        self.environment = {}
        self.declared = {}
        self.started = []

    def text(self, value):
        return value.perform(self) if hasattr(value, 'perform') else value


class LaunchConfiguration:
    def __init__(self, name):
        self.name = name

    def perform(self, context):
        return context.launch_configurations[self.name]


class FindPackageShare:
    """Where setup.py installs a package's files; here they are in the repository."""

    def __init__(self, package):
        assert package == 'homing_node'

    def perform(self, context):
        return str(ROOT)


class PathJoinSubstitution:
    def __init__(self, parts):
        self.parts = parts

    def perform(self, context):
        return '/'.join(context.text(part) for part in self.parts)


class DeclareLaunchArgument:
    def __init__(self, name, *, default_value=None, description, choices=None):
        self.name, self.default, self.description = name, default_value, description
        self.choices = choices

    def visit(self, context):
        context.declared.setdefault(self.name, self)
        values = context.launch_configurations
        if self.name not in values:
            if self.default is None:
                raise RuntimeError(f'argument {self.name} is required')
            values[self.name] = context.text(self.default)
        if self.choices and values[self.name] not in self.choices:
            raise RuntimeError(f'{self.name}:={values[self.name]} is none of {self.choices}')


class SetEnvironmentVariable:
    def __init__(self, name, value):
        self.name, self.value = name, value

    def visit(self, context):
        context.environment[self.name] = self.value


class OpaqueFunction:
    def __init__(self, *, function):
        self.function = function

    def visit(self, context):
        for entity in self.function(context):
            entity.visit(context)


class LaunchDescription:
    def __init__(self, entities):
        self.entities = entities

    def visit(self, context):
        for entity in self.entities:
            entity.visit(context)


class PythonLaunchDescriptionSource:
    def __init__(self, path):
        self.path = path


class IncludeLaunchDescription:
    def __init__(self, source, *, launch_arguments=()):
        self.source, self.arguments = source, launch_arguments

    def visit(self, context):
        values = {name: context.text(value) for name, value in self.arguments}
        context.launch_configurations.update(values)
        description_of(context.text(self.source.path)).visit(context)


class ParameterValue:
    def __init__(self, value, *, value_type):
        self.value, self.kind = value, value_type

    def perform(self, context):
        value = context.text(self.value)
        return {'true': True, 'false': False}[value] if self.kind is bool else self.kind(value)


class Node:
    def __init__(
        self,
        *,
        package,
        executable,
        output,
        namespace='',
        parameters=(),
        remappings=(),
        ros_arguments=(),
        arguments=(),
    ):
        assert output == 'screen'
        self.package, self.executable, self.namespace = package, executable, namespace
        self.parameters, self.remappings, self.ros_arguments = (
            parameters,
            remappings,
            ros_arguments,
        )
        self.arguments = arguments

    def visit(self, context):
        words = [
            *self.arguments,
            '--ros-args',
            *map(context.text, self.ros_arguments),
            '--ros-args',
        ]
        if namespace := context.text(self.namespace):
            words += ['-r', f'__ns:=/{namespace.strip("/")}']
        for parameters in self.parameters:
            words += ['--params-file', self._file(context, parameters)]
        for name, to in self.remappings:
            words += ['-r', f'{name}:={context.text(to)}']
        context.started.append(Started(self.package, self.executable, words))

    def _file(self, context, parameters):
        if not isinstance(parameters, dict):
            return context.text(parameters)
        values = {name: context.text(value) for name, value in parameters.items()}
        file = context.folder / f'launch_params_{len(context.started)}.yaml'
        file.write_text(yaml.safe_dump({'/**': {'ros__parameters': values}}))
        return str(file)


MODULES = {
    'launch': [LaunchDescription],
    'launch.actions': [
        DeclareLaunchArgument,
        IncludeLaunchDescription,
        OpaqueFunction,
        SetEnvironmentVariable,
    ],
    'launch.launch_description_sources': [PythonLaunchDescriptionSource],
    'launch.substitutions': [LaunchConfiguration, PathJoinSubstitution],
    'launch_ros': [],
    'launch_ros.actions': [Node],
    'launch_ros.parameter_descriptions': [ParameterValue],
    'launch_ros.substitutions': [FindPackageShare],
}


def description_of(path):
    """Return what a launch file's function returns, made of the classes of this module."""
    modules = {}
    for name, classes in MODULES.items():
        modules[name] = ModuleType(name)
        modules[name].__dict__.update({one.__name__: one for one in classes})
    spec = importlib.util.spec_from_file_location('launch_file', path)
    module = importlib.util.module_from_spec(spec)
    with mock.patch.dict(sys.modules, modules):
        spec.loader.exec_module(module)
    return module.generate_launch_description()


def launched(path, folder, **arguments):
    """Run a launch file with arguments; return the context after it.

    Args:
        path: The launch file.
        folder: Where parameters that the launch file sets are written.
        arguments: Values by name, as in `ros2 launch … name:=value`.
    """
    context = Context(folder, arguments)
    description_of(path).visit(context)
    return context
