# SPDX-License-Identifier: Apache-2.0
"""Records of a gantry: each side is in them, and in their picture."""

from dataclasses import replace

import pytest
import yaml
from record_rig import Recorded
from test_gantry_rehearsal import AXIS, LAYOUT, layout, parameters, skew_in, turned

from homing_node.cli import main
from homing_node.figures import plot
from homing_node.parameters import yaml_file
from homing_node.procedures.states import Error
from homing_node.recording import reading
from homing_node.recording.folder import RecordFolder
from homing_node.recording.run_file import mirrored
from homing_node.rehearsal.gantry import GantryRehearsal

PARAMETERS = yaml_file.written(
    '/homing_node',
    {'axes': ['y'], **{f'y.{key}': value for key, value in AXIS.items()}, 'y.y2.joint': 'y2'},
)


def recorded(path, where, given):
    """Home once; return the rehearsal and the record."""
    leader, followers = given
    made = GantryRehearsal('y', replace(leader, pause_mode=False), followers, where)
    one = Recorded(made, RecordFolder(path, '/homing_node', 50, 200), PARAMETERS)
    one.home()
    assert one.warnings == []
    (file,) = path.glob('*.mcap')
    return made, file


@pytest.mark.parametrize(('home_type', 'turn'), [('HSHS', False), ('HSZPulse', True)])
def test_each_side_is_read_as_it_was(tmp_path, home_type, turn):
    offset = 0.0 if 'ZPulse' in home_type else 0.0003
    given = layout(0.001, offset), parameters(offset, home_type=home_type)
    made, file = recorded(tmp_path, *(turned(*given) if turn else given))
    course, same = reading.read(file).course, made.course
    assert course.outcome.success and course.outcome.members == made.axis.outcome.members
    own, true = course.followers['y.y2'], same.followers['y.y2']
    assert [one.state for one in own.samples] == [one.state for one in course.samples]
    assert [one.time for one in own.samples] == [one.time for one in course.samples]
    told = [one.position for one in true.samples]
    first = told.index(own.samples[0].position)
    true_samples = true.samples[first : first + len(own.samples)]
    assert len(told) - len(true_samples) <= 3  # before the first state, and after the last one
    for one, other in zip(own.samples, true_samples, strict=True):
        assert one.position == other.position
        assert abs(one.feedback - other.feedback) < 1e-3  # a reading is older than the cycle
    for drive, other in ((course, same), (own, true)):
        assert len(drive.happenings) > 2
        for one in drive.happenings:
            near = [
                abs(each.position - one.position)
                for each in other.happenings
                if (each.input, bool(each.value)) == (one.input, bool(one.value))
            ]
            assert min(near) < 2e-4, one
    curve = skew_in(plot.figure(course))
    assert abs(curve[0]) == pytest.approx(1.0, abs=0.07)
    assert curve[-1] == pytest.approx(0.0, abs=0.07)


@pytest.mark.parametrize('dead', ['y', 'y.y2'])
def test_the_edge_that_no_other_side_has_joined_is_in_the_record(tmp_path, dead):
    nowhere = {'home_switch': [0.4, 0.41], 'y2.home_switch': [0.03, 0.034]}
    if dead == 'y.y2':
        nowhere = {'y2.home_switch': [0.4, 0.41]}
    _, file = recorded(tmp_path, layout(**nowhere), parameters())
    course = reading.read(file).course
    assert course.outcome.error is Error.FollowerSwitchMissing
    sides = {'y': course, **course.followers}
    edges = {
        name: [each for each in one.happenings if each.input == 'home_switch']
        for name, one in sides.items()
    }
    (alive,) = sides.keys() - {dead}
    assert edges[alive] and not edges[dead]
    assert edges[alive][0].position == pytest.approx(0.03, abs=1e-5)


@pytest.mark.long
def test_the_picture_has_the_rehearsal_of_both_sides_beneath(tmp_path, capsys):
    _, file = recorded(tmp_path, layout(0.001), parameters())
    machine = tmp_path / 'machine.yaml'
    machine.write_text(yaml.safe_dump({'y': LAYOUT}))
    picture = tmp_path / 'run.svg'
    assert main(['plot', str(file), '-o', str(picture), '--layout', str(machine)]) == 0
    said = capsys.readouterr().out
    assert 'both went through HSSearch' in said and 'Squaring, Proving' in said
    assert 'y.y2' in picture.read_text()


def test_a_mirrored_side_is_told():
    leader, followers = parameters()
    other = {'y.y2': replace(followers['y.y2'], home_direction=leader.home_direction)}
    assert mirrored(leader, other) == {}
    negative, _ = turned(layout(), parameters())[1]
    assert mirrored(negative, followers) == {'mirrored': 'y.y2'}
