# SPDX-License-Identifier: Apache-2.0
"""The command `homing`: what it prints, what it writes, how it ends."""

import csv
import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from time import process_time

import pytest
import yaml
from core_rig import thinned

from homing_node.cli import main
from homing_node.figures import record
from homing_node.parameters.axis import DEFINITIONS
from homing_node.plant.timing import Timing
from homing_node.procedures.states import HomeType
from homing_node.rehearsal.examples import EXAMPLES
from homing_node.rehearsal.sweep import rehearse_from, starts, transport_of

CONFIG = Path(__file__).parent.parent / 'config'
PLANT = str(CONFIG / 'simulated_axes.yaml')
DEMO = str(CONFIG / 'demo.yaml')


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def write(name, axes, **node):
    """Write a parameter file of homing_node."""
    Path(name).write_text(
        json.dumps({'/**': {'ros__parameters': {'axes': list(axes), **node, **axes}}}, indent=1)
    )
    return name


def run(capsys, *arguments):
    """Run a command; return its exit status and what it printed."""
    try:
        status = main([str(argument) for argument in arguments])
    except SystemExit as end:
        status = end.code
    out, err = capsys.readouterr()
    return status, out, err


def demo(axis='x', **changes):
    values = yaml.safe_load(Path(DEMO).read_text())['/**/homing_node']['ros__parameters'][axis]
    return {**values, **changes}


# ----------------------------------------------------------------------------------------- check


def test_check_of_a_good_configuration(capsys):
    status, out, err = run(capsys, 'check', DEMO, '--layout', PLANT)
    assert (status, err) == (0, '')
    assert out.splitlines()[-1].startswith(f'{DEMO}: ') and 'error' not in out
    assert '\x1b' not in out


def test_check_of_a_bad_one(capsys):
    config = write('bad.yaml', {'x': demo(homing_velocity_fast=0.2)})
    status, out, _ = run(capsys, 'check', config, '--layout', PLANT)
    assert status == 1
    first = out.splitlines()[0]
    assert first.startswith('error: axis x: hard-stop: at 0.2 m/s')
    assert '[homing_velocity_fast: ' in first
    assert '1 error' in out.splitlines()[-1] or 'errors' in out.splitlines()[-1]


def test_check_as_json(capsys):
    config = write('bad.yaml', {'x': demo(homing_velocity_fast=0.2)})
    status, out, _ = run(capsys, 'check', config, '--layout', PLANT, '--json')
    told = json.loads(out)
    assert status == 1 and told['ok'] is False
    one = told['findings'][0]
    assert set(one) == {
        'severity',
        'axis',
        'check',
        'what',
        'why',
        'parameter',
        'value',
        'right',
        'unit',
        'also',
    }
    assert (one['severity'], one['check'], one['parameter']) == (
        'error',
        'hard-stop',
        'homing_velocity_fast',
    )
    assert 0 < one['right'] < 0.2 and one['unit'] == 'm/s'


def test_check_without_a_layout(capsys):
    status, out, _ = run(capsys, 'check', DEMO)
    assert status == 0 and out == f'{DEMO}: nothing found\n'


def test_check_of_one_axis(capsys):
    config = write('two.yaml', {'x': demo(homing_velocity_fast=0.2), 'y': demo('y')})
    assert run(capsys, 'check', config, '--layout', PLANT, '--axis', 'y')[0] == 0
    assert run(capsys, 'check', config, '--layout', PLANT, '--axis', 'x')[0] == 1
    status, _, err = run(capsys, 'check', config, '--axis', 'a')
    assert status == 2 and 'x, y' in err


def test_faults_of_the_configuration_are_findings(capsys):
    config = write('bad.yaml', {'x': demo(travel='long', homing_velocity_fst=1.0)})
    status, out, _ = run(capsys, 'check', config)
    assert status == 1
    assert 'bad.yaml:' in out and "'long'" in out and 'did you mean' in out
    status, out, _ = run(capsys, 'check', config, '--json')
    assert status == 1 and {one['check'] for one in json.loads(out)['findings']} == {
        'configuration'
    }


def test_the_timing_counts(capsys):
    config = write('axes.yaml', {'x': demo(homing_velocity_fast=0.08)})
    assert run(capsys, 'check', config, '--layout', PLANT)[0] == 0
    assert run(capsys, 'check', config, '--layout', PLANT, '--latency', 0.05)[0] == 1
    status, out, _ = run(capsys, 'check', DEMO, '--layout', PLANT, '--accuracy', 1e-6)
    assert 'accuracy' in out and status == 0
    _, out, _ = run(capsys, 'check', DEMO, '--feedback-rate', 4)
    assert 'feedback-timeout' in out


# ------------------------------------------------------------------------------------------- run


def test_run_tells_the_course(capsys):
    status, out, err = run(capsys, 'run', DEMO, '--layout', PLANT, '--axis', 'z')
    assert (status, err) == (0, '')
    assert out.startswith('axis z: HSHS Positive from 0.175 m: homed in ')
    states = [
        'HSSearch',
        'HSFallingEdgeSearchReverse',
        'HSSearch',
        'HSClearReverse',
        'SecondHSSearch',
        'HomeShift',
    ]
    assert [line.split()[4] for line in out.splitlines() if '->' in line] == states
    assert 'home position 0.150000 m (raw); true 0.150000 m, off by' in out and 'real time' in out


def test_run_homes_all_axes(capsys):
    status, out, _ = run(capsys, 'run', DEMO, '--layout', PLANT)
    assert status == 0
    assert [line.split(':')[0] for line in out.splitlines() if line.startswith('axis')] == [
        'axis x',
        'axis y',
        'axis z',
    ]


def test_run_from_another_start_with_another_type(capsys):
    status, out, _ = run(
        capsys,
        'run',
        DEMO,
        '--layout',
        PLANT,
        '--axis',
        'y',
        '--from',
        0.03,
        '--type',
        'HSZPulse',
        '--json',
    )
    told = json.loads(out)['runs'][0]
    assert status == 0 and told['home_type'] == 'HSZPulse' and told['start'] == 0.03
    assert told['states'][0]['state'] == 'HSAndZPulseSearch'
    assert (
        abs(told['off']) < 1e-9 and told['uncertainty'] < 2e-5
    )  # a feedback interval at the slow velocity


def test_a_run_that_fails(capsys):
    config = write('bad.yaml', {'y': demo('y', max_search_distance=0.05)})
    status, out, _ = run(capsys, 'run', config, '--layout', PLANT)
    assert status == 1
    assert 'failed after' in out and 'SearchDistanceExceeded: axis y: ' in out


def test_a_run_into_the_hard_stop_fails(capsys):
    config = write('bad.yaml', {'x': demo(homing_velocity_fast=0.2, following_error=0.1)})
    status, out, _ = run(capsys, 'run', config, '--layout', PLANT, '--from', 0.161)
    assert status == 1 and 'ran into the hard stop at 0.205' in out


@pytest.mark.parametrize('beyond', [0.9, 1.1])
def test_a_home_further_off_than_its_uncertainty_is_a_wrong_home(capsys, monkeypatch, beyond):
    def shifted(*arguments):
        trial = rehearse_from(*arguments)
        right = trial.course.outcome
        home = trial.true_home + beyond * right.uncertainty
        trial.course.outcome = right._replace(home_position_raw=home)
        return trial

    for module in ('homing_node.cli.run', 'homing_node.rehearsal.sweep'):
        monkeypatch.setattr(f'{module}.rehearse_from', shifted)
    one = ('run', DEMO, '--layout', PLANT, '--axis', 'x')
    status, out, _ = run(capsys, *one)
    _, told, _ = run(capsys, *one, '--json')
    _, everywhere, _ = run(capsys, *one, '--all-starts', '--starts', 3)
    result = json.loads(told)
    wrong = beyond > 1.0
    assert status == wrong
    assert ('wrong home: ' in out, 'failed after' in out) == (wrong, wrong)
    assert ('  wrong home from 3 positions' in everywhere) == wrong
    (found,) = result['runs']
    assert (result['ok'], found['success'], found['wrong_home']) == (not wrong, not wrong, wrong)
    assert found['error'] == ('wrong home' if wrong else '')


def test_pause_mode_does_not_hold_a_rehearsal(capsys):
    config = write(
        'axes.yaml',
        {
            'x': demo(
                pause_mode=True,
                switches=[
                    'home_switch',
                    'positive_limit_switch',
                    'negative_limit_switch',
                    'servo_enabled',
                ],
            )
        },
    )
    assert run(capsys, 'run', config, '--layout', PLANT)[0] == 0


@pytest.mark.parametrize('rate, kept', [(400.0, '500'), (2000.0, '1000'), (300.0, '333.333')])
def test_a_rate_that_the_plant_cannot_keep(capsys, rate, kept):
    config = write('axes.yaml', {'x': demo()}, update_rate=rate, cycle_timeout=1.0)
    status, out, err = run(capsys, 'run', config, '--layout', PLANT)
    assert status in (0, 1) and not err
    assert out.startswith(f'update_rate is {rate:g} Hz; rehearsed at {kept} Hz, the nearest')
    _, out, _ = run(capsys, 'run', config, '--layout', PLANT, '--json')
    assert f'{json.loads(out)["runs"][0]["update_rate"]:.6g}' == kept
    _, out, _ = run(capsys, 'run', DEMO, '--layout', PLANT, '--feedback-rate', 300)
    assert out.startswith('feedback_rate is 300 Hz; rehearsed at 333.333 Hz')


def test_run_saves_and_plots(capsys):
    status, out, _ = run(
        capsys,
        'run',
        DEMO,
        '--layout',
        PLANT,
        '--axis',
        'x',
        '--save',
        'run.npz',
        '--plot',
        'run.svg',
    )
    assert status == 0 and out.endswith('wrote run.npz\n  wrote run.svg\n')
    course, title, unit = record.load('run.npz')
    assert (title, unit) == ('x: HSHS from 0.05 m', 'm') and course.outcome.success
    assert '<svg' in Path('run.svg').read_text()


def test_runs_from_everywhere(capsys):
    status, out, _ = run(
        capsys,
        'run',
        DEMO,
        '--layout',
        PLANT,
        '--axis',
        'x',
        '--all-starts',
        '--starts',
        9,
        '--save',
        'starts.csv',
    )
    assert status == 0
    assert out.startswith('axis x: HSHS Positive from 9 positions: 9 homed, 0 failed\n')
    assert Path('x_starts.png').read_bytes().startswith(b'\x89PNG')
    rows = list(csv.DictReader(Path('starts.csv').read_text().splitlines()))
    assert [float(row['start']) for row in rows][::8] == [-0.005, 0.205]
    assert all(row['error'] == '' and float(row['time']) > 0 for row in rows)


@pytest.mark.parametrize('stops', [(-0.005, 0.205), (-0.1, 0.2), (0.0, 0.3), (0.1, 0.7)])
def test_no_start_is_beyond_the_hard_stops(stops):
    example = EXAMPLES[HomeType.HS]
    layout = example.layout._replace(hard_stops=stops)
    for count in (2, 3, 9, 14, 50, 101):
        positions = starts(example.parameters, layout, count)
        assert (len(positions), positions[0], positions[-1]) == (count, *stops)
        assert positions == sorted(positions)


def test_a_table_that_cannot_be_saved_is_told_before_the_sweep(capsys):
    status, out, err = run(
        capsys,
        'run',
        DEMO,
        '--layout',
        PLANT,
        '--axis',
        'x',
        '--all-starts',
        '--starts',
        100_000,
        '--save',
        'starts.npz',
    )
    assert (status, out) == (2, '') and 'saved as .csv' in err
    assert not Path('x_starts.png').exists()


def test_runs_from_everywhere_of_which_some_fail(capsys):
    config = write('bad.yaml', {'x': demo(max_search_distance=0.1)})
    status, out, _ = run(
        capsys,
        'run',
        config,
        '--layout',
        PLANT,
        '--all-starts',
        '--starts',
        9,
        '--plot',
        'all.svg',
    )
    assert status == 1 and 'SearchDistanceExceeded from ' in out
    assert '<svg' in Path('all.svg').read_text()


def test_a_rehearsal_is_much_faster_than_the_machine():
    example = EXAMPLES[HomeType.HSHS]
    best = 0.0
    for _ in range(5):
        begin = process_time()
        trial = rehearse_from(example.parameters, example.layout, transport_of(Timing()), 0.0)
        best = max(best, trial.course.duration / (process_time() - begin))
    assert best > 20.0


# ------------------------------------------------------------------------------ plot and diagram


def test_plot_of_a_record(capsys):
    run(capsys, 'run', DEMO, '--layout', PLANT, '--axis', 'z', '--save', 'run.csv')
    assert run(capsys, 'plot', 'run.csv') == (0, 'wrote run.png\n', '')
    assert Path('run.png').read_bytes().startswith(b'\x89PNG')
    assert run(capsys, 'plot', 'run.csv', '-o', 'a.svg', '--layout', PLANT)[0] == 0
    assert (
        run(
            capsys,
            'plot',
            'run.csv',
            '-o',
            'b.svg',
            '--layout',
            PLANT,
            '--axis',
            'z',
            '--panels',
            'profile',
            '--unit',
            'rad',
        )[0]
        == 0
    )
    assert Path('a.svg').stat().st_size > Path('b.svg').stat().st_size


@pytest.mark.parametrize('suffix', thinned(['csv', 'npz'], 2))
def test_a_rotary_axis_is_drawn_in_rad(capsys, suffix):
    """As text, so that the picture can be searched for it."""
    record_of = f'run.{suffix}'
    run(
        capsys,
        'run',
        DEMO,
        '--layout',
        PLANT,
        '--axis',
        'x',
        '--unit',
        'rad',
        '--save',
        record_of,
        '--plot',
        'a.svg',
    )
    assert record.load(record_of).unit == 'rad'
    run(capsys, 'plot', record_of, '-o', 'b.svg', '--layout', PLANT)
    run(capsys, 'plot', record_of, '-o', 'c.svg', '--layout', PLANT, '--unit', 'm')
    rad, again, metre = (Path(f'{name}.svg').read_text() for name in 'abc')
    assert rad == again != metre
    run(
        capsys,
        'run',
        DEMO,
        '--layout',
        PLANT,
        '--axis',
        'x',
        '--all-starts',
        '--starts',
        2,
        '--unit',
        'rad',
        '--plot',
        'd.svg',
    )
    run(
        capsys,
        'run',
        DEMO,
        '--layout',
        PLANT,
        '--axis',
        'x',
        '--all-starts',
        '--starts',
        2,
        '--plot',
        'e.svg',
    )
    assert Path('d.svg').read_text() != Path('e.svg').read_text()


def test_plot_needs_to_know_the_axis(capsys):
    course = EXAMPLES[HomeType.HS].rehearse(EXAMPLES[HomeType.HS].runs[0])
    record.save('run.npz', course, 'a run')
    status, _, err = run(capsys, 'plot', 'run.npz', '--layout', PLANT)
    assert status == 2 and '--axis: x, y, z' in err
    Path('one.yaml').write_text('q: {hard_stops: [0.0, 0.12]}')
    assert run(capsys, 'plot', 'run.npz', '--layout', 'one.yaml')[0] == 0


def test_plot_of_what_is_no_record(capsys):
    Path('run.npz').write_text('nonsense')
    status, _, err = run(capsys, 'plot', 'run.npz')
    assert status == 1 and err.startswith('homing: run.npz: no course in it')


@pytest.mark.parametrize('home_type', HomeType)
def test_diagram(capsys, home_type):
    status, out, _ = run(capsys, 'diagram', home_type)
    assert status == 0 and out.startswith('stateDiagram-v2')
    status, out, _ = run(capsys, 'diagram', home_type, '--format', 'svg')
    assert status == 0 and out.startswith('<svg')


def test_diagram_into_a_file(capsys):
    assert run(capsys, 'diagram', 'HS', '-o', 'hs.svg') == (0, 'wrote hs.svg\n', '')
    assert Path('hs.svg').read_text().startswith('<svg')
    run(capsys, 'diagram', 'HS', '-o', 'hs.mmd')
    assert Path('hs.mmd').read_text().startswith('stateDiagram-v2')


# ----------------------------------------------------------------------------- wrong usage, files


@pytest.mark.parametrize(
    'arguments, said',
    [
        ([], 'COMMAND'),
        (['hone'], 'invalid choice'),
        (['check'], 'CONFIG'),
        (['run', DEMO], '--layout'),
        (['run', DEMO, '--layout', PLANT, '--type', 'HSS'], 'HSS'),
        (['run', DEMO, '--layout', PLANT, '--starts', '1', '--all-starts'], 'from 2'),
        (['run', DEMO, '--layout', PLANT, '--axis', 'x', '--starts', '5'], 'for --all-starts'),
        (['check', DEMO, 'b.yaml'], 'b.yaml: one file too many, a command takes one'),
        (['check', DEMO, PLANT], f'use --layout {PLANT}'),
        (['check', DEMO, '--nonsense'], '--nonsense: no such option'),
        (['check', DEMO, '--latency', '-1'], '--latency: -1 is not a number >= 0'),
        (['check', DEMO, '--latency', 'nan'], '--latency'),
        (['check', DEMO, '--accuracy', '0'], '--accuracy'),
        (['diagram', 'XX'], 'XX'),
        (['diagram', 'HS', '-o', 'hs.png'], 'hs.png: a diagram is written as .svg'),
        (['diagram', 'HS', '-o', 'hs.mmd', '--format', 'svg'], 'hs.mmd: a diagram'),
        (
            ['run', DEMO, '--layout', PLANT, '--axis', 'x', '--all-starts', '--from', '0'],
            '--from is one start',
        ),
        (['run', DEMO, '--layout', PLANT, '--save', 'r.npz'], '--save is for one axis'),
        (['run', DEMO, '--layout', PLANT, '--from', '0'], '--from is for one axis'),
        (['run', DEMO, '--layout', PLANT, '--axis', 'q'], "'q' is none of the axes"),
        (['run', DEMO, '--layout', PLANT, '--axis', 'x', '--from', '1'], 'beyond the hard stops'),
        (['run', DEMO, '--layout', PLANT, '--axis', 'x', '--save', 'r.txt'], '.npz or .csv'),
        (['run', DEMO, '--layout', PLANT, '--axis', 'x', '--plot', 'r.txt'], 'r.txt'),
        (['run', DEMO, '--layout', PLANT, '--axis', 'x', '--save', 'no/r.npz'], 'No such file'),
        (
            [
                'run',
                DEMO,
                '--layout',
                PLANT,
                '--axis',
                'x',
                '--all-starts',
                '--starts',
                '2',
                '--save',
                'r.npz',
            ],
            'saved as .csv',
        ),
        (
            ['run', DEMO, '--layout', PLANT, '--axis', 'x', '--type', 'HSZPulse'],
            'x.switches: z_pulse is missing',
        ),
        (['check', 'none.yaml'], 'none.yaml: No such file'),
        (['check', DEMO, '--layout', 'none.yaml'], 'none.yaml: No such file'),
        (['run', 'none.yaml', '--layout', PLANT], 'none.yaml: No such file'),
        (['check', DEMO, '--layout', DEMO], 'give it as CONFIG, without --layout'),
        (['check', PLANT], f'this looks like a layout: use --layout {PLANT}'),
        (['run', PLANT, '--layout', PLANT], f'this looks like a layout: use --layout {PLANT}'),
        (['plot', 'none.npz'], 'none.npz: No such file'),
        (
            ['run', DEMO, '--layout', PLANT, '--axis', 'x', '--plot', 'x'],
            'x: a picture is written',
        ),
        (['run', DEMO, '--layout', PLANT, '--axis', 'x', '--plot', 'x.eps'], '.png, .svg or .pdf'),
        (['diagram', 'HS', '-o', 'no/hs.svg'], 'No such file'),
    ],
)
def test_wrong_usage_ends_with_2(capsys, arguments, said):
    status, _, err = run(capsys, *arguments)
    assert status == 2 and said in err, err
    assert 'Traceback' not in err


def test_a_run_needs_the_places_of_its_inputs(capsys):
    Path('part.yaml').write_text('x: {hard_stops: [0.0, 0.2], home_switch: [0.15, 0.16]}')
    status, _, err = run(capsys, 'run', DEMO, '--layout', 'part.yaml', '--axis', 'x')
    assert status == 2 and err.count('homing: part.yaml: axis x: a run needs to know where') == 2
    status, _, err = run(capsys, 'run', DEMO, '--layout', 'part.yaml', '--axis', 'y')
    assert status == 2 and "no axis 'y' in it, only x" in err
    Path('part.yaml').write_text(
        'x: {hard_stops: [0.0, 0.2], home_switch: [0.15, 0.16], start: 0.1,\n'
        '    stays_off: [positive_limit_switch, negative_limit_switch]}'
    )  # as a survey leaves it that has not come to them
    status, out, _ = run(capsys, 'run', DEMO, '--layout', 'part.yaml', '--axis', 'x')
    assert status == 0, out
    assert 'nobody knows where positive_limit_switch, negative_limit_switch is' in out


def test_what_becomes_of_a_faulty_configuration_is_told(capsys):
    """For the check it is a finding, no run can begin with it."""
    config = write('bad.yaml', {'x': demo(travel='long')})
    assert run(capsys, 'check', config)[0] == 1
    assert run(capsys, 'run', config, '--layout', PLANT)[0] == 2
    _, out, _ = run(capsys, 'check', '--help')
    assert '1  an error was found, be it that the node cannot use CONFIG' in out
    _, out, _ = run(capsys, 'run', '--help')
    assert '2  wrong arguments, or a file that cannot be read, used or written' in out


@pytest.mark.parametrize('command', ['', 'check', 'run', 'doctor', 'plot', 'diagram'])
def test_help_teaches(capsys, command):
    status, out, _ = run(capsys, *command.split(), '--help')
    assert status == 0 and 'exit status:' in out
    assert out.count('homing ') > (3 if not command else 2)
    for number in '012':
        assert f'\n  {number}  ' in out


def test_the_layout_in_the_help_is_one(capsys):
    _, out, _ = run(capsys, 'check', '--help')
    begin = out.index('  x:\n')
    Path('help.yaml').write_text(out[begin : out.index('  The parameter file of sim')])
    config = write('axes.yaml', {'x': demo()})
    assert run(capsys, 'check', config, '--layout', 'help.yaml')[0] == 0
    assert run(capsys, 'run', config, '--layout', 'help.yaml')[0] == 0


# -------------------------------------------------------------------------------------- terminal


def on_a_terminal(*arguments, **environment):
    """Run the command with a terminal as its output; return its exit status and what it wrote."""
    lead, follow = pty.openpty()
    plain = {name: value for name, value in os.environ.items() if name != 'NO_COLOR'}
    child = subprocess.Popen(
        [
            sys.executable,
            '-c',
            'import sys; from homing_node.cli import main; sys.exit(main())',
            *map(str, arguments),
        ],
        stdout=follow,
        stderr=follow,
        env={**plain, 'TERM': 'xterm-256color', 'COLUMNS': '100', **environment},
    )
    os.close(follow)
    parts = []
    while True:
        try:
            part = os.read(lead, 65536)
        except OSError:
            break
        if not part:
            break
        parts.append(part)
    os.close(lead)
    return child.wait(), b''.join(parts).decode()


def test_colours_where_a_terminal_is():
    config = write('bad.yaml', {'x': demo(homing_velocity_fast=0.2)})
    status, out = on_a_terminal('check', config, '--layout', PLANT)
    assert status == 1 and '\x1b[1;31m' in out and '→' in out
    status, out = on_a_terminal('check', config, '--layout', PLANT, NO_COLOR='1')
    assert status == 1 and '\x1b[1;31m' not in out and '[31m' not in out
    status, out = on_a_terminal('run', DEMO, '--layout', PLANT, '--axis', 'x')
    assert status == 0 and '\x1b[' in out and 'SecondHSSearch' in out


def test_progress_where_a_terminal_is():
    status, out = on_a_terminal(
        'run', DEMO, '--layout', PLANT, '--axis', 'x', '--all-starts', '--starts', '5'
    )
    assert status == 0 and '100%' in out


MAIN = 'import sys; from homing_node.cli import main; sys.exit(main())'


@pytest.mark.parametrize('command', ['', 'check', 'run', 'plot', 'diagram', 'doctor'])
def test_every_verb_tells_the_version(capsys, command):
    status, out, _ = run(capsys, *command.split(), '--version')
    assert status == 0 and re.fullmatch(r'homing_node \d+\.\d+\.\d+\n', out)


def test_an_interrupt_is_told_in_a_word():
    # A process that a script has put into the background ignores SIGINT, and so do its children.
    heard = 'import signal; signal.signal(signal.SIGINT, signal.default_int_handler); '
    heard += 'import homing_node.cli.run, sys; print("ready", file=sys.stderr, flush=True); '
    child = subprocess.Popen(
        [
            *(sys.executable, '-c', heard + MAIN, 'run', DEMO, '--layout', PLANT, '--axis', 'x'),
            *('--all-starts', '--starts', '100000'),
        ],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    busy = Path(f'/proc/{child.pid}/stat')

    def processor_time():
        return sum(map(int, busy.read_text().rpartition(')')[2].split()[11:13]))

    assert child.stderr.readline() == 'ready\n'
    begun = processor_time()
    while processor_time() < begun + 0.5 * os.sysconf('SC_CLK_TCK') and child.poll() is None:
        time.sleep(0.05)  # it reads its files, then it rehearses for minutes
    child.send_signal(signal.SIGINT)
    err = child.communicate(timeout=60)[1]
    assert (child.returncode, err) == (130, 'homing: interrupted\n'), err


def test_a_closed_output_is_told_in_a_line():
    done = subprocess.run(
        ['sh', '-c', '"$0" -c "$1" check "$2" >&-', sys.executable, MAIN, DEMO],
        stderr=subprocess.PIPE,
        text=True,
    )
    assert (done.returncode, done.stderr) == (
        2,
        'homing: the output cannot be written: it is closed\n',
    )


def test_a_node_needs_no_slash(capsys):
    config = write('good.yaml', {'x': demo()})
    assert run(capsys, 'check', config, '--node', 'homing')[0] == 0


def test_files_that_are_nested_too_deeply(capsys):
    Path('deep.yaml').write_text('{a: ' * 3000)
    status, _, err = run(capsys, 'check', DEMO, '--layout', 'deep.yaml')
    assert (status, err) == (2, 'homing: deep.yaml: nested too deeply\n')
    status, out, _ = run(capsys, 'check', 'deep.yaml')
    assert status == 1 and 'deep.yaml: nested too deeply' in out


def test_a_run_of_a_rotary_axis_says_rad(capsys):
    config = write('rotary.yaml', {'x': demo(unit='rad')})
    status, out, _ = run(capsys, 'run', config, '--layout', PLANT, '--axis', 'x')
    assert status == 0 and ' m ' not in out
    assert 'home position 0.150000 rad (raw); true 0.150000 rad, off by' in out
    config = write('short.yaml', {'x': demo(unit='rad', max_search_distance=0.03)})
    status, out, _ = run(capsys, 'run', config, '--layout', PLANT, '--axis', 'x')
    assert status == 1 and '0.03 rad (max_search_distance)' in out


def test_a_closed_pipe_is_no_error():
    child = subprocess.Popen(
        [sys.executable, '-c', MAIN, 'diagram', 'HSHS'],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    child.stdout.close()
    err = child.stderr.read()
    child.stderr.close()
    assert child.wait() in (0, 120) and b'Traceback' not in err


@pytest.mark.parametrize(
    'arguments',
    thinned(
        [
            ['run', DEMO, '--layout', PLANT],
            ['check', DEMO],
            ['check', DEMO, '--json'],
            ['diagram', 'HSHS'],
        ],
        4,
    ),
)
def test_a_full_device_is_told_in_a_line(arguments):
    with open('/dev/full', 'w') as full:
        done = subprocess.run(
            [sys.executable, '-c', MAIN, *arguments],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert (done.returncode, done.stderr) == (
        2,
        'homing: the output cannot be written: No space left on device\n',
    )


def test_no_ros_is_needed():
    """The command works where rclpy cannot be imported, and checks without matplotlib."""
    code = (
        "import sys; sys.modules['rclpy'] = sys.modules['matplotlib'] = None\n"
        'from homing_node.cli import main; sys.exit(main())'
    )
    done = subprocess.run(
        [sys.executable, '-c', code, 'check', DEMO, '--layout', PLANT],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr


def test_every_parameter_that_a_remedy_names_exists(capsys):
    """The remedies of the examples' findings can be pasted into the file."""
    config = write('axes.yaml', {'x': demo(max_jerk=1.0, ls_dec=0.1, travel=0.4)})
    _, out, _ = run(capsys, 'check', config, '--layout', PLANT, '--json')
    named = {one['parameter'] for one in json.loads(out)['findings'] if one['right'] is not None}
    assert named and named <= set(DEFINITIONS)


def test_the_doctor_needs_ros_and_says_so(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'homing_node.ros.doctor', None)
    status, _, err = run(capsys, 'doctor')
    assert status == 2 and '`homing doctor` needs ROS 2' in err


def test_a_gantry_with_a_fault_is_not_taken_for_a_layout(capsys, tmp_path):
    """Both files may have `followers`."""
    file = tmp_path / 'gantry.yaml'
    file.write_text(
        (CONFIG / 'gantry.yaml').read_text().replace('max_skew: 0.002', 'max_skew: 0.0')
    )
    status, out, err = run(capsys, 'check', file)
    assert status == 1 and 'y.max_skew: required with followers' in out, err
