# SPDX-License-Identifier: Apache-2.0
"""The SROS2 policy allows what the running processes do, and names no more than they can do."""

from fnmatch import fnmatchcase
from pathlib import Path
from xml.etree import ElementTree

import pytest
import ros_harness as ros
from rclpy.action import (
    get_action_client_names_and_types_by_node,
    get_action_server_names_and_types_by_node,
)

from homing_node.procedures.states import Input

NODES = (
    'homing_node',
    'homing_coordinator',
    '_homing_coordinator_axes',
    'homed_axes',
    'simulated_axes',
)
POLICY = Path(__file__).resolve().parent.parent / 'config' / 'sros2_policy.xml'
#: Names that no process of this test has: the time is real, the interface is `trajectory`.
ELSEWHERE = {
    '/clock',
    '/homing_node/position_commands',
    '/homing_node/dof_commands',
    '/homing_node/*/deadman',  # in a jog with a deadman
    # of a managed node
    '/homing_node/change_state',
    '/homing_node/get_state',
    '/homing_node/get_available_states',
    '/homing_node/get_available_transitions',
    '/homing_node/get_transition_graph',
    '/homing_node/transition_event',
    # of a coordinator that was asked to cancel
    '/*/homing_node/cancel',
    '/*/homing_node/*/cancel',
    # of a controller and its manager, which are not here
    '/*/get_parameters',
    '/*/list_parameters',
    '/*/list_controllers',
}


def allowed():
    """Return (node, list, right) → the full names that the policy allows, * for any axis."""
    found = {}
    for profile in ElementTree.parse(POLICY).iter('profile'):
        namespace, node = profile.get('ns'), profile.get('node')
        for rules in profile:
            ((right, rule),) = rules.attrib.items()
            assert rule == 'ALLOW'
            found[node, rules.tag, right] = {
                full_name(entry.text, namespace, node) for entry in rules
            }
    return found


def full_name(name, namespace, node):
    if name.startswith('~'):
        return f'{namespace}{node}{name[1:]}'
    return name if name.startswith('/') else f'{namespace}{name}'


def used(graph, node):
    """Return (list, right) → the names that a node has in the graph."""

    def names(found):
        return {name for name, _ in found if '/_action/' not in name}

    return {
        ('topics', 'publish'): names(graph.get_publisher_names_and_types_by_node(node, '/')),
        ('topics', 'subscribe'): names(graph.get_subscriber_names_and_types_by_node(node, '/')),
        ('services', 'reply'): names(graph.get_service_names_and_types_by_node(node, '/')),
        ('services', 'request'): names(graph.get_client_names_and_types_by_node(node, '/')),
        ('actions', 'execute'): names(get_action_server_names_and_types_by_node(graph, node, '/')),
        ('actions', 'call'): names(get_action_client_names_and_types_by_node(graph, node, '/')),
    }


@pytest.fixture(scope='module')
def seen(tmp_path_factory):
    """Run a node with an axis and a gantry, their plant, the relay, and a coordinator."""
    inputs = {
        'x': {
            'switches': [str(i) for i in Input],
            'near_ls_type': 'Dec',
            'external_ls_type': 'Dec',
            'apply': 'relay',
        },
        'y': {'followers': ['y2'], 'max_skew': 0.002},
    }
    pairs = {f'{kind}_negative_limit_switch': [-0.055, 0.0] for kind in ('near', 'external')}
    pairs |= {f'{kind}_positive_limit_switch': [0.08, 0.135] for kind in ('near', 'external')}
    plant = ros.plant_parameters(
        {'x': {**pairs, 'touch_probe': 0.05}, 'y': {'followers': ['y2'], 'y2': {'stiffness': 1e5}}}
    )
    parameters = ros.node_parameters(inputs)
    with ros.World(tmp_path_factory.mktemp('security'), parameters, plant) as world:
        graph = world.client.node
        relay = {'axes': ['x'], 'x': parameters['x'], 'controllers': ['/controller']}
        world.run('homed_axes', relay)
        line = {'nodes': ['/cell1/homing_node'], 'steps': ['cell1/x']}
        world.run('homing_coordinator', line)

        def complete():
            if not set(NODES) <= set(graph.get_node_names()):
                return None
            found = {name: used(graph, name) for name in NODES}
            node, axes = found['homing_node'], found['simulated_axes']
            return (
                node['actions', 'execute']
                and '/homing_node/x/servo' in node['services', 'reply']
                and '/homing_node/y/y2/home_switch' in node['topics', 'subscribe']
                and '/simulated_axes/transition_event' in node['topics', 'subscribe']
                and '/homing_node/setpoints' in axes['topics', 'subscribe']
                and found['homed_axes']['actions', 'call']
                and found['homing_coordinator']['actions', 'call']
                and found['_homing_coordinator_axes']['services', 'reply']
                and found
            )

        world.client.until(complete, what='the whole graph')
        world.client.pass_time(1.0)  # what comes late must be allowed, too
        yield complete()


@pytest.mark.parametrize('node', NODES)
def test_the_policy_allows_what_a_process_does(seen, node):
    for (kind, right), names in seen[node].items():
        rules = allowed().get((node, kind, right), set())
        missing = {name for name in names if not any(fnmatchcase(name, rule) for rule in rules)}
        assert missing == set(), (kind, right)


@pytest.mark.parametrize('node', NODES)
def test_the_policy_allows_nothing_that_a_process_does_not_do(seen, node):
    ours = {key: rules for key, rules in allowed().items() if key[0] == node}
    assert ours
    for (_, kind, right), rules in ours.items():
        names = seen[node][kind, right]
        useless = {rule for rule in rules if not any(fnmatchcase(n, rule) for n in names)}
        assert useless <= ELSEWHERE | {'/parameter_events', '/rosout'}, (kind, right)
