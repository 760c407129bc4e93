# SPDX-License-Identifier: Apache-2.0
"""What the node does when inputs fail, with a plant whose every message the test controls."""

import math
import signal
import time
from itertools import pairwise

import pytest
import ros_harness as ros
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

PERIODIC = {'switch_timeout': 0.3}
DRIVE = {
    'switches': ['home_switch', 'positive_limit_switch', 'negative_limit_switch', 'servo_enabled']
}
AXES = {
    'x': {'home_type': 'HS'},
    'lost': {'feedback_timeout': 0.3, 'following_error': 0.04},
    'timed': PERIODIC,
    'drive': DRIVE,
    'probe': {'home_type': 'TouchProbe', 'switches': ['touch_probe']},
}
AXES = {name: {'travel': 1.0, **values} for name, values in AXES.items()}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    with ros.World(tmp_path_factory.mktemp('loss'), ros.node_parameters(AXES)) as world:
        world.hand = ros.HandPlant(world.client, **dict.fromkeys(AXES, 0.0))
        for axis in ('x', 'lost', 'timed', 'drive'):
            world.hand.set_levels(axis)
        world.hand.until_heard('drive/servo_enabled', True)
        yield world
        world.hand.close()


@pytest.fixture
def client(world):
    yield world.client
    world.hand.silent = False
    world.client.rest()


@pytest.fixture
def hand(world):
    return world.hand


@pytest.fixture
def setpoints(client):
    return client.record(JointTrajectory, 'setpoints')


def test_feedback_is_lost(client, hand, setpoints):
    states = client.record_states('lost')
    future = client.start('lost')
    ros.at_speed(client, setpoints, 'lost')
    lost = time.time_ns()
    hand.silent = True
    answer = client.answer(future, 3.0)
    assert not answer.success
    # 50 mm/s for 0.3 s is less than the following error.
    assert answer.message.startswith('FeedbackStale: axis lost: '), answer.message
    assert '0.3 s' in answer.message
    assert 'feedback_timeout' in answer.message
    client.until(lambda: states[-1].message.state == 'Idle')
    assert states[-1].message.error == 'FeedbackStale'
    assert not states[-1].message.homed
    # Nothing is told any more; what was told last ends at rest.
    last = [heard for heard in setpoints if 'lost' in heard.message.joint_names][-1]
    assert 0.25 < (last.sent - lost) * 1e-9 < 0.5
    assert set(last.message.points[-1].velocities) == {0.0}

    answer = client.trigger('lost/home')
    assert answer.message.startswith('FeedbackStale: axis lost: '), answer.message
    hand.silent = False
    client.pass_time(0.1)
    assert setpoints[-1] is last
    setpoints.clear()
    client.start('lost')  # nothing else is wrong with it
    client.trigger('lost/cancel')


def test_a_switch_loses_its_publisher(client, hand, setpoints):
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    hand.drop('x/home_switch')
    answer = client.answer(future, 3.0)
    assert not answer.success
    assert answer.message.startswith('SwitchStale: axis x: '), answer.message
    assert client.name('x/home_switch') in answer.message
    ros.assert_stopped(client, setpoints, 'x')
    hand.set('x/home_switch', False)
    setpoints.clear()
    client.start('x')
    client.trigger('x/cancel')


def test_a_driver_that_came_back_has_to_tell_the_levels(client, hand, setpoints):
    """What it said before it was restarted may not be so any more."""
    topic = 'x/home_switch'
    client.start('x')
    client.trigger('x/cancel')
    hand.drop(topic)
    client.until(
        lambda: (
            client.trigger('x/home').message
            == (f'SwitchUnknown: axis x: nobody publishes home_switch ({client.name(topic)})')
        )
    )
    client.pass_time(0.2)
    count = len(setpoints)  # of a run that began before the node knew
    silent = hand.announce(topic)
    client.until(lambda: silent.get_subscription_count() > 0)
    client.until(
        lambda: (
            client.trigger('x/home').message
            == (f'SwitchUnknown: axis x: no message yet from home_switch ({client.name(topic)})')
        )
    )
    client.pass_time(0.1)
    assert len(setpoints) == count
    hand.set(topic, False)
    client.start('x')
    client.trigger('x/cancel')


def test_to_set_a_parameter_misses_no_message(client, hand, setpoints):
    states = client.record_states('x')
    for level in (True, False):
        assert client.set(x__ls_dec=1.0).successful
        hand.set('x/home_switch', level)
        client.pass_time(0.05)
        client.start('x')
        client.until(lambda: states[-1].message.state != 'Idle')
        expected = 'HSClearReverse' if level else 'HSSearch'
        assert states[-1].message.state == expected
        client.trigger('x/cancel')


def test_a_periodic_switch_falls_silent(client, hand, setpoints):
    """It is refused while it is old, and it ends a run."""
    names = ('home_switch', 'positive_limit_switch', 'negative_limit_switch')

    def say():
        for name in names:
            hand.set(f'timed/{name}', False)

    client.until(lambda: client.trigger('timed/home').message.startswith('SwitchStale: '))
    assert not setpoints
    say()
    future = client.send(Trigger, 'timed/home')
    said = 0.0

    def at_speed_while_saying():
        nonlocal future, said
        if time.monotonic() > said + 0.05:
            said = time.monotonic()
            say()
        if future.done():  # the request has overtaken the levels
            assert future.result().message.startswith('SwitchStale: '), future.result()
            future = client.send(Trigger, 'timed/home')
        samples = ros.course_of(setpoints, 'timed')
        return samples and samples[-1].velocity > 0.0499 and len(samples) > 120

    client.until(at_speed_while_saying)  # longer than the timeout: it is alive
    assert not future.done()
    answer = client.answer(future, 3.0)
    assert answer.message.startswith('SwitchStale: axis timed: '), answer.message
    assert 'switch_timeout' in answer.message
    assert '0.3 s' in answer.message
    ros.assert_stopped(client, setpoints, 'timed')


def test_the_drive_switches_its_servo_off(client, hand, setpoints):
    future = client.start('drive')
    ros.at_speed(client, setpoints, 'drive')
    hand.set('drive/servo_enabled', False)
    answer = client.answer(future, 3.0)
    assert answer.message.startswith('ServoOff: axis drive: '), answer.message
    count = len(setpoints)
    client.pass_time(0.1)
    assert len(setpoints) == count
    assert ros.course_of(setpoints, 'drive')[-1].velocity > 0.04
    assert client.trigger('drive/home').message.startswith('ServoOff: axis drive: ')
    hand.set('drive/servo_enabled', True)
    client.pass_time(0.1)
    assert len(setpoints) == count
    setpoints.clear()
    client.start('drive')
    client.trigger('drive/cancel')


def test_the_edge_is_where_the_feedback_was_at_its_time(client, hand, setpoints):
    """The message is stamped by the middleware; the feedback by its header."""
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    sent = time.time_ns()
    hand.set('x/home_switch', True)
    answer = client.answer(future)
    assert answer.success, answer.message
    raw = float(answer.message.split('home_position_raw=')[1].split()[0])
    before = [s for s in ros.course_of(setpoints, 'x') if s.sent <= sent]
    # Feedback: the last setpoint, every 4 ms and by then up to 8 ms old.
    assert raw == pytest.approx(before[-1].position, abs=0.05 * 0.016)
    hand.set('x/home_switch', False)


def test_a_latch_that_nobody_publishes(client, hand, setpoints):
    answer = client.trigger('probe/home')
    assert not answer.success
    assert answer.message.startswith('SwitchUnknown: axis probe: '), answer.message
    assert client.name('probe/touch_probe') in answer.message
    assert not setpoints


def test_a_latched_position_is_exact(client, hand, setpoints):
    hand.set('probe/touch_probe', -5.0)  # an old one: before the search began
    future = client.start('probe')
    client.until(lambda: len(ros.course_of(setpoints, 'probe')) > 50)
    position = hand.positions['probe'] - 1e-5
    hand.set('probe/touch_probe', position)
    answer = client.answer(future)
    assert answer.success, answer.message
    raw = float(answer.message.split('home_position_raw=')[1].split()[0])
    assert raw == pytest.approx(position, abs=1e-9)
    # No better than what the axis travels between two feedbacks.
    assert float(answer.message.partition('uncertainty=')[2].split()[0]) < 1e-4


def test_nonsense_in_the_feedback_is_ignored(client, hand, setpoints):
    """NaN, names without positions and other joints do no harm."""
    publisher = client.node.create_publisher(JointState, '/joint_states', 10)
    client.until(lambda: publisher.get_subscription_count() > 0)
    future = client.start('x')
    for message in (
        JointState(name=['x'], position=[math.nan]),
        JointState(name=['x', 'timed'], position=[]),
        JointState(name=['other'], position=[1.0]),
        JointState(name=['x'], position=[math.inf]),
    ):
        publisher.publish(message)
    ros.at_speed(client, setpoints, 'x')
    assert not future.done()
    client.trigger('x/cancel')
    ros.assert_within_limits(ros.course_of(setpoints, 'x'), 0.05, 0.5, 20.0)
    client.node.destroy_publisher(publisher)


def test_a_short_hold_up_delays_the_motion(client, world, setpoints):
    """What was missed is not made up for: the steps stay as long as they are."""
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    world.node.signal(signal.SIGSTOP)
    stopped = time.monotonic()
    client.until(lambda: time.monotonic() > stopped + 0.1)
    world.node.signal(signal.SIGCONT)
    count = len(setpoints)
    client.until(lambda: len(setpoints) > count + 50)
    assert not future.done()
    client.trigger('x/cancel')
    samples = ros.course_of(setpoints, 'x')
    ros.assert_within_limits(samples, 0.05, 0.5, 20.0)
    pause, after = max((b.sent - a.sent, b.sent) for a, b in pairwise(samples))
    assert pause > 0.09e9
    assert sum(after <= s.sent < after + 0.08e9 for s in samples) < 28  # 20, not 45


def test_a_long_hold_up_ends_the_run(client, world, setpoints):
    future = client.start('x')
    ros.at_speed(client, setpoints, 'x')
    world.node.signal(signal.SIGSTOP)
    stopped = time.monotonic()
    client.until(lambda: time.monotonic() > stopped + 1.2)
    world.node.signal(signal.SIGCONT)
    answer = client.answer(future, 3.0)
    assert answer.message.startswith('CycleLate: axis x: '), answer.message
    assert 'cycle_timeout' in answer.message
    ros.assert_stopped(client, setpoints, 'x')
