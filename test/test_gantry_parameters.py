# SPDX-License-Identifier: Apache-2.0
"""The parameters of a gantry: what is a follower's own, what is the leader's, what is refused."""

from pathlib import Path

import pytest
from gantry_rig import Gantry, SideRig

from homing_node.parameters.configuration import configuration
from homing_node.parameters.definition import InvalidParameters
from homing_node.parameters.gantry import group_parameters
from homing_node.parameters.wiring import wiring_of
from homing_node.parameters.yaml_file import load, read
from homing_node.procedures.states import Error, Input, LSType
from homing_node.ros.simulated.settings import settings_from

CONFIG = Path(__file__).resolve().parent.parent / 'config'

GANTRY = {
    'axes': ['y'],
    'y.joint': 'y1_joint',
    'y.home_type': 'HSHS',
    'y.travel': 0.4,
    'y.invert_hs_polarity': True,
    'y.followers': ['y2'],
    'y.max_skew': 0.002,
    'y.y2.joint': 'y2_joint',
    'y.y2.switch_offset': 0.0003,
}


def follower(**changes):
    """Return the parameters of the follower, where some parameters are others."""
    return configuration({**GANTRY, **changes}).followers['y']['y.y2']


def faults(**changes):
    with pytest.raises(InvalidParameters) as caught:
        configuration({**GANTRY, **{name.replace('__', '.'): v for name, v in changes.items()}})
    return caught.value.faults


def fault(**changes):
    found = faults(**changes)
    assert len(found) == 1, found
    return found[0]


def test_a_follower_has_the_parameters_of_its_leader_but_for_its_own():
    checked = configuration(GANTRY)
    one = checked.followers['y']['y.y2']
    assert (one.joint, one.switch_offset) == ('y2_joint', 0.0003)
    assert one.invert_hs_polarity and one.travel == 0.4 and one.followers == ()
    assert list(checked.axes) == ['y'] and list(checked.drives) == ['y', 'y.y2']
    assert checked.joints == {'y': 'y1_joint', 'y.y2': 'y2_joint'}
    assert checked.position_joints == ('y1_joint', 'y2_joint')
    assert str(checked.connections['y.y2'].source('y.y2', 'home_switch')) == '~/y/y2/home_switch'
    assert not follower(**{'y.y2.invert_hs_polarity': False}).invert_hs_polarity
    assert follower(**{'y.y2.joint': None}).joint == 'y2'


def test_a_follower_need_not_have_every_switch():
    one = follower(**{'y.y2.switches': ['positive_limit_switch']})
    assert one.switches == (Input.POSITIVE_LIMIT_SWITCH,)
    places = wiring_of(configuration({**GANTRY, 'y.y2.switches': []})).signals
    assert all(place.axis == 'y' for place in places)


def test_a_direction_by_a_method_of_cia_402_can_be_mirrored():
    one = follower(**{'y.home_type': 19, 'y.y2.home_direction': 'Negative'})
    assert one.home_direction == 'Negative'


@pytest.mark.parametrize(
    ('changes', 'text'),
    [
        ({'y__max_skew': None}, 'y.max_skew: required with followers (y2)'),
        ({'y__max_skew': 0.0}, 'y.max_skew: required with followers (y2)'),
        ({'y__max_skew': -0.001}, 'y.max_skew: -0.001 m must be 0 or >= 1e-09'),
        ({'y__max_skew': 5.0}, 'y.max_skew: 5 m must be < travel, '),
        ({'y__followers': ['y2', 'y2']}, 'a name is empty or stands twice'),
        ({'y__square_tolerance': 0.002}, 'y.square_tolerance: 0.002 m must be < max_skew'),
        ({'y__home_type': 'CurrentPos'}, 'y.home_type: CurrentPos cannot home a gantry'),
        ({'y__home_type': 'ZPulse', 'y__switches': ['z_pulse']}, 'y.home_type: ZPulse cannot'),
        ({'y__rehome': True}, 'y.rehome: true cannot be with followers'),
        ({'y__restore': 'trust'}, 'y.restore: trust cannot be with followers'),
        ({'y__apply': 'relay'}, 'y.apply: relay cannot be with followers'),
        ({'y__wrap': 6.0}, 'y.wrap: 6 m cannot be with followers'),
        ({'y__open_loop_homing': True}, 'y.open_loop_homing: true cannot be with followers'),
        (
            {'y__gantry_homing_use_slave_mechanical_end': True},
            'y.gantry_homing_use_slave_mechanical_end: true is not there yet',
        ),
        ({'y__switch_offset': 0.1}, 'y.switch_offset: is for a follower: y.y2.switch_offset'),
        ({'y__y2__travel': 1.0}, "y.y2.travel: a gantry has one, the leader's: y.travel"),
        ({'y__y2__jiont': 'a'}, "y.y2.jiont: no such parameter; did you mean 'joint'?"),
        ({'y__y2__switches': ['hoem']}, "y.y2.switches: 'hoem' is none of home_switch"),
        ({'y__y2__joint': 'y1_joint'}, "y.y2.joint: 'y1_joint' is already the joint of axis y"),
        ({'y__y3__joint': 'a'}, "y.y3: 'y3' is none of the followers of y"),
        ({'y__y2__topics__home_switch': '~/y/home_switch'}, 'on a gantry each switch is an input'),
        ({'position_joints': ['y1_joint']}, "position_joints: 'y2_joint', the joint of axis y.y2"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else '',
)
def test_what_is_refused(changes, text):
    assert text in fault(**changes)


@pytest.mark.parametrize('changes', [{'y__followers': ['y']}, {'axes': ['y', 'y2']}])
def test_a_follower_is_no_axis(changes):
    """It is told even where nothing else of that axis is."""
    assert any('is one of the axes: a follower is none' in one for one in faults(**changes))


def test_names_of_followers():
    assert "'y2' is one of the axes" in str(faults(axes=['y', 'y2'], **_axis('y2')))
    for name in ('state', 'topics', 'travel', '2'):
        assert f'y.followers: {name!r}' in str(faults(y__followers=['y2', name]))


def _axis(name):
    return {f'{name}__home_type': 'HS', f'{name}__travel': 1.0}


def test_needless_parameters_of_an_axis():
    alone = {'y__followers': [], 'y__y2__joint': None, 'y__y2__switch_offset': None}
    assert fault(**alone) == 'y.max_skew: 0.002 m has no effect without followers'


def test_a_gantry_as_one_axis():
    """All inputs, the strongest action of each limit, the weakest dynamics."""
    leader = configuration({**GANTRY, 'y.ls_type': 'SlowDec'}).axes['y']
    other = follower(
        **{
            'y.y2.ls_type': 'DecServoOff',
            'y.y2.switches': ['home_switch', 'negative_limit_switch'],
            'y.y2.homing_velocity_fast': 0.02,
            'y.y2.max_jerk': 5.0,
        }
    )
    one = group_parameters(leader, [other])
    assert set(one.inputs) == set(leader.inputs)
    assert (one.positive_ls_type, one.negative_ls_type) == (LSType.SlowDec, LSType.DecServoOff)
    assert (one.homing_velocity_fast, one.max_jerk) == (0.02, 5.0)
    assert one.homing_velocity_slow == leader.homing_velocity_slow
    mirrored = follower(**{'y.y2.home_direction': 'Negative', 'y.y2.ls_type': 'ServoOff'})
    only = group_parameters(leader, [mirrored])
    assert only.positive_ls_type is LSType.ServoOff and only.home_direction == 'Positive'


@pytest.mark.parametrize('skew', [0.0, 0.001, -0.0015])
def test_the_example_homes_as_it_stands(skew):
    checked = load(CONFIG / 'gantry.yaml')
    layout = settings_from(read(CONFIG / 'simulated_axes.yaml', '/simulated_axes').values)
    sides = (SideRig(lag=0.005), SideRig(skew=skew, offset=0.0003, lag=0.006))
    gantry = Gantry(
        'HSHS', sides, start=0.1, parameters=checked.axes['y'], layout=layout.layouts['x']
    )
    own = {name: drive.parameters for name, drive in gantry.axis.drives.items()}
    assert {name: p.switch_offset for name, p in own.items()} == {'y': 0.0, 'y.y2': 0.0003}
    assert own['y.y2'].switches == checked.followers['y']['y.y2'].switches
    outcome = gantry.home()
    assert outcome.error is Error.NoError, outcome.message
    assert outcome.home_position_raw == pytest.approx(0.150, abs=1e-5)
    assert gantry.skews == pytest.approx([0.0], abs=5e-5)
