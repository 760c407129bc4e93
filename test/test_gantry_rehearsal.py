# SPDX-License-Identifier: Apache-2.0
"""Gantries against their simulated machine: springs, delays, skews, offsets; `homing run`."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from homing_node.cli import main
from homing_node.figures import plot, record
from homing_node.figures.gantry_plot import COLOURS
from homing_node.parameters.configuration import configuration
from homing_node.parameters.gantry import follower_parameters
from homing_node.plant.layout import mirrored
from homing_node.plant.layout_reader import layouts_from
from homing_node.procedures.states import Direction, Error, State
from homing_node.rehearsal.gantry import GantryRehearsal
from homing_node.rehearsal.link import DIRECT, Transport
from homing_node.rehearsal.sweep import rehearse_from, starts

CONFIG = Path(__file__).parent.parent / 'config'
GANTRY, MACHINE = str(CONFIG / 'gantry.yaml'), str(CONFIG / 'simulated_gantry.yaml')
MAX_SKEW = 0.002

#: A gantry that needs few seconds of simulated time: the home switch is near.
LAYOUT = {
    'followers': ['y2'],
    'hard_stops': [-0.005, 0.055],
    'negative_limit_switch': [-0.055, 0.0],
    'positive_limit_switch': [0.05, 0.105],
    'home_switch': [0.03, 0.034],
    'home_switch_hysteresis': 0.00005,
    'index_pitch': 0.01,
    'index_offset': 0.0037,
    'lag': 0.005,
    'start': 0.02,
    'y2.stiffness': 2e5,
}
AXIS = {
    'joint': 'y1',
    'home_type': 'HSHS',
    'travel': 0.05,
    'switches': ['home_switch', 'positive_limit_switch', 'negative_limit_switch'],
    'homing_reverse_distance': 0.002,
    'homing_velocity_slow': 0.01,
    'max_jerk': 100.0,
    'followers': ['y2'],
    'max_skew': MAX_SKEW,
}


def layout(skew=0.0, offset=0.0, **changes):
    """Return the machine; ``offset``: how much further the follower's switch is."""
    if offset:
        changes['y2.home_switch'] = [0.03 + offset, 0.034 + offset]
    return layouts_from({'y': {**LAYOUT, 'y2.start': 0.02 + skew, **changes}})['y']


def parameters(offset=0.0, **changes):
    """Return the parameters of the leader and of the followers."""
    values = {**AXIS, 'y2.switch_offset': offset, **changes}
    if 'ZPulse' in values['home_type']:
        values['switches'] = [*values['switches'], 'z_pulse']
    found = configuration({'axes': ['y'], **{f'y.{key}': v for key, v in values.items()}})
    return found.axes['y'], found.followers['y']


def rehearse(where, given, transport=DIRECT, **own):
    leader, followers = given
    leader = replace(leader, pause_mode=False)
    made = GantryRehearsal('y', leader, followers, where, transport, own=own)
    return made, made.home()


def turned(where, given):
    """Return the mirrored machine, which homes toward negative."""
    leader, followers = given
    other = replace(leader, home_direction=Direction.Negative)
    own = {'switch_offset': -followers['y.y2'].switch_offset}
    return mirrored(where), (other, {'y.y2': follower_parameters(other, 'y2', own)})


def assert_square(made, course, off=0.0):
    """Assert that a run has homed, and that the gantry is as square as it says."""
    outcome = course.outcome
    assert outcome.success, outcome.message
    (_, member) = outcome.members
    assert abs(member.squareness) <= 5e-5 + member.uncertainty
    assert made.gantry.racked[0] == pytest.approx(off, abs=5e-5 + member.uncertainty)


# -- what must stand ------------------------------------------------------------------------------


@pytest.mark.parametrize('stiffness', [0.0, 1e4, 1e6, 1e7])
@pytest.mark.parametrize('skew', [-0.0019, -0.0005, 0.0, 0.001, 0.0019])
def test_it_homes_square_from_any_skew(skew, stiffness):
    where = layout(skew, **{'y2.stiffness': stiffness})
    made, course = rehearse(where, parameters())
    assert_square(made, course)
    assert course.largest_skew <= MAX_SKEW
    assert course.largest_force <= stiffness * MAX_SKEW
    assert made.gantry.forces[0] == pytest.approx(0.0, abs=stiffness * 7e-5)
    assert (State.Squaring in course.states) is (abs(skew) > 5e-5)
    assert (State.Proving in course.states) is (abs(skew) > 5e-5)


@pytest.mark.parametrize('home_type', ['HS', 'HSReverse', 'HSOff', 'LS', 'LSOff', 'HSZPulse'])
@pytest.mark.parametrize('negative', [False, True], ids=['positive', 'negative'])
def test_other_types_and_the_other_direction(home_type, negative):
    where, given = layout(0.001), parameters(home_type=home_type)
    if negative:
        where, given = turned(where, given)
    made, course = rehearse(where, given)
    assert_square(made, course)


@pytest.mark.parametrize('offset', [-0.001, 0.001])
@pytest.mark.parametrize('skew', [-0.0009, 0.0009])
def test_switches_at_different_places(offset, skew):
    made, course = rehearse(layout(skew, offset), parameters(offset))
    assert_square(made, course)


def test_an_offset_that_is_not_told_racks_the_gantry_by_it():
    """It is square where its switches say so; the plant knows better."""
    made, course = rehearse(layout(0.0, 0.0005), parameters())
    assert_square(made, course, off=0.0005)
    assert made.gantry.forces[0] == pytest.approx(0.0005 * 2e5, rel=0.05)


@pytest.mark.parametrize('delay', [0.01, 0.05])
def test_messages_of_one_side_are_late(delay):
    """What they say is compared at equal times: it is no skew."""
    late = Transport(feedback_delay=delay, switch_delay=delay)
    made, course = rehearse(layout(0.001), parameters(following_error=0.01), **{'y.y2': late})
    assert_square(made, course)


@pytest.mark.parametrize(('delay', 'error'), [(0.01, Error.NoError), (0.06, Error.SkewTooLarge)])
def test_one_side_obeys_late(delay, error):
    """It is really behind: by 0.5 mm and by 3 mm at 50 mm/s."""
    given = parameters(following_error=0.01)
    made, course = rehearse(layout(**{'y2.delay': delay}), given)
    assert course.outcome.error is error, course.outcome.message
    beyond = 0.0 if error is Error.NoError else 0.0012
    assert course.largest_skew <= MAX_SKEW + beyond
    assert course.largest_force <= 2e5 * (MAX_SKEW + beyond)
    if error is Error.NoError:
        assert_square(made, course)
        assert course.largest_skew > 0.0004


def test_it_is_not_forced():
    made, course = rehearse(layout(0.0025), parameters())
    assert course.outcome.error in (Error.SkewTooLarge, Error.FollowerSwitchMissing)
    assert State.Squaring not in course.states
    assert made.gantry.racked == pytest.approx([0.0025], abs=1e-6)


def test_a_stiff_gantry_is_measured_and_left_alone():
    made, course = rehearse(layout(0.001), parameters(square=False))
    assert course.outcome.success, course.outcome.message
    assert course.outcome.members[1].squareness == pytest.approx(-0.001, abs=3e-5)
    assert made.gantry.racked == pytest.approx([0.001], abs=1e-6)


def test_a_servo_that_goes_off_in_a_run_lets_it_spring_back():
    leader, followers = parameters()
    made = GantryRehearsal('y', replace(leader, pause_mode=False), followers, layout(0.001))
    for _ in range(5):
        made.cycle()
    assert made.axis.home(made.time) is None
    while made.plant.position < 0.025:
        made.cycle()
    made.gantry.sides['y.y2'].servo(False)
    course = made.finish()
    assert course.outcome.error in (Error.FollowingError, Error.SkewTooLarge, Error.ServoOff)
    assert made.axis.homed is False


def test_three_followers():
    where = {**LAYOUT, 'followers': ['y2', 'y3', 'y4'], 'y2.start': 0.0205, 'y3.start': 0.0195}
    where |= {'y3.stiffness': 2e5, 'y4.stiffness': 2e5, 'y4.start': 0.02}
    made, course = rehearse(
        layouts_from({'y': where})['y'], parameters(followers=['y2', 'y3', 'y4'])
    )
    assert course.outcome.success, course.outcome.message
    assert made.gantry.racked == pytest.approx([0.0] * 3, abs=7e-5)
    assert list(course.followers) == ['y.y2', 'y.y3', 'y.y4']


def test_a_mirrored_mount():
    where = layout(**{'y2.mirrored': True, 'y2.square_at': 0.01, 'y2.start': -0.031})
    leader, _ = parameters()
    own = {'home_direction': 'Negative'}
    given = leader, {'y.y2': follower_parameters(leader, 'y2', own)}
    assert where.followers['y.y2'].hard_stops == pytest.approx((-0.065, -0.005))
    made, course = rehearse(where, given)
    assert_square(made, course)
    assert State.Squaring in course.states
    assert course.followers['y.y2'].mirrored
    assert course.largest_skew == pytest.approx(0.001, abs=2e-4)


def test_the_springs_are_recorded():
    _, course = rehearse(layout(0.001), parameters())
    other = course.followers['y.y2']
    assert len(other.samples) == len(other.forces) == len(course.samples)
    assert other.forces[0] == pytest.approx(200.0)
    assert other.forces[-1] == pytest.approx(0.0, abs=15.0)
    assert [s.state for s in other.samples] == [s.state for s in course.samples]
    assert {one.input for one in other.happenings} == {'home_switch', 'z_pulse'}


# -- trials, `homing run`, the picture ------------------------------------------------------------


def test_a_trial_knows_whether_it_is_square():
    leader, followers = parameters()
    good = rehearse_from(leader, layout(0.001), DIRECT, axis='y', followers=followers)
    assert good.success and good.error == ''
    assert good.askew['y.y2'] == pytest.approx(0.0, abs=3e-5)
    spoilt = good._replace(askew={'y.y2': 0.0002})
    assert not spoilt.success and spoilt.error == 'not square'


def test_starts_leave_room_for_the_skew_of_the_followers():
    leader, followers = parameters()
    where = layout(-0.001)
    found = starts(leader, where, 3)
    assert found == pytest.approx([-0.004, 0.0255, 0.055])
    for start in found:
        assert rehearse_from(leader, where, DIRECT, start, 'y', followers).success


def run(capsys, *arguments):
    status = main(['run', *map(str, arguments)])
    return status, capsys.readouterr()


def test_homing_run_of_a_gantry(capsys):
    status, said = run(capsys, GANTRY, '--layout', MACHINE)
    assert status == 0, said.err
    assert 'Squaring' in said.out and 'Proving' in said.out
    assert 'y.y2 is ' in said.out and 'm out of square, to within 2e-05 m' in said.out
    assert 'a spring bore up to 2' in said.out


def test_homing_run_of_a_gantry_as_json(capsys):
    status, said = run(capsys, GANTRY, '--layout', MACHINE, '--json')
    (found,) = json.loads(said.out)['runs']
    assert status == 0 and [one['name'] for one in found['members']] == ['y', 'y2']
    assert abs(found['out_of_square']['y.y2']) < 3e-5
    assert 0.0009 < found['largest_skew'] < MAX_SKEW
    assert 190.0 < found['largest_force'] < 400.0


def test_homing_run_needs_both_sides(capsys, tmp_path):
    alone = tmp_path / 'machine.yaml'
    alone.write_text('y: {hard_stops: [0.0, 0.2], home_switch: [0.15, 0.16]}\n')
    status, said = run(capsys, GANTRY, '--layout', alone)
    assert status == 2
    assert 'axis y: a run needs to know its side y.y2: add it to y.followers' in said.err
    plain = """
y:
  followers: [y2]
  hard_stops: [-0.005, 0.205]
  home_switch: [0.15, 0.16]
  positive_limit_switch: [0.195, null]
  negative_limit_switch: [null, 0.0]
y.y2: {stiffness: 1e5, home_switch: null}
"""
    alone.write_text(plain)
    status, said = run(capsys, GANTRY, '--layout', alone)
    assert status == 2
    assert 'axis y.y2: a run needs to know where home_switch is' in said.err


def test_the_picture_has_both_sides_and_the_skew():
    where = layout(0.001)
    _, course = rehearse(where, parameters())
    sheet = plot.figure(course, where)
    names = [axes.get_ylabel().partition('\n')[0] for axes in sheet.axes]
    assert [name for name in names if name] == [
        'position in mm',
        'skew',
        'racking force',
        'velocity',
        'acceleration',
    ]
    position, skew, force = (sheet.axes[names.index(n)] for n in (names[1], 'skew', names[3]))
    both = [line for line in position.get_lines() if line.get_label() == 'y.y2']
    assert len(both) == 1 and both[0].get_color() == COLOURS[0]
    drawn = both[0].get_ydata()
    assert drawn[0] == pytest.approx(21.0) and len(drawn) == len(course.samples)
    curve = next(line for line in skew.get_lines() if line.get_color() == COLOURS[0])
    assert curve.get_ydata()[0] == pytest.approx(1.0)
    assert curve.get_ydata()[-1] == pytest.approx(0.0, abs=0.07)
    assert force.get_ylim()[1] / skew.get_ylim()[1] == pytest.approx(200.0)
    (legend,) = sheet.legends
    assert {'leader', 'y.y2'} <= {text.get_text() for text in legend.get_texts()}


@pytest.mark.parametrize(('square', 'last'), [(True, 0.0), (False, 1.0)])
def test_without_a_layout_the_end_tells_what_is_square(square, last):
    """Of a run that has homed: a stiff gantry stays out of square by what it says."""
    _, course = rehearse(layout(0.001), parameters(square=square))
    curve = skew_in(plot.figure(course))
    assert curve[0] == pytest.approx(1.0, abs=0.07)
    assert curve[-1] == pytest.approx(last, abs=0.07)


def test_without_a_layout_and_a_home_the_picture_has_the_skew_since_the_start():
    _, course = rehearse(layout(0.001), parameters())
    course.outcome = None
    curve = skew_in(plot.figure(course))
    assert curve[0] == 0.0 and curve[-1] == pytest.approx(-1.0, abs=0.07)


def skew_in(sheet):
    """Return the skew that a picture shows, mm."""
    (skew,) = (axes for axes in sheet.axes if axes.get_ylabel().startswith('skew'))
    (curve,) = (line for line in skew.get_lines() if line.get_color() == COLOURS[0])
    return curve.get_ydata()


@pytest.mark.parametrize('suffix', ['.npz', '.csv'])
def test_a_saved_course_has_both_sides(tmp_path, suffix):
    _, course = rehearse(layout(0.001), parameters())
    path = tmp_path / f'run{suffix}'
    record.save(path, course, 'y: HSHS')
    found = record.load(path).course
    assert found.followers == course.followers
    assert found.outcome == course.outcome and found.outcome.members[1].name == 'y2'
    assert found.samples == course.samples
    assert found.largest_force == course.largest_force > 190.0
