# SPDX-License-Identifier: Apache-2.0
"""What goes wrong on one side of a gantry, between processes: each case by its name.

The names are those of research/ros_machines.md §5, "Nasty cases". The machine is a process of its
own, with a spring between its sides, and what it tells the node goes over wires that break
(gantry_wires.py). Skew and force are those of the machine, whatever the node believes.
"""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import gantry_wires
import pytest
import ros_harness as ros
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, String
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from homing_node.check.gantry import Gantry
from homing_node.parameters.configuration import configuration
from homing_node.plant.layout_reader import layouts_from
from homing_node.plant.timing import Timing
from homing_node.recording import reading

pytestmark = pytest.mark.long

#: N/m; where the follower's switches are, and how far the sides may be apart, m.
STIFFNESS, OFFSET, MAX_SKEW = 2e5, 0.0003, 0.002
VELOCITY = 0.05
#: A busy machine may see a skew so much later, s.
BUSY = 0.05
LEADER, FOLLOWER = 'y', 'y/y2'

LAYOUT = {**ros.LAYOUT, 'home_switch': [0.055, 0.07], 'switch_rate': 0.0}
OWN = {
    'home_switch': [0.055 + OFFSET, 0.07 + OFFSET],
    'positive_limit_switch': [0.08, 0.135],
    'negative_limit_switch': [-0.055, 0.0],
    'stiffness': STIFFNESS,
}
PLANT = {'y': {**LAYOUT, 'followers': ['y2'], **{f'y2.{key}': v for key, v in OWN.items()}}}
NODE = {
    'y': {
        **ros.AXIS,
        'joint': 'y1_joint',
        'switches': ['home_switch', *gantry_wires.SWITCHES[1:], 'servo_enabled', 'z_pulse'],
        'homing_velocity_fast': VELOCITY,
        'followers': ['y2'],
        'max_skew': MAX_SKEW,
        'switch_stamp_error': 0.004,
        'y2.joint': 'y2_joint',
        'y2.switch_offset': OFFSET,
    }
}


def flat(axes):
    return {
        f'{axis}.{key}': value for axis, values in axes.items() for key, value in values.items()
    }


@pytest.fixture(scope='module')
def machine(tmp_path_factory):
    parameters = ros.node_parameters(NODE)
    joints = {'y.joint': 'y1_joint', 'y.y2.joint': 'y2_joint'}
    plant = ros.plant_parameters(PLANT, target_node=gantry_wires.PLANT, **joints)
    folder = tmp_path_factory.mktemp('faults')
    with ros.World(
        folder, parameters, plant, plant_arguments=gantry_wires.PLANT_ARGUMENTS
    ) as world:
        world.parameters = parameters
        world.run('gantry_wires', {})
        world.client.watch(*world.processes)
        yield Machine(world)


class Machine:
    """The gantry y, its wires, and what is true of it."""

    def __init__(self, world):
        self.world, self.client = world, world.client
        checked = configuration({'axes': ['y'], **flat(NODE)})
        layout = layouts_from(PLANT)['y']
        check = Gantry('y', checked.axes['y'], checked.followers['y'], layout, Timing())
        self.most = check.most_skew(VELOCITY, layout) + VELOCITY * BUSY
        node = self.client.node
        self._breaks = node.create_publisher(String, gantry_wires.BREAK, gantry_wires.LATCHED)
        self._stop = node.create_publisher(Bool, self.client.name('emergency_stop'), 1)
        self._puts = node.create_publisher(JointTrajectory, f'{gantry_wires.PLANT}/setpoints', 1)

    def breaks(self, **wrong):
        """Let something be wrong from now on, and nothing else."""
        client, text = self.client, json.dumps(wrong)
        client.until(lambda: self._breaks.get_subscription_count() > 0, what='the wires')
        told = client.record(String, gantry_wires.BROKEN, gantry_wires.LATCHED)
        self._breaks.publish(String(data=text))
        client.until(lambda: told and told[-1].message.data == text, what=text)
        client.forget(told)
        heard = len(self.true)
        client.until(lambda: len(self.true) > heard + 10)

    def begin(self, start=0.045, skew=0.0):
        """Put both sides where the next run begins; nothing is wrong, and nothing is known."""
        client = self.client
        client.rest()
        self.true = client.record(JointState, gantry_wires.TRUE_FEEDBACK)
        client.until(lambda: self.true, what='a machine')
        self.breaks()
        self.states = client.record_states('y')
        for on in (False, True):
            assert client.servo('y', on).success
            client.until(lambda on=on: self.servos() == [on, on], what=f'servos {on}')
        self.put(start, start + skew)
        self.started = skew
        self.setpoints = client.record(JointTrajectory, 'setpoints')
        self.forces = client.record(Float64, '/simulated_axes/y/y2/racking_force')
        self.true.clear()

    def put(self, *places):
        """Move the sides slowly to where they shall be; the node is idle."""
        joints = list(gantry_wires.JOINTS.values())
        self.client.until(lambda: self._puts.get_subscription_count() > 0, what='a machine')
        points = [
            JointTrajectoryPoint(positions=list(where))
            for where in (places_of(self.true[-1].message), places)
        ]
        points[1].time_from_start.nanosec = 400_000_000
        self._puts.publish(JointTrajectory(joint_names=joints, points=points))
        self.client.until(
            lambda: places_of(self.true[-1].message) == pytest.approx(places, abs=2e-6),
            what=f'{places}',
        )

    def servos(self):
        """Return whether the drives of both sides are on, as the node has heard it."""
        if not self.states:
            return []
        state = self.states[-1].message
        levels = dict(zip(state.inputs, state.levels, strict=True))
        return [levels[name] == 1 for name in ('servo_enabled', 'y2.servo_enabled')]

    def change(self, values):
        """Set parameters of the axis; return what they were."""
        client = self.client
        before = {name: client.get(f'y.{name}')[0] for name in values}
        for name, value in values.items():
            result = client.set(**{f'y.{name}': value})
            assert result.successful, result.reason
        return before

    def emergency_stop(self, on):
        """Tell the node, once it listens."""
        self.client.until(lambda: self._stop.get_subscription_count() > 0)
        self._stop.publish(Bool(data=on))

    def home(self):
        return self.client.asking_to_home('y')

    def until(self, asking, state):
        """Wait until the gantry moves in a state."""

        def is_there():
            refusal = asking.answer()
            assert refusal is None, refusal.message
            return self.states and self.states[-1].message.state == state

        self.client.until(is_there, timeout=40.0, what=state)
        begun = len(self.setpoints)
        self.client.until(lambda: len(self.setpoints) > begun + 5 or asking.answer())

    def until_fast(self, asking):
        def is_fast():
            refusal = asking.answer()
            assert refusal is None, refusal.message
            samples = ros.course_of(self.setpoints[-5:], 'y1_joint')
            return samples and samples[-1].velocity > 0.99 * VELOCITY

        self.client.until(is_fast, what='motion')

    @property
    def skews(self):
        """How far the follower was ahead, truly."""
        return [skew_of(one.message) for one in self.true]

    def is_homed(self):
        return self.states[-1].message.homed

    def assert_square(self):
        """Check that the gantry is homed, truly square, and was not racked on its way."""
        client = self.client
        client.until(self.is_homed, what='a homed gantry')
        state = self.states[-1].message
        assert state.state == 'Idle'
        unsure = state.members[1].uncertainty
        assert unsure < 1e-4
        heard = len(self.true)
        client.until(lambda: len(self.true) > heard + 20)
        assert abs(self.skews[-1]) <= 5e-5 + unsure
        least = abs(self.started)
        assert max(map(abs, self.skews)) <= MAX_SKEW
        self.assert_force(max(least, 5e-4))
        self.assert_rests()

    def assert_bounded(self):
        """Check that the sides never racked more than the check of the configuration promises."""
        most = self.most + abs(self.started)
        assert max(map(abs, self.skews)) <= most
        self.assert_force(most)
        self.assert_rests()

    def assert_force(self, skew):
        assert self.forces
        worst = max(abs(one.message.data) for one in self.forces)
        assert worst <= STIFFNESS * skew * 1.05

    def assert_rests(self):
        """Check that no command comes any more, and that the sides come to rest."""
        client, heard = self.client, len(self.true)
        client.until(lambda: len(self.true) > heard + 10)  # what was on its way has come
        told = len(self.setpoints)

        def rest():
            newest = [places_of(one.message) for one in self.true[-60::10]]
            return newest[-1] == pytest.approx(newest[0], abs=1e-6)

        client.until(lambda: len(self.true) > heard + 80 and rest(), what='rest')
        assert len(self.setpoints) == told


def places_of(message):
    at = dict(zip(message.name, message.position, strict=True))
    return [at[joint] for joint in gantry_wires.JOINTS.values()]


def skew_of(message):
    leader, follower = places_of(message)
    return follower - leader


class Case(NamedTuple):
    """One thing that goes wrong.

    Attributes:
        wrong: What is wrong, as gantry_wires.py has it.
        error: How the run ends; '' if it ends well.
        says: What the message must say besides.
        when: Since when it is wrong: 'start', 'fast', or a state.
        start, skew: Where the sides stand at the start.
        changes: Parameters of the axis that are set for this case.
    """

    wrong: Mapping[str, Any] = MappingProxyType({})
    error: str = ''
    says: str = ''
    when: str = 'start'
    start: float = 0.045
    skew: float = 0.0008
    changes: Mapping[str, Any] = MappingProxyType({})


def stuck(side, level):
    return {'stuck': {f'{side}/home_switch': level}}


SWAPPED = {LEADER: FOLLOWER, FOLLOWER: LEADER}
MISSING, SKEWED = 'FollowerSwitchMissing', 'SkewTooLarge'
CASES = {
    'one switch dead, of the leader': Case(stuck(LEADER, False), MISSING, ' of y '),
    'one switch dead, of the follower': Case(stuck(FOLLOWER, False), MISSING, ' of y.y2 '),
    'one stuck on at start': Case(stuck(FOLLOWER, True), MISSING, ' of y.y2 '),
    'both on, then only one falls': Case(stuck(FOLLOWER, True), MISSING, ' of y.y2 ', start=0.057),
    'edges in the opposite order after a squaring': Case(
        {'late_switches': {FOLLOWER: 0.006}}, when='Squaring'
    ),
    "bounce on the follower right after the leader's edge": Case(
        {'bounces': [FOLLOWER]}, skew=0.0001
    ),
    "follower's cable swapped with the leader's, of the motors": Case(
        {'motors': SWAPPED}, 'NotSquare', 'gets worse in Squaring'
    ),
    "follower's cable swapped with the leader's, of the encoders": Case(
        {'encoders': SWAPPED}, 'NotSquare', 'gets worse in Squaring', skew=0.0005
    ),
    "follower's feedback frozen": Case({'frozen': [FOLLOWER]}, SKEWED, 'y.y2 is ', 'fast'),
    "leader's feedback frozen": Case({'frozen': [LEADER]}, SKEWED, 'y.y2 is ', 'fast'),
    "follower's feedback late by 50 ms": Case({'late': {FOLLOWER: 0.05}}, skew=0.0018),
    "leader's feedback late by 50 ms": Case({'late': {LEADER: 0.05}}, skew=-0.0018),
    "follower's switches late by 50 ms, which nobody tells": Case(
        {'late_switches': {FOLLOWER: 0.05}}, MISSING, ' of y.y2 '
    ),
    'one index a pitch away': Case(
        {'pulses_from': {FOLLOWER: 0.07}},
        'IndexAmbiguous',
        '1 x 0.01 m',
        changes={'home_type': 'HSZPulse', 'z_pulse_distance_check': 0.01},
    ),
    'one drive trips while squaring': Case(
        {'tripped': [FOLLOWER]}, 'ServoOff', 'y.y2', 'Squaring', skew=0.0018
    ),
    'one drive trips in motion': Case({'tripped': [FOLLOWER]}, 'ServoOff', 'y.y2', 'fast'),
    'limit of one side hit first because of racking': Case(start=0.074, skew=0.0018),
    'follower inverted': Case({'inverted': [FOLLOWER]}, SKEWED, 'inverted', skew=0.0),
    'command lost for one of two controllers, the follower': Case(
        {'deaf': [FOLLOWER]}, SKEWED, 'y.y2 is ', 'fast'
    ),
    'command lost for one of two controllers, the leader': Case(
        {'deaf': [LEADER]}, SKEWED, 'y.y2 is ', 'fast'
    ),
    'different travel of the two sides': Case({'stops': {FOLLOWER: 0.05}}, SKEWED),
}


@pytest.mark.parametrize('name', CASES)
def test_case(machine, name):
    case, client = CASES[name], machine.client
    machine.begin(case.start, case.skew)
    before = machine.change(case.changes)
    if case.when == 'start':
        machine.breaks(**case.wrong)
    asking = machine.home()
    if case.when == 'fast':
        machine.until_fast(asking)
        machine.breaks(**case.wrong)
    elif case.when != 'start':
        machine.until(asking, case.when)
        machine.breaks(**case.wrong)
    answer = client.until(asking.answer, 40.0, 'an answer')
    machine.change(before)
    if case.error:
        assert not answer.success
        assert answer.message.startswith(f'{case.error}: axis y: '), answer.message
        assert case.says in answer.message
        client.until(lambda: machine.states[-1].message.state == 'Idle')
        assert not machine.states[-1].message.homed
        machine.assert_bounded()
    else:
        assert answer.success, answer.message
        machine.assert_square()


# ----------------------------------------------------------------------- stops in every state

STATES = ['HSSearch', 'HSClearReverse', 'SecondHSSearch', 'HomeShift', 'Squaring', 'Proving']


@pytest.mark.parametrize('state', STATES)
@pytest.mark.parametrize('error', ['Canceled', 'EmergencyStop'])
def test_cancel_and_emergency_stop(machine, state, error):
    """All come to rest on their paths; afterwards the gantry homes square."""
    client = machine.client
    machine.begin(skew=0.0015)
    asking = machine.home()
    machine.until(asking, state)
    if error == 'Canceled':
        assert client.trigger('y/cancel').success
    else:
        machine.emergency_stop(True)
    answer = client.until(asking.answer, what='an answer')
    assert answer.message.startswith(f'{error}: axis y: '), answer.message
    client.until(lambda: machine.states[-1].message.state == 'Idle')
    assert not machine.states[-1].message.homed
    for joint in gantry_wires.JOINTS.values():
        samples = ros.course_of(machine.setpoints, joint)
        ros.assert_within_limits(samples, VELOCITY, 1.0, ros.AXIS['max_jerk'])
        assert samples[-1].velocity == samples[-1].acceleration == 0.0
    machine.assert_bounded()
    if error == 'EmergencyStop':
        machine.emergency_stop(False)


@pytest.mark.parametrize('state', STATES)
def test_node_killed(machine, state):
    """The sides come to rest by what they were told; the next node knows no home, and squares."""
    client, world = machine.client, machine.world
    machine.begin(skew=0.0015)
    asking = machine.home()
    machine.until(asking, state)
    world.processes.remove(world.node)
    client.watch(*world.processes)
    world.node.signal(signal.SIGKILL)
    world.node.wait()
    try:
        machine.assert_bounded()
    finally:  # the other tests need a node
        killed = machine.true[-1].sent
        world.node = world.run('homing_node', world.parameters)
        client.watch(*world.processes)
    client.until(lambda: machine.states[-1].sent > killed, what='a new node')
    assert not machine.states[-1].message.homed
    answer = client.home('y')['y']
    assert answer.success, answer.message
    machine.assert_square()


def test_skewed_at_rest_it_springs_back_when_a_servo_goes_off(machine):
    """The home is lost with the servo of one side, and the next run squares what is left."""
    client = machine.client
    machine.begin()
    assert client.home('y')['y'].success
    machine.assert_square()
    leader, _ = places_of(machine.true[-1].message)
    machine.put(leader, leader + 0.0019)
    machine.breaks(tripped=[FOLLOWER])
    client.until(lambda: not machine.states[-1].message.homed)
    state = machine.states[-1].message
    assert state.error == 'ServoOff' and 'y.y2' in state.message
    client.until(lambda: machine.servos() == [False, False], what='servos off')
    machine.assert_rests()
    assert abs(machine.skews[-1]) < 0.0005
    machine.breaks()
    assert client.servo('y', True).success
    client.until(lambda: machine.servos() == [True, True])
    assert client.home('y')['y'].success
    client.until(lambda: machine.states[-1].message.homed)


def test_records_have_both_sides(machine, tmp_path):
    """The node's own record, and what `homing record` has heard from outside."""
    machine.begin(skew=0.001)
    file = tmp_path / 'run.mcap'
    records = machine.world.folder / 'ros_home/homing/records'
    before = set(records.glob('*.Homed.mcap'))
    command = 'import sys; from homing_node.cli import main; sys.exit(main())'
    child = subprocess.Popen(
        [sys.executable, '-c', command, 'record', 'y', '-o', str(file)],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, 'ROS_DOMAIN_ID': str(machine.world.domain.number)},
    )
    try:
        assert child.stdout.readline() == 'waiting for a run of y of /homing_node\n'
        assert machine.client.home('y')['y'].success
        out, _ = child.communicate(timeout=ros.PATIENCE)
    finally:
        child.kill()
    assert (child.returncode, out) == (0, f'wrote {file}: y NoError\n')
    (own,) = machine.client.until(lambda: set(records.glob('*.Homed.mcap')) - before)
    for path in (own, file):
        course = reading.read(path).course
        other = course.followers['y.y2']
        assert len(other.samples) == len(course.samples) > 200
        assert max(abs(one.position - one.feedback) for one in other.samples) < 0.003
        for side, place in ((course, 0.055), (other, 0.055 + OFFSET)):
            edges = [one for one in side.happenings if one.input == 'home_switch']
            assert {one.value for one in edges[:2]} == {True, False}
            assert edges[0].position == pytest.approx(place, abs=0.003)
        ahead = [
            one.feedback - leader.feedback
            for one, leader in zip(other.samples, course.samples, strict=True)
        ]
        assert ahead[0] == pytest.approx(0.001, abs=1e-4)
        assert ahead[-1] == pytest.approx(0.0, abs=1e-4)
