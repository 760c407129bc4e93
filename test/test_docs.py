# SPDX-License-Identifier: Apache-2.0
"""The documentation: its links and tables, and the blocks that need no node."""

import ast
import dataclasses
import importlib.util
import re
import shlex
import subprocess
from fnmatch import fnmatch
from pathlib import Path

import pytest
import yaml
from core_rig import rig
from doc_blocks import (
    BLOCKS,
    DOC,
    GUIDE,
    PAGES,
    README,
    ROOT,
    ROS_INTERFACE,
    TUTORIAL,
    axes_yaml,
    commands,
    each,
)
from record_rig import Recorded

from homing_node.cli import main
from homing_node.parameters.axis import DEFINITIONS
from homing_node.parameters.configuration import configuration
from homing_node.parameters.yaml_file import load, read
from homing_node.plant import layout_file
from homing_node.plant.layout import SWITCHES, AxisLayout
from homing_node.procedures.cia402 import METHODS
from homing_node.procedures.states import Error, HomeType, Input, LSType, State
from homing_node.recording.folder import RecordFolder
from homing_node.ros.simulated.settings import Settings

IMAGES = ('.svg', '.png', '.pdf', '.jpg')

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


@pytest.mark.parametrize('slow', [False, pytest.param(True, marks=pytest.mark.long)])
def test_homing_commands(tmp_path, monkeypatch, capsys, slow):
    """What other pages than the tutorial show of the command line works on README's axis.

    Those are slow that rehearse a gantry, or runs from everywhere.
    """
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
    for words in map(list, dict.fromkeys(map(tuple, found))):
        if slow is not any(one in words for one in ('--all-starts', 'config/gantry.yaml')):
            continue
        if '--all-starts' in words:
            words += ['--starts', '5']
        if words[1] == 'convert':
            words[words.index('-o') + 1] = 'converted.yaml'
        if words[1] in ('doctor', 'record'):  # test_node_{doctor,record}.py have a node for them
            with pytest.raises(SystemExit, match=r'^0$'):
                main([*words[1:], '--help'])
        else:
            assert main(words[1:]) == 0, (words, capsys.readouterr().out)


def test_make_targets_exist():
    makefile = (ROOT / 'Makefile').read_text()
    targets = {words[1] for words in commands(['make'])}
    assert {'demo', 'test'} <= targets
    for target in targets:
        assert re.search(rf'^{target}:', makefile, re.MULTILINE)


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


@pytest.mark.long
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
