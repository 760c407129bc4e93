# SPDX-License-Identifier: Apache-2.0
"""The executables: help and version before ROS is loaded, and no traceback at Ctrl-C.

This module loads next to nothing: while it is loaded, Ctrl-C makes a traceback.
"""

import sys
from collections.abc import Sequence
from importlib import import_module

INTERRUPTED, USAGE = 130, 2
#: The modules of the nodes, and what their help says.
NODES = {
    'homing_node': (
        'homing_node.ros.main',
        """\
usage: homing_node --ros-args --params-file axes.yaml [further ROS arguments]

Homes machine axes: the node. Its parameters say which axes there are and how they are wired.

  ros2 run homing_node homing_node --ros-args --params-file axes.yaml
  ros2 launch homing_node homing.launch.py config:=axes.yaml

`homing check axes.yaml` proves a configuration before the first motion, `homing doctor` looks at
the running system, `homing home` homes. Exit status: 0 after SIGINT or SIGTERM, 1 for bad
parameters, or where a part of the node broke.
""",
    ),
    'homing_coordinator': (
        'homing_node.ros.coordinator',
        """\
usage: homing_coordinator --ros-args --params-file line.yaml [further ROS arguments]

Homes the axes of several homing nodes in steps, and locks those whose prerequisites are not homed.

  ros2 launch homing_node line.launch.py
""",
    ),
    'homed_axes': (
        'homing_node.ros.relay.homed_axes',
        """\
usage: homed_axes --ros-args --params-file axes.yaml [further ROS arguments]

The relay: the machine in homed coordinates, between the world and the controllers.
It reads the parameter file of homing_node and one of its own.
""",
    ),
    'simulated_axes': (
        'homing_node.ros.simulated.axes',
        """\
usage: simulated_axes --ros-args --params-file machine.yaml [further ROS arguments]

A simulated machine to try homing_node on: drives, switches and index pulses of some axes.

  ros2 launch homing_node demo.launch.py
""",
    ),
}


def homing_node() -> int:
    """Run the node."""
    return _node('homing_node')


def homing_coordinator() -> int:
    """Run the coordinator of several cells."""
    return _node('homing_coordinator')


def homed_axes() -> int:
    """Run the relay."""
    return _node('homed_axes')


def simulated_axes() -> int:
    """Run the simulated axes."""
    return _node('simulated_axes')


def homing() -> int:
    """Run the command `homing`."""
    return _main('homing', 'homing_node.cli')


def _node(name: str) -> int:
    module, text = NODES[name]
    for argument in _own_arguments(sys.argv[1:]):
        if argument in ('-h', '--help'):
            print(text, end='')
            return 0
        if argument == '--version':
            from importlib import metadata

            print(f'{name} {metadata.version("homing_node")}')
            return 0
        if argument.endswith(('.yaml', '.yml')):
            hint = f'give a parameter file so: {name} --ros-args --params-file {argument}'
            print(f'{name}: {argument}: {hint}', file=sys.stderr)
            return USAGE
    return _main(name, module)


def _own_arguments(arguments: Sequence[str]) -> list[str]:
    """Return the arguments that are none of ROS: those between --ros-args and -- are."""
    own, of_ros = [], False
    for argument in arguments:
        if argument in ('--ros-args', '--'):
            of_ros = argument == '--ros-args'
        elif not of_ros:
            own.append(argument)
    return own


def _main(name: str, module: str) -> int:
    try:
        status: int = import_module(module).main()
    except KeyboardInterrupt:
        print(f'{name}: interrupted', file=sys.stderr)
        return INTERRUPTED
    return status
