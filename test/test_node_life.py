# SPDX-License-Identifier: Apache-2.0
"""How the node starts, is wired and ends."""

import os
import re
import signal
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from statistics import median

import pytest
import ros_harness as ros
import yaml
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

# ------------------------------------------------------------------------------ bad parameters


def described(**changes):
    """Return node parameters of one axis with changes; None leaves one out."""
    axis = {**ros.AXIS, **changes}
    return {'axes': ['x'], 'x': {name: v for name, v in axis.items() if v is not None}}


def fault_cases():
    return {
        'several': (
            {
                **described(
                    travel=None,
                    homing_velocity_fst=0.1,
                    homing_velocity_slow=-1.0,
                    home_type='HSHSH',
                ),
                'update_rat': 250.0,
                'z': {'travel': 1.0},
            },
            [
                'x.travel',
                'x.homing_velocity_fst',
                "did you mean 'homing_velocity_fast'",
                'x.homing_velocity_slow: -1.0 m/s must be >= 1e-07 and <= 10000 m/s',
                "'HSHSH'",
                'update_rat',
                "did you mean 'update_rate'",
                "z: 'z' is none of the axes",
            ],
        ),
        'of every node': (
            {**described(), 'use_sim_time': 5},
            ['the parameters are not valid', 'use_sim_time'],
        ),
        'of QoS': (
            {
                **described(),
                'qos_overrides': {
                    '/homing_node/x/home_switch': {
                        'subscription': {'durablity': 'transient_local', 'depth': -1}
                    }
                },
            },
            ["did you mean 'durability'", 'depth: -1'],
        ),
        'a topic of another type': (
            described(topics={'home_switch': '/joint_states'}),
            ['x.topics.home_switch: cannot subscribe to /joint_states: '],
        ),
        'beyond every range': (
            described(travel=1e301, timeout=1e302),
            ['x.travel: 1e+301 m must be >= 1e-06 and <= 100000 m', 'x.timeout: 1e+302 s must be'],
        ),
        'unquoted y': (
            '/**:\n  ros__parameters:\n    axes: [x, y]\n',
            ['params', 'unquoted', "'y'"],
        ),
        'malformed': ('/**:\n  ros__parameters:\n   axes: ["x"\n    x: {\n', ['params']),
    }


@pytest.fixture(scope='module')
def refusals(tmp_path_factory):
    """All of them at once: (exit status, output) by case."""
    folder, domain = tmp_path_factory.mktemp('faults'), ros.Domain()
    processes = {
        name: ros.Process('homing_node', folder, domain, parameters)
        for name, (parameters, _) in fault_cases().items()
    }
    for process in processes.values():
        process.wait()
    domain.release()
    return {name: (process.wait(), process.output) for name, process in processes.items()}


@pytest.mark.parametrize('case', fault_cases())
def test_bad_parameters_stop_the_start(refusals, case):
    status, output = refusals[case]
    assert status == 1, output
    for part in fault_cases()[case][1]:
        assert part in output, output
    assert 'Traceback' not in output, output


# ------------------------------------------------------------------------------------- the end


@pytest.fixture(scope='module')
def ended(tmp_path_factory):
    """Let two nodes end in the middle of a search: what was seen, by signal."""
    seen = {}
    for number in (signal.SIGINT, signal.SIGTERM):
        with ros.World(
            tmp_path_factory.mktemp(number.name),
            ros.node_parameters({'x': {'travel': 1.0}}),
            anew=True,
        ) as world:
            client = world.client
            hand = ros.HandPlant(client, x=0.1)
            hand.set_levels('x')
            setpoints = client.record(JointTrajectory, 'setpoints')
            states = client.record_states('x')
            future = client.start('x')
            client.until(lambda s=setpoints: ros.course_of(s, 'x')[-1].velocity > 0.0499)
            client.watch()
            told, told_ns = time.monotonic(), time.time_ns()
            world.node.signal(number)
            client.until(lambda w=world: not w.node.alive)
            took = time.monotonic() - told
            client.until(future.done, 2.0, 'the answer of a node that ends')
            client.pump()
            hand.close()
        seen[number] = (world, setpoints, states, future.result(), took, told_ns)
    return seen


SIGNALS = pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])


@SIGNALS
def test_a_signal_stops_the_axis_within_its_deceleration(ended, number):
    _, setpoints, _, _, _, told = ended[number]
    samples = ros.course_of(setpoints, 'x')
    ros.assert_within_limits(samples, 0.05, 0.5, 20.0)
    assert samples[-1].velocity == samples[-1].acceleration == 0.0
    before = [s for s in samples if s.sent < told]
    # v^2 / 2a + v a / 2j, and a tenth of a second until the node has noticed.
    assert samples[-1].position - before[-1].position < 0.0025 + 0.000625 + 0.005
    assert samples[-1].position < 0.8  # in the middle of the search, not at its end


@SIGNALS
def test_a_signal_answers_the_request_and_ends_the_node(ended, number):
    world, _, states, answer, took, _ = ended[number]
    assert world.node.wait() == 0
    assert not answer.success
    assert answer.message.startswith('Canceled: axis x: '), answer.message
    assert took < 2.0
    assert 'Traceback' not in world.node.output
    assert ros.course(states)[-2:] == ['Cancel', 'Idle']
    assert states[-1].message.error == 'Canceled'


def test_every_executable_ends_with_its_interpreter(tmp_path):
    """Nothing of ROS is left that would break it."""
    parameters = {
        'homing_node': ros.node_parameters({'x': {}}),
        'simulated_axes': ros.plant_parameters({'x': {}}),
        'homing_coordinator': {'nodes': ['/cell/homing_node'], 'steps': ['cell/x']},
        'homed_axes': {'axes': ['x'], 'x': ros.AXIS, 'controllers': ['controller']},
    }
    ours = {name for name, module in ros.MAINS.items() if module.startswith('homing_node.')}
    assert set(parameters) == ours
    domain = ros.Domain()
    client = ros.Client(domain)
    processes = {
        name: ros.Process(name, tmp_path, domain, values, anew=True)
        for name, values in parameters.items()
    }
    client.watch(*processes.values())
    client.until(lambda: set(parameters) <= set(client.node.get_node_names()))
    client.watch()
    for process in processes.values():
        process.signal()
    for name, process in processes.items():
        assert process.wait() == 0, (name, process.output)
        assert 'Traceback' not in process.output, process.output
    client.close()
    domain.release()


@pytest.fixture
def breakable(tmp_path, monkeypatch):
    """Run a node with two axes that move, and a file that says what shall break."""
    trigger = tmp_path / 'break'
    monkeypatch.setenv('BREAK', str(trigger))
    monkeypatch.setenv(
        'PYTHONPATH',
        os.pathsep.join([str(Path(__file__).parent), os.environ.get('PYTHONPATH', '')]),
    )
    monkeypatch.setitem(ros.MAINS, 'homing_node', 'breaking_node')
    axes = {'x': {'home_type': 'HS', 'travel': 1.0}, 'y': {'travel': 1.0}}
    long = {
        'hard_stops': [-0.005, 1.005],
        'positive_limit_switch': [1.0, 1.2],
        'home_switch': [0.9, 0.91],
    }
    plant = {'x': {**long, 'start': 0.1}, 'y': {**long, 'start': 0.7}}
    with ros.World(tmp_path, ros.node_parameters(axes), ros.plant_parameters(plant)) as world:
        setpoints = world.client.record(JointTrajectory, 'setpoints')
        answers = {axis: world.client.start(axis) for axis in axes}
        for axis in axes:
            ros.at_speed(world.client, setpoints, axis)
        yield world, setpoints, answers, trigger


@pytest.mark.parametrize(
    ('part', 'name'),
    [pytest.param('reports', 'reports', marks=pytest.mark.long), ('inputs', 'cycle')],
)
def test_a_thread_that_breaks_stops_the_axes_and_ends_the_node(breakable, part, name):
    world, setpoints, answers, trigger = breakable
    world.client.watch()
    trigger.write_text(part)
    world.client.until(lambda: not world.node.alive)
    assert world.node.wait() == 1
    assert f'the {name} broke' in world.node.output
    assert "OSError('the network is gone')" in world.node.output
    for axis in answers:
        samples = ros.course_of(setpoints, axis)
        ros.assert_within_limits(samples, 0.05, 1.0, ros.AXIS['max_jerk'])
        assert samples[-1].velocity == samples[-1].acceleration == 0.0
    for answer in answers.values():
        assert world.client.answer(answer).message.startswith('Canceled: ')
    world.processes.remove(world.node)


@pytest.mark.long
def test_an_axis_that_breaks_stops_alone(breakable):
    """The node goes on, and so does the other axis."""
    world, setpoints, answers, trigger = breakable
    trigger.write_text('HS')
    answer = world.client.answer(answers['x'])
    assert answer.message.startswith("InternalError: axis x: OSError('the network is gone')")
    assert world.client.answer(answers['y']).success
    assert ros.course_of(setpoints, 'y')[-1].velocity == 0.0
    trigger.unlink()
    world.client.start('x')  # it is not broken for ever
    assert "axis x broke: OSError('the network is gone')" in world.node.output
    log = world.node.output
    world.processes.remove(world.node)  # its log has a traceback, as it should
    world.node.signal()
    world.client.watch()
    world.client.until(lambda: not world.node.alive)
    assert world.node.wait() == 0
    assert log.count('Traceback') == 1


# ------------------------------------------------------- position interface, names and topics


@pytest.fixture(scope='module')
def cell(tmp_path_factory):
    """Run a node of another name in a namespace, wired by remapping and by its parameters."""
    axes = {
        'a': {'topics': {'home_switch': '/io/flag', 'positive_limit_switch': 'io/limit'}},
        'b': {'joint': 'joint_b', 'home_direction': 'Negative', 'home_type': 'HS'},
        'c': {'home_type': 'HS'},
    }
    names = ['-r', '__ns:=/cell']
    with ros.World(
        tmp_path_factory.mktemp('cell'),
        ros.node_parameters(axes, setpoint_interface='position', home_sequence=['c, b', 'a']),
        ros.plant_parameters(
            {'a': {}, 'b': {**ros.mirrored(ros.LAYOUT), 'joint': 'joint_b'}, 'c': {}},
            target_node='/cell/homer',
            setpoint_interface='position',
        ),
        node='/cell/homer',
        arguments=[
            *names,
            '-r',
            '__node:=homer',
            '-r',
            'joint_states:=/cell/feedback',
            '-r',
            '~/c/home_switch:=/io/c',
        ],
        plant_arguments=[
            *names,
            '-r',
            'joint_states:=/cell/feedback',
            '-r',
            '/cell/homer/a/home_switch:=/io/flag',
            '-r',
            '/cell/homer/c/home_switch:=/io/c',
            '-r',
            '/cell/homer/a/positive_limit_switch:=/cell/io/limit',
        ],
    ) as world:
        yield world


def between_pauses(values, sent):
    """Return the stretches of a course; after a pause of a busy machine it begins from rest."""
    starts = [i for i in range(1, len(sent)) if sent[i] - sent[i - 1] > 8e6]
    return [values[a:b] for a, b in pairwise([0, *starts, len(values)])]


def test_a_sequence_in_a_namespace_with_position_commands(cell):
    client = cell.client
    commands = client.record(Float64MultiArray, 'position_commands')
    setpoints = client.record(JointTrajectory, 'setpoints')
    client.until(lambda: ('homer', '/cell') in client.node.get_node_names_and_namespaces())

    def answered():
        answer = client.trigger('home', 40.0)
        return None if answer.message.startswith(ros.UNHEARD) else answer

    answer = client.until(answered)
    assert answer.success, answer.message
    assert answer.message.startswith('Homed: ')
    assert not setpoints
    rows = [heard.message.data for heard in commands]
    assert [heard.sequence for heard in commands] == list(
        range(commands[0].sequence, commands[0].sequence + len(commands))
    )
    # In the order of `axes`; an axis that is idle keeps what it had.
    assert {len(row) for row in rows} == {3}
    assert rows[0] == pytest.approx([0.04, -0.04, 0.04], abs=1e-5)
    moved = {}
    for axis, joint in enumerate('abc'):
        values = [row[axis] for row in rows]
        changes = [i for i, (x, y) in enumerate(pairwise(values)) if x != y]
        moved[joint] = (changes[0], changes[-1])
        first, last = moved[joint]
        assert set(values[:first]) <= {values[0]}
        assert set(values[last + 1 :]) == {values[-1]}
        for stretch in between_pauses(values, [heard.sent for heard in commands]):
            derivative = stretch
            for limit in (0.05, 0.5, 20.0):
                derivative = [(y - x) / 0.004 for x, y in pairwise(derivative)]
                assert max(map(abs, derivative), default=0.0) <= limit * (1 + 1e-4) + 1e-6
    held = 52  # at first all are held for 0.2 s, because nobody says which joints they are
    assert moved['b'][0] < held + 5
    assert moved['c'][0] < held + 5
    assert moved['a'][0] > max(moved['b'][1], moved['c'][1])
    assert rows[-1] == pytest.approx([0.055, -0.055, 0.055], abs=1e-4)
    count = len(commands)
    client.pass_time(0.1)
    assert len(commands) == count


def test_topics_that_were_wired(cell):
    client = cell.client
    heard = dict(client.node.get_subscriber_names_and_types_by_node('homer', '/cell'))
    assert {
        '/io/flag',
        '/cell/io/limit',
        '/io/c',
        '/cell/feedback',
        '/cell/homer/a/negative_limit_switch',
        '/cell/homer/emergency_stop',
    } <= set(heard)
    assert '/cell/homer/a/home_switch' not in heard
    assert '/joint_states' not in heard


def test_parameters_under_another_name(cell):
    assert cell.client.get('a.travel', 'home_sequence') == [0.08, ['c, b', 'a']]


# ------------------------------------------------------------------------------------ a long life

#: Homings in a row; `make fuzz` asks for a thousand.
HOMINGS = 1000 if os.environ.get('HOMING_FUZZ') else 60
FAST = {
    'home_type': 'HS',
    'homing_velocity_fast': 0.2,
    'homing_velocity_fast_acc': 8.0,
    'homing_velocity_fast_dec': 8.0,
    'home_shift_velocity': 0.2,
    'home_shift_acc': 8.0,
    'home_shift_dec': 8.0,
    'max_jerk': 1000.0,
}


def held_by(process):
    """Return what a process holds: resident memory in bytes, threads, open files."""
    folder = Path('/proc', str(process.process.pid))
    pages = int((folder / 'statm').read_text().split()[1])
    return (
        pages * os.sysconf('SC_PAGE_SIZE'),
        len(list((folder / 'task').iterdir())),
        len(list((folder / 'fd').iterdir())),
    )


@pytest.mark.long
def test_homings_in_a_row(tmp_path):
    """Neither memory nor threads nor files nor the time of an answer grow."""
    axes = [f'a{i}' for i in range(4)]
    parameters = ros.node_parameters(dict.fromkeys(axes, FAST))
    with ros.World(
        tmp_path, parameters, ros.plant_parameters({axis: {} for axis in axes})
    ) as world:
        waits = []

        def home(times):
            for _ in range(times // len(axes)):
                begun = time.monotonic()
                answers = world.client.home(*axes)
                waits.append(time.monotonic() - begun)
                assert all(answer.success for answer in answers.values()), answers

        home(HOMINGS // 3)
        memory, threads, files = held_by(world.node)
        waits.clear()
        home(HOMINGS)
        grown, more_threads, more_files = held_by(world.node)
        assert more_threads <= threads
        assert more_files <= files
        assert grown - memory < 2e6  # 0.06 MB in 1000 homings
        third = len(waits) // 3
        assert median(waits[-third:]) < 2.0 * median(waits[:third])


# ----------------------------------------------------------------------------------- the process


#: A node that ends as soon as it has started, and first says what it is like.
SAYING = """
import gc, os, sys
from homing_node.ros import main
from homing_node.ros.node import HomingNode

before = dict(os.environ)

def start(node, start=HomingNode.start):
    print(gc.isenabled(), gc.get_freeze_count() > 10_000, dict(os.environ) == before)
    start(node)
    node.stop()

HomingNode.start = start
sys.exit(main.main())
"""


@pytest.mark.parametrize('udp', [{}, ros.UDP], ids=['shared memory', 'UDP'])
def test_what_a_process_does_to_itself(tmp_path, udp):
    """What exists at the start is frozen: a full collection would hold up the cycle by ms.

    It warns once where shared memory can hold up the setpoints, and changes no variable.
    """
    file = tmp_path / 'parameters.yaml'
    file.write_text(yaml.dump({'/**': {'ros__parameters': described()}}, Dumper=ros.PlainDumper))
    domain = ros.Domain()
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain.number)}
    del environment['FASTRTPS_DEFAULT_PROFILES_FILE']
    ended = subprocess.run(
        [sys.executable, '-c', SAYING, '--ros-args', '--params-file', str(file)],
        check=False,
        env={**environment, **udp},
        capture_output=True,
        text=True,
        timeout=ros.PATIENCE,
    )
    domain.release()
    assert ended.returncode == 0, ended.stderr
    assert ended.stdout == 'True True True\n'
    assert ended.stderr.count('shared memory of Fast DDS') == (0 if udp else 1)


# ------------------------------------------------------------------------------------- the demo


@pytest.mark.long
@pytest.mark.parametrize(
    ('script', 'says', 'most'),
    [('demo', r'home is (\S+) µm off', 10.0), ('demo_gantry', r'y2 is (\S+) µm out of', 50.0)],
)
def test_the_demo(script, says, most):
    """What `make demo` and `make demo-gantry` run homes an axis and draws its course."""
    root = Path(__file__).resolve().parent.parent
    domain = ros.Domain()
    environment = {**os.environ, 'ROS_DOMAIN_ID': str(domain.number)}
    del environment['FASTRTPS_DEFAULT_PROFILES_FILE']  # a user has none
    begin = time.time()
    ended = subprocess.run(
        [sys.executable, str(root / 'scripts' / f'{script}.py')],
        env=environment,
        check=False,
        capture_output=True,
        text=True,
        timeout=3 * ros.PATIENCE,
    )
    domain.release()
    assert ended.returncode == 0, ended.stdout + ended.stderr
    (off,) = re.findall(says, ended.stdout)
    assert abs(float(off)) < most
    assert 'Traceback' not in ended.stderr
    assert (root / f'{script}.png').stat().st_mtime >= begin
