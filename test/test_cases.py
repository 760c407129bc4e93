# SPDX-License-Identifier: Apache-2.0
"""Inputs on which an earlier version was wrong, rehearsed without ROS (doc/faults.md).

The numbers are those of the reports. What needs processes is in test_node_drivers.py and the
other tests of the node.
"""

from math import inf

import pytest

from homing_node.check import Severity, check_axis
from homing_node.core.axis import Axis
from homing_node.parameters.axis import axis_parameters
from homing_node.plant.layout import AxisLayout, SwitchLayout
from homing_node.procedures.states import Error, Input
from homing_node.rehearsal.link import Transport
from homing_node.rehearsal.run import Rehearsal
from homing_node.rehearsal.sweep import rehearse_from

HS, AHEAD, BEHIND = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'
#: x of a machine of three axes.
X = {
    'home_type': 'HS',
    'home_direction': 'Negative',
    'travel': 0.8,
    'homing_velocity_fast': 0.06,
    'homing_velocity_slow': 0.005,
    'homing_reverse_distance': 0.003,
}
X_LAYOUT = AxisLayout(
    (-0.02, 0.78),
    {
        HS: SwitchLayout(0.0, 0.02, 0.0001),
        AHEAD: SwitchLayout(0.77, inf),
        BEHIND: SwitchLayout(-inf, -0.01),
    },
    lag=0.004,
    start=0.3,
)
#: z of the same machine.
Z = {
    'home_type': 'LS',
    'home_direction': 'Positive',
    'travel': 0.25,
    'homing_reverse_distance': 0.002,
    'home_shift_distance': -0.005,
    'home_position': 0.25,
    'switches': [AHEAD, BEHIND],
}
Z_LAYOUT = AxisLayout(
    (0.0, 0.25),
    {AHEAD: SwitchLayout(0.245, inf), BEHIND: SwitchLayout(-inf, 0.005)},
    lag=0.004,
    start=0.2,
)


def fast_rehearsal(values, layout, **transport):
    return Rehearsal(axis_parameters(values), layout, Transport(feedback_rate=250.0, **transport))


def test_case_1_and_2_the_check_foretells_what_polling_leaves_open():
    for home_type, fast, slow, rate in (('HSHS', 0.1, 0.01, 50.0), ('HS', 0.05, 0.005, 5.0)):
        values = {**X, 'home_type': home_type, 'homing_velocity_fast': fast}
        parameters = axis_parameters({**values, 'homing_velocity_slow': slow})
        layout = X_LAYOUT._replace(switch_rate=rate)
        (found,) = [f for f in check_axis('x', parameters, layout) if f.check == 'accuracy']
        for seed in range(5):
            trial = rehearse_from(parameters, layout, Transport(seed=seed))
            assert trial.success, trial.error
            assert trial.course.outcome.uncertainty <= 1.2 * found.value
            assert found.value <= 2.0 * trial.course.outcome.uncertainty


def test_case_5_an_axis_that_jams_in_the_hard_stop_is_not_homed():
    values = {**X, 'homing_velocity_fast': 1.0, 'homing_velocity_fast_dec': 1.0}
    made = Rehearsal(axis_parameters(values), X_LAYOUT, position=0.7)
    outcome = made.home().outcome
    assert not outcome.success
    assert outcome.error is Error.FollowingError
    assert not made.axis.homed


END = {
    'home_type': 'MechanicalEndDetection',
    'home_direction': 'Positive',
    'travel': 0.158,
    'homing_velocity_fast': 0.05,
    'homing_velocity_slow': 0.05,
    'mechanical_end_detection_pos_diff': 0.0005,
    'mechanical_end_detection_time': 0.05,
    'mechanical_end_detection_first_torque_limit': 20,
    'switches': [],
    'max_jerk': 1000.0,
}


@pytest.mark.parametrize('lag', [0.002, 0.02, 0.05])
def test_case_6_a_drive_that_lags_is_not_at_its_end(lag):
    layout = AxisLayout((-0.001, 0.157), {}, lag=lag, start=0.08)
    trial = rehearse_from(axis_parameters(END), layout, Transport())
    outcome = trial.course.outcome
    assert not trial.wrong_home
    if outcome.success:
        assert outcome.home_position_raw == pytest.approx(0.157, abs=outcome.uncertainty + 1e-9)
        assert outcome.uncertainty > 1e-6
    else:
        assert outcome.error is Error.FollowingError
    findings = check_axis('x', axis_parameters(END), layout)
    assert Severity.error in [finding.severity for finding in findings]


@pytest.mark.parametrize('speed', [0.1, -0.1])
def test_case_13_an_axis_that_something_else_moves(speed):
    axis = Axis('x', axis_parameters(X), 0.004)
    for name in (HS, AHEAD, BEHIND):
        axis.switch(Input(name), 0.0, False)
    for n in range(200):
        axis.feedback(n * 0.004, 0.3 + speed * n * 0.004)
        axis.update(n * 0.004)
    refusal = axis.home(0.796)
    assert refusal is not None
    assert refusal.error is Error.AxisMoving
    assert '0.1 m/s' in refusal.message


def test_case_16_open_loop_homing_takes_the_first_pulse_beyond_the_edge():
    values = {
        **X,
        'home_type': 'HSZPulse',
        'home_direction': 'Positive',
        'homing_velocity_fast': 0.2,
        'open_loop_homing': True,
        'following_error': 0.05,
        'switches': [HS, AHEAD, BEHIND, 'z_pulse'],
    }
    layout = X_LAYOUT._replace(
        switches={**X_LAYOUT.switches, HS: SwitchLayout(0.5, 0.52)},
        index_pitch=0.01,
        index_offset=0.002,  # 2 mm behind the edge; the command is 3.6 mm ahead
        lag=0.018,
    )
    trial = rehearse_from(axis_parameters(values), layout, Transport())
    assert trial.success, trial.course.outcome.message
    assert trial.course.outcome.home_position_raw == pytest.approx(0.502, abs=1e-6)


def test_case_21_a_polarity_that_was_forgotten_is_named():
    layout = X_LAYOUT._replace(
        switches={**X_LAYOUT.switches, HS: SwitchLayout(0.0, 0.02, 0.0001, inverted=True)}
    )
    outcome = fast_rehearsal(X, layout).home().outcome
    assert outcome.error is Error.LSTriggered
    assert 'home switch' in outcome.message
    assert 'invert_hs_polarity' in outcome.message


def test_case_22_the_last_move_is_as_fast_as_the_fast_velocity():
    values = {**Z, 'homing_velocity_fast': 0.002, 'homing_velocity_slow': 0.0002}
    course = fast_rehearsal(values, Z_LAYOUT._replace(start=0.24)).home()
    assert course.outcome.success, course.outcome.message
    shift = [abs(s.velocity) for s in course.samples if s.state == 'HomeShift']
    assert 0.0015 < max(shift) <= 0.002 * (1 + 1e-6)


def test_case_23_dead_switches_end_soon_behind_the_hard_stop():
    flags = {name: SwitchLayout(-10.0, -9.0) for name in (HS, AHEAD, BEHIND)}
    made = fast_rehearsal(X, X_LAYOUT._replace(switches=flags))
    outcome = made.home().outcome
    assert outcome.error is Error.FollowingError
    pushed = [s for s in made.course.samples if s.position < -0.02]
    assert -0.02 - min(s.position for s in pushed) < 0.05 * 0.06 + 0.001 + 0.06 * 0.06
