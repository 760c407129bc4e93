# SPDX-License-Identifier: Apache-2.0
"""A node that is held up or killed in the middle of a search: what the drive gets of it.

The messages of the real node go to the model of joint_trajectory_controller, each DELAY after its
stamp: on a busy machine this process and the simulated axes are held up, too. The model's commands
are judged, and the simulated axes must end where the model does.
"""

import random
import signal
import time
from itertools import pairwise

import pytest
import ros_harness as ros
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory

from homing_node.plant.controller import NS, Message, Point, TrajectoryController

JERK, RATE = 20.0, 500
#: Velocity and deceleration of each axis.
PACES = {'slow': (0.05, 0.5), 'fast': (0.5, 2.0)}
#: How far the present message may be old when the controller needs the next one, s.
PERIOD, HORIZON = 0.004, 0.02
#: How long a message takes to the model of the controller, ns.
DELAY = 2_000_000


def long_axis(speed, acceleration):
    return {
        'home_type': 'HS',
        'travel': 20.0,
        'homing_velocity_fast': speed,
        'homing_velocity_fast_acc': acceleration,
        'homing_velocity_fast_dec': acceleration,
        'max_jerk': JERK,
        'following_error': 0.5,
        'feedback_timeout': 5.0,
    }


LAYOUT = {
    'hard_stops': [-1.0, 21.0],
    'negative_limit_switch': [-2.0, -0.5],
    'positive_limit_switch': [20.5, 22.0],
    'home_switch': [20.0, 20.1],
}


@pytest.fixture(scope='module')
def world(tmp_path_factory):
    with ros.World(
        tmp_path_factory.mktemp('held_up'),
        ros.node_parameters(
            {name: long_axis(*pace) for name, pace in PACES.items()},
            cycle_timeout=5.0,
            ready_timeout=10.0,
        ),
        ros.plant_parameters(dict.fromkeys(PACES, LAYOUT)),
    ) as world:
        yield world


@pytest.fixture
def setpoints(world):
    """Return the setpoints from now on; afterwards all is at rest."""
    yield world.client.record(JointTrajectory, 'setpoints')
    if world.node.alive:
        world.client.rest()


def message_of(heard):
    stamp = heard.message.header.stamp
    return Message(
        stamp.sec * NS + stamp.nanosec,
        tuple(heard.message.joint_names),
        tuple(
            Point(
                p.time_from_start.sec * NS + p.time_from_start.nanosec,
                tuple(p.positions),
                tuple(p.velocities),
                tuple(p.accelerations),
            )
            for p in heard.message.points
        ),
    )


def played(setpoints, joint, lost=0.0):
    """Return the commands of the model of the controller, until it rests: times and positions.

    ``lost``: which part of the messages is lost: where a busy machine missed a cycle, too, none,
    nor the last one before the pause: the node goes on from where that one leads to.
    Times count from the arrival of the last one, s.
    """
    chance = random.Random(1)
    messages = [message_of(heard) for heard in setpoints]
    gaps = [b.stamp - a.stamp for a, b in pairwise(messages)]
    missed = {gap for gap in gaps if gap > 1.5 * PERIOD * NS} - {max(gaps)}
    last = gaps.index(max(gaps))

    def is_lost(number):
        near = gaps[max(0, number - 2) : number + 2]
        return chance.random() < lost and number != last and missed.isdisjoint(near)

    told = [(one.stamp + DELAY, one) for n, one in enumerate(messages) if not is_lost(n)]
    start = {}
    for _, message in told:
        for name, position in zip(message.joints, message.points[0].positions, strict=True):
            start.setdefault(name, position)
    controller = TrajectoryController(list(start), RATE)
    controller.activate(list(start.values()))
    place = list(start).index(joint)
    now, end = told[0][0] - NS // RATE, told[-1][0]
    waiting, commands = list(reversed(told)), []
    while now < end + 2 * NS:
        while waiting and waiting[-1][0] <= now:
            assert controller.receive(waiting.pop()[1], now), controller.refused
        command = controller.update(now, [0.0] * len(start))
        assert command is not None
        commands.append(((now - end) / NS, command.positions[place]))
        now += NS // RATE
    return commands


def rates_of_change(values):
    return [(b - a) * RATE for a, b in pairwise(values)]


def assert_no_step(commands, speed, acceleration, off=0.1):
    """Check that the drive gets no step of its position or velocity, and nothing backwards.

    On a busy machine cycles are missed, and the velocity may be ``off`` by a part for an update.
    """
    velocities = rates_of_change([position for _, position in commands])
    assert min(velocities) > -off * speed
    assert max(velocities) <= (1.0 + off) * speed
    steps = [abs(b - a) for a, b in pairwise(velocities)]
    assert max(steps) <= 1.05 * acceleration / RATE + off * speed
    assert velocities[-1] == 0.0


def at_rest(feedback, samples=60):
    last = [heard.message.position for heard in feedback[-samples:]]
    columns = zip(*last, strict=True)
    return len(last) == samples and all(max(one) - min(one) < 1e-7 for one in columns)


@pytest.mark.parametrize('stall', [0.015, 0.1, pytest.param(1.0, marks=pytest.mark.long)])
def test_a_node_that_is_held_up_makes_no_step(world, setpoints, stall):
    """Not at once, not when it goes on, and not where every tenth message is lost as well."""
    client, (speed, acceleration) = world.client, PACES['fast']
    feedback = client.record(JointState, '/joint_states')
    client.start('fast')
    ros.at_speed(client, setpoints, 'fast', 0.999 * speed)
    world.node.signal(signal.SIGSTOP)
    time.sleep(stall)
    world.node.signal(signal.SIGCONT)
    count = len(setpoints)
    client.until(
        lambda: (
            len(setpoints) > count + 50
            and ros.course_of(setpoints, 'fast')[-1].velocity > 0.999 * speed
        )
    )
    client.trigger('fast/cancel')
    client.until(lambda: at_rest(feedback))
    assert max(b.sent - a.sent for a, b in pairwise(setpoints)) > 0.9e9 * stall
    for lost, off in ((0.1, 0.25), (0.0, 0.1)):
        commands = played(setpoints, 'fast', lost)
        assert_no_step(commands, speed, acceleration, off)
    resting = [a == b for (_, a), (time, b) in pairwise(commands) if time < -0.5]
    assert any(resting[20:]) == (stall > 0.5)  # it had come to rest by itself
    place = list(feedback[-1].message.name).index('fast')
    _, rest = played(setpoints, 'fast')[-1]
    assert feedback[-1].message.position[place] == pytest.approx(rest, abs=1e-5)


def test_a_servo_that_comes_back_finds_its_command_where_the_axis_is(world, setpoints):
    """The stop that was announced would have ended 0.1 m further: a jump."""
    client = world.client
    feedback = client.record(JointState, '/joint_states')
    client.start('fast')
    ros.at_speed(client, setpoints, 'fast', 0.499)
    assert client.servo('fast', False).success
    client.until(lambda: at_rest(feedback))
    place = list(feedback[-1].message.name).index('fast')
    rest = feedback[-1].message.position[place]
    *_, (_, command) = played(setpoints, 'fast')
    assert command == pytest.approx(rest, abs=0.03)  # the brake acts a little later
    assert client.servo('fast', True).success
    client.pass_time(0.1)
    assert feedback[-1].message.position[place] == pytest.approx(rest, abs=0.03)


def test_a_node_that_is_killed_leaves_the_axes_at_rest(world, setpoints):
    """At 50 and at 500 mm/s: within the horizon, v^2 / 2a and the part of the jerk."""
    client = world.client
    feedback = client.record(JointState, '/joint_states')
    for name in PACES:
        client.send(Trigger, f'{name}/home')
    for name, (speed, _) in PACES.items():
        ros.at_speed(client, setpoints, name, 0.999 * speed)
    client.watch()
    world.node.signal(signal.SIGKILL)
    world.node.wait()
    world.processes.remove(world.node)
    client.until(lambda: at_rest(feedback))
    names = list(feedback[-1].message.name)
    for name, (speed, acceleration) in PACES.items():
        commands = played(setpoints, name)
        assert_no_step(commands, speed, acceleration)
        # The last message alone: exactly within the limits.
        stop = [position for time, position in commands if time > 2.0 / RATE]
        accelerations = rates_of_change(rates_of_change(stop))
        assert max(map(abs, accelerations)) <= 1.01 * acceleration
        assert max(map(abs, rates_of_change(accelerations))) <= 1.01 * JERK
        last = ros.course_of(setpoints, name)[-1].position
        rest = feedback[-1].message.position[names.index(name)]
        most = speed * (HORIZON + PERIOD) + speed**2 / (2 * acceleration)
        most += speed * acceleration / (2 * JERK)
        assert 0.8 * most < rest - last <= most
