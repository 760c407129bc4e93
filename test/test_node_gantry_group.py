# SPDX-License-Identifier: Apache-2.0
"""Gantries beside axes in one request, between processes; one of them has three followers."""

import pytest
import ros_harness as ros
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from trajectory_msgs.msg import JointTrajectory

pytestmark = pytest.mark.long

STIFFNESS, MAX_SKEW = 1e5, 0.002
LAYOUT = {**ros.LAYOUT, 'home_switch': [0.055, 0.07]}
#: How far the followers of a gantry are ahead at the start, m. Those of w contradict each other:
#: each may be squared, but they are further than max_skew from each other.
SKEWS = {'y': (0.0015, -0.0004, 0.0009), 'w': (0.0012, -0.0012)}


def names_of(gantry):
    return [f'{gantry}{number}' for number, _ in enumerate(SKEWS[gantry], 2)]


def gantry_of(name):
    own = {f'{one}.joint': f'{one}_joint' for one in names_of(name)}
    followers = {'followers': names_of(name), 'max_skew': MAX_SKEW}
    return {'joint': f'{name}_joint', **followers, **own}


def layout_of(name):
    """Return the layout of a gantry, with the joints of its sides."""
    own = {
        f'{one}.{key}': value
        for one, skew in zip(names_of(name), SKEWS[name], strict=True)
        for key, value in (
            ('start', LAYOUT['start'] + skew),
            ('stiffness', STIFFNESS),
            ('joint', f'{one}_joint'),
        )
    }
    return {**LAYOUT, 'followers': names_of(name), 'joint': f'{name}_joint', **own}


def test_groups_of_gantries_and_axes(tmp_path):
    """First z homes, then x beside the gantry y, then w, which is not forced."""
    parameters = ros.node_parameters(
        {'z': {}, 'x': {}, 'y': gantry_of('y'), 'w': gantry_of('w')},
        home_sequence=['z', 'x, y', 'w'],
    )
    plant = ros.plant_parameters(
        {'z': LAYOUT, 'x': LAYOUT, 'y': layout_of('y'), 'w': layout_of('w')}
    )
    with ros.World(tmp_path, parameters, plant) as world:
        client = world.client
        states = {name: client.record_states(name) for name in 'zxyw'}
        setpoints = client.record(JointTrajectory, 'setpoints')
        feedback = client.record(JointState, '/joint_states')
        forces = {
            (name, one): client.record(Float64, f'/simulated_axes/{name}/{one}/racking_force')
            for name in SKEWS
            for one in names_of(name)
        }
        asking = ros.Asking(lambda: client.send(ros.Trigger, 'home'), lambda: False, ros.UNHEARD)
        answer = client.until(asking.answer, 60.0, 'an answer')
        assert not answer.success
        client.until(lambda: all(one[-1].message.state == 'Idle' for one in states.values()))
        last = {name: one[-1].message for name, one in states.items()}
        assert [last[name].homed for name in 'zxyw'] == [True, True, True, False]
        assert last['w'].error in ('FollowerSwitchMissing', 'SkewTooLarge'), last['w'].message

        begun, ended = {}, {}
        for one in setpoints:
            for joint in one.message.joint_names:
                begun.setdefault(joint, one.sent)
                ended[joint] = one.sent
        of_y = [f'{name}_joint' for name in ('y', *names_of('y'))]
        assert ended['z'] < begun['x'] and ended['z'] < begun['y_joint']
        assert begun['y_joint'] < ended['x'] and begun['x'] < ended['y_joint']
        assert ended['x'] < begun['w_joint'] and ended['y_joint'] < begun['w_joint']
        assert {begun[joint] for joint in of_y} == {begun['y_joint']}

        at = dict(zip(feedback[-1].message.name, feedback[-1].message.position, strict=True))
        for member in last['y'].members[1:]:
            true = at[member.joint] - at['y_joint']
            assert abs(true) <= 5e-5 + member.uncertainty, member
            assert abs(member.squareness + true) <= member.uncertainty + 2e-6
        for (name, one), heard in forces.items():
            start = abs(SKEWS[name][names_of(name).index(one)])
            worst = max(abs(each.message.data) for each in heard)
            assert worst <= STIFFNESS * (start + 0.0005), (one, worst)
