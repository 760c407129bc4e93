# SPDX-License-Identifier: Apache-2.0
"""What `homing doctor` says of a running system: each rule against facts that are written down."""

from math import nan, pi

import pytest

from homing_node.check import Severity
from homing_node.diagnosis import diagnose
from homing_node.diagnosis.controller import is_known
from homing_node.diagnosis.facts import (
    Controller,
    Endpoint,
    Facts,
    Heard,
    Manager,
    Sample,
    Setpoints,
    Topic,
)
from homing_node.parameters.axis import axis_parameters
from homing_node.procedures.states import Input

NODE = '/homing_node'
CONTROLLER = '/axes_controller'
OWN = Endpoint(NODE)
DRIVER = Endpoint('/driver')

P = axis_parameters({'home_type': 'HSHS', 'travel': 0.2}, 'x')
AXES = {'x_joint': ('x', P), 'y_joint': ('y', P)}

#: A joint_trajectory_controller as Jazzy has it, set as README says.
JTC = {
    'joints': ['x_joint', 'y_joint'],
    'command_joints': [],
    'command_interfaces': ['position'],
    'state_interfaces': ['position', 'velocity'],
    'allow_partial_joints_goal': True,
    'interpolate_from_desired_state': True,
    'open_loop_control': False,
    'allow_nonzero_velocity_at_trajectory_end': False,
    'interpolation_method': 'splines',
    'speed_scaling.initial_scaling_factor': 1.0,
    'cmd_timeout': 0.0,
    'update_rate': 500,
    'use_sim_time': False,
    'constraints.goal_time': 0.0,
    'constraints.x_joint.trajectory': 0.0,
    'constraints.y_joint.trajectory': 0.0,
}
FORWARD = {
    'joints': ['x_joint', 'y_joint'],
    'interface_name': 'position',
    'update_rate': 250,
}
DOF = {
    'dof_names': ['x_joint', 'y_joint'],
    'command_interface': 'velocity',
    'reference_and_state_interfaces': ['position', 'velocity'],
    'update_rate': 250,
}


def trajectory(**changed):
    given = {name.replace('__', '.'): value for name, value in changed.items()}
    return setpoints('trajectory'), Controller(CONTROLLER, {**JTC, **given})


def position(**changed):
    return setpoints('position'), Controller(CONTROLLER, {**FORWARD, **changed})


def dof(**changed):
    return setpoints('dof'), Controller(CONTROLLER, {**DOF, **changed})


def setpoints(interface):
    return Setpoints(f'{NODE}/setpoints', interface, ('x_joint', 'y_joint'), AXES, 250.0)


def samples(positions, rate=100.0, stamp=0.0, joint='x_joint'):
    """Return feedback with given positions; ``stamp``: header stamp less the time of sending."""
    return tuple(
        Sample(
            10.0 + i / rate + 0.0003,
            10.0 + i / rate,
            10.0 + i / rate + stamp,
            {joint: position, 'y_joint': 0.0},
        )
        for i, position in enumerate(positions)
    )


STILL = samples([0.05] * 50)


def facts(behind=None, **changed):
    """Return the facts about a system with which all is well, except for what is changed."""
    where, controller = behind or trajectory()
    return Facts(
        **{
            'node': NODE,
            'setpoints': where,
            'publishers': (OWN,),
            'controllers': (controller,),
            'feedback': Topic('/joint_states', (DRIVER,), OWN),
            'samples': STILL,
            'inputs': {},
            'listened': 3.0,
            **changed,
        }
    )


def switch(*values, rate=1000.0, **topic):
    times = tuple(20.0 + i / rate for i in range(len(values)))
    return {
        ('x', Input.HOME_SWITCH): Topic(
            **{
                'name': '/io/home',
                'publishers': (DRIVER,),
                'subscription': OWN,
                'heard': Heard(times, times, values),
                **topic,
            }
        )
    }


def with_axis(**values):
    changed = axis_parameters({'home_type': 'HSHS', 'travel': 0.2, **values}, 'x')
    return trajectory()[0]._replace(axes={**AXES, 'x_joint': ('x', changed)}), trajectory()[1]


INACTIVE = Controller(CONTROLLER, JTC, 'inactive')
ALL = (Severity.error, Severity.warning, Severity.info)
error, warning, info = ALL

#: name: facts -> the one finding (severity, word), and a part of its text.
CASES = {
    # the controller
    'nobody listens': (facts(controllers=()), error, 'no-controller', 'nobody subscribes'),
    'only a tool of the command line listens': (
        facts(controllers=(Controller('/_ros2cli_12'),)),
        error,
        'no-controller',
        'nobody subscribes',
    ),
    'a listener without parameters': (
        facts(controllers=(Controller('/bridge'),)),
        info,
        'controller-unknown',
        '/bridge',
    ),
    'JTC without one of the joints': (
        facts(trajectory(joints=['x_joint'])),
        error,
        'controller-joints',
        'names y_joint',
    ),
    'JTC that does not command one of the joints': (
        facts(trajectory(command_joints=['x_joint'])),
        error,
        'controller-joints',
        'y_joint would not move',
    ),
    'JTC that refuses partial goals': (
        facts(trajectory(allow_partial_joints_goal=False)),
        error,
        'partial-joints',
        'allow_partial_joints_goal: true',
    ),
    'JTC that starts at the measured state': (
        facts(trajectory(interpolate_from_desired_state=False)),
        warning,
        'desired-state',
        'interpolate_from_desired_state: true',
    ),
    'JTC that lets points end in motion': (
        facts(trajectory(allow_nonzero_velocity_at_trajectory_end=True)),
        info,
        'nonzero-end',
        'end at rest',
    ),
    'JTC that blends': (
        facts(trajectory(allow_trajectory_replacement=True)),
        warning,
        'replacement',
        'allow_trajectory_replacement: false',
    ),
    'JTC that does not interpolate': (
        facts(trajectory(interpolation_method='none')),
        warning,
        'interpolation',
        'splines',
    ),
    'JTC with a velocity interface alone': (
        facts(trajectory(command_interfaces=['velocity'], cmd_timeout=0.5)),
        warning,
        'command-interfaces',
        'closes the position loop',
    ),
    'JTC with a velocity interface and no timeout': (
        facts(trajectory(command_interfaces=['position', 'velocity'])),
        info,
        'cmd-timeout',
        'cmd_timeout: 0.5 s',
    ),
    'JTC that ignores its timeout': (
        facts(trajectory(cmd_timeout=0.5, constraints__goal_time=1.0)),
        warning,
        'cmd-timeout',
        'cmd_timeout: 2 s',
    ),
    'JTC that plays slowly': (
        facts(trajectory(speed_scaling__initial_scaling_factor=0.5)),
        warning,
        'speed-scaling',
        '0.5',
    ),
    'JTC at a low rate': (
        facts(trajectory(update_rate=20)),
        warning,
        'controller-rate',
        'update_rate: 250 Hz',
    ),
    'JTC with a tolerance below the bound of following error': (
        facts(trajectory(constraints__x_joint__trajectory=0.0002)),
        warning,
        'path-tolerance',
        'constraints.x_joint.trajectory: 0 m',
    ),
    'JTC with a tolerance below the lag of the drive': (
        facts(trajectory(constraints__x_joint__trajectory=0.0002), lags={'x': 0.005}),
        error,
        'path-tolerance',
        '0.00025 behind',
    ),
    'forward controller in another order': (
        facts(position(joints=['y_joint', 'x_joint'])),
        error,
        'controller-joints',
        '[y_joint, x_joint], the position commands are for [x_joint, y_joint]',
    ),
    'forward controller with another length': (
        facts(position(joints=['x_joint', 'y_joint', 'z_joint'])),
        error,
        'controller-joints',
        'switches the controller off; position_joints: [x_joint, y_joint, z_joint]',
    ),
    'forward controller of velocities': (
        facts(position(interface_name='velocity')),
        error,
        'command-interfaces',
        'commands velocity',
    ),
    'forward controller at another rate': (
        facts(position(update_rate=1000)),
        warning,
        'controller-rate',
        'update_rate: 1000 Hz',
    ),
    'PID controller with a joint more': (
        facts(dof(dof_names=['x_joint', 'y_joint', 'z_joint'])),
        error,
        'controller-joints',
        'ignores a message',
    ),
    'another joint of the array without feedback': (
        facts(
            (
                setpoints('position')._replace(joints=('x_joint', 'y_joint', 'gripper')),
                Controller(CONTROLLER, {**FORWARD, 'joints': ['x_joint', 'y_joint', 'gripper']}),
            )
        ),
        error,
        'joint-missing',
        'has no joint gripper',
    ),
    'PID controller in another order': (
        facts(dof(dof_names=['y_joint', 'x_joint'])),
        error,
        'controller-joints',
        'each would go to the joint of another; position_joints: [y_joint, x_joint]',
    ),
    'PID controller with other names of the references': (
        facts(dof(reference_and_state_dof_names=['x_motor', 'y_motor'])),
        error,
        'controller-joints',
        '[x_motor, y_motor]',
    ),
    'PID controller of velocities': (
        facts(dof(reference_and_state_interfaces=['velocity'])),
        error,
        'command-interfaces',
        'takes the values for velocity',
    ),
    'PID controller at another rate': (
        facts(dof(update_rate=1000)),
        warning,
        'controller-rate',
        'update_rate: 1000 Hz',
    ),
    'another clock': (
        facts(trajectory(use_sim_time=True)),
        error,
        'sim-time',
        'use_sim_time: true',
    ),
    # its manager
    'a controller that is not active': (
        facts(controllers=(INACTIVE,)),
        error,
        'controller-inactive',
        'switch_controllers --activate axes_controller',
    ),
    'a controller that is not active, for another one is': (
        facts(
            controllers=(INACTIVE,),
            managers=(Manager('/controller_manager', {}, {'/jog': ('x_joint/position',)}),),
        ),
        error,
        'controller-inactive',
        '--activate axes_controller --deactivate jog',
    ),
    'a controller that holds nothing': (
        facts(controllers=(Controller(CONTROLLER, JTC, 'active', ('x_joint/position',)),)),
        warning,
        'controller-claims',
        'of y_joint',
    ),
    'a manager that clamps': (
        facts(managers=(Manager('/controller_manager', {'enforce_command_limits': True}, {}),)),
        warning,
        'enforce-limits',
        'enforce_command_limits: false',
    ),
    'a manager that is slower': (
        facts(managers=(Manager('/controller_manager', {'update_rate': 100}, {}),)),
        info,
        'manager-rate',
        '100 Hz',
    ),
    'a manager without its messages': (
        facts(managers=(Manager('/controller_manager', {}, None),)),
        info,
        'manager-messages',
        'controller_manager_msgs',
    ),
    # who else commands
    'a second publisher': (
        facts(publishers=(OWN, Endpoint('/rqt'))),
        error,
        'setpoint-publishers',
        '/rqt publishes',
    ),
    'two nodes of one name': (facts(twins=2), error, 'node-twice', '2 nodes'),
    # the feedback
    'no publisher of the feedback': (
        facts(feedback=Topic('/joint_states', (), OWN), samples=()),
        error,
        'no-feedback',
        'nobody publishes /joint_states',
    ),
    'silent feedback': (facts(samples=()), error, 'no-feedback', 'from /driver'),
    'another joint': (
        facts(samples=samples([0.0] * 9, joint='x_jiont')),
        error,
        'joint-missing',
        'it has x_jiont, y_joint',
    ),
    'feedback that is no number': (
        facts(samples=samples([0.0, nan, 0.0])),
        error,
        'feedback-not-finite',
        'in 1 of 3',
    ),
    'feedback that pauses': (
        facts(samples=STILL[:10] + STILL[40:]),
        error,
        'feedback-gap',
        'feedback_timeout: 0.47 s',
    ),
    'feedback that is slow': (
        facts(samples=samples([0.0] * 20, rate=10.0)),
        warning,
        'feedback-rate',
        'feedback_timeout: 0.5 s',
    ),
    'header stamps of another clock': (
        facts(samples=samples([0.0] * 9, stamp=-0.1)),
        warning,
        'feedback-clock',
        '0.1 s behind',
    ),
    'header stamps that stand still': (
        facts(samples=tuple(one._replace(stamp=5.0) for one in STILL)),
        warning,
        'feedback-stamps',
        'the same header stamp',
    ),
    'header stamps that run backwards': (
        facts(samples=(*STILL[:20], STILL[20]._replace(stamp=10.15), *STILL[21:])),
        warning,
        'feedback-order',
        '1 times',
    ),
    'feedback from two places': (
        facts(samples=samples([0.12, 0.12, 0.0, 0.12, 0.12, 0.0, 0.12, 0.12])),
        error,
        'feedback-doubled',
        'between 0 and 0.12',
    ),
    'feedback modulo a turn': (
        facts(samples=samples([6.25, 6.28, 6.28 + 0.03 - 2 * pi, 0.06])),
        error,
        'feedback-wrap',
        'wrap: 6.28319 rad',
    ),
    'an axis that moves': (
        facts(samples=samples([0.001 * i for i in range(30)])),
        warning,
        'axis-moves',
        '0.029',
    ),
    # the inputs
    'no publisher of a switch': (
        facts(inputs=switch(publishers=(), heard=Heard())),
        error,
        'no-publisher',
        'home_switch (/io/home)',
    ),
    'an expression that does not fit its messages': (
        facts(inputs=switch(expression='data[9]', problem='data is a Bool, and has no elements')),
        error,
        'expression',
        '/io/home#data[9]: data is a Bool, and has no elements',
    ),
    'a message that does not say a switch': (
        facts(inputs=switch(expression='EL1008/d_input.3', missing='no element has EL1008')),
        error,
        'value-missing',
        '/io/home#EL1008/d_input.3: no element has EL1008',
    ),
    'two publishers of a switch': (
        facts(inputs=switch(1.0, publishers=(DRIVER, Endpoint('/plc')))),
        error,
        'publishers',
        '/driver, /plc',
    ),
    'a switch of another type': (
        facts(
            inputs=switch(
                publishers=(Endpoint('/driver', 'std_msgs/msg/Int8'),),
                subscription=Endpoint(NODE, 'std_msgs/msg/Bool'),
            )
        ),
        error,
        'type',
        'publishes std_msgs/msg/Int8',
    ),
    'a best-effort publisher': (
        facts(inputs=switch(1.0, publishers=(DRIVER._replace(reliable=False),))),
        error,
        'qos',
        'subscription.reliability: best_effort',
    ),
    'a latched publisher that was not heard': (
        facts(inputs=switch(publishers=(DRIVER._replace(latched=True),))),
        warning,
        'qos-latched',
        'subscription.durability: transient_local',
    ),
    'a switch that is polled slowly': (
        facts(inputs=switch(*[0.0] * 15, rate=5.0)),
        warning,
        'switch-polled',
        'homing_velocity_slow: 0.001 m/s',
    ),
    'a switch that is polled fast': (
        facts(inputs=switch(*[0.0] * 900)),
        info,
        'switch-rate',
        '1000 Hz',
    ),
    'a timeout for a switch that is published on change': (
        facts(with_axis(switch_timeout=1.0), inputs=switch(0.0, 1.0)),
        error,
        'switch-timeout',
        'switch_timeout: 0 s',
    ),
    'a switch that pauses longer than its timeout': (
        facts(with_axis(switch_timeout=0.1), inputs=switch(*[0.0] * 15, rate=8.0)),
        error,
        'switch-timeout',
        'switch_timeout: 0.38 s',
    ),
    'a host whose clock is ahead': (
        facts(inputs=switch(1.0, heard=Heard((20.0,), (20.3,), (1.0,)))),
        warning,
        'clock',
        '0.3 s before they were sent',
    ),
}


@pytest.mark.parametrize('name', CASES)
def test_each_fault_is_found(name):
    given, severity, word, text = CASES[name]
    found = {one.check: one for one in diagnose(given)}
    assert word in found, list(found)
    assert found[word].severity is severity
    assert text in found[word].text


@pytest.mark.parametrize('name', CASES)
def test_a_fault_is_not_taken_for_others_as_well(name):
    given, _, word, _ = CASES[name]
    others = {one.check for one in diagnose(given) if one.severity is not info} - {word}
    consequences = {
        'a switch that pauses longer than its timeout': {'switch-polled'},
    }
    assert others <= consequences.get(name, set())


@pytest.mark.parametrize(
    'behind', [trajectory(), position(), dof()], ids=['jtc', 'forward', 'dof']
)
def test_nothing_is_found_where_all_is_well(behind):
    found = diagnose(facts(behind, inputs=switch(0.0, 1.0)))
    assert [one for one in found if one.severity is not info] == []


def test_a_controller_of_one_joint_needs_no_partial_goals():
    where, controller = trajectory(joints=['x_joint'], allow_partial_joints_goal=False)
    assert diagnose(facts((where._replace(axes={'x_joint': ('x', P)}), controller))) == []


def test_a_staircase_is_seen_while_the_axis_moves():
    moving = samples([0.001 * (i // 5) for i in range(50)])
    assert 'feedback-staircase' in {one.check for one in diagnose(facts(samples=moving))}


def test_noise_of_an_encoder_is_no_second_source():
    noisy = samples([0.05 + 1e-6 * (-1) ** i for i in range(50)])
    assert diagnose(facts(samples=noisy)) == []


def test_a_recorder_beside_the_controller_is_not_judged():
    recorder = Controller('/rosbag2_recorder', {'use_sim_time': False})
    assert diagnose(facts(controllers=(trajectory()[1], recorder))) == []


def test_a_controller_is_known_by_its_joints():
    assert is_known(Controller('/c', {'joints': ['x']}), 'trajectory')
    assert is_known(Controller('/c', {'joint': 'x'}), 'position')
    assert is_known(Controller('/c', {'dof_names': ['x']}), 'dof')
    assert not is_known(Controller('/c', {'joints': []}), 'trajectory')
    assert not is_known(Controller('/c', None), 'trajectory')


def test_who_publishes_beside_the_node_and_its_relays():
    from homing_node.diagnosis.listeners import others

    unnamed = '_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_'
    names = ['/homing_node', '/homed_axes', '/homed_axes', '/moveit', unnamed]
    found = [Endpoint(name) for name in names]
    beside = others('/homing_node', found, {'/homed_axes'})
    assert beside == sorted(['/homed_axes', '/moveit', unnamed])
    node, relay, *_, nobody = found
    assert others('/homing_node', [node, nobody], {'/homed_axes'}) == []  # it may be the relay
    assert others('/homing_node', [node, relay, nobody], {'/homed_axes'}) == [unnamed]
