# SPDX-License-Identifier: Apache-2.0
"""Inputs from messages of any type: what a message costs, and what the node uses at rest.

A message has 8 groups of 16 values (control_msgs/DynamicInterfaceGroupValues, from the interfaces
for tests). The counterpart of reading it is rclpy's own reception as an object, from the same
queue. At rest, 55 inputs of 8 axes come from one such message at 500 Hz, or from a Bool each.
"""

import random
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from itertools import pairwise
from pathlib import Path
from threading import Event, Thread
from typing import Any

from control_msgs.msg import DynamicInterfaceGroupValues, InterfaceValue
from figures import Figure, within
from graph import EXECUTABLE, World, cpu_seconds, parameters
from rclpy.serialization import serialize_message
from std_msgs.msg import Bool

from homing_node.core.axis import Axis
from homing_node.parameters.axis import axis_parameters
from homing_node.parameters.connections import connections
from homing_node.procedures.states import Input
from homing_node.ros.inputs import Inputs
from homing_node.ros.subscriptions import Subscriptions, qos
from homing_node.ros.timebase import TimeBase

GROUPS, VALUES, AXES, INPUTS = 8, 16, 8, 55
TOPIC = '/gpio_controller/gpio_states'
#: The inputs of an axis that have a level.
LEVELS = [str(one) for one in Input if 'switch' in one]
#: What is published before it is read.
BATCH = 50
RATE = 500.0  # Hz


def wired() -> list[tuple[str, str, str]]:
    """Return axis, input and interface of each input."""
    places = [f'module_{group}/d_input.{n}' for n in range(VALUES) for group in range(GROUPS)]
    inputs = [(f'a{axis}', level) for axis in range(AXES) for level in LEVELS]
    return [(*one, place) for one, place in zip(inputs[:INPUTS], places, strict=False)]


def messages(shuffled: bool, number: int) -> list[bytes]:
    """Return messages; ``shuffled``: with the groups in another order in each.

    No input changes, but the last value of each group, which no input reads, is another in each.
    """
    found, names = [], [f'module_{group}' for group in range(GROUPS)]
    for count in range(number):
        if shuffled:
            random.Random(count).shuffle(names)
        message = DynamicInterfaceGroupValues(
            interface_groups=names,
            interface_values=[
                InterfaceValue(
                    interface_names=[f'd_input.{n}' for n in range(VALUES)],
                    values=[0.0] * (VALUES - 1) + [0.1 * count],
                )
                for _ in names
            ],
        )
        message.header.stamp.sec = 1 + count
        found.append(serialize_message(message))
    return found


class Reception:
    """A topic that is published and read in one process: as an object, or by the node's inputs."""

    def __init__(self, world: World, inputs: Sequence[tuple[str, str, str]]) -> None:
        self._world = world
        by_axis: dict[str, dict[str, object]] = {}
        for axis, name, place in inputs:
            by_axis.setdefault(axis, {})[f'topics.{name}'] = f'{TOPIC}#{place}'
        axes = {
            axis: Axis(
                axis,
                axis_parameters(
                    {
                        'home_type': 'CurrentPos',
                        'travel': 1.0,
                        'switches': [name.partition('.')[2] for name in topics],
                        'near_ls_type': 'Dec',
                        'external_ls_type': 'Dec',
                    }
                ),
                0.004,
            )
            for axis, topics in by_axis.items()
        }
        graph = Subscriptions(world.node)
        self._inputs = Inputs(
            axes,
            {axis: axis for axis in axes},
            TimeBase(),
            graph,
            lambda _: '',
            nullcontext(),  # type: ignore[arg-type]
        )
        for axis, topics in by_axis.items():
            types = {name.replace('topics', 'types'): KIND for name in topics}
            found, faults = connections({**topics, **types})
            assert not faults, faults
            self._inputs.wire(axis, found)
        kind = DynamicInterfaceGroupValues
        self._bare = graph.subscribe(kind, TOPIC, qos())
        self._publisher = world.node.create_publisher(kind, TOPIC, BATCH)
        world.until(lambda: self._publisher.get_subscription_count() == 2, TOPIC)

    def times(self, batch: Sequence[bytes]) -> tuple[float, float]:
        """Publish a batch; return how long ours takes for a message, and how long rclpy, µs."""
        for message in batch:
            self._publisher.publish(message)
        time.sleep(0.05)
        begin = time.thread_time()
        self._inputs.poll()
        middle = time.thread_time()
        taken = 0
        while self._bare.handle.take_message(DynamicInterfaceGroupValues, False) is not None:
            taken += 1
        end = time.thread_time()
        assert taken == len(batch), taken
        return (middle - begin) / taken * 1e6, (end - middle) / taken * 1e6


KIND = 'control_msgs/msg/DynamicInterfaceGroupValues'


def reception(quick: bool) -> Iterator[Figure]:
    """Yield the cost of a message, for some numbers of inputs."""
    repeats = 3 if quick else 40
    for number in (3, INPUTS):
        world = World(0, 0.0)
        try:
            received = Reception(world, wired()[:number])
            for shuffled in (False, True):
                batch = messages(shuffled, BATCH)
                received.times(batch)
                ours, bare = zip(*(received.times(batch) for _ in range(repeats)), strict=True)
                order = 'in another order each time' if shuffled else 'in one order'
                what = f'a message of {GROUPS} × {VALUES} values, groups {order}, {number} inputs'
                yield within(what, 'µs', ours, bare, 1.5)
        finally:
            world.close()


def at_rest(world: World, by_message: bool) -> str:
    """Return the parameters of a node with all inputs, as YAML."""
    lines = parameters(AXES, 250.0).splitlines()
    found = []
    for line in lines:
        found.append(line)
        axis = line.strip().rstrip(':')
        if axis in world.names:
            names = [name for one, name, _ in wired() if one == axis]
            found += ['      near_ls_type: Dec', '      external_ls_type: Dec']
            found.append(f'      switches: [{", ".join(names)}]')
            if by_message:
                found.append('      topics:')
                found += [
                    f"        {name}: '{TOPIC}#{place}'"
                    for one, name, place in wired()
                    if one == axis
                ]
    return '\n'.join(found) + '\n'


def feed(world: World, ended: Event) -> None:
    """Publish the message at RATE, with its true stamp."""
    node = world.node
    publisher = node.create_publisher(DynamicInterfaceGroupValues, TOPIC, 10)
    data = bytearray(messages(False, 1)[0])
    due = time.monotonic()
    while not ended.is_set():
        due += 1.0 / RATE
        time.sleep(max(0.0, due - time.monotonic()))
        seconds, nanoseconds = divmod(time.time_ns(), 1_000_000_000)
        data[4:8] = seconds.to_bytes(4, sys.byteorder)
        data[8:12] = nanoseconds.to_bytes(4, sys.byteorder)
        publisher.publish(bytes(data))


def processor(duration: float, times: int) -> tuple[list[float], list[float]]:
    """Return the share of a core of a node fed by messages, and of one with a Bool each, %."""
    worlds = [World(AXES, 500.0), World(AXES, 500.0)]
    ended = Event()
    feeder = Thread(target=feed, args=(worlds[0], ended))
    bools = [
        worlds[1].node.create_publisher(Bool, f'/homing_node/{axis}/{name}', 10)
        for axis, name, _ in wired()
        if (axis, name) not in worlds[1].switches
    ]
    used: list[list[float]] = []
    try:
        feeder.start()
        runs = []
        for world, by_message in zip(worlds, (True, False), strict=True):
            file = Path(world.folder) / 'parameters.yaml'
            file.write_text(at_rest(world, by_message))
            run: Any = world.running(str(EXECUTABLE), '--ros-args', '--params-file', str(file))
            runs.append((run, run.__enter__()))
        worlds[0].until(lambda: worlds[0].node.count_subscribers(TOPIC), TOPIC)
        for publisher in [*bools, *worlds[1].switches.values()]:
            worlds[1].until(publisher.get_subscription_count, publisher.topic_name)
            publisher.publish(Bool(data=False))
        time.sleep(3.0)
        used.append([cpu_seconds(child.pid) for _, child in runs])
        for _ in range(times):
            time.sleep(duration)
            used.append([cpu_seconds(child.pid) for _, child in runs])
        for run, _ in runs:
            run.__exit__(None, None, None)
    finally:
        ended.set()
        feeder.join()
        for world in worlds:
            world.close()
    ours, bare = (
        [100.0 * (after - before) / duration for before, after in pairwise(one)]
        for one in zip(*used, strict=True)
    )
    return ours, bare


def figures(quick: bool = False) -> Iterator[Figure]:
    """Yield what a message costs, and what 55 inputs cost at rest."""
    yield from reception(quick)
    ours, bare = processor(0.5 if quick else 1.0, 2 if quick else 20)
    what = f'{INPUTS} inputs of {AXES} axes at rest, from one message at {RATE:g} Hz, against Bool'
    yield within(what, '% of a core', ours, bare, 1.0)
