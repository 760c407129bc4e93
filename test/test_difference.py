# SPDX-License-Identifier: Apache-2.0
"""What is said of a recorded run beside its rehearsal."""

from dataclasses import replace

import pytest
from core_rig import HS, rig
from record_rig import Recorded

from homing_node import cli
from homing_node.core.outcome import Outcome
from homing_node.course import Course
from homing_node.parameters import yaml_file
from homing_node.parameters.units import Unit
from homing_node.plant.layout_file import load
from homing_node.procedures.states import Error
from homing_node.recording.folder import RecordFolder
from homing_node.rehearsal.difference import differences
from homing_node.rehearsal.run import Rehearsal

CONFIG = """
/homing_node:
  ros__parameters:
    axes: [x]
    x: {home_type: HS, travel: 0.2, max_jerk: 100.0, homing_velocity_fast: 0.1}
"""
LAYOUT = """
x:
  hard_stops: [-0.005, 0.205]
  negative_limit_switch: [-0.055, 0.0]
  positive_limit_switch: [0.195, 0.255]
  home_switch: [0.150, 0.160]
  start: 0.1
"""


def test_a_rehearsal_does_not_differ_from_itself():
    course = rig('HSHS').home()
    way, took, home = differences(course, course, Unit.m)
    assert way.startswith('both went through HSSearch, ')
    assert took.endswith(': +0.000 s (+0.0 %)')
    assert 'within what is uncertain of both' in home


def test_a_slower_run_names_the_state_that_was_slow():
    course, other = rig('HSHS').home(), rig('HSHS', homing_velocity_slow=0.02).home()
    _, took, most, home = differences(other, course, Unit.m)
    assert took.startswith(f'the run took {other.duration:.3f} s') and '(+' in took
    assert most.startswith('most of it in SecondHSSearch: +')
    assert 'within' in home


def test_a_home_elsewhere_is_more_than_what_is_uncertain():
    one = rig('HS')
    moved = one.layout.switches[HS]._replace(on_from=0.061)
    *_, home = differences(one.switched(**{HS: moved}).home(), one.home(), Unit.rad)
    assert '+1 mrad from where the rehearsal found it: more than' in home
    assert home.endswith('is the layout true?')


def test_where_two_ways_part():
    course = rig('HSHS').home()
    other = replace(course, samples=[s for s in course.samples if s.state != 'SecondHSSearch'])
    assert (
        'they part after HSClearReverse: the run went to HomeShift'
        in (differences(other, course, Unit.m)[0])
    )
    empty = Course([], outcome=Outcome(Error.Timeout))
    assert differences(empty, course, Unit.m)[0].startswith('they part at the start')


@pytest.mark.parametrize(
    'outcome, text',
    [
        (None, 'its home is not known'),
        (Outcome(Error.Timeout, ''), 'the run ended with Timeout, the rehearsal homed'),
    ],
)
def test_a_run_that_did_not_home(outcome, text):
    course = rig('HS').home()
    assert text in differences(replace(course, outcome=outcome), course, Unit.m)[-1]


def test_plot_draws_the_rehearsal_beneath_a_record(tmp_path, capsys):
    config, layout = tmp_path / 'axes.yaml', tmp_path / 'machine.yaml'
    config.write_text(CONFIG)
    layout.write_text(LAYOUT)
    values = yaml_file.read(config).values
    text = yaml_file.written('/homing_node', values)
    parameters = yaml_file.load(config).axes['x']
    made = Rehearsal(parameters, load(layout).layouts['x'])
    recorded = Recorded(made, RecordFolder(tmp_path / 'records', '/homing_node', 5, 5), text)
    recorded.home()
    (file,) = (tmp_path / 'records').iterdir()
    picture = tmp_path / 'x.png'
    assert cli.main(['plot', str(file), '-o', str(picture), '--layout', str(layout)]) == 0
    told = capsys.readouterr().out.splitlines()
    assert told[0].startswith('both went through HSSearch')
    assert 'within what is uncertain of both' in told[-2]
    assert told[-1] == f'wrote {picture}' and picture.stat().st_size > 10_000
    layout.write_text(LAYOUT.replace('x:', 'y:'))
    assert cli.main(['plot', str(file), '-o', str(picture), '--layout', str(layout)]) == 2
    assert "no axis 'x' in it" in capsys.readouterr().err


def test_a_parameter_file_is_written_as_rcl_reads_it():
    values = {
        'axes': ['y', 'x'],
        'update_rate': 100.0,
        'y.home_type': 'HS',
        'y.travel': 1e-5,
        'y.joint': '1e-3',
        'y.topics.home_switch': '/io#a[0]',
        'y.invert_hs_polarity': True,
        'x.joint': 'on',
    }
    text = yaml_file.written('/cell/homing_node', values)
    assert yaml_file.parsed(text.encode(), 'f', '/cell/homing_node').values == values
