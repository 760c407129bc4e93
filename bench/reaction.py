# SPDX-License-Identifier: Apache-2.0
"""Reaction: a switch is published → the first setpoint that decelerates.

Both times are time stamps: before the switch is published, and the middleware's of the setpoint.
The counterpart answers the switch by a setpoint in its subscription's callback.
"""

import random
import time
from collections.abc import Callable
from statistics import median

from core import ENDLESS
from figures import Figure, nth
from graph import Heard, World
from std_msgs.msg import Bool

RATE = 250.0
#: Where in a message a change of the plan shows first: setpoint_lead and a period, ns.
AHEAD = 12_000_000
FEEDBACK_RATE = 500.0


def answered(world: World, decelerates: Callable[[Heard], bool]) -> float:
    """Publish the home switch and return how long it takes until a setpoint decelerates, ms."""
    time.sleep(random.uniform(0.0, 0.02))
    world.heard()
    switch = world.switches['a0', 'home_switch']
    sent = time.time()
    switch.publish(Bool(data=True))
    found: list[Heard] = []

    def look() -> bool:
        found.extend(one for one in world.heard() if decelerates(one))
        return bool(found)

    world.until(look, 'a setpoint that decelerates')
    return (found[0].sent - sent) * 1e3


def motion(one: Heard) -> tuple[float, float]:
    """Return the velocity and the acceleration that a message tells for a lead and a period."""
    point = next(p for p in one.message.points if p.time_from_start.nanosec >= AHEAD)
    return point.velocities[0], point.accelerations[0]


def cruises(one: Heard) -> bool:
    velocity, acceleration = motion(one)
    return velocity > 0.999 * ENDLESS['homing_velocity_fast'] and abs(acceleration) < 1e-6


def of_node(trials: int) -> list[float]:
    """Let the axis search, answer and stop, again and again."""
    world = World(1, FEEDBACK_RATE, raw=False)
    found = []
    try:
        with world.homing_node(RATE):
            for _ in range(trials):
                world.start_homing()
                world.until(lambda: any(cruises(one) for one in world.heard()), 'cruise')
                found.append(answered(world, lambda one: motion(one)[1] < -1e-6))
                world.ask('cancel')
                world.switches['a0', 'home_switch'].publish(Bool(data=False))
                world.listen(0.05)  # until the node has heard that
    finally:
        world.close()
    return found


def of_bare(trials: int) -> list[float]:
    """Let a callback answer."""
    world = World(1, FEEDBACK_RATE, raw=False)
    switch = world.switches['a0', 'home_switch']
    try:
        with world.running('bare_answer.py'):
            world.until(switch.get_subscription_count, 'a reader')
            time.sleep(0.5)  # for its publisher to be found, too
            return [answered(world, lambda _: True) for _ in range(trials)]
    finally:
        world.close()


def figures(quick: bool = False) -> list[Figure]:
    """Give the reaction's distribution over the trials."""
    trials = 3 if quick else 100
    ours, bare = of_node(trials), of_bare(trials)
    more, period = median(ours) - median(bare), 1e3 / RATE
    return [
        Figure(
            f'reaction at {RATE:g} Hz', 'ms', ours, bare, f'≤ {period:g} ms more', more <= period
        ),
        Figure('p99', 'ms', [nth(ours, 0.99)], [nth(bare, 0.99)]),
    ]
