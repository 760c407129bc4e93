# SPDX-License-Identifier: Apache-2.0
"""Proposed values: the checks call them right, and the axis homes; the file keeps its shape."""

import subprocess
from dataclasses import replace
from math import inf
from pathlib import Path

import pytest
import yaml
from core_rig import thinned
from hypothesis import given, settings
from hypothesis import strategies as st

from homing_node.check import check_axis, errors
from homing_node.check.proposal import DECISIONS, propose
from homing_node.cli import main
from homing_node.parameters import yaml_file
from homing_node.parameters.axis import DEFINITIONS, axis_parameters
from homing_node.parameters.yaml_edit import Edit, NotEditable, edited, plain
from homing_node.plant.layout import AxisLayout, SwitchLayout, mirrored
from homing_node.plant.timing import Timing
from homing_node.procedures.states import HomeType
from homing_node.rehearsal.examples import EXAMPLES
from homing_node.rehearsal.sweep import rehearse_from, transport_of

#: An axis that nobody has set up: the speeds are too high, the polarity is wrong.
VALUES = {'home_type': 'HSHS', 'travel': 0.3, 'homing_velocity_fast': 0.5}
LAYOUT = AxisLayout(
    (-0.005, 0.205),
    {
        'home_switch': SwitchLayout(0.15, 0.16, 5e-5, inverted=True),
        'positive_limit_switch': SwitchLayout(0.195, 0.3),
        'negative_limit_switch': SwitchLayout(-0.1, 0.0),
    },
    lag=0.005,
    start=0.05,
)


def serious(parameters, layout, timing=None):
    found = check_axis('x', parameters, layout, timing or Timing())
    return [one for one in found if one.severity != 'info']


def values_of(proposal):
    return {change.name: change.value for change in proposal.changes}


@pytest.mark.parametrize('direction', [1, -1])
def test_an_axis_that_nobody_has_set_up(direction):
    values = VALUES if direction > 0 else {**VALUES, 'home_direction': 'Negative'}
    layout = LAYOUT if direction > 0 else mirrored(LAYOUT)
    found = propose('x', axis_parameters(values), layout)
    assert found.findings == () and serious(found.parameters, layout) == []
    changed = values_of(found)
    assert changed['invert_hs_polarity'] is True and changed['travel'] == pytest.approx(0.21)
    assert changed['homing_velocity_fast'] == found.room
    assert set(changed) == {
        'travel',
        'homing_velocity_fast',
        'invert_hs_polarity',
        'max_ls_reverse_distance',
        'max_hs_on_at_start_reverse_distance',
        'following_error',
    }
    for start in (layout.hard_stops[0], layout.start, *layout.hard_stops[1:]):
        trial = rehearse_from(found.parameters, layout, transport_of(Timing()), start)
        assert trial.success, (start, trial)


@pytest.mark.parametrize('home_type', thinned(HomeType, 3))
def test_the_room_is_what_no_check_objects_to(home_type):
    """At the proposed speed the axis homes; a fifth faster a check objects."""
    example = EXAMPLES[home_type]
    found = propose('x', example.parameters, example.layout, at_most=0.2)
    assert errors(list(found.findings)) == []
    fast = found.parameters.homing_velocity_fast
    assert fast <= 0.2
    if found.room < 0.2:
        assert fast == found.room
        faster = replace(found.parameters, homing_velocity_fast=1.2 * fast)
        assert len(serious(faster, example.layout)) > len(found.findings)
    (start,) = {run.start for run in example.runs[:1]}
    trial = rehearse_from(found.parameters, example.layout, transport_of(Timing()), start)
    assert trial.success


def test_it_proposes_no_higher_velocity_than_it_may():
    slow = axis_parameters({**VALUES, 'homing_velocity_fast': 0.01, 'travel': 0.21})
    kept = propose('x', slow, LAYOUT)
    assert 'homing_velocity_fast' not in values_of(kept) and kept.room > 0.04
    assert values_of(propose('x', slow, LAYOUT, at_most=0.02))['homing_velocity_fast'] == 0.02
    fastest = propose('x', slow, LAYOUT, at_most=1.0)
    assert values_of(fastest)['homing_velocity_fast'] == fastest.room == kept.room


@pytest.mark.parametrize('stops', [(-inf, 0.205), (-0.005, inf), (-inf, inf)])
def test_without_hard_stops_no_higher_velocity_is_proposed(stops):
    slow = axis_parameters({**VALUES, 'homing_velocity_fast': 0.01, 'travel': 0.21})
    found = propose('x', slow, LAYOUT._replace(hard_stops=stops), at_most=0.03)
    assert found.room == 0.0 and 'homing_velocity_fast' not in values_of(found)
    assert values_of(found)['invert_hs_polarity'] is True


def test_the_slow_velocity_stays_below_the_fast_one():
    values = {**VALUES, 'homing_velocity_slow': 0.3}
    found = propose('x', axis_parameters(values), LAYOUT).parameters
    assert found.homing_velocity_slow == pytest.approx(0.1 * found.homing_velocity_fast, rel=0.05)


def test_a_home_that_must_be_known_well_is_sought_slowly():
    parameters = axis_parameters({**VALUES, 'travel': 0.21})
    found = propose('x', parameters, LAYOUT, Timing(accuracy=4e-6)).parameters
    assert found.homing_velocity_slow * found.switch_stamp_error <= 4e-6


def test_what_the_user_decides_is_left():
    switches = {**LAYOUT.switches, 'external_positive_limit_switch': SwitchLayout(0.2, 0.3)}
    found = propose('x', axis_parameters(VALUES), LAYOUT._replace(switches=switches))
    assert 'switches' not in values_of(found)
    assert [one.check for one in found.findings] == ['fitted-unwired']


@settings(max_examples=8, deadline=None)
@given(
    fast=st.floats(0.002, 1.0),
    slow=st.floats(0.01, 1.0),
    reverse=st.sampled_from([0.0, 0.0005, 0.01, 0.05]),
    jerk=st.sampled_from([5.0, 50.0, 500.0]),
    limit=st.floats(0.001, 0.03),
    hysteresis=st.sampled_from([0.0, 5e-5, 0.002]),
    lag=st.sampled_from([0.0, 0.002, 0.02]),
    rate=st.sampled_from([0.0, 20.0, 100.0]),
    own=st.sampled_from([{}, {'max_ls_reverse_distance': 0.01}, {'following_error': 1e-5}]),
    home_type=st.sampled_from(['HS', 'HSHS', 'HSOff', 'LS', 'LSLS', 'HSReverse']),
    inverted=st.booleans(),
)
def test_no_value_that_is_called_right_is_left(
    fast, slow, reverse, jerk, limit, hysteresis, lag, rate, own, home_type, inverted
):
    """What is left has no remedy that is a value, and a second proposal changes nothing."""
    values = {
        'home_type': home_type,
        'travel': 0.21,
        'homing_velocity_fast': fast,
        'homing_velocity_slow': slow * fast,
        'homing_reverse_distance': reverse,
        'max_jerk': jerk,
        **own,
    }
    flags = {
        'home_switch': SwitchLayout(0.15, 0.16, hysteresis, inverted),
        'positive_limit_switch': SwitchLayout(0.205 - limit, 0.3, hysteresis),
        'negative_limit_switch': SwitchLayout(-0.1, -0.005 + limit, hysteresis),
    }
    layout = LAYOUT._replace(switches=flags, lag=lag, switch_rate=rate)
    found = propose('x', axis_parameters(values), layout)
    for one in found.findings:
        assert one.right is None or one.parameter in DECISIONS or one.parameter not in DEFINITIONS
    assert found.parameters.cross_check() == []
    again = propose('x', found.parameters, layout)
    assert again.changes == ()


# -------------------------------------------------------------------------------------- the file

FILE = """\
# my machine
/**:
  ros__parameters:
    axes: ['x', "y"]
    'x':
      home_type: HSHS         # two passes
      travel: 0.21
      homing_velocity_fast: 0.5  # m/s
      topics:
        home_switch: '/io#data & 0x02'

    y.travel: 0.3
    y.home_type: CurrentPos   # for now
"""


def edit(text, *edits):
    made = edited(
        text, yaml_file.parsed(text.encode(), 'axes.yaml'), [Edit(*one) for one in edits]
    )
    return made, yaml_file.parsed(made.encode(), 'axes.yaml').values


def test_a_value_is_replaced_and_the_comments_stay():
    made, values = edit(FILE, ('x.homing_velocity_fast', 0.1, 'too fast'))
    assert made == FILE.replace(
        '      homing_velocity_fast: 0.5  # m/s\n',
        '      # was 0.5: too fast\n      homing_velocity_fast: 0.1  # m/s\n',
    )
    assert values['x.homing_velocity_fast'] == 0.1


def test_a_parameter_is_added_to_its_axis():
    made, values = edit(
        FILE,
        ('x.invert_hs_polarity', True, 'normally closed'),
        ('x.max_ls_reverse_distance', 1.0, 'a bound'),
        ('y.ls_type', axis_parameters(VALUES).ls_type, 'so'),
    )
    assert (values['x.invert_hs_polarity'], values['y.ls_type']) == (True, 'Dec')
    assert isinstance(values['x.max_ls_reverse_distance'], float)
    lines = made.splitlines()
    assert lines.index('      invert_hs_polarity: true') < lines.index('      topics:')
    assert lines[-1] == "    y.ls_type: 'Dec'"
    before = yaml_file.parsed(FILE.encode(), 'axes.yaml').values
    assert before.items() <= values.items()


@pytest.mark.parametrize(
    'text',
    [
        '/**:\n  ros__parameters:\n    axes: [x]\n    x: {home_type: HS, travel: 0.2}\n',
        '{"/**": {"ros__parameters": {"axes": ["x"], "x": {"home_type": "HS", "travel": 0.2}}}}',
    ],
)
@pytest.mark.parametrize('name', ['x.travel', 'x.ls_dec'])
def test_a_file_without_lines_of_their_own(text, name):
    with pytest.raises(NotEditable, match='a line of its own'):
        edit(text, (name, 0.1, 'why'))


@pytest.mark.parametrize(
    'value, text', [(0.1, '0.1'), (2.0, '2.0'), (1e-6, '1e-06'), (True, 'true'), (3, '3')]
)
def test_values_as_ros_reads_them(value, text):
    assert plain(value) == text
    assert type(yaml.safe_load(f'[{text if "e-" not in text else 0.1}]')[0]) is type(value)


# ----------------------------------------------------------------------------------- the command

MACHINE = """\
x:
  hard_stops: [-0.005, 0.205]
  negative_limit_switch: [null, 0.0]
  positive_limit_switch: [0.195, null]
  home_switch: [0.150, 0.160]
  home_switch_hysteresis: 0.00005
  inverted: [home_switch]
  lag: 0.005
"""


@pytest.fixture
def homing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    text = FILE.replace('[\'x\', "y"]', "['x']").partition('    y.')[0]
    Path('axes.yaml').write_text(text)
    Path('machine.yaml').write_text(MACHINE)

    def run(*arguments):
        status = main([*arguments, 'axes.yaml', '--layout', 'machine.yaml'])
        out, err = capsys.readouterr()
        return status, out, err

    return run


def test_the_diff_is_one_that_patch_takes(homing):
    status, diff, err = homing('propose')
    assert (status, err) == (0, '')
    assert '-      homing_velocity_fast: 0.5  # m/s' in diff.splitlines()
    assert '+      # was 0.5: ' in diff and '+      invert_hs_polarity: true' in diff
    subprocess.run(['patch', '-s', 'axes.yaml'], input=diff, text=True, check=True)
    assert homing('propose') == (0, 'axes.yaml: nothing to propose\n', '')
    assert homing('check')[0] == 0


def test_the_whole_file_is_written(homing):
    status, out, _ = homing('propose', '-o', 'new.yaml', '--at-most', '0.02')
    assert (status, out.splitlines()[-1]) == (0, 'wrote new.yaml')
    assert out.startswith('# axis x: behind every switch there is room for 0.0')
    assert yaml_file.load('new.yaml').axes['x'].homing_velocity_fast == 0.02
    assert Path('new.yaml').read_text().startswith('# my machine\n')


def test_an_error_that_no_value_puts_right(homing):
    Path('machine.yaml').write_text(MACHINE.replace('[0.150, 0.160]', '[0.197, 0.2]'))
    status, out, _ = homing('propose')
    assert status == 1 and out.startswith('# error: axis x: the edge of home_switch lies beyond')


def test_hard_stops_that_are_not_known_are_told(homing):
    Path('machine.yaml').write_text(MACHINE.replace('[-0.005, 0.205]', '[null, null]'))
    status, out, _ = homing('propose')
    assert status == 0 and out.startswith('# axis x: the layout does not tell where both hard')


@pytest.mark.parametrize(
    'layout, why',
    [
        (MACHINE.replace('x:', 'z:'), 'machine.yaml: x is not in it, only z; --axis chooses one'),
        ('x: {lagg: 1.0}', 'machine.yaml:1: x.lagg: no such parameter'),
    ],
)
def test_a_layout_that_cannot_be_used(homing, layout, why):
    Path('machine.yaml').write_text(layout)
    status, out, err = homing('propose')
    assert (status, out) == (2, '') and err.startswith(f'homing: {why}')


def test_a_file_that_cannot_be_changed_line_by_line(homing):
    Path('axes.yaml').write_text(
        '/**: {ros__parameters: {axes: [x], x: {home_type: HSHS, travel: 0.21}}}\n'
    )
    status, out, err = homing('propose')
    assert (status, out) == (2, '')
    assert 'cannot be changed line by line' in err and 'x.invert_hs_polarity: true  # ' in err
