# SPDX-License-Identifier: Apache-2.0
"""Messages and descriptors."""

import re
from types import SimpleNamespace

import pytest
from core_rig import grouped
from diagnostic_msgs.msg import DiagnosticStatus
from gantry_rig import Gantry, SideRig
from homing_interfaces.action import Home
from homing_interfaces.msg import AxisState
from rclpy.serialization import serialize_message
from std_msgs.msg import Bool, Float64

from homing_node.core.axis import Axis
from homing_node.core.dispatch import DryRun
from homing_node.core.outcome import Outcome
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.configuration import AXIS_DEFINITIONS
from homing_node.parameters.node_fields import NODE_DEFINITIONS
from homing_node.parameters.units import Unit
from homing_node.parameters.wiring import Place, Wiring
from homing_node.procedures.states import Error, Input, State
from homing_node.ros import cell_messages, messages
from homing_node.ros.input_status import InputStatus


@pytest.fixture
def axis():
    axis = Axis('x', axis_parameters({'home_type': 'HS', 'travel': 1}), 0.004)
    axis.feedback(1.0, 0.5)
    return axis


def test_members_of_a_gantry():
    gantry = Gantry('HSHS', (SideRig(), SideRig(skew=0.001, zero=0.5)))
    before = messages.axis_state(0, gantry.axis).members
    assert [(one.name, one.joint, one.squareness) for one in before] == [
        ('y', 'y1', 0.0),
        ('y2', 'y2', 0.0),
    ]
    outcome = gantry.home()
    told = messages.home_message({'y': outcome})
    assert re.search(r'^Homed: home_position_raw=0\.06.* y2: squareness=\S+ µm ± ', told), told
    shown = messages.diagnostics(0, '/node', [gantry.axis], lambda _: {}).status[0].values
    assert {'y2.squareness', 'y2.skew'} <= {one.key for one in shown}
    state = messages.axis_state(0, gantry.axis)
    assert state.inputs[3:] == [f'y2.{name}' for name in state.inputs[:3]]
    assert len(state.levels) == 6
    leader, follower = messages.axis_state(0, gantry.axis).members
    assert (leader.skew, leader.squareness) == (0.0, 0.0)
    assert follower.skew == pytest.approx(-0.001, abs=1e-4)
    assert follower.home_position_raw == pytest.approx(0.56, abs=1e-5)
    assert follower.position == pytest.approx(0.56, abs=1e-4)
    assert 0.0 < follower.uncertainty < 1e-4
    homed = gantry.axis.homed_position_of(gantry.axis.followers[0])
    assert homed == pytest.approx(gantry.axis.position, abs=1e-4)


def test_an_axis_has_no_members(axis):
    assert messages.axis_state(0, axis).members == []


@grouped('definition', [*NODE_DEFINITIONS.values(), *AXIS_DEFINITIONS.values()])
def test_descriptors(definition):
    described = messages.descriptor(definition)
    assert described.dynamic_typing  # integers for real numbers
    assert definition.text in described.description
    if definition.unit:
        assert f'[{definition.unit}]' in described.description
    for choice in definition.choices:
        assert choice in described.additional_constraints
    for bounds in (*described.floating_point_range, *described.integer_range):
        assert bounds.from_value <= bounds.to_value
        assert bounds.step == 0
    if definition.bounds:
        assert definition.bounds in described.additional_constraints
        assert described.floating_point_range or described.integer_range
    assert messages.descriptor(definition, read_only=True).read_only


def test_plain_values():
    assert messages.plain(AXIS_DEFINITIONS['switches'].default) == [
        'home_switch',
        'positive_limit_switch',
        'negative_limit_switch',
    ]
    for value in (AXIS_DEFINITIONS['ls_type'].default, Input.Z_PULSE):
        assert type(messages.plain(value)) is str
    assert messages.plain(5) == 5
    assert messages.plain(True) is True
    assert messages.plain(None) is None


@pytest.mark.parametrize('nanoseconds', [0, 1, 999_999_999, 1_000_000_000, 1795347884123456789])
def test_stamps(nanoseconds):
    stamp = messages.to_stamp(nanoseconds)
    assert stamp.nanosec < 1_000_000_000
    assert ns(stamp) == nanoseconds


def ns(stamp):
    return stamp.sec * 1_000_000_000 + stamp.nanosec


@pytest.mark.parametrize('message', [Bool(data=True), Bool(data=False), Float64(data=-0.25)])
def test_values(message):
    data = serialize_message(message)
    assert messages.data_of(data, type(message)) == message.data
    assert messages.data_of(data[:3], type(message)) is None


def test_numbers_are_cast():
    """An integer in a field for real numbers would arrive as another number."""
    assert list(messages.joint_states(0, {'a': 1}).position) == [1.0]


def test_home_message():
    homed = Outcome(Error.NoError, '', 0.123456789123, -0.5, 1.23456e-5)
    assert messages.home_message({'x': homed}) == (
        'Homed: home_position_raw=0.123456789 m ± 12.3 µm home_offset=-0.500000000 m '
        'uncertainty=1.23e-05 m'
    )
    rotary = homed._replace(unit=Unit.rad, duration=2.583, uncertainty=2e-8, index_margin=0.5)
    assert messages.home_message({'x': rotary}) == (
        'Homed: home_position_raw=0.123456789 rad ± 0.02 µrad home_offset=-0.500000000 rad '
        'uncertainty=2e-08 rad index_margin=0.500, 2.58 s'
    )
    passes = homed._replace(passes=3, passes_range=2e-6, passes_deviation=1e-6, applied=0.25)
    assert messages.home_message({'x': passes}).endswith(
        ' passes=3 range=2 µm deviation=1 µm applied=0.250000000 m'
    )
    failed = Outcome(Error.LSTriggered, 'axis x: …')
    canceled = Outcome(Error.Canceled, 'axis y: …')
    outcomes = {'z': homed, 'y': canceled}
    assert messages.home_message(outcomes) == 'Canceled: axis y: …'
    assert messages.home_message({**outcomes, 'x': failed}) == 'LSTriggered: axis x: …'
    both = messages.home_message({'x': homed, 'y': homed})
    assert both.startswith('Homed: x: home_position_raw=0.12')
    assert '; y: home_position_raw=0.12' in both
    warned = Outcome(Error.LSTriggered, 'axis x: …', warnings=('it bounced',))
    assert messages.home_message({'x': warned}) == 'LSTriggered: axis x: … | warning: it bounced'


def test_axis_state(axis):
    message = messages.axis_state(2_500_000_000, axis)
    assert ns(message.header.stamp) == 2_500_000_000
    assert (message.axis, message.state, message.error) == ('x', 'Idle', 'NoError')
    assert (message.error_code, message.state_code) == (0, AxisState.STATE_IDLE)
    assert (message.paused, message.homed) == (False, False)
    assert message.position == 0.5
    axis.outcome = Outcome(Error.NoError, '', 0.25, 0.125, 0.001)
    axis.homed = True
    message = messages.axis_state(0, axis)
    assert message.homed
    assert message.position == 0.375
    assert (message.home_position_raw, message.home_offset) == (0.25, 0.125)
    assert message.uncertainty == 0.001
    assert (message.command, message.following_error) == (0.5, 0.0)


def test_axis_state_has_the_levels_of_the_inputs(axis):
    axis.switch(Input.HOME_SWITCH, 1.0, True)
    axis.switch(Input.POSITIVE_LIMIT_SWITCH, 1.0, False)
    message = messages.axis_state(0, axis)
    assert dict(zip(message.inputs, message.levels, strict=True)) == {
        'home_switch': AxisState.LEVEL_ON,
        'positive_limit_switch': AxisState.LEVEL_OFF,
        'negative_limit_switch': AxisState.LEVEL_UNKNOWN,
    }
    assert message.inputs == list(axis.parameters.switches)


def test_diagnostics(axis):
    def status():
        (found,) = messages.diagnostics(0, '/cell/homing_node', [axis]).status
        return found

    assert (status().level, status().message) == (DiagnosticStatus.WARN, 'not homed')
    assert (status().name, status().hardware_id) == (
        '/cell/homing_node: x',
        '/cell/homing_node/x',
    )
    axis.outcome = Outcome(Error.Timeout, 'too long')
    assert (status().level, status().message) == (DiagnosticStatus.ERROR, 'Timeout: too long')
    axis.outcome = Outcome(Error.NoError)
    axis.homed = True
    assert (status().level, status().message) == (DiagnosticStatus.OK, 'homed')
    assert {pair.key: pair.value for pair in status().values}['state'] == 'Idle'


def test_each_error_and_each_state_has_a_number_of_its_own():
    assert messages.constant_of('MaxLSRevDistanceTraveled') == 'MAX_LS_REV_DISTANCE_TRAVELED'
    assert messages.ERROR_CODES[Error.NoError] == 0
    assert len(set(messages.ERROR_CODES.values())) == len(Error)
    assert len(set(messages.STATE_CODES.values())) == len(State)
    assert messages.ERROR_CODES[Error.LSTriggered] == AxisState.LS_TRIGGERED
    assert messages.STATE_CODES[State.SecondHSSearch] == AxisState.STATE_SECOND_HS_SEARCH


def test_the_first_failure_is_no_cancellation():
    canceled, failed = Outcome(Error.Canceled, 'y'), Outcome(Error.LSTriggered, 'x')
    assert messages.first_failure({'y': canceled, 'x': failed}) is failed
    assert messages.first_failure({'y': canceled}) is canceled
    assert messages.first_failure({'x': Outcome(Error.NoError)}) is None


def test_the_diagnostics_say_what_comes_from_each_input(axis):
    clock = SimpleNamespace(now=2.0)
    wiring = Wiring({Place(axis.name, Input.HOME_SWITCH): '/io/din3#data'})
    status = InputStatus(lambda: wiring, clock)
    for time in (1.0, 1.02, 1.04, 1.06):
        axis.switch(Input.HOME_SWITCH, time, True)
    axis.switch(Input.POSITIVE_LIMIT_SWITCH, 1.5, False)
    (found,) = messages.diagnostics(0, '/homing_node', [axis], status.of).status
    values = {one.key: one.value for one in found.values}
    assert values['home_switch'] == 'on, 0.940 s, 50 Hz, /io/din3#data'
    assert values['positive_limit_switch'] == 'off, 0.500 s, on change, -'
    assert values['negative_limit_switch'] == 'unknown, -, -, -'


def test_the_answer_to_a_dry_run():
    stop = Outcome(Error.EmergencyStop, 'axis x: the emergency stop is on')
    run = DryRun([('z',), ('x', 'y')], [('x', stop)])
    answer = messages.dry_run(run, [1.5, float('nan')], '', [AxisState(axis='x')])
    assert not answer.success
    assert answer.message == 'EmergencyStop: axis x: the emergency stop is on'
    assert answer.error_code == AxisState.EMERGENCY_STOP
    assert answer.steps == ['z', 'x, y']
    assert answer.durations[0] == 1.5
    assert answer.durations[1] != answer.durations[1]
    assert answer.missing == ['x: EmergencyStop: axis x: the emergency stop is on']
    unknown = 'how long y takes is not known'
    good = messages.dry_run(run._replace(missing=[]), [1.5, 2.0], unknown, [])
    assert (good.success, good.error_code, list(good.missing)) == (True, 0, [])
    assert good.message == f'dry run: nothing is missing; {unknown}'


def test_a_cell_says_the_same_as_its_coordinator_reads():
    stop = Outcome(Error.PrerequisiteMissing, 'axis x: cell1/z is not homed')
    closed = Outcome(Error.Canceled, 'the node is shutting down')
    run = DryRun([('x', 'y')], [('', closed), ('x', stop)])
    answer = messages.dry_run(run, [2.0], '', [AxisState(axis='x', state='Idle', homed=True)])
    read = cell_messages.checked('hall/cell2', ['hall/cell2/x', 'hall/cell2/y'], answer)
    assert read.seen['hall/cell2/x'].homed
    assert read.seen['hall/cell2/x'].idle
    assert read.missing == {
        'hall/cell2/x': (
            'Canceled: the node is shutting down',
            'PrerequisiteMissing: axis x: cell1/z is not homed',
        ),
        'hall/cell2/y': ('Canceled: the node is shutting down',),
    }
    assert read.duration == 2.0


def test_how_a_goal_of_a_cell_ended():
    state = AxisState(axis='x', home_position_raw=0.25, home_offset=0.5, uncertainty=0.1)
    good = cell_messages.outcome('cell1', Home.Result(success=True, states=[state]))
    assert (good.success, good.home_position_raw, good.home_offset) == (True, 0.25, 0.5)
    bad = Home.Result(error_code=AxisState.LS_TRIGGERED, message='LSTriggered: axis x: hit')
    assert cell_messages.outcome('cell1', bad) == Outcome(
        Error.LSTriggered, 'cell cell1: axis x: hit'
    )
    unknown = Home.Result(error_code=9999, message='from the future')
    assert cell_messages.outcome('cell1', unknown).error is Error.InternalError
    assert not cell_messages.outcome('cell1', Home.Result()).success
