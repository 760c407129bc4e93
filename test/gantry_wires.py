# SPDX-License-Identifier: Apache-2.0
"""The wires between a node and its simulated gantry, a process: what goes wrong on one side.

The plant's target node is `PLANT`, and it publishes its feedback on `TRUE_FEEDBACK`. This process
passes on what the sides tell, and what they are told. Sides are called as their topics are: ``y``
and ``y/y2``. What is wrong comes as JSON on `BREAK`, and is told on `BROKEN` once it is so:

- ``stuck``: the level of switches that never change, by side and input;
- ``late``: how late the feedback of a side is, s; its stamps are true;
- ``late_switches``: how late the switches of a side are, s, which have no stamps;
- ``bounces``: sides whose home switch bounces;
- ``frozen``: sides whose encoder stands still; ``inverted``: whose encoder counts the wrong way;
- ``pulses_from``: before which place the pulses of a side are lost;
- ``motors``, ``encoders``: which side gets the commands of a side, and whose feedback it has;
- ``deaf``: sides that get no commands; ``stops``: how far a side can go;
- ``tripped``: sides whose drive goes off by itself.
"""

import heapq
import json
import os
import signal
import sys
import time
from contextlib import suppress
from itertools import count

import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, String
from trajectory_msgs.msg import JointTrajectory

PLANT, NODE = '/plant', '/homing_node'
TRUE_FEEDBACK, BREAK, BROKEN = '/wires/joint_states', '/wires/break', '/wires/broken'
#: What makes a plant publish there.
PLANT_ARGUMENTS = ('-r', f'joint_states:={TRUE_FEEDBACK}')
SWITCHES = 'home_switch', 'positive_limit_switch', 'negative_limit_switch'
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: The joint of each side.
JOINTS = {'y': 'y1_joint', 'y/y2': 'y2_joint'}
SIDES = {joint: side for side, joint in JOINTS.items()}
#: When a contact that bounces is open or closed again, s.
BOUNCES = 0.001, 0.0015, 0.0025, 0.003
NOTHING = {
    'stuck': {},
    'late': {},
    'late_switches': {},
    'bounces': [],
    'frozen': [],
    'inverted': [],
    'pulses_from': {},
    'motors': {},
    'encoders': {},
    'deaf': [],
    'stops': {},
    'tripped': [],
}


class Wires:
    """Passes messages on; they stay bytes where nothing is wrong with them."""

    def __init__(self, node):
        self._node, self._takes = node, []
        self._due, self._order = [], count()
        self._places, self._held = b'', {}  # the newest feedback; where encoders went wrong
        self._levels, self._readers = {}, {}
        self._wrong = NOTHING
        publish = node.create_publisher
        self._told = publish(String, BROKEN, LATCHED)
        self._feedback = publish(JointState, '/joint_states', 100)
        self._setpoints = publish(JointTrajectory, f'{PLANT}/setpoints', 100)
        self._servo = {side: publish(Bool, f'{PLANT}/{side}/servo_on', LATCHED) for side in JOINTS}
        self._outputs = {}
        for side in JOINTS:
            for name in (*SWITCHES, 'servo_enabled', 'z_pulse'):
                self._connect(side, name, Float64 if name == 'z_pulse' else Bool)
            topic = f'{NODE}/{side}/servo_on'
            self._listen(Bool, topic, LATCHED, self._servo[side].publish)
        self._listen(JointState, TRUE_FEEDBACK, 100, self._take_feedback)
        self._listen(JointTrajectory, f'{NODE}/setpoints', 100, self._take_setpoints)
        self._listen(String, BREAK, LATCHED, self._break)

    def run(self, stopped):
        """Pass on what comes until `stopped()`."""
        turn = 0
        while not stopped():
            time.sleep(0.0003)
            for take, use in self._takes:
                while (taken := take()) is not None:
                    use(bytes(taken[0]))
            while self._due and self._due[0][0] <= time.monotonic():
                _, _, publisher, data = heapq.heappop(self._due)
                publisher.publish(data)
            turn += 1
            if turn % 100 == 0:
                self._greet()

    def _listen(self, kind, topic, qos, use):
        subscription = self._node.create_subscription(kind, topic, lambda _: None, qos)
        handle = subscription.handle
        self._takes.append((lambda: handle.take_message(kind, True), use))

    def _connect(self, side, name, kind):
        qos = 100 if kind is Float64 else LATCHED
        publisher = self._node.create_publisher(kind, f'{NODE}/{side}/{name}', qos)
        self._outputs[side, name] = publisher
        self._readers[side, name] = 0

        def take(data):
            wrong = self._wrong
            message = deserialize_message(data, kind)
            if kind is Float64:
                if message.data < wrong['pulses_from'].get(side, -1e300):
                    return
            else:
                self._levels[side, name] = message.data
                message.data = wrong['stuck'].get(f'{side}/{name}', message.data)
            late = wrong['late_switches'].get(side, 0.0)
            self._after(late, publisher, message)
            if name == 'home_switch' and side in wrong['bounces']:
                for number, after in enumerate(BOUNCES):
                    level = message.data is (number % 2 == 1)
                    self._after(late + after, publisher, Bool(data=level))

        self._listen(kind, f'{PLANT}/{side}/{name}', qos, take)

    def _after(self, late, publisher, message):
        if late:
            due = time.monotonic() + late
            heapq.heappush(self._due, (due, next(self._order), publisher, message))
        else:
            publisher.publish(message)

    def _break(self, data):
        before, text = self._wrong, deserialize_message(data, String)
        self._due = []  # what is late is lost
        self._wrong = {**NOTHING, **json.loads(text.data)}
        for key, level in self._levels.items():
            name = '/'.join(key)
            now = self._wrong['stuck'].get(name, level)
            if now is not before['stuck'].get(name, level):
                self._outputs[key].publish(Bool(data=now))
        self._held = {}
        for side in self._wrong['frozen'] + self._wrong['inverted']:
            told = deserialize_message(self._places, JointState)
            self._held[side] = told.position[told.name.index(JOINTS[side])]
        for side in self._wrong['tripped']:
            self._servo[side].publish(Bool(data=False))
        self._told.publish(text)

    def _take_feedback(self, data):
        wrong, self._places = self._wrong, data
        if not (self._held or wrong['late'] or wrong['encoders']):
            self._feedback.publish(data)
            return
        message = deserialize_message(data, JointState)
        told = dict(zip(message.name, message.position, strict=True))
        apart = {}  # by lateness
        for joint, place in told.items():
            side = SIDES.get(joint)
            if side in wrong['encoders']:
                place = told[JOINTS[wrong['encoders'][side]]]
            if side in self._held:
                turned = side in wrong['inverted']
                place = 2.0 * self._held[side] - place if turned else self._held[side]
            apart.setdefault(wrong['late'].get(side, 0.0), {})[joint] = place
        for late, places in apart.items():
            one = JointState(name=list(places), position=list(places.values()))
            one.header.stamp = message.header.stamp
            self._after(late, self._feedback, serialize_message(one))

    def _take_setpoints(self, data):
        wrong = self._wrong
        if not (wrong['motors'] or wrong['deaf'] or wrong['stops']):
            self._setpoints.publish(data)
            return
        message = deserialize_message(data, JointTrajectory)
        sides = [SIDES[joint] for joint in message.joint_names]
        sides = [wrong['motors'].get(side, side) for side in sides]
        kept = [number for number, side in enumerate(sides) if side not in wrong['deaf']]
        sides = [sides[number] for number in kept]
        message.joint_names = [JOINTS[side] for side in sides]
        for point in message.points:
            for part in ('positions', 'velocities', 'accelerations'):
                values = getattr(point, part)
                setattr(point, part, [values[number] for number in kept])
            for number, side in enumerate(sides):
                stop = wrong['stops'].get(side)
                if stop is not None and point.positions[number] > stop:
                    point.positions[number] = stop
                    point.velocities[number] = point.accelerations[number] = 0.0
        if kept:
            self._setpoints.publish(message)

    def _greet(self):
        """Tell the levels again to a node that has come."""
        for key, publisher in self._outputs.items():
            readers = publisher.get_subscription_count()
            if readers > self._readers[key] and key in self._levels:
                level = self._wrong['stuck'].get('/'.join(key), self._levels[key])
                publisher.publish(Bool(data=level))
            self._readers[key] = readers


def main():
    """Pass messages on until a signal comes."""
    signals = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: signals.append(number))
    rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('wires', start_parameter_services=False)
    with suppress(OSError):  # for those who may
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    Wires(node).run(lambda: bool(signals))
    node.destroy_node()
    rclpy.try_shutdown()
    return 0
