# SPDX-License-Identifier: Apache-2.0
"""Services and parameters of the node, with a simulated plant as a process of its own."""

import time
from functools import partial
from itertools import pairwise
from statistics import median

import pytest
import ros_harness as ros
from homing_interfaces.msg import AxisState
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import DescribeParameters, GetParameterTypes, ListParameters
from std_msgs.msg import Bool
from std_srvs.srv import SetBool, Trigger
from trajectory_msgs.msg import JointTrajectory

from homing_node.client import HomingClient

#: An axis that searches for 16 s unless it is stopped.
LONG = {
    'hard_stops': [-0.005, 1.005],
    'positive_limit_switch': [1.0, 1.2],
    'home_switch': [0.9, 0.91],
    'start': 0.1,
}
OWN_SERVICES = {
    'home': 'Trigger',
    'cancel': 'Trigger',
    'continue': 'Trigger',
    'servo': 'SetBool',
}
#: No plant has the joint of `mute`; nobody publishes the home switch of `deaf`.
AXES = {
    'long': {'travel': 1.0},
    'y': {'joint': 'joint_y'},
    'deaf': {'topics': {'home_switch': '/nowhere'}},
    'mute': {},
    'two': {},
}
PLANT = {
    'long': LONG,
    'y': {'joint': 'joint_y'},
    'deaf': {},
    'mute': {'joint': 'no_axis'},
    'two': {},
}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    with ros.World(
        tmp_path_factory.mktemp('services'), ros.node_parameters(AXES), ros.plant_parameters(PLANT)
    ) as world:
        yield world


@pytest.fixture
def client(world):
    yield world.client
    world.client.rest()


@pytest.fixture
def setpoints(client):
    return client.record(JointTrajectory, 'setpoints')


def test_discovery_by_the_name_of_the_node(client):
    node = client.node
    client.until(lambda: ('homing_node', '/') in node.get_node_names_and_namespaces())

    def all_there(look, *names):
        """Return what the node has, by name, as soon as it has these: each is found by itself."""
        look = partial(look, 'homing_node', '/')
        return client.until(lambda: (found := dict(look())).keys() >= set(names) and found)

    services = all_there(
        node.get_service_names_and_types_by_node,
        '/homing_node/home',
        '/homing_node/cancel',
        *(f'/homing_node/{axis}/{name}' for axis in AXES for name in OWN_SERVICES),
    )
    for axis in AXES:
        for name, kind in OWN_SERVICES.items():
            assert services[f'/homing_node/{axis}/{name}'] == [f'std_srvs/srv/{kind}']
    assert (
        services['/homing_node/home']
        == services['/homing_node/cancel']
        == ['std_srvs/srv/Trigger']
    )
    outputs = {
        '/homing_node/setpoints': 'trajectory_msgs/msg/JointTrajectory',
        '/homing_node/y/state': 'homing_interfaces/msg/AxisState',
        '/homing_node/y/servo_on': 'std_msgs/msg/Bool',
        '/homing_node/joint_states': 'sensor_msgs/msg/JointState',
        '/diagnostics': 'diagnostic_msgs/msg/DiagnosticArray',
    }
    published = all_there(node.get_publisher_names_and_types_by_node, *outputs)
    assert {name: published[name] for name in outputs} == {n: [k] for n, k in outputs.items()}
    inputs = {
        '/joint_states': 'sensor_msgs/msg/JointState',
        '/homing_node/emergency_stop': 'std_msgs/msg/Bool',
        '/homing_node/y/home_switch': 'std_msgs/msg/Bool',
        '/nowhere': 'std_msgs/msg/Bool',
    }
    heard = all_there(node.get_subscriber_names_and_types_by_node, *inputs)
    assert {name: heard[name] for name in inputs} == {n: [k] for n, k in inputs.items()}
    assert '/homing_node/y/z_pulse' not in heard  # not in its switches


def test_busy_and_meanwhile_everything_else_answers(client, setpoints):
    states = client.record_states('long')
    future = client.start('long')
    for service in ('long/home', 'home'):
        asked = time.monotonic()
        answer = client.trigger(service)
        assert time.monotonic() - asked < 1.0
        assert not answer.success
        assert answer.message.startswith('Busy: axis long: ~/long/home is homing long'), answer
        assert 'HSSearch' in answer.message
    assert client.get('long.travel', 'update_rate') == [1.0, 250.0]
    answer = client.home('y')['y']
    assert answer.success, answer.message
    assert not future.done()
    # Its own setpoints went on, at the same velocity but where the machine held cycles up.
    own = ros.course_of(setpoints, 'long')[-101:]
    sent = [one.sent for one in setpoints[-200:]]
    held_up = max(b - a for a, b in pairwise(sent)) > 20_000_000  # the horizon
    assert held_up or all(one.velocity == pytest.approx(0.05) for one in own)
    assert median(one.velocity for one in own) == pytest.approx(0.05)
    ros.assert_within_limits(own, 0.05, 0.5, 20.0)

    assert client.trigger('y/cancel').message == 'nothing to cancel'
    assert not future.done()
    answer = client.trigger('long/cancel')
    assert answer.success
    assert 'long' in answer.message
    client.until(lambda: states[-1].message.state == 'Idle', 0.5)
    ros.assert_stopped(client, setpoints, 'long', 0.5)
    assert not client.answer(future).success
    assert client.answer(future).message.startswith('Canceled: axis long: ')
    assert ros.course(states)[-3:] == ['HSSearch', 'Cancel', 'Idle']
    last = states[-1].message
    assert (last.error, last.homed, last.paused) == ('Canceled', False, False)
    assert last.message.startswith('axis long: ')


def test_cancel_answers_at_rest(client, setpoints):
    client.start('long')
    ros.at_speed(client, setpoints, 'long')
    canceled = client.send(Trigger, 'long/cancel')
    again = client.send(Trigger, 'cancel')
    client.until(lambda: canceled.done() and again.done())
    assert canceled.result().success
    assert again.result().success
    client.pump()
    assert ros.course_of(setpoints, 'long')[-1].velocity == 0.0
    ros.assert_stopped(client, setpoints, 'long', 0.5)


def test_nothing_to_cancel(client):
    for service in ('cancel', 'long/cancel', 'y/cancel', 'mute/cancel'):
        answer = client.trigger(service)
        assert answer.success
        assert answer.message == 'nothing to cancel'


def test_inputs_that_were_never_heard(client, setpoints):
    client.home('y')  # the plant is there
    setpoints.clear()
    answer = client.trigger('mute/home')
    assert not answer.success
    assert answer.message.startswith('FeedbackStale: axis mute: '), answer.message
    assert "'mute'" in answer.message
    answer = client.trigger('deaf/home')
    assert not answer.success
    assert answer.message.startswith('SwitchUnknown: axis deaf: '), answer.message
    assert 'home_switch (/nowhere)' in answer.message
    assert 'limit_switch' not in answer.message
    client.pass_time(0.1)
    assert not setpoints


def test_two_publishers_of_a_switch(client, setpoints):
    topic = client.name('two/home_switch')
    publisher = client.node.create_publisher(Bool, topic, 1)
    client.until(lambda: publisher.get_subscription_count() > 0)
    client.until(lambda: client.trigger('two/home').message.startswith('PublisherConflict'))
    answer = client.trigger('two/home')
    assert not answer.success
    assert answer.message.startswith('PublisherConflict: axis two: ')
    for part in (topic, '/client', '/simulated_axes'):
        assert part in answer.message, answer.message
    assert not setpoints
    client.node.destroy_publisher(publisher)
    client.until(lambda: not client.trigger('two/home').message.startswith('PublisherConflict'))


def test_servo(client, setpoints):
    wanted = client.record(Bool, 'long/servo_on', ros.LATCHED)
    states = client.record_states('long')
    client.until(lambda: wanted and wanted[-1].message.data is True)
    future = client.start('long')
    ros.at_speed(client, setpoints, 'long')
    assert client.servo('long', False).success
    answer = client.answer(future)
    assert answer.message.startswith('ServoOff: axis long: '), answer.message
    client.until(lambda: wanted[-1].message.data is False)
    count = len(setpoints)
    client.pass_time(0.1)
    assert len(setpoints) == count
    assert ros.course_of(setpoints, 'long')[-1].velocity > 0.04  # no ramp: at once

    answer = client.trigger('long/home')
    assert answer.message.startswith('ServoOff: axis long: '), answer.message
    assert not answer.success
    assert client.servo('long', True).success
    client.until(lambda: wanted[-1].message.data is True)
    client.until(lambda: states[-1].message.state == 'Idle')
    assert len(setpoints) == count
    setpoints.clear()
    client.start('long')
    client.until(lambda: len(ros.course_of(setpoints, 'long')) > 10)
    client.trigger('long/cancel')
    ros.assert_stopped(client, setpoints, 'long', 0.5)


def test_servo_off_and_on_within_a_cycle(client):
    """The drive hears of it all the same: one that stopped by itself waits for it."""
    wanted = client.record(Bool, 'long/servo_on', ros.LATCHED)
    client.until(lambda: wanted)
    for _ in range(5):
        before = len(wanted)
        answers = [client.send(SetBool, 'long/servo', data=on) for on in (False, True)]
        for answer in answers:
            client.answer(answer)
        client.until(lambda n=before: len(wanted) > n and wanted[-1].message.data is True)


@pytest.fixture
def emergency_stop(client):
    publisher = client.node.create_publisher(Bool, client.name('emergency_stop'), ros.LATCHED)
    client.until(lambda: publisher.get_subscription_count() > 0)
    yield publisher
    publisher.publish(Bool(data=False))
    client.until(lambda: not client.trigger('deaf/home').message.startswith('EmergencyStop'))
    client.node.destroy_publisher(publisher)


def test_emergency_stop(client, setpoints, emergency_stop):
    """It stops with ls_dec; what it refuses then, its release does not start."""
    states = client.record_states('long')
    future = client.start('long')
    ros.at_speed(client, setpoints, 'long')
    emergency_stop.publish(Bool(data=True))
    answer = client.answer(future, 2.0)
    assert not answer.success
    assert answer.message.startswith('EmergencyStop: axis long: '), answer.message
    client.until(lambda: states[-1].message.state == 'Idle')
    ros.assert_stopped(client, setpoints, 'long', 1.0)
    samples = ros.course_of(setpoints, 'long')
    assert min(s.acceleration for s in samples) < -0.6  # of ls_dec, not of the profile: 0.5
    assert states[-1].message.error == 'EmergencyStop'
    assert ros.course(states)[-2:] == ['HSSearch', 'Idle']

    count = len(setpoints)
    for service in ('long/home', 'y/home'):
        assert client.trigger(service).message.startswith('EmergencyStop: axis ')
    emergency_stop.publish(Bool(data=False))
    client.until(lambda: not client.trigger('deaf/home').message.startswith('EmergencyStop'))
    client.pass_time(0.1)
    assert len(setpoints) == count
    assert client.home('y')['y'].success


def test_pause_and_continue(client, setpoints):
    states = client.record_states('y')
    answer = client.trigger('y/continue')
    assert not answer.success
    assert answer.message == 'axis y is not paused'
    assert client.set(y__pause_mode=True).successful
    client.until(lambda: states)
    future = client.send(Trigger, 'y/home')
    pauses = 0
    while not future.done():
        client.until(lambda: future.done() or states[-1].message.paused)
        if not future.done():
            pauses += 1
            client.until(lambda: ros.course_of(setpoints, 'joint_y')[-1].velocity == 0.0)
            assert client.trigger('y/continue').success
            client.until(lambda: not states[-1].message.paused)
    assert future.result().success, future.result().message
    assert pauses >= 2  # HSHS: away from the switch, and toward it again
    assert client.set(y__pause_mode=False).successful


# ------------------------------------------------------------------------------ parameters


def test_parameters_are_listed(client):
    names = set(client.ask(ListParameters, 'list_parameters', depth=0).result.names)
    assert {
        'axes',
        'update_rate',
        'cycle_timeout',
        'setpoint_interface',
        'home_sequence',
        'y.joint',
        'y.home_type',
        'y.travel',
        'y.homing_velocity_fast',
        'y.switches',
        'y.topics.home_switch',
        'long.travel',
    } <= names


def test_parameters_are_read(client):
    assert client.get(
        'axes',
        'y.joint',
        'y.home_type',
        'y.homing_velocity_slow',
        'y.switches',
        'y.invert_hs_polarity',
        'deaf.topics.home_switch',
        'setpoint_interface',
    ) == [
        list(AXES),
        'joint_y',
        'HSHS',
        0.005,
        ['home_switch', 'positive_limit_switch', 'negative_limit_switch'],
        False,
        '/nowhere',
        'trajectory',
    ]


def test_parameters_are_described(client):
    names = ['y.homing_velocity_fast', 'y.home_type', 'axes', 'y.multiple_z_pulse', 'y.ls_dec']
    velocity, kind, axes, pulses, _ = client.ask(
        DescribeParameters, 'describe_parameters', names=names
    ).descriptors
    assert velocity.name == 'y.homing_velocity_fast'
    assert velocity.type == ParameterType.PARAMETER_DOUBLE
    assert 'velocity of switch searches' in velocity.description
    assert '[m/s]' in velocity.description
    assert velocity.floating_point_range[0].from_value == 1e-7
    assert '>= 1e-07 and <= 10000 m/s' in velocity.additional_constraints
    assert 'HSReverseZPulse' in kind.additional_constraints
    assert axes.read_only
    assert pulses.integer_range[0].from_value == 0
    names.append('home_sequence')  # empty here
    types = client.ask(GetParameterTypes, 'get_parameter_types', names=names).types
    assert list(types) == [
        ParameterType.PARAMETER_DOUBLE,
        ParameterType.PARAMETER_STRING,
        ParameterType.PARAMETER_STRING_ARRAY,
        ParameterType.PARAMETER_INTEGER,
        ParameterType.PARAMETER_DOUBLE,
        ParameterType.PARAMETER_STRING_ARRAY,
    ]


def test_an_integer_is_a_real_number(client):
    result = client.set(y__max_jerk=21)
    assert result.successful, result.reason
    assert client.get('y.max_jerk')[0] == 21
    assert client.set(y__max_jerk=20.0).successful


@pytest.mark.parametrize(
    ('name', 'value', 'parts'),
    [
        ('y__homing_velocity_fast', -0.1, ('y.homing_velocity_fast', '-0.1', '>= 1e-07', 'm/s')),
        ('y__homing_velocity_fast', 0.0, ('y.homing_velocity_fast', '0.0', '>= 1e-07', 'm/s')),
        ('y__homing_velocity_fast', float('nan'), ('y.homing_velocity_fast', 'nan')),
        ('y__travel', float('inf'), ('y.travel', 'inf')),
        (
            'y__homing_reverse_distance',
            -1,
            ('y.homing_reverse_distance', '-1', '>= 1e-09', ' m'),
        ),
        ('y__z_pulse_distance_tolerance', 1.5, ('y.z_pulse_distance_tolerance', '1.5', '<= 1')),
        ('y__home_type', 'HSHSHS', ('y.home_type', 'HSHSHS', "did you mean 'HSHS'")),
        ('y__switches', ['home_swich'], ('y.switches', 'home_swich', "'home_switch'")),
        ('y__invert_hs_polarity', 'yes', ('y.invert_hs_polarity', 'yes', 'true or false')),
        ('y__max_jerk', 1e-300, ('y.max_jerk', '1e-300', '>= 0.001', 'm/s^3')),
        ('y__max_jerk', 1e300, ('y.max_jerk', '1e+300', '<= 1e+09', 'm/s^3')),
        ('y__travel', 'long', ('y.travel', 'long', 'a number', 'm')),
        ('y__joint', 5, ('y.joint', '5', 'a string')),
        ('y__multiple_z_pulse', 1.5, ('y.multiple_z_pulse', '1.5', 'an integer')),
        ('cycle_timeout', 0.0, ('cycle_timeout', '0.0', '>= 0.001', 's')),
        ('home_sequence', ['y, q'], ('home_sequence', "'q'")),
        ('home_sequence', ['y', 'y'], ('home_sequence', "'y'", 'twice')),
        ('home_sequence', 5.0, ('home_sequence', '5.0', 'list of strings')),
        ('home_sequence', True, ('home_sequence', 'True', 'list of strings')),
        ('home_sequence', None, ('home_sequence', 'deleted')),
        ('cycle_timeout', None, ('cycle_timeout', 'deleted')),
        ('y__travel', None, ('y.travel', 'deleted')),
        ('y__topics__home_switch', None, ('y.topics.home_switch', 'deleted')),
        ('use_sim_time', None, ('use_sim_time', 'deleted')),
        ('y__topics__home_switch', '/a b', ('y.topics.home_switch', "'/a b'")),
        ('y__topics__home_switch', 'a/', ('y.topics.home_switch', "'a/'")),
        ('y__joint', 'z', ('y.joint', 'read-only')),
        ('axes', ['q'], ('axes', 'read-only')),
        ('update_rate', 100.0, ('update_rate', 'read-only')),
        ('use_sim_time', True, ('use_sim_time', 'read-only')),
        ('y__homing_velocity_fst', 0.1, ('y.homing_velocity_fst',)),
        ('q__travel', 0.1, ('q.travel',)),
    ],
)
def test_a_bad_value_is_refused(client, name, value, parts):
    result = client.set(**{name: value})
    assert not result.successful
    for part in parts:
        assert part in result.reason, result.reason


def test_a_refused_value_changes_nothing(client):
    assert not client.set(y__homing_velocity_fast=-1.0).successful
    assert client.get('y.homing_velocity_fast') == [0.05]


def test_each_value_of_one_call_is_answered(client):
    good, bad = client.set(y__ls_dec=2.0, y__travel=-1.0)
    assert good.successful
    assert not bad.successful
    assert client.get('y.ls_dec', 'y.travel') == [2.0, 0.08]
    assert client.set(y__ls_dec=1.0).successful


@pytest.mark.parametrize('velocity', [1.0, 4.0])
def test_a_value_that_the_check_calls_an_error_is_refused_when_it_is_set(client, velocity):
    """Case 5: at this velocity the axis cannot stop before its end."""
    result = client.set(y__homing_velocity_fast=velocity)
    assert not result.successful
    for part in ('axis y', f'{velocity:g} m/s', 'travel', 'm/s'):
        assert part in result.reason, result.reason
    assert client.get('y.homing_velocity_fast') == [0.05]


def test_values_that_contradict_each_other(client, setpoints):
    """Together they are refused; one after the other they are judged when a run starts."""
    result = client.set(
        atomically=True, y__homing_velocity_fast=0.01, y__homing_velocity_slow=0.02
    )
    assert not result.successful
    for part in ('y.homing_velocity_slow', '0.02 m/s', 'homing_velocity_fast', '0.01 m/s'):
        assert part in result.reason, result.reason
    assert client.get('y.homing_velocity_fast', 'y.homing_velocity_slow') == [0.05, 0.005]

    assert client.set(y__homing_velocity_slow=0.1).successful
    answer = client.trigger('y/home')
    assert not answer.success
    assert answer.message.startswith('InvalidParameter: '), answer.message
    assert 'y.homing_velocity_slow: 0.1 m/s' in answer.message, answer.message
    assert not setpoints
    result = client.set(atomically=True, y__homing_velocity_fast=0.2, y__homing_velocity_slow=0.1)
    assert result.successful, result.reason
    result = client.set(
        atomically=True, y__homing_velocity_fast=0.05, y__homing_velocity_slow=0.005
    )
    assert result.successful, result.reason
    assert client.home('y')['y'].success


def test_a_parameter_takes_effect_at_the_next_run(client, setpoints):
    client.start('long')
    ros.at_speed(client, setpoints, 'long')
    result = client.set(long__homing_velocity_fast=0.02)
    assert not result.successful
    for part in ('long.homing_velocity_fast', 'axis long: ~/long/home is homing', 'HSSearch'):
        assert part in result.reason, result.reason
    assert client.set(y__homing_velocity_fast=0.04).successful  # the other axis is idle
    assert client.set(y__homing_velocity_fast=0.05).successful
    assert client.get('long.homing_velocity_fast') == [0.05]
    client.trigger('long/cancel')
    ros.assert_stopped(client, setpoints, 'long', 0.5)

    assert client.set(long__homing_velocity_fast=0.02).successful
    setpoints.clear()
    client.start('long')
    client.until(lambda: len(setpoints) > 60)
    client.trigger('long/cancel')
    ros.assert_stopped(client, setpoints, 'long', 0.5, velocity=0.02)
    assert max(s.velocity for s in ros.course_of(setpoints, 'long')) == pytest.approx(0.02)
    assert client.set(long__homing_velocity_fast=0.05).successful


def test_the_topic_of_an_input_can_be_set(client):
    assert client.set(deaf__topics__home_switch='').successful
    assert client.home('deaf')['deaf'].success


@pytest.mark.parametrize('topic', ['/joint_states', '/homing_node/setpoints', 'l' * 300])
def test_a_topic_that_cannot_be_subscribed_to(client, setpoints, topic):
    """Its axis homes no more; the others go on."""
    client.start('long')
    ros.at_speed(client, setpoints, 'long')
    assert client.set(two__topics__home_switch=topic).successful
    answer = client.trigger('two/home')
    assert answer.message.startswith('InvalidParameter: two.topics.home_switch: cannot '), answer
    assert client.set(two__topics__home_switch='').successful
    setpoints.clear()
    ros.at_speed(client, setpoints, 'long')
    client.trigger('long/cancel')
    ros.assert_stopped(client, setpoints, 'long', 0.5)
    assert client.home('two')['two'].success


def test_a_script_reads_the_newest_state(client, world, monkeypatch):
    """Not the first of those that the node published before."""
    assert client.home('two')['two'].success
    monkeypatch.setenv('ROS_DOMAIN_ID', str(world.domain.number))
    with HomingClient() as homing:
        assert homing.state('two').homed


@pytest.mark.long
@pytest.mark.parametrize('ask', ['home', 'call_home'])
def test_a_script_that_has_homed_an_axis_sees_it_homed(world, monkeypatch, ask):
    """The last state of a run leaves before its answer."""
    monkeypatch.setenv('ROS_DOMAIN_ID', str(world.domain.number))
    with HomingClient() as homing:
        for _ in range(5):
            homing.state('two')
            assert getattr(homing, ask)('two')
            assert homing.state('two').homed


def test_who_comes_late_gets_the_last_state(client, world):
    """`ros2 topic echo --once` prints the first message that comes."""
    assert client.home('two')['two'].success
    late = client.record(AxisState, 'two/state', ros.LATCHED)
    client.until(lambda: late)
    assert (late[0].message.state, late[0].message.homed) == ('Idle', True)
    assert (late[0].message.error_code, late[0].message.state_code) == (0, AxisState.STATE_IDLE)
    client.forget(late)
