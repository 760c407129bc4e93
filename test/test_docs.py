# SPDX-License-Identifier: Apache-2.0
"""The documentation: its links and tables, and every block that a reader may copy.

The commands run against real nodes as far as this goes without the `ros2` command, which is not on
PyPI: names and types are looked up in the graph, goals are made of the YAML, parameters are set.
"""

import ast
import dataclasses
import importlib.util
import math
import os
import re
import shlex
import signal
import subprocess
import sys
from contextlib import suppress
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

import pytest
import ros_harness as ros
import yaml
from core_rig import rig
from homing_interfaces.action import Home, Jog
from rcl_interfaces.srv import DescribeParameters
from rclpy.action import get_action_names_and_types
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from record_rig import Recorded

from homing_node.cli import main
from homing_node.parameters.axis import DEFINITIONS
from homing_node.parameters.configuration import configuration
from homing_node.parameters.yaml_file import load, read
from homing_node.plant import layout_file
from homing_node.plant.layout import SWITCHES, AxisLayout
from homing_node.procedures.cia402 import METHODS
from homing_node.procedures.states import LIMIT_SWITCHES, Error, HomeType, Input, LSType, State
from homing_node.recording.folder import RecordFolder
from homing_node.ros.simulated.settings import Settings

ROOT = Path(__file__).resolve().parent.parent
DOC = ROOT / 'doc'
PAGES = [ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *sorted(DOC.rglob('*.md'))]
README = ROOT / 'README.md'
GUIDE = DOC / 'guide.md'
TUTORIAL = DOC / 'tutorial.md'
ROS_INTERFACE = DOC / 'ros_interface.md'
IMAGES = ('.svg', '.png', '.pdf', '.jpg')


class Block(NamedTuple):
    """A fenced block of a page."""

    page: Path
    language: str
    text: str
    line: int

    @property
    def id(self):
        return f'{self.page.name}:{self.line}'


def blocks_of(page):
    text = page.read_text()
    for found in re.finditer(r'^```(\w*)\n(.*?)^```$', text, re.MULTILINE | re.DOTALL):
        yield Block(page, found[1], found[2], text.count('\n', 0, found.start()) + 1)


BLOCKS = [block for page in PAGES for block in blocks_of(page)]


def each(language):
    found = [b for b in BLOCKS if b.language == language]
    return pytest.mark.parametrize('block', found, ids=lambda b: b.id)


def commands(first):
    """Return the words of every documented command that begins with these words."""
    lines = [line for b in BLOCKS if b.language == 'bash' for line in b.text.splitlines()]
    words = [shlex.split(line, comments=True) for line in lines]
    return [w for w in words if w[: len(first)] == list(first)]


# -- what needs no node ---------------------------------------------------------------------------


@pytest.mark.parametrize('page', PAGES, ids=lambda p: str(p.relative_to(ROOT)))
def test_links(page):
    text = re.sub(r'^```.*?^```$', '', page.read_text(), flags=re.MULTILINE | re.DOTALL)
    for target in re.findall(r'\]\(([^)\s]+)\)', text):
        if target.startswith('https://'):
            continue
        name, _, anchor = target.partition('#')
        file = page.parent / name if name else page
        assert file.exists(), f'{page.name}: {target}'
        if anchor:
            titles = re.findall(r'^#+ (.*)$', file.read_text(), re.MULTILINE)
            anchors = {re.sub(r'[^\w -]', '', t.lower()).replace(' ', '-') for t in titles}
            assert anchor in anchors, f'{page.name}: {target}'


@each('bash')
def test_shell_syntax(block):
    subprocess.run(['bash', '-n'], input=block.text, text=True, check=True)


@each('python')
def test_python_compiles(block):
    compile(block.text, block.id, 'exec')


def axes_yaml():
    """Return README's own axis."""
    return next(b.text for b in blocks_of(README) if b.language == 'yaml')


@each('yaml')
def test_yaml(block, tmp_path):
    """A block for the node is a good configuration, by itself or beside README's axis."""
    file = tmp_path / 'axes.yaml'
    file.write_text(block.text)
    if 'hard_stops' in block.text:
        assert layout_file.load(file).layouts
    elif '/**' not in yaml.safe_load(block.text):
        (parameters,) = yaml.safe_load(block.text).values()
        assert set(parameters) == {'ros__parameters'}
    elif 'axes:' in block.text:
        load(file)
    else:
        found = read(file).values
        file.write_text(axes_yaml())
        configuration({**read(file).values, **found})


def test_homing_commands(tmp_path, monkeypatch, capsys):
    """What other pages than the tutorial show of the command line works on README's axis."""
    pages = [b.text for b in BLOCKS if b.language == 'bash' and b.page not in (TUTORIAL, GUIDE)]
    found = [
        shlex.split(line, comments=True)
        for text in pages
        for line in text.splitlines()
        if line.startswith('homing ')
    ]
    assert {words[1] for words in found} >= {'check', 'run', 'diagram'}
    monkeypatch.chdir(tmp_path)
    Path('config').symlink_to(ROOT / 'config')
    Path('axes.yaml').write_text(axes_yaml())
    foreign = Path(__file__).with_name('foreign') / 'servo_router.ini'
    Path('machine.ini').write_text(foreign.read_text())
    Path('machine.yaml').write_text(
        yaml.safe_dump(
            {
                'x': {
                    'hard_stops': [0.0, 0.4],
                    'negative_limit_switch': [-0.1, 0.01],
                    'positive_limit_switch': [0.39, 0.5],
                    'home_switch': [0.1, 0.12],
                    'start': 0.2,
                    'inverted': ['home_switch'],
                }
            }
        )
    )
    recorded = Recorded(rig('HS').rehearsal(), RecordFolder(tmp_path / 'kept', '/n', 9, 9))
    recorded.home()
    (kept,) = Path('kept').glob('*.mcap')
    kept.rename('run.mcap')
    for words in found:
        if words[1] == 'convert':
            words[words.index('-o') + 1] = 'converted.yaml'
        if words[1] in ('doctor', 'record'):  # test_node_{doctor,record}.py have a node for them
            with pytest.raises(SystemExit, match=r'^0$'):
                main([*words[1:], '--help'])
        else:
            assert main(words[1:]) == 0, (words, capsys.readouterr().out)


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


def test_make_targets_exist():
    makefile = (ROOT / 'Makefile').read_text()
    targets = {words[1] for words in commands(['make'])}
    assert {'demo', 'test'} <= targets
    for target in targets:
        assert re.search(rf'^{target}:', makefile, re.MULTILINE)


def test_launch_commands():
    found = commands(['ros2', 'launch'])
    assert found
    for words in found:
        package, file, *arguments = words[2:]
        text = (ROOT / 'launch' / file).read_text()
        assert package == 'homing_node'
        for argument in arguments:
            assert re.search(rf"DeclareLaunchArgument\(\s*'{argument.split(':=')[0]}'", text)


def test_parameters_page_is_generated():
    spec = importlib.util.spec_from_file_location('reference', ROOT / 'scripts' / 'reference.py')
    reference = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(reference)
    page = reference.page()
    assert (DOC / 'parameters.md').read_text() == page, 'run `make docs`'
    for name in DEFINITIONS:
        assert page.count(f'\n| `{name}` |') == 1


def test_pages_of_methods_and_of_other_files_are_generated():
    spec = importlib.util.spec_from_file_location('methods', ROOT / 'scripts' / 'methods.py')
    methods = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(methods)
    assert (DOC / 'cia402.md').read_text() == methods.cia402_page(), 'run `make docs`'
    assert (DOC / 'convert.md').read_text() == methods.convert_page(), 'run `make docs`'
    drawn = {number for family in methods.FAMILIES for number in family.numbers}
    moving = {number for number, one in METHODS.items() if one.direction}
    assert drawn == moving
    for family in methods.FAMILIES:
        assert (DOC / 'figures' / f'cia402_{family.name}.svg').stat().st_size < 40_000


def of_script(name):
    """Return a script that makes pages, as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / 'scripts' / f'{name}.py')
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_figure_is_one_that_the_tests_hold_to_the_code():
    """What is measured, or drawn of a real run, is not kept: nobody could see that it is old."""
    kept = {str(one.relative_to(DOC)) for one in DOC.rglob('*') if one.suffix in IMAGES}
    methods = {f'figures/cia402_{family.name}.svg' for family in of_script('methods').FAMILIES}
    of_types = {one for one in kept if one.startswith('types/figures/')}  # see test_diagram.py
    assert kept == of_types | methods | {
        'edges.svg',  # see test_edge_time.py
        'figures/gantry_square.svg',
        'figures/gantry_skew.svg',
    }


def test_a_figure_of_the_methods_shows_the_runs_as_they_are():
    """The one with the fewest runs: all are drawn by the same code."""
    methods = of_script('methods')
    family = min(methods.FAMILIES, key=lambda one: len(one.numbers))
    committed = (DOC / 'figures' / f'cia402_{family.name}.svg').read_text()
    assert methods.picture(family) == committed, 'run make docs'


def test_the_figures_of_the_gantry_show_its_runs_as_they_are(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / 'scripts')
    gantry = of_script('gantry')
    for name, delay in (('square', 0.0), ('skew', gantry.LATE)):
        committed = (DOC / 'figures' / f'gantry_{name}.svg').read_text()
        assert gantry.run(delay)[1] == committed, 'run make docs'


def rows_of(page, *columns):
    """Return the first cells of the table with these columns."""
    head = '| ' + ' | '.join(columns) + ' |\n'
    _, found, rest = page.read_text().partition(head)
    assert found, f'{page.name} has no table {columns}'
    return [line.split('|')[1].strip() for line in rest.split('\n\n')[0].splitlines()[1:]]


def names_in(cells):
    return [name for cell in cells for name in re.findall(r'`([^`]+)`', cell)]


def test_every_error_is_explained():
    found = re.findall(r'^\| `(\w+)` \|', (DOC / 'errors.md').read_text(), re.MULTILINE)
    assert sorted(found) == sorted(Error)


def test_every_state_is_explained():
    assert sorted(names_in(rows_of(DOC / 'homing.md', 'state', 'the axis'))) == sorted(State)


def test_every_setting_of_the_simulated_axes_is_explained():
    named = names_in(rows_of(ROS_INTERFACE, 'parameter', 'default', 'meaning'))
    settings = {field.name for field in dataclasses.fields(Settings)} - {'layouts', 'joints'}
    assert set(named) == settings | {'axes', '<axis>.joint', '<axis>.…', '<axis>.<follower>.…'}


def test_every_limit_switch_type_is_explained():
    assert sorted(names_in(rows_of(DOC / 'homing.md', 'LS Type', 'action'))) == sorted(LSType)


def findings(*folders):
    """Return every word that a finding can have, from the calls that make them."""
    place = {'found': 1, 'Finding': 2, '_beyond': 2}
    for path in [path for folder in folders for path in (ROOT / 'homing_node').glob(folder)]:
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call):
                name = getattr(call.func, 'attr', getattr(call.func, 'id', ''))
                word = call.args[place[name]] if name in place else None
                if isinstance(word, ast.Constant):
                    yield word.value


@pytest.mark.parametrize(
    ('page', 'folders'),
    [('check.md', ('check/*.py', 'cli/check.py')), ('doctor.md', ('diagnosis/*.py',))],
)
def test_every_finding_is_explained(page, folders):
    _, _, text = (DOC / page).read_text().partition('## Findings')
    cells = re.findall(r'^\| (`[a-z-]+`.*?) \|', text, re.MULTILINE)
    assert sorted(names_in(cells)) == sorted(set(findings(*folders)))


def test_every_key_of_a_layout_is_explained():
    found = names_in(rows_of(DOC / 'check.md', 'key', 'default', 'meaning'))
    fields = set(AxisLayout._fields) - {'switches'}
    assert sorted(found) == sorted({*SWITCHES, *fields, '_hysteresis', 'inverted'})


def test_every_room_has_its_place_in_contributing():
    named = names_in(rows_of(ROOT / 'CONTRIBUTING.md', 'room', 'what it holds'))
    for path in (ROOT / 'homing_node').iterdir():
        name = f'{path.name}/' if path.is_dir() else path.name
        assert name in named or name.startswith('__'), name


def test_every_test_is_named_in_contributing():
    named = names_in(rows_of(ROOT / 'CONTRIBUTING.md', 'file', 'what it is about'))
    for path in (ROOT / 'test').glob('test_*.py'):
        assert any(fnmatch(path.name, name) for name in named), path.name


def test_every_parameter_that_is_named_exists():
    others = ('parameters.md', 'convert.md')  # convert.md names those of other controllers
    text = ''.join(page.read_text() for page in PAGES if page.name not in others)
    prefixes = ('homing_', 'home_', 'max_', 'invert_', 'switch_', 'mechanical_end_detection_')
    known = {
        *DEFINITIONS,
        *Input,
        *(field.name for field in dataclasses.fields(Settings)),
        *AxisLayout._fields,
        'homing_node',
        'homing_interfaces',
        'home_sequence',
        'home_position_raw',
        'home_offset',
        'homing_coordinator',
        'home_source',
        'home_types',
        'switch_controller',  # a service
    }
    named = {name for name in re.findall(r'`([a-z_]+)`', text) if name.startswith(prefixes)}
    assert named - known == set()


def test_every_python_file_that_is_named_exists():
    existing = {
        path.name
        for folder in ('homing_node', 'test', 'scripts', 'examples')
        for path in (ROOT / folder).rglob('*.py')
    }
    for page in PAGES:
        named = set(re.findall(r'(?<![\w.])(\w+\.py)\b', page.read_text()))
        written = {'home.py'} if page == TUTORIAL else set()
        assert named - written <= existing, page.name


def test_number_of_home_types():
    assert f'{len(HomeType)} home types' in README.read_text()
    assert f'{len(HomeType)} home types' in (ROOT / 'CHANGELOG.rst').read_text()


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


def test_only_commands_that_are_tested():
    tested = (
        'run',
        'launch',
        'service call',
        'action send_goal',
        'topic echo',
        'param set',
        'param describe',
    )
    for words in commands(['ros2']):
        assert ' '.join(words[1:]).startswith(tested), words


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
