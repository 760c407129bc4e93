# SPDX-License-Identifier: Apache-2.0
"""Relay: joint states in raw coordinates → the same in homed coordinates.

From the stamp of the source, taken before it publishes, to the arrival of the relayed message; 8
joints at 500 Hz. The latency that is added is that without the latency of the source's own
message. Bare are two processes that pass the bytes on: a loop that polls, and an executor's
callback.
"""

import time
from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from operator import attrgetter
from typing import Any, NamedTuple

import rclpy
from core import ENDLESS
from figures import Figure, alternately, nth, within
from graph import World
from sensor_msgs.msg import JointState

JOINTS, RATE = 8, 500.0
RELAY, POLLS, CALLBACK = 'homed_axes', 'a bare loop that polls', 'a bare callback'
SETTLE = 1.5  # s


class Latency(NamedTuple):
    """Added latency in µs, and how many messages were lost or out of order."""

    p50: float
    p99: float
    max: float
    lost: float


def latency(what: str, duration: float) -> Latency:
    """Run one process and listen to it for a while."""
    world = World(JOINTS, RATE)
    try:
        with running(world, what):
            return listen(world, duration)
    finally:
        world.close()


def running(world: World, what: str) -> Any:
    if what == POLLS:
        return world.running('bare_relay.py', '--poll')
    if what == CALLBACK:
        return world.running('bare_relay.py')
    file = world.folder / 'relay.yaml'
    lines = ['/**:', '  ros__parameters:', f'    axes: {world.names}']
    for name in world.names:
        values = {**ENDLESS, 'apply': 'relay', 'home_offset': 0.1, 'feedback_timeout': 5.0}
        lines += [f'    {name}:', *(f'      {key}: {value}' for key, value in values.items())]
    file.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    return world.running('start_relay.py', '--ros-args', '--params-file', str(file))


def listen(world: World, duration: float) -> Latency:
    """Return how much later the relayed messages arrive than those of the source."""
    node = rclpy.create_node(
        'ears', context=world.context, enable_rosout=False, start_parameter_services=False
    )
    topics = 'joint_states', 'homed_axes/joint_states'
    ears = [node.create_subscription(JointState, t, print, 5000, raw=True) for t in topics]
    heard: list[list[tuple[bytes, int]]] = [[], []]

    def drain() -> None:
        for ear, found in zip(ears, heard, strict=True):
            while (taken := ear.handle.take_message(JointState, True)) is not None:
                data, info = taken
                found.append((bytes(data[4:12]), info['received_timestamp']))

    def pass_time(seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            drain()
            time.sleep(0.02)

    world.until(lambda: (drain(), heard[1])[1], 'relayed messages')
    pass_time(SETTLE)
    first = heard[0][-1][0]
    pass_time(duration)
    node.destroy_node()
    direct = dict(heard[0])
    sent, relayed = ([stamp for stamp, _ in found] for found in heard)
    sent, relayed = sent[sent.index(first) :], relayed[relayed.index(first) :]
    lost = missed(sent, relayed)
    added = [(at - direct[stamp]) * 1e-3 for stamp, at in heard[1][-len(relayed) :]]
    return Latency(nth(added, 0.5), nth(added, 0.99), max(added), lost)


def missed(sent: list[bytes], relayed: list[bytes]) -> int:
    """Return how many messages are missing up to the last relayed one, or come out of order."""
    place = {stamp: number for number, stamp in enumerate(sent)}
    places = [place[stamp] for stamp in relayed if stamp in place]
    return places[-1] + 1 - len(set(places)) + sum(b <= a for a, b in pairwise(places))


def figures(quick: bool = False, seconds: float = 0.0) -> Iterator[Figure]:
    """Yield the added latency of the relay beside bare ones, and what was lost.

    ``seconds``: how long each process is listened to in all; 0: as long as is usual.
    """
    duration, repeats = (0.5, 1) if quick else (0.5 * seconds, 2) if seconds else (10.0, 5)
    ours, polls, callback = alternately(
        repeats,
        *(partial(latency, what, duration) for what in (RELAY, POLLS, CALLBACK)),
        warm_up=False,
    )
    for name in 'p50', 'p99', 'max':
        of = attrgetter(name)
        mine, bare = [*map(of, ours)], [*map(of, polls)]
        what = f'added latency {name}, beside {POLLS}'
        yield (
            within(what, 'µs', mine, bare, 1.3)
            if name == 'p99'
            else Figure(what, 'µs', mine, bare)
        )
        yield Figure(f'added latency {name}, beside {CALLBACK}', 'µs', mine, [*map(of, callback)])
    lost = [one.lost for one in ours]
    count = f'of {RATE * duration:g}'
    yield Figure(
        'lost or out of order', count, lost, [one.lost for one in polls], '0', not any(lost)
    )
