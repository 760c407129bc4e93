# SPDX-License-Identifier: Apache-2.0
"""Layout files: both forms, what may be unknown, and faults with their place."""

from itertools import pairwise
from math import inf, isnan
from pathlib import Path

import pytest

from homing_node.plant.layout import SwitchLayout
from homing_node.plant.layout_file import InvalidLayout, load

CONFIG = Path(__file__).parent.parent / 'config'


def read(tmp_path, text):
    path = tmp_path / 'layout.yaml'
    path.write_text(text)
    return load(path)


def test_the_parameters_of_simulated_axes():
    found = load(CONFIG / 'simulated_axes.yaml')
    assert list(found.layouts) == ['x', 'y', 'z']
    assert found.layouts['y'].switches['home_switch'] == SwitchLayout(0.04, 0.05, 0.00005)
    assert (found.feedback_rate, found.dead_time) == (500.0, 0.004)


def test_a_plain_file_with_what_is_known(tmp_path):
    found = read(
        tmp_path,
        """
y:   # not a boolean here
  hard_stops: [null, 2e-1]
  home_switch: [0.15, 0.16]
  positive_limit_switch: [0.19, null]
  negative_limit_switch: null
  index_pitch: 1e-2
  index_offset: null
""",
    )
    assert found.feedback_rate is None and found.dead_time is None
    layout = found.layouts['y']
    assert layout.hard_stops == (-inf, 0.2)
    assert layout.switches == {
        'home_switch': SwitchLayout(0.15, 0.16),
        'positive_limit_switch': SwitchLayout(0.19, inf),
    }
    assert layout.index_pitch == 0.01 and isnan(layout.index_offset)


def test_nothing_known_but_the_axis(tmp_path):
    assert read(tmp_path, 'x: {}').layouts['x'].hard_stops == (-inf, inf)


@pytest.mark.parametrize(
    'stops, start',
    [('[0.1, 0.3]', 0.2), ('[0.1, null]', 0.1), ('[null, -0.1]', -0.1), ('[-0.1, 0.1]', 0.0)],
)
def test_an_axis_starts_within_its_travel(tmp_path, stops, start):
    layout = read(tmp_path, f'x: {{hard_stops: {stops}}}').layouts['x']
    assert layout.start == pytest.approx(start)


@pytest.mark.parametrize(
    'text', ['x: {lag: %s}' % ('9' * 5000), 'x: %s' % ('9' * 5000), '%s: {}' % ('[' * 3000)]
)
def test_values_that_python_does_not_read(tmp_path, text):
    with pytest.raises(InvalidLayout, match=r'layout.yaml:1: .*(too long|expected)|nested'):
        read(tmp_path, text)


@pytest.mark.parametrize('top', ['a: *h\n', 'a: {lag: *h}\n', 'a: {home_switch: *h}\n'])
def test_a_value_of_millions_makes_no_message_of_millions(tmp_path, top):
    """Each line holds the one before it nine times."""
    names = 'bcdefgh'
    lines = ['  - &b [1, 1, 1, 1, 1, 1, 1, 1, 1]']
    for before, name in pairwise(names):
        lines.append(f'  - &{name} [{", ".join(9 * ["*" + before])}]')
    with pytest.raises(InvalidLayout) as found:
        read(tmp_path, '\n'.join(['z:', *lines]) + '\n' + top)
    assert all(len(fault) < 1000 for fault in found.value.faults)


@pytest.mark.parametrize('line', ['index_pitch: 1', 'hard_stops: [0, 1', 'lag: -1'])
def test_a_whole_number_that_no_float_holds(tmp_path, line):
    with pytest.raises(InvalidLayout, match=line.partition(':')[0]):
        read(tmp_path, f'x:\n  {line}{"0" * 400}{"]" * line.count("[")}\n')


def test_dotted_names_as_ros_reads_them(tmp_path):
    found = read(
        tmp_path,
        """
/**:
  ros__parameters:
    x.hard_stops: [0.0, 0.2]
    x.lag: 0.01
    x: {start: 0.1, joint: x_joint}
    x.joint: x_joint
""",
    )
    assert (found.layouts['x'].lag, found.layouts['x'].start) == (0.01, 0.1)


@pytest.mark.parametrize(
    'text, said',
    [
        (
            'x:\n  hard_stops: [0.0, 0.2]\n  hom_switch: [0.1, 0.2]\n',
            "layout.yaml:3: x.hom_switch: no such parameter; did you mean 'home_switch'",
        ),
        ('x:\n  lag: -1\n', 'layout.yaml:2: x.lag: -1.0 s must be >= 0'),
        ('x:\n  lag: [1, 2]\n', r'x.lag: \[1, 2\] is not a number'),
        ('x:\n  home_switch: [0.2, 0.1]\n', 'x.home_switch: 0.2 m or rad must be <= 0.1'),
        ('x: {hard_stops: ["a", 0.2]}\n', r"hard_stops: \['a', 0.2\] is not a pair"),
        ('x: {hard_stops: ["a", null]}\n', 'hard_stops: .* is not a pair'),
        ('x: {hard_stops: [0.2]}\n', 'hard_stops: .* is not a pair'),
        ('x: {}\ny: {}\nx: {}\n', 'layout.yaml:3: x stands there twice'),
        ('x:\n  lag: 0.1\n  lag: 0.2\n', 'layout.yaml:3: lag stands there twice'),
        (
            'x:\n  positive_limit_switch: [0.1, 0.2]\n  stays_off: [positive_limit_switch]\n',
            'layout.yaml:3: x.stays_off: where positive_limit_switch is stands there, too',
        ),
        ('x:\n  stays_off: [home_switch]\n', 'layout.yaml:2: x.stays_off: '),
        ('x: 3\n', 'layout.yaml:1: x: 3 is not a mapping'),
        ('- x\n', 'expected the names of axes'),
        ('', 'expected the names of axes'),
        ('x: [1\n', 'layout.yaml:[12]: '),
        ('x: &a {}\ny: *b\n', 'undefined alias'),
        ('/**:\n  ros__parameters:\n    axes: [x]\n', 'no axis in it'),
        ('/**:\n  ros__parameters:\n    feedback_rate: fast\n    x: {}\n', "'fast' is not a num"),
        ('x: {lag: !!python/name:os.system ""}\n', 'could not determine a constructor'),
    ],
)
def test_faults_name_the_file_the_line_and_the_value(tmp_path, text, said):
    with pytest.raises(InvalidLayout, match=said):
        read(tmp_path, text)


GANTRY = """
y:
  followers: ['y2']
  hard_stops: [-0.01, 0.21]
  home_switch: [0.15, 0.16]
  home_switch_hysteresis: 0.0001
  negative_limit_switch: [null, 0.0]
  inverted: [negative_limit_switch]
  index_pitch: 0.01
  index_offset: 0.0037
  start: 0.1
  lag: 0.005
y.y2:
  stiffness: 1e6
"""


def test_a_follower_has_what_the_leader_has(tmp_path):
    layout = read(tmp_path, GANTRY).layouts['y']
    assert list(layout.followers) == ['y.y2']
    follower = layout.followers['y.y2']
    assert follower == layout._replace(followers={}, stiffness=1e6)
    assert (layout.mass, layout.delay, layout.stiffness) == (50.0, 0.0, 0.0)


def test_what_is_a_followers_own(tmp_path):
    own = """
  home_switch: [0.1503, 0.1603]
  inverted: []
  negative_limit_switch: null
  positive_limit_switch: [0.19, null]
  positive_limit_switch_hysteresis: 0.0002
  index_offset: null
  start: 0.101
  lag: 0.01
  delay: 0.05
  mass: 80
"""
    follower = read(tmp_path, GANTRY + own).layouts['y'].followers['y.y2']
    assert follower.switches == {
        'home_switch': SwitchLayout(0.1503, 0.1603, 0.0001),
        'positive_limit_switch': SwitchLayout(0.19, inf, 0.0002),
    }
    assert follower.index_pitch == 0.01 and isnan(follower.index_offset)
    assert (follower.start, follower.lag, follower.delay, follower.mass) == (
        0.101,
        0.01,
        0.05,
        80.0,
    )


def test_a_followers_encoder_begins_elsewhere(tmp_path):
    text = GANTRY + '  square_at: 0.02\n'
    follower = read(tmp_path, text).layouts['y'].followers['y.y2']
    assert follower.hard_stops == pytest.approx((0.01, 0.23))
    assert follower.switches['home_switch'][:2] == pytest.approx((0.17, 0.18))
    assert (follower.start, follower.index_offset) == pytest.approx((0.12, 0.0237))


def test_a_mirrored_follower(tmp_path):
    text = GANTRY + '  square_at: 0.02\n  mirrored: true\n'
    follower = read(tmp_path, text).layouts['y'].followers['y.y2']
    assert follower.hard_stops == pytest.approx((-0.23, -0.01))
    assert follower.switches['home_switch'][:2] == pytest.approx((-0.18, -0.17))
    assert follower.switches['positive_limit_switch'] == SwitchLayout(-0.02, inf, inverted=True)
    assert 'negative_limit_switch' not in follower.switches
    assert follower.start == pytest.approx(-0.12)
    assert (follower.mirrored, follower.square_at) == (True, 0.02)


def test_all_forms_of_a_gantry_are_one(tmp_path):
    plain = read(tmp_path, GANTRY).layouts
    nested = GANTRY.replace('y.y2:\n  stiffness: 1e6', '  y2: {stiffness: 1e6}')
    assert read(tmp_path, nested).layouts == plain
    lines = ''.join(f'    {line}\n' for line in GANTRY.splitlines())
    assert read(tmp_path, f'/**:\n  ros__parameters:\n{lines}').layouts == plain
    dotted = lines.replace('y.y2:\n      stiffness', 'y.y2.joint: y2_joint\n    y.y2.stiffness')
    assert read(tmp_path, f'/**:\n  ros__parameters:\n{dotted}').layouts == plain


@pytest.mark.parametrize(
    'change, said',
    [
        (
            ('  stiffness: 1e6', '  lag: 0.0'),
            'layout.yaml:13: y.y2.stiffness: required, but not set (stiffness of the spring '
            'between it and the leader (0: nothing joins them), N/m)',
        ),
        (
            ('y.y2:\n  stiffness: 1e6\n', ''),
            'layout.yaml:2: y.y2.stiffness: required, but not set (stiffness of the spring '
            'between it and the leader (0: nothing joins them), N/m)',
        ),
        (('stiffness: 1e6', 'stiffness: -1'), 'layout.yaml:14: y.y2.stiffness: -1.0 N/m must be'),
        (
            ("followers: ['y2']", 'stop_dec: 1.0'),
            "layout.yaml:13: y.y2: 'y2' is none of the followers of y: add it to y.followers, or "
            'delete its keys',
        ),
        (
            ("['y2']", "['y2', 'y2']"),
            'layout.yaml:3: y.followers: a name stands twice in y2, y2',
        ),
        (
            ("['y2']", "['y2', '3']"),
            "layout.yaml:3: y.followers: '3' is not a name: a letter, then letters, digits and _",
        ),
        (("['y2']", "['y2', lag]"), "layout.yaml:3: y.followers: 'lag' is a key of a layout"),
        (("['y2']", 'y2'), "layout.yaml:3: y.followers: 'y2' is not a list of strings"),
        (
            ('1e6', '1e6\n  followers: [y3]'),
            'layout.yaml:15: y.y2.followers: no such parameter',
        ),
        (
            ("  followers: ['y2']", '  stiffness: 1e6'),
            'layout.yaml:3: y.stiffness: no such parameter',
        ),
        (
            ('1e6', '1e6\n  start: 0.5'),
            'layout.yaml:15: y.y2.start: 0.5 m or rad must be within hard_stops, [-0.01, 0.21]',
        ),
        (
            ('1e6', '1e6\n  square_at: far'),
            "layout.yaml:15: y.y2.square_at: 'far' is not a number (m or rad)",
        ),
        (
            ('1e6', '1e6\n  mirrored: 1'),
            'layout.yaml:15: y.y2.mirrored: 1 is not true or false',
        ),
        (
            ('1e6', '1e6\n  inverted: [home_switch]\n  home_switch: null'),
            'layout.yaml:15: y.y2.inverted: home_switch is not given',
        ),
        (
            ('1e6', '1e6\n  positive_limit_switch_hysteresis: 0.0'),
            'layout.yaml:15: y.y2.positive_limit_switch_hysteresis: positive_limit_switch is not '
            'given',
        ),
        (
            ('1e6', '1e6\n  hard_stops: [0.0, 0.0]'),
            'layout.yaml:15: y.y2.hard_stops: both are 0.0 m or rad, which leaves no travel',
        ),
        (('1e6', '1e6\n  mass: 0'), 'layout.yaml:15: y.y2.mass: 0.0 kg must be'),
        (
            ('1e6', '1e6\nx: {delay: 0.05}'),
            'layout.yaml:15: x.delay: 0.05 has no effect: x has no followers',
        ),
    ],
)
def test_faults_of_a_gantry(tmp_path, change, said):
    text = GANTRY.replace(*change)
    assert text != GANTRY
    with pytest.raises(InvalidLayout) as caught:
        read(tmp_path, text)
    assert any(said in fault for fault in caught.value.faults), caught.value


def test_all_faults_at_once(tmp_path):
    with pytest.raises(InvalidLayout) as caught:
        read(tmp_path, 'x:\n  lag: a\n  start: b\ny:\n  lagg: 1\n')
    assert [fault.split(':')[1] for fault in caught.value.faults] == ['2', '3', '5']


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(InvalidLayout, match='No such file'):
        load(tmp_path / 'none.yaml')
    with pytest.raises(InvalidLayout, match='directory'):
        load(tmp_path)
    (tmp_path / 'binary').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(InvalidLayout, match='UTF-8'):
        load(tmp_path / 'binary')


@pytest.mark.parametrize(
    'text',
    [
        'switch_rate: 50\nx: {}\ny: {switch_rate: 0}\n',
        '/**: {ros__parameters: {switch_rate: 50.0, x.lag: 0.0, y.switch_rate: 0.0}}',
    ],
)
def test_how_often_the_switches_are_read(tmp_path, text):
    layouts = read(tmp_path, text).layouts
    assert list(layouts) == ['x', 'y']
    assert (layouts['x'].switch_rate, layouts['x'].switch_period) == (50.0, 0.02)
    assert (layouts['y'].switch_rate, layouts['y'].switch_period) == (0.0, 0.0)


def test_what_is_true_of_all_axes_stands_in_a_plain_file_too(tmp_path):
    found = read(tmp_path, 'feedback_rate: 100\ndead_time: null\nx: {}\n')
    assert (found.feedback_rate, found.dead_time) == (100.0, None)
    assert found.layouts['x'].switch_rate is None
    with pytest.raises(
        InvalidLayout, match=r'switch_rate: -1\.0 Hz must be 0 or >= 0\.1 and <= 5000 Hz'
    ):
        read(tmp_path, 'switch_rate: -1\nx: {}\n')
