# SPDX-License-Identifier: Apache-2.0
"""The demo's processes with the arguments that its launch file gives them home an axis."""

from pathlib import Path

import pytest
import ros_harness as ros
from launch_stand_in import launched

DEMO = Path(__file__).resolve().parent.parent / 'launch' / 'demo.launch.py'
TOPIC = '/axes/position_commands'


@pytest.mark.long
@pytest.mark.parametrize(
    'arguments',
    [
        {'namespace': 'cell'},
        {'namespace': 'cell', 'setpoint_topic': TOPIC, 'setpoint_interface': 'position'},
    ],
    ids=['namespace', 'topic and interface'],
)
def test_the_demo_homes_in_a_namespace(arguments, tmp_path, monkeypatch):
    generated, folder = tmp_path / 'generated', tmp_path / 'run'
    generated.mkdir()
    folder.mkdir()
    context = launched(DEMO, generated, **arguments)
    for name, value in context.environment.items():
        monkeypatch.setenv(name, value)
    node, plant = context.started
    assert (node.executable, plant.executable) == ('homing_node', 'simulated_axes')
    # On a busy machine the feedback may come late.
    patient = ['-p', 'cycle_timeout:=1.0', *('-p', 'z.feedback_timeout:=1.0')]
    with ros.World(
        folder,
        Path(node.option('--params-file')[0]).read_text(),
        Path(plant.option('--params-file')[0]).read_text(),
        node='/cell/homing_node',
        arguments=[*node.arguments, *patient],
        plant_arguments=plant.arguments,
    ) as world:
        answer = world.client.home('z')['z']
        assert answer.success, answer.message
        graph = world.client.node
        assert all(namespace == '/cell' for name, namespace in nodes(graph))
        if topic := arguments.get('setpoint_topic'):
            assert [e.node_name for e in graph.get_publishers_info_by_topic(topic)] == [
                'homing_node'
            ]
            assert [e.node_name for e in graph.get_subscriptions_info_by_topic(topic)] == [
                'simulated_axes'
            ]


def nodes(graph):
    """Return the names and namespaces of the processes' nodes, without those of the test."""
    return [
        (name, namespace)
        for name, namespace in graph.get_node_names_and_namespaces()
        if name not in ('client', 'listener')
    ]
