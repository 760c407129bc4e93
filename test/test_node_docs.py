# SPDX-License-Identifier: Apache-2.0
"""What a reader may copy from the documentation, against real nodes.

As far as this goes without the `ros2` command, which is not on PyPI: names and types are looked up
in the graph, goals are made of the YAML, parameters are set.
"""

import math
import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
import ros_harness as ros
import yaml
from doc_blocks import (
    BLOCKS,
    GUIDE,
    ROOT,
    ROS_INTERFACE,
    TUTORIAL,
    axes_yaml,
    blocks_of,
    commands,
    each,
)
from homing_interfaces.action import Home, Jog
from rcl_interfaces.srv import DescribeParameters
from rclpy.action import get_action_names_and_types
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from homing_node.parameters.yaml_file import load
from homing_node.plant import layout_file
from homing_node.procedures.states import LIMIT_SWITCHES, Input

# -- the pages that are pasted as a whole ---------------------------------------------------------


def parts_of(page):
    """Yield the blocks of a page as parts of one script; a block of YAML or Python is a file."""
    text = page.read_text()
    for block in blocks_of(page):
        if block.language == 'bash':
            yield block.text.replace('make venv\n. .venv/bin/activate\n', '')
        else:
            before = text[: text.index(block.text)]
            name = re.findall(r'`(\w+\.(?:yaml|py))`', before)[-1]
            yield f"cat > {name} <<'END'\n{block.text}END\n"


def pasted(script, folder, timeout):
    """Run a script in a domain of its own; return what it said. None of its processes stays."""
    domain = ros.Domain()
    shell = subprocess.Popen(
        ['bash', '-c', '\n'.join(script)],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
        env={
            **os.environ,
            'ROS_DOMAIN_ID': str(domain.number),
            'ROS_HOME': str(folder / 'ros_home'),
            'PATH': f'{Path(sys.executable).parent}:{os.environ["PATH"]}',
        },
    )
    try:
        output = shell.communicate(timeout=timeout)[0]
    finally:
        end_session(shell.pid)
        shell.wait()
        domain.release()
    assert shell.returncode == 0, output
    return output


def end_session(leader):
    """Kill every process of a session: the jobs of a shell are in groups of their own."""
    for stat in Path('/proc').glob('[0-9]*/stat'):
        with suppress(OSError):
            session = stat.read_text().rpartition(')')[2].split()[3]
            if int(session) == leader:
                os.kill(int(stat.parent.name), signal.SIGKILL)


@pytest.mark.long
def test_the_tutorial(tmp_path):
    """Every block in its order: files are written, commands run, the axis homes."""
    output = pasted(['set -em', *parts_of(TUTORIAL)], tmp_path, 90)
    assert 'not good enough yet' in output
    assert 'axes.yaml: nothing found' in output
    assert '101 homed, 0 failed' in output
    home = re.search(r'^Homed: home_position_raw=(\S+)', output, re.MULTILINE)
    assert float(home[1]) == pytest.approx(0.25, abs=1e-5)
    made = {path.name for path in (tmp_path / 'my_machine').iterdir()}
    assert {'run.npz', 'run.png', 'starts.png', 'HSHS.svg'} <= made


@pytest.mark.long
def test_the_guide(tmp_path):
    """Every block in its order: the machine that is found is the one that was hidden."""
    script = ['set -em', *map(patient, parts_of(GUIDE))]
    (tmp_path / 'config').mkdir()
    hidden = ROOT / 'config' / 'simulated_axes.yaml'
    (tmp_path / 'config' / hidden.name).write_text(hidden.read_text())
    output = pasted(
        [*script[:1], 'trap "kill $(jobs -p) || true" EXIT', *script[1:]], tmp_path, 150
    )
    homes = re.findall(r'home_position_raw=(\S+)', output)
    assert len(homes) >= 2 and 'Verified: ' in output, output
    true = layout_file.load(hidden).layouts['x']
    path = tmp_path / 'my_machine' / 'machine.yaml'
    found, told = layout_file.load(path).layouts['x'], path.read_text()
    for name, low, high in (
        ('home_switch', true.switches['home_switch'].on_from, true.switches['home_switch'].on_to),
        ('positive_limit_switch', true.switches['positive_limit_switch'].on_from, math.inf),
        ('negative_limit_switch', -math.inf, true.switches['negative_limit_switch'].on_to),
    ):
        flag = found.switches[name]
        for place, seen in ((low, flag.on_from), (high, flag.on_to)):
            assert seen == place or abs(seen - place) <= stated(told, name), (name, told)
    assert abs(float(homes[0]) - true.switches['home_switch'].on_from) < 1e-4


def patient(part):
    """Give the node of the guide the patience that a busy machine needs in half a minute."""
    return part.replace("    axes: ['x']\n", "    axes: ['x']\n    cycle_timeout: 1.0\n").replace(
        '      max_jerk: 50.0\n',
        '      max_jerk: 50.0\n      feedback_timeout: 1.0\n      following_error: 0.025\n',
    )


def stated(told, name):
    """Return how far the numbers of a key may be off, as the comment behind them says, m."""
    line = next(line for line in told.splitlines() if line.strip().startswith(f'{name}:'))
    units = {'nm': 1e-9, 'µm': 1e-6, 'mm': 1e-3, 'm': 1.0}
    return max(float(n) * units[unit] for n, unit in re.findall(r'± (\S+) ([nµm]?m)\b', line))


# -- the commands, with the demo's nodes ----------------------------------------------------------


@pytest.fixture(scope='module')
def demo(tmp_path_factory):
    config = ROOT / 'config'
    patient = [
        f'{name}:=1.0'
        for name in (  # a busy machine may hold something up
            'cycle_timeout',
            *(f'{axis}.feedback_timeout' for axis in 'xyz'),
        )
    ]
    with ros.World(
        tmp_path_factory.mktemp('demo'),
        (config / 'demo.yaml').read_text(),
        (config / 'simulated_axes.yaml').read_text(),
        arguments=[word for value in patient for word in ('-p', value)],
    ) as world:
        world.run('homing_coordinator', (config / 'line.yaml').read_text())
        yield world


def types(world, names_and_types, *arguments):
    """Return a function that looks up the type of a name in the graph."""
    return lambda name: dict(names_and_types(*arguments)).get(name, [None])[0]


def test_service_calls(demo):
    look = types(demo, demo.client.node.get_service_names_and_types)
    found = commands(['ros2', 'service', 'call'])
    assert found
    for words in found:
        name, kind = words[3:5]
        demo.client.until(lambda n=name: look(n), what=name)
        assert look(name) == kind


def test_action_goals(demo):
    look = types(demo, get_action_names_and_types, demo.client.node)
    found = commands(['ros2', 'action', 'send_goal'])
    assert found
    for words in found:
        name, kind, goal = [word for word in words[3:] if not word.startswith('-')]
        values = yaml.safe_load(goal)
        if kind.endswith('/Jog'):
            assert Jog.Goal(**values).axis in {'x', 'y', 'z'}
        elif name.startswith('/homing_node/'):
            assert set(Home.Goal(**values).axes) <= {'x', 'y', 'z'}
        else:
            assert name == '/homing_coordinator/home' and Home.Goal(**values) is not None
            continue
        demo.client.until(lambda n=name: look(n), what=name)
        assert look(name) == kind


def test_topics(demo):
    look = types(demo, demo.client.node.get_topic_names_and_types)
    found = commands(['ros2', 'topic', 'echo'])
    assert found
    for words in found:
        demo.client.until(lambda n=words[3]: look(n), what=words[3])


def test_parameter_commands(demo):
    for words in commands(['ros2', 'param']):
        verb, node, name, *value = words[2:]
        assert node == demo.client.target
        if verb == 'set':
            result = demo.client.set(**{name.replace('.', '__'): yaml.safe_load(value[0])})
            assert result.successful, result.reason
        else:
            assert verb == 'describe'
            answer = demo.client.ask(DescribeParameters, 'describe_parameters', names=[name])
            assert answer.descriptors[0].description


@pytest.mark.long
@each('python')
def test_python_homes(block, demo):
    demo.client.start('z')  # so the node has heard the plant
    demo.client.trigger('z/cancel')
    done = subprocess.run(
        [sys.executable, '-c', block.text],
        capture_output=True,
        text=True,
        timeout=60,
        env={
            **os.environ,
            'ROS_DOMAIN_ID': str(demo.domain.number),
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        },
    )
    assert done.stdout.startswith('Homed: home_position_raw='), (done.stdout, done.stderr)


# -- README's own axis ----------------------------------------------------------------------------

RUNS = commands(['ros2', 'run'])
INTERFACES = {
    '~/setpoints': 'trajectory_msgs/msg/JointTrajectory',
    '~/position_commands': 'std_msgs/msg/Float64MultiArray',
}


@pytest.mark.parametrize('words', RUNS, ids=lambda words: words[-1])
def test_run_commands(words, tmp_path):
    package, executable, ros_args, option, file, *arguments = words[2:]
    assert (package, ros_args, option, file) == (
        'homing_node',
        '--ros-args',
        '--params-file',
        'axes.yaml',
    )
    assert executable in ros.MAINS
    with ros.World(tmp_path, axes_yaml(), arguments=arguments) as world:
        remapped, _, name = arguments[arguments.index('-r') + 1].partition(':=')
        node = world.client.node
        publishers = world.client.until(lambda: node.get_publishers_info_by_topic(name))
        assert [p.topic_type for p in publishers] == [INTERFACES[remapped]]


def levels_of(configured, axis):
    """Return topic → the level of a switch that is off, for every wired switch of an axis."""
    parameters, connections = configured.axes[axis], configured.connections[axis]
    return {
        connections.source(axis, source).topic.replace('~', '/homing_node'): parameters.inverted(
            source
        )
        for source in parameters.inputs
    }


QOS_BLOCKS = [b for b in BLOCKS if 'qos_overrides' in b.text]


@pytest.mark.long
@pytest.mark.parametrize('overridden', [True, False], ids=['overridden', 'plain'])
@pytest.mark.parametrize('block', QOS_BLOCKS, ids=lambda b: b.id)
def test_latching_driver(block, overridden, tmp_path):
    """Levels that were published once, before the node began, are heard without the block only."""
    text = (ROOT / 'config' / 'one_axis.yaml').read_text()
    file = tmp_path / 'axes.yaml'
    file.write_text(text)
    configured = load(file)
    override = tmp_path / 'qos.yaml'
    override.write_text(block.text)
    folder = tmp_path / 'run'
    folder.mkdir()
    domain = ros.Domain()
    client = ros.Client(domain)
    plant = ros.HandPlant(client, **{configured.joints['x']: 0.1})
    for topic, level in levels_of(configured, 'x').items():
        plant.set(topic, level)
    arguments = ['--params-file', str(override)] if overridden else []
    node = ros.Process('homing_node', folder, domain, text, arguments)
    client.watch(node)
    try:
        heard = client.record_states('x')
        if not overridden:
            asking = client.asking_to_home('x')
            moves = client.until(
                lambda: asking.answer() or any(h.message.state == 'HSSearch' for h in heard)
            )
            assert moves is True
            client.trigger('x/cancel')
            assert client.answer(asking.last).message.startswith('Canceled: ')
        else:
            asking = client.asking_to_home('x', 'FeedbackStale', unheard=())
            answer = client.until(asking.answer).message
            assert answer.startswith('SwitchUnknown: ')
            assert 'no message yet from home_switch' in answer
            assert 'positive_limit_switch' not in answer
    finally:
        client.watch()
        node.close()
        plant.close()
        client.close()
        domain.release()


# -- the tables of the ROS interface --------------------------------------------------------------


@pytest.fixture(scope='module')
def wired(tmp_path_factory):
    """Run a node with one axis and every input that there is."""
    parameters = ros.node_parameters(
        {
            'x': {
                'switches': [str(i) for i in Input],
                'near_ls_type': 'Dec',
                'external_ls_type': 'Dec',
            }
        }
    )
    with ros.World(tmp_path_factory.mktemp('wired'), parameters) as world:
        yield world


def listed(title):
    """Return full name → the cells of its row, of the tables below a title."""
    section = ROS_INTERFACE.read_text().partition(f'## {title}\n')[2].partition('\n## ')[0]
    found = {}
    for line in section.splitlines():
        if line.startswith('| `'):
            cells = [cell.strip() for cell in line.strip('|').split('|')]
            for name in re.findall(r'`([^`…]+)`', cells[0]):
                name = name.replace('~', '/homing_node').replace('<axis>', 'x')
                found[name if name.startswith('/') else f'/{name}'] = cells
    return found


@pytest.mark.parametrize('title', ['Inputs', 'Outputs'])
def test_topics_of_the_interface(wired, title):
    """Types and QoS in the tables are those of the graph."""
    node = wired.client.node
    ask = (
        node.get_subscriptions_info_by_topic
        if title == 'Inputs'
        else node.get_publishers_info_by_topic
    )
    rows = listed(title)
    if title == 'Outputs':  # of the interface that is not chosen there is no topic
        for name in ('/homing_node/position_commands', '/homing_node/dof_commands'):
            del rows[name]
            assert not node.get_publishers_info_by_topic(name)
    for name, (_, kind, qos, _) in rows.items():
        ends = wired.client.until(
            lambda n=name: [e for e in ask(n) if e.node_name == 'homing_node'], what=name
        )
        assert {e.topic_type.replace('/msg/', '/') for e in ends} == {kind.strip('`')}, name
        # The emergency stop has more subscriptions, which hear what others publish.
        latches, lossy = DurabilityPolicy.TRANSIENT_LOCAL, ReliabilityPolicy.BEST_EFFORT
        profile = min(
            (e.qos_profile for e in ends),
            key=lambda q: (q.durability is latches, q.reliability is lossy),
        )
        assert (profile.reliability is ReliabilityPolicy.BEST_EFFORT) == ('best effort' in qos), (
            name
        )
        assert (profile.durability is DurabilityPolicy.TRANSIENT_LOCAL) == (
            'transient local' in qos
        ), name


def test_no_input_is_missing_in_the_interface(wired):
    wired.client.until(lambda: 'homing_node' in wired.client.node.get_node_names())
    limits = {f'/homing_node/x/{limit}' for limit in LIMIT_SWITCHES}  # told by one row
    wired.client.until(
        lambda: (
            limits | set(listed('Inputs'))
            <= {name for name, _ in wired.client.node.get_topic_names_and_types()}
        )
    )
    subscribed = {
        name
        for name, _ in wired.client.node.get_subscriber_names_and_types_by_node('homing_node', '/')
        if name.startswith('/homing_node/')
    }
    assert subscribed | {'/joint_states'} == limits | set(listed('Inputs'))


def test_services_of_the_interface(wired):
    node = wired.client.node
    services = types(wired, node.get_service_names_and_types)
    actions = types(wired, get_action_names_and_types, node)
    seen = set()
    for name, (_, kind, _) in listed('Services and action').items():
        package, _, short = kind.strip('`').partition('/')
        look, part = (actions, 'action') if short in ('Home', 'Jog') else (services, 'srv')
        wired.client.until(lambda n=name, look=look: look(n), what=name)
        assert look(name) == f'{package}/{part}/{short}'
        seen.add(name)
    own = {
        name
        for name, _ in node.get_service_names_and_types_by_node('homing_node', '/')
        if 'parameter' not in name and 'type_description' not in name and '/_action/' not in name
    }
    assert own == seen - {'/homing_node/jog'}  # the one action that is no service, too
