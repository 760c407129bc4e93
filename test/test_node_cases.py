# SPDX-License-Identifier: Apache-2.0
"""Drives and values on which an earlier version was wrong, between real processes."""

import pytest
import ros_harness as ros
from trajectory_msgs.msg import JointTrajectory

POSITIVE, NEGATIVE = 'positive_limit_switch', 'negative_limit_switch'
AXES = {
    # case 6: the lag of the drive, 2 mm, is more than mechanical_end_detection_pos_diff
    'end': {
        'home_type': 'MechanicalEndDetection',
        'homing_velocity_slow': 0.05,
        'mechanical_end_detection_pos_diff': 0.0005,
        'mechanical_end_detection_time': 0.05,
        'switches': [],
    },
    # case 16: the command is 3.6 mm ahead of the axis, the index 2 mm behind the edge
    'pulse': {
        'home_type': 'HSZPulse',
        'homing_velocity_fast': 0.2,
        'open_loop_homing': True,
        'switches': ['home_switch', POSITIVE, NEGATIVE, 'z_pulse'],
    },
    # case 22: a tenth of the speed, and a shift of 5 mm
    'slow': {
        'home_type': 'LS',
        'homing_velocity_fast': 0.004,
        'homing_velocity_slow': 0.0004,
        'home_shift_distance': -0.005,
        'switches': [POSITIVE, NEGATIVE],
    },
}
LAYOUTS = {
    'end': {'lag': 0.04},
    'pulse': {'lag': 0.018, 'index_pitch': 0.01, 'index_offset': 0.007},
    'slow': {'start': 0.079},
}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    """Home all the axes at once, and keep their answers and setpoints."""
    with ros.World(
        tmp_path_factory.mktemp('cases'),
        ros.node_parameters(AXES),
        ros.plant_parameters(LAYOUTS),
    ) as made:
        made.setpoints = made.client.record(JointTrajectory, 'setpoints')
        made.states = {axis: made.client.record_states(axis) for axis in AXES}
        made.answers = made.client.home(*AXES)
        yield made


def test_case_6_a_drive_that_lags_is_not_at_its_end(world):
    answer = world.answers['end']
    if not answer.success:
        assert answer.message.startswith('FollowingError: '), answer.message
        return
    world.client.until(lambda: world.states['end'][-1].message.homed)
    last = world.states['end'][-1].message
    assert last.home_position_raw == pytest.approx(0.085, abs=last.uncertainty + 1e-6)
    assert last.uncertainty > 1e-6


def test_case_16_open_loop_homing_takes_the_first_pulse_beyond_the_edge(world):
    answer = world.answers['pulse']
    assert answer.success, answer.message
    world.client.until(lambda: world.states['pulse'][-1].message.homed)
    last = world.states['pulse'][-1].message
    assert last.home_position_raw == pytest.approx(0.057, abs=1e-6)


def test_case_22_the_last_move_is_as_fast_as_the_fast_velocity(world):
    answer = world.answers['slow']
    assert answer.success, answer.message
    speeds = [-one.velocity for one in ros.course_of(world.setpoints, 'slow')]
    assert 0.003 < max(speeds) <= 0.004 * (1 + 1e-6)
