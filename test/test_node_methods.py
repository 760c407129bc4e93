# SPDX-License-Identifier: Apache-2.0
"""Home types by the number of CiA 402, between real processes."""

import pytest
import ros_harness as ros

SWITCHES = ['home_switch', 'positive_limit_switch', 'negative_limit_switch']
#: axis: (home_type, the direction that it implies, the states of its run)
AXES = {
    'up': (24, 'Positive', ['HSSearch', 'HSClearReverse', 'SecondHSSearch']),
    'down': ('CiA402 28', 'Negative', ['HSSearch', 'HSClearReverse', 'SecondHSSearch']),
    'release': (19, 'Positive', ['HSSearch', 'HSFallingEdgeSearchReverse']),
}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    layouts = {name: {**ros.LAYOUT, 'start': 0.04} for name in AXES}
    layouts['down'] = ros.mirrored(layouts['down'])
    axes = {
        name: {'home_type': home_type, 'switches': SWITCHES}
        for name, (home_type, _, _) in AXES.items()
    }
    with ros.World(
        tmp_path_factory.mktemp('methods'),
        ros.node_parameters(axes),
        ros.plant_parameters(layouts),
    ) as made:
        yield made


def test_a_number_implies_the_direction_and_the_reversal(world):
    for axis, (home_type, direction, _) in AXES.items():
        names = [f'{axis}.{name}' for name in ('home_type', 'home_direction', 'limit_reversal')]
        assert list(world.client.get(*names)) == [home_type, direction, home_type != 19]


def test_it_homes_and_shows_the_states_of_the_table(world):
    states = {axis: world.client.record_states(axis) for axis in AXES}
    world.client.until(lambda: all(states.values()), what='a state of every axis')
    for axis, answer in world.client.home(*AXES).items():
        assert answer.success, (axis, answer.message)
    world.client.until(lambda: all(s[-1].message.homed for s in states.values()))
    for axis, (_, _, path) in AXES.items():
        assert ros.course(states[axis]) == ['Idle', *path, 'HomeShift', 'Idle']


def test_another_number_is_set_with_its_direction(world):
    def set_up(home_type, direction):
        return world.client.set(True, up__home_type=home_type, up__home_direction=direction)

    refused = set_up(28, 'Positive')
    assert not refused.successful
    assert 'contradicts home_type 28' in refused.reason
    assert set_up(28, 'Negative').successful
    assert set_up(24, 'Positive').successful
