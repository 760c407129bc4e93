# SPDX-License-Identifier: Apache-2.0
"""Home types between real processes: from every start position, in both directions."""

import re
from itertools import pairwise

import pytest
import ros_harness as ros
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory

#: Start positions in the layout of the harness, m. The narrow flag is overrun.
STARTS = {
    'before': {'start': 0.04},
    'on': {'start': 0.058},
    'between': {'start': 0.070},
    'limit': {'start': 0.082},
    'narrow': {'start': 0.045, 'home_switch': [0.055, 0.0555]},
}
TYPES = ('HS', 'HSHS', 'HSReverseZPulse')
#: Speed at the reference, m/s; of a latched position no edge moves.
SPEED = {'HS': 0.05, 'HSHS': 0.005, 'HSReverseZPulse': 0.0}
#: How much longer or faster an interval of the feedback may be than it should, on a busy machine.
UNCERTAIN = 6.0
#: The uncertainty of a latched position, m: settling_tolerance, and a float's last digits.
FINEST = 1e-5 + 1e-8
EDGE = {'HS': 0.055, 'HSHS': 0.055, 'HSReverseZPulse': 0.0535}

REVERSAL, CLEAR = 'HSFallingEdgeSearchReverse', 'HSClearReverse'
#: What follows until the home shift.
NORMAL = {
    'HS': ['HSSearch'],
    'HSHS': ['HSSearch', CLEAR, 'SecondHSSearch'],
    'HSReverseZPulse': ['HSSearch', 'ZPulseSearchReverse'],
}


def expected_course(home_type, start):
    normal = NORMAL[home_type]
    path = {
        'before': normal,
        'narrow': normal,
        'on': [CLEAR, 'SecondHSSearch'] if home_type == 'HSHS' else [CLEAR, *normal],
        'between': ['HSSearch', REVERSAL, *normal],
        'limit': [REVERSAL, *normal],
    }[start]
    return ['Idle', *path, 'HomeShift', 'Idle']


class Run:
    """All axes of a type have homed once; everything that was heard meanwhile."""

    def __init__(self, world, home_type):
        self.world = world
        self.client = client = world.client
        self.home_type = home_type
        self.axes = [f'{d}_{start}' for d in ('up', 'down') for start in STARTS]
        self.setpoints = client.record(JointTrajectory, 'setpoints')
        self.states = {axis: client.record_states(axis) for axis in self.axes}
        self.homed = client.record(JointState, 'joint_states')
        self.diagnostics = client.record(DiagnosticArray, '/diagnostics')
        client.until(lambda: all(self.states.values()), what='a state of every axis')
        self.early = len(self.setpoints)
        self.answers = client.home(*self.axes)
        client.until(lambda: all(s[-1].message.homed for s in self.states.values()))
        self.total = len(self.setpoints)


@pytest.fixture(
    scope='module',
    params=[one if one == 'HSHS' else pytest.param(one, marks=pytest.mark.long) for one in TYPES],
)
def run(request, tmp_path_factory):
    layouts, axes = {}, {}
    for start, values in STARTS.items():
        layout = {**ros.LAYOUT, **values}
        layouts[f'up_{start}'], layouts[f'down_{start}'] = layout, ros.mirrored(layout)
    for name in layouts:
        axes[name] = {
            'home_type': request.param,
            'home_direction': 'Positive' if name.startswith('up') else 'Negative',
            'switches': [
                'home_switch',
                'positive_limit_switch',
                'negative_limit_switch',
                'z_pulse',
            ],
        }
    with ros.World(
        tmp_path_factory.mktemp('homing'), ros.node_parameters(axes), ros.plant_parameters(layouts)
    ) as world:
        yield Run(world, request.param)


#: For what does not depend on the type.
ONE_TYPE = pytest.mark.parametrize('run', ['HSHS'], indirect=True)


def start_of(axis):
    return axis.partition('_')[2]


def sign_of(axis):
    return 1.0 if axis.startswith('up') else -1.0


def test_every_axis_finds_its_edge(run):
    for axis, answer in run.answers.items():
        assert answer.success, answer.message
        found = re.match(
            r'Homed: home_position_raw=(\S+) m ± .*? home_offset=(\S+) m uncertainty=(\S+) m',
            answer.message,
        )
        assert found, answer.message
        raw, offset, uncertainty = map(float, found.groups()[:3])
        error = abs(raw - sign_of(axis) * EDGE[run.home_type])
        assert offset == raw
        assert error <= max(uncertainty, 5e-6), (axis, error, uncertainty)
        assert error <= (1e-4 if run.home_type == 'HS' else 1e-5), (axis, error)
        assert 0 <= uncertainty <= UNCERTAIN * SPEED[run.home_type] / 500 + FINEST, answer.message


def test_every_state_on_the_way_is_published(run):
    for axis, states in run.states.items():
        assert ros.course(states) == expected_course(run.home_type, start_of(axis)), axis
        messages = [heard.message for heard in states]
        assert all(m.axis == axis and m.error == 'NoError' and not m.paused for m in messages)
        homed = [m.homed for m in messages]
        assert homed == sorted(homed)  # from its end on
        assert homed[-1]
        assert all(m.state == 'Idle' for m in messages if m.homed)
        assert messages[-1].home_position_raw == pytest.approx(
            sign_of(axis) * EDGE[run.home_type], abs=1e-4
        )
        assert messages[-1].home_offset == messages[-1].home_position_raw
        assert 0 <= messages[-1].uncertainty <= UNCERTAIN * SPEED[run.home_type] / 500 + FINEST
        stamps = [m.header.stamp.sec + m.header.stamp.nanosec * 1e-9 for m in messages]
        assert stamps == sorted(stamps)
        # 10 Hz while homing: no gap is much longer.
        assert stamps[-1] - stamps[1] < 0.3 * (len(stamps) - 1)


def test_setpoints_keep_to_the_limits(run):
    for axis in run.axes:
        samples = ros.course_of(run.setpoints[: run.total], axis)
        braked_by_limit = start_of(axis) == 'between'
        ros.assert_within_limits(samples, 0.05, 1.0 if braked_by_limit else 0.5, 20.0)
        start = sign_of(axis) * STARTS[start_of(axis)]['start']
        assert samples[0].position == pytest.approx(start, abs=20.0 * 0.004**3)
        assert samples[0].velocity == pytest.approx(0.0, abs=20.0 * 0.004**2)
        assert samples[-1].velocity == samples[-1].acceleration == 0.0
        # It ends on the edge that it has found.
        raw = run.states[axis][-1].message.home_position_raw
        assert samples[-1].position == pytest.approx(raw, abs=1e-9)
        assert max(sign_of(axis) * s.position for s in samples) < 0.085


def test_setpoints_tell_the_joints_that_home_what_comes(run):
    for heard in run.setpoints[: run.total]:
        message = heard.message
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert -0.2e9 < stamp - heard.sent < 0.02e9  # a busy machine sends late, never early
        times = [p.time_from_start.sec * 10**9 + p.time_from_start.nanosec for p in message.points]
        assert times[0] == 0
        assert {4_000_000, 8_000_000} <= set(times)
        assert all(later > earlier for earlier, later in pairwise(times))
        for point in message.points:
            assert len(point.positions) == len(point.velocities) == len(point.accelerations)
            assert len(message.joint_names) == len(point.positions) > 0
        assert len(set(message.joint_names)) == len(message.joint_names)
        assert set(message.points[-1].velocities) == set(message.points[-1].accelerations) == {0.0}
    # The runs have different lengths, so the last messages lack those that have ended.
    assert len(run.setpoints[run.total - 1].message.joint_names) < len(run.axes)


def test_a_setpoint_every_cycle(run):
    times = [s.time for s in ros.course_of(run.setpoints[: run.total], 'up_between')]
    steps = sorted(b - a for a, b in pairwise(times))
    # A busy machine misses a cycle now and then; twice as many setpoints, or half, would show.
    assert steps[len(steps) // 2] == pytest.approx(0.004, rel=0.45)


@ONE_TYPE
def test_no_setpoint_without_a_run(run):
    assert run.early == 0
    run.client.pass_time(0.3)
    assert len(run.setpoints) == run.total


@ONE_TYPE
def test_a_late_joiner_hears_state_and_servo(run):
    states = run.client.record_states('up_before')
    servo = run.client.record(Bool, 'up_before/servo_on', ros.LATCHED)
    run.client.until(lambda: states and servo)
    run.client.until(lambda: states[-1].message.homed)
    assert states[-1].message.state == 'Idle'
    assert servo[-1].message.data is True


@ONE_TYPE
def test_homed_joint_states(run):
    """Every homed axis rests where homed coordinates begin."""
    run.client.until(lambda: set(run.homed[-1].message.name) == set(run.axes))
    message = run.homed[-1].message
    assert max(map(abs, message.position)) < 1e-5
    assert message.header.stamp.sec > 0


@ONE_TYPE
def test_diagnostics(run):
    run.client.until(
        lambda: (
            run.diagnostics
            and all(s.message.startswith('homed') for s in run.diagnostics[-1].message.status)
        )
    )
    statuses = {s.hardware_id: s for s in run.diagnostics[-1].message.status}
    assert set(statuses) == {f'/homing_node/{axis}' for axis in run.axes}
    for status in statuses.values():
        # On a busy machine a run may end with a warning.
        assert (status.level == b'\x00') == (status.message == 'homed')
        values = {pair.key: pair.value for pair in status.values}
        assert values['state'] == 'Idle'
        assert values['homed'] == 'True'
        assert values['error'] == 'NoError'


def test_homing_again_finds_the_same_edge(run):
    """With no shift the axis rests exactly on the edge: the switch may be on or off."""
    before = {axis: run.states[axis][-1].message.home_position_raw for axis in run.axes[:4]}
    for axis, answer in run.client.home(*before).items():
        assert answer.success, answer.message
        run.client.until(lambda axis=axis: run.states[axis][-1].message.homed)
        again = run.states[axis][-1].message.home_position_raw
        assert again == pytest.approx(before[axis], abs=2e-4 if run.home_type == 'HS' else 1e-5)
